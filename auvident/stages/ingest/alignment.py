"""Signs and clocks of the sensors against each other, from the motion itself."""

from dataclasses import dataclass, replace

import numpy as np

from auvident.errors import InputError
from auvident.schema.artifacts import Finding
from auvident.schema.logs import DEG, Alignment, RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.response import Relation, Signals, fit_relation, shifted, smooth_records

MAX_LAG_S = 2.0  # scanned either way; sensors of one log that differ by more are seen at once
HORIZONTAL = {"u": "u_mps", "v": "v_mps", "r": "r_radps", "rudder": "rudder_rad"}
VERTICAL = {"u": "u_mps", "q": "q_radps", "elevator": "elevator_rad", "pitch": "pitch_rad"}
EITHER_WAY_S = (-MAX_LAG_S, MAX_LAG_S)
LAG_LIMIT_S = 0.3  # between sensors: three steps of a 10 Hz model, an error of tens of per cent
RUDDER_LIMIT_S = 0.6  # rudder to gyro: a servo and a bus take up to half a second
MIN_EXPLAINED = 0.3  # of the variance: below it the relation says nothing about a lag
SURE_STDS = 3.0  # standard deviations beyond which a lag is not chance
MAX_LAG_STD_S = 0.5  # a lag known no better is not worth telling
# The relations leave out couplings (added mass, cross-flow) that pass for a lag: in sample and
# basin trials up to a tenth of the time in which the vehicle travels its length.
MODEL_LAG_LENGTHS = 0.1
# The sign is judged at lags of a rudder that acts on the vehicle; at negative ones a helm that
# answers to the yaw rate would count as a rudder of the opposite sign.
CAUSAL_LAGS_S = (0.0, 0.6)
SLOW_SHARE = 0.3  # of the 90 % quantile of the speed: below it a rudder has no grip
MIN_SPEED_MPS = 0.1
SIGN_STDS = 4.0  # a refusal needs more than a warning: four jackknife standard deviations,
SIGN_SHARE = 0.2  # a fifth of the variance of the yaw acceleration due to the rudder alone,
SIGN_EXPLAINED = 0.4  # and a relation that explains a fair part of it; true ones exceed 0.85
GAIN_LIMIT = 0.1  # gyro against heading: no gyro has a scale error of 10 %
UNIT_LIMIT = 0.25  # relative distance from a ratio of units that counts as that ratio


@dataclass(frozen=True)
class Aligned:
    """What the motion says about signs and clocks."""

    alignment: tuple[Alignment, ...]
    checks: dict[str, dict[str, float]]
    findings: tuple[Finding, ...]


def check_alignment(raw: RawTrial, trial: Trial, vehicle: Vehicle) -> Aligned:
    """Signs of rudder and heading, lags between rudder, gyro, DVL and heading.

    Nothing is corrected: `diagnose` decides what a lag is due to.

    Raises
    ------
    InputError
        When the rudder's sign contradicts the vehicle file, or heading and gyro disagree in
        sign or unit.
    """
    if not set(HORIZONTAL.values()) <= set(trial.table.columns):
        return Aligned((), {}, ())
    records = smooth_records(trial, HORIZONTAL, MAX_LAG_S)
    grip, passage = _grip(records), _passage_s(records, vehicle)
    sign = _rudder_to_gyro(records, grip, CAUSAL_LAGS_S)
    pitching = _elevator_to_gyro(trial)
    heading = _gyro_to_heading(trial)
    _refuse_heading(raw, heading)
    _refuse_sign(raw, vehicle, "rudder", sign)
    _refuse_sign(raw, vehicle, "elevator", pitching)
    rudder = _told(_rudder_to_gyro(records, grip, EITHER_WAY_S), passage)
    dvl = _told(_gyro_to_dvl(records, grip, vehicle, rudder.lag_s if rudder else 0.0), passage)
    pairs = (("rudder", "gyro", rudder), ("gyro", "dvl", dvl))
    lags = [_alignment(*pair) for pair in (*pairs, ("gyro", "attitude", _told(heading, 0.0)))]
    told = tuple(lag for lag in lags if lag is not None)
    findings = [*_lag_findings(raw, told), *_sign_findings(raw, sign), *_gain(raw, heading)]
    return Aligned(told, _evidence(sign, pitching, heading), tuple(findings))


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


def _elevator_to_gyro(trial: Trial) -> Relation | None:
    """Pitch acceleration from elevator, pitch rate, the righting moment and a trim."""
    columns = {name: c for name, c in VERTICAL.items() if c in trial.table}
    if not {"u", "q", "elevator"} <= set(columns):
        return None
    records = smooth_records(trial, columns, MAX_LAG_S)
    grip = _grip(records)

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        x = [s["u"] ** 2 * shifted(s, "elevator", lag), s["u"] * s["q"], s["u"] ** 2]
        x += [s["pitch"]] if "pitch" in s else []
        return s["q_dot"], np.column_stack(x)

    return fit_relation(records, relation, CAUSAL_LAGS_S, lambda s: s["u"] > grip)


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


def _in_stds(found: Relation) -> float:
    """Leading coefficient in its standard deviations; 0 when it was never excited."""
    return float(found.theta[0] / max(found.theta_std[0], np.finfo(float).tiny))


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


