"""Most likely course of a Gaussian chain through noisy readings; it knows no vehicle.

A chain of states x_1, ..., x_n of d numbers each, whose steps x_k+1 = F_k x_k + w_k and whose
readings are linear, has a posterior with the block-tridiagonal precision

    L = sum_i B_i / theta_i + M / r + E

where B_i collects the steps driven by noise of intensity theta_i, M the readings of variance r,
and E what is known of the first state of each piece (hardly anything). It is factorised as a
band (Golub and Van Loan 2013, 4.3.5), and so is the likelihood of theta and r. What a
Rauch-Tung-Striebel smoother gives by recursion is the same mean and covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

FIRST_STD = 1e3  # of the first state: far beyond any, in any of its units
LOG_TOLERANCE = 0.03  # to which the logarithm of an intensity is sought
MOST_TRIES = 200
MOST_APART = 1e12  # weights of a step and of a reading: beyond it digits are lost
QUADRATURE = 5  # points: exact for a walk, and to twelve digits for steps of a tenth of back_s
WAVES, WAVES_LOOKED_AT = (1e-3, 1e2), 500  # frequencies [rad/s] among which the largest is sought


@dataclass(frozen=True)
class Chain:
    """A chain with its readings, counted from a course near the most likely one.

    Attributes
    ----------
    F : (n - 1, d, d) array
        Steps.
    weights : tuple of (n - 1, d, d) arrays
        Inverse of what unit intensity adds in each, by source of noise; zero where nothing leads
        from one piece to the next.
    volumes : tuple of (int, float)
        For each source the rank of its weights, and the logarithm of the determinant of the
        covariance that they invert.
    rows, place, values : (m, d), (m,), (m,) arrays
        Readings: row times the state at a place.
    starts : (n,) array of bool
        States at which pieces begin.
    bands : tuple of (2 d, n d) arrays
        B_i of each source, M and E as lower bands.
    centre : (n, d) array
        The course from which states count.
    """

    F: Array
    weights: tuple[Array, ...]
    volumes: tuple[tuple[int, float], ...]
    rows: Array
    place: npt.NDArray[np.int64]
    values: Array
    starts: npt.NDArray[np.bool_]
    bands: tuple[Array, ...]
    centre: Array

    @property
    def d(self) -> int:
        """Numbers in a state."""
        return self.rows.shape[1]


class ChainEstimate(NamedTuple):
    """Posterior of a chain: means (n, d), covariances (n, d, d)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Intensities:
    """Most likely noise: `theta` of the steps, variance `r` of a reading, log-likelihood."""

    theta: tuple[float, ...]
    r: float
    log_likelihood: float


class Motion(NamedTuple):
    """How a rate wanders about: white noise drives it (order 1) or its derivative (order 2).

    What is driven is drawn back to zero within `back_s`, if that is finite (Singer 1970).
    """

    order: int
    back_s: float = np.inf


def driven(motion: Motion, dt_s: Array) -> tuple[Array, Array]:
    """Step of a quantity and its rate, driven by white noise.

    Parameters
    ----------
    motion : Motion
    dt_s : (n,) array

    Returns
    -------
    F : (n, order + 1, order + 1) array
        Of the quantity and its derivatives.
    Q : (n, order + 1, order + 1) array
        Covariance that unit intensity adds, by Gaussian quadrature.
    """
    order, size = motion.order, motion.order + 1
    F = np.zeros((dt_s.size, size, size))
    F[:, :, order] = _answer(motion, dt_s)
    F[:, 0, 0] = 1.0
    if order == 2:
        F[:, 0, 1], F[:, 1, 1] = dt_s, 1.0
    at, weight = np.polynomial.legendre.leggauss(QUADRATURE)
    answer = _answer(motion, 0.5 * dt_s[:, None] * (1.0 + at))
    Q = np.einsum("kpi,kpj,p,k->kij", answer, answer, weight, 0.5 * dt_s)
    return F, Q


def _answer(motion: Motion, t: Array) -> Array:
    """What the quantity and its derivatives are a time after a unit push."""
    order, back = motion.order, motion.back_s
    if not np.isfinite(back):
        return np.stack([t**k / (1.0, 1.0, 2.0)[k] for k in range(order, -1, -1)], axis=-1)
    decay = np.exp(-t / back)
    way = -back * np.expm1(-t / back)
    return np.stack([back * (t - way), way, decay][2 - order :], axis=-1)


