"""How well the sizes of effects are known: from the curvature and from the scatter of maneuvers."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.free_run import normal_equations
from auvident.estimation.chances import student_quantile
from auvident.physics.terms import LINEAR_DRAG
from auvident.schema.diagnosis import Bound, ParameterValue, ends
from auvident.schema.effects import BY_ID, EFFECTS, EffectParameter, parameter_of
from auvident.stages.diagnose.fit.case import Case, counted_from
from auvident.stages.diagnose.fit.fits import Fitted, output_error, prior_of
from auvident.stages.diagnose.score.left_out import MOST_FITS, FitsWithout
from auvident.stages.diagnose.select.candidates import bounds_of, open_of
from auvident.stages.diagnose.select.instants import instant_of, span_of
from auvident.stages.diagnose.select.starts import known_to_sensors

Array = npt.NDArray[Any]

INTERVAL = 0.975
INFORMED = 0.5  # of the share of the data in a parameter
# Of what all maneuvers tell of a parameter: a fit without the one that tells nearly all knows it to
# three times the standard deviation of the fit to all, and that is no scatter. Of a backlash one
# straight run told 99 %; without it 1.8 deg were 0.75 (odd seed 13597, which chose this).
LEAST_TOLD = 0.1
# [rad] Without a compass headings are the sum of the yaw rate, and that of a vehicle that rolls by
# phi in a turn is short of that of its heading by 1 - cos phi: 5 deg in a full circle at 10 deg.
# Two of drawn vehicles (odd seeds 13443 and 13503, which chose this) were off by 4.6 and 3.7 deg,
# and 15 in logs with a compass by 0.3 at the most.
SUMMED_HEADING = math.radians(4.0)
NORTHWARD, EASTWARD = "current.north_mps", "current.east_mps"
TIMED = tuple(
    n for e in EFFECTS if e.alike == "late" for n in e.names() if parameter_of(n).unit == "s"
)


def spreads(case: Case, fitted: Fitted, fits: FitsWithout) -> Array:
    """Standard deviation (n_parameters,) of the free parameters of a fit.

    The larger of what the curvature says, with what every vehicle has of it where that is
    subtracted or may be lent, and of the scatter when maneuvers are left out (jackknife); no more
    than what sensors held against each other leave open.
    """
    free, moving = fitted.free, case.setup.free(fitted.free)
    prior, of_record = _information(case, fitted)
    whole = prior + of_record.sum(axis=0)
    out = np.zeros(len(fitted.parameters))
    out[free] = np.sqrt(np.diag(np.linalg.inv(whole))) * moving.scale
    for i in free:
        out[i] = math.hypot(out[i], of_every_vehicle(case, int(i)))
    if len(case.records) > 2:
        groups = [
            of_record[k::MOST_FITS].sum(axis=0) for k in range(min(len(of_record), MOST_FITS))
        ]
        known = _informed(prior, whole, groups)
        out[free] = np.maximum(out[free], scatter(fits.of(case, fitted)[:, free], known))
    return np.minimum(np.hypot(out, by_heading(case, fitted)), known_by_sensors(case, fitted))


def by_heading(case: Case, fitted: Fitted) -> Array:
    """What a heading that is only summed up leaves open in the parameters (n_parameters,)."""
    out = np.zeros(len(fitted.parameters))
    if counted_from(case.records) == "bow":
        for name, across in ((NORTHWARD, EASTWARD), (EASTWARD, NORTHWARD)):
            speed = abs(float(fitted.parameters[case.position(across)]))
            out[case.position(name)] = SUMMED_HEADING * speed
    return out


def of_every_vehicle(case: Case, i: int) -> float:
    """Standard deviation of what every vehicle has of an effect's parameter, in its own unit.

    Of times what the fin may lend (`lent`). Of drag in proportion to u what the friction line
    makes of it: the size of the effect is what is beyond, and the line is known no better (four
    planted drags of even seeds were off by 2.2 to 4.8 of their deviations, and are by 0.4 to 2.6).
    """
    name = case.names[i]
    if name in TIMED:
        return lent(case)
    return float(case.nuisance_std[i]) if name == LINEAR_DRAG else 0.0


def _information(case: Case, fitted: Fitted) -> tuple[Array, Array]:
    """Information of the prior (k, k) and of each maneuver (m, k, k) on the free parameters."""
    output, moving = output_error(case, fitted.colours), case.setup.free(fitted.free)
    prior = prior_of(case, fitted.free, open_of(case, fitted)).information
    parts = (normal_equations(output, fitted.parameters, r, moving) for r in case.records)
    return prior, np.array([np.zeros_like(prior) if p is None else p[2] for p in parts])


def _informed(prior: Array, whole: Array, groups: Sequence[Array]) -> npt.NDArray[np.bool_]:
    """Which parameters (k,) each fit (f, k) without some maneuvers is told of by the others.

    Half of the share that the data have of them at least, and `LEAST_TOLD` of the information.
    Without the only maneuver after a step of thrust its size is that of the prior, which is no
    scatter (even seed 5190).
    """
    variances = [np.diag(np.linalg.inv(whole - own)) for own in (0.0 * whole, *groups)]
    of_prior = np.diag(np.linalg.inv(prior))
    shares = 1.0 - np.array(variances) / of_prior
    told = variances[0] / np.array(variances[1:])
    return (shares[1:] >= INFORMED * shares[0]) & (told >= LEAST_TOLD)


def scatter(fits: Array, known: npt.NDArray[np.bool_]) -> Array:
    """Jackknife standard deviations (k,) of parameters (f, k), of the fits that know of each."""
    count = known.sum(axis=0)
    away = fits - np.sum(np.where(known, fits, 0.0), axis=0) / np.maximum(count, 1)
    squares = np.sum(np.where(known, away**2, 0.0), axis=0)
    return np.asarray(np.sqrt(np.maximum(count - 1, 0) / np.maximum(count, 1) * squares))


def known_by_sensors(case: Case, fitted: Fitted) -> Array:
    """How well sensors held against each other know the parameters (n_parameters,) of a fit.

    Root of the sum of squares of what they leave open and of how far the fit is from what they
    say; infinite where they say nothing.
    """
    out = np.full(len(fitted.parameters), np.inf)
    for name, (mean, std) in known_to_sensors(case, fitted.effects).items():
        i = case.position(name)
        out[i] = math.hypot(std, fitted.parameters[i] - mean)
    return out


def lent(case: Case) -> float:
    """What the nuisance lag and delay of the fin may lend to another time, or take [s]."""
    own = [n for n in TIMED if n in case.names and n.startswith(case.plane.fin)]
    return math.hypot(*(float(case.nuisance_std[case.position(n)]) for n in own))


def effect_values(
    case: Case, effect: str, p: Array, stds: Array | None
) -> tuple[ParameterValue, ...]:
    """Parameters of an effect in the units of the artifacts, with 95 % intervals.

    Without standard deviations in internal units they have the values alone.
    """
    found, at = [], bounds_of(case, effect, p)
    freedom = max(min(len(case.records), MOST_FITS) - 1, 1)
    reach = student_quantile(freedom, INTERVAL)
    for i in case.positions(effect):
        declared = parameter_of(case.names[i])
        internal = float(p[i] - case.setup.prior[i])
        value, std = declared.shown(internal, 0.0 if stds is None else float(stds[i]))
        bound = bound_of(declared, at[i]) if i in at else None
        known = {} if stds is None else ends(value, reach * std, bound, declared.known_to)
        found.append(
            ParameterValue(
                symbol=declared.symbol,
                value=value,
                std=None if stds is None else std,
                unit=declared.unit,
                bound=bound,
                matters_from=_matters_from(case, effect, i),
                **known,
            )
        )
    return tuple(found)


def _matters_from(case: Case, effect: str, position: int) -> float | None:
    """Practical size of a parameter as shown; None where only its parts have one."""
    practical = float(case.practical([position])[0] * case.setup.prior_std[position])
    if BY_ID[effect].parts or practical <= 0.0:
        return None
    return parameter_of(case.names[position]).shown(practical)[0]


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
