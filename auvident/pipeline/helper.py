"""A second process that does pieces of work of a run, while this one goes on with others.

It is a copy of this process, made while nothing else runs in it, and has a piece of work told by
name: what it needs it imports and reads itself, so that little is copied to and fro. Most of what
one trial takes is not compiled and holds the interpreter's lock, which threads would wait for.
"""

import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, TypeVar

from auvident.errors import AuvidentError
from auvident.parallel import stay_alone, threads
from auvident.pipeline.observer import Observer

Result = TypeVar("Result")
# Of this process, those of libraries too; a copy lacks them, and might wait for them for ever.
THREADS = Path("/proc/self/task")
COPIED = "jemalloc_bg_thd"  # that of pyarrow's allocator, which is made to be copied
# asked for of a pipe, which holds what is told while the other process is at work
PIPE_BYTES = 2**20
TOLD, MADE, RAISED, FAILED = "told", "made", "raised", "failed"


@contextmanager
def helping(wanted: bool = True) -> "Iterator[Helper]":
    """A helper, which is gone afterwards; one that does everything here where none can be made."""
    helper = Helper(_Copy() if wanted and _can_copy() else None)
    try:
        yield helper
    finally:
        helper.dismiss()


@dataclass
class _Piece:
    """A piece of work that was told to a copy in so many bytes, and what was heard of it so far."""

    here: Callable[[], Any]
    told_bytes: int
    observer: Observer
    answer: tuple[str, Any] | None = None


class Helper:
    """Does pieces of work, one after another in a copy of this process where there is one.

    Whatever becomes of the copy, what it has not told is done here when it is asked for: nothing
    is lost but time. Errors are raised where the result is asked for.
    """

    def __init__(self, copy: "_Copy | None" = None) -> None:
        self._copy = copy
        self._waiting: deque[_Piece] = deque()

    @property
    def is_beside(self) -> bool:
        """Whether there is another process."""
        return self._copy is not None

    def begin(
        self, work: Callable[..., Result], *arguments: Any, observer: Observer | None = None
    ) -> Callable[[], Result]:
        """Begin a piece of work, and return what waits for its result.

        Parameters
        ----------
        work : callable
            A function of a module; it and its result can be pickled, and what it changes is lost.
        *arguments : objects
        observer : Observer, optional
            Given to the work as `observer`, and told what happens when the result is asked for.
        """
        here = partial(work, *arguments, **({} if observer is None else {"observer": observer}))
        if self._copy is None:
            return cache(here)
        order = pickle.dumps((work, arguments, observer is not None))
        told = sum(piece.told_bytes for piece in self._waiting)
        if told and told + len(order) > self._copy.holds_bytes:  # who tells would wait
            return cache(here)
        self._copy.tell(order)
        piece = _Piece(here, len(order), observer or Observer())
        self._waiting.append(piece)
        return partial(self._result, piece)

    def _result(self, piece: _Piece) -> Any:
        """What a piece of work came to; answers come in the order in which the work was told."""
        while piece.answer is None and self._copy is not None:
            first = self._waiting.popleft()
            first.answer = self._copy.hear(first.observer)
        if piece.answer is None or piece.answer[0] == FAILED:
            piece.answer = MADE, piece.here()
        kind, found = piece.answer
        if kind == RAISED:
            raise found
        return found

    def renew(self) -> None:
        """Have the copy know what this process has loaded since it was made, where possible."""
        if self._copy is not None and _can_copy():
            self.dismiss()
            self._copy = _Copy()

    def dismiss(self) -> None:
        """Let the copy go, whatever it is doing; from now on everything is done here."""
        if self._copy is not None:
            self._copy.end()
        self._copy = None
        self._waiting.clear()


class _Copy:
    """A copy of this process as it is now, that does as it is told."""

    def __init__(self) -> None:
        orders, tell = os.pipe()
        hear, answers = os.pipe()
        self.holds_bytes = _widened(tell)
        _widened(answers)  # so that the next piece is begun before anybody asks
        self._process = os.fork()
        if self._process == 0:
            _serve(orders, answers)
        os.close(orders)
        os.close(answers)
        self._tell, self._hear = os.fdopen(tell, "wb"), os.fdopen(hear, "rb")

    def tell(self, order: bytes) -> None:
        """Tell it what to do next."""
        with suppress(BrokenPipeError):  # it is gone, which is seen when nothing is heard
            self._tell.write(order)
            self._tell.flush()

    def hear(self, observer: Observer) -> tuple[str, Any]:
        """The next answer; what happens before it is passed on."""
        try:
            kind, found = pickle.load(self._hear)
            while kind == TOLD:
                name, arguments = found
                getattr(observer, name)(*arguments)
                kind, found = pickle.load(self._hear)
        except (pickle.UnpicklingError, EOFError):  # killed before it had told everything
            return FAILED, None
        return kind, found

    def end(self) -> None:
        """End it at once: it only reads, and nobody asks any more for what it would tell."""
        os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)
        self._hear.close()
        with suppress(BrokenPipeError):
            self._tell.close()


def _widened(pipe: int) -> int:
    """Bytes that a pipe surely holds, many where the system grants them.

    Half of what it has room for: what is told begins on a page of memory of its own.
    """
    import fcntl  # where there is `fork`

    with suppress(OSError):
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    return fcntl.fcntl(pipe, fcntl.F_GETPIPE_SZ) // 2


def _can_copy() -> bool:
    """Whether nothing runs in this process but this thread, and another processor is free."""
    if sys.platform != "linux" or threads() == 1:
        return False
    names = [(thread / "comm").read_text().strip() for thread in THREADS.iterdir()]
    return sum(name != COPIED for name in names) == 1


# --- in the other process -----------------------------------------------------------------


def _serve(orders: int, answers: int) -> NoReturn:
    """Do what is told until nobody is there to tell more; leave without this process's own end."""
    with suppress(BaseException):  # the other process does the work, and says what is wrong
        _keep_only(orders, answers)
        stay_alone()
        with os.fdopen(orders, "rb") as heard, os.fdopen(answers, "wb") as told:
            while True:
                _answer(heard, told)
    os._exit(0)


def _answer(heard: BinaryIO, told: BinaryIO) -> None:
    """Do one piece of work and tell its result, or its error where the user can act on it."""
    work, arguments, is_watched = pickle.load(heard)
    try:
        watching = {"observer": _Messenger(told)} if is_watched else {}
        answer = MADE, work(*arguments, **watching)
    except AuvidentError as error:
        answer = RAISED, error
    except Exception:
        answer = FAILED, None
    told.write(pickle.dumps(answer))
    told.flush()


class _Messenger(Observer):
    """Passes on what happens to whoever watches the other process."""

    def __init__(self, told: BinaryIO) -> None:
        self._told = told

    def _pass_on(self, name: str, *arguments: Any) -> None:
        self._told.write(pickle.dumps((TOLD, (name, arguments))))
        self._told.flush()

    def progress(self, text: str, fraction: float | None = None) -> None:
        """As of `Observer`."""
        self._pass_on("progress", text, fraction)

    def note(self, text: str) -> None:
        """As of `Observer`."""
        self._pass_on("note", text)

    def refused(self, problem: str) -> None:
        """As of `Observer`."""
        self._pass_on("refused", problem)


def _keep_only(*ends: int) -> None:
    """Hold nothing that others may wait for when the first process is gone: locks, pipes, signals.

    An interrupt at the keyboard is for the first process, which then ends this one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    first = 3
    for end in sorted(ends):
        os.closerange(first, end)
        first = end + 1
    os.closerange(first, os.sysconf("SC_OPEN_MAX"))
