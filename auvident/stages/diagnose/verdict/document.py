"""From the evidence of a diagnosis to its verdict and its artifact."""

from collections.abc import Sequence
from typing import Any

from auvident.schema.artifacts import IdentifiedModel, Verdict
from auvident.schema.diagnosis import Diagnosis
from auvident.schema.likeness import separated_by
from auvident.schema.loop_statements import remaining_of, statement
from auvident.stages.diagnose.select.candidates import Traced
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
    effects = [*disturbances(evidence), *accepted(traced)]
    rest, rest_before = (
        remainders(traced.case, fitted, model.length_m)
        for fitted in (traced.final, traced.baseline)
    )
    left = mattering(rest)
    nearest = nearest_of(evidence)
    groups = tuple(r.alike for r in traced.rounds if r.alike and r.accepted in traced.named)
    verdict = verdict_of(effects, evidence, left, nearest, groups)
    pushes = detectable_push(evidence.least_push, traced.case.plane)
    last = traced.rounds[-1].joint
    sees = (*detectable(joint, last, evidence.candidates), *pushes)
    named = [e for g in groups for e in g]
    by = separated_by(named, traced.case.plane.name) if groups else ""
    closest = nearest if effects else nearest or closest_of(evidence)
    unexplained = _remainder(evidence, left, closest) if verdict in WITH_REMAINDER else {}
    remaining = remaining_of(verdict, unexplained, [r.as_told() for r in rest], closest)
    return Diagnosis(
        plane=model.plane,
        verdict=verdict,
        statement=statement(verdict, effects, groups, by, sees, unexplained, remaining),
        effects=tuple(effects),
        candidates=tuple(candidate_rows(traced.rounds, traced.case)),
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
        false_alarm_p=_false_alarm_p(traced),
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


def _false_alarm_p(traced: Traced) -> float | None:
    """How often a search finds as much by chance as the first effect named; None without one."""
    first = next((r for r in traced.rounds if r.accepted in traced.named), None)
    if first is None:
        return None
    named = next(t for t in first.tried if t.id == first.accepted)
    return named.account.helped.p if named.account.helped else None
