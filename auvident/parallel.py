"""Independent pieces of work side by side; what comes out does not depend on how many at a time.

The kernels run without the interpreter's lock, so threads are enough. Every piece is a function
of its argument alone and results come back in order: one thread or several, the same bytes. The
threads of the linear algebra library keep no such promise, and on our small matrices they cost
more than they gain: one is enough (a diagnosis on two processors took half as long again with two).
"""

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

# Two make a diagnosis 1.3 times as fast; what is not compiled waits for the interpreter's lock, so
# that many would only wait. More than two were not measured. Copies of the process (fork) in their
# place end a round of fits in 0.9 of the time, and a diagnosis in 1.1 of it: they cost some 10 ms
# each time, and what one of them has worked out once the others work out again.
MOST_THREADS = 4
VARIABLE = "AUVIDENT_THREADS"
# with all of them at one, linear algebra that is loaded later has one thread from the start
BLAS_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
_here = threading.local()  # whether this thread already does one of several pieces of work


@cache
def threads() -> int:
    """Number of threads: as the environment says, else that of the processors we may use."""
    asked = os.environ.get(VARIABLE, "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), MOST_THREADS)
    return min(os.cpu_count() or 1, MOST_THREADS)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), thread_name_prefix="auvident")


def each(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    effort: Callable[[Item], float] | None = None,
) -> list[Result]:
    """Results of a function for some items, in their order.

    A function that calls `each` again does what it asks for in its own thread: all threads might
    wait for each other otherwise, and the outer pieces keep them busy with fewer places to wait.
    A single piece is done at once, and has all threads for what it asks for.

    Parameters
    ----------
    function : callable
    items : iterable
    effort : callable, optional
        How long an item takes, in any unit: the longest begin first, so that no thread is left
        alone with one at the end.
    """
    every = list(items)
    if len(every) < 2 or threads() == 1 or getattr(_here, "at_work", False):
        return [function(item) for item in every]
    order = list(range(len(every)))
    if effort is not None:
        order.sort(key=lambda i: -effort(every[i]))
    pending = {i: _pool().submit(_at_work, function, every[i]) for i in order}
    return [pending[i].result() for i in range(len(every))]


def load_beside(module: str) -> None:
    """Import in another thread what will be needed; an error is left to who needs it."""
    if threads() > 1:
        _pool().submit(import_module, module)


def stay_alone() -> None:
    """From now on this thread does all that it asks `each` for by itself."""
    _here.at_work = True


def _at_work(function: Callable[[Item], Result], item: Item) -> Result:
    _here.at_work = True
    try:
        return function(item)
    finally:
        _here.at_work = False


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Linear algebra of numpy and of scipy on one thread."""
    from threadpoolctl import threadpool_limits

    if any(os.environ.get(name) != "1" for name in BLAS_VARIABLES):
        import scipy.linalg  # noqa: F401 (what is not loaded yet cannot be limited)
    with threadpool_limits(1, user_api="blas"):
        yield
