"""What the numbers of a run depend on beside its inputs: recorded, and told."""

import json
import platform
from collections.abc import Callable
from pathlib import Path

import numpy as np

from auvident import __version__, versions
from tests.command_line import Called

Auvident = Callable[..., Called]


def test_the_version_is_one_line(auvident: Auvident) -> None:
    assert auvident("--version").out == f"auvident, version {__version__}\n"


def test_all_versions_are_told_in_either_order(auvident: Auvident) -> None:
    told = auvident("--version", "--verbose")
    assert told.code == 0
    assert told.out == auvident("--verbose", "--version").out
    names = [line.split()[0] for line in told.out.splitlines()]
    expected = "auvident Python numpy scipy numba filterpy pandas pyarrow pydantic"
    assert names == f"{expected} matplotlib jinja2 rich click compiled".split()
    assert f"numpy {np.__version__}" in told.out.splitlines()
    assert auvident("--verbose", "effects").code == 2


def test_a_run_records_them_and_status_tells_what_changed(demo: Path, auvident: Auvident) -> None:
    file = demo / "run.json"
    manifest = json.loads(file.read_text())
    for stage in manifest["stages"].values():
        assert stage["libraries"] == versions.libraries()
        assert stage["libraries"]["python"] == platform.python_version()
    assert "are those that the stages were run with" in auvident("status", demo, "--verbose").err
    manifest["stages"]["identify"]["libraries"]["numba"] = "0.1"
    del manifest["stages"]["ase"]["libraries"]
    file.write_text(json.dumps(manifest))
    told = auvident("status", demo, "--verbose", "--json")
    assert f"numba was 0.1, is {versions.libraries()['numba']}: identify" in told.err
    assert "libraries not recorded: ase" in told.err
    rows = {row["stage"]: row for row in json.loads(told.out)["stages"]}
    assert rows["identify"]["state"] == "done"
    assert list(rows["identify"]["libraries_changed"]) == ["numba"]
    assert "numba" not in auvident("status", demo).err


def test_a_library_that_is_gone_has_changed() -> None:
    assert versions.changed({"no-such-thing": "1.0"}) == {"no-such-thing": ("1.0", "none")}
