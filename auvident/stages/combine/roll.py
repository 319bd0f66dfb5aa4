"""Roll from logs that show it: least squares of the roll equation, the geometry as prior.

Everything in the equation but the free terms is known from planes, geometry and vehicle file, the
righting moment above all, which gives the scale. What is left is torque of turbulence and of what
the equation lacks, slow beside the rows of a log: it is whitened as a first-order process before
it counts as noise (Cochrane and Orcutt). As that torque moves the roll at once, the rates and
accelerations are taken as half a period of the roll before predicts them (two-stage least
squares): else the inertia comes out by a tenth and the damping by a third too small. Velocities
over the water are averaged over a period: a DVL above or below the origin, as no vehicle file
says exactly, reads sway where there is roll. Only maneuvers that identify are looked at.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.ndimage import uniform_filter1d

from auvident.physics.sensing import DVL_PITCH, SCALE, YAW
from auvident.physics.six_dof import balance, variables_of
from auvident.physics.six_dof_terms import (
    ROLL_SIGNS,
    ROLL_UNITS,
    SixDofStructure,
    six_dof_structure,
)
from auvident.schema.artifacts import Maneuvers, Role, Sensing
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN
from auvident.schema.combined import CombinedEntry, CombinedModel, CovarianceBlock
from auvident.schema.planes import PLANES
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.combine.flight import plane_frame

Array = npt.NDArray[np.float64]
Logs = Sequence[tuple[Sequence[Trial], Maneuvers]]

IDENTIFIED = "identified, roll"
# K_pdot goes with I_xx alone, and the ties of sway and yaw to roll with what the planes have
DRIVEN = ("I_xx", "K_up", "K_p|p|")  # what they multiply follows the torque at once
FREE = ("I_xx", "K_up", "K_p|p|", "K_uv", "K_ur", "K_nn", "K_nu")
COLUMNS = (
    *("u_mps", "v_mps", "w_mps", "p_radps", "q_radps", "r_radps", "roll_rad", "pitch_rad"),
    *("rudder_rad", "elevator_rad", "rpm"),
)
TORQUE = {"K_nn": "T_nn", "K_nu": "T_nu"}
TORQUE_SHARE = 0.3  # of thrust times diameter; K_Q is 0.1 to 0.2 of K_T (Wageningen B series)
USUAL_PROPELLER = 0.7  # diameters of the hull, where the file has no propeller
LEAST_SHARE = 0.1  # of the prior variance that the data have to take for a term to be theirs
INSTRUMENT_LAG = 0.5  # periods of the roll
SMOOTHED = (0.25, 0.75, 1.0, 0.75, 0.25)  # both sides of the equation, against noise of rates
DIFFERENCES = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0  # first derivative, fourth order
LEAST_ROWS = 100
PASSES, SETTLED = 20, 1e-6


@dataclass(frozen=True)
class RollPiece:
    """Uninterrupted rows of the balance of the roll equation.

    Attributes
    ----------
    rows : (n, n_parameters) array
        What each parameter is multiplied by; the sum is the torque of the unknown.
    lag : int
        Rows back that predict what is `DRIVEN`.
    """

    rows: Array
    lag: int

    @property
    def is_long(self) -> bool:
        """Whether half of its rows or more have one that predicts them."""
        return len(self.rows) > 2 * self.lag


@dataclass(frozen=True)
class RollFit:
    """Values of the free terms, their covariance and the share of the data in each."""

    values: Array
    covariance: Array
    shares: Array


def with_roll(model: CombinedModel, vehicle: Vehicle, logs: Logs) -> CombinedModel:
    """The model with roll as the logs show it; as it was, where they do not.

    Parameters
    ----------
    model : CombinedModel
    vehicle : Vehicle
    logs : sequence of (trials, maneuvers)
        Of each run.
    """
    structure, prior, period = six_dof_structure(), _priors(model, vehicle), roll_period_s(model)
    cut = _pieces(logs) if np.isfinite(period) else ()
    pieces = [
        RollPiece(
            _smoothed(balance(structure, "K", *_motion(piece, model, dt_s, period))),
            max(round(INSTRUMENT_LAG * period / dt_s), 1),
        )
        for piece, dt_s in cut
    ]
    long = [piece for piece in pieces if piece.is_long]
    if not long:
        return model
    return _updated(model, prior, fitted(structure, model.values(), prior, long))


def roll_period_s(model: CombinedModel) -> float:
    """Period of the undamped roll [s]; infinite without a righting moment."""
    values = model.values()
    inertia = values["I_xx"] - values.get("K_pdot", 0.0)
    if not (values["z_GW"] > 0.0 and inertia > 0.0):
        return float("inf")
    return float(2.0 * np.pi * np.sqrt(inertia / values["z_GW"]))


def _priors(model: CombinedModel, vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each free term before the data."""
    rows = {e.symbol: (e.value, e.std) for e in model.entries}
    values = model.values()
    hull = vehicle.hull.diameter_m or vehicle.hull.beam_m or vehicle.hull.length_m
    diameter = vehicle.propeller.diameter_m if vehicle.propeller else USUAL_PROPELLER * hull
    for symbol, thrust in TORQUE.items():
        rows.setdefault(symbol, (0.0, TORQUE_SHARE * abs(values[thrust]) * diameter))
    return {symbol: rows[symbol] for symbol in FREE if rows.get(symbol, (0.0, 0.0))[1] > 0.0}


