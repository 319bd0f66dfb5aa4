"""What is drawn of a vehicle over its trials."""

import pytest

from auvident.report.figures_campaign import of_middle
from auvident.schema.changes import VehicleChange


@pytest.mark.parametrize("share", [True, False])
def test_the_line_of_a_drift_has_the_measure_of_its_points(share: bool) -> None:
    """Points are shares of the middle; the words say the same of the start: 1.2 to 0.8 of it."""
    size = -0.4 / 1.2 if share else -0.4
    drift = VehicleChange(
        kind="drift",
        what="fin",
        symbols=("Y_uud",),
        sentence="",
        trial="first",
        earliest="first",
        latest="last",
        size=size,
        std=0.1,
        low=size - 0.2,
        high=size + 0.2,
        unit="-",
        share=share,
        score=5.0,
        p=0.001,
    )
    assert of_middle(drift) == pytest.approx(-0.4)
