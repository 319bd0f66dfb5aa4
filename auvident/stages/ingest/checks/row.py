"""What a row of the table of checks is, and what its test says."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, Self

import numpy as np

from auvident.constants import NORMAL_95
from auvident.stages.ingest.response import Relation

if TYPE_CHECKING:
    from auvident.stages.ingest.checks.seen import Seen

FAR_OFF = "only what is far off"  # how coarsely a test was made that no size limits
Outcome = Literal["agrees", "contradicts", "untested"]


@dataclass(frozen=True)
class Verdict:
    """What a test says of a trial; the fields are those of `auvident.schema.logs.CheckMade`."""

    outcome: Outcome
    message: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    remedy: str = ""
    fix: str = ""
    only: str = ""
    within: float | None = None


@dataclass(frozen=True)
class Check:
    """Declaration of one test.

    Attributes
    ----------
    name : str
        Also what ``--fix`` takes.
    what, against : str
        The quantity, and what it is held against, in words.
    test : callable
        `Seen` -> `Verdict`.
    limit : float or None
        Distance from what is expected that counts as a contradiction; None where the test has
        several.
    reason : str
        Why so much.
    code : str
        Of the finding; that of the name unless given.
    channel : str
        Without it in the trial there is nothing to test, and no row.
    after : tuple of str
        Checks above it in the table that have to stand, or this one tests nothing.
    """

    name: str
    what: str
    against: str
    test: "Callable[[Seen], Verdict]"
    limit: float | None
    reason: str
    code: str = ""
    after: tuple[str, ...] = ()
    channel: str = ""

    @property
    def finding(self) -> str:
        """Code of the finding of a contradiction."""
        return self.code or self.name


@dataclass(frozen=True)
class Figure:
    """An estimate with its standard deviation."""

    value: float
    std: float

    @classmethod
    def of(cls, found: Relation, term: int = 0) -> Self:
        """Coefficient of one term of a relation."""
        return cls(float(found.theta[term]), float(found.theta_std[term]))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - NORMAL_95 * self.std, self.value + NORMAL_95 * self.std

    def verdict(self, outcome: Outcome, message: str, remedy: str = "", fix: str = "") -> Verdict:
        """A verdict with this figure."""
        return Verdict(outcome, message, self.value, *self.interval, remedy=remedy, fix=fix)


@dataclass(frozen=True)
class Ratio:
    """A positive ratio with the standard deviation of its logarithm."""

    value: float
    log_std: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        factor = float(np.exp(NORMAL_95 * self.log_std))
        return self.value / factor, self.value * factor

    @property
    def log(self) -> float:
        """Natural logarithm of the value."""
        return float(np.log(self.value))

    def untold(self, limit: float) -> float:
        """Largest factor on either side that would have left the logarithm within its limit."""
        return float(np.exp(limit + abs(self.log)))

    def verdict(self, outcome: Outcome, message: str, remedy: str = "", fix: str = "") -> Verdict:
        """A verdict with this ratio."""
        return Verdict(outcome, message, self.value, *self.interval, remedy=remedy, fix=fix)


def coarsely(said: Verdict, factor: float) -> Verdict:
    """A verdict of a test of a scale that leaves much open: a factor up to so much is not told."""
    only = f"to a factor of {factor:.1f}" if np.isfinite(factor) else FAR_OFF
    return replace(said, only=only, within=factor)


def untested(message: str) -> Verdict:
    """Nothing in the trial or the vehicle file can test it; the message says what would."""
    return Verdict("untested", message)


def agrees(message: str, value: float | None = None) -> Verdict:
    """Nothing is said against it."""
    return Verdict("agrees", message, value)


def contradicts(message: str, value: float | None, remedy: str, fix: str = "") -> Verdict:
    """It cannot be as the log has it."""
    return Verdict("contradicts", message, value, remedy=remedy, fix=fix)
