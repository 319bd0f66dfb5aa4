"""What an effect brings to maneuvers left out of its fit, with what the sensors say of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, check_cost, log_gain
from auvident.stages.diagnose.score.left_out import (
    FitsWithout,
    Helped,
    helped,
    noise_floor,
    seen_with,
)
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import Tried
from auvident.stages.diagnose.select.decisions import judge
from auvident.stages.diagnose.select.healthy import strength
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rule import passes
from auvident.stages.diagnose.select.telling import LEAVE_OUT, Telling


def judged_with(
    case: Case,
    before: Fitted,
    tried: Sequence[Tried],
    told: Telling | None = None,
    without: FitsWithout | None = None,
) -> list[Tried]:
    """What the rules say of the candidates of a round, those left out of their fit tried last.

    Parameters
    ----------
    before : Fitted
        The model without any of them.
    tried : sequence of Tried
        Largest gain first.
    told : Telling, optional
    without : FitsWithout, optional
        Fits of other rounds.
    """
    told, without = told or Telling(), without or FitsWithout()
    told.enter(LEAVE_OUT)
    fits = {t.id: t.fitted for t in tried}

    def left_out(account: Account) -> Helped:
        told.next(account.id)
        return left_out_with(case, before, fits[account.id], without)

    accounts = judge([t.account for t in tried], left_out)
    return [Tried(fits[account.id], account, refusal) for account, refusal in accounts]


def left_out_with(case: Case, before: Fitted, after: Fitted, without: FitsWithout) -> Helped:
    """What a model does for the maneuvers left out, beside the one without its last effect."""
    old = seen_with(case, before, without.of(case, before), after.colours)
    new = seen_with(case, after, without.of(case, after), after.colours)
    floor = noise_floor(case, after.colours)
    found = helped(old, new, log_gain(before, after), floor)
    found = with_sensors(case, before, after, found)
    return replace(found, strength=strength(found))


def with_sensors(case: Case, before: Fitted, fitted: Fitted, found: Helped) -> Helped:
    """The same with what the sensors say about each other, which needs no maneuver."""
    old, new = check_cost(case, before.parameters), check_cost(case, fitted.parameters)
    gained = old - new
    if not passes(gained, rules.SENSORS):
        return found
    return Helped(
        found.gain + gained,
        share=1.0,  # the sensors are the same in every maneuver
        t=max(found.t, float(np.sqrt(2.0 * gained))),
        explained=max(found.explained, gained / old),
    )
