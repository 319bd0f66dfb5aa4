"""Velocities and yaw rate that a position log and a compass imply, with how well they are known.

The heading is a chain driven by white noise; given it, so is the track, whose velocities live in
axes that turn with the vehicle::

    d(north)/dt = u cos psi - v sin psi,    d(east)/dt = u sin psi + v cos psi

That u and v change slowly, the velocity north and east by whole turns, is what tells motion from
noise. Intensities and the variance of the readings are the most likely ones, of the heading the
order of the chain as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from auvident.estimation.chain import (
    Chain,
    ChainEstimate,
    Intensities,
    Motion,
    chain_of,
    course,
    driven,
    most_likely,
    white_equal,
)

Motions = tuple[Motion, ...]
WALKS, SMOOTH = Motion(1), Motion(2)
# A yaw acceleration ends as a turn becomes steady, a drift aside as the turn does: within the time
# in which the vehicle passes so many of its lengths. Which it is shows in a heading, but hardly in
# fixes: errors are 0.7 to 1.3 of what is claimed with 4 lengths, 0.6 to 1.9 with the most likely.
PUSHED_LENGTHS = (12.0, 4.0, 1.5)
DRIFT_LENGTHS = 4.0
MOST_NODES = 9000  # a quarter of an hour at 10 Hz: more shows the noise hardly better
STEP_SHARE = 0.25  # of the period of the readings: a vehicle turns little within
LEAST_STEP_S = 0.1  # faster than the 10 Hz on which trials are identified nothing is asked
FIRST_RATE_SHARE = 0.1  # of the spread of a rate, per second: where the search begins


@dataclass(frozen=True)
class Nodes:
    """Times at which the chain has a state, and where a new piece begins."""

    time_s: np.ndarray
    starts: np.ndarray

    def before(self, time_s: np.ndarray) -> np.ndarray:
        """Node at or before each time."""
        return np.maximum(np.searchsorted(self.time_s, time_s, side="right") - 1, 0)

    def within(self, time_s: np.ndarray) -> np.ndarray:
        """Whether each time lies in a piece."""
        place = self.before(time_s)
        after = np.minimum(place + 1, self.time_s.size - 1)
        inside = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        return inside & (~self.starts[after] | (self.time_s[place] == time_s))


@dataclass(frozen=True)
class Rate:
    """A rate at the nodes.

    Attributes
    ----------
    values, std : (n,) arrays
        Mean and standard deviation given all readings.
    density : float
        Spectral density of white noise that is nowhere less than the error.
    """

    values: np.ndarray
    std: np.ndarray
    density: float


@dataclass(frozen=True)
class Turning:
    """Heading and yaw rate: the angle at the nodes, its reading noise and its spectral density."""

    nodes: Nodes
    psi: np.ndarray
    psi_std: np.ndarray
    psi_density: float
    r: Rate
    noise_rad: float


@dataclass(frozen=True)
class Moving:
    """Velocities of the point whose position was logged, and the noise of a fix."""

    nodes: Nodes
    u: Rate
    v: Rate
    noise_m: float


def nodes_in(pieces: list[tuple[float, float]], step_s: float) -> Nodes:
    """Nodes at a distance of `step_s` in each piece, from its start beyond its end."""
    runs = [np.arange(a, b + step_s, step_s) for a, b in pieces]
    starts = np.concatenate([np.arange(run.size) == 0 for run in runs])
    return Nodes(np.concatenate(runs), starts)


def step_for(period_s: float) -> float:
    """Distance of the nodes in s for readings of a period."""
    return max(LEAST_STEP_S, STEP_SHARE * period_s)


def turning(time_s: np.ndarray, heading_rad: np.ndarray, nodes: Nodes, passage_s: float) -> Turning:
    """Heading and yaw rate from a compass, angles unwrapped.

    `passage_s` is the time in which the vehicle travels its length.
    """
    middle = float(np.mean(heading_rad))
    z = heading_rad - middle

    def build(motions: Motions, where: Nodes) -> Chain:
        own = where.within(time_s)
        place = where.before(time_s[own])
        F, Q = driven(motions[0], np.diff(where.time_s))
        rows = driven(motions[0], time_s[own] - where.time_s[place])[0][:, 0, :]
        source = (np.linalg.inv(Q), np.linalg.slogdet(Q)[1], Q.shape[1])
        return chain_of(F, [source], where.starts, (rows, place, z[own]))

    step = float(np.median(np.diff(time_s)))
    first = (_first_intensity(z, step),)
    busiest = _busiest(nodes, time_s, z)
    kinds = [(SMOOTH,), *((Motion(2, n * passage_s),) for n in PUSHED_LENGTHS), (WALKS,)]
    (motion,), noise, found = _best(build, kinds, first, _first_variance(z), nodes, busiest)
    density = noise.r * step
    rate = Rate(
        found.mean[:, 1],
        np.sqrt(found.covariance[:, 1, 1]),
        white_equal(motion, noise.theta[0], density),
    )
    psi_std = np.sqrt(found.covariance[:, 0, 0])
    return Turning(nodes, found.mean[:, 0] + middle, psi_std, density, rate, float(noise.r**0.5))


def moving(
    time_s: np.ndarray,
    fixes_m: tuple[np.ndarray, np.ndarray],
    turn: Turning,
    nodes: Nodes,
    passage_s: float,
) -> Moving:
    """Velocities in vehicle axes from fixes (north, east), given the heading."""
    north_m, east_m = fixes_m
    n, e = north_m - np.mean(north_m), east_m - np.mean(east_m)

    def psi(at: np.ndarray) -> np.ndarray:
        return np.interp(at, turn.nodes.time_s, turn.psi)

    def build(motions: Motions, where: Nodes) -> Chain:
        own = where.within(time_s)
        place = where.before(time_s[own])
        since = time_s[own] - where.time_s[place]
        steps = np.diff(where.time_s)
        middle = psi(where.time_s[:-1] + 0.5 * steps)
        to_fix = _turned(motions, since, psi(where.time_s[place] + 0.5 * since))
        rows = np.vstack((to_fix[:, 0], to_fix[:, 1]))
        readings = (rows, np.tile(place, 2), np.concatenate((n[own], e[own])))
        F = _turned(motions, steps, middle)
        return chain_of(F, _sources(motions, steps, middle), where.starts, readings)

    step = float(np.median(np.diff(time_s)))
    first = max(_first_intensity(n, step), _first_intensity(e, step))
    variance = max(_first_variance(n), _first_variance(e))
    busiest = _busiest(nodes, turn.nodes.time_s, turn.psi)
    kinds = [(WALKS, Motion(1, DRIFT_LENGTHS * passage_s))]
    motions, noise, found = _best(build, kinds, (first, first), variance, nodes, busiest)
    tilt = np.interp(nodes.time_s, turn.nodes.time_s, turn.psi_std)
    rates = []
    for axis, motion in enumerate(motions):
        # an error of the heading turns the other velocity into this one
        other = found.mean[:, 3 - axis]
        variances = found.covariance[:, 2 + axis, 2 + axis] + (tilt * other) ** 2
        density = white_equal(motion, noise.theta[axis], noise.r * step)
        density += float(np.mean(other**2)) * turn.psi_density
        rates.append(Rate(found.mean[:, 2 + axis], np.sqrt(variances), density))
    return Moving(nodes, rates[0], rates[1], float(noise.r**0.5))


def _turned(motions: Motions, dt_s: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Steps of the track (north, east, u, v) under a heading."""
    F = np.zeros((dt_s.size, 4, 4))
    for axis, motion in enumerate(motions):
        F[:, axis::2, axis::2] = driven(motion, dt_s)[0]
    F[:, :2, 2:] = _rotation(psi) @ F[:, :2, 2:]
    return F


