"""Standard maneuvers that are flown beside, before anyone asks for them."""

from dataclasses import replace
from pathlib import Path

import pytest

from auvident.pipeline.flights import Flights
from auvident.pipeline.given import Given
from auvident.pipeline.helper import Helper
from auvident.schema.desk import StandardManeuvers
from auvident.stages.desk import greatest_laid_deg
from auvident.stages.validate import Validation
from auvident.storage.artifacts import read_model
from auvident.storage.run_directory import RunDirectory


class Beside(Helper):
    """A helper that keeps count of what it is asked to fly, and flies it here."""

    asked: list[float]

    @property
    def is_beside(self) -> bool:
        return True

    def begin(self, work, *arguments, observer=None):  # type: ignore[no-untyped-def, override]
        self.asked.append(arguments[2])
        return super().begin(work, *arguments, observer=observer)


@pytest.fixture
def given(completed: Path) -> Given:
    """A run with a helper."""
    run, helper = RunDirectory(completed / "runs/demo"), Beside()
    helper.asked = []
    return Given(run, run.manifest(), helper=helper)


def _prediction(given: Given) -> Validation:
    return Validation(given.metrics, given.table("validate/simulation.parquet"))


def test_a_model_that_is_flown_beside_is_not_flown_again(given: Given) -> None:
    found = _prediction(given)
    laid_deg = greatest_laid_deg(found.simulation)
    flights = Flights(given, laid_deg)
    other = given.model.model_copy()
    flights.begin(other)
    flights.begin(given.model)
    kept = read_model(given.run / "validate/standard.json", StandardManeuvers, "")
    assert flights.of(given.model, found) == kept
    assert given.helper.asked == [laid_deg, laid_deg]  # type: ignore[attr-defined]


def test_it_is_flown_again_where_the_fin_was_laid_to_another_angle(given: Given) -> None:
    found = _prediction(given)
    laid_deg = greatest_laid_deg(found.simulation)
    flights = Flights(given, 0.5 * laid_deg)
    flights.begin(given.model)
    assert flights.of(given.model, found).greatest_laid_deg == laid_deg
    assert given.helper.asked == [0.5 * laid_deg, laid_deg]  # type: ignore[attr-defined]


def test_nothing_is_flown_ahead_where_no_other_process_has_the_time(given: Given) -> None:
    alone = replace(given, helper=Helper())
    flights, found = Flights(alone, 20.0), _prediction(given)
    flights.begin(given.model)
    assert flights.of(given.model, found) == Flights(alone).of(given.model, found)
