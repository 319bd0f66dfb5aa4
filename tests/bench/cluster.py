"""A campaign on the workers of a Dask cluster, whatever becomes of them (``tests.bench cluster``).

Scheduler and workers are processes of this machine, as ``dask scheduler`` and ``dask worker`` start
them. Held against processes without Dask: the bytes of every run directory from two workers, from
four, from four of which one is killed, and with a scheduler that is killed and started again. Then
the memory of two workers over many tiny trials.
"""

import argparse
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from auvident.pipeline.campaign_cluster import ClusterWorkers
from auvident.pipeline.campaign_jobs import Job, JobRunner, LocalProcesses
from auvident.pipeline.observer import Observer
from auvident.pipeline.warming import warm_for_runs
from tests.bench.kills import contents
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

VEHICLE, SEED = SAMPLES / "remus100.toml", 1001  # a seed of development
SCHEDULE = {"straights": 1, "turns": 2, "zigzags_10": 1, "zigzags_20": 1}
KILL_AFTER = 0.3  # of the time that the trials took on this machine
MIB = 2.0**20
Rows = list[dict[str, Any]]


def main(arguments: list[str], show: Callable[[str, Rows], None]) -> None:
    """Make some trials, run them everywhere, compare and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench cluster", description=__doc__)
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--tiny", type=int, default=50, help="trials of the look at the memory")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="auvident-cluster-") as name:
        folder = Path(name)
        show("the same trials on a cluster", same_bytes(folder, options.trials))
        show("memory of the workers", [memory(folder / "tiny", options.tiny)])


def same_bytes(folder: Path, count: int) -> Rows:
    """Each way of running the same trials, and what is not as on this machine without Dask."""
    logs = [sailed(folder / "logs" / f"trial-{k}", SEED + k) for k in range(count)]
    warm_for_runs(Observer())
    began = time.monotonic()
    first = _ran(LocalProcesses(2), logs, folder / "here")
    lasts_s = time.monotonic() - began
    expected = {log.name: contents(folder / "here" / log.name) for log in logs}
    rows = [{"where": "processes", "trials": count, "ended": first, "other files": 0}]
    for where, workers, harm in (
        ("2 workers", 2, None),
        ("4 workers", 4, None),
        ("4 workers, one killed", 4, kill_worker),
        ("2 workers, scheduler killed and started again", 2, restart),
    ):
        output = folder / where.replace(" ", "-").replace(",", "")
        with (
            Cluster(workers, folder) as cluster,
            _meanwhile(harm, cluster, KILL_AFTER * lasts_s),
        ):
            ended = _ran(ClusterWorkers(cluster.address, output, _say), logs, output)
        found = {log.name: contents(output / log.name) for log in logs}
        other = sum(
            found[k].get(n) != expected[k].get(n)
            for k in expected
            for n in expected[k].keys() | found[k].keys()
        )
        rows.append({"where": where, "trials": count, "ended": ended, "other files": other})
    return rows


def sailed(folder: Path, seed: int) -> Path:
    """A trial of five maneuvers."""
    from seatrial.trial import generate

    recipe = {"name": folder.name, "vehicle": VEHICLE.stem, "seed": seed, "schedule": SCHEDULE}
    generate(recipe, folder)
    return folder


def _ran(runner: JobRunner, logs: Sequence[Path], output: Path) -> int:
    """Run them; how many ended well."""
    output.mkdir()
    jobs = [
        Job(log.name, ("run", *_of(log), "--run", str(output / log.name), "--quiet"))
        for log in logs
    ]
    done = list(runner.each(jobs))
    for one in (d for d in done if d.exit_code):
        _say(f"{output.name}/{one.key}: {one.problem}")
    return sum(d.exit_code == 0 for d in done)


def _of(log: Path) -> tuple[str, ...]:
    return str(log), "--vehicle", str(VEHICLE)


def memory(folder: Path, count: int) -> dict[str, Any]:
    """Memory of each worker after the first tiny trials, and after all of them."""
    from distributed import Client

    folder.mkdir()
    first = 10
    jobs = [
        Job(f"{k}", ("ase", "--vehicle", str(VEHICLE), "--quiet")) for k in range(count + first)
    ]
    with Cluster(2, folder) as cluster, Client(cluster.address, set_as_default=False) as client:
        client.wait_for_workers(2)
        runner = ClusterWorkers(cluster.address, folder)
        list(runner.each(jobs[:first]))
        before = median(client.run(resident_mib).values())
        ended = sum(d.exit_code == 0 for d in runner.each(jobs[first:]))
        after = median(client.run(resident_mib).values())
    return {"trials": ended, "before MiB": before, "after MiB": after, "growth MiB": after - before}


def resident_mib() -> float:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MIB


# --- a cluster of processes -----------------------------------------------------------------


class Cluster:
    """A scheduler at a port of its own, and workers."""

    def __init__(self, workers: int, folder: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.workers, self.folder = workers, folder
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler: subprocess.Popen[bytes] | None = None
        self._open = ExitStack()

    def __enter__(self) -> "Cluster":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def start(self) -> None:
        """A scheduler, and as many workers as there are to be."""
        at = ("--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        self.scheduler = self._process("dask_scheduler", *at)
        many = ("--nworkers", str(self.workers), "--nthreads", "1", "--no-dashboard")
        self._process("dask_worker", self.address, *many, "--death-timeout", "10")

    def _process(self, module: str, *arguments: str) -> "subprocess.Popen[bytes]":
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
            cwd=self.folder, stdin=quiet, stdout=quiet, stderr=quiet,
        )  # fmt: skip
        self._open.callback(_ended, process)
        return process


def _ended(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def _meanwhile(
    harm: Callable[[Cluster], None] | None, cluster: Cluster, after_s: float
) -> Iterator[None]:
    """Do harm to a cluster while something else goes on."""
    if harm is None:
        yield
        return
    timer = threading.Timer(after_s, harm, (cluster,))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def kill_worker(cluster: Cluster) -> None:
    """Kill one of the workers that are at work, as a machine without memory does."""
    from distributed import Client

    with Client(cluster.address, set_as_default=False) as client:
        number = next(iter(client.run(os.getpid).values()))
    os.kill(number, signal.SIGKILL)
    _say(f"worker {number} killed")


def restart(cluster: Cluster) -> None:
    """Kill the scheduler, and start another with its workers in the same place."""
    assert cluster.scheduler is not None
    cluster.scheduler.kill()
    cluster.scheduler.wait()
    time.sleep(5.0)
    cluster.start()
    _say("scheduler killed and started again")


def _say(text: str) -> None:
    print(text, file=sys.stderr)
