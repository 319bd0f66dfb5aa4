"""Nothing that the program has not written is deleted, overwritten or read as its own."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from auvident.errors import InputError, StageError, UsageError
from auvident.pipeline import STAGES, run_all, run_stage, status
from auvident.storage import artifacts
from auvident.storage.artifacts import write_bytes
from auvident.storage.run_directory import RunDirectory
from tests.command_line import SAMPLES, Called
from tests.storage.test_run_directory import FAST_STAGES, OPTIONS

INGEST = (
    "ingest",
    SAMPLES / "harbour_trial",
    "--vehicle",
    SAMPLES / "remus100.toml",
    "--quiet",
    "--run",
)
MINE = "mine, not the program's"


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the first stages; not to be written to."""
    folder = tmp_path_factory.mktemp("begun") / "run"
    run_all(folder, OPTIONS[0], until=FAST_STAGES[-1])
    return folder


@pytest.fixture
def run(begun: Path, tmp_path: Path) -> Path:
    """A copy of the run to work on."""
    return Path(shutil.copytree(begun, tmp_path / "run"))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def change_manifest(run: Path, change: Callable[[dict], None]) -> None:
    tree = json.loads((run / "run.json").read_text())
    change(tree)
    (run / "run.json").write_text(json.dumps(tree))


ELSEWHERE = [
    "../victim.txt",
    "{outside}/victim.txt",
    "ase/../../victim.txt",
    "./ase/x.json",
    "ase//x.json",
    "ase/..",
    "ase/.",
    "ase/",
    "ase",
    "",
    "segment/maneuvers.json",
    "ase/deep/x.json",
    "run.json",
    "..\\victim.txt",
    "ase/..\\..\\victim.txt",
    "C:/victim.txt",
    "C:\\victim.txt",
    "ase/\0",
]


@pytest.mark.parametrize("key", ["outputs", "writing"])
@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_manifest_that_claims_a_file_elsewhere_is_refused(
    run: Path, auvident: Callable[..., Called], name: str, key: str
) -> None:
    victim = run.parent / "victim.txt"
    victim.write_text(MINE)
    name = name.format(outside=run.parent)

    def claim(tree: dict) -> None:
        if key == "outputs":
            tree["stages"]["ase"]["outputs"][name] = "0" * 64
        else:
            tree["writing"] = {"ase": [name]}

    change_manifest(run, claim)
    before = contents(run.parent)
    called = auvident("ase", run)
    assert called.code == 4, called.err
    assert "run.json" in called.err
    assert repr(name) in called.err
    assert "another run directory" in called.err
    assert auvident("status", run).code == 4
    assert contents(run.parent) == before


def test_a_stage_that_is_no_folder_name_claims_nothing(run: Path) -> None:
    def claim(tree: dict) -> None:
        tree["stages"][".."] = tree["stages"]["ase"] | {"outputs": {"../victim.txt": "0" * 64}}

    change_manifest(run, claim)
    with pytest.raises(StageError, match=r"\.\./victim\.txt"):
        RunDirectory(run).manifest()


@pytest.mark.parametrize("key", ["schema", "program"])
def test_a_manifest_of_something_else_is_refused_and_stays(run: Path, key: str) -> None:
    change_manifest(run, lambda tree: tree.update({key: "another/run/7"}))
    before = contents(run)
    with pytest.raises(StageError, match="another/run/7"):
        run_all(run, OPTIONS[1], until=FAST_STAGES[-1])
    assert contents(run) == before


@pytest.mark.parametrize("linked", ["ase", "ase/coefficients.json", "run.json"])
def test_nothing_is_written_through_a_link(
    run: Path, auvident: Callable[..., Called], linked: str
) -> None:
    outside = run.parent / "outside"
    shutil.move(run / linked, outside)
    (run / linked).symlink_to(outside)
    before = contents(run.parent)
    called = auvident("ase", run)
    assert called.code == 2, called.err
    assert str(run / linked) in called.err
    assert "symbolic link" in called.err
    assert "Remove" in called.err
    assert contents(run.parent) == before
    assert (run / linked).is_symlink()


def test_nothing_is_deleted_through_a_link(run: Path) -> None:
    outside = run.parent / "outside"
    write_bytes(outside / "old.json", b"mine")
    (run / "refine").symlink_to(outside)
    with pytest.raises(UsageError, match="symbolic link"):
        RunDirectory(run).commit({}, obsolete=frozenset({"refine/old.json"}))
    partial = outside / f".x.json.1{artifacts.TEMPORARY_SUFFIX}"
    partial.write_text(MINE)
    folder = run / "ase" / f".folder{artifacts.TEMPORARY_SUFFIX}"
    folder.mkdir()
    with RunDirectory(run).lock():
        pass
    assert partial.read_text() == MINE
    assert (outside / "old.json").exists()
    assert folder.is_dir()


