"""Signs of rudder, elevator and heading against the gyro, from the motion itself; and clocks."""

from dataclasses import dataclass

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_QUANTITY
from auvident.schema.logs import Alignment, CheckMade, RawTrial
from auvident.schema.planes import VERTICAL
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clocks import check_clocks, refuse_clocks
from auvident.stages.ingest.held import Votes, held_fin, held_steps
from auvident.stages.ingest.response import (
    SLOW_SHARE,
    Relation,
    Signals,
    fit_relation,
    shifted,
    smooth_records,
)
from auvident.stages.ingest.signs import (
    RudderSign,
    evidence,
    judge_rudder,
    refuse_elevator_sign,
    refuse_heading,
    refuse_rudder_sign,
    sign_findings,
)

MAX_LAG_S = 2.0  # scanned either way for the signs; clocks have a scan of their own
STEERING = {q: BY_QUANTITY[q].column for q in ("u", "v", "r", "rudder")}
PITCHING = {q: BY_QUANTITY[q].column for q in ("u", "q", "elevator", "pitch")}
EITHER_WAY_S = (-MAX_LAG_S, MAX_LAG_S)
# The sign is judged at lags of a rudder that acts on the vehicle; at negative ones a helm that
# answers to the yaw rate would count as a rudder of the opposite sign.
CAUSAL_LAGS_S = (0.0, 0.6)
MIN_SPEED_MPS = 0.1


@dataclass(frozen=True)
class Aligned:
    """What the motion says about signs and clocks."""

    alignment: tuple[Alignment, ...]
    checks: dict[str, dict[str, float]]
    findings: tuple[Finding, ...]
    heading: Relation | None = None
    rudder: Relation | None = None
    sign: RudderSign | None = None
    elevator: int = 0
    checks_made: tuple[CheckMade, ...] = ()


def check_alignment(raw: RawTrial, trial: Trial, vehicle: Vehicle) -> Aligned:
    """Signs of rudder and heading, clocks of all sensors against the gyro's.

    Nothing is corrected.

    Raises
    ------
    InputError
        When a clock is seconds off, the rudder's sign contradicts the vehicle file, or heading
        and gyro disagree in sign or unit.
    """
    if not set(STEERING.values()) <= set(trial.table.columns):
        return Aligned((), {}, ())
    clocks = check_clocks(raw, trial, vehicle)
    refuse_clocks(raw, vehicle, trial, clocks)
    records = smooth_records(trial, STEERING, MAX_LAG_S)
    grip = _grip(records)
    sign = _rudder_to_gyro(records, grip, CAUSAL_LAGS_S)
    pitching = _elevator_to_gyro(trial, CAUSAL_LAGS_S)
    heading = _gyro_to_heading(trial)
    refuse_heading(raw, heading)
    held = held_fin(trial, vehicle.hull.length_m, grip)
    either_way = _rudder_to_gyro(records, grip, EITHER_WAY_S)
    judged = judge_rudder(vehicle, sign, either_way, held)
    refuse_rudder_sign(raw, vehicle, judged)
    elevator = _held_elevator(trial, vehicle, grip)
    untested = refuse_elevator_sign(
        raw,
        vehicle,
        pitching,
        _elevator_to_gyro(trial, EITHER_WAY_S),
        _elevator_steps(trial, vehicle, grip),
        elevator,
    )
    findings = [
        *clocks.findings,
        *sign_findings(raw, sign, judged),
    ]
    told = evidence(sign, held, pitching, heading, elevator)
    made = (*clocks.checks, *untested)
    return Aligned(
        clocks.alignment, told, tuple(findings), heading, sign, judged, elevator.sign, made
    )


def _grip(records: list[Signals]) -> float:
    """Speed in m/s above which rudder and hull forces dominate."""
    if not records:
        return MIN_SPEED_MPS
    speed = np.concatenate([signals["u"] for signals in records])
    return max(MIN_SPEED_MPS, SLOW_SHARE * float(np.quantile(speed, 0.9)))


def _rudder_to_gyro(
    records: list[Signals], grip: float, lags_s: tuple[float, float]
) -> Relation | None:
    """Yaw acceleration from rudder, yaw rate and a trim: dr/dt = a u r + b u^2 d + c u^2."""

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        rudder = shifted(s, "rudder", lag)
        return s["r_dot"], np.column_stack((s["u"] ** 2 * rudder, s["u"] * s["r"], s["u"] ** 2))

    return fit_relation(records, relation, lags_s, lambda s: s["u"] > grip)


def _elevator_to_gyro(trial: Trial, lags_s: tuple[float, float]) -> Relation | None:
    """Pitch acceleration from elevator, pitch rate, the righting moment and a trim."""
    columns = {name: c for name, c in PITCHING.items() if c in trial.table}
    if not {"u", "q", "elevator"} <= set(columns):
        return None
    records = smooth_records(trial, columns, MAX_LAG_S)
    grip = _grip(records)

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        x = [s["u"] ** 2 * shifted(s, "elevator", lag), s["u"] * s["q"], s["u"] ** 2]
        x += [s["pitch"]] if "pitch" in s else []
        return s["q_dot"], np.column_stack(x)

    return fit_relation(records, relation, lags_s, lambda s: s["u"] > grip)


def _elevator_steps(trial: Trial, vehicle: Vehicle, grip: float) -> int:
    column = PITCHING["elevator"]
    known = column in trial.table
    return held_steps(trial, column, vehicle.hull.length_m, grip) if known else 0


def _held_elevator(trial: Trial, vehicle: Vehicle, grip: float) -> Votes:
    """What the pitch rate does after steps of the elevator."""
    if not {PITCHING["q"], PITCHING["elevator"]} <= set(trial.table.columns):
        return Votes()
    return held_fin(trial, vehicle.hull.length_m, grip, VERTICAL).steps


def _gyro_to_heading(trial: Trial) -> Relation | None:
    """Rate of the heading from the gyro: d(psi)/dt = k r + c."""
    if "heading_rad" not in trial.table:
        return None
    columns = {"r": "r_radps", "heading": "heading_rad"}
    records = smooth_records(trial, columns, MAX_LAG_S)

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        rate = shifted(s, "r", lag)
        return s["heading_dot"], np.column_stack((rate, np.ones_like(rate)))

    return fit_relation(records, relation, EITHER_WAY_S, lambda s: np.ones(s["r"].size, dtype=bool))