def _evidence(
    sign: Relation | None, pitching: Relation | None, heading: Relation | None
) -> dict[str, dict[str, float]]:
    """Responses to the internal rudder and elevator (negative as they should be), heading gain."""
    checks = {}
    for name, found in (("rudder_sign", sign), ("elevator_sign", pitching)):
        if found is not None:
            checks[name] = {
                "response_1pm2": float(found.theta[0]),
                "std": float(found.theta_std[0]),
                "share": float(found.alone[0]),
                "explained": float(found.explained),
            }
    if heading is not None:
        gain, std = float(heading.theta[0]), float(heading.theta_std[0])
        checks["heading_over_gyro"] = {"gain": gain, "std": std}
    return checks


def _refuse_sign(raw: RawTrial, vehicle: Vehicle, fin: str, found: Relation | None) -> None:
    """Refuse a log whose rudder or elevator works the other way than the vehicle file says."""
    if found is None or found.explained < SIGN_EXPLAINED or found.alone[0] < SIGN_SHARE:
        return
    if _in_stds(found) <= SIGN_STDS:
        return
    key, ways, rate = {
        "rudder": ("rudder_positive_turns", ("port", "starboard"), "r"),
        "elevator": ("elevator_positive_pitches", ("down", "up"), "q"),
    }[fin]
    said = str(getattr(vehicle.signs, key))
    other = ways[1] if said == ways[0] else ways[0]
    sensor = raw.sensors[fin]
    column = sensor.columns[f"{fin}_rad"]
    raise InputError(
        f"the log's {fin} sign contradicts [signs] {key} = {said!r}: a positive {column} turns "
        f"the bow {other} (its share of the acceleration is {100 * found.alone[0]:.0f} %, "
        f"{_in_stds(found):.0f} standard deviations from zero)",
        f"{sensor.file}, column {column}",
        f"Say {key} = {other!r} in the vehicle file, or sign = -1 for the column in a map "
        f"(--map); if it is the gyro that counts the other way, give {rate} the sign -1.",
    )


def _refuse_heading(raw: RawTrial, found: Relation | None) -> None:
    if found is None:
        return
    gain, std = float(found.theta[0]), float(found.theta_std[0])
    if found.explained < SIGN_EXPLAINED or abs(gain) < SIGN_STDS * std:
        return
    gyro, attitude = raw.sensors["gyro"], raw.sensors["attitude"]
    names = (
        f"{attitude.columns['heading_rad']} changes at {gain:.3g} times {gyro.columns['r_radps']}"
    )
    where = f"{attitude.file} and {gyro.file}"
    if gain < 0:
        raise InputError(
            f"heading and yaw rate turn opposite ways: {names}",
            where,
            "Heading counts clockwise, r to starboard: give the wrong one sign = -1 in a map "
            "(--map), or leave the heading out.",
        )
    for ratio in (1.0 / DEG, DEG):
        if abs(gain / ratio - 1.0) < UNIT_LIMIT:
            raise InputError(
                f"heading and yaw rate are not in the units that they claim: {names}",
                where,
                "One of them is in degrees where it says rad, or the other way round.",
            )


def _gain(raw: RawTrial, found: Relation | None) -> list[Finding]:
    if found is None or found.explained < SIGN_EXPLAINED:
        return []
    gain, std = float(found.theta[0]), float(found.theta_std[0])
    if abs(gain - 1.0) <= GAIN_LIMIT + SURE_STDS * std:
        return []
    return [
        Finding(
            code="heading_gyro_gain",
            message=f"the heading changes at {gain:.2f} times the yaw rate",
            where=f"trial {raw.name}",
            value=gain,
            threshold=GAIN_LIMIT,
            remedy="Check units and scale of gyro and heading.",
        )
    ]


def _lag_findings(raw: RawTrial, lags: tuple[Alignment, ...]) -> list[Finding]:
    found = []
    for lag in lags:
        limit = RUDDER_LIMIT_S if lag.first == "rudder" and lag.lag_s > 0 else LAG_LIMIT_S
        if abs(lag.lag_s) > max(limit, SURE_STDS * lag.std_s):
            found.append(
                Finding(
                    code=f"{lag.second}_lags_{lag.first}",
                    message=f"{lag.second} lags {lag.first} by {lag.lag_s:.2f} s "
                    f"(std {lag.std_s:.2f} s)",
                    where=f"trial {raw.name}",
                    value=lag.lag_s,
                    threshold=limit,
                    remedy="If it is the clock, shift it by time_offset_s in a map (--map); "
                    "nothing was corrected.",
                )
            )
    return found


def _sign_findings(raw: RawTrial, found: Relation | None) -> list[Finding]:
    if found is not None and _in_stds(found) < -SURE_STDS:
        return []
    return [
        Finding(
            code="rudder_sign_unverified",
            message="the trial does not show which way a positive rudder turns the vehicle",
            where=f"trial {raw.name}",
            value=None if found is None else _in_stds(found),
            threshold=-SURE_STDS,
            remedy="Make sure that [signs] rudder_positive_turns is right.",
        )
    ]
