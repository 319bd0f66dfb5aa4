"""One process at a time in a run directory, from its creation on."""

import errno
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from auvident.errors import InputError, InUseError, NumericsError, StageError
from auvident.pipeline import run_stage, status
from auvident.storage import lock
from auvident.storage.run_directory import RunDirectory
from tests.command_line import ENVIRONMENT, SAMPLES, Called

TRIES = 4  # of a race between two programs: about two seconds each
HOLD = (
    "import sys, time; from pathlib import Path;"
    "from auvident.storage.run_directory import RunDirectory\n"
    "with RunDirectory(Path(sys.argv[1])).lock(): print('locked', flush=True); time.sleep(60)"
)
# Both programs are loaded and wait for the same moment.
START = (
    "import sys, time, auvident.pipeline, auvident.stages.ingest, auvident.storage.logs\n"
    "from auvident.cli import main\n"
    "print('ready', flush=True); sys.stdin.readline(); main(sys.argv[1:])"
)


def ingest(run: Path, rate_hz: str) -> subprocess.Popen:
    command = [
        sys.executable,
        "-c",
        START,
        "ingest",
        str(SAMPLES / "harbour_trial"),
        "--vehicle",
        str(SAMPLES / "remus100.toml"),
        "--run",
        str(run),
        "--rate",
        rate_hz,
        "--json",
    ]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, env=ENVIRONMENT, text=True, **pipes)  # type: ignore[call-overload]


@pytest.mark.parametrize("number", range(TRIES))
def test_two_runs_started_together_on_a_new_directory(tmp_path: Path, number: int) -> None:
    """One is refused, or comes after the other; what each prints is what it did."""
    run = tmp_path / "runs" / "new"
    processes = {rate: ingest(run, rate) for rate in ("5", "10")}
    for process in processes.values():
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes.values():
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    said = {rate: process.communicate(timeout=60) for rate, process in processes.items()}
    codes = {rate: process.returncode for rate, process in processes.items()}
    assert sorted(codes.values()) in ([0, 6], [0, 0]), said
    for rate in (rate for rate, code in codes.items() if code == 6):
        assert "another auvident process" in said[rate][1]
        assert said[rate][0] == ""
    done = {rate: said[rate][0] for rate, code in codes.items() if code == 0}
    assert all(json.loads(text)["rate_hz"] == float(rate) for rate, text in done.items())
    assert (run / "ingest" / "quality.json").read_text() in done.values()
    decisions, manifest = status(run)
    assert {d.stage: d.state for d in decisions}["ingest"] == "done"
    last = json.loads((run / "ingest" / "quality.json").read_text())["rate_hz"]
    assert manifest.stages["ingest"].options["rate_hz"] == last


def test_a_new_directory_is_locked_while_its_first_stage_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    options = {"logs": [SAMPLES / "harbour_trial"], "vehicle": SAMPLES / "remus100.toml"}

    def meanwhile(*_: object) -> None:
        with pytest.raises(InUseError), RunDirectory(run).lock():
            pass
        raise NumericsError("enough")

    monkeypatch.setattr("auvident.pipeline.execution.make", meanwhile)
    with pytest.raises(NumericsError, match="enough"):
        run_stage("ingest", run, options)
    assert not run.exists()


def test_a_second_process_is_refused_while_the_first_works(tmp_path: Path) -> None:
    first = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, env=ENVIRONMENT
    )
    assert first.stdout is not None
    first.stdout.readline()
    run = RunDirectory(tmp_path)
    with pytest.raises(InUseError, match="another auvident process"), run.lock():
        pass
    first.kill()
    first.wait()
    with run.lock():  # the lock died with its process
        pass


def test_who_holds_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pid, host, since when and the command, of a process that works."""
    monkeypatch.setattr(lock.sys, "argv", ["auvident", "run", "a log"])
    said = f"process {os.getpid()} on {socket.gethostname()}, since 20.*: auvident run 'a log'"
    run = RunDirectory(tmp_path)
    with run.lock(), pytest.raises(InUseError, match=said), RunDirectory(tmp_path).lock():
        pass
    assert list(tmp_path.iterdir()) == []


def left_by(tmp_path: Path, **changes: object) -> None:
    """The lock file of a process that was killed, or that works on another machine."""
    done = subprocess.Popen(["true"])
    done.wait()
    holder = {"pid": done.pid, "host": socket.gethostname(), "command": "x", "since": "then"}
    (tmp_path / lock.LOCK_FILE).write_text(json.dumps(holder | changes))


@pytest.mark.parametrize("host", [socket.gethostname(), "another"])
def test_what_a_killed_process_has_left_does_not_block(tmp_path: Path, host: str) -> None:
    left_by(tmp_path, host=host)
    with RunDirectory(tmp_path).lock():
        pass
    assert not (tmp_path / lock.LOCK_FILE).exists()


def test_status_names_who_works_there_and_nobody_who_is_gone(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    assert json.loads(auvident("status", demo, "--json").out)["in_use"] is None
    command = [sys.executable, "-c", HOLD, str(demo)]
    with subprocess.Popen(command, env=ENVIRONMENT, text=True, stdout=subprocess.PIPE) as first:
        assert first.stdout is not None and first.stdout.readline() == "locked\n"
        called = auvident("status", demo)
        who = f"process {first.pid} on {socket.gethostname()}"
        assert called.code == 0
        assert f"In use, so that this may change: {who}" in " ".join(called.err.split())
        assert json.loads(auvident("status", demo, "--json").out)["in_use"].startswith(who)
        first.kill()
    assert (demo / lock.LOCK_FILE).exists()
    assert json.loads(auvident("status", demo, "--json").out)["in_use"] is None


@pytest.fixture
def no_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system that knows none."""

    def none(descriptor: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock, "_lock", none)


