"""What a column of rpm may hold instead of a rate: the pulses or the per cent of a throttle."""

import numpy as np

from auvident.schema.quoting import quoted
from auvident.stages.ingest.checks.seen import MIN_SPEED_MPS, Seen

# Pulses of servos and speed controllers last 1000 to 2000 us; 1500, or the shortest, is rest.
PULSES_US, LONGEST_REST_US = (900.0, 2100.0), 1600.0
PULSES_SHARE, REST_SHARE = 0.99, 0.9  # of all rows, of those at rest
LEAST_STEP_US = 25.0  # from rest to what drives the vehicle: a rate that is held makes none
LEAST_ROWS = 50  # fewer are no evidence
LEAST_WINDOWS, LEAST_SPREAD = 4, 0.05  # steady speeds of several rates tell the rate of no speed
SURE_STDS = 3.0
MOST_PERCENT, MOST_SHARE = 100.5, 1.05  # of a full throttle, with some rounding

EXAMPLE_SCALE = 2  # rpm of 1 us, in the line of a map that is offered
PULSES_REMEDY = (
    "Log the rate of the propeller, or make one of the pulses under [rpm] in a map (--map), e.g. "
    'where 1 us is {scale} rpm: rpm = {{ column = "{column}", unit = "rpm", scale = {scale}, '
    "offset = {offset:.0f} }}. The offset is -scale times {rest:.0f}, the pulse at rest."
)
SHARE_REMEDY = (
    "State under [rpm] in a map (--map) what one of it is in rpm as scale, e.g. 12.5 rpm: "
    'rpm = {{ column = "{column}", unit = "percent", scale = 12.5 }}.'
)


def rest_us(seen: Seen) -> float | None:
    """The pulse at which the vehicle rests, where rpm is the length of pulses; else None.

    A propeller that turns at a thousand rpm and more drives the vehicle, and one at rest is at 0.
    """
    u, rpm = seen.columns("u_mps", "rpm")
    if u.size < LEAST_ROWS or _share_within(rpm, PULSES_US) < PULSES_SHARE:
        return None
    resting, driving = (rpm[rows] for rows in (np.abs(u) < MIN_SPEED_MPS, u > seen.way_mps))
    if resting.size < LEAST_ROWS or driving.size < LEAST_ROWS:
        return _rate_of_no_speed(seen)
    rest = float(np.median(resting))
    at_rest = _share_within(resting, (PULSES_US[0], LONGEST_REST_US)) >= REST_SHARE
    return rest if at_rest and abs(np.median(driving) - rest) > LEAST_STEP_US else None


def _share_within(values: np.ndarray, limits: tuple[float, float]) -> float:
    return float(np.mean((values >= limits[0]) & (values <= limits[1])))


def _rate_of_no_speed(seen: Seen) -> float | None:
    """Where the line of steady speeds over rpm meets zero, if it is surely that of a pulse."""
    rpm = np.array([60.0 * w.rate_rps for w in seen.windows])
    speed = np.array([w.speed_mps for w in seen.windows])
    if rpm.size < LEAST_WINDOWS or np.ptp(rpm) < LEAST_SPREAD * rpm.mean():
        return None
    x = np.column_stack((speed, np.ones_like(speed)))
    (slope, rest), *_ = np.linalg.lstsq(x, rpm, rcond=None)
    off = rpm - x @ (slope, rest)
    variance = float(off @ off) / (rpm.size - 2) * np.linalg.inv(x.T @ x)[1, 1]
    sure = slope > 0.0 and rest - SURE_STDS * np.sqrt(variance) >= PULSES_US[0]
    return float(rest) if sure and rest <= LONGEST_REST_US else None


def share_of_throttle(seen: Seen) -> str:
    """What an rpm that never exceeds 1 or 100 looks like, where it fits no speed; "" if neither."""
    (rpm,) = seen.columns("rpm")
    most = float(np.abs(rpm).max()) if rpm.size else np.inf
    if most <= MOST_SHARE:
        return f"a throttle of 0 to 1 in an rpm column (at most {most:.3g})"
    return (
        f"per cent of a throttle in an rpm column (at most {most:.3g})"
        if most <= MOST_PERCENT
        else ""
    )


def pulses_remedy(seen: Seen, rest: float) -> str:
    """What to do about pulses, of which one rests the vehicle."""
    column = column_of_rpm(seen)
    offset = -EXAMPLE_SCALE * round(rest)
    return PULSES_REMEDY.format(column=column, rest=rest, scale=EXAMPLE_SCALE, offset=offset)


def column_of_rpm(seen: Seen) -> str:
    """Name of the column in the log, as it stands between quotes in a map."""
    sensor = seen.raw.sensors.get("rpm")
    return quoted("rpm" if sensor is None else sensor.columns.get("rpm", "rpm"))
