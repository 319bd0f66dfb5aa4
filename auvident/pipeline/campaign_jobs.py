"""Trials side by side, each a process of its own: what one leaves is what `auvident run` leaves.

A process that dies, whatever kills it, takes nothing with it but its own work, and its memory is
given back. It costs what a single run costs; a pool of workers would save the import (a second),
and would lose its other work with a worker that is killed.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from auvident.parallel import VARIABLE

ONE_THREAD = (VARIABLE, "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
ATTEMPTS = 2  # of a trial whose process was killed
LONGEST_PROBLEM = 500  # characters


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

    def __init__(
        self, count: int, start: Callable[..., subprocess.Popen[str]] = subprocess.Popen
    ) -> None:
        self.count, self.start = count, start
        self._alive: set[subprocess.Popen[str]] = set()
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
                for process in list(self._alive):
                    process.terminate()
                raise

    def _run(self, job: Job) -> JobDone:
        began = time.perf_counter()
        code, said = 0, ""
        for _ in range(ATTEMPTS):
            code, said = self._once(job)
            if code >= 0 or self._stopped.is_set():
                break
        problem = said if code else ""
        if code < 0:
            problem = f"its process was killed (signal {-code})"
        return JobDone(job.key, code, problem[:LONGEST_PROBLEM], time.perf_counter() - began)

    def _once(self, job: Job) -> tuple[int, str]:
        process = self.start(
            [sys.executable, "-m", "auvident", *job.arguments],
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._alive.add(process)
        try:
            if self._stopped.is_set():
                process.terminate()
            _, said = process.communicate()
        finally:
            self._alive.discard(process)
        return process.returncode, problem_of(said)


def environment() -> Mapping[str, str]:
    """Of a process for one trial: the processors are taken by other trials."""
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    path = os.pathsep.join(p for p in paths if p)
    return {**os.environ, "PYTHONPATH": path, **dict.fromkeys(ONE_THREAD, "1")}


def problem_of(said: str) -> str:
    """The error among what a command said, in one line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    starts = [k for k, line in enumerate(lines) if line.startswith("Error:")]
    told = lines[starts[-1] :] if starts else lines[-2:]
    return " ".join(told).removeprefix("Error:").strip()
