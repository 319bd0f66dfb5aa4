"""Trials on a Dask cluster: the same processes as on one machine, started by its workers.

Workers see the files of the campaign under the same paths, and have the same version of the
program. A worker only starts and watches processes, so that its memory does not grow, and what a
trial leaves is what `auvident run` leaves.
"""

import logging
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from auvident import __version__
from auvident.errors import UsageError
from auvident.pipeline.campaign_jobs import Job, JobDone, environment, run_job
from auvident.schema.quoting import LONGEST_PROBLEM, first_words

if TYPE_CHECKING:
    from distributed import Client, Future

INSTALL = "Install it: pip install 'auvident[dask]'."
NO_ANSWER = "Check the address and that the scheduler runs; `dask scheduler` prints it."
REPLY_S = 10.0  # for a scheduler to answer the first time
RETURN_S = 60.0  # for one that was lost to be there again
LOSSES = 3  # of the scheduler, one after the other without a trial that ended in between
WAITING = 1000  # trials that the scheduler knows of at a time
WORKER_DIED = -9  # as if by SIGKILL, which it mostly is
DIED = "every worker that ran it died; their memory may be too small"
# What every first trial of a worker would do; others wait for the one that compiles.
WARM_UP = """
from auvident.pipeline.observer import Observer
from auvident.pipeline.warming import warm_for_runs
warm_for_runs(Observer())
"""
_warming = threading.Lock()


@dataclass(frozen=True)
class Order:
    """A trial for a worker.

    Attributes
    ----------
    job : Job
    folder : str
        Where the campaign was started; paths of the job may be relative to it.
    output : str
        Folder of the campaign, which is there if workers see the same files.
    version : str
        Of the program.
    """

    job: Job
    folder: str
    output: str
    version: str = __version__


class ClusterWorkers:
    """Trials on the workers of a Dask scheduler, each thread of a worker one at a time.

    Parameters
    ----------
    address : str
        Of the scheduler (``tcp://host:8786``), or its scheduler file (``.json``).
    output : Path
        Folder of the campaign.
    tell : callable, optional
        Takes a line on the cluster.
    work : callable, optional
        What a worker does.

    Raises
    ------
    UsageError
        Dask is not installed.
    """

    def __init__(
        self,
        address: str,
        output: Path,
        tell: Callable[[str], None] = lambda text: None,
        work: "Callable[[Order], JobDone] | None" = None,
    ) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise UsageError("needs Dask", "--scheduler", INSTALL) from None
        self.address, self.output, self.tell = address, output, tell
        self.work = work or run_on_worker
        # what it has to say of a lost scheduler, over many lines, is told in one
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        """Run them all; where the scheduler is lost, those that have not ended start again.

        Raises
        ------
        UsageError
            No scheduler answers.
        """
        waiting, suspects = {job.key: job for job in jobs}, dict[str, Job]()
        losses, patience = 0, REPLY_S
        while (waiting or suspects) and losses <= LOSSES:
            try:
                with self._connected(patience) as client:
                    for done in self._all(client, waiting, suspects):
                        losses = 0
                        yield done
            except UsageError:
                if patience == REPLY_S:  # it never answered
                    raise
                break
            losses, patience = losses + 1, RETURN_S
            if left := len(waiting) + len(suspects):
                self.tell(f"Connection to {self.address} lost: {left} trials start again.")
        lost = f"the scheduler {self.address} was lost; run the campaign again to go on"
        yield from (JobDone(key, WORKER_DIED, lost, 0.0) for key in (*waiting, *suspects))

    def _all(
        self, client: "Client", waiting: dict[str, Job], suspects: dict[str, Job]
    ) -> Iterator[JobDone]:
        """Trials, and at last, one at a time, those whose workers died.

        Whatever was beside a trial that kills workers, or behind it, died with it as often.
        """
        yield from self._round(client, waiting, WAITING, suspects)
        if not waiting:
            yield from self._round(client, suspects, 1)

    @contextmanager
    def _connected(self, patience: float) -> "Iterator[Client]":
        """A connection; trials that nobody waits for any more are ended with it."""
        from distributed import Client

        try:
            client = Client(
                **self._place(), timeout=patience, set_as_default=False, name="auvident"
            )
        except (OSError, ValueError) as error:
            raise UsageError(_no_answer(error), f"--scheduler {self.address}", NO_ANSWER) from None
        try:
            threads = sum(client.nthreads().values())
            now = f"{threads} trials at a time now" if threads else "waiting for its first worker"
            self.tell(f"Dask cluster {self.address}: {now}.")
            yield client
        finally:
            with suppress(Exception):  # of a connection that is lost
                client.close(timeout=REPLY_S)

    def _place(self) -> dict[str, Any]:
        if not self.address.endswith(".json"):
            return {"address": self.address}
        if not os.path.exists(self.address):  # dask would wait for it forever
            raise FileNotFoundError(self.address)
        return {"scheduler_file": self.address}

    def _round(
        self,
        client: "Client",
        waiting: dict[str, Job],
        at_once: int,
        suspects: dict[str, Job] | None = None,
    ) -> Iterator[JobDone]:
        """Trials as they end, taken out of those that wait, until the scheduler is lost."""
        from distributed import CancelledError, as_completed

        queue, name = iter(list(waiting.values())), uuid4().hex
        jobs: dict[str, Job] = {}

        def sent(count: int) -> "Iterator[Future[JobDone]]":
            for job in islice(queue, count):
                order = Order(job, os.getcwd(), str(self.output))
                key = f"auvident-{name}-{job.key}"
                jobs[key] = job
                yield client.submit(self.work, order, key=key, pure=False)

        running = as_completed(sent(at_once), loop=client.loop)
        for future in running:
            if future.status == "cancelled":  # with the connection
                return
            if future.status == "lost":  # with the worker that held its answer; it runs again
                running.add(future)
                continue
            job = jobs.pop(future.key)
            try:
                done = _ended(job, future)
            except CancelledError:  # lost between its end and its answer
                return
            future.release()
            del waiting[job.key]
            running.update(sent(1))
            if done is None and suspects is not None:
                suspects[job.key] = job
                continue
            yield done or JobDone(job.key, WORKER_DIED, DIED, 0.0)


