"""Ctrl-C that is not lost: where it falls into a library's own `except`, it is raised again later.

Libraries that try one import after another swallow whatever is raised meanwhile.
"""

import signal
import threading
from types import FrameType

_asked = threading.Event()


def listen() -> None:
    """From now on an interrupt is raised, as always, and remembered as well.

    A handler that somebody else has set stays.
    """
    _asked.clear()
    ours = signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _interrupt)
    if ours and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _asked.set()
    raise KeyboardInterrupt


def was_asked() -> bool:
    """Whether there was an interrupt, whatever a library made of it."""
    return _asked.is_set()


def raise_again() -> None:
    """Raise an interrupt that was asked for and is still not heeded.

    Raises
    ------
    KeyboardInterrupt
    """
    if was_asked():
        raise KeyboardInterrupt


def heeded() -> None:
    """Let the program leave with its exit code.

    CPython notes an interrupt that falls into an `exec`, as libraries use while they are imported,
    and after all is done ends by the signal in place of the exit code; the next `exec` clears that.
    """
    exec("")
