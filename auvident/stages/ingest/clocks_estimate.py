"""Lag of a sensor by one relation, or by several."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clocks_line import TINY, Line, Question, Signals, fit_line
from auvident.stages.ingest.clocks_relations import (
    SMOOTHING_LENGTHS,
    SYMBOLS,
    ClockRelation,
    fix_smoothing_s,
    smooth_signals,
    smoothing_s,
    symbols_of,
    with_course,
    with_derivatives,
    without_current,
)
from auvident.stages.ingest.resample import median_period

MIN_SPEED_MPS = 0.1
MIN_EXPLAINED = 0.3  # of the variance: below it the relation says nothing
FLOOR_S = 0.01  # no lag is known better: stamps are rounded, rows interpolated
GAIN_SPREAD = 1.5  # of errors in the drift over their jackknife deviation, even seeds
WIDEST_STD = 0.5  # s or L/U, the larger: a lag known no better is not worth telling
APART_STDS = 3.0  # lags further apart are not of one clock
UNLIKE_GAIN = 0.3  # of the lag of an unlike hull, what changes along a trial


@dataclass(frozen=True)
class ClockLag:
    """Lag of one sensor: at the middle of the trial, and what it gains to its end.

    `sure_std_s` and `sure_gain_std_s` count in that the equations leave out more where the
    smoothing is wide for the vehicle, and on hulls unlike those of the population. What a right
    clock, and one without drift, leave unexplained over what this one does are `right` and
    `steady`. It is `kinematic` where it holds whatever the vehicle; `instead` is a sensor that
    may as well be the one that is off.
    """

    lag_s: float
    std_s: float
    sure_std_s: float
    gain_s: float
    gain_std_s: float
    sure_gain_std_s: float
    at_s: float
    half_s: float
    explained: float
    right: float
    steady: float
    against: tuple[str, ...]
    kinematic: bool
    instead: str = ""

    def opposite(self) -> "ClockLag":
        """The same of the other of the two sensors."""
        return replace(self, lag_s=-self.lag_s, gain_s=-self.gain_s)


@dataclass(frozen=True)
class Lags:
    """Estimates by sensor, and why there is none."""

    of: dict[str, ClockLag] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


def passage_s(trial: Trial, vehicle: Vehicle) -> float:
    """Time in s in which the vehicle travels its length at the median of its speeds."""
    speed = trial.table["u_mps"].to_numpy(dtype=float)
    moving = speed[speed > MIN_SPEED_MPS]
    return vehicle.hull.length_m / (float(np.median(moving)) if moving.size else MIN_SPEED_MPS)


def combined(found: Sequence[ClockLag]) -> ClockLag:
    """Mean of several estimates by their weights; the scatter between them counts.

    One of them that shows that a clock is wrong is enough evidence for those that agree with it.
    """
    if len(found) == 1:
        return found[0]
    lag, std = _mean([(e.lag_s, e.std_s) for e in found])
    gain, gain_std = _mean([(e.gain_s, e.gain_std_s) for e in found])
    sure = _mean([(e.lag_s, e.sure_std_s) for e in found])[1]
    sure_gain = _mean([(e.gain_s, e.sure_gain_std_s) for e in found])[1]
    return replace(
        min(found, key=lambda e: e.std_s),
        lag_s=lag,
        std_s=std,
        sure_std_s=max(std, sure),
        gain_s=gain,
        gain_std_s=gain_std,
        sure_gain_std_s=max(gain_std, sure_gain),
        right=max(e.right for e in found),
        steady=max(e.steady for e in found),
        against=tuple(a for e in found for a in e.against),
        kinematic=any(e.kinematic for e in found),
    )


def _mean(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    known = [(x, std) for x, std in pairs if np.isfinite(std)]
    if not known:
        return 0.0, float("inf")
    x, weight = np.array([p[0] for p in known]), np.array([p[1] for p in known]) ** -2.0
    mean = float(x @ weight / weight.sum())
    scatter = float((x - mean) ** 2 @ weight) / max(len(known) - 1, 1)
    return mean, float(np.sqrt(max(1.0, scatter) / weight.sum()))


def put_right(trial: Trial, sensor: str, found: ClockLag) -> Trial:
    """The trial with the columns of one sensor read at ``t + lag(t)``."""
    table = trial.table.copy()
    time = table["time_s"].to_numpy()
    gain = found.gain_s if np.isfinite(found.gain_std_s) else 0.0
    lag = found.lag_s + gain * (time - found.at_s) / found.half_s
    for column in table.columns:
        if column in BY_COLUMN and BY_COLUMN[column].sensor == sensor:
            values = table[column].to_numpy(dtype=float)
            table[column] = np.interp(time + lag, time, values, left=np.nan, right=np.nan)
    return trial.with_table(table)


class Bench:
    """Signals of one trial, smoothed when they are first wanted."""

    def __init__(self, raw: RawTrial, trial: Trial, vehicle: Vehicle, passage: float) -> None:
        self.raw, self.trial, self.vehicle, self.passage = raw, trial, vehicle, passage
        self._signals: dict[float, Signals] = {}

    def with_trial(self, trial: Trial) -> "Bench":
        """The same on other signals."""
        return Bench(self.raw, trial, self.vehicle, self.passage)

    def unexplained(self, row: ClockRelation) -> float | None:
        """Share that the best lag leaves; None where a relation cannot be judged."""
        line = self._line(row, row.widths[0] * self._width_s(row))
        return None if line is None or line.explained < MIN_EXPLAINED else 1.0 - line.explained

    def estimate(self, row: ClockRelation) -> ClockLag | None:
        """Lag by one relation, at the first of its widths at which it is distinct."""
        for factor in row.widths:
            width = factor * self._width_s(row)
            line = self._line(row, width)
            if line is not None and is_distinct(line, row):
                passage = factor * self.passage
                usual = width if row.slow else SMOOTHING_LENGTHS * passage
                return _estimate(line, row, passage, max(1.0, width / usual))
        return None

    def why(self, rows: Sequence[ClockRelation]) -> str:
        """What is lacking for a test."""
        lacking = {self._lacks(row) for row in rows}
        if not all(lacking):
            return "the maneuvers do not determine the lag: more turns, zigzags or steps would"
        return "needs " + ", or ".join(sorted(lacking))

    def _lacks(self, row: ClockRelation) -> str:
        names = [SYMBOLS[s] for s in (row.own[0], *row.others) if s in SYMBOLS]
        return " and ".join(n for n in names if n not in self.trial.table)

    def _width_s(self, row: ClockRelation) -> float:
        if not row.slow or "position" not in self.raw.sensors:
            return smoothing_s(self.passage)
        stamps = self.raw.sensors["position"].time_s
        return fix_smoothing_s(self.passage, median_period(np.sort(stamps[np.isfinite(stamps)])))

    def _line(self, row: ClockRelation, width: float) -> Line | None:
        signals = self._smooth(width, row.slow)
        if not {row.own[0], *row.others} <= set(signals):
            return None
        both = (signals, without_current(signals)) if row.in_water else (signals,)
        lines = (self._fit(row, s, width) for s in both)
        return max((x for x in lines if x is not None), key=lambda x: x.explained, default=None)

    def _fit(self, row: ClockRelation, signals: Signals, width: float) -> Line | None:
        own = [n for n in with_derivatives(symbols_of(row.sensor)) if n in signals]
        return fit_line(
            Question(signals, own, lambda s: row.equations(s, self.vehicle), width, row.prior)
        )

    def _smooth(self, width: float, with_fixes: bool) -> Signals:
        if width not in self._signals:
            self._signals.clear()  # one width at a time: those of a day are large
            signals = smooth_signals(self.trial, width)
            if with_fixes:
                signals = with_course(signals, self.trial, self.vehicle, width)
            self._signals[width] = signals
        return self._signals[width]


def is_distinct(line: Line, row: ClockRelation) -> bool:
    """Whether a line is the only one that explains the relation."""
    known = np.isfinite(line.lag_std_s) and line.alone and not line.at_edge
    return bool(known and line.explained >= MIN_EXPLAINED and line.rival >= row.rival)


def _estimate(line: Line, row: ClockRelation, passage: float, wide: float) -> ClockLag | None:
    """A line with what its relation leaves out, at a smoothing `wide` times the usual."""
    usual, spread = (passage * x for x in row.usual_lengths)
    gain_std = np.hypot(GAIN_SPREAD * line.gain_std_s, row.gain_lengths * passage)
    drifts = line.gain_s**2 > (APART_STDS * gain_std) ** 2
    lag, lag_std = (line.lag_s, line.lag_std_s)
    if drifts:
        lag, lag_std = line.middle_s, line.middle_std_s
    std = float(np.sqrt(lag_std**2 + spread**2 + FLOOR_S**2))
    if not std <= WIDEST_STD * max(1.0, passage):
        return None
    unlike = passage * row.unlike_lengths
    gain_std = float(np.hypot(gain_std, FLOOR_S))
    return ClockLag(
        lag_s=float(lag) - usual,
        std_s=std,
        sure_std_s=float(np.sqrt(std**2 + spread**2 * (wide**2 - 1.0) + unlike**2)),
        gain_s=float(line.gain_s) if np.isfinite(gain_std) else 0.0,
        gain_std_s=gain_std,
        sure_gain_std_s=float(np.hypot(gain_std, UNLIKE_GAIN * unlike)),
        at_s=line.at_s,
        half_s=line.half_s,
        explained=float(line.explained_drifting if drifts else line.explained),
        right=line.right,
        steady=(1.0 - line.explained) / max(1.0 - line.explained_drifting, TINY),
        against=(row.against,),
        kinematic=row.kinematic,
    )
