"""One fit of the horizontal model by other means, on the same data, from the same start.

``python -m tests.bench casadi`` (extra ``bench``). The motion, its discretisation, the readings
and the whitening are written out here from docs/equations.md and share no code with the package;
what is taken from it are data (records, prior, noise). One set of equations serves CasADi, where
it becomes a graph with exact derivatives, and numpy, where all records and all shifted parameters
are simulated at once and differences are taken. Both are minimised by `scipy.optimize`. That all
three have the same cost is shown by evaluating each at the solutions of all.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from auvident.constants import FITTED_START_STD
from auvident.engines.estimator import task_of
from auvident.engines.free_run import OutputError, likelihood
from auvident.engines.map_fit import Prior, map_fit
from auvident.engines.noise import coloured_noise, effective_noise, white
from auvident.engines.prediction import Free
from auvident.physics.consistency import UNCONSTRAINED
from tests.engines.chain import plan_named, sample

FALL = 1e-7  # relative fall of the cost at which a fit has converged
STEPS = 100
SHIFT = 1e-6  # [prior standard deviations] of a difference
SHIFT_OF_START = 1e-5  # [m/s, rad/s]
WIDTH = 3  # states u, v, r; as many readings
Array = np.ndarray
Rows = list[dict[str, Any]]
# theta -> half the squared error with the prior; residuals (n,) and slopes (n, m) behind it
Residuals = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Piece:
    """One record as the other fits take it.

    Attributes
    ----------
    inputs : (n, 3) array
        Rudder, elevator [rad], propeller rate [1/s].
    read : (n, 3) array
        Zero where nothing was.
    start : (3,) array
    gain, scale : (n, 3) array
        Of the whitening filter, see `whitening`; zero where nothing was read.
    """

    inputs: Array
    read: Array
    start: Array
    gain: Array
    scale: Array


@dataclass(frozen=True)
class Case:
    """One fit: the package's own way of asking for it, and the same as plain arrays."""

    output: OutputError
    free: Free
    prior: Prior
    start: Array
    names: tuple[str, ...]
    pieces: tuple[Piece, ...]
    keep: Array
    start_stds: Array
    root: Array  # of the information of the prior

    def values(self, theta: Sequence[Any]) -> dict[str, Any]:
        """Coefficients and constants by name; N_vdot is as far from its estimate as Y_rdot."""
        found = dict(zip(self.names, self.start.tolist(), strict=True))
        for k, i in enumerate(self.free.positions):
            found[self.names[i]] = found[self.names[i]] + float(self.free.scale[k]) * theta[k]
        change = found["Y_rdot"] - float(self.start[self.names.index("Y_rdot")])
        return found | {"N_vdot": found["N_vdot"] + change}


# --- the same model, written out ------------------------------------------------------------


def rates(x: Sequence[Any], inputs: Sequence[Any], p: dict[str, Any]) -> list[Any]:
    """Accelerations of surge, sway and yaw (docs/equations.md, motion)."""
    u, v, r = x
    rudder, elevator, n = inputs
    m, mx = p["m"], p["m x_G"]
    thrust = p["T_nn"] * n * abs(n) + p["T_nu"] * abs(n) * u
    surge = p["X_uu"] * u * abs(u) + p["X_vv"] * v * v + (p["X_vr"] + m) * v * r + thrust
    surge = surge + (p["X_rr"] + mx) * r * r + p["X_uudd"] * u * u * (rudder**2 + elevator**2)
    sway = p["Y_uv"] * u * v + (p["Y_ur"] - m) * u * r + p["Y_v|v|"] * v * abs(v)
    sway = sway + p["Y_r|r|"] * r * abs(r) + p["Y_uud"] * u * u * rudder
    yaw = p["N_uv"] * u * v + (p["N_ur"] - mx) * u * r + p["N_v|v|"] * v * abs(v)
    yaw = yaw + p["N_r|r|"] * r * abs(r) + p["N_uud"] * u * u * rudder
    vv, vr = m - p["Y_vdot"], mx - p["Y_rdot"]
    rv, rr = mx - p["N_vdot"], p["I"] - p["N_rdot"]
    whole = vv * rr - vr * rv
    return [
        surge / (m - p["X_udot"]), (rr * sway - vr * yaw) / whole, (vv * yaw - rv * sway) / whole
    ]  # fmt: skip


