"""How a command came out, for machines that do not read tables: cases, gates and findings.

The exit code is what the gates say. Beside it every stage, check, finding and gate is a case
that passed, failed, broke or was skipped, under the same names in every run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from auvident.schema.artifacts import ESTIMATE_CONTRADICTED, RAN_AWAY, Finding

CaseResult = Literal["passed", "failed", "error", "skipped"]
Severity = Literal["error", "warning", "note"]
# What makes the results wrong (error), or is a remark on the data that asks for nothing (note);
# every other finding is a warning.
SEVERITIES: dict[str, Severity] = {
    ESTIMATE_CONTRADICTED: "error",
    RAN_AWAY: "error",
    "log_refused": "error",
    "nothing_held_out": "error",
    "planes-disagree": "error",
    "plane-not-identified": "error",
    "as-since-change": "note",
    "ase_does_not_apply": "note",
    "assumed_propulsion_factor": "note",
    "assumed_section": "note",
    "channels_absent": "note",
    "coarse_time": "note",
    "columns_not_read": "note",
    "cut_by_gap": "note",
    "derived_channels": "note",
    "dvl_roll_removed": "note",
    "file_not_used": "note",
    "fixed": "note",
    "held_copies": "note",
    "held_out_along": "note",
    "input_logged_on_change": "note",
    "input_sampled": "note",
    "no-torque": "note",
    "own_outputs_left_out": "note",
    "plane-from-geometry": "note",
    "roll-from-geometry": "note",
    "small-changes": "note",
    "stage-skipped": "note",
    "torn_by_dropout": "note",
    "trials_overlap": "note",
}
ORDER: tuple[Severity, ...] = ("error", "warning", "note")


def severity(finding: Finding) -> Severity:
    """How much a finding matters."""
    return SEVERITIES.get(finding.code, "warning")


@dataclass(frozen=True)
class ResultCase:
    """One thing that was judged.

    Attributes
    ----------
    group : str
        ``command``, ``stages``, ``checks``, ``findings`` or ``gates``.
    name : str
        The same in every run of the same logs.
    message, text : str
        What to know of it, in one sentence and in several; empty where there is nothing.
    kind : str
        Of a failure: the gate, the class of the error, the code of the finding.
    """

    group: str
    name: str
    result: CaseResult = "passed"
    message: str = ""
    text: str = ""
    kind: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class GateResult:
    """One gate: the error of a channel against its limit; `unmet` says why it is not met."""

    channel: str
    limit: float | None
    value: float | None = None
    unit: str = ""
    of: str = ""
    unmet: str = ""


@dataclass(frozen=True)
class HeldOutError:
    """RMSE of a channel over all that was held out: from geometry, identified, refined."""

    channel: str
    unit: str
    geometry: float | None
    identified: float | None
    refined: float | None
    nrmse: float | None
    covered: float | None = None


@dataclass(frozen=True)
class PlaneOutcome:
    """What became of one plane: the verdict on what the model lacked, and the errors."""

    plane: str
    statement: str = ""
    maneuvers: Sequence[str] = ()
    errors: Sequence[HeldOutError] = ()
    effects: Sequence[str] = ()


@dataclass(frozen=True)
class CommandOutcome:
    """How a command came out.

    Attributes
    ----------
    command : str
        As it is typed, without options: ``auvident validate runs/demo``.
    problem, where, remedy : str
        Of the error that ended it; empty where none did.
    compared : sequence of mapping
        Several runs side by side, a table for each plane (`auvident.pipeline.compare`).
    """

    command: str
    vehicle: str = ""
    problem: str = ""
    where: str = ""
    remedy: str = ""
    exit_code: int = 0
    at: str = ""
    report: str = ""
    planes: Sequence[PlaneOutcome] = ()
    gates: Sequence[GateResult] = ()
    findings: Sequence[Finding] = ()
    cases: Sequence[ResultCase] = ()
    compared: Sequence[Mapping[str, Any]] = ()
