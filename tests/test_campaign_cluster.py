"""A campaign on a Dask cluster: the same results as here, whatever becomes of workers."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from auvident.errors import UsageError
from auvident.pipeline import campaign_cluster, campaign_trial
from auvident.pipeline.campaign_cluster import (
    ClusterWorkers,
    Order,
    refused,
    run_on_worker,
    still_wanted,
)
from auvident.pipeline.campaign_jobs import Job, JobDone, LocalProcesses, run_job
from tests.command_line import SAMPLES, call

if TYPE_CHECKING:
    from distributed import LocalCluster

SHORT_S = 60.0  # of a log, from its beginning on


@pytest.fixture(scope="module")
def cluster() -> "Iterator[LocalCluster]":
    """Two workers; a trial that two of them died of is not tried again."""
    distributed = pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    own = {"distributed.scheduler.allowed-failures": 1, "distributed.admin.log-format": ""}
    place = {"dashboard_address": None, "silence_logs": 50, "threads_per_worker": 1}
    with dask.config.set(own), distributed.LocalCluster(n_workers=2, **place) as found:
        yield found


def nothing() -> None:
    """Compile nothing: no kernel is used."""


def works(order: Order, code: str) -> JobDone:
    """A trial that is some lines of Python, with its arguments."""

    def start(command: list[str], **options: Any) -> "subprocess.Popen[str]":
        return subprocess.Popen([sys.executable, "-c", code, *command[3:]], **options)

    return run_job(order.job, still_wanted(), start)


def deadly(order: Order) -> JobDone:
    """Its worker is killed: by "once" in the first attempt, by "ever" in each."""
    kind, marker = order.job.arguments
    if kind == "ever" or (kind == "once" and not Path(marker).exists()):
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return JobDone(order.job.key, 0, "", 0.0)


def short_log(folder: Path) -> Path:
    """The beginning of a sample trial."""
    folder.mkdir(parents=True)
    for file in (SAMPLES / "harbour_trial").glob("*.csv"):
        lines = file.read_text().splitlines(keepends=True)
        begins = float(lines[1].partition(",")[0])
        rows = (r for r in lines[1:] if float(r.partition(",")[0]) < begins + SHORT_S)
        (folder / file.name).write_text("".join([lines[0], *rows]))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Files that hold no times."""
    files = [p for p in folder.rglob("*") if p.is_file() and p.name != "run.json"]
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


def test_two_workers_and_four_leave_the_same_as_processes_of_this_machine(
    cluster: "LocalCluster", tmp_path: Path
) -> None:
    code = "import random, sys; random.seed(sys.argv[1])\n"
    code += "open(sys.argv[2], 'wb').write(random.randbytes(9999))"

    def jobs(folder: str) -> list[Job]:
        (tmp_path / folder).mkdir()
        return [Job(f"v/{k}", (f"{k}", str(tmp_path / folder / f"{k}"))) for k in range(6)]

    def start(command: list[str], **options: Any) -> "subprocess.Popen[str]":
        return subprocess.Popen([sys.executable, "-c", code, *command[3:]], **options)

    assert len(list(LocalProcesses(2, start).each(jobs("here")))) == 6
    for count in (4, 2):
        cluster.scale(count)
        work = partial(works, code=code)
        runner = ClusterWorkers(cluster.scheduler_address, tmp_path, work=work)
        done = list(runner.each(jobs(f"on {count}")))
        assert sorted(d.key for d in done) == [f"v/{k}" for k in range(6)]
        assert {(d.exit_code, d.problem) for d in done} == {(0, "")}
        assert contents(tmp_path / f"on {count}") == contents(tmp_path / "here")