def step(x: Sequence[Any], inputs: Sequence[Any], p: dict[str, Any], dt: float) -> list[Any]:
    """One step of Runge-Kutta, fourth order, with the input as its mean."""
    k1 = rates(x, inputs, p)
    k2 = rates([a + 0.5 * dt * k for a, k in zip(x, k1, strict=True)], inputs, p)
    k3 = rates([a + 0.5 * dt * k for a, k in zip(x, k2, strict=True)], inputs, p)
    k4 = rates([a + dt * k for a, k in zip(x, k3, strict=True)], inputs, p)
    parts = zip(x, k1, k2, k3, k4, strict=True)
    return [a + dt / 6.0 * (i + 2.0 * j + 2.0 * k + end) for a, i, j, k, end in parts]


def reading(x: Sequence[Any], place: Array) -> list[Any]:
    """Of the DVL at its place (x, y), and of the gyro."""
    u, v, r = x
    return [u - r * place[1], v + r * place[0], r]


def whitening(seen: Array, keep: float, noise: float, slow: float) -> tuple[Array, Array]:
    """Gain, and one over the standard deviation, of a Kalman filter for noise and disturbance."""
    gain, scale = np.zeros(len(seen)), np.zeros(len(seen))
    variance = slow**2
    for k, there in enumerate(seen):
        if there:
            gain[k] = variance / (variance + noise**2)
            scale[k] = (variance + noise**2) ** -0.5
            variance *= 1.0 - gain[k]
        variance = keep**2 * variance + (1.0 - keep**2) * slow**2
    return gain, scale


def onward(
    z: Sequence[Any], row: Sequence[Any], p: dict[str, Any], case: Case
) -> tuple[list[Any], list[Any]]:
    """From states and expected disturbances to the next ones, and the whitened residuals."""
    x, slow = z[:WIDTH], z[WIDTH:]
    inputs, read, gain, scale = (row[k : k + WIDTH] for k in range(0, 4 * WIDTH, WIDTH))
    place = np.array([case.output.frame.sensing.dvl_x_m, case.output.frame.sensing.dvl_y_m])
    off = [y - z - s for y, z, s in zip(reading(x, place), read, slow, strict=True)]
    expected = [
        (s + g * o) * k for s, g, o, k in zip(slow, gain, off, case.keep.tolist(), strict=True)
    ]
    following = step(x, inputs, p, case.output.frame.dt_s)
    return [*following, *expected], [o * s for o, s in zip(off, scale, strict=True)]


def rows_of(piece: Piece) -> Array:
    """Data (n, 12) of a record, a row for each step."""
    return np.column_stack([piece.inputs, piece.read, piece.gain, piece.scale])


def without_start(e: Array, by_start: Array, by_theta: Array, case: Case) -> tuple[Array, Array]:
    """Residuals and slopes of a record once its start is where it fits best."""
    own = np.vstack([by_start, np.diag(1.0 / case.start_stds)])
    q, _ = np.linalg.qr(own)
    both = np.vstack([np.column_stack([e, by_theta]), np.zeros((WIDTH, 1 + by_theta.shape[1]))])
    both -= q @ (q.T @ both)
    return both[:, 0], both[:, 1:]


def whole(parts: Sequence[tuple[Array, Array]], theta: Array, case: Case) -> tuple[Array, Array]:
    """All records and the prior."""
    away = case.root @ (theta - case.prior.mean)
    return np.concatenate([*(e for e, _ in parts), away]), np.vstack(
        [*(j for _, j in parts), case.root]
    )


# --- CasADi ---------------------------------------------------------------------------------


