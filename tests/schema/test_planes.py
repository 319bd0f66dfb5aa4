"""The table of planes agrees with those of coefficients and channels."""

import pytest

from auvident.schema.channels import BY_COLUMN, BY_QUANTITY
from auvident.schema.coefficients import of_plane
from auvident.schema.planes import PLANE_ROWS, STATES, PlaneRow
from auvident.schema.vehicle import Signs


@pytest.mark.parametrize("row", PLANE_ROWS, ids=lambda row: row.name)
def test_the_coefficients_are_along_the_axes_of_the_plane(row: PlaneRow) -> None:
    assert {c.equation for c in of_plane(row.name)} == set(row.axes)


@pytest.mark.parametrize("row", PLANE_ROWS, ids=lambda row: row.name)
def test_the_added_masses_are_of_the_velocities_of_the_plane(row: PlaneRow) -> None:
    regressors = {c.regressor for c in of_plane(row.name) if c.symbol.endswith("dot")}
    assert regressors == {f"d{name}/dt" for name in row.velocities}


@pytest.mark.parametrize("row", PLANE_ROWS, ids=lambda row: row.name)
def test_its_columns_are_channels(row: PlaneRow) -> None:
    assert [BY_COLUMN[c].unit for c in row.columns] == ["m/s", "m/s", "rad/s", "rad"]
    assert all(BY_QUANTITY[s.symbol].column == s.column for s in row.states)
    assert all(BY_COLUMN[c].kind == "input" for c in row.control_columns)
    assert row.sign_key in Signs.model_fields


def test_a_state_of_both_planes_stands_once() -> None:
    assert [s.symbol for s in STATES] == ["u", "v", "w", "r", "q", "heading", "pitch"]
    assert [s.symbol for s in STATES if s.wraps] == ["heading"]
