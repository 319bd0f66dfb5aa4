"""Progress: what is tried, how far it is, how long it will still take."""

import io
import itertools
from pathlib import Path

import pytest

from auvident.cli.lines import in_lines
from auvident.cli.time_left import TimeLeft, about, took
from auvident.cli.watch import Watch
from auvident.stages.diagnose.select.telling import COMPARE, FIT, SETTLE, SHARES, Telling


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_the_rest_is_estimated_from_what_is_done() -> None:
    clock = Clock()
    pace = TimeLeft(clock)
    assert pace.left_s(0.0) is None
    clock.now = 1.0
    assert pace.left_s(0.1) is None  # too early to tell
    clock.now = 10.0
    assert pace.left_s(0.26) == pytest.approx(10.0 * 0.74 / 0.26, rel=0.2)
    assert pace.left_s(None) is None


def test_a_smaller_share_begins_something_new() -> None:
    clock = Clock()
    pace = TimeLeft(clock)
    pace.left_s(0.0)
    clock.now = 100.0
    assert pace.left_s(0.5) == pytest.approx(100.0, rel=0.1)
    assert pace.left_s(0.0) is None  # round 2
    clock.now = 110.0
    pace.left_s(0.1)
    clock.now = 120.0
    assert pace.left_s(0.5) == pytest.approx(20.0, rel=0.3)


@pytest.mark.parametrize(
    ("time_s", "left", "passed"),
    [
        (0.2, "1 s", "0.2 s"),
        (8.7, "9 s", "8.7 s"),
        (23.0, "25 s", "23 s"),
        (200.0, "3 min", "3 min 20 s"),
    ],
)
def test_times_in_words(time_s: float, left: str, passed: str) -> None:
    assert (about(time_s), took(time_s)) == (left, passed)


def test_a_search_says_what_it_tries() -> None:
    said: list[tuple[str, float | None]] = []
    told = Telling(lambda text, share: said.append((text, share)))
    told.begin(41)
    told.enter(FIT)
    told.one_of(2, "rudder_lag")
    told.one_of(2, "gyro_delay")
    told.enter(SETTLE)
    told.next("rudder_lag")
    told.next("gyro_delay")
    told.enter(COMPARE)
    told.begin(41)
    texts = [text for text, _ in said]
    assert texts[0] == "round 1: 41 effects compared with the residual"
    assert texts[2] == "round 1: 1 of 2 effects, servo lag"
    assert texts[5] == "round 1: servo lag fitted to convergence"
    assert texts[-1].startswith("round 2: ")
    shares = [share for _, share in said[:-1] if share is not None]
    assert shares == sorted(shares) and shares[-1] < 1.0 and said[-1][1] == 0.0
    assert sum(SHARES.values()) == pytest.approx(1.0)


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


def watched(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch, quiet: bool = False) -> str:
    monkeypatch.setattr("sys.stderr", stream)
    clock = Clock()
    with Watch(quiet) as watch:
        watch.started("diagnose")
        watch._pace = TimeLeft(clock)
        for k, share in itertools.product(range(2), (0.1, 0.5)):
            clock.now += 10.0 * k + 1.0
            watch.progress("round 1: 1 of 2 effects, servo lag", share)
        watch.finished("diagnose", {}, 12.3) if quiet else watch._line("diagnose: done")
    return stream.getvalue()


def test_a_terminal_has_a_bar_with_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    text = watched(Terminal(), monkeypatch)
    assert "started" not in text
    assert "diagnose: round 1: 1 of 2 effects, servo lag" in text
    assert "left" in text


def test_a_pipe_has_a_line_at_the_start_and_none_of_the_bar(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert watched(io.StringIO(), monkeypatch) == "diagnose: started\ndiagnose: done\n"
    assert watched(io.StringIO(), monkeypatch, quiet=True) == ""
    assert watched(Terminal(), monkeypatch, quiet=True) == ""


def test_a_stage_in_a_pipe_has_a_line_at_its_start_and_at_its_end(demo: Path, auvident) -> None:
    lines = auvident("segment", demo).err.splitlines()
    assert lines[0] == "segment: started"
    assert lines[-1].startswith("segment: done in ")
    assert auvident("segment", demo, "--json").out[0] == "["


def test_a_message_breaks_between_words_and_keeps_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "Error: a rather long message\n  Run `auvident identify a/path/that/is/long/enough`."
    assert in_lines(text) == text
    monkeypatch.setenv("COLUMNS", "24")
    lines = in_lines(text).splitlines()
    assert lines[:2] == ["Error: a rather long", "message"]
    assert lines[2] == "  Run `auvident identify"
    assert lines[3] == "  a/path/that/is/long/enough`."
