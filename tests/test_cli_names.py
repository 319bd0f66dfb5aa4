"""Names of vehicles, trials and run directories are text wherever the program writes them."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import ENVIRONMENT, SAMPLES, Called

NASTY = ("[/dev]", "[bold]deep[/bold]", ":warning:")


@pytest.mark.parametrize("name", NASTY)
def test_a_name_that_looks_like_markup_is_shown(
    tmp_path: Path, auvident: Callable[..., Called], name: str
) -> None:
    """In the tables, in the decisions, in an error; the folders have such names, too."""
    folder = name.replace("/", "\u2215")  # a folder has no slash in its name
    folder = f"{folder}[red]"
    log = shutil.copytree(SAMPLES / "harbour_trial", tmp_path / folder)
    vehicle, run = tmp_path / "v.toml", tmp_path / f"run{folder}"
    text = (SAMPLES / "remus100.toml").read_text()
    vehicle.write_text(text.replace('"REMUS 100"', f'"{name}"'))
    called = auvident("ase", "--vehicle", vehicle)
    assert called.code == 0, called.err
    assert f"{name}: both planes" in called.err
    called = auvident("ingest", log, "--vehicle", vehicle, "--run", run)
    assert called.code == 0, called.err
    assert f"{folder}: " in called.err
    called = auvident("segment", run)
    assert called.code == 0, called.err
    assert f"{folder}-straight-1" in called.err
    called = auvident("status", run)
    assert called.code == 0, called.err
    assert folder in called.err.replace("\n", "")
    called = auvident("segment", run, "--hold-out", name)
    assert called.code == 2
    assert name in called.err


def test_an_exported_program_runs_no_name(demo: Path, auvident: Callable[..., Called]) -> None:
    model = (demo / "refine" / "model.json").read_text()
    name = '\\"\\"\\"\\nopen(\'ran\', \'w\')\\n\\"\\"\\"'
    assert '"vehicle": "REMUS 100"' in model
    Path("odd.json").write_text(model.replace('"REMUS 100"', f'"{name}"'))
    assert auvident("export", "odd.json", "--output", "odd.py").code == 0
    subprocess.run([sys.executable, "odd.py"], check=True, env=ENVIRONMENT)
    assert not Path("ran").exists()