def _pieces(logs: Logs) -> Iterator[tuple[pd.DataFrame, float]]:
    """Uninterrupted rows of maneuvers that identify, with all channels, and their step."""
    for trials, maneuvers in logs:
        for trial in trials:
            if not set(COLUMNS) <= set(trial.table):
                continue
            usable = _within(trial, maneuvers, "identify") & ~_within(trial, maneuvers, "validate")
            usable &= trial.table[list(COLUMNS)].notna().all(axis=1).to_numpy()
            breaks = np.diff(usable.astype(int), prepend=0) != 0
            breaks |= trial.table[RECORD_COLUMN].diff().fillna(0).ne(0).to_numpy()
            for _, piece in trial.table[usable].groupby(np.cumsum(breaks)[usable]):
                if len(piece) >= LEAST_ROWS:
                    yield piece, 1.0 / trial.rate_hz


def _within(trial: Trial, maneuvers: Maneuvers, role: Role) -> npt.NDArray[np.bool_]:
    """Rows of a trial in its maneuvers of a role."""
    time, found = trial.table[TIME_COLUMN].to_numpy(), np.zeros(len(trial.table), dtype=bool)
    for m in maneuvers.maneuvers:
        if m.trial == trial.name and m.role == role:
            found |= (time >= m.t_start_s) & (time < m.t_end_s)
    return found


def _motion(
    piece: pd.DataFrame, model: CombinedModel, dt_s: float, period_s: float
) -> tuple[Array, Array]:
    """Variables (n, k) and accelerations (n, 6) at the origin."""
    columns = {c: piece[c].to_numpy(float) for c in COLUMNS}
    velocities = _at_origin(columns, model.sensing[PLANES[0]], _sensor_effects(model, dt_s))
    size = max(round(period_s / dt_s), 1)
    velocities[:, :3] = uniform_filter1d(velocities[:, :3], size, axis=0, mode="nearest")
    angles = np.column_stack([columns["roll_rad"], columns["pitch_rad"]])
    inputs = np.column_stack(
        [columns["rudder_rad"], columns["elevator_rad"], columns["rpm"] / 60.0]
    )
    accelerations = np.column_stack(
        [np.convolve(x, DIFFERENCES[::-1], mode="same") / dt_s for x in velocities.T]
    )
    return variables_of(velocities, angles, inputs), accelerations


def _sensor_effects(model: CombinedModel, dt_s: float) -> Array:
    """Effects in the order of `READING`, each of the first plane that carries it."""
    frames = (plane_frame(model, plane, dt_s) for plane in PLANES)
    first, second = (frame.reading_effects(p) for frame, p in frames)
    return np.where(first != 0.0, first, second)


def _at_origin(columns: Mapping[str, Array], sensing: Sensing, effects: Array) -> Array:
    """Velocities (n, 6) of the origin from those of the DVL (theory 1.1 and 1.5).

    The DVL is turned as the vehicle file says, and as much further as the models found; its scale
    is theirs, too.
    """
    yaw = sensing.dvl_mounting_yaw_rad + effects[YAW]
    u, v, w = (columns[name] / (1.0 + effects[SCALE]) for name in ("u_mps", "v_mps", "w_mps"))
    u, v = np.cos(yaw) * u - np.sin(yaw) * v, np.sin(yaw) * u + np.cos(yaw) * v
    pitch = effects[DVL_PITCH]
    ahead, below = np.cos(pitch) * u + np.sin(pitch) * w, np.cos(pitch) * w - np.sin(pitch) * u
    p, q, r = (columns[name] for name in ("p_radps", "q_radps", "r_radps"))
    x, y, z = sensing.dvl_x_m, sensing.dvl_y_m, sensing.dvl_z_m
    return np.column_stack(
        [
            ahead - q * z + r * y,
            v - r * x + p * z,
            below - p * y + q * x,
            *(p, q, r),
        ]
    )


def _smoothed(rows: Array) -> Array:
    """Rows (n, k) averaged over half a second of a log at 10 Hz, without the ends."""
    weights = np.array(SMOOTHED) / np.sum(SMOOTHED)
    ends = len(SMOOTHED)
    return np.apply_along_axis(np.convolve, 0, rows, weights, mode="same")[ends:-ends]


