"""How long something will still take, from what it took so far."""

import time
from collections.abc import Callable

LEAST_DONE, LEAST_S = 0.03, 1.5  # share and time from which on the rest is estimated


class TimeLeft:
    """Follows the share that is done of a piece of work; a smaller share begins another piece."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self._began, self._first = clock(), 0.0
        self._last: float | None = None

    def left_s(self, share: float | None) -> float | None:
        """Seconds that are left; None where nobody can know yet."""
        now = self.clock()
        if share is None or self._last is None or share < self._last:
            self._began, self._first = now, share or 0.0
        self._last = share
        if share is None:
            return None
        spent, done = now - self._began, share - self._first
        if done < LEAST_DONE or spent < LEAST_S:
            return None
        return spent * (1.0 - share) / done


def about(time_s: float) -> str:
    """A time in words, no finer than it is known: ``9 s``, ``40 s``, ``3 min``."""
    if time_s < 9.5:
        return f"{max(time_s, 1.0):.0f} s"
    return f"{5 * round(time_s / 5):.0f} s" if time_s < 57.5 else f"{time_s / 60.0:.0f} min"


def took(time_s: float) -> str:
    """A time that has passed: ``0.4 s``, ``12 s``, ``3 min 20 s``."""
    if time_s < 60.0:
        return f"{time_s:.1f} s" if time_s < 9.95 else f"{time_s:.0f} s"
    minutes, rest = divmod(round(time_s), 60)
    return f"{minutes} min {rest} s"
