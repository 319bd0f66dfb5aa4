"""An elevator that contradicts its sign: whether pitch and depth say that the gyro does."""

from auvident.errors import ContradictionError
from auvident.stages.ingest.checks.correction import scaled
from auvident.stages.ingest.checks.heave import (
    above_water,
    heave_by_depth,
    pitch_by_depth,
    pitch_rate,
)
from auvident.stages.ingest.checks.seen import Seen

TURNED_PITCH = scaled(-1.0, "pitch_rad")
AXES = ("q_radps", "pitch_rad", "depth_m")  # of the other sign where they are forward-left-up


def with_the_gyro_at_fault(error: ContradictionError, seen: Seen) -> ContradictionError:
    """The contradiction of an elevator, or that of the gyro where it stands against the others.

    The elevator is judged by the pitch rate. A pitch that changes against the pitch rate agrees
    with the elevator, and then q alone is off: turning the elevator would leave two of three
    upside down. So would it where pitch and q agree and the depth contradicts both, or is itself
    a height.

    Parameters
    ----------
    error : ContradictionError
        Of whatever sign; any but that of the elevator is returned as it is.
    seen : Seen
    """
    if error.check != "elevator_sign":
        return error
    rate, depth = pitch_rate(seen), pitch_by_depth(seen)
    if rate.outcome == "contradicts" and (rate.value or 0.0) < 0.0:
        return _of_the_rate(seen, rate.message)
    if rate.outcome != "agrees" or depth.outcome != "contradicts":
        return error
    if depth.fix == TURNED_PITCH:
        return _of_rate_and_pitch(seen, depth.message)
    upward = (depth.value or 0.0) > 0.0 and above_water(seen)
    return _of_the_axes(seen) if upward else error


def _of_the_rate(seen: Seen, said: str) -> ContradictionError:
    return ContradictionError(
        f"{said}, and the elevator contradicts the pitch rate: {_column(seen)} looks positive bow "
        "down",
        _place(seen),
        "Pitch and q are positive bow up: set sign = -1 for q in a map (--map), or give --fix "
        "pitch_rate_scale.",
        "pitch_rate_scale",
        scaled(-1.0, "q_radps"),
    )


def _of_rate_and_pitch(seen: Seen, said: str) -> ContradictionError:
    return ContradictionError(
        f"{said}, and the elevator contradicts the pitch rate: pitch and {_column(seen)} look "
        "positive bow down",
        _place(seen),
        "Pitch and q are positive bow up: set sign = -1 for both in a map (--map), or give --fix "
        "pitch_sign.",
        "pitch_sign",
        scaled(-1.0, "q_radps", "pitch_rad"),
    )


def _of_the_axes(seen: Seen) -> ContradictionError:
    heave = () if heave_by_depth(seen).outcome == "contradicts" else ("w_mps",)
    turned = [column for column in (*AXES, *heave) if seen.has(column)]
    return ContradictionError(
        "the elevator contradicts the pitch rate, and the depth is negative throughout: pitch, q"
        f"{', w' if heave else ''} and depth look like axes forward-left-up",
        _place(seen),
        "Depth and w are positive down, pitch and q bow up: set sign = -1 for each of them in a "
        "map (--map), or give --fix pitch_sign.",
        "pitch_sign",
        scaled(-1.0, *turned),
    )


def _column(seen: Seen) -> str:
    return seen.raw.sensors["gyro"].columns["q_radps"]


def _place(seen: Seen) -> str:
    return f"{seen.raw.sensors['gyro'].file}, column {_column(seen)}"
