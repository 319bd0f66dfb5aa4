"""What motions tell of the coefficients: accelerations, M^-1 times those of each product.

In the equations M d(u, a, b)/dt = C x, with x the products of velocities, controls and angles, a
motion depends on M^-1 C alone: M and C times any matrix move alike (as long as the mass matrix
stays symmetric). Which changes of the coefficients leave every motion as it is therefore depends on
the coefficients themselves. Two trials, each described about its own coefficients, can only be
compared in M^-1 C: about two points, each would seem to see what neither of them can.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.physics.terms import EQUATIONS, Structure

Array = npt.NDArray[Any]


class Accelerations(NamedTuple):
    """The map from n parameters to what motions tell of them.

    Attributes
    ----------
    start : (n_parameters,) array
        Of a structure, with the values of those that do not move.
    moved : (n, n_parameters) array
        Change of that vector by one unit of each of the n.
    masses : (n_parameters, 3, 3) array
        Slopes of the mass matrix.
    forces : (n_parameters, 3, k) array
        Slopes of the coefficients of each product.
    others : (m,) int array
        Among the n: those that are no force (a lag of a servo), which stand for themselves.
    """

    start: Array
    moved: Array
    masses: Array
    forces: Array
    others: npt.NDArray[np.int64]

    def at(self, theta: Array) -> Array:
        """Accelerations and other parameters (q,)."""
        p = self.start + theta @ self.moved
        rates = np.linalg.solve(self._sum(p, self.masses), self._sum(p, self.forces))
        return np.concatenate([rates.ravel(), theta[self.others]])

    def slopes(self, theta: Array) -> Array:
        """Slopes (q, n): d(M^-1 C) = M^-1 (dC - dM M^-1 C)."""
        p = self.start + theta @ self.moved
        mass = self._sum(p, self.masses)
        rates = np.linalg.solve(mass, self._sum(p, self.forces))
        masses = np.tensordot(self.moved, self.masses, 1)
        forces = np.tensordot(self.moved, self.forces, 1)
        own = np.linalg.solve(mass, forces - masses @ rates)
        rest = np.zeros((len(self.others), len(theta)))
        rest[np.arange(len(self.others)), self.others] = 1.0
        return np.vstack([own.reshape(len(theta), -1).T, rest])

    @staticmethod
    def _sum(p: Array, slopes: Array) -> Array:
        found: Array = np.tensordot(p, slopes, 1)
        return found


def accelerations_of(
    structure: Structure,
    start: Array,
    names: Sequence[str],
    unit: Array,
    followers: Mapping[str, str],
) -> Accelerations:
    """The map for some parameters of a structure.

    Parameters
    ----------
    structure : Structure
    start : (n_parameters,) array
        Where the parameters count from.
    names : sequence of str
    unit : (n,) array
    followers : mapping
        Parameters that move with another one, by their name.
    """
    size, rows = len(structure.parameters), len(EQUATIONS)
    moved = np.zeros((len(names), size))
    for k, name in enumerate(names):
        moved[k, structure.index(name)] = unit[k]
        for follower in (f for f, leader in followers.items() if leader == name):
            moved[k, structure.index(follower)] = unit[k]
    masses = np.zeros((size, rows, rows))
    for (i, j, parameter), weight in zip(structure.mass, structure.mass_weights, strict=True):
        masses[parameter, i, j] += weight
    products = {tuple(row): k for k, row in enumerate(np.unique(structure.terms[:, 2:], axis=0))}
    forces = np.zeros((size, rows, len(products)))
    for row, weight in zip(structure.terms, structure.weights, strict=True):
        forces[row[1], row[0], products[tuple(row[2:])]] += weight
    acting = {structure.parameters[i] for i in {*structure.terms[:, 1], *structure.mass[:, 2]}}
    others = np.array([k for k, name in enumerate(names) if name not in acting], dtype=np.int64)
    return Accelerations(start, moved, masses, forces, others)
