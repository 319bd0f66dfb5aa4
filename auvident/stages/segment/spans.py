"""Half-open ranges among which one that meets another is looked up, however many there are."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable


class Spans:
    """Ranges from start to stop, joined where they overlap.

    Parameters
    ----------
    ranges : iterable of (float, float)
        Samples or times.
    """

    def __init__(self, ranges: Iterable[tuple[float, float]] = ()) -> None:
        self._starts: list[float] = []
        self._stops: list[float] = []
        for start, stop in sorted(ranges):
            self.add(start, stop)

    def add(self, start: float, stop: float) -> None:
        """Add a range."""
        first, last = self._met(start, stop)
        if first < last:
            start = min(start, self._starts[first])
            stop = max(stop, self._stops[last - 1])
        self._starts[first:last] = [start]
        self._stops[first:last] = [stop]

    def meets(self, start: float, stop: float) -> bool:
        """Whether a range has something in common with any of them."""
        first, last = self._met(start, stop)
        return first < last

    def holds(self, sample: int) -> bool:
        """Whether a sample lies in any of them."""
        return self.meets(sample, sample + 1)

    def _met(self, start: float, stop: float) -> tuple[int, int]:
        """First and end of those that a range meets."""
        return bisect_right(self._stops, start), bisect_left(self._starts, stop)
