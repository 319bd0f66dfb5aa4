import io
from pathlib import Path

import pytest
from rich.console import Console

from auvident.report.ase_tables import ase_report, coefficient_tables, side_by_side
from auvident.schema.coefficients import COEFFICIENTS
from auvident.stages.ase import estimate
from auvident.storage.vehicle_file import load_vehicle

VEHICLES = Path(__file__).parents[1] / "data" / "vehicles"


def text_of(renderable, width=160):
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(renderable)
    return console.export_text()


@pytest.fixture(scope="module")
def results():
    return [estimate(load_vehicle(VEHICLES / f"{n}.toml")) for n in ("remus", "suboff", "kvlcc2")]


def test_report_shows_every_coefficient_with_its_parts(results):
    text = text_of(ase_report(results[1]))
    for c in COEFFICIENTS:
        assert c.symbol in text
    for word in ("hull", "sail", "rudder", "elevator", "G horizontal", "turning"):
        assert word in text
    row = next(line for line in text.splitlines() if line.strip().startswith("Y_uud "))
    assert f"{results[1].by_symbol()['Y_uud'].value:.4g}" in row


def test_findings_and_given_values_are_told(results):
    assert "wake of the hull" in text_of(ase_report(results[0]), width=400)
    text = text_of(ase_report(results[2]), width=400)
    assert "not a body of revolution" in text
    assert "(given)" in text


def test_figures_stand_with_what_is_not_known_of_them(results):
    text = " ".join(text_of(ase_report(results[0])).split())
    spread = results[0].facts["spread"]
    chance = spread["horizontal"]["unstable_probability"]
    assert f"probability of being directionally unstable {chance:.2f}" in text
    for words in ("G horizontal (> 0 stable)", "tactical diameter at 15° rudder, m"):
        assert "±" in text.split(words)[1][:20], words
    assert f"speed at {spread['speed']['rpm']:.0f} rpm, m/s 1.54 ±" in text


def test_parts_that_a_vehicle_lacks_have_no_column(results):
    tables = [list(coefficient_tables(r)) for r in results[:2]]
    names = [[{column.head for column in t.columns} for t in vehicle] for vehicle in tables]
    assert [["sail" in head for head in vehicle] for vehicle in names] == [
        [False, False, False],
        [True, True, False],  # drag, horizontal plane; a sail does nothing in the vertical one
    ]
    assert "elevator" in names[0][2] and "rudder" not in names[0][2]


@pytest.mark.parametrize("width", [80, 120])
def test_each_plane_and_roll_stand_in_a_terminal(results, width):
    """Nothing is cut, and each plane has its parts beside the value."""
    lines = text_of(ase_report(results[1]), width).splitlines()
    assert all(len(line) <= width for line in lines)
    for title in ("both planes", "horizontal plane", "vertical plane", "roll"):
        assert any(f"DARPA SUBOFF: {title} at" in line for line in lines), title
    row = next(line for line in lines if line.strip().startswith("Z_uud "))
    value = results[1].by_symbol()["Z_uud"]
    assert f"{value.parts['elevator']:.4g}" in row
    for symbol in ("Y_uv", "Z_uw", "M_uq"):
        assert sum(line.strip().startswith(f"{symbol} ") for line in lines) == 1, symbol


def test_roll_is_told_with_its_parts(results):
    text = text_of(ase_report(results[1]))
    for term in results[1].roll:
        row = next(line for line in text.splitlines() if line.strip().startswith(f"{term.symbol} "))
        assert term.unit in row and "±" in row
    assert {term.symbol for term in results[2].roll} == {"I_xx"}  # no body of revolution


def test_side_by_side_shows_the_change(results):
    text = text_of(side_by_side(results[:2]))
    first, second = (r.by_symbol()["Y_uv"].value for r in results[:2])
    assert f"{100 * (second / first - 1):+.1f} %" in text
    assert "REMUS" in text
    assert "DARPA SUBOFF" in text
