"""What a search does with candidates that lie in valleys of their own."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.select import search
from auvident.stages.diagnose.select.search import STUCK, Search

PLACES = {"a": [2], "b": [3], "c": [4]}  # behind two coefficients


@dataclass(frozen=True)
class Places:
    """As much of a case as is asked for."""

    def positions(self, effect: str) -> list[int]:
        return PLACES[effect]


def fitted(likelihood: float, *values: float, effects: tuple[str, ...] = ()) -> Fitted:
    return Fitted(
        np.array(values),
        np.arange(0),
        (),
        likelihood,
        effects=effects,
        residuals=(),
        rms=np.ones(3),
    )


BEFORE = fitted(0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
FOUND = {
    "a": fitted(700.0, 5.0, 6.0, 2.0, 0.0, 0.0, effects=("a",)),
    "b": fitted(400.0, 1.1, 1.2, 0.0, 3.0, 0.0, effects=("b",)),
    "c": fitted(30.0, 1.0, 1.1, 0.0, 0.0, 4.0, effects=("c",)),
}


def unstuck(monkeypatch: pytest.MonkeyPatch, polished: float) -> tuple[dict, list[Any]]:
    """Candidates as they leave, and where their fits began; each of them gains 50."""
    starts: list[Any] = []

    def again(case, effects, start, like) -> Fitted:
        starts.append((effects, start[0].tolist()))
        gained = FOUND[effects[-1]].log_likelihood + 50.0
        return fitted(gained, *start[0], effects=effects)

    monkeypatch.setattr(search, "refit", again)
    own = Search(Places(), ("a", "b", "c"), np.random.default_rng(0))  # type: ignore[arg-type]
    monkeypatch.setattr(own, "_polished", lambda *_: fitted(polished, 4.0, 5.0, 0.0, 0.0, 0.0))
    return own._unstuck(BEFORE, dict(FOUND))[1], starts


def test_a_rival_is_fitted_from_where_the_best_candidate_lies(monkeypatch) -> None:
    found, starts = unstuck(monkeypatch, polished=STUCK - 1.0)
    # the coefficients of the best, its own effect off, the size that the rival had
    assert starts == [(("b",), [5.0, 6.0, 0.0, 3.0, 0.0])]
    assert found["b"].log_likelihood == 450.0
    assert found["a"] is FOUND["a"] and found["c"] is FOUND["c"]


def test_beside_a_model_that_was_stuck_all_that_lead_are_fitted_again(monkeypatch) -> None:
    found, starts = unstuck(monkeypatch, polished=STUCK + 1.0)
    assert [effects for effects, _ in starts] == [("b",), ("c",)]
    assert found["c"].log_likelihood == 80.0


def test_a_worse_fit_is_not_taken(monkeypatch) -> None:
    monkeypatch.setitem(FOUND, "b", fitted(690.0, 1.1, 1.2, 0.0, 3.0, 0.0, effects=("b",)))

    def worse(case, effects, start, like) -> Fitted:
        return fitted(1.0, *start[0], effects=effects)

    own = Search(Places(), ("a", "b", "c"), np.random.default_rng(0))  # type: ignore[arg-type]
    monkeypatch.setattr(own, "_polished", lambda *_: BEFORE)
    monkeypatch.setattr(search, "refit", worse)
    assert own._unstuck(BEFORE, dict(FOUND))[1]["b"] is FOUND["b"]
