"""Candidates of a search: what was tried, what is known of it, and what looks like it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.effects import BY_ID, EFFECTS
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, check_cost, log_gain
from auvident.stages.diagnose.fit.refits import without
from auvident.stages.diagnose.score.first_order import Joint, in_parts
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.records import Account, Reconciled
from auvident.stages.diagnose.select.rule import Refusal, passes

Array = npt.NDArray[Any]

NEAR_BOUND = 1.0e-3  # of the width between the bounds: as good as at one


@dataclass(frozen=True)
class Tried:
    """A candidate after its refit, and why it was refused (None: accepted)."""

    fitted: Fitted
    account: Account
    refusal: Refusal | None = None

    @property
    def id(self) -> str:
        """The effect."""
        return self.account.id

    @property
    def gain(self) -> float:
        """Rise of the log-likelihood [nats]."""
        return self.account.gain


@dataclass(frozen=True)
class Round:
    """One search: the model it began with and what was tried, best first.

    ``screened`` are first-order gains by candidate [nats].
    """

    before: Fitted
    joint: Joint
    tried: tuple[Tried, ...]
    screened: dict[str, float]
    alike: tuple[str, ...] = ()
    accepted: str | None = None


@dataclass(frozen=True)
class Traced:
    """Result of the search; `unclaimed` are effects taken along without a claim."""

    case: Case
    baseline: Fitted
    final: Fitted
    rounds: tuple[Round, ...]
    steps: tuple[str, ...] = ()
    unclaimed: tuple[str, ...] = ()
    without: FitsWithout = field(default_factory=FitsWithout)

    @property
    def named(self) -> tuple[str, ...]:
        """Effects that are claimed."""
        return tuple(e for e in self.final.effects if e not in self.unclaimed)

    @property
    def claimed(self) -> list[Round]:
        """Rounds in which an effect was accepted that is claimed, or gave way to one that is."""
        return [r for r in self.rounds if r.accepted and r.accepted not in self.unclaimed]


def steady(effect: str) -> tuple[str, ...]:
    """Effects that show in a straight run as one does, itself with them; none for the others.

    In the coefficients that were fitted without it each of them has left its mark, so that they
    are compared from the estimate as well.
    """
    return tuple(e.id for e in EFFECTS if e.steady) if BY_ID[effect].steady else ()


def ranked(values: dict[str, float]) -> list[str]:
    """Names, largest value first."""
    return sorted(values, key=lambda name: (-values[name], name))


def account_of(
    case: Case, before: Fitted, fitted: Fitted, by_others: float, settled: bool, promise: float
) -> Account:
    """What is known of a candidate, the last effect of a fit; see `Account`."""
    effect, p = fitted.effects[-1], fitted.parameters
    return Account(
        id=effect,
        gain=log_gain(before, fitted),
        by_others=by_others,
        parameters=len(case.positions(effect)),
        size=size_of(case, effect, fitted),
        falls=falls_of(case, before, fitted),
        rms=tuple(fitted.rms.tolist()),
        impossible=impossible(case, effect, p),
        settled=settled,
        promise=promise,
        maneuvers=len(case.records),
    )


def falls_of(case: Case, before: Fitted, after: Fitted) -> dict[str, float]:
    """Relative falls of the residual by channel; sensors that disagree count as one."""
    falls = 1.0 - after.rms / before.rms
    found = {name: float(fall) for name, fall in zip(case.channels, falls, strict=True)}
    old, new = check_cost(case, before.parameters), check_cost(case, after.parameters)
    if passes(old - new, rules.SENSORS):
        found["sensors"] = 1.0 - float(np.sqrt(new / old))
    return found


def by_sensors(case: Case, effect: str, p: Array) -> bool:
    """Whether sensors held against each other show an effect, whatever the model."""
    old, new = check_cost(case, without(case, p, [effect])), check_cost(case, p)
    share = (old - new) / old if old > 0.0 else 0.0
    return passes(Reconciled(old - new, share), rules.BY_SENSORS)


def size_of(case: Case, effect: str, fitted: Fitted) -> float:
    """Size of an effect beyond what every model is expected to have, in practical sizes.

    Of a force that bears no size for itself: of what does the same, see `in_parts`.
    """
    own = case.positions(effect)
    size = (fitted.parameters[own] - case.setup.prior[own]) / case.setup.prior_std[own]
    by_parts = in_parts(case, fitted, effect)
    if by_parts is not None:
        return float(np.linalg.norm(by_parts @ size))
    return float(np.linalg.norm(size / case.practical(own)))


def bounds_of(case: Case, effect: str, p: Array) -> dict[int, float]:
    """Positions of the parameters at a physical bound other than off, with the sign of the bound.

    A bound is where the search ends, not what is true: a parameter there is known to one side.
    """
    found = {}
    for i in case.positions(effect):
        near = NEAR_BOUND * (case.high[i] - case.low[i])
        if p[i] >= case.high[i] - near:
            found[i] = 1.0
        elif case.low[i] < 0.0 and p[i] <= case.low[i] + near:
            found[i] = -1.0
    return found


def impossible(case: Case, effect: str, p: Array) -> bool:
    """Whether a parameter lies at the bound to a side where no size is possible.

    Some bounds reach further to one side than to the other: no servo moves before its command,
    and a little of that is allowed for clocks alone.
    """
    sides = bounds_of(case, effect, p).items()
    return any(sign * (case.low[i] + case.high[i]) < 0.0 for i, sign in sides)


def open_of(case: Case, fitted: Fitted) -> list[int]:
    """Positions of the effects' parameters of a fit."""
    return case.positions(*fitted.effects)
