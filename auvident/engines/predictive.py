"""How far a free-running prediction may be off: its variance by channel and time.

With J the slopes of a channel by the parameters and P their covariance, a band reaches::

    f (J P J' + noise^2 + e^2 (1 + t)^(2 g))^(1/2)

to either side of the prediction. Noise is that of the sensor; the model error e, of which the
square grows with the power 2 g of the time t [s] since the start, and the factor f come from
maneuvers that were left out of the identification in turn (`errors_of`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import BAND_SHARE, NORMAL_95
from auvident.engines.carried import (
    frame_of,
    free_behind,
    free_running,
    over_ground,
    predicted_course,
    vector_behind,
)
from auvident.engines.falling import PushesAlong, fallen_models
from auvident.engines.prediction import At, Frame, Free, readings_with_slopes
from auvident.engines.records import Record
from auvident.estimation.chances import student_quantile
from auvident.physics.dynamics import ALL_STATES, N_STATES
from auvident.physics.maneuvers import headings_from_start, integral_of, track_of
from auvident.physics.sensing import sensor_matrix
from auvident.schema.artifacts import IdentifiedModel, ModelError, Sensing
from auvident.schema.planes import BY_PLANE, TRACK, Plane

Array = npt.NDArray[Any]

NOMINAL = BAND_SHARE
# of the models drawn, where a model tells of nothing but its coefficients
OF_DRAWS = (50.0 * (1.0 - NOMINAL), 50.0 * (1.0 + NOMINAL))  # percentiles
# Power of the time in the model error. A heading is the sum of errors of the rate, of which some
# come and go (a random walk, 1/2) and some stay (1); a track is the sum of headings that are off
# times the speed, one power more. Others are held by damping.
HEADING_GROWTH, TRACK_GROWTH = 0.75, 1.75
LEAST = 1.0e-30  # variance, so that errors without one can be divided by it
MOST_STEPS, CONVERGED = 60, 1.0e-9  # of the mean square that is to be one


def growths(plane: Plane) -> dict[str, float]:
    """Power of the time in the model error of each channel that is compared."""
    found = {s.symbol: HEADING_GROWTH if s.wraps else 0.0 for s in BY_PLANE[plane].states}
    return found | ({TRACK: TRACK_GROWTH} if plane == "horizontal" else {})


def parameter_variance(
    frame: Frame, p: Array, record: Record, free: Free, covariance: Array
) -> dict[str, Array] | None:
    """Variance (n,) of each predicted channel by the parameters; None where it runs away.

    Parameters
    ----------
    covariance : (k, k) array
        Of the free parameters, in units of their scale.

    Returns
    -------
    dict or None
        ``track`` is the mean squared distance [m^2].
    """
    running = free_running(frame, p, record, ALL_STATES)
    found = readings_with_slopes(At(frame, p, free), running, ALL_STATES)
    if found is None:
        return None
    slopes = found.slopes[:, :, N_STATES:]
    channels = [state.symbol for state in BY_PLANE[frame.structure.plane].states]
    variance = {name: _variance(slopes[:, c], covariance) for c, name in enumerate(channels)}
    if frame.structure.plane == "horizontal":
        matrix = sensor_matrix(frame.structure.plane, frame.sensing, frame.reading_effects(p))
        behind = np.einsum("ij,tjk->tik", np.linalg.inv(matrix), slopes)
        states = over_ground(frame, p, record, found.states)
        north, east = _track_slopes(record.time_s, states, behind)
        variance[TRACK] = _variance(north, covariance) + _variance(east, covariance)
    return variance if all(np.isfinite(v).all() for v in variance.values()) else None


def _variance(slopes: Array, covariance: Array) -> Array:
    return np.maximum(np.sum((slopes @ covariance) * slopes, axis=1), 0.0)


def _track_slopes(time_s: Array, states: Array, slopes: Array) -> tuple[Array, Array]:
    """Slopes (n, k) of north and east, from those of the velocities and the heading (n, 4, k)."""
    u, v, angle = (states[:, i, None] for i in (0, 1, 3))
    cos, sin = np.cos(angle), np.sin(angle)
    north = cos * slopes[:, 0] - sin * slopes[:, 1] - (u * sin + v * cos) * slopes[:, 3]
    east = sin * slopes[:, 0] + cos * slopes[:, 1] + (u * cos - v * sin) * slopes[:, 3]
    summed = [[integral_of(time_s, x) for x in rates.T] for rates in (north, east)]
    return np.array(summed[0]).T, np.array(summed[1]).T


# --- what was measured ---------------------------------------------------------------------


def measured_channels(record: Record, dt_s: float) -> Array:
    """Readings (n, 4) to compare with; where no angle was logged the gyro's is integrated."""
    measured = record.measured.copy()
    if not np.isfinite(measured[:, 3]).any():
        steps = np.cumsum(record.given[:-1, 2] + record.given[1:, 2]) * dt_s / 2.0
        measured[:, 3] = record.start[3] + np.concatenate([[0.0], steps])
    return measured


