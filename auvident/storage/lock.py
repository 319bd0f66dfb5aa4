"""A lock on a folder, which is made for it and removed again if nothing came into it."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from auvident.errors import InputError, InUseError

try:
    import fcntl
except ImportError:  # not on Windows: no lock there
    fcntl = None  # type: ignore[assignment]

ATTEMPTS = 100  # to lock a folder that others make and remove at the same time
HELD = (errno.EWOULDBLOCK, errno.EACCES)  # by another process


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes out of a folder; the system releases it when the process dies.

    The folder is made where it is missing. Folders that were made here and are still empty at
    the end are removed while the lock is held, so that none is taken from another process.

    Raises
    ------
    InUseError
        Another process has it.
    InputError
        It cannot be made or opened.
    """
    made, descriptor = _made_and_locked(folder)
    try:
        yield
    finally:
        with suppress(OSError):  # not empty
            for place in made:
                place.rmdir()
        _close(descriptor)


def _made_and_locked(folder: Path) -> tuple[list[Path], int | None]:
    """Folders that had to be made, the innermost first, and the descriptor with the lock."""
    for _ in range(ATTEMPTS):
        descriptor = None
        try:
            made = _make(folder)
            descriptor = os.open(folder, os.O_RDONLY) if fcntl else None
            _take(descriptor, folder)
            if descriptor is None or os.path.samestat(os.fstat(descriptor), folder.stat()):
                return made, descriptor
            _close(descriptor)  # removed and made anew by another process
        except (FileNotFoundError, FileExistsError):  # another process made it, and removes it
            _close(descriptor)
        except InUseError:
            _close(descriptor)
            raise
        except OSError as error:
            _close(descriptor)
            raise _cannot_be_made(folder, error.strerror) from None
    raise _cannot_be_made(
        folder, "a dangling link, or another process keeps creating and removing it"
    )


def _make(folder: Path) -> list[Path]:
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _take(descriptor: int | None, folder: Path) -> None:
    if descriptor is None:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in HELD:
            raise _in_use(folder) from None
        # a file system without locks: nothing to be done about it


def _cannot_be_made(folder: Path, why: str | None) -> InputError:
    return InputError(f"cannot be created: {why}", str(folder), "Choose another folder.")


def _in_use(folder: Path) -> InUseError:
    return InUseError(
        "another auvident process is working in this run directory",
        str(folder),
        "Wait for it to end, or use another run directory.",
    )


def _close(descriptor: int | None) -> None:
    if descriptor is not None:
        os.close(descriptor)
