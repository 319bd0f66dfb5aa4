"""What a fin must have been for the vehicle to turn or pitch as it did.

A steady elevator gives a steady pitch, not a rate, and a hull that swings about it goes on for a
while; a rudder that stands for ten seconds leaves no settled turn. Only the balance of moments
shows the fin at every moment. With its terms estimated,

    dr/dt = a u^2 rudder + b u r + c u v + d r |r| + e u^2,
    dq/dt = a u^2 elevator + b u q + c u w + d sin(pitch) + e u^2 + f,

it is solved for the fin; f is a trim by weight, of which a slower vehicle shows more. What is
shallower than half its length is not looked at, as waves turn it too. The terms are taken from
where the fin was moved not long before: a stretch in which its log stands still does not spoil
them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from auvident.schema.logs import DEG
from auvident.schema.planes import HORIZONTAL, VERTICAL, PlaneRow
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.held import holds
from auvident.stages.ingest.response import (
    Relation,
    Signals,
    fit_relation,
    shifted,
    smooth_records,
)

LAGS_S = (0.0, 1.0)  # of a servo, and of the velocities behind it
MARGIN_S = 2.0  # for shifting, and as in the other checks
MOVED_LENGTHS, MOVED_S = 5.0, 5.0  # of way, time, since the fin was moved: tells its terms
SETTLE_LENGTHS, SETTLE_S = 0.3, 1.5  # after a step a servo and the smoothing are through
LEAST_S = 0.5  # that is left of a hold
END_S = 1.0  # of a hold, which the smoothing mixes with the next
PART_LENGTHS, PART_S = 1.0, 3.0  # of a hold, over which an angle is averaged
USUAL_RAD = 12.0 * DEG  # range of a fin that is steered: what is held is a share of its own
SURFACED = 0.5  # [L] depth within which it is at the surface
STATES = ("u", "side", "rate", "angle")  # of either plane, in the order of its columns


@dataclass(frozen=True)
class MomentsRow:
    """The moments of one plane: its row, the states that they need, what else than the fin turns.

    `rest` takes smoothed signals and the place of the DVL ahead of the origin (m); shape (n, p).
    """

    plane: PlaneRow
    states: int
    rest: Callable[[Signals, float], np.ndarray]

    @property
    def columns(self) -> dict[str, str]:
        """Column by name of the signal."""
        named = zip(STATES[: self.states], self.plane.columns, strict=False)
        return dict(named) | {"fin": self.plane.control_columns[0]}


def _yaw_rest(s: Signals, arm: float) -> np.ndarray:
    u, v, r = s["u"], s["side"] - arm * s["rate"], s["rate"]
    return np.column_stack((u * r, u * v, r * np.abs(r), u**2))


def _pitch_rest(s: Signals, arm: float) -> np.ndarray:
    u, w = s["u"], s["side"] + arm * s["rate"]
    return np.column_stack((u * s["rate"], u * w, np.sin(s["angle"]), u**2, np.ones_like(u)))


YAW, PITCH = MomentsRow(HORIZONTAL, 3, _yaw_rest), MomentsRow(VERTICAL, 4, _pitch_rest)


@dataclass(frozen=True)
class HeldFin:
    """A stretch in which the fin is held, once its servo has arrived.

    Attributes
    ----------
    start_s, end_s : float
    angle : float
        As logged (rad).
    shown : numpy.ndarray
        As the moments show it, of one part after another (rad).
    shown_std : numpy.ndarray
        Jackknife standard deviation of each.
    """

    start_s: float
    end_s: float
    angle: float
    shown: np.ndarray
    shown_std: np.ndarray


@dataclass(frozen=True)
class Moments:
    """The balance of moments, first the fin's, and what it shows of each hold.

    `usual` is the range of the fin to one side (rad).
    """

    relation: Relation
    holds: tuple[HeldFin, ...]
    usual: float


def moments(
    trial: Trial, vehicle: Vehicle, balance: MomentsRow, grip_mps: float, passage_s: float
) -> Moments | None:
    """Balance of the moments of one plane; None without its channels, or too little of them.

    Parameters
    ----------
    trial : Trial
    vehicle : Vehicle
    balance : MomentsRow
    grip_mps : float
        Speed above which the fins govern the motion.
    passage_s : float
        Time of a hull length of way.
    """
    columns = balance.columns
    if not set(columns.values()) <= set(trial.table.columns) or not np.isfinite(passage_s):
        return None
    records = smooth_records(trial, columns, MARGIN_S)
    time, fin = (trial.table[c].to_numpy(float) for c in ("time_s", columns["fin"]))
    known = fin[np.isfinite(fin)]
    usual = float(np.quantile(np.abs(known - np.median(known)), 0.95)) if known.size else 0.0
    if usual == 0.0:
        return None
    scale = USUAL_RAD / usual
    moved = _lately_moved(time, scale * fin, max(MOVED_S, MOVED_LENGTHS * passage_s))
    dived = _dived(trial, vehicle.hull.length_m)
    arm = vehicle.dvl.x_m

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        by_fin = s["u"] ** 2 * shifted(s, "fin", lag)
        return s["rate_dot"], np.column_stack((by_fin, balance.rest(s, arm)))

    def under_way(s: Signals) -> np.ndarray:
        return (s["u"] > grip_mps) & dived[np.searchsorted(time, s["time"])]

    def use(s: Signals) -> np.ndarray:
        return under_way(s) & moved[np.searchsorted(time, s["time"])]

    found = fit_relation(records, relation, LAGS_S, use)
    if found is None or found.theta[0] == 0.0:
        return None
    solve = _Solve(found, balance, arm, grip_mps, passage_s, trial.rate_hz, scale)
    held = [h for s in records for h in _held(s, under_way(s), solve)]
    return Moments(found, tuple(held), usual)


def _dived(trial: Trial, length_m: float) -> np.ndarray:
    """Rows in which a vehicle that dives is not at the surface."""
    rows = np.ones(len(trial.table), dtype=bool)
    depth = trial.table["depth_m"].to_numpy(float) if "depth_m" in trial.table.columns else rows
    surfaced = depth < SURFACED * length_m
    return ~surfaced if 2 * np.count_nonzero(surfaced) < surfaced.size else rows


def _lately_moved(time: np.ndarray, fin: np.ndarray, within_s: float) -> np.ndarray:
    """Rows in which the fin has not been held for long."""
    lately = np.isfinite(fin)
    for rows in _known(lately):
        for hold in holds(time[rows], fin[rows]):
            own = time[rows][hold]
            lately[rows][hold] = own < own[0] + within_s
    return lately


def _known(known: np.ndarray) -> Iterator[slice]:
    """Stretches without gaps."""
    edges = np.flatnonzero(np.diff(known.astype(int), prepend=0, append=0))
    yield from (slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True))


@dataclass(frozen=True)
class _Solve:
    """What the balance is solved for the fin with."""

    found: Relation
    balance: MomentsRow
    arm: float
    grip: float
    passage_s: float
    rate_hz: float
    scale: float


def _held(s: Signals, under_way: np.ndarray, by: _Solve) -> Iterator[HeldFin]:
    """Each hold of a record under way, with the angle that the moments show."""
    # The angle is linear in these, whatever the coefficients are.
    per = np.column_stack((s["rate_dot"], by.balance.rest(s, by.arm)))
    per /= np.maximum(s["u"], by.grip)[:, None] ** 2
    first_s = max(SETTLE_S, SETTLE_LENGTHS * by.passage_s) + by.found.lag_s
    part = max(round(min(PART_S, PART_LENGTHS * by.passage_s) * by.rate_hz), 1)
    for rows in _known(under_way):
        time, fin = s["time"][rows], s["fin"][rows]
        for hold in holds(time, by.scale * fin):
            inside = time[hold] >= time[hold.start] + first_s
            inside &= time[hold] <= time[hold.stop - 1] - END_S
            terms = per[rows][hold][inside]
            if len(terms) >= LEAST_S * by.rate_hz:
                parts = np.array_split(terms, max(len(terms) // part, 1))
                means = np.array([p.mean(axis=0) for p in parts])
                shown, std = by.found.derived(partial(_angles, means))
                angle = float(np.median(fin[hold][inside]))
                yield HeldFin(
                    float(time[hold.start]), float(time[hold.stop - 1]), angle, shown, std
                )


def _angles(means: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Angles of the fin, shape (..., parts), of means (parts, 1 + terms) and coefficients."""
    return (means[:, 0] - theta[..., 1:] @ means[:, 1:].T) / theta[..., :1]
