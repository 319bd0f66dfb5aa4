"""Standard output and standard error, as long as somebody reads them."""

import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO


class Patient(io.FileIO):
    """A pipe whose reader may leave; what nobody reads any more goes nowhere."""

    def write(self, data: Any, /) -> int:
        """As of any file, but the last reader who leaves is no error."""
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return len(data)


def outlive_readers() -> None:
    """Let a command go on to its end, and to its exit code, when a reader leaves (``| head``).

    A gate is judged after its artifact was printed, and a run that was nearly done is worth more
    than the lines that tell of it.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started this (``>&-``): takes its place and number
            nowhere = io.BufferedWriter(io.FileIO(os.devnull, "w"))
            setattr(sys, name, io.TextIOWrapper(nowhere, encoding="utf-8"))
            continue
        with suppress(OSError, ValueError):  # closed here, or no file
            if not stream.isatty():
                setattr(sys, name, _patient(stream))


def _patient(stream: TextIO) -> TextIO:
    """The same stream, encoded and buffered as it was."""
    assert isinstance(stream, io.TextIOWrapper)
    stream.flush()
    raw = Patient(stream.fileno(), "wb", closefd=False)
    # unbuffered (python -u), the text writes straight to the file
    bare = isinstance(stream.buffer, io.RawIOBase)
    return io.TextIOWrapper(
        raw if bare else io.BufferedWriter(raw),  # type: ignore[arg-type]
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
