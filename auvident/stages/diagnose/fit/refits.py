"""Fits with effects from more than one start: from where a search stands, and afresh.

Coefficients that were fitted without an effect have drifted to where they take up part of it, and
a fit that begins there may end in a valley of its own, however many steps it is given: at the
trial of seed 1143 a hull asymmetry gains 1,120 nats from there and 2,200 from the estimate.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import (
    Fitted,
    first_colours,
    fit_with,
    log_gain,
)

Array = npt.NDArray[Any]

FRESH_ROUNDS, FRESH_STEPS = 3, 8  # from the estimate it is a longer way
SETTLED = 1.0  # [nats] a refit that gains less has converged: a hundredth of what is worth a name
MOST_REFITS = 4  # of two rounds each; a fit from the estimate has three


def refit(
    case: Case,
    effects: Sequence[str],
    starts: Sequence[Array],
    like: Fitted,
    rounds: int = 2,
    steps: int = 8,
    ceiling: float = np.inf,
) -> Fitted | None:
    """Best fit with effects from several starts; None where nothing comes of any of them."""
    fits = [
        fit_with(case, effects, start, like.colours, rounds=rounds, steps=steps, ceiling=ceiling)
        for start in starts
    ]
    return best_of(fits)


def holding(case: Case, before: Fitted, effects: Sequence[str]) -> Fitted:
    """A model as a fit with more effects, none of which does anything."""
    return replace(before, effects=tuple(effects), free=case.with_baseline(effects))


def nested(case: Case, before: Fitted, fitted: Fitted) -> Fitted:
    """A fit that contains a model never ends below it.

    One that does has lost its way: it begins again at the model, with its own effect off and at
    the size it had come to, and at the worst it stays there.
    """
    gained = log_gain(before, fitted)
    if gained > 0.0:
        return fitted
    if gained > -SETTLED:  # there is nothing to be gained
        return holding(case, before, fitted.effects)
    sized, own = before.parameters.copy(), case.positions(fitted.effects[-1])
    sized[own] = fitted.parameters[own]
    again = refit(case, fitted.effects, [before.parameters, sized], before, 1, 5)
    best = best_of([holding(case, before, fitted.effects), again])
    assert best is not None
    return best


def settled(case: Case, fitted: Fitted) -> Fitted:
    """A fit carried on until it gains no more."""
    for _ in range(MOST_REFITS):
        again = refit(case, fitted.effects, [fitted.parameters], fitted)
        if again is None or log_gain(fitted, again) <= 0.0:
            return fitted
        fitted, gained = again, log_gain(fitted, again)
        if gained < SETTLED:
            break
    return fitted


def best_of(fits: Sequence[Fitted | None]) -> Fitted | None:
    """The likeliest of some fits."""
    good = [f for f in fits if f is not None]
    return max(good, key=lambda f: f.log_likelihood) if good else None


def from_estimate(case: Case, effects: Sequence[str], sizes: Array) -> Fitted | None:
    """Fit from the analytical estimate, with the effects at the sizes in a parameter vector."""
    start = case.at_rest(case.setup.prior)
    own = case.positions(*effects)
    start[own] = sizes[own]
    colours = first_colours(case, start)
    return fit_with(case, effects, start, colours, rounds=FRESH_ROUNDS, steps=FRESH_STEPS)


def from_both(case: Case, effects: Sequence[str], start: Array, like: Fitted) -> Fitted | None:
    """Best fit with effects from a start, and afresh with the sizes found."""
    return afresh_too(case, effects, start, refit(case, effects, [start], like))


def afresh_too(
    case: Case, effects: Sequence[str], start: Array, near: Fitted | None
) -> Fitted | None:
    """The better of a fit from a start and of one from the estimate with the sizes found."""
    sizes = start if near is None else near.parameters
    return best_of([near, from_estimate(case, effects, sizes)])


def without(case: Case, p: Array, effects: Sequence[str]) -> Array:
    """Parameters with some effects off."""
    q = p.copy()
    own = case.positions(*effects)
    q[own] = case.setup.prior[own]
    return q


def apart(fitted: Fitted, effects: Sequence[str]) -> tuple[str, ...]:
    """Effects of a fit apart from some."""
    return tuple(e for e in fitted.effects if e not in effects)


def prior_cost(case: Case, fitted: Fitted) -> float:
    """Half the squared sizes of the effects in units of their prior [nats].

    The likelihood leaves them out; of two explanations the one with typical sizes is likelier.
    """
    own = case.positions(*fitted.effects)
    away = (fitted.parameters[own] - case.setup.prior[own]) / case.setup.prior_std[own]
    return 0.5 * float(np.sum(away**2))