def chain_of(
    F: Array,
    sources: Sequence[tuple[Array, Array, int]],
    starts: npt.NDArray[np.bool_],
    readings: tuple[Array, npt.NDArray[np.int64], Array],
) -> Chain:
    """A chain from its steps and readings.

    Parameters
    ----------
    F : (n - 1, d, d) array
    sources : sequence of (weights (n - 1, d, d), log_volume (n - 1,), rank) tuples
        For each source of noise the (pseudo-)inverse of what unit intensity adds in a step, the
        logarithm of the determinant of that, and its rank.
    starts : (n,) array of bool
    readings : rows (m, d), place (m,), values (m,)
    """
    joined = ~starts[1:]
    rows, place, values = readings
    n, d = starts.size, rows.shape[1]
    weights = tuple(np.where(joined[:, None, None], own, 0.0) for own, _, _ in sources)
    bands = [_step_band(F, own) for own in weights]
    bands += [_reading_band(rows, place, n), _first_band(starts, d)]
    volumes = tuple(
        (rank * int(joined.sum()), float(volume[joined].sum())) for _, volume, rank in sources
    )
    return Chain(F, weights, volumes, rows, place, values, starts, tuple(bands), np.zeros((n, d)))


def _step_band(F: Array, weight: Array) -> Array:
    back = F.swapaxes(1, 2) @ weight
    diagonal = np.zeros((len(F) + 1, *F.shape[1:]))
    diagonal[:-1] += back @ F
    diagonal[1:] += weight
    return banded(diagonal, -(weight @ F))


def _reading_band(rows: Array, place: npt.NDArray[np.int64], n: int) -> Array:
    d = rows.shape[1]
    diagonal = np.zeros((n, d, d))
    np.add.at(diagonal, place, rows[:, :, None] * rows[:, None, :])
    return banded(diagonal, np.zeros((n - 1, d, d)))


def _first_band(starts: npt.NDArray[np.bool_], d: int) -> Array:
    band = np.zeros((2 * d, starts.size, d))
    band[0, starts] = FIRST_STD**-2
    return band.reshape(2 * d, starts.size * d)


def banded(diagonal: Array, below: Array) -> Array:
    """Lower band (2 d, n d) of the blocks on (n, d, d) and below (n - 1, d, d) the diagonal."""
    n, d = diagonal.shape[:2]
    band = np.zeros((2 * d, n, d))
    for a in range(d):
        for b in range(d):
            if a >= b:
                band[a - b, :, b] = diagonal[:, a, b]
            band[d + a - b, :-1, b] = below[:, a, b]
    return band.reshape(2 * d, n * d)


def most_likely(chain: Chain, theta: Sequence[float], r: float) -> Intensities:
    """Intensities with the largest likelihood, sought from some on (all above 0)."""
    from scipy.optimize import minimize  # a third of a second to import, for logs without a DVL

    near = _centred(chain, _solution(chain, (), theta, r))
    left, least = _left(near), _least(chain)

    def bounded(logs: Array) -> tuple[tuple[float, ...], float]:
        values = np.exp(logs)
        return tuple(np.maximum(values[:-1], least * values[-1]).tolist()), float(values[-1])

    def cost(logs: Array) -> float:
        theta, variance = bounded(logs)
        return -_log_likelihood(near, left, theta, variance)

    found = minimize(
        cost,
        np.log([*theta, r]),
        method="Nelder-Mead",
        options={
            "xatol": LOG_TOLERANCE,
            "fatol": LOG_TOLERANCE,
            "maxfev": MOST_TRIES,
            "initial_simplex": _simplex(np.log([*theta, r])),
        },
    )
    best, variance = bounded(found.x)
    return Intensities(best, variance, -float(found.fun))


def _least(chain: Chain) -> Array:
    """Smallest intensities, in the variance of a reading, with which the band has a factor.

    A rate that does not change at all is driven by no more.
    """
    largest = float(np.abs(chain.bands[-2]).max())
    sources = chain.bands[: len(chain.weights)]
    return np.array([float(np.abs(own).max()) / (MOST_APART * largest) for own in sources])


def _simplex(start: Array) -> Array:
    """Corners a factor e apart: intensities are known to an order of magnitude at first."""
    return np.vstack((start, start + np.eye(start.size)))


def course(chain: Chain, noise: Intensities) -> ChainEstimate:
    """Means and covariances of the states given all readings."""
    near = _centred(chain, _solution(chain, (), noise.theta, noise.r))
    mean = near.centre + _solution(near, _left(near), noise.theta, noise.r)
    factor = _factor(chain, noise.theta, noise.r)
    return ChainEstimate(mean, _covariances(factor, chain.d))


class _OffCentre(NamedTuple):
    """What the centre leaves of a source or the readings: its square, and its pull."""

    power: float
    pull: Array