def measured_track(record: Record, measured: Array) -> Array:
    """Dead-reckoned track (n, 2) of what was measured; gaps are bridged."""
    angle = np.where(np.isfinite(measured[:, 3]), measured[:, 3], record.given[:, 3])
    return track_of(record.time_s, np.column_stack([record.given[:, :3], angle]))


# --- maneuvers that were left out ----------------------------------------------------------


@dataclass(frozen=True)
class LeftOutCourse:
    """A maneuver predicted without having had a part in the parameters.

    Attributes
    ----------
    id : str
    elapsed_s : (n,) array
    error, variance : dict of str to (n,) array
        Distance from what was measured (NaN: nothing was), and its variance by the parameters.
    measured : dict of str to (n,) or (n, 2) array
    """

    id: str
    elapsed_s: Array
    error: dict[str, Array]
    variance: dict[str, Array]
    measured: dict[str, Array]

    def beyond(self, noise: Mapping[str, float]) -> dict[str, float]:
        """Mean square error beyond the coefficients and some noise, by channel measured."""
        found = {}
        for name, error in self.error.items():
            seen = np.isfinite(error)
            if seen.any():
                left = error[seen] ** 2 - self.variance[name][seen] - noise.get(name, 0.0) ** 2
                found[name] = float(np.mean(left))
        return found


def widened(course: LeftOutCourse, variance: Mapping[str, Array]) -> LeftOutCourse:
    """The course with at least such a variance (n,) in each channel; it may lack some."""
    return replace(course, variance=at_least(course.variance, variance))


def left_out_course(
    frame: Frame, p: Array, record: Record, free: Free, covariance: Array
) -> LeftOutCourse | None:
    """Prediction of a record with parameters from the other maneuvers; None: it runs away."""
    variance = parameter_variance(frame, p, record, free, covariance)
    course = predicted_course(frame, p, record, ALL_STATES)
    if variance is None or not np.isfinite(course.readings).all():
        return None
    readings, plane = measured_channels(record, frame.dt_s), frame.structure.plane
    error, measured = {}, {}
    for c, state in enumerate(BY_PLANE[plane].states):
        pair = readings[:, c], course.readings[:, c]
        seen, told = headings_from_start(*pair) if state.wraps else pair
        error[state.symbol], measured[state.symbol] = np.abs(seen - told), seen
    if TRACK in variance:
        track = measured_track(record, readings)
        away = track - track_of(record.time_s, course.over_ground)
        error[TRACK] = np.hypot(away[:, 0], away[:, 1])
        measured[TRACK] = track
    elapsed = record.time_s - record.time_s[0]
    return LeftOutCourse(record.id, elapsed, error, variance, measured)


def errors_of(
    courses: Sequence[LeftOutCourse],
    plane: Plane,
    noise: Mapping[str, float],
    lost: int,
    falls: bool = False,
) -> dict[str, ModelError]:
    """Model error and factor of each channel, from maneuvers that were left out in turn.

    The factor puts `NOMINAL` of their samples within the band (a conformal step). What one
    maneuver more would be off scatters about what the F measured show as about a mean of F: the
    variance of a prediction is (1 + 1/F) times theirs. The samples of a sum drift away together:
    its maneuvers count as one draw each, of which the mean squares over the variances give the
    spread, and the factor is the quantile of Student's t with F degrees of freedom. That a hull
    which may fall to the other side did not in a few maneuvers does not narrow its band: there the
    factor is no less than that of a normal distribution.

    Parameters
    ----------
    noise : mapping
        Standard deviation of each sensor by channel.
    lost : int
        Readings of maneuvers whose prediction ran away, which no band holds.
    falls : bool
        Whether the hull may fall to the other side, see `engines.falling`.

    Returns
    -------
    dict
        Without the channels that were not measured, or of which no band holds enough.
    """
    found = {}
    for name, growth in growths(plane).items():
        error = np.concatenate([c.error[name] for c in courses])
        whose = np.repeat(np.arange(len(courses)), [len(c.error[name]) for c in courses])
        seen = np.isfinite(error)
        whose = whose[seen]
        known = np.concatenate([c.variance[name] for c in courses])[seen]
        known = known + noise.get(name, 0.0) ** 2
        grown = grown_by(np.concatenate([c.elapsed_s for c in courses])[seen], growth)
        level = NOMINAL * (1.0 + lost / max(int(seen.sum()), 1))
        if not seen.any() or level > 1.0:
            continue
        square = error[seen] ** 2
        left = model_error(square, known, grown)
        ratio = square / np.maximum(with_model_error(known, left, grown), LEAST)
        least = NORMAL_95 if falls else 0.0
        factor = drifting(ratio, whose, level) if growth else _conformal(ratio, level, least)
        factor *= math.sqrt(1.0 + 1.0 / len(np.unique(whose)))
        if math.isfinite(factor):
            found[name] = ModelError(std=math.sqrt(left), growth=growth, factor=factor)
    return found


def _conformal(ratio: Array, level: float, least: float) -> float:
    """Factor that holds a share of the samples, from their squares over their variances."""
    return max(math.sqrt(float(np.quantile(ratio, level))), least)


