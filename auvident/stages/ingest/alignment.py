"""Signs and clocks of the sensors against each other, from the motion itself."""

from dataclasses import dataclass, replace

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_QUANTITY
from auvident.schema.logs import Alignment, RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.held import held_rudder
from auvident.stages.ingest.response import Relation, Signals, fit_relation, shifted, smooth_records
from auvident.stages.ingest.signs import (
    AHEAD_S,
    SURE_STDS,
    RudderSign,
    evidence,
    judge_rudder,
    refuse_elevator_sign,
    refuse_heading,
    refuse_rudder_sign,
    sign_findings,
)

MAX_LAG_S = 2.0  # scanned either way; sensors of one log that differ by more are seen at once
STEERING = {q: BY_QUANTITY[q].column for q in ("u", "v", "r", "rudder")}
PITCHING = {q: BY_QUANTITY[q].column for q in ("u", "q", "elevator", "pitch")}
EITHER_WAY_S = (-MAX_LAG_S, MAX_LAG_S)
LAG_LIMITS_S = {  # beyond what effects of the sea and of actuators pass for
    "rudder": 0.6,  # to the gyro: a servo and a bus take up to half a second
    "dvl": 0.5,  # behind the gyro: a current of 0.2 m/s passes for 0.3 s
    "attitude": 0.1,  # behind the gyro: pure kinematics, one step of a 10 Hz grid
}
MIN_EXPLAINED = 0.3  # of the variance: below it the relation says nothing about a lag
MAX_LAG_STD_S = 0.5  # a lag known no better is not worth telling
# The relations leave out couplings (added mass, cross-flow) that pass for a lag: in sample and
# basin trials up to a tenth of the time in which the vehicle travels its length.
MODEL_LAG_LENGTHS = 0.1
# The sign is judged at lags of a rudder that acts on the vehicle; at negative ones a helm that
# answers to the yaw rate would count as a rudder of the opposite sign.
CAUSAL_LAGS_S = (0.0, 0.6)
SLOW_SHARE = 0.3  # of the 90 % quantile of the speed: below it a rudder has no grip
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


def check_alignment(raw: RawTrial, trial: Trial, vehicle: Vehicle) -> Aligned:
    """Signs of rudder and heading, lags between rudder, gyro, DVL and heading.

    Nothing is corrected: `diagnose` decides what a lag is due to.

    Raises
    ------
    InputError
        When the rudder's sign contradicts the vehicle file, or heading and gyro disagree in
        sign or unit.
    """
    if not set(STEERING.values()) <= set(trial.table.columns):
        return Aligned((), {}, ())
    records = smooth_records(trial, STEERING, MAX_LAG_S)
    grip, passage = _grip(records), _passage_s(records, vehicle)
    sign = _rudder_to_gyro(records, grip, CAUSAL_LAGS_S)
    pitching = _elevator_to_gyro(trial, CAUSAL_LAGS_S)
    heading = _gyro_to_heading(trial)
    refuse_heading(raw, heading)
    held = held_rudder(trial, vehicle.hull.length_m, grip)
    either_way = _rudder_to_gyro(records, grip, EITHER_WAY_S)
    judged = judge_rudder(vehicle, sign, either_way, held)
    refuse_rudder_sign(raw, vehicle, judged)
    refuse_elevator_sign(raw, vehicle, pitching, _elevator_to_gyro(trial, EITHER_WAY_S))
    rudder = _told(either_way, passage)
    dvl = _told(_gyro_to_dvl(records, grip, vehicle, rudder.lag_s if rudder else 0.0), passage)
    pairs = (("rudder", "gyro", rudder), ("gyro", "dvl", dvl))
    lags = [_alignment(*pair) for pair in (*pairs, ("gyro", "attitude", _told(heading, 0.0)))]
    told = tuple(lag for lag in lags if lag is not None)
    findings = [
        *_lag_findings(raw, told),
        *sign_findings(raw, sign, judged),
    ]
    checks = evidence(sign, held, pitching, heading)
    return Aligned(told, checks, tuple(findings), heading, sign, judged)


def _told(found: Relation | None, passage_s: float) -> Relation | None:
    """A relation whose lag is worth telling, what it leaves out counted in its uncertainty."""
    if found is None or found.explained < MIN_EXPLAINED or found.at_edge:
        return None
    std = float(np.hypot(found.lag_std_s, MODEL_LAG_LENGTHS * passage_s))
    return replace(found, lag_std_s=std) if std <= MAX_LAG_STD_S else None


def _passage_s(records: list[Signals], vehicle: Vehicle) -> float:
    """Time in s in which the vehicle travels its length at the median of its speeds."""
    if not records:
        return np.inf
    speed = np.concatenate([signals["u"] for signals in records])
    return vehicle.hull.length_m / max(float(np.median(speed)), MIN_SPEED_MPS)


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


def _gyro_to_dvl(
    records: list[Signals], grip: float, vehicle: Vehicle, rudder_lag_s: float
) -> Relation | None:
    """Sway of the DVL from yaw rate and rudder, both as they were a lag ago.

    v = v_D - x_D r and dv/dt = a u v + b u r + c u^2 d + e u^2. The lever arm is known; left
    free, it could stand in for the lag. What Y_rdot adds to dv/dt shifts the lag by a few
    hundredths of a second.
    """
    arm = vehicle.dvl.x_m

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        r, u = shifted(s, "r", lag), s["u"]
        rudder = shifted(s, "rudder", lag + rudder_lag_s)
        y = s["v_dot"] - arm * shifted(s, "r_dot", lag)
        return y, np.column_stack((u * (s["v"] - arm * r), u * r, u**2 * rudder, u**2))

    return fit_relation(records, relation, EITHER_WAY_S, lambda s: s["u"] > grip)


def _alignment(first: str, second: str, found: Relation | None) -> Alignment | None:
    if found is None:
        return None
    return Alignment(
        first=first,
        second=second,
        lag_s=found.lag_s,
        std_s=found.lag_std_s,
        explained=found.explained,
    )


def _lag_findings(raw: RawTrial, lags: tuple[Alignment, ...]) -> list[Finding]:
    found = []
    for lag in lags:
        limit = LAG_LIMITS_S["rudder" if lag.first == "rudder" else lag.second]
        limit = AHEAD_S if lag.first == "rudder" and lag.lag_s < 0 else limit
        if abs(lag.lag_s) > max(limit, SURE_STDS * lag.std_s):
            found.append(
                Finding(
                    code=f"{lag.second}_lags_{lag.first}",
                    message=f"{lag.second} lags {lag.first} by {lag.lag_s:.2f} s "
                    f"(std {lag.std_s:.2f} s)",
                    where=f"trial {raw.name}",
                    value=lag.lag_s,
                    threshold=limit,
                    remedy="If the clocks are offset, set time_offset_s in a map (--map); "
                    "nothing was corrected.",
                )
            )
    return found
