"""Work in a copy of the process: the same result, whatever becomes of the copy."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from auvident import parallel
from auvident.errors import InputError
from auvident.pipeline import helper as module
from auvident.pipeline.helper import Helper, helping
from auvident.pipeline.observer import Observer

# in a process that has loaded nothing, as a command has when it begins
SCRIPT = """
import os, sys
from tests.test_helper import lock_is_open, pid, harmed
from auvident.pipeline.helper import helping
{open}
with helping() as helper:
    first, asked = helper.begin(pid), helper.begin({work})
    print(asked(), asked() == asked(), os.getpid(), first())
"""


def pid() -> int:
    return os.getpid()


def harmed(how: str, before: int) -> int:
    """The number of the process that is not harmed."""
    if os.getpid() != before:
        {"leaves": lambda: os._exit(1), "fails": lambda: 1 / 0, "dies": lambda: os.kill(pid(), 9)}[
            how
        ]()
    return os.getpid()


def lock_is_open(number: int, before: int) -> bool:
    return os.path.exists(f"/proc/self/fd/{number}") or os.getpid() == before


def told(work: str, threads: str = "2", open: str = "") -> list[str]:
    """What a process prints of some work."""
    alone = {**dict.fromkeys(parallel.BLAS_VARIABLES, "1"), parallel.VARIABLE: threads}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(work=work, open=open)],
        check=True, capture_output=True, text=True,
        env={**os.environ, **alone}, cwd=Path(__file__).parents[1],
    )  # fmt: skip
    assert not done.stderr
    return done.stdout.split()


def test_a_copy_does_the_work_where_there_is_room_for_it() -> None:
    for threads, copied in (("2", sys.platform == "linux"), ("1", False)):
        worker, same, here, first = told("pid", threads, "import pandas")
        assert same == "True" and worker == first
        assert (worker != here) == copied


def test_a_copy_that_dies_or_fails_costs_nothing_but_time() -> None:
    for how in ("leaves", "fails", "dies"):
        found = told(f"harmed, '{how}', os.getpid()")
        assert found[0] == found[2]


def test_a_copy_holds_nothing_open_that_others_wait_for() -> None:
    there = told("lock_is_open, lock.fileno(), os.getpid()", open="lock = open(os.devnull)")
    assert there[0] == "False"


@pytest.fixture
def beside(monkeypatch: pytest.MonkeyPatch) -> Iterator[Helper]:
    """A helper with a copy of this process, however many threads that has."""
    if sys.platform != "linux":
        pytest.skip("no copies of processes")
    monkeypatch.setattr(module, "_can_copy", lambda: True)
    with helping() as helper:
        assert helper.is_beside
        yield helper


class Told(Observer):
    def __init__(self) -> None:
        self.said: list[Any] = []

    def progress(self, text: str, fraction: float | None = None) -> None:
        self.said.append((text, fraction, os.getpid()))

    def note(self, text: str) -> None:
        self.said.append(text)

    def refused(self, problem: str) -> None:
        self.said.append(problem)


def watched(observer: Observer) -> int:
    observer.progress("half", 0.5)
    observer.note("noted")
    observer.refused("a log")
    return os.getpid()


def refuse(observer: Observer) -> None:
    raise InputError("no column u", "dvl.csv", "Name it.", lacks="u")


def large(size: int) -> bytes:
    return bytes(size)


def whose(_: bytes) -> int:
    return os.getpid()


def test_what_is_told_while_it_works_waits_where_there_is_room(beside: Helper) -> None:
    assert beside._copy is not None
    room = beside._copy.holds_bytes
    beside.begin(time.sleep, 0.2)
    later, too_much = (beside.begin(whose, bytes(size)) for size in (room // 2, room))
    assert too_much() == os.getpid() != later()


def test_what_happens_in_the_copy_is_told_here(beside: Helper) -> None:
    told = Told()
    asked = beside.begin(watched, observer=told)
    assert asked() != os.getpid()
    assert told.said == [("half", 0.5, os.getpid()), "noted", "a log"]


def test_answers_may_be_asked_for_in_any_order(beside: Helper) -> None:
    small, other, last = (beside.begin(large, size) for size in (3, 2_000_000, 5))
    assert [len(last()), len(small()), len(other()), len(small())] == [5, 3, 2_000_000, 3]


@pytest.mark.parametrize("copied", [True, False])
def test_errors_are_raised_where_the_result_is_asked_for(
    copied: bool, request: pytest.FixtureRequest
) -> None:
    helper: Helper = request.getfixturevalue("beside") if copied else Helper()
    asked = helper.begin(refuse, observer=Told())
    with pytest.raises(InputError, match="no column u") as caught:
        asked()
    error = caught.value
    assert (error.where, error.remedy, error.lacks) == ("dvl.csv", "Name it.", "u")


def test_what_was_asked_of_a_copy_that_was_let_go_is_done_here(beside: Helper) -> None:
    asked = beside.begin(pid)
    beside.dismiss()
    assert asked() == os.getpid() == beside.begin(pid)()
    assert not beside.is_beside


def test_a_new_copy_knows_what_was_loaded_since(
    beside: Helper, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SINCE", "then")
    assert beside.begin(os.getenv, "SINCE")() is None
    beside.renew()
    assert beside.begin(os.getenv, "SINCE")() == "then"


def test_other_threads_leave_all_the_work_here() -> None:
    other = threading.Event()
    waiting = threading.Thread(target=other.wait)
    waiting.start()
    done: list[int] = []
    with helping() as helper:
        asked: Callable[[], None] = helper.begin(done.append, 1)
        assert not (done or helper.is_beside)
        asked(), asked()
    assert done == [1]
    other.set()


def test_a_copy_ends_with_the_process_that_it_helps() -> None:
    """It looks up from its work, and nobody is there to tell."""
    if sys.platform != "linux":
        pytest.skip("no copies of processes")
    script = (
        "import os, time; from auvident.pipeline.helper import helping\n"
        "with helping() as helper:\n"
        "    print(helper.begin(os.getpid)(), flush=True)\n"
        "    helper.begin(time.sleep, 0.2); time.sleep(60)\n"
    )
    environment = {**os.environ, **dict.fromkeys(parallel.BLAS_VARIABLES, "1")}
    first = subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE, text=True, env={**environment, parallel.VARIABLE: "2"},
    )  # fmt: skip
    assert first.stdout is not None
    other = Path("/proc") / first.stdout.readline().strip() / "stat"
    first.kill()
    first.wait()
    ends = time.monotonic() + 20.0
    while is_alive(other) and time.monotonic() < ends:
        time.sleep(0.05)
    assert not is_alive(other)


def is_alive(stat: Path) -> bool:
    """Whether a process is there, and not only its exit code that nobody asked for."""
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
