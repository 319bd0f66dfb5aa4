"""The run directory: whole files or none, one writer, nothing lost when a process is killed."""

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from auvident.errors import NumericsError, StageError
from auvident.pipeline import run_all, status
from auvident.pipeline.given import Given
from auvident.pipeline.table import BY_NAME
from auvident.schema.manifest import Manifest, can_be_output
from auvident.storage import artifacts
from auvident.storage.artifacts import json_bytes, parquet_bytes, read_table, write_bytes
from auvident.storage.run_directory import RunDirectory
from tests import loop_world
from tests.bench.kills import contents, differing
from tests.command_line import ENVIRONMENT, PROGRAM, SAMPLES

KILLS_BYTE_FOR_BYTE = 5
KILLS_OF_THE_PROGRAM = 6  # of a real process at random moments: about a second each
FAST_STAGES = ("ingest", "segment", "ase")  # together 0.3 s; the kernels take longer
OPTIONS = [
    {
        "ingest": {
            "logs": [SAMPLES / "harbour_trial"],
            "vehicle": SAMPLES / "remus100.toml",
            "rate_hz": rate_hz,
        },
        "segment": {"hold_out": held},
    }
    for rate_hz, held in ((10.0, ()), (5.0, ("harbour_trial-turn-4",)))
]


known: dict[tuple[str, str, str], dict[str, Any]] = {}  # of all tests of this module


