"""What the pipeline tells whoever watches it; the console is one that does."""

from collections.abc import Mapping
from typing import Any


class Observer:
    """Told what happens; this one keeps silent."""

    def decided(self, stage: str, sentence: str) -> None:
        """A stage is up to date or runs, with the reason in one sentence."""

    def started(self, stage: str) -> None:
        """A stage begins."""

    def progress(self, text: str, fraction: float | None = None) -> None:
        """A stage got so far, 0 to 1; None where the end is unknown.

        A fraction that is smaller than the one before begins something new, as the text says.
        """

    def finished(self, stage: str, outputs: Mapping[str, Any], seconds: float) -> None:
        """A stage has written its outputs, given by path in the run directory."""

    def note(self, text: str) -> None:
        """Something worth a line."""

    def refused(self, problem: str) -> None:
        """One of several logs is left out."""
