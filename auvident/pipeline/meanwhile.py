"""A piece of work in a copy of this process, while this one goes on with another."""

import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

from auvident.parallel import threads

Result = TypeVar("Result")
# Of this process, those of libraries too; a copy lacks them, and might wait for them for ever.
THREADS = Path("/proc/self/task")
COPIED = "jemalloc_bg_thd"  # that of pyarrow's allocator, which is made to be copied


def meanwhile(work: Callable[[], Result]) -> Callable[[], Result]:
    """Begin a piece of work where that is safe, and return what waits for its result.

    Elsewhere, and whatever becomes of the copy, the work is done here when its result is asked
    for: nothing is lost but time, and its errors are raised by whom they concern.

    Parameters
    ----------
    work : callable
        It touches nothing that outlives it; its result can be pickled.
    """
    if not _can_copy():
        return cache(work)
    end, other_end = os.pipe()
    process = os.fork()
    if process == 0:
        _close_all_but(other_end)
        _answer(work, other_end)
    os.close(other_end)
    return cache(lambda: _heard(process, end, work))


def _can_copy() -> bool:
    """Whether nothing runs in this process but this thread, and another processor is free."""
    if sys.platform != "linux" or threads() == 1:
        return False
    names = [(thread / "comm").read_text().strip() for thread in THREADS.iterdir()]
    return sum(name != COPIED for name in names) == 1


def _close_all_but(end: int) -> None:
    """Keep nothing open, such as a lock, that others may wait for when this process is gone."""
    os.closerange(3, end)
    os.closerange(end + 1, os.sysconf("SC_OPEN_MAX"))


def _answer(work: Callable[[], Result], end: int) -> None:
    """Do the work, tell the result, and leave without what this process would do at its end."""
    with suppress(BaseException):  # the other process does the work again, and says what is wrong
        told = pickle.dumps(work())
        with os.fdopen(end, "wb") as stream:
            stream.write(told)
    os._exit(0)


def _heard(process: int, end: int, work: Callable[[], Result]) -> Result:
    """The result of the copy; without one the work is done here."""
    with os.fdopen(end, "rb") as stream:
        told = stream.read()
    os.waitpid(process, 0)
    try:
        found: Result = pickle.loads(told)
    except (pickle.UnpicklingError, EOFError):  # killed before it had told everything
        return work()
    return found
