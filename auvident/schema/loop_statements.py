"""Verdicts of the residual loop in sentences, the same after `diagnose` and after `refine`."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from auvident.schema.artifacts import Verdict
from auvident.schema.confirmed import is_confirmed, told_of
from auvident.schema.diagnosis import Attempt, Detectable, EffectFound
from auvident.schema.effect_words import words_of
from auvident.schema.effects import BY_ID
from auvident.schema.likeness import nested

NAMED_EFFECTS = 4  # told in the statement that nothing was found
TOGETHER = ("one_off_event",)  # effects of which all sizes have to be exceeded, not one
# why an effect that was accepted is not claimed after all
NOT_ADDED, NOT_CONFIRMED, LEANS = "not-added", "not-confirmed", "leans"
DOUBTS = {
    NOT_ADDED: "a model with it does not predict the maneuvers used for identification better",
    NOT_CONFIRMED: "not confirmed: the interval of its size contains zero, or what it tells from "
    "zero is too small to matter",
    LEANS: "not confirmed: found beside a stronger effect that is not confirmed",
}


def statement(
    verdict: Verdict,
    effects: Sequence[EffectFound],
    groups: Sequence[Sequence[str]],
    separate_by: str,
    sees: Sequence[Detectable],
    unexplained: Mapping[str, Any],
    left: Mapping[str, Any],
) -> str:
    """The verdict in words.

    Parameters
    ----------
    verdict : str
    effects : sequence of EffectFound
        Those that stand.
    groups : sequence of sequence of str
        Effects that cannot be told apart.
    separate_by : str
        What would tell them apart.
    sees : sequence of Detectable
    unexplained : mapping
        As in the artifacts: ``correlates``, ``nearest``, ``channels``.
    left : mapping
        ``remaining`` of the artifacts: see `remaining_of`.
    """
    pieces = {
        "none_found": lambda: [
            nothing_found(sees),
            too_little(left.get("sizes", ())),
            too_weak(left.get("nearest")),
        ],
        "effect_found": lambda: [
            found(effects),
            alike([group for group in groups if not nested(group)], separate_by),
        ],
        "ambiguous": lambda: [found(effects), alike(groups, separate_by)],
        "partly_explained": lambda: [
            found(effects),
            alike(groups, separate_by),
            remaining(unexplained),
        ],
        "unexplained": lambda: [nothing_known(unexplained)],
    }[verdict]()
    return " ".join(piece for piece in pieces if piece)


def remaining_of(
    verdict: Verdict,
    unexplained: Mapping[str, Any],
    sizes: Sequence[Mapping[str, Any]],
    nearest: str | None = None,
) -> dict[str, Any]:
    """What ``remaining`` says: beside effects that stand, or too little to be anything.

    Parameters
    ----------
    verdict : str
    unexplained : mapping
    sizes : sequence of mapping
        ``channel``, ``noises`` (the residual over the noise of the sensor) and ``share`` (over the
        standard deviation of the channel) of what is more than a complete model leaves.
    nearest : str, optional
        The effect that came closest, where nothing was found.
    """
    if verdict == "none_found":
        nothing = {"channels": [], "correlates": [], "sizes": list(sizes), "nearest": nearest}
        return nothing if sizes or nearest else {}
    if verdict != "partly_explained":
        return {}
    named = {key: unexplained.get(key) or [] for key in ("channels", "correlates")}
    return {**named, "sizes": list(sizes)}


def too_weak(nearest: str | None) -> str:
    """The statement that the evidence for an effect was too weak; empty where there is none."""
    if not nearest:
        return ""
    return f"Closest came {words_of(nearest)}, on evidence too weak to claim it."


def too_little(sizes: Sequence[Mapping[str, Any]]) -> str:
    """The statement that a residual beyond the noise is too small to matter; empty without one."""
    told = [
        f"{row['channel']} is off by {row['noises']:.1f} times the noise of its sensor, "
        f"{row['share']:.1%} of its standard deviation"
        for row in sizes
    ]
    return f"What remains is too little to matter: {'; '.join(told)}." if told else ""


def nothing_found(sees: Sequence[Detectable]) -> str:
    """The statement that nothing is missing, with what would have been noticed."""
    text = "The model lacks nothing that these maneuvers would show."
    rows: dict[str, list[Detectable]] = {}
    for row in (row for row in sees if row.visible):
        rows.setdefault(row.id, []).append(row)
    sizes = {effect: [_least(row) for row in seen_last(own)] for effect, own in rows.items()}
    named = [
        f"{words_of(effect)} {(' and ' if effect in TOGETHER else ' or ').join(own)}"
        for effect, own in sizes.items()
    ]
    if not named:
        return text
    listed = "; ".join(named[:NAMED_EFFECTS])
    return f"{text} Among others, these would have been noticed: {listed}."


def seen_last(rows: Sequence[Detectable]) -> list[Detectable]:
    """Of one effect, the parameter of each unit that has to be furthest off to show.

    A limit shows from some size downwards.
    """
    last: dict[tuple[bool, str], Detectable] = {}
    for row in rows:
        key = (is_limit(row), row.unit)
        small, large = sorted((row, last.get(key, row)), key=lambda r: r.size)
        last[key] = small if is_limit(row) else large
    return list(last.values())


def is_limit(row: Detectable) -> bool:
    """Whether a parameter shows from some size downwards, everything else upwards."""
    declared = BY_ID[row.id].parameters if row.id in BY_ID else ()
    return any(p.form != "plain" for p in declared if p.symbol == row.symbol)


def _least(row: Detectable) -> str:
    """The size from which on an effect is noticed; a limit from there downwards."""
    unit = "" if row.unit == "-" else f" {row.unit}"
    return f"{'below' if is_limit(row) else 'above'} {row.size:.2g}{unit}"


def found(effects: Sequence[EffectFound]) -> str:
    """The statement of what was found."""
    return f"The model lacks {' and '.join(e.plain or e.id for e in effects)}."


def alike(groups: Sequence[Sequence[str]], separate_by: str) -> str:
    """What explains the data alike, and what would tell it apart; empty where nothing does."""
    if not groups:
        return ""
    listed = "; ".join(" and ".join(words_of(e) for e in group) for group in groups)
    return f"These data cannot tell apart {listed}. These maneuvers would: {separate_by}."


def remaining(unexplained: Mapping[str, Any]) -> str:
    """The statement that something is left beside what was found."""
    text = f"An unexplained residual remains{_where(unexplained)}"
    if unexplained.get("nearest"):
        closest, several = _closest(unexplained["nearest"])
        text += f"; of the known effects {closest}, but {'fit' if several else 'fits'} too badly"
    return text + "."


def _closest(nearest: str) -> tuple[str, bool]:
    """``hull_asymmetry comes closest``, and whether there are several."""
    several = "," in nearest
    return f"{nearest} {'come' if several else 'comes'} closest", several


def nothing_known(unexplained: Mapping[str, Any]) -> str:
    """The statement that something is there which no effect explains."""
    text = f"There is a residual that no known effect explains{_where(unexplained)}"
    if unexplained.get("nearest"):
        closest, several = _closest(unexplained["nearest"])
        text += f"; {closest}, but {'are' if several else 'is'} not confirmed"
    return text + "."


def _where(unexplained: Mapping[str, Any]) -> str:
    """Channels in which something is left, and what it follows."""
    channels, text = unexplained.get("channels"), ""
    if channels:
        text += f" in {', '.join(channels)}"
    first = next(iter(unexplained.get("correlates") or ()), None)
    if first and largest_fall(first) >= LEAST_FALL:
        text += f"; {follows(first)}"
    return text


LATE = "delayed "
LEAST_FALL = 0.02  # of a residual: what takes less off it explains nothing of it
NAMED = ("rate", "heading", "rudder", "elevator", "yaw", "pitch")  # words, no formulas
# force or moment on an axis, in words
FORCES = {
    "X": "axial force",
    "Y": "side force",
    "Z": "normal force",
    "K": "roll moment",
    "M": "pitch moment",
    "N": "yaw moment",
}


def largest_fall(correlate: Mapping[str, Any]) -> float:
    """Share by which a force lowers the residual of the channel that it lowers most."""
    return max(correlate.get("rms_fall", {}).values(), default=0.0)


def follows(correlate: Mapping[str, Any]) -> str:
    """What an unexplained force follows: "the remaining side force follows the rudder, late"."""
    axis = str(correlate.get("axis", ""))
    force = f"the remaining {FORCES.get(axis, 'force')}"
    return f"{force} follows {_with_article(str(correlate['regressor']))}"


def _with_article(regressor: str) -> str:
    """A regressor as a sentence names it; formulas as they are."""
    if regressor.startswith(LATE):
        return f"{_with_article(regressor.removeprefix(LATE))} with a delay"
    named = regressor.startswith(NAMED) or regressor == "roll"
    return f"the {regressor}" if named else regressor


def not_added(refused: Attempt) -> str:
    """The statement that a model with what was found is no better, so that nothing was added."""
    ratios = refused.left_out or refused.ratios
    which = ", each left out in turn" if refused.left_out else ""
    why = "diverges in them" if refused.ran_away else f"changes their errors by {changes(ratios)}"
    why = f"could not be identified ({refused.failed})" if refused.failed else why
    return (
        f"No effect was added, because none improves the prediction of the maneuvers used for "
        f"identification{which}: a model with {' and '.join(refused.effects)} {why}. "
        "The identified model is kept."
    )


def changes(ratios: Mapping[str, float]) -> str:
    """Changes of some errors, as ``u -30 %, r +2 %``, from what they are over those before."""
    return ", ".join(f"{c} {100.0 * (ratio - 1.0):+.0f} %" for c, ratio in ratios.items())


def also_refused(effects: Sequence[EffectFound]) -> str:
    """The statement that only a part of what was found was added; empty where all was."""
    if not effects:
        return ""
    listed = " and ".join(words_of(e.id) for e in effects)
    them = "it" if len(effects) == 1 else "them"
    return (
        f"Not added: {listed}, because with {them} the prediction of the maneuvers used for "
        "identification is no better."
    )


def shown_by_sensors(effects: Sequence[EffectFound]) -> str:
    """The statement that logs alone show what is not in the model; empty where they do not."""
    if not effects:
        return ""
    listed = " and ".join(words_of(e.id) for e in effects)
    return f"Logs held against each other show the {listed}, whatever the model."


def not_confirmed(effects: Sequence[EffectFound], leaning: Collection[str] = ()) -> str:
    """What a model predicts with although it is not confirmed; empty for nothing.

    ``leaning`` are those found beside a stronger one that is not, see `confirmed.leaning`.
    """
    return _unconfirmed("Used for prediction", effects, leaning)


def fits_better(effects: Sequence[EffectFound], leaning: Collection[str] = ()) -> str:
    """What a diagnosis fits better with although it is not confirmed; ``leaning`` as there."""
    return _unconfirmed("Fits the data better", effects, leaning)


def _unconfirmed(serves: str, effects: Sequence[EffectFound], leaning: Collection[str]) -> str:
    leans = [e for e in effects if e.id in leaning]
    small = [e for e in effects if told_of(e) and not is_confirmed(e) and e not in leans]
    zero = [e for e in effects if told_of(e) == [] and e not in leans]
    before = [e for e in effects if e not in (*leans, *small, *zero)]
    contain = "its interval contains" if len(zero) == 1 else "the intervals contain"
    found = "it was" if len(leans) == 1 else "they were"
    whys = (
        (zero, f"{contain} zero"),
        (small, "what is told from zero is too small to matter"),
        (before, "the diagnosis does not tell a size that matters from zero"),
        (leans, f"{found} found beside a stronger effect that is not confirmed"),
    )
    return " ".join(
        f"{serves}, but not confirmed because {why}: {' and '.join(e.plain or e.id for e in some)}."
        for some, why in whys
        if some
    )