def _no_answer(error: Exception) -> str:
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    if isinstance(error, ValueError):
        return f"is no address of a scheduler ({error})"
    return f"no scheduler answers within {REPLY_S:.0f} s"


def _ended(job: Job, future: "Future[JobDone]") -> JobDone | None:
    """What a worker says of a trial, or why it says nothing; None if too many died of it."""
    from distributed import KilledWorker

    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, KilledWorker):
        return None
    problem = " ".join(f"its worker failed: {type(error).__name__}: {error}".split())
    return JobDone(job.key, WORKER_DIED, first_words(problem, LONGEST_PROBLEM), 0.0)


# --- on a worker ----------------------------------------------------------------------------


@cache
def warm_kernels() -> None:
    """Have the kernels compiled where this worker keeps them, once."""
    quiet = subprocess.DEVNULL
    subprocess.run(
        [sys.executable, "-c", WARM_UP], env=environment(), stdin=quiet, stdout=quiet, stderr=quiet
    )


def run_on_worker(order: Order, warm: Callable[[], None] = warm_kernels) -> JobDone:
    """Run a trial as a process of this worker's machine."""
    refusal = refused(order)
    if refusal:
        return JobDone(order.job.key, UsageError.exit_code, refusal, 0.0)
    with _warming:
        warm()
    return run_job(order.job, still_wanted(), partial(subprocess.Popen, cwd=order.folder))


def refused(order: Order) -> str:
    """Why this worker cannot run it; empty if it can."""
    host = socket.gethostname()
    if order.version != __version__:
        return f"worker {host} has auvident {__version__}, not {order.version}"
    for place in (order.folder, os.path.join(order.folder, order.output)):
        if not os.path.isdir(place):
            return f"worker {host} does not see {place}: workers need the same file system"
    return ""


def still_wanted() -> Callable[[], bool]:
    """Whether the scheduler still wants the trial that this thread runs.

    A task that was cancelled, or whose client has gone, is told to the worker and not to the
    thread.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state == "executing" and worker.status.name == "running"

    return wanted