def test_a_worker_runs_the_program_where_the_campaign_was_started(
    cluster: "LocalCluster", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short_log(tmp_path / "log")
    monkeypatch.chdir(tmp_path)
    command = ("ingest", "log", "--vehicle", str(SAMPLES / "remus100.toml"), "--quiet", "--run")
    made = call(*command, "here/v/log")
    assert made.code == 0, made.err
    Path("there").mkdir()
    work = partial(run_on_worker, warm=nothing)
    runner = ClusterWorkers(cluster.scheduler_address, Path("there"), work=work)
    (done,) = runner.each([Job("v/log", (*command, "there/v/log"))])
    assert (done.exit_code, done.problem) == (0, "")
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_worker_that_is_killed_takes_nothing_with_it(
    cluster: "LocalCluster", tmp_path: Path
) -> None:
    kinds = {"a": "never", "b": "once", "c": "ever", "d": "never"}
    jobs = [Job(k, (kind, str(tmp_path / k))) for k, kind in kinds.items()]
    told: list[str] = []
    runner = ClusterWorkers(cluster.scheduler_address, tmp_path, told.append, work=deadly)
    done = {d.key: d for d in runner.each(jobs)}
    assert {k: d.exit_code for k, d in done.items()} == {"a": 0, "b": 0, "c": -9, "d": 0}
    assert done["c"].problem.startswith("every worker that ran it died")
    assert told == [f"Dask cluster {cluster.scheduler_address}: 2 trials at a time now."]


def noted(order: Order) -> JobDone:
    """Say which process ran it; the second time it lasts."""
    marker = Path(order.job.arguments[0])
    again = marker.exists()
    with marker.open("a") as file:
        file.write(f"{os.getpid()}\n")
    time.sleep(2.0 * again)
    return JobDone(order.job.key, 0, "", 0.0)


def test_an_answer_that_dies_with_its_worker_is_no_lost_scheduler(
    cluster: "LocalCluster", tmp_path: Path
) -> None:
    def held(key: str) -> bool:
        tasks = cluster.scheduler.tasks.values()
        return any(t.state == "memory" and str(t.key).endswith(f"-{key}") for t in tasks)

    def ran(key: str) -> list[str]:
        return (tmp_path / key).read_text().split()

    jobs = [Job(k, (str(tmp_path / k),)) for k in "ab"]
    told: list[str] = []
    runner = ClusterWorkers(cluster.scheduler_address, tmp_path, told.append, work=noted)
    running = runner.each(jobs)
    first = next(running).key
    second = "b" if first == "a" else "a"
    until(lambda: held(second))
    os.kill(int(ran(second)[0]), signal.SIGKILL)
    until(lambda: len(ran(second)) == 2)
    assert [(d.key, d.exit_code) for d in running] == [(second, 0)]
    assert len(ran(second)) == 2
    assert len(told) == 1, told


def test_whoever_gives_up_leaves_no_process_on_the_workers(
    cluster: "LocalCluster", tmp_path: Path
) -> None:
    code = "import os, sys, time; open(sys.argv[1], 'w').write(str(os.getpid())); time.sleep("
    code += "0 if sys.argv[1].endswith('short') else 60)"
    jobs = [Job(k, (str(tmp_path / k),)) for k in ("long", "short")]
    runner = ClusterWorkers(cluster.scheduler_address, tmp_path, work=partial(works, code=code))
    running = runner.each(jobs)
    assert next(running).key == "short"
    until(lambda: (tmp_path / "long").exists() and (tmp_path / "long").read_text() != "")
    number = int((tmp_path / "long").read_text())
    running.close()  # type: ignore[attr-defined]
    until(lambda: not alive(number))


def until(true: Callable[[], bool], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def alive(number: int) -> bool:
    with suppress(ProcessLookupError):
        os.kill(number, 0)
        return True
    return False


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://127.0.0.1:9", "no scheduler answers within 0 s"),
        ("nowhere://x", "is no address of a scheduler"),
        ("missing.json", "there is no such file"),
    ],
)
def test_a_scheduler_that_does_not_answer_is_one_line(
    address: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(campaign_cluster, "REPLY_S", 0.3)
    with pytest.raises(UsageError, match=said) as caught:
        list(ClusterWorkers(address, tmp_path).each([Job("v/a", ())]))
    assert (caught.value.exit_code, caught.value.where) == (2, f"--scheduler {address}")
    assert list(ClusterWorkers(address, tmp_path).each([])) == []  # nobody to be asked


def test_without_dask_the_remedy_is_the_line_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"pip install 'auvident\[dask\]'"):
        ClusterWorkers("tcp://127.0.0.1:8786", tmp_path)


def test_a_cluster_has_its_own_number_of_trials_at_a_time() -> None:
    said = call("campaign", "x", "--output", "y", "--jobs", "2", "--scheduler", "tcp://h:1")
    assert said.code == 2 and "either --jobs or --scheduler" in said.err


def test_a_worker_that_cannot_run_a_trial_says_why(tmp_path: Path) -> None:
    job = Job("v/a", ())
    assert refused(Order(job, str(tmp_path), ".")) == ""
    assert "not 0.0" in refused(Order(job, str(tmp_path), ".", version="0.0"))
    assert "same file system" in refused(Order(job, str(tmp_path), "elsewhere"))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends them")
def test_a_trial_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    file = tmp_path / "number"
    child = (
        "import os, time; from auvident.pipeline.campaign_trial import end_with_starter as e; e();"
        f"open({str(file)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    )
    starter = (
        "import os, subprocess, sys, time\n"
        f"own = {{**os.environ, {campaign_trial.STARTED_BY!r}: str(os.getpid())}}\n"
        f"subprocess.Popen([sys.executable, '-c', {child!r}], env=own); time.sleep(60)"
    )
    first = subprocess.Popen([sys.executable, "-c", starter])
    try:
        until(lambda: file.exists() and file.read_text() != "")
    finally:
        first.kill()
        first.wait()
    until(lambda: not alive(int(file.read_text())))
