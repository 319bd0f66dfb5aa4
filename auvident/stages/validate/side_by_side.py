"""Two predictions of the same maneuvers: which is the better one, and by more than chance?"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import vector_behind
from auvident.estimation.chances import student_above
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.planes import Plane
from auvident.schema.trial import Trial
from auvident.stages.validate.stage import Prediction, channel_pairs, predict_all

Array = npt.NDArray[Any]

# Of a maneuver, whose mean squared errors count as independent: some seconds long, as errors of a
# prediction are. All its samples would not be, and two maneuvers as a whole tell of no difference.
PARTS = 8


@dataclass(frozen=True)
class ErrorPair:
    """Errors (RMSE) of two predictions in a channel.

    ``p`` is the probability of the first one being so much worse by chance: near 0 it is worse,
    near 1 better.
    """

    unit: str
    one: float
    other: float
    p: float


def held_out_errors(
    trials: Sequence[Trial], maneuvers: Maneuvers, one: IdentifiedModel, other: IdentifiedModel
) -> dict[str, ErrorPair]:
    """Errors by channel of the held-out maneuvers with two models of a plane."""
    chosen = tuple(m for m in maneuvers.maneuvers if m.role == "validate")
    held = maneuvers.model_copy(update={"maneuvers": chosen})
    first, second = (predict_all(trials, held, m, vector_behind(m)) for m in (one, other))
    return side_by_side(first, second, one.plane)


def side_by_side(
    one: Sequence[Prediction], other: Sequence[Prediction], plane: Plane
) -> dict[str, ErrorPair]:
    """Errors by channel of two predictions of the same maneuvers; infinite where one runs away.

    Whether one is worse is told as Diebold and Mariano (1995) do: by the mean difference of their
    squared errors over its standard error, here from the means over parts of the maneuvers.
    """
    squares: dict[str, tuple[str, list[Array]]] = {}
    for a, b in zip(one, other, strict=True):
        for mine, theirs in zip(channel_pairs(a, plane), channel_pairs(b, plane), strict=True):
            name, unit, *_ = mine
            both = np.column_stack([_squared(*pair[2:]) for pair in (mine, theirs)])
            squares.setdefault(name, (unit, []))[1].append(both[~np.isnan(both).any(axis=1)])
    return {
        name: _pair(unit, pieces)
        for name, (unit, pieces) in squares.items()
        if sum(len(piece) for piece in pieces)
    }


def _squared(measured: Array, simulated: Array) -> Array:
    """Squared errors (n,), of a track those of the place; NaN where nothing was measured."""
    error: Array = (measured - simulated).reshape(len(measured), -1)
    seen = np.isfinite(measured).reshape(len(measured), -1).all(axis=1)
    found = (error**2).sum(axis=1)
    return np.where(seen, np.where(np.isfinite(found), found, np.inf), np.nan)


def _pair(unit: str, pieces: Sequence[Array]) -> ErrorPair:
    one, other = np.sqrt(np.mean(np.concatenate(pieces), axis=0))
    if not (np.isfinite(one) and np.isfinite(other)):
        better = 0.5 * (1.0 + np.isinf(other) - np.isinf(one))
        return ErrorPair(unit, float(one), float(other), float(better))
    parts = [part for piece in pieces for part in np.array_split(piece, PARTS) if len(part)]
    away = np.array([part[:, 0].mean() - part[:, 1].mean() for part in parts])
    return ErrorPair(unit, float(one), float(other), worse_by_chance(away))


def worse_by_chance(away: Array) -> float:
    """Probability that differences (n,) which are none in truth have so large a mean."""
    spread = float(np.std(away, ddof=1)) if len(away) > 1 else 0.0
    if spread <= 0.0:
        return 0.5
    return student_above(len(away) - 1, float(np.mean(away)) / spread * math.sqrt(len(away)))
