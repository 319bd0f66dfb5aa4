"""Figures of the report, drawn once for all pages that show them: nearly all that a page takes."""

import hashlib
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import pytest

from auvident.report import (
    figures_coefficients,
    figures_evidence,
    figures_forces,
    figures_innovations,
    figures_loop,
    figures_prediction,
    figures_trial,
)
from auvident.report.taken import are_taken

FIGURES = {
    figures_coefficients: ("correlation_matrix", "history"),
    figures_evidence: ("evidence", "settling"),
    figures_forces: ("unknown_force",),
    figures_innovations: ("innovations",),
    figures_loop: ("before_after", "gains"),
    figures_prediction: ("prediction",),
    figures_trial: ("timeline", "track"),
}
drawn: dict[tuple[str, str], Any] = {}  # empty it to have everything drawn anew


def remembered(draw: Callable[..., Any]) -> Callable[..., Any]:
    """The figure of these very arguments, drawn if it has not been."""

    @wraps(draw)
    def figure(*arguments: Any, **named: Any) -> Any:
        if are_taken():
            return draw(*arguments, **named)
        of = pickle.dumps((arguments, sorted(named.items())))
        key = draw.__name__, hashlib.sha256(of).hexdigest()
        if key not in drawn:
            drawn[key] = draw(*arguments, **named)
        return drawn[key]

    return figure


@contextmanager
def each_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module, names in FIGURES.items():
            for name in names:
                patch.setattr(module, name, remembered(getattr(module, name)))
        yield
