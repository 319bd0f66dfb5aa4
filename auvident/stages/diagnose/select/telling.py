"""What a search tells whoever waits for it: the round, what it tries, how far it has come."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from auvident.schema.effect_words import words_of

Tell = Callable[[str, float | None], None]

# Share of the time of a round that each of its steps takes: the mean over the rounds of the samples
# harbour and bay, which differ by a third of it.
SHARES = {
    "effects compared with the residual": 0.12,
    "effects": 0.34,
    "fitted to convergence": 0.26,
    "the best one held against the others": 0.07,
    "tried on maneuvers left out": 0.21,
}
SCREEN, FIT, SETTLE, COMPARE, LEAVE_OUT = SHARES


def untold(text: str, share: float | None) -> None:
    """Nobody listens."""


@dataclass
class Telling:
    """Where a search is.

    Attributes
    ----------
    tell : callable
        Called with a text and the share of the round that is done.
    """

    tell: Tell = untold
    number: int = 0
    _done: float = 0.0
    _step: str = SCREEN
    _count: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, effects: int) -> None:
        """Another round, with so many effects to choose from."""
        self.number += 1
        self._done, self._step = 0.0, SCREEN
        self._say(f"{effects} {SCREEN}", 0.0)

    def enter(self, step: str) -> None:
        """A step of the round begins."""
        steps = list(SHARES)
        self._done = sum(SHARES[earlier] for earlier in steps[: steps.index(step)])
        self._step, self._count = step, 0
        self._say(step, 0.0)

    def one_of(self, total: int, effect: str) -> None:
        """One of so many effects is done with; several may be at a time."""
        with self._lock:
            self._count += 1
            text = f"{self._count} of {total} {self._step}, {words_of(effect)}"
            self._say(text, self._count / total)

    def next(self, effect: str) -> None:
        """One more effect, of nobody knows how many: the first ones take most of the time."""
        self._say(f"{words_of(effect)} {self._step}", 1.0 - 0.5**self._count)
        self._count += 1

    def _say(self, text: str, share: float) -> None:
        self.tell(f"round {self.number}: {text}", self._done + share * SHARES[self._step])
