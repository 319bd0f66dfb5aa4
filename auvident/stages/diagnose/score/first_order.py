"""All effects at once, to first order about a fitted model: the screen before any refit.

One simulation with the slopes of everything gives, for each maneuver, how the likelihood changes
when any effect is added and the coefficients adjust (the score test, or Lagrange multiplier),
which effects these maneuvers can show at all, and which look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import DIAGNOSED_START_STD
from auvident.engines.free_run import LARGEST, lost_readings, start_information
from auvident.engines.prediction import Free, Slopes
from auvident.engines.records import Record
from auvident.estimation.output_error import bounded_step
from auvident.parallel import each
from auvident.physics.dynamics import N_STATES
from auvident.stages.diagnose.fit.case import ACTIVE, Case
from auvident.stages.diagnose.fit.fits import (
    N_CHANNELS,
    N_START,
    Colours,
    Fitted,
    prior_of,
    white_slopes,
)

Array = npt.NDArray[Any]

SMALLEST = 1.0e-12


@dataclass(frozen=True)
class Joint:
    """Slopes of the likelihood about a fitted model.

    Attributes
    ----------
    case : Case
    fitted : Fitted
    free : (n,) int array
        Coefficients, silent allowances and the parameters of all effects.
    half : float
        Half the sum of squared whitened errors, starts eliminated.
    gradient : (n,) array
    curvature : (n, n) array
        Summed over the maneuvers, starts eliminated.
    raw : (3, n, n) array
        Mean products of the unwhitened slopes of each channel.
    """

    case: Case
    fitted: Fitted
    free: npt.NDArray[np.int64]
    half: float
    gradient: Array
    curvature: Array
    raw: Array

    def columns(self, positions: Sequence[int] | Array) -> Array:
        """Columns of parameters."""
        return np.searchsorted(self.free, np.array(positions, dtype=np.int64))


def joint_about(
    case: Case, fitted: Fitted, effects: Sequence[str], gain: Array | None = None
) -> Joint | None:
    """Slopes of everything about a fitted model; None where the simulation runs away.

    Parameters
    ----------
    effects : sequence of str
        Effects to look at.
    gain : (4,) array, optional
        Observer gain, which brings out what is fast.
    """
    extra = [i for effect in effects for i in case.positions(effect)]
    free = np.array(sorted({*fitted.free.tolist(), *extra}), dtype=np.int64)
    moving = case.setup.free(free)
    parts = each(lambda r: _slopes_of(case, fitted, r, moving, gain), case.records, len)
    if any(part is None for part in parts):
        return None
    half, gradient, curvature, raw, count = zip(*parts, strict=True)  # type: ignore[arg-type]
    mean = sum(raw) / np.maximum(sum(count), 1.0)[:, None, None]
    return Joint(case, fitted, free, sum(half), sum(gradient), sum(curvature), mean)


def _slopes_of(
    case: Case, fitted: Fitted, record: Record, moving: Free, gain: Array | None
) -> tuple[float, Array, Array, Array, Array] | None:
    """Share of a record in what `Joint` holds, with the count of its readings (3,)."""
    whitened = _white_slopes(case, fitted, fitted.parameters, record, moving, gain)
    if whitened is None:
        return None
    found, seen, rows = whitened
    error, own = _without_start(rows, fitted.colours)
    own_slopes = [found.slopes[seen[:, c], c, N_STATES:] for c in range(N_CHANNELS)]
    lost = lost_readings(record, seen, np.arange(N_CHANNELS))
    return (
        0.5 * (float(rows[:, 0] @ error) + lost),
        rows[:, 1 + N_START :].T @ error,
        rows[:, 1 + N_START :].T @ own,
        np.array([part.T @ part for part in own_slopes]),
        np.array([float(len(part)) for part in own_slopes]),
    )


def _white_slopes(
    case: Case, fitted: Fitted, p: Array, record: Record, moving: Free, gain: Array | None = None
) -> tuple[Slopes, Array, Array] | None:
    """`white_slopes` with the noise of a fit; None as well where the motion is nearly lost."""
    found = white_slopes(case, p, record, fitted.colours, moving, gain)
    if found is None or not np.abs(found[2]).max() <= LARGEST**0.5:  # nor a NaN
        return None
    return found


def gains_of_absent(
    case: Case, fitted: Fitted, effect: str, vectors: Sequence[Array]
) -> list[float]:
    """Gain of adding an effect, see `score`, for several of its forms.

    While the effect is absent its form changes neither the motion nor any slope but its own.

    Parameters
    ----------
    effect : str
        Not among those of the model; zero in its parameters.
    vectors : sequence of (n_parameters,) array
        The model's parameters, apart from those that give the effect its form.

    Returns
    -------
    list of float
        Zero where the simulation runs away.
    """
    about = joint_about(case, fitted, (effect,))
    if about is None:
        return [0.0] * len(vectors)
    own = about.columns(case.positions(effect))
    both = case.setup.free(about.free), case.setup.free(np.array(case.positions(effect)))
    parts = each(lambda r: _forms_of(case, fitted, r, both, vectors), case.records, len)
    found = []
    for shares in zip(*parts, strict=True):
        gradient, curvature = about.gradient.copy(), about.curvature.copy()
        gradient[own] = sum(share[0] for share in shares)
        by_all = sum(share[1] for share in shares)
        curvature[own], curvature[:, own] = by_all, by_all.T
        curvature[np.ix_(own, own)] = sum(share[2] for share in shares)
        found.append(score(replace(about, gradient=gradient, curvature=curvature), (effect,)).gain)
    return found


def _forms_of(
    case: Case, fitted: Fitted, record: Record, free: tuple[Free, Free], vectors: Sequence[Array]
) -> list[tuple[Array, Array, Array]]:
    """For each form of an effect its gradient (k,), and its curvature (k, n) with all and own."""
    every, own = free
    whole = _white_slopes(case, fitted, fitted.parameters, record, every)
    assert whole is not None  # the joint one ran through
    error, base = _without_start(whole[2], fitted.colours)
    found = []
    for p in vectors:
        form = _white_slopes(case, fitted, p, record, own)
        assert form is not None  # the same motion
        slopes, left = form[2][:, 1 + N_START :], _without_start(form[2], fitted.colours)[1]
        found.append((slopes.T @ error, slopes.T @ base, slopes.T @ left))
    return found


def _without_start(rows: Array, colours: Colours) -> tuple[Array, Array]:
    """Errors and slopes with what the start state can take up removed."""
    start = rows[:, 1 : 1 + N_START]
    held = start_information(ACTIVE, colours, DIAGNOSED_START_STD)
    share = np.linalg.solve(start.T @ start + held, start.T @ rows)
    left = rows - start @ share
    return left[:, 0], left[:, 1 + N_START :]


@dataclass(frozen=True)
class Score:
    """What adding an effect would bring to first order.

    Attributes
    ----------
    gain : float
        Rise of the log posterior [nats].
    parameters : (n_parameters,) array
        Where the first step leads.
    cost : float
        Negative log posterior before the step, up to a constant.
    """

    gain: float
    parameters: Array
    cost: float = 0.0


def score(joint: Joint, effects: Sequence[str]) -> Score:
    """Gain of adding effects to the fitted model, the other parameters adjusting."""
    case, start = joint.case, joint.fitted.parameters
    free = np.array(
        sorted({*joint.fitted.free.tolist(), *(i for e in effects for i in case.positions(e))}),
        dtype=np.int64,
    )
    open_ = [i for e in (*joint.fitted.effects, *effects) for i in case.positions(e)]
    mean, information, low, high = prior_of(case, free, open_)
    at = joint.columns(free)
    theta = start[free] / case.setup.prior_std[free]
    gradient = joint.gradient[at] + information @ (theta - mean)
    curvature = joint.curvature[np.ix_(at, at)] + information
    step = bounded_step(curvature, gradient, low - theta, high - theta)
    gain = -(gradient @ step + 0.5 * step @ curvature @ step)
    p = start.copy()
    p[free] = (theta + step) * case.setup.prior_std[free]
    cost = joint.half + 0.5 * float((theta - mean) @ information @ (theta - mean))
    return Score(float(gain), p, cost)


def score_from(joint: Joint, effect: str, there: Array) -> Score:
    """As `score`, with the step taken from an effect at another size `there`.

    For effects whose signature changes with their size: what a small one would do says little.
    """
    here = score(joint, (effect,))
    moved = replace(joint.fitted, parameters=there)
    other = joint_about(joint.case, moved, (effect,))
    if other is None:
        return here
    found = score(other, (effect,))
    gain = here.cost - found.cost + found.gain
    return Score(gain, found.parameters, found.cost) if gain > here.gain else here


def unabsorbed(joint: Joint, positions: Sequence[int]) -> tuple[Array, Array, Array]:
    """What of the signature of parameters the fitted model cannot take up.

    Returns
    -------
    information : (k, k) array
        Of the parameters, in units of their prior, the others adjusting.
    kept : (k,) array
        Share of each one's signature (0: the coefficients absorb it, 1: nothing hides it).
    rms : (k, 3) array
        Root mean square in each channel, per unit of prior.
    """
    own = joint.columns(positions)
    # silent allowances are bounded, and an effect worth a word exceeds them
    base = joint.columns(
        [i for i in joint.fitted.free if i not in set(positions) and joint.case.silent[i] == 0.0]
    )
    _, information, _, _ = prior_of(joint.case, joint.free[base], _open(joint))
    h = joint.curvature
    share = np.linalg.solve(h[np.ix_(base, base)] + information, h[np.ix_(base, own)])
    left = h[np.ix_(own, own)] - h[np.ix_(own, base)] @ share
    kept = np.diag(left) / np.maximum(np.diag(h)[own], SMALLEST)
    transform = np.zeros((len(h), len(own)))
    transform[own, np.arange(len(own))] = 1.0
    transform[base] = -share
    power = np.einsum("ik,cij,jk->kc", transform, joint.raw, transform)
    return left, kept, np.sqrt(np.maximum(power, 0.0))


def _open(joint: Joint) -> list[int]:
    return [i for e in joint.fitted.effects for i in joint.case.positions(e)]


def cosine(joint: Joint, a: Sequence[int], b: Sequence[int]) -> float:
    """Likeness of two effects: largest canonical correlation of what is not absorbed of them."""
    both = [*a, *b]
    left, _, _ = unabsorbed(joint, both)
    k = len(a)
    aa, bb, ab = left[:k, :k], left[k:, k:], left[:k, k:]
    return _canonical(aa, bb, ab)


def _canonical(aa: Array, bb: Array, ab: Array) -> float:
    def root(m: Array) -> Array:
        values, vectors = np.linalg.eigh(0.5 * (m + m.T))
        values = np.where(values > 1e-9 * max(float(values[-1]), SMALLEST), values, np.inf)
        return np.asarray(vectors / np.sqrt(values) @ vectors.T)

    return float(np.clip(np.linalg.svd(root(aa) @ ab @ root(bb), compute_uv=False)[0], 0.0, 1.0))
