"""The likelihood of the free-running prediction: output error with coloured noise.

A record is predicted from its start and its inputs alone. Its readings y are taken for::

    x_0 = s + d,                    d ~ N(0, D)       s: from a line through the readings
    x_{k+1} = f(x_k, u_k; theta)
    y_k = h(x_k; theta) + b_k + v_k,  v_k ~ N(0, W)   b: a slow disturbance of each channel

(`estimation.coloured` says what b is). A scalar Kalman filter of each channel turns y - h(x) and
its slopes into white innovations e, E by the start and J by the free parameters, so that::

    -log p(y | theta) = min_d |e + E d|^2 / 2 + d' D^-1 d / 2 + log det(I + E D E') / 2 + constant

The start is a nuisance parameter: linear in d, it is eliminated in closed form. `normal_equations`
is what one record adds to value, gradient and curvature, `likelihood` their sum over the records.
E depends on theta as well. The determinant is left out for that, and so is the change of E in the
gradient, which is exact where d is zero: the records of a fit begin where d had come to, and d
counts on from there (`well_started`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import FITTED_START_STD
from auvident.engines import accumulated
from auvident.engines.accumulated import LARGEST
from auvident.engines.prediction import (
    At,
    Frame,
    Free,
    Slopes,
    at_effects,
    observed,
    readings,
    readings_with_slopes,
    seen_rows,
    simulated,
)
from auvident.engines.records import Record
from auvident.estimation.coloured import Colour, whiten_channels, whitened
from auvident.parallel import each
from auvident.physics.dynamics import N_STATES

Array = npt.NDArray[Any]
Colours = tuple[Colour, ...]
Normal = tuple[float, Array, Array]  # half the squared error, its gradient, its curvature

NOTHING = np.zeros(0, dtype=np.int64)
# A start that moves by so many standard deviations of the noise is not tried first; of one that
# moves further the whole way is tried, then a part of it. Chosen to save passes: on `bay_trial`
# 0.3 in place of 1 took as many evaluations within 3 %.
NEAR, PART = 1.0, 0.25
# [nats a reading] What leaves more is far from the end of a fit, and its starts would suit what is
# wrong: a limit begun far from its size then gained 5 to 1,400 nats of 1,700 in the first steps.
FAR = 2.0  # a right model leaves a half


@dataclass(frozen=True)
class OutputError:
    """All that the likelihood of a parameter vector rests on.

    Attributes
    ----------
    frame : Frame
    records : tuple of Record
    active : (4,) bool array
        States that are predicted and channels that are compared; the others are as logged.
    colours : tuple of Colour
        Noise of each channel, at least of the active ones.
    start_stds : float
        A start is known to so many standard deviations of the noise of its channel.
    gain : (4,) array or None
        Observer gain, see `physics.dynamics.simulate_with_sensitivities`; none runs free.
    known : dict
        What records add at some parameters, where that has been found before; see `knowing`.
    """

    frame: Frame
    records: tuple[Record, ...]
    active: npt.NDArray[np.bool_]
    colours: Colours
    start_stds: float = FITTED_START_STD
    gain: Array | None = None
    known: Mapping[tuple[str, bytes], Normal | None] = field(default_factory=dict)

    @cached_property
    def channels(self) -> npt.NDArray[np.int64]:
        """Channels that are compared."""
        return np.flatnonzero(self.active).astype(np.int64)

    @cached_property
    def start_information(self) -> Array:
        """Inverse covariance (k, k) of the k active states of a start."""
        stds = [start_std(self.colours[c], self.start_stds) for c in self.channels]
        return np.diag([std**-2.0 for std in stds])

    @property
    def no_parameter(self) -> Free:
        """That no parameter moves."""
        column = np.full(len(self.frame.structure.parameters), -1, dtype=np.int64)
        return Free(NOTHING, column, np.zeros(0))

    def at(self, p: Array, free: Free | None = None) -> At:
        """The prediction at p, which all records share; no parameter moves unless told."""
        return At(self.frame, p, self.no_parameter if free is None else free)


@dataclass(frozen=True)
class Innovations:
    """A record and its prediction, whitened.

    Attributes
    ----------
    predicted : Slopes
        Readings, their slopes, and the states.
    seen : (n, 4) bool array
        Readings that the prediction is compared with.
    white : (c n, 1 + k + m) array
        One channel below the other: predicted minus measured, slopes by the k active states of
        the start, by the m free parameters.
    """

    predicted: Slopes
    seen: npt.NDArray[np.bool_]
    white: Array


def predicted(frame: Frame, p: Array, record: Record, active: Array) -> Array:
    """Readings (n, 4) predicted by free-running simulation of the active states."""
    acting = at_effects(frame, p, record)
    return readings(frame, p, record, simulated(frame, p, acting, active))


def start_std(colour: Colour, stds: float) -> float:
    """How far the start of a record may be from the line through its readings."""
    return stds * math.hypot(colour.white, colour.slow)


def white_columns(
    error: Array,
    slopes: Array,
    columns: Array,
    seen: Array,
    channels: Array,
    colours: Colours,
    dt_s: float,
) -> Array:
    """Whitened errors and slopes of some channels, one below the other.

    Parameters
    ----------
    error, seen : (n, 4) array
    slopes : (n, 4, k) array
    columns : (m,) int array
        Of the slopes.
    channels : (c,) int array
    colours : tuple of Colour
        Of every channel; those named are used.

    Returns
    -------
    (c n, 1 + m) array
        Column 0 is the error.
    """
    own = [colours[c] for c in channels]
    keep = np.array([math.exp(-dt_s / colour.time_s) for colour in own])
    still, slow = (np.array([getattr(c, part) for c in own]) for part in ("white", "slow"))
    out = np.empty((len(own) * len(error), 1 + len(columns)))
    whiten_channels(error, slopes, columns, seen, channels, keep, still, slow, out)
    return out


def white_error(error: Array, colours: Colours, dt_s: float) -> Array:
    """Whitened errors (n, c) of the first c channels; zero where there is no reading."""
    white = [whitened(error[:, c], colour, dt_s) for c, colour in enumerate(colours)]
    return np.where(np.isfinite(error[:, : len(colours)]), np.column_stack(white), 0.0)


def innovations(output: OutputError, at: At, record: Record) -> Innovations | None:
    """Innovations of a record with their slopes; None where the prediction runs away."""
    channels, dt_s = output.channels, output.frame.dt_s
    found = readings_with_slopes(at, record, output.active, output.gain)
    if found is None:
        return None
    seen = seen_rows(at, record, output.active)
    columns = np.concatenate([channels, N_STATES + np.arange(len(at.free.positions))])
    error = found.readings - record.measured
    white = white_columns(error, found.slopes, columns, seen, channels, output.colours, dt_s)
    return Innovations(found, seen, white)


def finite_innovations(output: OutputError, at: At, record: Record) -> Innovations | None:
    """As `innovations`; None as well where the motion is nearly lost."""
    found = innovations(output, at, record)
    lost = found is None or not accumulated.all_within(found.white, LARGEST**0.5)
    return None if lost else found


def best_start(output: OutputError, own: Array, others: Array) -> Array:
    """What the start takes up (k, ...) of some columns of innovations.

    Parameters
    ----------
    output : OutputError
    own : (k, k) array
        Products of the slopes by the start with each other.
    others : (k, ...) array
        Products of these slopes with the columns.
    """
    share: Array = np.linalg.solve(own + output.start_information, others)
    return share


def pull_of_start(output: OutputError, record: Record) -> Array:
    """What a moved start (k,) is pulled back with: to be added to its products with the error."""
    pull: Array = output.start_information @ record.moved[output.active]
    return pull


def _taken_up(output: OutputError, record: Record, found: Innovations) -> tuple[Array, float]:
    """What the start takes up (k,) of the error of a record, no parameter being free; its gain."""
    white, by_start = found.white[:, 0], found.white[:, 1:]
    pulled = by_start.T @ white + pull_of_start(output, record)
    share = best_start(output, by_start.T @ by_start, pulled)
    return share, 0.5 * float(pulled @ share)


def lost_readings(record: Record, seen: Array, channels: Array) -> int:
    """Readings that a prediction cannot be compared with, as a late sensor's first ones.

    A fit must not gain by losing them: each counts as what a reading is expected to cost.
    """
    return int((np.isfinite(record.measured[:, channels]) & ~seen[:, channels]).sum())


def normal_equations(output: OutputError, p: Array, record: Record, free: Free) -> Normal | None:
    """What one record adds to the likelihood at p, its start eliminated; None: it runs away.

    Readings that are lost (`lost_readings`) count with their expected half each.

    Returns
    -------
    tuple of float, (m,) and (m, m) array, or None
        Half the squared error; gradient and Gauss-Newton curvature by the free parameters, in
        units of their scale.
    """
    return _normal_equations(output, output.at(p, free), _whitening(output), record)


def _normal_equations(
    output: OutputError, at: At, whitening: accumulated.Whitening, record: Record
) -> Normal | None:
    """`normal_equations` with what all records share."""
    found = observed(at, record, output.active, output.gain)
    if found is None:
        return None
    gram = np.empty((found.z.shape[2], found.z.shape[2]))
    lost = accumulated.normal_equations(
        found.z, found.sees, found.readings, record.measured, whitening, record.moved, gram
    )
    if lost < 0:
        return None
    first = 1 + N_STATES
    return 0.5 * (float(gram[0, 0]) + lost), gram[first:, 0].copy(), gram[first:, first:].copy()


def _whitening(output: OutputError) -> accumulated.Whitening:
    """Noise of the channels as the kernels take it; there may be no colour of inactive ones."""
    parts, start = np.zeros((3, N_STATES)), np.ones(N_STATES)
    for c in output.channels:
        colour = output.colours[c]
        parts[:, c] = math.exp(-output.frame.dt_s / colour.time_s), colour.white, colour.slow
    start[output.channels] = np.diag(output.start_information)
    keep, white, slow = parts
    return accumulated.Whitening(output.active, keep, white, slow, start)


def knowing(output: OutputError, p: Array, free: Free) -> OutputError:
    """The likelihood that remembers what each record adds at p.

    Fits to some of the records each that begin at p, with the same parameters free, find the same
    there again and again.
    """
    at, whitening = output.at(p, free), _whitening(output)
    parts = each(lambda r: _normal_equations(output, at, whitening, r), output.records, len)
    keys = [_key(record, p) for record in output.records]
    return replace(output, known=dict(zip(keys, parts, strict=True)))


def _key(record: Record, p: Array) -> tuple[str, bytes]:
    return record.id, p.tobytes()


def likelihood(output: OutputError, p: Array, free: Free) -> Normal:
    """Half the squared error of all records at p, gradient and curvature; see `summed`."""
    at, whitening = output.at(p, free), _whitening(output)

    def part(record: Record) -> Normal | None:
        key = _key(record, p)
        known = key in output.known
        return output.known[key] if known else _normal_equations(output, at, whitening, record)

    parts = each(part, output.records, len)
    half, gradient, curvature = summed(parts, len(free.positions))
    return half, gradient, 0.5 * (curvature + curvature.T)


def summed(parts: Sequence[Normal | None], n: int) -> Normal:
    """Sum over the records; infinite when one of them ran away."""
    half, gradient, curvature = 0.0, np.zeros(n), np.zeros((n, n))
    for part in parts:
        if part is None:
            return np.inf, gradient, curvature
        half += part[0]
        gradient += part[1]
        curvature += part[2]
    return half, gradient, curvature


@dataclass(frozen=True)
class RecordResidual:
    """What a prediction with its best start leaves of one record.

    Attributes
    ----------
    id : str
    time_s : (n,) array
    error : (n, 4) array
        Measured minus predicted; NaN where there is no reading.
    states : (n, 4) array
        Predicted from where the record begins.
    moved : (4,) array
        Where that is (`Record.moved`).
    away : (4,) array
        How far from there the best start lies, to first order.
    cost, least : float
        What the prediction from where the record begins costs, and having moved that [nats]; what
        it costs from the best start, to first order.
    """

    id: str
    time_s: Array
    error: Array
    states: Array
    moved: Array
    away: Array
    cost: float
    least: float


def residual_of(output: OutputError, at: At, record: Record) -> RecordResidual | None:
    """What the prediction leaves of a record, its start fitted; None where it runs away.

    Parameters
    ----------
    at : At
        No parameter moves.
    """
    assert not at.free.positions.size  # the slopes are those by the start alone
    found = finite_innovations(output, at, record)
    if found is None:
        return None
    there, (start, gained) = found.predicted, _taken_up(output, record, found)
    error = np.empty(found.seen.shape)
    accumulated.left_over(
        there.readings, there.slopes, record.measured, found.seen, output.channels, start, error
    )
    away = np.zeros(N_STATES)
    away[output.active] = -start
    cost = _cost_of(output, record, found)
    return RecordResidual(
        record.id, record.time_s, error, there.states, record.moved, away, cost, cost - gained
    )


def _cost_of(output: OutputError, record: Record, found: Innovations) -> float:
    white, moved = found.white[:, 0], record.moved[output.active]
    return 0.5 * float(white @ white + pull_of_start(output, record) @ moved)


def residuals_of(output: OutputError, p: Array) -> tuple[RecordResidual, ...] | None:
    """Residuals of all records; None where one runs away."""
    at = output.at(p)
    found = each(lambda record: residual_of(output, at, record), output.records, len)
    whole = tuple(residual for residual in found if residual is not None)
    return whole if len(whole) == len(found) else None


def beginning_at(record: Record, moved: Array) -> Record:
    """A record with its start so far (4,) from the line through its readings."""
    return replace(record, start=record.start + moved - record.moved, moved=moved)


def from_line(output: OutputError) -> OutputError:
    """The likelihood with each record begun at the line through its readings."""
    line = np.zeros(N_STATES)
    return replace(output, records=tuple(beginning_at(r, line) for r in output.records), known={})


def well_started(
    output: OutputError, p: Array, residuals: Sequence[RecordResidual] = ()
) -> OutputError:
    """The likelihood with each record begun where its readings are predicted best at p.

    Its value there is the same to first order; its gradient is exact. A record begins as it did
    where it runs away, is far from being predicted, or is predicted worse from the new start, as
    the motion bends.

    Parameters
    ----------
    residuals : sequence of RecordResidual
        What is left at p with this noise, where that is known already.
    """
    at, found = output.at(p), list[RecordResidual | None](residuals)
    found = found or each(lambda r: residual_of(output, at, r), output.records, len)
    records = [
        record if left is None else _begun(output, at, record, left)
        for record, left in zip(output.records, found, strict=True)
    ]
    return replace(output, records=tuple(records), known={})


def _begun(output: OutputError, at: At, record: Record, left: RecordResidual) -> Record:
    """A record at its best start; a part of the way or none where the whole leads too far."""
    if left.least > FAR * np.isfinite(left.error).sum():
        return beginning_at(record, left.moved)
    whole = beginning_at(record, left.moved + left.away)
    near = NEAR * np.array([start_std(colour, 1.0) for colour in output.colours])
    if (np.abs(left.away[: len(near)]) <= near).all():
        return whole
    part = beginning_at(record, left.moved + PART * left.away)
    better = (m for m in (whole, part) if _cost_from(output, at, m) < left.cost)
    return next(better, beginning_at(record, left.moved))


def _cost_from(output: OutputError, at: At, record: Record) -> float:
    """What the prediction from where a record begins costs; infinite where it runs away."""
    left = residual_of(output, at, record)
    return np.inf if left is None else left.cost
