"""Figures handed over as they are, for those who want matplotlib and no page."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TAKEN: "ContextVar[list[Figure] | None]" = ContextVar("figures that are taken", default=None)


@contextmanager
def taken() -> "Iterator[list[Figure]]":
    """Figures that are drawn inside are handed over as they are, and not written."""
    found: list[Figure] = []
    token = _TAKEN.set(found)
    try:
        yield found
    finally:
        _TAKEN.reset(token)


def are_taken() -> bool:
    """Whether somebody takes figures as they are."""
    return _TAKEN.get() is not None


def is_taken(figure: "Figure") -> bool:
    """Whether somebody takes the figure as it is, so that it need not be written."""
    found = _TAKEN.get()
    if found is not None:
        found.append(figure)
    return found is not None
