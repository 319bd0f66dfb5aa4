"""A kind of damage: one row of the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from seatrial.damage.log import Log

# What a program can do at best: give the right result, refuse, or say what is amiss.
RIGHT, REFUSED, SAID = "right", "refused", "said"
BEST = (RIGHT, REFUSED, SAID)

Apply = Callable[[Log, float, np.random.Generator], None]


@dataclass(frozen=True)
class Kind:
    """A row.

    id : of the row
    fault : what a message has to name, in a word or two that several rows may share
    does : in words; ``{}`` is the size
    best : the best outcome there is, one of `BEST`
    apply : does it to a log, with a size and a random stream
    sizes : how much; none where there is nothing to choose
    sensor : whose file or channel is not to be trusted
    without : sensors that are taken out beforehand
    family : of the rows of one module
    figure : whether what is told of it has the size as its figure, whatever the sign
    """

    id: str
    fault: str
    does: str
    best: str
    apply: Apply
    sizes: tuple[float, ...] = ()
    sensor: str = ""
    without: tuple[str, ...] = ()
    family: str = ""
    figure: bool = False

    def cases(self) -> list[Case]:
        """The row with each of its sizes."""
        return [Case(self, size) for size in self.sizes] or [Case(self, None)]


@dataclass(frozen=True)
class Case:
    """A kind of damage with a size."""

    kind: Kind
    size: float | None

    @property
    def id(self) -> str:
        """``kind`` or ``kind:size``."""
        return self.kind.id if self.size is None else f"{self.kind.id}:{self.size:g}"

    @property
    def words(self) -> str:
        """What it does."""
        return self.kind.does if self.size is None else self.kind.does.format(f"{self.size:g}")

    def apply(self, log: Log, rng: np.random.Generator) -> None:
        """Damage a log."""
        log.remove(*self.kind.without)
        self.kind.apply(log, 0.0 if self.size is None else self.size, rng)


def family(name: str, *rows: Kind) -> tuple[Kind, ...]:
    """Rows of one family."""
    return tuple(replace(row, family=name) for row in rows)