@pytest.mark.usefixtures("no_locks")
def test_without_locks_the_text_of_the_file_decides(tmp_path: Path) -> None:
    left_by(tmp_path)
    with RunDirectory(tmp_path).lock():  # of a process that is no more
        pass
    for changes in ({"pid": 1}, {"host": "another"}):
        left_by(tmp_path, **changes)
        with pytest.raises(InUseError, match=rf"remove .*{lock.LOCK_FILE}"):
            RunDirectory(tmp_path).lock().__enter__()


@pytest.mark.parametrize("text", ["", "[", "{}", "null", '{"pid": "x"}', "[" * 4000, "\0" * 99])
@pytest.mark.usefixtures("no_locks")
def test_a_damaged_lock_file_does_not_block(tmp_path: Path, text: str) -> None:
    (tmp_path / lock.LOCK_FILE).write_text(text)
    with RunDirectory(tmp_path).lock():
        pass


def test_a_lock_file_that_is_a_link_is_not_written_through(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / lock.LOCK_FILE).symlink_to("../mine")
    with (
        pytest.raises(InputError, match="run: cannot be written to"),
        RunDirectory(tmp_path / "run").lock(),
    ):
        pass
    assert (tmp_path / "mine").read_text() == "mine"


def test_a_directory_is_removed_only_if_made_here_and_empty(tmp_path: Path) -> None:
    with RunDirectory(tmp_path / "a" / "b").lock():
        assert (tmp_path / "a" / "b").is_dir()
    assert not (tmp_path / "a").exists()
    with RunDirectory(tmp_path / "a" / "b").lock():
        (tmp_path / "a" / "notes.txt").write_text("mine")
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["notes.txt"]
    (tmp_path / "empty").mkdir()
    with RunDirectory(tmp_path / "empty").lock():
        pass
    assert (tmp_path / "empty").is_dir()
    with RunDirectory(tmp_path / "c").lock():
        (tmp_path / "c" / "run.json").write_text("{}")
    assert (tmp_path / "c" / "run.json").exists()


def test_a_directory_that_was_made_anew_meanwhile_is_locked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first descriptor is of a file in a directory that another process has removed."""
    path, opened = tmp_path / "run", []
    open_before = os.open

    def open_and_lose(*arguments: object) -> int:
        descriptor = open_before(*arguments)  # type: ignore[arg-type]
        opened.append(descriptor)
        if len(opened) == 1:
            (path / lock.LOCK_FILE).unlink()
            path.rmdir()
        elif len(opened) == 2:
            path.rename(tmp_path / "moved")
            path.mkdir()
        return descriptor

    monkeypatch.setattr(lock.os, "open", open_and_lose)
    with RunDirectory(path).lock():
        assert len(opened) == 3
        assert os.path.samestat(os.fstat(opened[-1]), (path / lock.LOCK_FILE).stat())


def test_many_that_make_and_remove_the_same_directory_never_meet(tmp_path: Path) -> None:
    """Threads have descriptors of their own, so they exclude each other as processes do."""
    path, inside, met, failures = tmp_path / "runs" / "one", [], [], []

    def work() -> None:
        for _ in range(200):
            try:
                with RunDirectory(path).lock():
                    inside.append(1)
                    met.append(len(inside))
                    assert path.is_dir()
                    inside.pop()
            except InUseError:
                pass
            except BaseException as error:
                failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert set(met) == {1}


def test_a_stage_without_a_run_creates_nothing(tmp_path: Path) -> None:
    with pytest.raises(StageError, match="no run here"):
        run_stage("segment", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(InputError, match="file/run: cannot be created"),
        RunDirectory(tmp_path / "file" / "run").lock(),
    ):
        pass


def test_a_directory_that_is_there_cannot_be_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As root nothing is denied: the system is played."""

    def denied(*arguments: object) -> int:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(os, "open", denied)
    with (
        pytest.raises(InputError, match="cannot be written to: Permission denied"),
        RunDirectory(tmp_path).lock(),
    ):
        pass


def test_a_run_directory_in_which_the_first_ingest_works_is_in_use(tmp_path: Path) -> None:
    """It holds only a lock; it was told to be the folder of a log."""
    run = RunDirectory(tmp_path / "run")
    held = "from auvident.storage.lock import locked; from pathlib import Path; import sys\n"
    held += "with locked(Path(sys.argv[1])): print(flush=True); input()"
    command = [sys.executable, "-c", held, str(run.path)]
    with subprocess.Popen(
        command, env=ENVIRONMENT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as first:
        assert first.stdout is not None
        first.stdout.readline()
        with pytest.raises(InUseError, match=f"process {first.pid} on") as caught:
            run.existing()
        assert caught.value.where == str(run.path) and caught.value.exit_code == 6
        first.communicate("\n")
    with pytest.raises(StageError, match="no run here"):
        run.existing()


def test_a_lock_that_was_left_makes_no_log_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / lock.LOCK_FILE).write_text("{}")
    with pytest.raises(StageError, match="no run here") as caught:
        RunDirectory(tmp_path).existing()
    assert "the folder of a log" not in caught.value.remedy
