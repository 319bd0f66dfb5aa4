"""Signs and units of rudder, elevator and heading against the gyro: refused or noted."""

import numpy as np

from auvident.errors import InputError
from auvident.schema.artifacts import Finding
from auvident.schema.logs import DEG, RawTrial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.response import Relation

SURE_STDS = 3.0  # standard deviations beyond which a figure is not chance
SIGN_STDS = 4.0  # a refusal needs more than a warning: four jackknife standard deviations,
SIGN_SHARE = 0.2  # a fifth of the variance of the yaw acceleration due to the rudder alone,
SIGN_EXPLAINED = 0.4  # and a relation that explains a fair part of it; true ones exceed 0.85
# Angular acceleration over u^2 / L^2 and angle: 0.5 to 1.3 for torpedo and tanker alike; what is
# far below it is no fin's doing.
SIGN_RESPONSE = 0.1
GAIN_LIMIT = 0.1  # gyro against heading: no gyro has a scale error of 10 %
UNIT_LIMIT = 0.25  # relative distance from a ratio of units that counts as that ratio


def evidence(
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


def refuse_sign(raw: RawTrial, vehicle: Vehicle, fin: str, found: Relation | None) -> None:
    """Refuse a log whose rudder or elevator works the other way than the vehicle file says."""
    if found is None or found.explained < SIGN_EXPLAINED or found.alone[0] < SIGN_SHARE:
        return
    response = float(found.theta[0]) * vehicle.hull.length_m**2
    if _in_stds(found) <= SIGN_STDS or response < SIGN_RESPONSE:
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


def refuse_heading(raw: RawTrial, found: Relation | None) -> None:
    """Refuse a heading that turns against the gyro or at 57 times its rate."""
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


def gain_findings(raw: RawTrial, found: Relation | None) -> list[Finding]:
    """Note a heading that changes at another rate than the gyro's."""
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


def sign_findings(raw: RawTrial, found: Relation | None) -> list[Finding]:
    """Note a trial that does not show the sign of its rudder."""
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


def _in_stds(found: Relation) -> float:
    """Leading coefficient in its standard deviations; 0 when it was never excited."""
    return float(found.theta[0] / max(found.theta_std[0], np.finfo(float).tiny))
