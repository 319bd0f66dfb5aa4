"""The tutorial can be run from its first cell to its last, and has no outputs of another day."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import ROOT

FILE = ROOT / "docs" / "tutorial.ipynb"
NOTEBOOK = json.loads(FILE.read_text(encoding="utf-8"))
CELLS = ["".join(c["source"]) for c in NOTEBOOK["cells"] if c["cell_type"] == "code"]


def test_every_cell_runs(demo: Path) -> None:
    space: dict[str, Any] = {"__name__": "__main__"}
    for number, text in enumerate(CELLS):
        exec(compile(text, f"{FILE.name}, code cell {number}", "exec"), space)
    assert space["heading"] == pytest.approx(space["wanted"], abs=0.05)  # the controller gets there
    assert space["motion"]["r_radps"].iloc[-1] > 0.0  # a negative rudder turns to starboard
    larger = space["large"].coefficients["value"] / space["as_built"].coefficients["value"]
    assert larger["Y_uud"] > 1.3
    assert Path("runs/remus100_model.py").stat().st_size > 0


def test_it_is_a_notebook_without_outputs() -> None:
    assert (NOTEBOOK["nbformat"], NOTEBOOK["nbformat_minor"]) == (4, 5)
    assert len({c["id"] for c in NOTEBOOK["cells"]}) == len(NOTEBOOK["cells"])
    code = [c for c in NOTEBOOK["cells"] if c["cell_type"] == "code"]
    assert not [c for c in code if c["outputs"] or c["execution_count"]]
