"""The search beside one-off events: what it masks, and when it begins anew."""

from types import SimpleNamespace
from typing import Any

import pytest

from auvident.stages.diagnose.checks.events import Event
from auvident.stages.diagnose.select import events_aside
from auvident.stages.diagnose.select.events_aside import Pushes, traced_without_events

EVENT = Event("turn-1", 10.0, 3.0, 8.0, ("v", "r"), 0.1)


class Masked:
    """A case that remembers what was masked in it."""

    def __init__(self, windows: tuple[Any, ...] = ()) -> None:
        self.windows = windows

    def masked(self, windows: Any) -> "Masked":
        return Masked(tuple(windows))


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Cases searched, the effects found in each and the events told, by what a fit leaves."""

    def run(before: list[Event], after: list[Event], effects: tuple[str, ...]) -> Any:
        monkeypatch.setattr(events_aside, "baseline_of", lambda case: ("baseline", case.windows))
        told = {"baseline": before, "final": after}
        monkeypatch.setattr(
            Pushes,
            "left_by",
            lambda self, fit: told["final" if hasattr(fit, "effects") else "baseline"],
        )
        seen = []

        def trace(case: Any, baseline: Any) -> Any:
            assert baseline == ("baseline", case.windows)
            seen.append(case.windows)
            return SimpleNamespace(final=SimpleNamespace(effects=effects))

        case: Any = Masked()
        _, events = traced_without_events(Pushes(case, {}, 1.0), trace)
        return seen, events

    return run


WINDOW = ("turn-1", 10.0, 13.0)


def test_without_an_event_there_is_one_search(searched) -> None:
    assert searched([], [], ("current",)) == ([()], [])


def test_an_event_is_masked_before_any_search(searched) -> None:
    assert searched([EVENT], [], ("current",)) == ([(WINDOW,)], [EVENT])


def test_an_event_that_shows_beside_what_was_found_begins_the_search_anew(searched) -> None:
    assert searched([], [EVENT], ("current",)) == ([(), (WINDOW,)], [EVENT])


def test_without_an_effect_nobody_looks_twice(searched) -> None:
    assert searched([], [EVENT], ()) == ([()], [])
