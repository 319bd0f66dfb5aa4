"""Independent pieces of work side by side; what comes out does not depend on how many at a time.

The kernels run without the interpreter's lock, so threads are enough. Every piece is a function
of its argument alone and results come back in order: one thread or several, the same bytes. The
threads of the linear algebra library keep no such promise, and on our small matrices they cost
more than they gain: one is enough (a diagnosis on two processors took half as long again with two).

Who asks for pieces of work does them, and others that are idle take their part: of the outermost
pieces as long as there are any, as these are the largest, then of those within the last of them.
Who has none left helps those who still work for him. So nobody waits for what no one has begun,
and pieces within pieces cannot wait for ever.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from typing import Any, Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

# Two make a diagnosis 1.4 times as fast; what is not compiled waits for the interpreter's lock, so
# that many would only wait. More than two were not measured. Copies of the process (fork) in their
# place end a round of fits in 0.9 of the time, and a diagnosis in 1.1 of it: they cost some 10 ms
# each time, and what one of them has worked out once the others work out again.
MOST_THREADS = 4
VARIABLE = "AUVIDENT_THREADS"
# with all of them at one, linear algebra that is loaded later has one thread from the start
BLAS_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
_here = threading.local()  # the work of which this thread does a piece; whether it stays alone


@cache
def threads() -> int:
    """Number of threads: as the environment says, else that of the processors we may use."""
    asked = os.environ.get(VARIABLE, "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), MOST_THREADS)
    return min(os.cpu_count() or 1, MOST_THREADS)


@dataclass
class _Shared(Generic[Item, Result]):
    """Pieces of work that several threads take part in.

    ``untaken`` are those not begun; ``within`` is the work whose piece needs these.
    """

    function: Callable[[Item], Result]
    items: Sequence[Item]
    untaken: deque[int]
    within: "_Shared[Any, Any] | None" = None
    results: dict[int, Result] = field(default_factory=dict)
    errors: dict[int, Exception] = field(default_factory=dict)

    @property
    def is_done(self) -> bool:
        return len(self.results) + len(self.errors) == len(self.items)

    def is_for(self, other: "_Shared[Any, Any]") -> bool:
        """Whether a piece of the other work needs this one."""
        return self.within is not None and (self.within is other or self.within.is_for(other))

    def outcome(self) -> list[Result]:
        """Results in the order of the items; the first error is raised."""
        if self.errors:
            raise self.errors[min(self.errors)]
        return [self.results[place] for place in range(len(self.items))]


class _Crew:
    """Threads that take part in what is offered, the oldest first."""

    def __init__(self, number: int) -> None:
        self._changed = threading.Condition()
        self._offered: list[_Shared[Any, Any]] = []
        for k in range(number):
            name = f"auvident-{k + 1}"
            threading.Thread(target=self._serve, name=name, daemon=True).start()

    def offer(self, work: _Shared[Any, Any]) -> None:
        """Have those who are idle take part."""
        with self._changed:
            self._offered.append(work)
            self._changed.notify_all()

    def do(self, work: _Shared[Any, Any]) -> None:
        """Work with the others until it is done; once all is begun, on what they need for it."""
        self.offer(work)
        try:
            while self._take_piece(work):
                pass
        finally:
            with self._changed:
                work.untaken.clear()  # where this thread was interrupted
                self._open()
        while other := self._needed(work):
            self._take_piece(other)

    def _take_piece(self, work: _Shared[Any, Any]) -> bool:
        """Do a piece; False where all are begun."""
        try:
            place = work.untaken.popleft()
        except IndexError:
            return False
        before, _here.work = getattr(_here, "work", None), work
        try:
            work.results[place] = work.function(work.items[place])
        except Exception as error:
            work.errors[place] = error
        finally:
            _here.work = before
        if work.is_done:
            with self._changed:
                self._changed.notify_all()
        return True

    def _needed(self, work: _Shared[Any, Any]) -> _Shared[Any, Any] | None:
        """What is offered last of all that a work waits for; None once it is done."""
        with self._changed:
            while not work.is_done:
                if needed := [other for other in self._open() if other.is_for(work)]:
                    return needed[-1]
                self._changed.wait()
            return None

    def _open(self) -> list[_Shared[Any, Any]]:
        """What is offered and not all begun."""
        self._offered[:] = [work for work in self._offered if work.untaken]
        return self._offered

    def _serve(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._open)
                work = self._offered[0]
            self._take_piece(work)
            del work  # which may hold the data of a whole trial


@cache
def _crew() -> _Crew:
    """All threads but the one that asks."""
    return _Crew(threads() - 1)


if hasattr(os, "register_at_fork"):  # a copy of this process has none of its threads
    os.register_at_fork(after_in_child=_crew.cache_clear)


def each(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    effort: Callable[[Item], float] | None = None,
) -> list[Result]:
    """Results of a function for some items, in their order.

    Parameters
    ----------
    function : callable
        It may call `each` again.
    items : iterable
    effort : callable, optional
        How long an item takes, in any unit: the longest begin first, so that no thread is left
        alone with one at the end.
    """
    every = list(items)
    if len(every) < 2 or threads() == 1 or getattr(_here, "is_alone", False):
        return [function(item) for item in every]
    order = list(range(len(every)))
    if effort is not None:
        order.sort(key=lambda i: -effort(every[i]))
    work = _Shared(function, every, deque(order), getattr(_here, "work", None))
    _crew().do(work)
    return work.outcome()


def all_of(*pieces: Callable[[], Any]) -> list[Any]:
    """Results of different pieces of work, in their order."""
    return each(lambda piece: piece(), pieces)


def beside(piece: Callable[[], Any]) -> None:
    """Do in another thread what will be needed; an error is left to who needs it."""
    if threads() > 1 and not getattr(_here, "is_alone", False):
        _crew().offer(_Shared(lambda done: done(), [piece], deque([0])))


def load_beside(module: str) -> None:
    """Import in another thread what will be needed; an error is left to who needs it."""
    beside(partial(import_module, module))


def stay_alone() -> None:
    """From now on this thread does all that it asks `each` for by itself."""
    _here.is_alone = True


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Linear algebra of numpy and of scipy on one thread."""
    from threadpoolctl import threadpool_limits

    if any(os.environ.get(name) != "1" for name in BLAS_VARIABLES):
        import scipy.linalg  # noqa: F401 (what is not loaded yet cannot be limited)
    with threadpool_limits(1, user_api="blas"):
        yield
