"""What a refined model confirms of a diagnosis, in its own sizes."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from auvident.constants import NORMAL_95
from auvident.schema.artifacts import IdentifiedModel, Verdict
from auvident.schema.confirmed import is_confirmed, leaning
from auvident.schema.diagnosis import (
    Attempt,
    Candidate,
    CrossValidated,
    Diagnosis,
    EffectFound,
    ParameterValue,
    Refused,
    ends,
    keeps,
    left_outside,
)
from auvident.schema.effect_words import plain
from auvident.schema.effects import BY_ID, parameter_of
from auvident.schema.loop_statements import (
    DOUBTS,
    LEANS,
    NOT_ADDED,
    NOT_CONFIRMED,
    also_refused,
    found,
    not_added,
    not_confirmed,
    remaining_of,
    shown_by_sensors,
    statement,
)
from auvident.stages.refine.left_out import bettered


def claims_of(
    diagnosis: Diagnosis,
    after: IdentifiedModel,
    attempts: Sequence[Attempt],
    speed: float,
    rate: float,
    errors: CrossValidated | None = None,
) -> dict[str, Any]:
    """Verdict, statement and effects as the refined model has them, all in its sizes.

    An effect stands when some size of it is told from nothing, in the model that was taken. One
    that sensors held against each other show is a fact about the logs, whichever that model is.
    ``errors`` are those of the maneuvers left out in turn.
    """
    moving = [e.id for e in diagnosis.to_try if BY_ID[e.id].enters != "disturbance"]
    outside = left_outside(moving, attempts)
    final = [
        e if e.id in outside else _with_final_values(e, after, speed, rate)
        for e in diagnosis.to_try
    ]
    doubts = _doubts([e for e in final if e.id in moving], outside, diagnosis)
    doubted = [e for e in final if doubts.get(e.id)]
    leans = [id_ for id_, doubt in doubts.items() if doubt == LEANS]
    effects = tuple(e for e in final if e not in doubted)
    groups = tuple(g for g in diagnosis.ambiguous if {e.id for e in effects} & set(g))
    helped = bettered(attempts, errors) if doubted else ()
    verdict = _verdict(diagnosis, effects, groups, bool(doubted), helped)
    unexplained = {} if verdict == "none_found" else dict(diagnosis.unexplained)
    if doubted and verdict == "unexplained":
        unexplained["nearest"] = ", ".join(e.id for e in doubted)
        unexplained["channels"] = unexplained.get("channels") or list(helped)
    left = diagnosis.remaining
    remaining = remaining_of(verdict, unexplained, left.get("sizes", ()), left.get("nearest"))
    by, sees = diagnosis.separate_by, diagnosis.sees
    said = statement(verdict, effects, groups, by, sees, unexplained, remaining)
    candidates = (_final_candidate(c, final, doubts.get(c.id, "")) for c in diagnosis.candidates)
    return {
        "verdict": verdict,
        "statement": _with_doubts(said, effects, doubted, outside, leans, attempts),
        "effects": effects,
        "ambiguous": groups,
        "not_confirmed": tuple(e for e in doubted if e.id not in outside),
        "candidates": tuple(candidates),
        "unexplained": unexplained,
        "remaining": remaining,
    }


def _with_doubts(
    said: str,
    effects: Sequence[EffectFound],
    doubted: Sequence[EffectFound],
    outside: Collection[str],
    leans: Collection[str],
    attempts: Sequence[Attempt],
) -> str:
    """The statement with what became of the effects that are not claimed, or not in the model."""
    shown = shown_by_sensors([e for e in effects if e.id in outside])
    named = [a for a in attempts[1:] if not a.unclaimed]
    if keeps(attempts) and named:
        stands = said if not doubted else found(effects) if effects else ""
        return _joined(stands, shown, not_added(_refused(named)))
    unsure = [e for e in doubted if e.id not in outside]
    refused = [e for e in doubted if e.id in outside]
    return _joined(said, not_confirmed(unsure, leans), shown, also_refused(refused))


def _joined(*texts: str) -> str:
    return " ".join(text for text in texts if text)


def _refused(attempts: Sequence[Attempt]) -> Attempt:
    """The last attempt, if possible one that came to a model."""
    return next((a for a in reversed(attempts) if not a.failed), attempts[-1])


def _verdict(
    diagnosis: Diagnosis,
    effects: Sequence[EffectFound],
    groups: Sequence[Sequence[str]],
    doubted: bool,
    helped: Sequence[str],
) -> Verdict:
    """The verdict of the diagnosis with the effects that are left of it.

    Where none is left it hangs on what the model before leaves: an effect that is not told from
    nothing, and without which nothing that matters is unexplained, is nothing. Where it betters
    the prediction by what matters, something is there, by whatever name.
    """
    if not effects and doubted:
        return "unexplained" if helped else diagnosis.without_effects
    if effects and diagnosis.verdict == "ambiguous" and not groups:
        return "effect_found"
    return diagnosis.verdict


def _doubts(
    effects: Sequence[EffectFound], outside: Collection[str], diagnosis: Diagnosis
) -> dict[str, str]:
    """Why each effect is not claimed, by a code of `DOUBTS`; empty where it is.

    Parameters
    ----------
    outside : collection of str
        Effects that the model which was taken is without.
    """
    before = {c.id: c.refusal.code for c in diagnosis.candidates if c.refusal}
    unsure = {e.id: before.get(e.id, NOT_CONFIRMED) for e in diagnosis.not_confirmed}
    out = {e.id: _doubt(e, e.id in outside, unsure.get(e.id, "")) for e in effects}
    standing = [e for e in effects if not out[e.id]]
    fallen = [id_ for id_, doubt in out.items() if doubt]
    return out | dict.fromkeys(leaning(standing, fallen, diagnosis.candidates), LEANS)


def _doubt(effect: EffectFound, outside: bool, before: str) -> str:
    """Why an effect is not claimed by itself; ``before`` is why the diagnosis did not."""
    if outside:
        return "" if effect.by_sensors else NOT_ADDED
    return before or ("" if is_confirmed(effect) else NOT_CONFIRMED)


def _final_candidate(candidate: Candidate, effects: Sequence[EffectFound], doubt: str) -> Candidate:
    """A candidate with the size that the refined model ends at, where it has one."""
    final = next((e for e in effects if e.id == candidate.id), None)
    if final is None or candidate.rejected:
        return candidate
    update: dict[str, Any] = {"parameters": final.parameters}
    if doubt:
        update |= {"rejected": DOUBTS[doubt], "refusal": Refused(code=doubt)}
    return candidate.model_copy(update=update)


def _with_final_values(
    effect: EffectFound, after: IdentifiedModel, speed: float, rate: float
) -> EffectFound:
    """The effect with the values of the refined model.

    Its interval is the wider of the diagnosis' (from the scatter between maneuvers) and the
    filter's own.
    """
    rows = [row for row in after.effects if row["id"] == effect.id]
    if not rows:
        return effect
    final = {p["symbol"]: p for p in rows[0]["parameters"]}
    # a time is known to an interval, and not identified again
    declared = [parameter_of(f"{effect.id}.{p.symbol}") for p in effect.parameters]
    values = [
        p if d.grid else _final_value(p, final[p.symbol], d.known_to)
        for p, d in zip(effect.parameters, declared, strict=True)
    ]
    said = plain(effect.id, values, speed, rate, effect.frame)
    return effect.model_copy(update={"parameters": tuple(values), "plain": said})


def _final_value(p: ParameterValue, final: Mapping[str, Any], known_to: float) -> ParameterValue:
    """A parameter with the value of the refined model and the wider interval."""
    value = float(final["value"])
    std = max(float(final["std"]), p.std or 0.0)
    half = max(NORMAL_95 * std, p.half_of_fit(known_to))
    half = max(half, NORMAL_95 * abs(value - p.value))  # two methods that differ: say so
    return ParameterValue(
        symbol=p.symbol,
        value=value,
        std=half / NORMAL_95,
        unit=p.unit,
        bound=p.bound,
        matters_from=p.matters_from,
        **ends(value, half, p.bound, known_to),
    )
