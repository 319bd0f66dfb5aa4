"""Whether the band held what was held out, and the errors of maneuvers left out in turn."""

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from auvident.engines.predictive import NOMINAL
from auvident.schema.artifacts import Coverage, CrossValidation, IdentifiedModel
from auvident.schema.planes import BY_PLANE, TRACK

Array = npt.NDArray[np.float64]
FLAT = 1.0e-9  # least standard deviation to compare with: a constant channel is never predicted
Pair = tuple[str, str, Array, Array]  # channel, unit, measured and simulated (n,) or (n, m)


def coverage_of(
    held_out: Iterable[tuple[Iterable[Pair], Mapping[str, Array]]],
) -> dict[str, Coverage]:
    """Share of the held-out samples within the band of each channel, and its mean width.

    Samples of a prediction that diverges are not covered; its band has no width.

    Parameters
    ----------
    held_out : iterable of (pairs, half widths)
        Of each held-out maneuver.
    """
    inside: dict[str, list[Array]] = {}
    widths: dict[str, list[Array]] = {}
    units: dict[str, str] = {}
    for pairs, band in held_out:
        for name, unit, measured, simulated in pairs:
            if name in band:
                away = (measured - simulated).reshape(len(measured), -1)
                seen = np.isfinite(measured.reshape(away.shape)).all(axis=1)
                distance, half = np.linalg.norm(away[seen], axis=1), band[name][seen]
                inside.setdefault(name, []).append(distance <= half)
                widths.setdefault(name, []).append(2.0 * half[np.isfinite(half)])
                units[name] = unit
    return {
        name: Coverage(
            nominal=NOMINAL,
            covered=float(np.mean(within)),
            width=float(np.mean(width)),
            unit=units[name],
            samples=len(within),
        )
        for name in inside
        for within, width in [(np.concatenate(inside[name]), np.concatenate(widths[name]))]
        if len(width)
    }


def cross_validation_of(model: IdentifiedModel) -> dict[str, CrossValidation]:
    """Pooled errors of the identifying maneuvers, each left out in turn.

    The standard error of the pooled mean square is that over maneuvers, weighted by their samples.
    """
    if model.left_out is None:
        return {}
    found = {}
    units = {s.symbol: s.unit for s in BY_PLANE[model.plane].states} | {TRACK: "m"}
    for name, spread in model.left_out.spread.items():
        rows = [m.channels[name] for m in model.left_out.maneuvers if name in m.channels]
        squares = np.array([r.rmse**2 for r in rows])
        weights = np.array([r.samples for r in rows]) / sum(r.samples for r in rows)
        mean, count = float(weights @ squares), len(rows)
        variance = float(np.sum((weights * (squares - mean)) ** 2)) * count / max(count - 1, 1)
        rmse = mean**0.5
        found[name] = CrossValidation(
            rmse=rmse,
            nrmse=rmse / max(spread, FLAT),
            se=variance**0.5 / (2.0 * rmse) if rmse > 0.0 else 0.0,
            unit=units[name],
        )
    return found
