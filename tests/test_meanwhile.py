"""Work in a copy of the process: the same result, whatever becomes of the copy."""

import os
import subprocess
import sys
import threading

from auvident import parallel
from auvident.pipeline.meanwhile import meanwhile

# in a process that has loaded nothing, as a command has when it begins
SCRIPT = """
import os, sys, time
from auvident.pipeline.meanwhile import meanwhile
before = os.getpid()
{open}
asked = meanwhile(lambda: {work})
print(asked(), asked() == asked(), before, os.getpid())
"""


def told(work: str, threads: str = "2", open: str = "") -> list[str]:
    """What a process prints of some work."""
    alone = {**dict.fromkeys(parallel.BLAS_VARIABLES, "1"), parallel.VARIABLE: threads}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(work=work, open=open)],
        check=True, capture_output=True, text=True,
        env={**os.environ, **alone},
    )  # fmt: skip
    assert not done.stderr
    return done.stdout.split()


def test_a_copy_does_the_work_where_there_is_room_for_it() -> None:
    for threads, copied in (("2", sys.platform == "linux"), ("1", False)):
        worker, same, before, after = told("os.getpid()", threads, "import pandas")
        assert same == "True" and before == after
        assert (worker != before) == copied


def test_a_copy_that_dies_or_fails_costs_nothing_but_time() -> None:
    for harm in ("os._exit(1)", "1 / 0", "os.kill(os.getpid(), 9)"):
        found = told(f"os.getpid() if os.getpid() == before else {harm}")
        assert found[0] == found[2]


def test_a_copy_holds_nothing_open_that_others_wait_for() -> None:
    there = told(
        "os.path.exists(f'/proc/self/fd/{lock.fileno()}') and os.getpid() != before",
        open="lock = open(os.devnull)",
    )
    assert there[0] == "False"


def test_errors_are_raised_where_the_result_is_asked_for() -> None:
    other = threading.Event()  # a second thread: nothing can be copied
    waiting = threading.Thread(target=other.wait)
    waiting.start()
    done = []
    asked = meanwhile(lambda: done.append(1))
    assert not done
    asked(), asked()
    assert done == [1]
    other.set()
