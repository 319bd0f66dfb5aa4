"""What a run tells whoever asked for it in a notebook: a line a stage."""

import sys
from collections.abc import Mapping
from typing import Any, TextIO

from auvident.pipeline.observer import Observer
from auvident.schema.quoting import printable


class Lines(Observer):
    """Writes a line for each decision, note and stage; only where it was asked for.

    Parameters
    ----------
    stream : text stream, optional
        By default standard error, as it is when a line is written.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self.stream = stream

    def decided(self, stage: str, sentence: str) -> None:
        """A stage is up to date or runs."""
        self._line(sentence)

    def finished(self, stage: str, outputs: Mapping[str, Any], seconds: float) -> None:
        """A stage is done."""
        self._line(f"{stage}: done in {seconds:.1f} s")

    def note(self, text: str) -> None:
        """Something worth a line."""
        self._line(text)

    def refused(self, problem: str) -> None:
        """A log is set aside."""
        self._line(f"Warning: skipped: {problem}")

    def _line(self, text: str) -> None:
        stream = self.stream or sys.stderr
        stream.write(f"{printable(text)}\n")
        stream.flush()