def _rotation(psi: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(psi), np.sin(psi)
    return np.stack((np.stack((cos, -sin), axis=-1), np.stack((sin, cos), axis=-1)), axis=-2)


def _sources(
    motions: Motions, steps: np.ndarray, psi: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Noise ahead and aside; see `chain_of`."""
    to_body = np.tile(np.eye(4), (steps.size, 1, 1))
    to_body[:, :2, :2] = _rotation(psi).swapaxes(1, 2)
    found = []
    for axis, motion in enumerate(motions):
        Q = driven(motion, steps)[1]
        weight = np.zeros((steps.size, 4, 4))
        weight[:, axis::2, axis::2] = np.linalg.inv(Q)
        weight = to_body.swapaxes(1, 2) @ weight @ to_body
        found.append((weight, np.linalg.slogdet(Q)[1], 2))
    return found


def _best(
    build: Callable[[Motions, Nodes], Chain],
    kinds: Sequence[Motions],
    theta: tuple[float, ...],
    r: float,
    nodes: Nodes,
    busiest: Nodes,
) -> tuple[Motions, Intensities, ChainEstimate]:
    """Most likely of some kinds of motion, its noise and its course."""
    tried = []
    for motions in kinds:
        noise = most_likely(build(motions, busiest), theta, r)
        tried.append((motions, noise))
        theta, r = noise.theta, noise.r
    chosen, noise = max(tried, key=lambda one: one[1].log_likelihood)
    return chosen, noise, course(build(chosen, nodes), noise)


def _busiest(nodes: Nodes, time_s: np.ndarray, angle: np.ndarray) -> Nodes:
    """So many nodes as the noise is sought from, where the vehicle turns most."""
    if nodes.time_s.size <= MOST_NODES:
        return nodes
    turned = np.abs(np.diff(np.interp(nodes.time_s, time_s, angle), prepend=0.0))
    total = np.concatenate(([0.0], np.cumsum(np.where(nodes.starts, 0.0, turned))))
    first = int(np.argmax(total[MOST_NODES:] - total[:-MOST_NODES]))
    own = slice(first, first + MOST_NODES)
    starts = nodes.starts[own].copy()
    starts[0] = True
    return Nodes(nodes.time_s[own], starts)


def _first_variance(z: np.ndarray) -> float:
    """Variance of white noise by third differences, where motion has hardly any part."""
    return max(float(np.var(np.diff(z, 3)) / 20.0), float(np.finfo(float).tiny) ** 0.5)


def _first_intensity(z: np.ndarray, step: float) -> float:
    """Intensity of a rate that wanders over its spread in ten seconds."""
    spread = float(np.std(np.diff(z[:: max(1, round(1.0 / step))])))
    return max((spread * FIRST_RATE_SHARE) ** 2, float(np.finfo(float).tiny) ** 0.5)
