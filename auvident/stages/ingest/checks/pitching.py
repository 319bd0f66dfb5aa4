"""An elevator that contradicts its sign: whether pitch and depth say that the gyro does."""

from collections.abc import Sequence

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
    return _turned(
        seen,
        f"{said}, and the elevator contradicts the pitch rate: {_column(seen)} looks positive bow "
        "down",
        "Pitch and q are positive bow up: set sign = -1 for q",
        "pitch_rate_scale",
        ["q_radps"],
    )


def _of_rate_and_pitch(seen: Seen, said: str) -> ContradictionError:
    return _turned(
        seen,
        f"{said}, and the elevator contradicts the pitch rate: pitch and {_column(seen)} look "
        "positive bow down",
        "Pitch and q are positive bow up: set sign = -1 for both",
        "pitch_sign",
        ["q_radps", "pitch_rad"],
    )


def _of_the_axes(seen: Seen) -> ContradictionError:
    heave = () if heave_by_depth(seen).outcome == "contradicts" else ("w_mps",)
    return _turned(
        seen,
        "the elevator contradicts the pitch rate, and the depth is negative throughout: pitch, q"
        f"{', w' if heave else ''} and depth look like axes forward-left-up",
        "Depth and w are positive down, pitch and q bow up: set sign = -1 for each of them",
        "pitch_sign",
        [column for column in (*AXES, *heave) if seen.has(column)],
    )


def _turned(
    seen: Seen, problem: str, remedy: str, check: str, columns: Sequence[str]
) -> ContradictionError:
    """A contradiction that goes away where some channels are turned, by a map or by `--fix`."""
    return ContradictionError(
        problem,
        f"{seen.raw.sensors['gyro'].file}, column {_column(seen)}",
        f"{remedy} in a map (--map), or give --fix {check}.",
        check,
        scaled(-1.0, *columns),
    )


def _column(seen: Seen) -> str:
    return seen.raw.sensors["gyro"].columns["q_radps"]