def casadi_residuals(case: Case) -> Residuals:
    """Exact derivatives: those of a step, by CasADi, carried along a graph of each record.

    The Jacobian of the whole graph takes CasADi four times as long: it goes through each step for
    every direction anew.
    """
    import casadi as ca

    m, n_slopes = len(case.free.positions), WIDTH + len(case.free.positions)
    z, row, theta = ca.SX.sym("z", 2 * WIDTH), ca.SX.sym("row", 4 * WIDTH), ca.SX.sym("theta", m)
    by = ca.SX.sym("by", 2 * WIDTH, n_slopes)
    found = onward(ca.vertsplit(z), ca.vertsplit(row), case.values(ca.vertsplit(theta)), case)
    after, white_ = (ca.vertcat(*values) for values in found)

    def carried(values: Any) -> Any:
        own = ca.horzcat(ca.SX(values.numel(), WIDTH), ca.jacobian(values, theta))
        return ca.horzcat(values, ca.jacobian(values, z) @ by + own)

    one = ca.Function("one", [ca.horzcat(z, by), row, theta], [carried(after), carried(white_)])

    @cache
    def of_length(n: int) -> Any:
        return one.mapaccum("many", n)

    pieces = []
    for piece in case.pieces:
        begin = np.zeros((2 * WIDTH, 1 + n_slopes))
        begin[:WIDTH, 0], begin[:WIDTH, 1 : 1 + WIDTH] = piece.start, np.eye(WIDTH)
        pieces.append((of_length(len(piece.inputs)), begin, rows_of(piece).T))

    def residuals(theta: Array) -> tuple[Array, Array]:
        parts = []
        for function, begin, data in pieces:
            p = np.repeat(theta[:, None], data.shape[1], 1)
            out = function(begin, data, p)[1].full()
            own = out.reshape(WIDTH, -1, 1 + n_slopes).reshape(-1, 1 + n_slopes)
            parts.append(without_start(own[:, 0], own[:, 1 : 1 + WIDTH], own[:, 1 + WIDTH :], case))
        return whole(parts, theta, case)

    return residuals


# --- numpy ----------------------------------------------------------------------------------


def numpy_residuals(case: Case) -> Residuals:
    """Differences: all records with all shifted starts and parameters at once, step by step."""
    m, longest = len(case.free.positions), max(len(i.inputs) for i in case.pieces)
    data = np.zeros((longest, 4 * WIDTH, len(case.pieces), 1))
    for k, piece in enumerate(case.pieces):
        data[: len(piece.inputs), :, k, 0] = rows_of(piece)
    starts = np.array([i.start for i in case.pieces]).T[:, :, None]
    # the cost has the slopes by the start in it: central differences, others on one side
    there, back = SHIFT_OF_START * np.eye(WIDTH), -SHIFT_OF_START * np.eye(WIDTH)
    moved = np.hstack([np.zeros((WIDTH, 1)), there, back, np.zeros((WIDTH, m))])
    shift = np.hstack([np.zeros((m, 1 + 2 * WIDTH)), SHIFT * np.eye(m)])

    def residuals(theta: Array) -> tuple[Array, Array]:
        p = case.values(list(theta[:, None] + shift))
        begin = starts + moved[:, None]
        z = [*begin, *np.zeros((WIDTH, *begin.shape[1:]))]
        found = np.empty((longest, WIDTH, *begin.shape[1:]))
        with np.errstate(all="ignore"):  # where it runs away the solver sees that it does
            for k in range(longest):
                z, found[k] = onward(z, data[k], p, case)
        parts = []
        for k, piece in enumerate(case.pieces):
            own = found[: len(piece.inputs), :, k].reshape(-1, found.shape[-1])
            e, plus, minus, ahead = np.split(own, (1, 1 + WIDTH, 1 + 2 * WIDTH), axis=1)
            by_start = (plus - minus) / (2.0 * SHIFT_OF_START)
            parts.append(without_start(e[:, 0], by_start, (ahead - e) / SHIFT, case))
        return whole(parts, theta, case)

    return residuals


# --- fits -----------------------------------------------------------------------------------


def case_of(trial: str = "harbour_trial", most: int | None = None) -> Case:
    """The last stage of the default plan on a sample trial, from the estimate from geometry.

    The noise is held: that which the package finds with its own fit. Constraints of physics are
    left out, as they have no counterpart in a least-squares solver. `most` takes only so many
    records.
    """
    setup = sample(trial).setup(plan=plan_named("refined"))
    task, p = task_of(setup, setup.plan.stage[-1]), setup.prior
    prior = task.prior_about(p)
    noisy = white(effective_noise(task.output, p, setup.sensor_std))
    first = OutputError(task.output.frame, task.output.records[:most], task.output.active, noisy)
    there, _ = map_fit(first, task.free, prior, p, STEPS, FALL)
    colours = coloured_noise(first, there, setup.sensor_std)
    output = OutputError(first.frame, first.records, first.active, colours)
    plain = Prior(
        prior.mean, prior.information, prior.low, prior.high, p[task.positions], UNCONSTRAINED
    )
    own = colours[:WIDTH]
    keep = np.exp([-setup.dt_s / c.time_s for c in own])
    pieces = []
    for record in output.records:
        read = record.measured[:, :WIDTH]
        filters = [
            whitening(np.isfinite(read[:, c]), keep[c], own[c].white, own[c].slow)
            for c in range(WIDTH)
        ]
        gain, scale = (np.column_stack([f[k] for f in filters]) for k in (0, 1))
        pieces.append(
            Piece(record.inputs[:, :3], np.nan_to_num(read), record.start[:WIDTH], gain, scale)
        )
    return Case(
        output, task.free, plain, p.copy(), setup.structure.parameters, tuple(pieces), keep,
        FITTED_START_STD * np.hypot([c.white for c in own], [c.slow for c in own]),
        np.linalg.cholesky(prior.information).T,
    )  # fmt: skip