def test_a_prediction_is_not_written_through_a_link(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    outside = Path("outside")
    outside.mkdir()
    (demo / "simulate").symlink_to(outside.resolve())
    called = auvident(
        "simulate", demo, "--inputs", "sample_logs/harbour_trial", "--from", "1373", "--to", "1380"
    )
    assert called.code == 2, called.err
    assert "symbolic link" in called.err
    assert not list(outside.iterdir())


def test_a_link_under_the_temporary_name_is_not_written_through(tmp_path: Path) -> None:
    victim, target = tmp_path / "victim.txt", tmp_path / "model.json"
    victim.write_text(MINE)
    name = f".{target.name}.{os.getpid()}{artifacts.TEMPORARY_SUFFIX}"
    (tmp_path / name).symlink_to(victim)
    write_bytes(target, b"new")
    assert victim.read_text() == MINE
    assert target.read_bytes() == b"new"


def test_no_artifact_is_read_through_a_link(run: Path) -> None:
    outside = run.parent / "outside"
    shutil.move(run / "ase", outside)
    (run / "ase").symlink_to(outside)
    assert RunDirectory(run).sha256("ase/coefficients.json") is None
    decision = next(d for d in status(run)[0] if d.stage == "ase")
    assert decision.reason == "ase/coefficients.json is reached through a symbolic link"


@pytest.mark.parametrize("name", ["ingest/quality.json", "ingest/harbour_trial.parquet", "ingest"])
@pytest.mark.parametrize("command", ["ingest", "run"])
def test_a_foreign_file_is_not_overwritten_by_a_first_run(
    tmp_path: Path, auvident: Callable[..., Called], name: str, command: str
) -> None:
    run = tmp_path / "run"
    write_bytes(run / name, MINE.encode())
    called = auvident(command, *INGEST[1:], run)
    assert called.code == 2, called.err
    assert str(run / name) in called.err
    assert "not written by auvident" in called.err
    assert "Move it" in called.err
    assert contents(run) == {name: MINE.encode()}


@pytest.mark.parametrize("name", ["refine/model.json", "report/report.html"])
def test_a_whole_run_meets_a_foreign_file_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    run = tmp_path / "run"
    write_bytes(run / name, MINE.encode())
    monkeypatch.setattr("auvident.pipeline.execution.make", lambda *_: pytest.fail("it began"))
    with pytest.raises(UsageError, match=name):
        run_all(run, OPTIONS[0])
    assert contents(run) == {name: MINE.encode()}


def test_a_stage_meets_a_foreign_file_before_it_begins(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_bytes(run / "identify" / "states.parquet", MINE.encode())
    before = contents(run)
    monkeypatch.setattr("auvident.pipeline.execution.make", lambda *_: pytest.fail("it began"))
    with pytest.raises(UsageError, match=r"states\.parquet"):
        run_stage("identify", run)
    assert contents(run) == before


def test_a_file_that_is_not_in_the_way_does_not_matter(run: Path) -> None:
    write_bytes(run / "ase" / "notes.txt", MINE.encode())
    write_bytes(run / "notes.txt", MINE.encode())
    run_stage("ase", run)
    assert (run / "ase" / "notes.txt").read_text() == (run / "notes.txt").read_text() == MINE


def test_a_log_whose_name_can_be_no_file_name_everywhere_is_refused(tmp_path: Path) -> None:
    log = shutil.copytree(SAMPLES / "harbour_trial", tmp_path / "har\\bour")
    options = {"logs": [log], "vehicle": SAMPLES / "remus100.toml"}
    with pytest.raises(InputError, match="Rename"):
        run_stage("ingest", tmp_path / "run", options)
    assert not (tmp_path / "run").exists()


def test_what_the_table_says_a_stage_writes_is_what_it_writes(demo: Path) -> None:
    entries = status(demo)[1].stages
    for stage in (s for s in STAGES if not s.needs_both):
        trials = {n for n in entries[stage.name].outputs if stage.name == "ingest" and ".p" in n}
        assert set(stage.writes) | trials == set(entries[stage.name].outputs)


def test_a_finished_stage_has_no_intent_left(run: Path) -> None:
    assert status(run)[1].writing == {}
