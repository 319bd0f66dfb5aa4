"""Forces without physics: does one explain more than every named effect?

A force on an axis of the plane follows a regressor that belongs to no effect of the table: a
function of the heading or of the pitch, or of the motion a while ago. Regressors are made of
simulated states; measured ones are stirred by the same turbulence as the residual. Each is fitted
like an effect; a first-order gain says little here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.free_run import RecordResidual
from auvident.engines.records import Record
from auvident.parallel import each
from auvident.physics.terms import EQUATIONS, FREE_FORCE, FREE_FORCES
from auvident.schema.planes import HORIZONTAL, VERTICAL, Plane, PlaneRow
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, fit_with, log_gain
from auvident.stages.diagnose.fit.refits import holding, nested
from auvident.stages.diagnose.score.first_order import Form, scores_of_forms
from auvident.stages.diagnose.score.left_out import (
    FitsWithout,
    fits_without,
    gains_told,
    seen_with,
    t_value,
)

Array = npt.NDArray[Any]
Regressor = Callable[[Array, Record, float], Array]

REFITTED = 2
FREE_GAIN, FREE_FALL = 120.0, 0.2  # a free force that gains and explains so much may be something
SLOW_S: VehicleTime = 4.0  # lags of the regressors with memory
QUICK_S: VehicleTime = 1.5


def lagged(values: Array, time_s: float, dt_s: float) -> Array:
    """First-order lag of a series."""
    keep, state = float(np.exp(-dt_s / time_s)), float(values[0])
    out = np.empty(len(values))
    for k, value in enumerate(values):
        state = keep * state + (1.0 - keep) * float(value)
        out[k] = state
    return out


HEADINGS: dict[str, Regressor] = {
    "cos heading": lambda x, r, dt: np.cos(x[:, 3]),
    "sin heading": lambda x, r, dt: np.sin(x[:, 3]),
    "cos 2 heading": lambda x, r, dt: np.cos(2.0 * x[:, 3]),
    "sin 2 heading": lambda x, r, dt: np.sin(2.0 * x[:, 3]),
}
# weight and buoyancy take up the first harmonic in heave and pitch, but in no other equation
PITCHES: dict[str, Regressor] = {
    "sin pitch": lambda x, r, dt: np.sin(x[:, 3]),
    "sin 2 pitch": lambda x, r, dt: np.sin(2.0 * x[:, 3]),
    "cos 2 pitch": lambda x, r, dt: np.cos(2.0 * x[:, 3]),
}


def motions(plane: PlaneRow) -> dict[str, Regressor]:
    """Regressors of what the vehicle did a while ago."""
    _, a, b = plane.velocities
    return {
        f"delayed |{a}| {b}": lambda x, r, dt: lagged(np.abs(x[:, 1]) * x[:, 2], SLOW_S, dt),
        f"delayed u {b}": lambda x, r, dt: lagged(x[:, 0] * x[:, 2], QUICK_S, dt),
        f"rate of change of u {b}": lambda x, r, dt: np.gradient(x[:, 0] * x[:, 2], dt),
        f"delayed {plane.fin} angle": lambda x, r, dt: lagged(r.inputs[:, 0], SLOW_S, dt),
        f"delayed {plane.states[2].words.removesuffix(f' {b}')}": lambda x, r, dt: lagged(
            x[:, 2], SLOW_S, dt
        ),
    }


REGRESSORS: dict[Plane, dict[str, Regressor]] = {
    "horizontal": HEADINGS | motions(HORIZONTAL),
    "vertical": PITCHES | motions(VERTICAL),
}


@dataclass(frozen=True)
class FreeForce:
    """A force along a regressor, fitted.

    Attributes
    ----------
    regressor : str
    axis : str
        Of the plane, where it is largest in units of its prior.
    size : float
        Root mean square on that axis [N or N m].
    gain : float
        Rise of the log-likelihood [nats].
    falls : (3,) array
        Relative fall of the rms of each channel.
    helps : float or None
        What it brings to maneuvers left out of its fit, in standard errors; None where that was
        not worked out.
    """

    regressor: str
    axis: str
    size: float
    gain: float
    falls: Array
    helps: float | None = None


def free_forces(case: Case, fitted: Fitted, without: FitsWithout | None = None) -> list[FreeForce]:
    """Free forces that explain most beside a fitted model, best first.

    Parameters
    ----------
    case : Case
    fitted : Fitted
    without : FitsWithout, optional
        Fits of other models. With them the forces that explain as much as something does are tried
        on maneuvers left out.
    """
    there = REGRESSORS[case.plane.name]
    cases = {name: _with_series(case, of, fitted.residuals) for name, of in there.items()}
    forms = [Form(fitted.parameters, own.records) for own in cases.values()]
    scores = scores_of_forms(case, fitted, FREE_FORCE, forms)
    gains = dict(zip(cases, scores or (), strict=scores is not None))
    best = sorted(gains, key=lambda name: -gains[name].gain)[:REFITTED]

    def fit(name: str) -> Fitted:
        own, effects = cases[name], (*fitted.effects, FREE_FORCE)
        start = gains[name].parameters
        found = fit_with(own, effects, start, fitted.colours, rounds=1, steps=6)
        return nested(own, fitted, found or holding(own, fitted, effects))

    found = [
        _described(cases[name], name, fitted, after, without)
        for name, after in zip(best, each(fit, best), strict=True)
    ]
    return sorted(found, key=lambda f: -f.gain)


def _with_series(case: Case, regressor: Regressor, residuals: Sequence[RecordResidual]) -> Case:
    """The case with a regressor on all three axes, of root mean square one."""
    raw = {
        r.id: regressor(residual.states, r, case.setup.dt_s)
        for r, residual in zip(case.records, residuals, strict=True)
    }
    size = float(np.sqrt(np.mean(np.concatenate(list(raw.values())) ** 2))) or 1.0
    return case.with_free_force(
        {key: np.repeat(values[:, None] / size, 3, axis=1) for key, values in raw.items()}
    )


def _described(
    case: Case, name: str, before: Fitted, after: Fitted, without: FitsWithout | None
) -> FreeForce:
    sizes = {f[-1]: after.parameters[case.position(f)] for f in FREE_FORCES}
    stds = {f[-1]: case.setup.prior_std[case.position(f)] for f in FREE_FORCES}
    axis = max(sizes, key=lambda a: abs(sizes[a]) / stds[a])
    gain, falls = log_gain(before, after), 1.0 - after.rms / before.rms
    much = gain > FREE_GAIN and falls.max() > FREE_FALL
    return FreeForce(
        name,
        dict(zip(EQUATIONS, case.plane.axes, strict=True))[axis],
        float(sizes[axis]),
        gain,
        falls,
        _helps(case, before, after, without) if much and without is not None else None,
    )


def _helps(case: Case, before: Fitted, after: Fitted, without: FitsWithout) -> float:
    """What a force brings to maneuvers left out in turn, in standard errors."""
    old = seen_with(case, before, without.of(case, before), after.colours)
    new = seen_with(case, after, fits_without(case, after), after.colours)
    return t_value(np.concatenate(gains_told(old, new, log_gain(before, after))))
