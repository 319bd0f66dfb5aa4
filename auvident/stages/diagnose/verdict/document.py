"""From the evidence of a diagnosis to its verdict and its artifact."""

from collections.abc import Collection, Sequence
from typing import Any

from auvident.schema.artifacts import IdentifiedModel, Verdict
from auvident.schema.confirmed import is_confirmed, leaning
from auvident.schema.diagnosis import Candidate, Diagnosis, EffectFound, Refused
from auvident.schema.likeness import separated_by
from auvident.schema.loop_statements import (
    DOUBTS,
    LEANS,
    NOT_CONFIRMED,
    fits_better,
    remaining_of,
    statement,
)
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.select.healthy import share_of_healthy
from auvident.stages.diagnose.select.rules import LEAST_GAIN
from auvident.stages.diagnose.verdict.candidates import candidate_rows
from auvident.stages.diagnose.verdict.carried import carried
from auvident.stages.diagnose.verdict.checks import checks, correlate
from auvident.stages.diagnose.verdict.effects import accepted, disturbances, nuisances
from auvident.stages.diagnose.verdict.evidence import (
    Evidence,
    closest_of,
    mattering,
    nearest_of,
    remainders,
    verdict_of,
)
from auvident.stages.diagnose.verdict.observability import (
    detectable,
    detectable_push,
    lookalikes,
)
from auvident.stages.diagnose.verdict.residuals import residual_rows
from auvident.stages.diagnose.verdict.taken_up import coefficient_findings

WITH_REMAINDER: tuple[Verdict, ...] = ("unexplained", "partly_explained")


def diagnosis_of(evidence: Evidence, model: IdentifiedModel) -> Diagnosis:
    """The artifact of a diagnosis."""
    traced, joint = evidence.traced, evidence.traced.rounds[0].joint
    claimed, rows = accepted(traced), candidate_rows(traced.rounds, traced.case)
    unsure = [e.id for e in claimed if not is_confirmed(e)]
    leans = leaning(claimed, unsure, rows)
    doubted = [e for e in claimed if e.id in (*unsure, *leans)]
    effects = [*disturbances(evidence), *(e for e in claimed if e not in doubted)]
    rest, rest_before = (
        remainders(traced.case, fitted, model.length_m)
        for fitted in (traced.final, traced.baseline)
    )
    # what only an effect in doubt takes away is there still
    left = mattering(rest if effects or not doubted else rest_before)
    nearest = nearest_of(evidence)
    named = {e.id for e in effects}
    groups = tuple(r.alike for r in traced.rounds if r.alike and r.accepted in named)
    verdict = verdict_of(effects, evidence, left, nearest, groups)
    pushes = detectable_push(evidence.least_push, traced.case.plane)
    last = traced.rounds[-1]
    sees = (*detectable(joint, last.joint, evidence.candidates, last.tried), *pushes)
    alike = [e for g in groups for e in g]
    by = separated_by(alike, traced.case.plane.name) if groups else ""
    closest = nearest if effects else nearest or _listed(doubted) or closest_of(evidence)
    unexplained = _remainder(evidence, left, closest) if verdict in WITH_REMAINDER else {}
    sizes = [r.as_told() for r in rest]
    remaining = remaining_of(verdict, unexplained, sizes, None if doubted else closest)
    said = statement(verdict, effects, groups, by, sees, unexplained, remaining)
    return Diagnosis(
        plane=model.plane,
        verdict=verdict,
        statement=f"{said} {fits_better(doubted, leans)}".strip(),
        effects=tuple(effects),
        not_confirmed=tuple(doubted),
        candidates=tuple(_doubting(rows, unsure, leans)),
        ambiguous=groups,
        unexplained=unexplained,
        remaining=remaining,
        without_effects=verdict_of((), evidence, mattering(rest_before), None, ()),
        sees=sees,
        lookalikes=lookalikes(joint, evidence.candidates),
        separate_by=by,
        nuisance=nuisances(traced),
        carried=carried(traced),
        steps=traced.steps,
        residuals=tuple(residual_rows(traced)),
        checks=checks(evidence),
        missing=evidence.missing,
        false_alarm_p=_false_alarm_p(traced, effects),
        identify_maneuvers=tuple(r.id for r in traced.case.records),
        findings=tuple(coefficient_findings(traced)),
    )


def _remainder(evidence: Evidence, left: Sequence[str], nearest: str | None) -> dict[str, Any]:
    """What is left, and what it follows: forces that an effect would be asked for, each once."""
    tried = [f for f in (evidence.rival, *evidence.free) if f is not None]
    forces = {(f.axis, f.regressor): f for f in reversed(tried) if f.gain >= LEAST_GAIN}
    return {
        "correlates": [correlate(evidence.traced.case, f) for f in reversed(forces.values())],
        "nearest": nearest,
        "channels": list(left),
    }


def _listed(effects: Sequence[EffectFound]) -> str:
    return ", ".join(e.id for e in effects)


def _doubting(
    rows: Sequence[Candidate], unsure: Collection[str], leans: Collection[str]
) -> list[Candidate]:
    """Candidates with what became of those that are not confirmed."""
    codes = dict.fromkeys(unsure, NOT_CONFIRMED) | dict.fromkeys(leans, LEANS)
    return [_doubting_of(c, codes.get(c.id, "")) if not c.rejected else c for c in rows]


def _doubting_of(row: Candidate, code: str) -> Candidate:
    update = {"rejected": DOUBTS[code], "refusal": Refused(code=code)} if code else {}
    return row.model_copy(update=update)


def _false_alarm_p(traced: Traced, effects: Sequence[EffectFound]) -> float | None:
    """How often a search finds as much by chance as the first effect named; None without one."""
    named = {e.id for e in effects}
    first = next((r for r in traced.rounds if r.accepted in named), None)
    if first is None:
        return None
    helped = next(t for t in first.tried if t.id == first.accepted).account.helped
    return share_of_healthy(helped.strength) if helped else None