def fitted(
    structure: SixDofStructure,
    values: Mapping[str, float],
    prior: Mapping[str, tuple[float, float]],
    pieces: Sequence[RollPiece],
) -> RollFit:
    """Least squares of the balance of the roll equation.

    Parameters
    ----------
    structure : SixDofStructure
    values : mapping
        Of every other parameter.
    prior : mapping
        Value and standard deviation of each free one.
    pieces : sequence of RollPiece
        At least one, each long enough for its lag.
    """
    names = tuple(prior)
    free = [structure.parameters.index(name) for name in names]
    known = structure.vector(values)
    known[free] = [prior[name][0] for name in names]
    scale = np.array([prior[name][1] for name in names])
    lags = [piece.lag for piece in pieces]
    slopes = [piece.rows[:, free] * scale for piece in pieces]
    left = [-(piece.rows @ known) for piece in pieces]
    driven = [k for k, name in enumerate(names) if name in DRIVEN]
    memory, found = 0.0, np.zeros(len(free))
    for _ in range(PASSES):
        white = [x[1:] - memory * x[:-1] for x in slopes]
        a = np.vstack([x[lag:] for x, lag in zip(white, lags, strict=True)])
        before = np.vstack([x[:-lag] for x, lag in zip(white, lags, strict=True)])
        pairs = zip(left, lags, strict=True)
        y = np.concatenate([x[1 + lag :] - memory * x[lag:-1] for x, lag in pairs])
        variance = float(np.mean((y - a @ found) ** 2)) * _repeats(y - a @ found)
        a = _predicted(a, before, driven)
        information = a.T @ a / variance + np.eye(len(free))
        last, found = found, np.linalg.solve(information, a.T @ y / variance)
        rest = [y_ - x @ found for x, y_ in zip(slopes, left, strict=True)]
        memory = sum(e[1:] @ e[:-1] for e in rest) / sum(e[:-1] @ e[:-1] for e in rest)
        if np.abs(found - last).max() < SETTLED:
            break
    covariance = np.linalg.inv(information)
    moved = np.array([prior[name][0] for name in names]) + scale * found
    shares = np.asarray(1.0 - np.diag(covariance), dtype=np.float64)
    scaled = np.asarray(covariance * np.outer(scale, scale), dtype=np.float64)
    return RollFit(moved, scaled, shares)


def _predicted(rows: Array, before: Array, driven: Sequence[int]) -> Array:
    """Rows (n, k) with the driven columns as those of a while before predict them."""
    instruments = rows.copy()
    instruments[:, driven] = before[:, driven]
    weights, *_ = np.linalg.lstsq(instruments, rows, rcond=None)
    return np.asarray(instruments @ weights)


def _repeats(residual: Array) -> float:
    """How many rows say the same: the sum of the correlations up to the first that is none."""
    residual = residual - residual.mean()
    power, total = float(residual @ residual), 1.0
    for lag in range(1, len(residual) // 2):
        correlation = float(residual[lag:] @ residual[:-lag]) / power
        if correlation <= 0.0:
            break
        total += 2.0 * correlation
    return total


def _updated(
    model: CombinedModel, prior: Mapping[str, tuple[float, float]], fit: RollFit
) -> CombinedModel:
    """The model with the terms that the data determined."""
    names = tuple(prior)
    kept = [k for k, share in enumerate(fit.shares) if share >= LEAST_SHARE]
    if not kept:
        return model
    rows = {names[k]: _entry(names[k], k, fit) for k in kept}
    matrix = fit.covariance[np.ix_(kept, kept)].tolist()
    block = CovarianceBlock(
        origin=IDENTIFIED, symbols=tuple(rows), matrix=tuple(tuple(row) for row in matrix)
    )
    blocks = [_without(b, rows) for b in model.covariance]
    said = {"no-torque"} if set(TORQUE) & set(rows) else set()
    others = [e for e in model.coefficients if e.symbol not in rows]
    new = [row for symbol, row in rows.items() if symbol != "I_xx"]
    return model.model_copy(
        update={
            "coefficients": (*others, *new),
            "constants": tuple(rows.get(e.symbol, e) for e in model.constants),
            "covariance": (*(b for b in blocks if b.symbols), block),
            "findings": tuple(
                f for f in model.findings if f.code not in said | {"roll-from-geometry"}
            ),
        }
    )


def _entry(symbol: str, k: int, fit: RollFit) -> CombinedEntry:
    return CombinedEntry(
        symbol=symbol,
        value=float(fit.values[k]),
        std=float(np.sqrt(fit.covariance[k, k])),
        unit=ROLL_UNITS[symbol],
        origin=IDENTIFIED,
        data_share=float(fit.shares[k]),
        sign=ROLL_SIGNS.get(symbol, 0),
    )


def _without(block: CovarianceBlock, rows: Mapping[str, CombinedEntry]) -> CovarianceBlock:
    """A block less what another block has now."""
    kept = [k for k, symbol in enumerate(block.symbols) if symbol not in rows]
    return CovarianceBlock(
        origin=block.origin,
        symbols=tuple(block.symbols[k] for k in kept),
        matrix=tuple(tuple(block.matrix[i][j] for j in kept) for i in kept),
    )
