"""How well the sizes of effects are known: from the curvature and from the scatter of maneuvers."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from auvident.schema.diagnosis import ParameterValue
from auvident.schema.effects import EFFECTS, parameter_of
from auvident.stages.diagnose.candidates import open_of
from auvident.stages.diagnose.case import Case
from auvident.stages.diagnose.fits import Fitted, prior_of, record_parts
from auvident.stages.diagnose.leftout import MOST_FITS, leave_out

Array = npt.NDArray[Any]

INTERVAL = 0.975
TIMED = tuple(
    n for e in EFFECTS if e.alike == "late" for n in e.names() if parameter_of(n).unit == "s"
)
TIMED_STD_S = 0.045  # silent lag and delay of a servo together


def together(case: Case, effect: str, covariance: Array) -> dict[str, Any]:
    """Covariance of the parameters of an effect that has several, and its degrees of freedom."""
    own = case.positions(effect)
    declared = [parameter_of(case.names[i]) for i in own]
    if len(own) < 2 or any(p.form != "plain" for p in declared):
        return {}
    factors = np.array([p.factor for p in declared])
    matrix = covariance[np.ix_(own, own)] * np.outer(factors, factors)
    return {"covariance": tuple(map(tuple, matrix.tolist())), "freedom": freedom_of(case)}


def freedom_of(case: Case) -> int:
    """Degrees of freedom of a scatter between maneuvers left out."""
    return max(min(len(case.records), MOST_FITS) - 1, 1)


def covariance_of(case: Case, fitted: Fitted) -> tuple[Array, Array]:
    """Covariances (n_parameters, n_parameters) of the free parameters of a fit.

    What the curvature says, and the scatter when maneuvers are left out (jackknife).
    """
    free, moving = fitted.free, case.setup.free(fitted.free)
    _, curvature, _, _ = prior_of(case, free, open_of(case, fitted))
    for record in case.records:
        parts = record_parts(case, fitted.parameters, record, fitted.colours, moving)
        if parts is not None:
            curvature = curvature + parts[2]
    n = len(fitted.parameters)
    by_curvature, scatter = np.zeros((n, n)), np.zeros((n, n))
    scale = np.outer(moving.scale, moving.scale)
    by_curvature[np.ix_(free, free)] = np.linalg.inv(curvature) * scale
    if len(case.records) > 2:
        without = leave_out(case, fitted, fitted.colours).parameters
        away = without - without.mean(0)
        scatter = (len(away) - 1) / len(away) * away.T @ away
    return by_curvature, scatter


def spreads(case: Case, fitted: Fitted, covariance: tuple[Array, Array]) -> Array:
    """Standard deviation (n_parameters,) of the free parameters of a fit.

    The larger of what the curvature says and of the scatter when maneuvers are left out.
    """
    out, scatter = (np.sqrt(np.diag(matrix)) for matrix in covariance)
    for i, name in enumerate(case.names):
        if name in TIMED and i in fitted.free:  # every model's allowances may lend or take this
            out[i] = math.hypot(out[i], TIMED_STD_S)
    return np.maximum(out, np.where(out > 0.0, scatter, 0.0))


def effect_values(case: Case, effect: str, p: Array, stds: Array) -> tuple[ParameterValue, ...]:
    """Parameters of an effect in the units of the artifacts, with 95 % intervals."""
    found = []
    reach = float(stdtrit(freedom_of(case), INTERVAL))
    for i in case.positions(effect):
        declared = parameter_of(case.names[i])
        value, std = declared.shown(float(p[i] - case.setup.prior[i]), float(stds[i]))
        found.append(ParameterValue(
            symbol=declared.symbol, value=value, std=std, unit=declared.unit,
            low=value - reach * std, high=value + reach * std,
        ))  # fmt: skip
    return tuple(found)