def _centred(chain: Chain, centre: Array) -> Chain:
    """The chain counted from another course: what is left is small, and its squares exact."""
    read = np.einsum("md,md->m", chain.rows, centre[chain.place])
    return replace(chain, values=chain.values - read, centre=chain.centre + centre)


def _left(chain: Chain) -> tuple[_OffCentre, ...]:
    """What the centre leaves of each source, then of the readings."""
    missed = np.einsum("kij,kj->ki", chain.F, chain.centre[:-1]) - chain.centre[1:]
    found = []
    for weight in chain.weights:
        force = np.einsum("kij,kj->ki", weight, missed)
        pull = np.zeros_like(chain.centre)
        pull[1:] += force
        pull[:-1] -= np.einsum("kij,ki->kj", chain.F, force)
        found.append(_OffCentre(float(np.sum(force * missed)), pull.ravel()))
    pull = np.zeros_like(chain.centre)
    np.add.at(pull, chain.place, chain.rows * chain.values[:, None])
    return (*found, _OffCentre(float(chain.values @ chain.values), pull.ravel()))


def _solution(chain: Chain, left: Sequence[_OffCentre], theta: Sequence[float], r: float) -> Array:
    """Most likely states (n, d), counted from the centre."""
    factor = _factor(chain, theta, r)
    pull = _pull(left or _left(chain), theta, r)
    return _solved(factor, pull).reshape(-1, chain.d)


def _pull(left: Sequence[_OffCentre], theta: Sequence[float], r: float) -> Array:
    return sum((own.pull / t for own, t in zip(left, (*theta, r), strict=True)), np.zeros(1))


def _precision(chain: Chain, theta: Sequence[float], r: float) -> Array:
    band = chain.bands[-1].copy()
    for own, intensity in zip(chain.bands[:-1], (*theta, r), strict=True):
        band += own / intensity
    return band


def _factor(chain: Chain, theta: Sequence[float], r: float) -> Array:
    """Cholesky factor of the precision, as a lower band."""
    from scipy.linalg import cholesky_banded  # takes as long to import as `minimize`

    factor: Array = cholesky_banded(_precision(chain, theta, r), lower=True)
    return factor


def _solved(factor: Array, pull: Array) -> Array:
    """States (n d,) that a factor and a pull make."""
    from scipy.linalg import cho_solve_banded

    states: Array = cho_solve_banded((factor, True), pull)
    return states


def _log_likelihood(
    chain: Chain, left: Sequence[_OffCentre], theta: Sequence[float], r: float
) -> float:
    """Up to what only the readings decide; -inf where the precision has no factor left."""
    try:
        factor = _factor(chain, theta, r)
    except np.linalg.LinAlgError:
        return -np.inf
    pull = _pull(left, theta, r)
    misfit = sum(own.power / t for own, t in zip(left, (*theta, r), strict=True))
    misfit -= float(pull @ _solved(factor, pull))
    volume = 2.0 * float(np.sum(np.log(factor[0])))
    volume += sum(m * np.log(t) + v for (m, v), t in zip(chain.volumes, theta, strict=True))
    volume += 2.0 * int(chain.starts.sum()) * chain.d * np.log(FIRST_STD)
    return -0.5 * (misfit + volume + chain.values.size * np.log(r))


def _covariances(factor: Array, d: int) -> Array:
    """Diagonal blocks of the inverse from the lower factor (Takahashi, Fagan and Chin 1973)."""
    n = factor.shape[1] // d
    band = factor.reshape(2 * d, n, d)
    own, below = np.zeros((n, d, d)), np.zeros((n, d, d))
    for a in range(d):
        for b in range(d):
            if a >= b:
                own[:, a, b] = band[a - b, :, b]
            below[:, a, b] = band[d + a - b, :, b]
    inverse = np.linalg.inv(own)
    gain = below @ inverse
    found = inverse.swapaxes(1, 2) @ inverse
    for k in range(n - 2, -1, -1):
        found[k] += gain[k].T @ found[k + 1] @ gain[k]
    return found


def white_equal(motion: Motion, intensity: float, r_s: float) -> float:
    """Largest spectral density of the error of a rate that was read off a noisy quantity.

    A reading of variance r every T s has the density r T. The rate is known with the error density
    1 / (w^(2 order - 2) (w^2 + back_s^-2) / q + 1 / (w^2 r T)): white noise of its maximum is
    nowhere less.

    Parameters
    ----------
    motion : Motion
    intensity : float
        q.
    r_s : float
        r T.
    """
    order, back = motion.order, motion.back_s
    w2 = np.geomspace(*WAVES, WAVES_LOOKED_AT) ** 2
    wanders = w2 ** (order - 1) * (w2 + back**-2) / intensity
    return float(np.max(1.0 / (wanders + 1.0 / (w2 * r_s))))
