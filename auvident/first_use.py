"""The first use on a machine: helper processes compile the kernels side by side.

Each helper does one piece of work, which calls the kernels that it is to compile; afterwards this
process finds them in the cache, and its own memory has not grown by what compiling takes. What
the pieces are is up to those who know what will be called.
"""

import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from auvident.jit import _permanent, cache_is_writable, compiled_already, remove_unused

Work = Callable[[], object]
LOCK = ".compiling"


def is_first(kind: str) -> bool:
    """Whether the kernels of a filter are still to be compiled, and are kept once they are."""
    return cache_is_writable() and not compiled_already(kind)


@contextmanager
def alone() -> Iterator[None]:
    """Wait until no other process compiles; what it left need not be compiled again.

    The system releases the lock when its process dies. Without locks (Windows, some network file
    systems) nobody waits, and several may compile the same.
    """
    folder = _permanent()
    if folder is None or sys.platform == "win32":
        yield
        return
    import fcntl

    with (folder / LOCK).open("a") as file:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def compile_side_by_side(pieces: Sequence[Work]) -> None:
    """Do some pieces of work in a process each.

    Whatever becomes of a helper, nothing is lost but time: what it does not leave in the cache
    is compiled when it is called.

    Parameters
    ----------
    pieces : sequence of callables
        That can be pickled.
    """
    remove_unused()
    told = [pickle.dumps(piece) for piece in pieces]
    helpers = [_helper() for _ in pieces]
    try:
        for helper, piece in zip(helpers, told, strict=True):
            _tell(helper, piece)
        for helper in helpers:
            helper.wait()
    except BaseException:
        for helper in helpers:
            helper.kill()
        raise


def _helper() -> subprocess.Popen[bytes]:
    """A process that does the piece of work it is told."""
    return subprocess.Popen(
        [sys.executable, "-m", "auvident.first_use"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _tell(helper: subprocess.Popen[bytes], piece: bytes) -> None:
    assert helper.stdin is not None  # it was asked for
    with suppress(BrokenPipeError):  # it did not get as far as to read
        helper.stdin.write(piece)
        helper.stdin.close()


if __name__ == "__main__":
    pickle.load(sys.stdin.buffer)()
