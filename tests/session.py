"""What many tests look at and takes long to make: once per session, also with several workers.

A worker of pytest-xdist that needs such a thing makes it while it holds a lock, and leaves it in a
folder that the workers of this session share; whoever comes next reads it there. Without workers,
and outside of pytest, it is made once per process and nothing is written.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

try:
    import fcntl
except ImportError:  # not on Windows: there every worker makes its own
    fcntl = None  # type: ignore[assignment]

Made = TypeVar("Made")
folder: Path | None = None  # that the workers share; set by conftest.py


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Wait for the others; the system releases the lock when its process dies."""
    with path.open("a") as file:
        if fcntl:
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def once(make: Callable[..., Made]) -> Callable[..., Made]:
    """`functools.cache` over all workers: for results that can be pickled, of plain arguments."""

    @cache
    @wraps(make)
    def made(*arguments: Any, **named: Any) -> Made:
        if folder is None or fcntl is None:
            return make(*arguments, **named)
        of = repr((make.__module__, make.__qualname__, arguments, sorted(named.items())))
        file = folder / f"{make.__name__}-{hashlib.sha256(of.encode()).hexdigest()[:16]}.pickle"
        with locked(file.with_suffix(".lock")):
            if file.exists():
                return pickle.loads(file.read_bytes())
            found = make(*arguments, **named)
            unfinished = file.with_suffix(f".{os.getpid()}")
            unfinished.write_bytes(pickle.dumps(found))
            unfinished.rename(file)
            return found

    return made