def own_cost(case: Case, theta: Array) -> float:
    """Half the squared error and the distance from the prior, as the package has them."""
    p = case.free.at(case.start, case.start[case.free.positions] + case.free.scale * theta)
    half, _, _ = likelihood(case.output, p, case.free)
    away = theta - case.prior.mean
    return half + 0.5 * float(away @ case.prior.information @ away)


def own_fit(case: Case) -> tuple[Array, int]:
    """Deviations where the package's fit ends, and evaluations."""
    _, found = map_fit(case.output, case.free, case.prior, case.start, STEPS, FALL)
    return found.theta, 1 + found.iterations


def scipy_fit(case: Case, residuals: Residuals) -> tuple[Array, int]:
    """Deviations where scipy's least squares end with the slopes of `residuals`, evaluations."""
    from scipy.optimize import least_squares

    last: dict[bytes, tuple[Array, Array]] = {}

    def at(theta: Array) -> tuple[Array, Array]:
        if theta.tobytes() not in last:
            last.clear()
            last[theta.tobytes()] = residuals(theta)
        return last[theta.tobytes()]

    found = least_squares(
        lambda theta: at(theta)[0],
        np.zeros(len(case.free.positions)),
        lambda theta: at(theta)[1],
        ftol=FALL,
        xtol=1e-12,
        gtol=1e-12,
        max_nfev=STEPS,
    )
    return found.x, found.nfev


def casadi(repeats: int = 3, trial: str = "harbour_trial") -> dict[str, Rows]:
    """Processor time of each fit, and all costs at each solution."""
    case = case_of(trial)
    started = process_time()
    graph = casadi_residuals(case)
    built_s = process_time() - started
    plain = numpy_residuals(case)
    ways: dict[str, tuple[Callable[[], tuple[Array, int]], Callable[[Array], float]]] = {
        "auvident": (lambda: own_fit(case), lambda t: own_cost(case, t)),
        "CasADi": (lambda: scipy_fit(case, graph), lambda t: half_square(graph, t)),
        "numpy": (lambda: scipy_fit(case, plain), lambda t: half_square(plain, t)),
    }
    own_fit(case)  # compiles
    rows, ends = [], {}
    for name, (way, cost) in ways.items():
        once = [_timed(way) for _ in range(repeats if name == "auvident" else 1)]
        ends[name], steps = once[0][0]
        spent = median(seconds for _, seconds in once)
        one = median(_timed(lambda c=cost, e=ends[name]: c(e))[1] for _ in range(5))
        rows.append(
            {
                "fit": name,
                "seconds": spent,
                "over auvident": spent / rows[0]["seconds"] if rows else 1.0,
                "built in s": built_s if name == "CasADi" else 0.0,
                "evaluations": steps if steps < STEPS else f"{STEPS}, the most allowed",
                "ms each, with slopes": 1e3 * one,
                "cost": f"{cost(ends[name]):.2f}",
            }
        )
    return {"one fit": rows, "every cost at every solution": list(certificate(ways, ends))}


def certificate(ways: dict[str, Any], ends: dict[str, Array]) -> Iterator[dict[str, Any]]:
    """All costs at each solution, and how far they are apart, relative to the cost."""
    for name, end in ends.items():
        found = {f"cost by {n}": cost(end) for n, (_, cost) in ways.items()}
        apart = (max(found.values()) - min(found.values())) / min(found.values())
        told = {key: f"{value:.7f}" for key, value in found.items()}
        yield {"solution of": name, **told, "apart": f"{apart:.1e}"}


def half_square(residuals: Residuals, theta: Array) -> float:
    """The cost of residuals."""
    return 0.5 * float(np.sum(residuals(theta)[0] ** 2))


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    start = process_time()
    found = work()
    return found, process_time() - start
