"""Words of the verdict, each by a rule; the report prints the table of them.

A rule is a row: up to which limit a figure is called so. Words elsewhere in the report follow from
these rows and from `auvident.report.tables_model.SIGHT`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from auvident.report.tables import Rows, Table, columns


@dataclass(frozen=True)
class Word:
    """Up to `limit` a figure is called `words`; `grade` is the CSS class."""

    limit: float
    words: str
    grade: str


@dataclass(frozen=True)
class Called:
    """A figure and what it is called.

    Attributes
    ----------
    figure : str
        For people.
    words : tuple of Word
        In rising order of their limits, the last one without.
    unit : str
        Behind the limits.
    """

    figure: str
    words: tuple[Word, ...]
    unit: str = ""

    def of(self, value: float) -> Word:
        """The word for a value; a limit itself belongs to the word before it."""
        return next(word for word in self.words if not value > word.limit)

    def told(self) -> str:
        """All of it in one line."""
        pieces = [f"up to {w.limit:g}{self.unit}: {w.words}" for w in self.words[:-1]]
        return f"{'; '.join(pieces)}; above: {self.words[-1].words}"


NEVER = math.inf
ERROR = Called(
    "NRMSE of a channel over the held-out maneuvers",
    (
        Word(0.1, "well", "good"),
        Word(0.3, "fairly well", "fair"),
        Word(1.0, "poorly", "poor"),
        Word(NEVER, "worse than a constant would", "poor"),
    ),
)
BAND = Called(
    "share of the held-out samples in the 95 % band",
    (
        Word(0.75, "too narrow: errors are larger than it says", "poor"),
        Word(0.90, "somewhat too narrow", "fair"),
        Word(NEVER, "to be trusted", "good"),
    ),
)
GAIN = Called(
    "RMSE of the estimate from geometry over that of the model",
    (
        Word(0.95, "worse than the estimate", "poor"),
        Word(1.05, "no better than the estimate", "fair"),
        Word(NEVER, "better than the estimate", "good"),
    ),
)
SETTLED = Called(
    "last change of a coefficient over its standard deviation",
    (
        Word(0.5, "settled", "good"),
        Word(1.0, "nearly settled", "fair"),
        Word(NEVER, "moved in the last round", "poor"),
    ),
)
PASS, FAIL = "pass", "fail"
LAGS = Called(
    "share of the lags of the autocorrelation outside their 95 % band",
    (Word(0.10, PASS, "good"), Word(NEVER, FAIL, "poor")),
)
RULES = (ERROR, BAND, GAIN, SETTLED, LAGS)
GRADES = ("good", "fair", "poor", "none")


def worst(grades: Sequence[str]) -> str:
    """The worst of some grades; ``none`` where there is none."""
    return max(grades, key=GRADES.index) if grades else "none"


def table(sight: str) -> Table:
    """The rules for the reader, with the one for what a coefficient rests on."""
    rows: Rows = [[r.figure, r.told()] for r in RULES] + [
        ["share of a coefficient's certainty", sight]
    ]
    return Table(columns(("figure", "called")), rows)
