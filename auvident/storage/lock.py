"""A lock on a folder, which is made for it and removed again if nothing came into it.

The lock is one of the system on a file in the folder, so that it dies with its process, holds on
network file systems as well, and needs no cleaning up. What the file says, who holds it, is for
people, and decides only where the file system knows no locks.
"""

import errno
import json
import os
import shlex
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from auvident.errors import InputError, InUseError, UsageError

LOCK_FILE = ".auvident-lock"
ATTEMPTS = 100  # to lock a folder that others make and remove at the same time
HELD = (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK)  # by another process
FAR = 1 << 30  # of Windows, where a locked byte cannot be read: one behind the text
MOST_BYTES = 4096  # of the text about the holder
COMMAND_LENGTH = 300


@dataclass(frozen=True)
class Holder:
    """The process that holds a lock, as it says of itself."""

    pid: int
    host: str
    command: str
    since: str

    @property
    def words(self) -> str:
        """For a message."""
        return f"process {self.pid} on {self.host}, since {self.since}: {self.command}"

    @property
    def may_be_alive(self) -> bool:
        """Whether it may still be at work; of another machine that cannot be known."""
        if self.host != socket.gethostname():
            return True
        if self.pid == os.getpid() or os.name == "nt":
            return False
        try:
            os.kill(self.pid, 0)
        except (OSError, OverflowError) as error:
            return isinstance(error, PermissionError)
        return True


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
        with suppress(OSError):  # Windows removes no open file; the next one takes it over
            (folder / LOCK_FILE).unlink()
        with suppress(OSError):  # not empty
            for place in made:
                place.rmdir()
        os.close(descriptor)


def worker(folder: Path) -> Holder | None:
    """Who works in a folder, by what the file says; nothing is locked to find out."""
    file = folder / LOCK_FILE
    if not file.is_file() or file.is_symlink():
        return None
    try:
        holder = _told(file.read_bytes()[:MOST_BYTES])
    except OSError:
        return None
    return holder if holder is not None and holder.may_be_alive else None


def _made_and_locked(folder: Path) -> tuple[list[Path], int]:
    """Folders that had to be made, the innermost first, and the descriptor with the lock."""
    file = folder / LOCK_FILE
    if folder.is_file():
        raise UsageError("is a file, not a folder", str(folder), "Choose another folder.")
    for _ in range(ATTEMPTS):
        descriptor = None
        try:
            made = _make(folder)
            descriptor = _open(file)
            _take(descriptor, folder)
            if os.path.samestat(os.fstat(descriptor), file.lstat()):
                _sign(descriptor)
                return made, descriptor
            os.close(descriptor)  # removed, and perhaps made anew, by another process
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


def _open(file: Path) -> int:
    """The lock file, for writing: network file systems lock no other; never through a link."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    descriptor = os.open(file, flags, 0o644)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, f"{file.name} is not a file")
    return descriptor


def _take(descriptor: int, folder: Path) -> None:
    try:
        _lock(descriptor)
    except OSError as error:
        holder = _holder(descriptor)
        if error.errno in HELD:
            raise in_use(folder, holder) from None
        if holder is not None and holder.may_be_alive:  # no locks here: what the file says
            raise in_use(
                folder, holder, f"If that has ended, remove {folder / LOCK_FILE}."
            ) from None


def _lock(descriptor: int) -> None:
    """An exclusive lock, or `OSError` at once."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(descriptor, FAR, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _sign(descriptor: int) -> None:
    """Say who holds the lock; a full disk is no reason to go without it."""
    since = datetime.now(UTC).isoformat(timespec="seconds")
    command = shlex.join(sys.argv)[:COMMAND_LENGTH]
    holder = Holder(os.getpid(), socket.gethostname(), command, since)
    with suppress(OSError):
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, json.dumps(asdict(holder)).encode())


def _holder(descriptor: int) -> Holder | None:
    """Who holds it, unless that is not yet written."""
    try:
        os.lseek(descriptor, 0, os.SEEK_SET)
        return _told(os.read(descriptor, MOST_BYTES))
    except OSError:
        return None


def _told(text: bytes) -> Holder | None:
    try:
        told = json.loads(text)
        return Holder(int(told["pid"]), *(str(told[k]) for k in ("host", "command", "since")))
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def _cannot_be_made(folder: Path, why: str | None) -> InputError:
    what = "written to" if os.path.isdir(folder) else "created"
    return InputError(f"cannot be {what}: {why}", str(folder), "Choose another folder.")


def in_use(folder: Path, holder: Holder | None, also: str = "") -> InUseError:
    """The error of a folder in which another process works."""
    who = f" ({holder.words})" if holder else ""
    return InUseError(
        f"another auvident process is working in this run directory{who}",
        str(folder),
        f"Wait for it to end, or use another run directory. {also}".rstrip(),
    )


def _close(descriptor: int | None) -> None:
    if descriptor is not None:
        with suppress(OSError):
            os.close(descriptor)
