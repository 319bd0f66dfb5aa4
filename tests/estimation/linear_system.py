"""A linear system with shared parameters and a plain-numpy Kalman filter, for comparison.

State [theta, x_1, ..., x_k] as in `auvident.estimation.kalman`; everything as full matrices,
the textbook's covariance update, all readings of a step at once.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LinearSystem:
    """x_j(next) = F_j x_j + G_j theta + noise; the first channel of each block is measured."""

    transition: np.ndarray  # (k, n_x, n_x)
    sensitivity: np.ndarray  # (k, n_x, n_theta)
    q_theta: np.ndarray
    q_x: np.ndarray
    gradient: np.ndarray  # (n_channels, n_x), the same for every block
    variance: np.ndarray  # (n_channels,)
    lengths: np.ndarray  # samples of each block, descending

    @property
    def n_theta(self) -> int:
        return self.sensitivity.shape[2]

    @property
    def n_x(self) -> int:
        return self.transition.shape[1]

    def size(self, alive: int) -> int:
        return self.n_theta + alive * self.n_x

    def alive(self, t: int) -> int:
        return int((self.lengths > t).sum())

    def block(self, j: int) -> slice:
        return slice(self.n_theta + j * self.n_x, self.n_theta + (j + 1) * self.n_x)

    def whole_transition(self, alive: int) -> np.ndarray:
        f = np.eye(self.size(alive))
        for j in range(alive):
            f[self.block(j), self.block(j)] = self.transition[j]
            f[self.block(j), : self.n_theta] = self.sensitivity[j]
        return f


def make_system(rng: np.random.Generator, lengths=(60, 45, 20), n_theta=3, n_x=2) -> LinearSystem:
    """A stable system with random couplings."""
    k = len(lengths)
    turn = rng.normal(size=(k, n_x, n_x))
    radius = np.array([np.abs(np.linalg.eigvals(f)).max() for f in turn])
    return LinearSystem(
        transition=0.9 * turn / radius[:, None, None],
        sensitivity=0.3 * rng.normal(size=(k, n_x, n_theta)),
        q_theta=rng.uniform(0, 1e-3, n_theta),
        q_x=rng.uniform(1e-3, 1e-2, n_x),
        gradient=rng.normal(size=(2, n_x)),
        variance=rng.uniform(0.01, 0.1, 2),
        lengths=np.array(lengths),
    )


def simulate(system: LinearSystem, rng: np.random.Generator, missing: float) -> np.ndarray:
    """Readings (k, n, channels) with gaps."""
    k, n = len(system.lengths), int(system.lengths[0])
    theta, x = rng.normal(size=system.n_theta), rng.normal(size=(k, system.n_x))
    z = np.full((k, n, len(system.gradient)), np.nan)
    for t in range(n):
        for j in range(system.alive(t)):
            z[j, t] = system.gradient @ x[j] + np.sqrt(system.variance) * rng.normal(size=2)
            x[j] = system.transition[j] @ x[j] + system.sensitivity[j] @ theta
            x[j] += np.sqrt(system.q_x) * rng.normal(size=system.n_x)
    z[rng.random(z.shape) < missing] = np.nan
    return z


def textbook(system: LinearSystem, z: np.ndarray, mean: np.ndarray, covariance: np.ndarray):
    """Means and covariances after the readings of each step, and the log-likelihood."""
    history, log_likelihood = [], 0.0
    for t in range(int(system.lengths[0])):
        alive = system.alive(t)
        n = system.size(alive)
        mean, covariance = mean[:n], covariance[:n, :n]
        seen = [(j, c) for j in range(alive) for c in range(2) if np.isfinite(z[j, t, c])]
        if seen:
            h = np.zeros((len(seen), n))
            for row, (j, c) in enumerate(seen):
                h[row, system.block(j)] = system.gradient[c]
            innovation = np.array([z[j, t, c] for j, c in seen]) - h @ mean
            s = h @ covariance @ h.T + np.diag([system.variance[c] for _, c in seen])
            gain = covariance @ h.T @ np.linalg.inv(s)
            mean, covariance = mean + gain @ innovation, covariance - gain @ s @ gain.T
            log_likelihood -= 0.5 * innovation @ np.linalg.solve(s, innovation)
            log_likelihood -= 0.5 * np.linalg.slogdet(2 * np.pi * s)[1]
        history.append((mean, covariance))
        n = system.size(system.alive(t + 1))
        f = system.whole_transition(system.alive(t + 1))
        q = np.concatenate([system.q_theta, np.tile(system.q_x, system.alive(t + 1))])
        mean, covariance = f @ mean[:n], f @ covariance[:n, :n] @ f.T + np.diag(q)
    return history, log_likelihood
