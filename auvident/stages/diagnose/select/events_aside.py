"""The search with one-off events out of the way: what happened once says nothing of an effect."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from auvident.stages.diagnose.checks.events import Event, find_events, smallest_push
from auvident.stages.diagnose.checks.waves import Residual
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.select.starts import baseline_of

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Pushes:
    """Where to look for one-off events.

    Attributes
    ----------
    case : Case
        With all readings.
    headings : mapping
        Heading (n,) of each record [rad].
    hull_time_s : float
        L/U of the vehicle.
    """

    case: Case
    headings: Mapping[str, Array]
    hull_time_s: float

    def left_by(self, fitted: Fitted) -> list[Event]:
        """Events in what a fit to all readings leaves."""
        return find_events(
            pieces_of(self.case, fitted.residuals, self.headings),
            self.case.setup.sensor_std[:3],
            self.case.plane,
            self.hull_time_s,
        )

    def smallest(self, fitted: Fitted) -> tuple[float, float] | None:
        """Changes of sway and yaw that would be an event in what a fit leaves."""
        return smallest_push(
            pieces_of(self.case, fitted.residuals, self.headings),
            self.case.setup.sensor_std[:3],
            self.hull_time_s,
        )

    def masked(self, events: Sequence[Event]) -> Case:
        """The case without the readings of events."""
        return self.case.masked([(e.maneuver, e.time_s, e.time_s + e.duration_s) for e in events])


def traced_without_events(
    pushes: Pushes, trace: Callable[[Case, Fitted], Traced]
) -> tuple[Traced, list[Event]]:
    """The search for effects with one-off events masked, and these.

    What an effect that is missing does may hide a push. Where none stands out at first, another
    look is taken at what the effects found leave; if one does, the search begins anew without it.

    Parameters
    ----------
    pushes : Pushes
    trace : callable
        The search in a case, from its fit without any effect.
    """
    baseline = baseline_of(pushes.case)
    events = pushes.left_by(baseline)
    if not events:
        traced = trace(pushes.case, baseline)
        events = pushes.left_by(traced.final) if traced.final.effects else []
        if not events:
            return traced, []
    masked = pushes.masked(events)
    return trace(masked, baseline_of(masked)), events


def headings_of(case: Case) -> dict[str, Array]:
    """Heading (n,) of each record; of the vertical plane as logged, zero where it is not."""
    found = {}
    for record in case.records:
        logged = record.source.heading if record.source is not None else None
        found[record.id] = record.given[:, 3] if logged is None else logged
    return found


def pieces_of(
    case: Case, residuals: Sequence[Any], headings: Mapping[str, Array]
) -> list[Residual]:
    """Residuals as the searches for waves and events take them."""
    return [
        Residual(r.id, r.time_s, r.error, record.given[:, 0], headings[r.id], record.given[:, 3])
        for r, record in zip(residuals, case.records, strict=True)
    ]
