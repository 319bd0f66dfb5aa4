"""Wrong input at the command line: one message with file and place, exit code 3, nothing touched.

The logs are copies of ``sample_logs/harbour_trial`` with one thing spoiled.
"""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.command_line import SAMPLES, Called

HEADER, FIRST = 0, 1  # lines of a sensor file


@dataclass
class World:
    """A log and a vehicle file to spoil."""

    folder: Path

    @property
    def log(self) -> Path:
        return self.folder / "harbour_trial"

    @property
    def vehicle(self) -> Path:
        return self.folder / "remus100.toml"

    def lines(self, sensor: str, change: Callable[[list[str]], list[str]]) -> None:
        """Replace the lines of a sensor's file."""
        path = self.log / f"{sensor}.csv"
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    def cells(self, sensor: str, column: str, change: Callable[[int, str], str]) -> None:
        """Replace the cells of a column, given their row in the file and their text."""

        def spoil(lines: list[str]) -> list[str]:
            index = lines[HEADER].split(",").index(column)
            changed = [lines[HEADER]]
            for row, line in enumerate(lines[FIRST:], start=2):
                cells = line.split(",")
                if len(cells) > index:
                    cells[index] = change(row, cells[index])
                changed.append(",".join(cells))
            return changed

        self.lines(sensor, spoil)

    def rename(self, sensor: str, old: str, new: str) -> None:
        """Rename a column."""
        self.lines(sensor, lambda lines: [lines[HEADER].replace(old, new), *lines[FIRST:]])

    def vehicle_text(self, old: str, new: str) -> None:
        """Replace a piece of the vehicle file."""
        text = self.vehicle.read_text()
        assert old in text
        self.vehicle.write_text(text.replace(old, new, 1))


@pytest.fixture
def world(tmp_path: Path) -> World:
    shutil.copytree(SAMPLES / "harbour_trial", tmp_path / "harbour_trial")
    shutil.copy(SAMPLES / "remus100.toml", tmp_path)
    return World(tmp_path)


def shift(seconds: float) -> Callable[[int, str], str]:
    return lambda row, text: str(float(text) + seconds)


def backward(row: int, text: str) -> str:
    """A clock that is set back by ten minutes in the middle of the trial."""
    return str(float(text) - 600.0) if row > 3000 else text


# Name of the fault -> how to spoil the world, and what the message must contain.
Fault = tuple[Callable[[World], object], tuple[str, ...]]
FAULTS: dict[str, Fault] = {
    "missing file": (
        lambda w: (w.log / "rudder.csv").unlink(),
        ("harbour_trial", "rudder_deg", "--map"),
    ),
    "missing log": (lambda w: shutil.rmtree(w.log), ("harbour_trial", "no such file")),
    "missing column": (lambda w: w.rename("dvl", "v_mps", "sway"), ("dvl.csv", "v_mps", "sway")),
    "no time": (lambda w: w.rename("rpm", "time_s", "x"), ("rpm.csv", "no time column")),
    "no unit": (
        lambda w: w.rename("rudder", "rudder_deg", "rudder"),
        ("rudder.csv", "rudder", "unit"),
    ),
    "text in a number column": (
        lambda w: w.cells("gyro", "r_degps", lambda row, x: "fast" if row == 77 else x),
        ("gyro.csv", "row 77", "r_degps", "'fast'"),
    ),
    "time going backward": (
        lambda w: w.cells("gyro", "time_s", backward),
        ("gyro.csv", "time_s", "row 3001"),
    ),
    "sensor that never overlaps": (
        lambda w: w.cells("dvl", "time_s", shift(1e5)),
        ("dvl.csv", "overlap", "gyro.csv"),
    ),
    "empty file": (lambda w: (w.log / "gyro.csv").write_text(""), ("gyro.csv", "empty")),
    "header only": (lambda w: w.lines("gyro", lambda lines: lines[:1]), ("gyro.csv",)),
    "NaN-only channel": (
        lambda w: w.cells("dvl", "v_mps", lambda row, x: "nan"),
        ("dvl.csv", "v_mps"),
    ),
    "binary file": (
        lambda w: (w.log / "dvl.csv").write_bytes(bytes(range(256)) * 40),
        ("dvl.csv",),
    ),
    "no vehicle file": (lambda w: w.vehicle.unlink(), ("remus100.toml", "no such file")),
    "no TOML": (
        lambda w: w.vehicle_text("[hull]", "[hull"),
        ("remus100.toml", "not valid TOML", "line"),
    ),
    "wrong TOML type": (
        lambda w: w.vehicle_text("mass_kg = 30.48", 'mass_kg = "heavy"'),
        ("remus100.toml", "mass_kg", "heavy"),
    ),
    "negative mass": (
        lambda w: w.vehicle_text("mass_kg = 30.48", "mass_kg = -1.0"),
        ("remus100.toml", "mass_kg", "-1"),
    ),
    "unknown key": (
        lambda w: w.vehicle_text("mass_kg", "colour = 3\nmass_kg"),
        ("remus100.toml", "colour", "unknown key"),
    ),
    "missing key": (
        lambda w: w.vehicle_text("izz_kgm2 = 3.45", ""),
        ("remus100.toml", "izz_kgm2", "missing"),
    ),
    "rudder sign against [signs]": (
        lambda w: w.vehicle_text(
            'rudder_positive_turns = "port"', 'rudder_positive_turns = "starboard"'
        ),
        ("rudder", "rudder_positive_turns"),
    ),
    "impossible geometry": (
        lambda w: w.vehicle_text("origin_from_nose_m = 0.611", "origin_from_nose_m = 6.11"),
        ("remus100.toml", "origin_from_nose_m", "6.11"),
    ),
}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def assert_refused(called: Called, words: tuple[str, ...], code: int = 3) -> None:
    """One message for people with all the words, and the exit code."""
    assert called.code == code, called.err
    assert called.out == ""
    assert len(re.findall(r"^Error: ", called.err, re.MULTILINE)) == 1, called.err
    assert "Traceback" not in called.err
    for word in words:
        assert word in called.err, f"{word!r} not in: {called.err}"


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_input_is_refused_and_creates_nothing(
    world: World, auvident: Callable[..., Called], fault: str
) -> None:
    spoil, words = FAULTS[fault]
    spoil(world)
    run = world.folder / "run"
    called = auvident("run", world.log, "--vehicle", world.vehicle, "--run", run)
    assert_refused(called, words)
    assert not run.exists()


