"""How well the sizes of effects are known: from the curvature and from the scatter of maneuvers."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from auvident.engines.free_run import normal_equations
from auvident.schema.diagnosis import Bound, ParameterValue, ends
from auvident.schema.effects import BY_ID, EFFECTS, EffectParameter, parameter_of
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, output_error, prior_of
from auvident.stages.diagnose.score.left_out import MOST_FITS, FitsWithout
from auvident.stages.diagnose.select.candidates import bounds_of, open_of
from auvident.stages.diagnose.select.instants import instant_of, span_of

Array = npt.NDArray[Any]

INTERVAL = 0.975
TIMED = tuple(
    n for e in EFFECTS if e.alike == "late" for n in e.names() if parameter_of(n).unit == "s"
)


def spreads(case: Case, fitted: Fitted, fits: FitsWithout) -> Array:
    """Standard deviation (n_parameters,) of the free parameters of a fit.

    The larger of what the curvature says and of the scatter when maneuvers are left out
    (jackknife).
    """
    free, moving = fitted.free, case.setup.free(fitted.free)
    output = output_error(case, fitted.colours)
    curvature = prior_of(case, free, open_of(case, fitted)).information
    for record in case.records:
        parts = normal_equations(output, fitted.parameters, record, moving)
        if parts is not None:
            curvature = curvature + parts[2]
    out = np.zeros(len(fitted.parameters))
    out[free] = np.sqrt(np.diag(np.linalg.inv(curvature))) * moving.scale
    lent_s = lent(case)
    for i, name in enumerate(case.names):
        if name in TIMED and i in free:
            out[i] = math.hypot(out[i], lent_s)
    if len(case.records) > 2:
        without = fits.of(case, fitted)
        count, away = len(without), without - without.mean(0)
        scatter = np.sqrt((count - 1) / count * np.sum(away**2, axis=0))
        out = np.maximum(out, np.where(out > 0.0, scatter, 0.0))
    return out


def lent(case: Case) -> float:
    """What the nuisance lag and delay of the fin may lend to another time, or take [s]."""
    own = [n for n in TIMED if n in case.names and n.startswith(case.plane.fin)]
    return math.hypot(*(float(case.nuisance_std[case.position(n)]) for n in own))


def effect_values(case: Case, effect: str, p: Array, stds: Array) -> tuple[ParameterValue, ...]:
    """Parameters of an effect in the units of the artifacts, with 95 % intervals."""
    found, at = [], bounds_of(case, effect, p)
    freedom = max(min(len(case.records), MOST_FITS) - 1, 1)
    reach = float(stdtrit(freedom, INTERVAL))
    for i in case.positions(effect):
        declared = parameter_of(case.names[i])
        value, std = declared.shown(float(p[i] - case.setup.prior[i]), float(stds[i]))
        bound = bound_of(declared, at[i]) if i in at else None
        found.append(
            ParameterValue(
                symbol=declared.symbol,
                value=value,
                std=std,
                unit=declared.unit,
                bound=bound,
                **ends(value, reach * std, bound),
            )
        )
    return tuple(found)


def bound_of(declared: EffectParameter, side: float) -> Bound:
    """What a parameter at its upper (1) or lower (-1) bound is known to be, as shown.

    A limit is stored as its inverse: the largest internal value is the least limit.
    """
    return "at least" if (side > 0.0) == (declared.form == "plain") else "at most"


def time_of(case: Case, effect: str, p: Array) -> ParameterValue | None:
    """Time of an effect as the log of the first trial counts it, with the interval it lies in."""
    instant, declared = instant_of(case, effect), BY_ID[effect].instant
    if instant is None or declared is None:
        return None
    first, half = case.records[0], 0.5 * float(p[instant.width])
    time = float(p[instant.time] + first.time_s[0] - span_of(first)[0])
    return ParameterValue(
        symbol=declared.symbol,
        value=time,
        std=half / 3.0**0.5,
        unit=declared.unit,
        low=time - half,
        high=time + half,
    )
