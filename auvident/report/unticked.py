"""Figures of which nobody draws the ticks: the page writes its own, and has no use for artists.

matplotlib makes a tick of each axis, of eight artists, as soon as it is told anything about ticks;
that was half of the time in which the figures of a report were made.
"""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, YAxis
from matplotlib.figure import Figure


class _NotBefore:
    """No tick is made before someone asks for one by its number."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, axis: Axis | None, owner: type) -> Any:
        if axis is None:
            return self
        ticks: list[Tick] = []
        vars(axis)[self.name] = ticks
        return ticks


class _Across(XAxis):
    majorTicks: Any = _NotBefore()
    minorTicks: Any = _NotBefore()


class _Up(YAxis):
    majorTicks: Any = _NotBefore()
    minorTicks: Any = _NotBefore()


class Panel(Axes):
    """Axes with axes of the kinds above; everything else is as matplotlib has it."""

    def _init_axis(self) -> None:
        super()._init_axis()  # type: ignore[misc]
        self.xaxis.__class__, self.yaxis.__class__ = _Across, _Up


class Unticked(Figure):
    """A figure with such panels."""

    def add_subplot(self, *args: Any, **kwargs: Any) -> Any:
        """As of a figure."""
        return super().add_subplot(*args, **{"axes_class": Panel, **kwargs})

    def add_axes(self, *args: Any, **kwargs: Any) -> Any:
        """As of a figure."""
        return super().add_axes(*args, **{"axes_class": Panel, **kwargs})