def drifting(ratio: Array, whose: Array, level: float) -> float:
    """Factor that holds a share of maneuvers whose samples drift away together.

    Parameters
    ----------
    ratio : (n,) array
        Squared errors over their variances.
    whose : (n,) int array
        Number of the maneuver of each sample.
    """
    own = [float(np.mean(ratio[whose == number])) for number in np.unique(whose)]
    return student_quantile(len(own), 0.5 * (1.0 + level)) * math.sqrt(float(np.mean(own)))


def model_error(square: Array, known: Array, grown: Array) -> float:
    """Square of the model error with which errors are as large as they are taken for.

    The root of mean(square / (known + e^2 grown)) = 1 (Paule and Mandel 1982), zero where errors
    are smaller without one: what is known to be far off, as a hull that may have fallen to the
    other side, weighs no more than the rest.

    Parameters
    ----------
    square, known : (n,) array
        Squared errors, and their variance without a model error.
    grown : (n,) array
        By how much the square of the model error has grown.
    """
    left = float(np.mean(square / grown))
    if np.mean(square / np.maximum(known, LEAST)) <= 1.0:
        return 0.0
    for _ in range(MOST_STEPS):  # of Newton: convex, so that it comes from below
        whole = np.maximum(with_model_error(known, left, grown), LEAST)
        beyond = float(np.mean(square / whole)) - 1.0
        if abs(beyond) < CONVERGED:
            break
        left = max(left + beyond / float(np.mean(square * grown / whole**2)), 0.5 * left)
    return left


def grown_by(elapsed_s: Array, growth: float) -> Array:
    """By how much the square of a model error has grown, some time after the start."""
    return (1.0 + elapsed_s) ** (2.0 * growth)


def with_model_error(known: Array, square: float, grown: Array) -> Array:
    """Variance of a prediction: by parameters and sensor, and by what the equations lack."""
    return known + square * grown


# --- band of a prediction ------------------------------------------------------------------


def half_widths(
    model: IdentifiedModel, variance: Mapping[str, Array], elapsed_s: Array
) -> dict[str, Array]:
    """Half width (n,) of the band of each channel of which the model tells.

    Parameters
    ----------
    variance : mapping
        By the parameters, as `parameter_variance` gives it.
    elapsed_s : (n,) array
        Since the start of the prediction.

    Returns
    -------
    dict
        That of the track is the radius about the predicted point [m].
    """
    errors = model.left_out.model_error if model.left_out else {}
    noise = noise_of(model.sensing, model.plane)
    found = {}
    for name, e in errors.items():
        if name in variance:
            found[name] = half_width(e, noise.get(name, 0.0), variance[name], elapsed_s)
    return found


def half_width(error: ModelError, noise_std: float, variance: Array, elapsed_s: Array) -> Array:
    """Half width (n,) of the band of a channel; see `half_widths`."""
    grown = grown_by(elapsed_s, error.growth)
    total = with_model_error(variance + noise_std**2, error.std**2, grown)
    return np.asarray(error.factor * np.sqrt(total))


@dataclass(frozen=True)
class Band:
    """The band about a prediction.

    Attributes
    ----------
    half_width : dict of str to (n,) array
        Of each channel of which the model tells; NaN where the prediction runs away.
    ran_away : int
        Models drawn for it that run away, which it leaves out (`auvident.engines.falling`).
    """

    half_width: dict[str, Array]
    ran_away: int = 0


def band_of(model: IdentifiedModel, record: Record, dt_s: float) -> Band:
    """The band about the prediction of a record."""
    if model.left_out is None:
        return Band({})
    frame, p = frame_of(model, dt_s), vector_behind(model)
    found = parameter_variance(frame, p, record, *free_behind(model))
    lost = np.full(len(record), np.nan)
    variance = found or dict.fromkeys(growths(model.plane), lost)
    pushes, ran_away = pushes_behind(model), 0
    if found and pushes:
        fallen = fallen_models(frame, p, record, *free_behind(model), pushes)
        variance, ran_away = at_least(found, fallen.variance), fallen.ran_away
    return Band(half_widths(model, variance, record.time_s - record.time_s[0]), ran_away)


def pushes_behind(model: IdentifiedModel) -> PushesAlong | None:
    """Pushes to a model that hardly keeps its course; None where it does, or does not tell."""
    if not model.left_out or not model.left_out.push:
        return None
    std = [model.left_out.push.get(s.symbol, 0.0) for s in BY_PLANE[model.plane].states]
    return PushesAlong(np.array(std), model.length_m)


def at_least(variance: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, Array]:
    """The larger one of two variances (n,) of each channel; the other may lack some."""
    return {name: np.maximum(v, other.get(name, v)) for name, v in variance.items()}


def noise_of(sensing: Sensing, plane: Plane) -> dict[str, float]:
    """Standard deviation of the sensor of each channel."""
    return {s.symbol: sensing.noise_std.get(s.column, 0.0) for s in BY_PLANE[plane].states}
