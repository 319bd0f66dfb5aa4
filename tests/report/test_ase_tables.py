import io
from pathlib import Path

import pytest
from rich.console import Console

from auvident.report.ase_tables import ase_report, side_by_side
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
    heads = [text_of(ase_report(r)).split("both planes")[0] for r in results[:2]]
    assert ["sail" in head for head in heads] == [False, True]


def test_side_by_side_shows_the_change(results):
    text = text_of(side_by_side(results[:2]))
    first, second = (r.by_symbol()["Y_uv"].value for r in results[:2])
    assert f"{100 * (second / first - 1):+.1f} %" in text
    assert "REMUS" in text
    assert "DARPA SUBOFF" in text
