"""What a command reads, and what a run is made of, is not written over by a result."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import SAMPLES, Called

RUN, LOG, VEHICLE = "runs/demo", "trial", "v.toml"
COMMANDS = [
    (("simulate", RUN, "--inputs", LOG, "--output"), "trial/dvl.csv"),
    (("simulate", RUN, "--inputs", "trial/../trial", "--output"), "trial/dvl.csv"),
    (
        ("simulate", VEHICLE, "--maneuver", "zigzag", "--output"),
        "runs/demo/ingest/harbour_trial.parquet",
    ),
    (("export", RUN, "--output"), "runs/demo/identify/model.json"),
    (("export", "flown.json", "--output"), "flown.json"),
    (("export", VEHICLE, "--format", "gz", "--output"), VEHICLE),
    (("combine", RUN, "--output"), "runs/demo/run.json"),
    (("combine", "--vehicle", VEHICLE, RUN, "--output"), VEHICLE),
    (("pool", RUN, "--changes"), "runs/demo/ase/coefficients.json"),
    (("validate", RUN, "--junit"), "runs/demo/run.json"),
    (("validate", RUN, "--summary"), "runs/demo/validate/metrics.json"),
]


@pytest.fixture
def here(demo: Path) -> Path:
    """The run with a log, a vehicle file and a model beside it."""
    shutil.copytree(SAMPLES / "harbour_trial", LOG)
    shutil.copy(SAMPLES / "remus100.toml", VEHICLE)
    shutil.copy(demo / "identify/model.json", "flown.json")
    return demo


@pytest.mark.parametrize(("command", "file"), COMMANDS)
@pytest.mark.usefixtures("here")
def test_it_is_refused_before_any_work(
    command: tuple[str, ...], file: str, auvident: Callable[..., Called]
) -> None:
    before = Path(file).read_bytes()
    called = auvident(*command, file)
    assert called.code == 2, called.err
    assert called.err.startswith(f"Error: {file}: ")
    assert "Give the name of another file" in called.err
    assert Path(file).read_bytes() == before


@pytest.mark.parametrize("command", ["ingest", "run"])
def test_a_run_is_not_made_in_the_folder_of_its_log(
    command: str, here: Path, auvident: Callable[..., Called]
) -> None:
    """The log was read once, and from then on refused as a run directory."""
    before = sorted(Path(LOG).iterdir())
    called = auvident(command, LOG, "--vehicle", VEHICLE, "--run", "trial/../trial")
    assert called.code == 2 and "is the folder of the log" in called.err
    assert sorted(Path(LOG).iterdir()) == before


def test_other_files_are_replaced(here: Path, auvident: Callable[..., Called]) -> None:
    """Also within a run directory: a model for use elsewhere, or a prediction."""
    for _ in range(2):
        for command in (
            ("export", RUN, "--output", here / "model.py"),
            (
                "simulate",
                VEHICLE,
                "--maneuver",
                "zigzag",
                "--samples",
                "0",
                "--output",
                "flown.csv",
            ),
            ("validate", RUN, "--quiet", "--junit", here / "told.xml", "--summary", "told.md"),
        ):
            called = auvident(*command)
            assert called.code == 0, called.err
