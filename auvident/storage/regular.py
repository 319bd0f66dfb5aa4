"""Files that a user names: only regular ones are opened, as devices and pipes never end."""

import stat
from collections.abc import Callable
from pathlib import Path

from auvident.errors import AuvidentError, InputError

KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
MEGABYTE = 1 << 20


def irregular(path: Path) -> str:
    """What stands at a path that is neither file nor folder nor nothing, in words; "" else."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # whoever opens it says what is wrong
        return ""
    return next((words for is_kind, words in KINDS if is_kind(mode)), "")


def refuse_irregular(path: Path) -> None:
    """Refuse to open what may block, or never end.

    Raises
    ------
    InputError
        It is a device, a pipe or a socket.
    """
    what = irregular(path)
    if what:
        raise InputError(f"is {what}, not a file", str(path), "Write its content to a file first.")


def read_small(path: Path, most_bytes: int, error: type[AuvidentError] = InputError) -> bytes:
    """Content of a file that is written by hand, or as short.

    Raises
    ------
    OSError
        It cannot be read.
    AuvidentError
        It is no regular file, or longer than `most_bytes`.
    """
    what = irregular(path)
    if what:
        raise error(f"is {what}, not a file", str(path), "Write its content to a file first.")
    with path.open("rb") as stream:
        content = stream.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise error(
            f"is larger than {most_bytes // MEGABYTE} MB",
            str(path),
            "Check the path: files of this kind are smaller.",
        )
    return content
