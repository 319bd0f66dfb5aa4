"""Which of the effects that were found stand: their sizes, and what they were found beside."""

import math
from collections.abc import Collection, Sequence

from auvident.schema.diagnosis import Candidate, EffectFound, ParameterValue
from auvident.schema.effects import BY_ID, parameter_of

# [practical sizes] An effect is worth its name where what is told of it from nothing comes to this.
# Of 390 effects claimed on retired odd seeds 18 had sizes that were told below a whole one: two
# lever arms of 0.11 and 0.25 that were none, sixteen of 0.41 and more, of which most were real.
LEAST_TOLD = 1.0 / 3.0
# Times the gain of another makes an effect clearly the stronger one. Claims beside one in doubt of
# 1.15, 1.5 and 5.2 times their gain were wrong (odd seeds 12309, 12979, 13271); one beside an equal
# was right (12893), and two beside weaker ones.
STRONGER = 1.1


def holds_nothing(effect: str, p: ParameterValue) -> bool:
    """Whether the 95 % interval of a parameter cannot be told from no effect at all."""
    if p.interval is None or f"{effect}.{p.symbol}" not in BY_ID[effect].names():
        return False
    # of an open interval, what its one end would be to both sides
    low, high = p.value - p.half, p.value + p.half
    if not p.bound and p.low is not None and p.high is not None:
        low, high = p.low, p.high
    return parameter_of(f"{effect}.{p.symbol}").holds_nothing(p.value, low, high)


def is_confirmed(effect: EffectFound) -> bool:
    """Whether sizes of an effect that matter are told from nothing; one without sizes always is."""
    told = told_of(effect)
    return told is None or (bool(told) and _matter(effect.id, told))


def told_of(effect: EffectFound) -> list[ParameterValue] | None:
    """Sizes of an effect that are told from nothing; None for one without sizes."""
    sizes = [
        p
        for p in effect.parameters
        if f"{effect.id}.{p.symbol}" in BY_ID[effect.id].names()
        and parameter_of(f"{effect.id}.{p.symbol}").practical > 0.0
    ]
    return [p for p in sizes if not holds_nothing(effect.id, p)] if sizes else None


def _matter(effect: str, told: Sequence[ParameterValue]) -> bool:
    """Whether what is told of an effect is worth a word by itself.

    An effect is large enough by all its sizes together. A lever arm of 0.1 m ahead that may as
    well be none and of 5 mm abeam that is sure (0.1 of what matters) is nothing to act on.
    """
    sizes = [_in_practical_sizes(effect, p) for p in told]
    return None in sizes or math.hypot(*(s for s in sizes if s is not None)) >= LEAST_TOLD


def _in_practical_sizes(effect: str, p: ParameterValue) -> float | None:
    if p.matters_from is None:
        return None
    declared = parameter_of(f"{effect}.{p.symbol}")
    return abs(declared.internal(p.value) / declared.internal(p.matters_from))


def leaning(
    effects: Sequence[EffectFound], unsure: Collection[str], candidates: Sequence[Candidate]
) -> set[str]:
    """Effects that were found beside a clearly stronger one which does not stand, or leans so.

    They explain what that one left over, and without it there is no telling what they would
    explain. What sensors show by themselves leans on nothing.

    Parameters
    ----------
    effects : sequence of EffectFound
        In the order in which they were found.
    unsure : collection of str
        Effects that do not stand by themselves.
    candidates : sequence of Candidate
        With what each was found beside, and its gain.
    """
    rows, fallen = {c.id: c for c in candidates}, set(unsure)
    for effect in effects:
        own = rows.get(effect.id)
        if own is None or effect.by_sensors:
            continue
        leaders = (rows[id_] for id_ in own.beside if id_ in fallen and id_ in rows)
        if any(leader.gain > STRONGER * own.gain for leader in leaders):
            fallen.add(effect.id)
    return fallen - set(unsure)
