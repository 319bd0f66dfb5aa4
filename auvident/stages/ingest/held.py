"""Sign of a fin from where it is held: the vehicle must turn the way it was put.

The yaw acceleration shows the rudder only while a turn begins or ends; in steady circles, with a
noisy gyro or a slow vehicle it shows little. A rudder that is held answers to nothing, so that the
turn that follows is its own: after a step the curvature of the path changes to one side, and once
it has settled the path bends to that side. A helm that works with the motion is never held.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass

import numpy as np
import pandas as pd

from auvident.schema.channels import RECORD_COLUMN
from auvident.schema.logs import DEG
from auvident.schema.planes import HORIZONTAL, PlaneRow
from auvident.schema.trial import Trial

HELD_BAND_RAD = 1.0 * DEG  # within which a rudder is held
HELD_S = 1.0  # shorter is no hold
LEAST_RAD = 5.0 * DEG  # beyond an offset of the rudder and the loop of an unstable hull
LEAST_STEP_S, STEP_LENGTHS = 2.0, 1.5  # a step shows after so long, or so many lengths of way,
LAST_LENGTHS = 5.0  # and best after so many
LEAST_SETTLED_S, SETTLED_LENGTHS = 3.0, 4.0  # by then a path bends as the rudder says
SLEW_S = 3.0  # between two holds of one step
CLOCK_S = 4.0  # at the end of a hold: so late may the rudder be stamped
MEAN_S, RUDDER_MEAN_S = 1.0, 0.5  # over which curvature and rudder are averaged
SURE_SHARE = 0.9  # of the rows that must say the same,
LEAST_SECONDS, LEAST_HOLDS = 20.0, 2  # in so much time and so often: one turn may be a drift
# ... and so many of the turns: a hull that falls into the same turn again and again, for minutes
# against 20 degrees of rudder, has most of its rows there but not most of its turns (4 of 10). Of
# 25 drawn vehicles of even seeds, five of them unstable, none has one among its 4 to 27.
SURE_HOLDS = 2.0 / 3.0
# Curvature times length over rudder angle: 0.5 to 3 for torpedo and tanker; what is far below it
# is no fin's doing.
RESPONSE = 0.1


@dataclass(frozen=True)
class Votes:
    """Rows that show the sign of the rudder: how many, how many contradict, of how many holds.

    Holds in one and the same turn count once. ``against`` are those of which most rows contradict.
    """

    rows: int = 0
    contrary: int = 0
    holds: int = 0
    seconds: float = 0.0
    against: int = 0

    @property
    def share(self) -> float:
        """Share of the rows that contradict; 0.5 when there are none."""
        return self.contrary / self.rows if self.rows else 0.5

    @property
    def sign(self) -> int:
        """-1 when the rudder works as it should, 1 the other way, 0 when that is not sure."""
        if self.seconds < LEAST_SECONDS:
            return 0
        least = max(LEAST_HOLDS, SURE_HOLDS * self.holds)
        if self.share >= SURE_SHARE and self.against >= least:
            return 1
        sure = self.share <= 1.0 - SURE_SHARE and self.holds - self.against >= least
        return -1 if sure else 0


@dataclass(frozen=True)
class Held:
    """What follows a held rudder: steady `turns`, and the change after `steps` from hold to hold.

    A clock of the rudder that is late or early by seconds spoils steps, but no steady turn.
    """

    turns: Votes
    steps: Votes

    @property
    def all(self) -> Votes:
        """Both together."""
        pairs = zip(astuple(self.turns), astuple(self.steps), strict=True)
        return Votes(*(a + b for a, b in pairs))


def held_fin(trial: Trial, length_m: float, grip_mps: float, plane: PlaneRow = HORIZONTAL) -> Held:
    """Compare every held rudder, or elevator, with the turn that follows.

    Parameters
    ----------
    trial : Trial
        With the internal sign of the fin: positive turns to port or down, to negative rates.
    length_m : float
        Of the hull.
    grip_mps : float
        Speed above which the fin governs the motion.
    plane : PlaneRow
        In which the fin steers.
    """
    turns: list[_Turn] = []
    steps: list[np.ndarray] = []
    for time, speed, rate, rudder in _pieces(trial, grip_mps, _rate_and_fin(plane)):
        curvature = _mean(rate * length_m / speed, round(MEAN_S * trial.rate_hz))
        passage = length_m / float(np.median(speed))
        held = _mean(rudder, round(RUDDER_MEAN_S * trial.rate_hz))
        stood = list(holds(time, held))
        angles = [float(np.mean(held[hold])) for hold in stood]
        for hold, angle in zip(stood, angles, strict=True):
            turns += _turn(time, curvature, hold, angle, passage)
        for k in range(1, len(stood)):
            if time[stood[k].start] - time[stood[k - 1].stop - 1] <= SLEW_S:
                step = angles[k] - angles[k - 1]
                steps += _step(time, curvature, stood[k - 1], stood[k], step, passage)
    once = _each_once(trial, turns, plane.columns[2])
    return Held(_votes(once, trial.rate_hz), _votes(steps, trial.rate_hz))


def held_steps(trial: Trial, fin: str, length_m: float, grip_mps: float) -> int:
    """How often a fin is stepped from one hold to another, each for the time of a hull length.

    An autopilot that trims or keeps a depth hardly ever does that; a zigzag does at every execute.

    Parameters
    ----------
    trial, length_m, grip_mps
        As of `held_fin`.
    fin : str
        Column of its angle.
    """
    count = 0
    for time, speed, angle in _pieces(trial, grip_mps, (fin,)):
        passage = length_m / float(np.median(speed))
        long = [h for h in holds(time, angle) if time[h.stop - 1] - time[h.start] >= passage]
        for before, hold in itertools.pairwise(long):
            quick = time[hold.start] - time[before.stop - 1] <= max(SLEW_S, passage)
            count += int(quick and abs(angle[hold].mean() - angle[before].mean()) >= LEAST_RAD)
    return count


@dataclass(frozen=True)
class SettledHold:
    """A stretch with the rudder held, once the turn has settled.

    Attributes
    ----------
    start_s, end_s, angle : float
        Times and mean angle (rad).
    bend : float
        Median of the curvature times length.
    swing : float
        Its range.
    contrary : float
        Most that it grows, as quickly as after a step of a rudder, to the side to which this one
        does not turn the vehicle.
    rate : float
        Median of the yaw rate [rad/s], which no current changes.
    """

    start_s: float
    end_s: float
    angle: float
    bend: float
    swing: float
    contrary: float
    rate: float


def settled_holds(trial: Trial, length_m: float, grip_mps: float) -> list[SettledHold]:
    """Every stretch in which the rudder is held for long enough that the turn settles.

    Parameters as of `held_fin`.
    """
    found = []
    for time, speed, rate, rudder in _pieces(trial, grip_mps, _rate_and_fin(HORIZONTAL)):
        curvature = _mean(rate * length_m / speed, round(MEAN_S * trial.rate_hz))
        passage = length_m / float(np.median(speed))
        settles_s = max(LEAST_SETTLED_S, SETTLED_LENGTHS * passage)
        answer = max(round(max(LEAST_STEP_S, LAST_LENGTHS * passage) * trial.rate_hz), 1)
        for hold in holds(time, rudder):
            rows = time[hold] >= time[hold.start] + settles_s
            rows &= time[hold] <= time[hold.stop - 1] - MEAN_S
            if rows.sum() > trial.rate_hz * HELD_S:
                turn = curvature[hold][rows], float(np.median(rate[hold][rows]))
                found.append(_settled(time[hold], *turn, rudder[hold], answer))
    return found


def _settled(
    time: np.ndarray, bend: np.ndarray, rate: float, rudder: np.ndarray, answer: int
) -> SettledHold:
    angle = float(np.mean(rudder))
    figures = (angle, float(np.median(bend)), float(np.ptp(bend)), _contrary(bend, angle, answer))
    return SettledHold(float(time[0]), float(time[-1]), *figures, rate)


def _contrary(bend: np.ndarray, angle: float, answer: int) -> float:
    """Most that a bend grows to the side to which the rudder does not turn the vehicle.

    A slow hull that hardly holds its course takes ten lengths from one turn to that of the rudder:
    that a bend fades, or grows to the side of the rudder, says nothing against it. Amidships it
    may not grow to either side, within the rows of an answer to a rudder; such a hull slips into
    a turn of its own in twenty lengths.
    """
    astray = np.maximum(bend * np.sign(angle), 0.0) if abs(angle) > HELD_BAND_RAD else np.abs(bend)
    least = pd.Series(astray).rolling(answer, min_periods=1).min().to_numpy()
    return float(np.max(astray - least))


def _votes(agreeing: list[np.ndarray], rate_hz: float) -> Votes:
    rows = sum(agrees.size for agrees in agreeing)
    contrary = [int(np.count_nonzero(~agrees)) for agrees in agreeing]
    against = sum(2 * n > agrees.size for n, agrees in zip(contrary, agreeing, strict=True))
    return Votes(rows, sum(contrary), len(agreeing), rows / rate_hz, against)


def _rate_and_fin(plane: PlaneRow) -> tuple[str, str]:
    return plane.columns[2], plane.control_columns[0]


def _pieces(
    trial: Trial, grip_mps: float, channels: tuple[str, ...]
) -> Iterator[tuple[np.ndarray, ...]]:
    """Time, speed and some channels of each uninterrupted piece under way."""
    table = trial.table
    values = table[["time_s", "u_mps", *channels]].to_numpy(float)
    good = np.isfinite(values).all(axis=1) & (values[:, 1] > grip_mps)
    record = np.where(good, table[RECORD_COLUMN].to_numpy(), -1)
    edges = np.flatnonzero(np.diff(record)) + 1
    for rows in np.split(np.arange(record.size), edges):
        if record[rows[0]] >= 0 and rows.size > 2 * trial.rate_hz * HELD_S:
            yield tuple(values[rows].T)


def _mean(values: np.ndarray, width: int) -> np.ndarray:
    """Moving average, the ends over what there is."""
    ones = np.ones(max(width, 1))
    return np.convolve(values, ones, "same") / np.convolve(np.ones(values.size), ones, "same")


def holds(time: np.ndarray, rudder: np.ndarray) -> Iterator[slice]:
    """Stretches in which the rudder stays within a narrow band, from left to right."""
    start, low, high = 0, rudder[0], rudder[0]
    for k, angle in enumerate(rudder.tolist()):  # a day of it: comparing is faster than calling
        if angle < low:
            low = angle
        if angle > high:
            high = angle
        if high - low > HELD_BAND_RAD:
            if time[k - 1] - time[start] >= HELD_S:
                yield slice(start, k)
            start, low, high = k, angle, angle
    if time[-1] - time[start] >= HELD_S:
        yield slice(start, time.size)


@dataclass(frozen=True)
class _Turn:
    """Rows of a hold that bend clearly once the turn has settled: whether as the rudder says."""

    end_s: float
    agrees: np.ndarray


def _turn(
    time: np.ndarray, curvature: np.ndarray, hold: slice, angle: float, passage_s: float
) -> list[_Turn]:
    """The turn of a hold, if its angle is large enough and the path bends clearly."""
    first = time[hold.start] + max(LEAST_SETTLED_S, SETTLED_LENGTHS * passage_s)
    settled = (time[hold] >= first) & (time[hold] <= time[hold.stop - 1] - CLOCK_S)
    bend, when = curvature[hold][settled], time[hold][settled]
    clear = np.abs(bend) >= RESPONSE * abs(angle)
    if abs(angle) < LEAST_RAD or not clear.any():
        return []
    return [_Turn(float(when[clear][-1]), bend[clear] * angle < 0)]


def _each_once(trial: Trial, turns: Sequence[_Turn], column: str) -> list[np.ndarray]:
    """Rows of each turn: holds between which the rate never changes sign are one and the same.

    A bluff hull may stay for the rest of a trial in a turn that no rudder ends (population, seeds
    3192 and 5070): however often the helm was moved, that is one turn against the rudder.
    """
    time, record = (trial.table[c].to_numpy() for c in ("time_s", RECORD_COLUMN))
    width = max(round(MEAN_S * trial.rate_hz), 1)
    smooth = trial.table[column].rolling(width, center=True, min_periods=1)
    side = np.sign(smooth.mean().to_numpy())
    found = [[turn.agrees] for turn in turns[:1]]
    for last, turn in itertools.pairwise(turns):
        since = (time >= last.end_s) & (time <= turn.end_s)
        if np.nanmin(side[since]) == np.nanmax(side[since]) and np.ptp(record[since]) == 0:
            found[-1].append(turn.agrees)
        else:
            found.append([turn.agrees])
    return [np.concatenate(parts) for parts in found]


def _step(
    time: np.ndarray,
    curvature: np.ndarray,
    before: slice,
    hold: slice,
    step: float,
    passage_s: float,
) -> list[np.ndarray]:
    """Whether the curvature changes as the step of the rudder says, once for each row."""
    start = time[hold.start]
    last = start + max(LEAST_STEP_S, LAST_LENGTHS * passage_s)
    after = hold.start + int(np.searchsorted(time[hold], last, "right")) - 1
    if time[after] - start < max(LEAST_STEP_S, STEP_LENGTHS * passage_s):
        return []
    change = curvature[after] - curvature[before.stop - 1]
    clear = abs(step) >= LEAST_RAD and abs(change) >= RESPONSE * abs(step)
    return [np.full(after - hold.start, change * step < 0)] if clear else []
