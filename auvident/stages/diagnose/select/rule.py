"""A rule: evidence of a plain record, a threshold, and the refusal of what does not reach it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Tried = TypeVar("Tried")


@dataclass(frozen=True)
class Refusal:
    """Why something is not done: the rule, what it looked at and what it asks for."""

    code: str
    text: str
    evidence: float | None = None
    threshold: float | None = None


@dataclass(frozen=True)
class Rule(Generic[Tried]):
    """A rule of the search, to be called with what was tried.

    Attributes
    ----------
    code : str
    asks : str
        What it asks for, for people.
    evidence : callable
    least, most : float
        What the evidence has to reach, or may not exceed; one of the two is given.
    words : str
        Why what fails it is refused, without which it stands as what it asks for; fields are
        ``evidence``, ``least``, ``most`` and whatever the record has.
    """

    code: str
    asks: str
    evidence: Callable[[Tried], float]
    least: float | None = None
    most: float | None = None
    words: str = ""

    @property
    def threshold(self) -> float:
        """The one that is given."""
        value = self.most if self.least is None else self.least
        assert value is not None
        return value

    def __call__(self, tried: Tried) -> Refusal | None:
        """None where it is met."""
        value = float(self.evidence(tried))
        met = value >= self.threshold if self.most is None else value <= self.threshold
        if met:
            return None
        known: dict[str, Any] = {n: getattr(tried, n) for n in dir(tried) if n[:1] != "_"}
        known |= {"evidence": value, "least": self.least, "most": self.most}
        text = (self.words or f"not so that {self.asks}").format_map(known)
        return Refusal(self.code, text, value, self.threshold)


def refusal_of(tried: Tried, rules: Sequence[Rule[Tried]]) -> Refusal | None:
    """What the first rule says that is not met; None where all are."""
    for rule in rules:
        refusal = rule(tried)
        if refusal is not None:
            return refusal
    return None


def passes(tried: Tried, rules: Sequence[Rule[Tried]]) -> bool:
    """Whether every rule is met."""
    return refusal_of(tried, rules) is None


def passes_any(tried: Tried, rules: Sequence[Rule[Tried]]) -> bool:
    """Whether some rule is met."""
    return any(rule(tried) is None for rule in rules)
