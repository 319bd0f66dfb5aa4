"""Trials side by side, each a process of its own: what one leaves is what `auvident run` leaves.

A process that dies, whatever kills it, takes nothing with it but its own work, and its memory is
given back. It costs what a single run costs; a pool of workers would save the import (a second),
and would lose its other work with a worker that is killed.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from auvident.errors import InUseError
from auvident.parallel import VARIABLE
from auvident.pipeline.campaign_trial import STARTED_BY
from auvident.schema.quoting import LONGEST_PROBLEM, first_words

PROGRAM = ("-m", "auvident.pipeline.campaign_trial")
ONE_THREAD = (VARIABLE, "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
OF_TERMINAL = ("COLUMNS", "LINES")  # size of the one that the campaign was started in
ENDS = (".", "!", "?", ":", "]", "}")  # of a sentence, of a line of TOML
ATTEMPTS = 2  # of a trial whose process was killed
OUT_OF_MEMORY = ", as the system does where memory runs out: run fewer at a time (`--jobs`)"
LOOK_S = 0.5  # how often a trial that runs is asked whether it is still wanted
# A run directory may still be held by the process of a campaign, or of a worker, that was killed.
IN_USE_ATTEMPTS, IN_USE_PAUSE_S = 5, 2.0

Start = Callable[..., "subprocess.Popen[str]"]


@dataclass(frozen=True)
class Job:
    """A trial to run: its key, and the arguments of the program."""

    key: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class JobDone:
    """How a trial ended: its exit code, negative where a signal ended it, and what it said."""

    key: str
    exit_code: int
    problem: str
    seconds: float


class JobRunner(Protocol):
    """Where trials run: on this machine, or on another one that sees the same files."""

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        """Run them all; each as soon as it has ended, in any order."""


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class LocalProcesses:
    """Trials as processes of this machine, so many at a time, one thread each.

    Parameters
    ----------
    count : int
        Trials at a time.
    start : callable, optional
        How a process is started.
    """

    def __init__(self, count: int, start: Start = subprocess.Popen) -> None:
        self.count, self.start = count, start
        self._stopped = threading.Event()

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        """Run them all; an interruption ends those that run."""
        with ThreadPoolExecutor(self.count, thread_name_prefix="campaign") as pool:
            pending: list[Future[JobDone]] = [pool.submit(self._run, job) for job in jobs]
            try:
                for done in as_completed(pending):
                    yield done.result()
            except BaseException:  # also where whoever asks for the next one gives up
                self._stopped.set()
                for future in pending:
                    future.cancel()
                raise

    def _run(self, job: Job) -> JobDone:
        return run_job(job, lambda: not self._stopped.is_set(), self.start)


def run_job(job: Job, wanted: Callable[[], bool], start: Start = subprocess.Popen) -> JobDone:
    """Run one trial as a process.

    Parameters
    ----------
    job : Job
    wanted : callable
        Whether anybody still waits for it; where not, the process is ended.
    start : callable, optional
        How a process is started.
    """
    began = time.perf_counter()
    killed = in_use = 0
    while True:
        code, said = _once(job, wanted, start)
        killed, in_use = killed + (code < 0), in_use + (code == InUseError.exit_code)
        again = code < 0 and killed < ATTEMPTS
        if code == InUseError.exit_code and in_use < IN_USE_ATTEMPTS:
            again = True
            time.sleep(IN_USE_PAUSE_S)
        if not (again and wanted()):
            break
    problem = said if code else ""
    if code < 0:
        problem = f"its process was killed (signal {-code})"
        problem += OUT_OF_MEMORY if code == -signal.SIGKILL else ""
    told = first_words(problem, LONGEST_PROBLEM)
    return JobDone(job.key, code, told, time.perf_counter() - began)


def _once(job: Job, wanted: Callable[[], bool], start: Start) -> tuple[int, str]:
    process = start(
        [sys.executable, *PROGRAM, *job.arguments],
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    while True:
        try:
            _, said = process.communicate(timeout=LOOK_S)
            return process.returncode, problem_of(said)
        except subprocess.TimeoutExpired:
            if not wanted():
                process.terminate()


def environment() -> Mapping[str, str]:
    """Of a process for one trial: the processors are taken by other trials.

    It does not know how wide the terminal is, so that lines of its error end where sentences do.
    """
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    path = os.pathsep.join(p for p in paths if p)
    own = {"PYTHONPATH": path, STARTED_BY: str(os.getpid())}
    given = {key: value for key, value in os.environ.items() if key not in OF_TERMINAL}
    return {**given, **own, **dict.fromkeys(ONE_THREAD, "1")}


def problem_of(said: str) -> str:
    """The error among what a command said, in one line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    starts = [k for k, line in enumerate(lines) if line.startswith("Error:")]
    told = lines[starts[-1] :] if starts else lines[-2:]
    ended = [line if line.endswith(ENDS) else f"{line}." for line in told[:-1]]
    return " ".join([*ended, *told[-1:]]).removeprefix("Error:").strip()