@pytest.fixture
def computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a stage computes from the same options and logs is computed once, and written often.

    Nothing waits for the disk: that is for power cuts, and no process here dies of one.
    """

    def remembered(name: str, function: Callable[[Given], dict[str, Any]]) -> Callable[..., Any]:
        def outputs(given: Given) -> dict[str, Any]:
            read = hashlib.sha256()
            for path in sorted((given.run.path / "ingest").glob("*")) if name != "ingest" else ():
                read.update(path.name.encode() + path.read_bytes())
            key = name, repr(sorted(given.options.items())), read.hexdigest()
            if key not in known:
                known[key] = function(given)
            return known[key]

        return outputs

    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    for name in FAST_STAGES:
        loop_world.replace_stage(monkeypatch, name, remembered(name, BY_NAME[name].function))


def child(work: Callable[[], object]) -> int:
    """Run something in a forked process; its wait status."""
    pid = os.fork()
    if pid == 0:
        try:
            work()
        finally:
            os._exit(0)
    return os.waitpid(pid, 0)[1]


def assert_whole(folder: Path) -> None:
    """Every artifact that is there can be read from its first to its last byte."""
    for path in folder.rglob("*"):
        if path.name.endswith(artifacts.TEMPORARY_SUFFIX):
            continue
        if path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".parquet":
            assert len(pd.read_parquet(path)) > 0


def assert_completes(folder: Path, options: dict) -> None:
    """The next run leaves everything done and no temporary file."""
    run_all(folder, options, until=FAST_STAGES[-1])
    states = {d.stage: d.state for d in status(folder)[0]}
    assert [states[s] for s in FAST_STAGES] == ["done"] * 3
    assert not [p for p in folder.rglob("*") if p.name.endswith(artifacts.TEMPORARY_SUFFIX)]


@pytest.mark.usefixtures("computed_once")
@pytest.mark.parametrize("when", ["before", "after"])
def test_killed_at_every_write(tmp_path: Path, when: str) -> None:
    """SIGKILL before or after the n-th file takes its name, for every n of a run."""
    finished, folder = tmp_path / "finished", tmp_path / "run"
    assert_completes(finished, OPTIONS[0])
    written = 0
    for step in range(1, 100):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(finished, folder)
        survived = child(lambda step=step: run_killed(folder, step, when)) == 0
        assert_whole(folder)
        if survived:
            break
        written = step
        assert_completes(folder, OPTIONS[1])
    assert written == 9  # three outputs of ingest, two of segment, one of ase, three manifests


@pytest.mark.usefixtures("computed_once")
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_first_run_killed_at_every_write(tmp_path: Path, when: str) -> None:
    """Its files are known for its own, though the first manifest of a stage comes after them."""
    folder = tmp_path / "run"
    for step in range(1, 100):
        shutil.rmtree(folder, ignore_errors=True)
        survived = child(lambda step=step: run_killed(folder, step, when)) == 0
        assert_whole(folder)
        assert_completes(folder, OPTIONS[step % 2])
        if survived:
            break
    assert step == 1 + 12  # six outputs, and for each of three stages the intent and the manifest


@pytest.mark.usefixtures("computed_once")
def test_what_a_killed_run_has_left_is_removed_when_it_is_no_output_any_more(
    tmp_path: Path,
) -> None:
    """Killed after its first output; then ingested from a log of another name."""
    folder, log = tmp_path / "run", tmp_path / "another_trial"
    child(lambda: run_killed(folder, 3, "before"))
    assert (folder / "ingest" / "harbour_trial.parquet").exists()
    shutil.copytree(SAMPLES / "harbour_trial", log)
    assert_completes(folder, OPTIONS[0] | {"ingest": OPTIONS[0]["ingest"] | {"logs": [log]}})
    assert [p.name for p in folder.glob("ingest/*.parquet")] == ["another_trial.parquet"]


def run_killed(folder: Path, step: int, when: str, options: dict = OPTIONS[1]) -> None:
    """A run that kills itself at one of its writes."""
    replace, count = os.replace, 0

    def fatal(*names: Path) -> None:
        nonlocal count
        count += 1
        if when == "after":
            replace(*names)
        if count == step:
            os.kill(os.getpid(), signal.SIGKILL)
        if when == "before":
            replace(*names)

    os.replace = fatal  # type: ignore[assignment]
    run_all(folder, options, until=FAST_STAGES[-1])


def test_the_program_killed_at_random_moments(tmp_path: Path) -> None:
    folder, rng = tmp_path / "run", random.Random(20)
    command = [
        str(PROGRAM),
        "run",
        str(SAMPLES / "harbour_trial"),
        "--vehicle",
        str(SAMPLES / "remus100.toml"),
        "--run",
        str(folder),
        "--quiet",
    ]
    killed = 0
    for number in range(KILLS_OF_THE_PROGRAM):
        process = subprocess.Popen([*command, "--rate", str(5 + number % 2)], env=ENVIRONMENT)
        try:
            process.wait(timeout=rng.uniform(0.4, 1.8))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            killed += 1
        process.wait()
        assert_whole(folder)
    assert killed > KILLS_OF_THE_PROGRAM / 2
    assert_completes(folder, OPTIONS[0])


def test_leftovers_of_a_killed_process_are_removed_and_other_files_are_not(tmp_path: Path) -> None:
    leftover = tmp_path / "ingest" / f".quality.json.123{artifacts.TEMPORARY_SUFFIX}"
    note = tmp_path / "notes.txt"
    write_bytes(leftover, b"half")
    write_bytes(note, b"mine")
    with RunDirectory(tmp_path).lock():
        assert not leftover.exists()
    assert note.read_bytes() == b"mine"


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "model.json"
    write_bytes(target, b"old")

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_bytes(target, b"new")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_outputs_a_stage_no_longer_has_are_removed(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path)
    run.commit({"ingest/a.parquet": b"1", "ingest/b.parquet": b"2"})
    run.commit({"ingest/b.parquet": b"3"}, obsolete=frozenset({"ingest/a.parquet"}))
    assert [p.name for p in (tmp_path / "ingest").iterdir()] == ["b.parquet"]


def test_the_manifest_comes_back_as_it_was_saved(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path)
    assert run.manifest() is None
    manifest = Manifest(program_version="1.2.3", created_at="2024-05-06T07:08:09+00:00")
    run.save(manifest)
    assert run.manifest() == manifest
    assert json.loads((tmp_path / "run.json").read_text())["schema"] == "auvident/run/1"


def test_a_damaged_manifest_is_named(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text('{"schema": ')
    with pytest.raises(StageError, match=r"run\.json"):
        RunDirectory(tmp_path).manifest()


DAMAGED = {
    "cut off": '{"schema": "auvident/run/1", "stages": {',
    "nested": "[" * 100_000,
    "a number that is none": '{"schema": "auvident/run/1", "stages": NaN}',
    "another type": '{"schema": "auvident/run/1", "program_version": "1", "stages": 3}',
    "no table": "[1]",
    "nothing": "",
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_manifest_says_how_to_rebuild(tmp_path: Path, name: str) -> None:
    (tmp_path / "run.json").write_text(DAMAGED[name])
    with pytest.raises(StageError, match=r"run\.json") as refused:
        RunDirectory(tmp_path).manifest()
    assert "makes everything again" in str(refused.value)
    assert len(str(refused.value)) < 1000


@pytest.mark.parametrize("schema", ["auvident/run/2", "auvident/run/99999999999999999999"])
def test_a_manifest_of_a_later_version_is_named_as_such(tmp_path: Path, schema: str) -> None:
    tree = {"schema": schema, "program_version": "9", "created_at": "then"}
    (tmp_path / "run.json").write_text(json.dumps(tree))
    with pytest.raises(StageError, match="later version") as refused:
        RunDirectory(tmp_path).manifest()
    assert "Update auvident" in str(refused.value)


def test_a_name_that_is_no_utf_8_stays_in_a_manifest(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path)
    manifest = Manifest(program_version="1", created_at="a\udcff")
    run.save(manifest)
    assert (tmp_path / "run.json").read_text()
    assert run.manifest() == manifest


@pytest.mark.parametrize("name", ["n" * 201, "\udcff"])
def test_a_name_that_no_file_can_have_everywhere_is_no_artifact(name: str) -> None:
    assert not can_be_output("ingest", f"ingest/{name}")


@pytest.mark.usefixtures("computed_once")
def test_killed_at_random_moments_the_next_run_ends_as_undisturbed(tmp_path: Path) -> None:
    """Byte for byte, apart from times; `tests.bench.kills` does it for whole runs."""
    first = run_all(tmp_path / "run", OPTIONS[0], until=FAST_STAGES[-1])
    undisturbed, rng = contents(tmp_path / "run"), random.Random(7)
    assert len(first.outputs) == 6
    for _ in range(KILLS_BYTE_FOR_BYTE):
        shutil.rmtree(tmp_path / "run")
        step, when = rng.randint(1, 12), rng.choice(("before", "after"))
        child(lambda step=step, when=when: run_killed(tmp_path / "run", step, when, OPTIONS[0]))
        assert_completes(tmp_path / "run", OPTIONS[0])
        assert differing(tmp_path / "run", undisturbed) == ()


def test_paths_are_remembered_relative_so_that_a_project_can_move(tmp_path: Path) -> None:
    log = tmp_path / "logs" / "a.csv"
    write_bytes(log, b"")
    run = RunDirectory(tmp_path / "runs" / "one")
    assert run.remembered(log) == "../../logs/a.csv"
    assert run.located("../../logs/a.csv").resolve() == log.resolve()
    plan = Path(artifacts.__file__).parents[1] / "plans" / "spiral.toml"
    assert run.remembered(plan) == "package:plans/spiral.toml"
    assert run.located("package:plans/spiral.toml") == plan


def test_a_number_that_is_not_finite_is_refused_with_its_place() -> None:
    with pytest.raises(NumericsError, match=r"model\.json: a\[1\]\.b is nan"):
        json_bytes({"a": [{"b": 1.0}, {"b": float("nan")}]}, "model.json")


def test_units_stand_in_the_parquet_metadata(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    table = pd.DataFrame(
        {"time_s": [0.0], "r_radps": [0.1], "Y_uv": [1.0], "Y_uv_std": [0.1], "dvl_sampled": [True]}
    )
    path = tmp_path / "t.parquet"
    write_bytes(path, parquet_bytes(table, {"trial": "t"}))
    schema = pq.read_schema(path)
    units = [schema.field(name).metadata[b"unit"].decode() for name in schema.names]
    assert units == ["s", "rad/s", "kg/m", "kg/m", "bool"]
    assert json.loads(schema.metadata[b"units"])["r_radps"] == "rad/s"
    pd.testing.assert_frame_equal(read_table(path), table)


def test_whether_a_folder_is_one_is_asked_once(tmp_path: Path, monkeypatch) -> None:
    """Another process may make or remove it in between: that made it a file for a moment."""
    place, real, asked = tmp_path / "run", Path.stat, []

    def removed_after(self, **how):
        found = real(self, **how)
        if self == place:
            asked.append(self)
            self.rmdir()
        return found

    place.mkdir()
    monkeypatch.setattr(Path, "stat", removed_after)
    RunDirectory(place)
    assert len(asked) == 1