@pytest.mark.parametrize("command", ["run", "ingest"])
@pytest.mark.parametrize("fault", ["missing column", "impossible geometry"])
def test_an_existing_run_stays_as_it_was(
    world: World, demo: Path, auvident: Callable[..., Called], fault: str, command: str
) -> None:
    FAULTS[fault][0](world)
    before = contents(demo)
    called = auvident(command, world.log, "--vehicle", world.vehicle, "--run", demo, "--json")
    assert_refused(called, FAULTS[fault][1])
    assert contents(demo) == before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[rudder]\nangle = 'x'\n", ("rudder", "angle", "unknown key")),
        ("[rudder]\nrudder = { column = 'delta', unit = 'deg' }\n", ("rudder.csv", "delta")),
        ("[rudder]\nrudder = { column = 'rudder_deg', unit = 'volt' }\n", ("rudder", "volt")),
    ],
)
def test_a_wrong_map(
    world: World, auvident: Callable[..., Called], text: str, words: tuple[str, ...]
) -> None:
    column_map = world.folder / "map.toml"
    column_map.write_text(text)
    run = world.folder / "run"
    called = auvident(
        "ingest", world.log, "--vehicle", world.vehicle, "--run", run, "--map", column_map
    )
    assert_refused(called, words)
    assert not run.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = 'p'\n", ("plan.toml", "stage", "missing")),
        (
            "name = 'p'\n[[stage]]\nname = 'a'\nsystem = 'surge'\nfree = ['Y_up']\n",
            ("plan.toml", "Y_up", "auvident coefficients"),
        ),
    ],
)
def test_a_wrong_plan_stops_a_run_before_it_begins(
    world: World, auvident: Callable[..., Called], text: str, words: tuple[str, ...]
) -> None:
    plan = world.folder / "plan.toml"
    plan.write_text(text)
    run = world.folder / "run"
    called = auvident("run", world.log, "--vehicle", world.vehicle, "--run", run, "--plan", plan)
    assert_refused(called, words)
    assert not run.exists()


def test_keep_going_leaves_out_the_wrong_log_and_says_so(
    world: World, auvident: Callable[..., Called]
) -> None:
    broken = world.folder / "broken_trial"
    shutil.copytree(world.log, broken)
    (broken / "gyro.csv").write_text("")
    run = world.folder / "run"
    arguments = (
        broken,
        world.log,
        world.folder / "absent",
        "--vehicle",
        world.vehicle,
        "--run",
        run,
    )
    assert_refused(auvident("ingest", *arguments), ("absent",))
    called = auvident("ingest", *arguments, "--keep-going")
    assert called.code == 3
    assert len(re.findall("^Warning: skipped: ", called.err, re.MULTILINE)) == 2
    assert [p.name for p in (run / "ingest").glob("*.parquet")] == ["harbour_trial.parquet"]
    quality = (run / "ingest" / "quality.json").read_text()
    assert quality.count("log_refused") == 2


def test_keep_going_with_nothing_left_is_an_error(
    world: World, auvident: Callable[..., Called]
) -> None:
    (world.log / "gyro.csv").write_text("")
    run = world.folder / "run"
    called = auvident("ingest", world.log, "--vehicle", world.vehicle, "--run", run, "--keep-going")
    assert called.code == 3
    assert not run.exists()
