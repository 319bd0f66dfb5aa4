"""Seconds of whole commands, as somebody waits for them: of the wall clock and of the processors.

Everything is compiled before; each command is a process of its own, as often as asked for. The
first row, Python and the libraries alone, tells how fast the machine is.
"""

import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

from tests.command_line import ENVIRONMENT, PROGRAM, SAMPLES

LIBRARIES = (sys.executable, "-c", "import numba, pandas, pyarrow.parquet, scipy.linalg")
VEHICLES = {"harbour_trial": "remus100", "bay_trial": "tern180"}
STAGES = ("ingest", "identify", "diagnose", "report")
# Some developers let Python keep no bytecode; a user's Python keeps it, and a command that has none
# begins by compiling all its modules.
AS_A_USER = {k: v for k, v in ENVIRONMENT.items() if k != "PYTHONDONTWRITEBYTECODE"}
Rows = list[dict[str, Any]]


class Spent(NamedTuple):
    """Of a command, from its start to its end [s]."""

    wall_s: float
    processor_s: float


def commands(repeats: int = 5, trials: Sequence[str] = tuple(VEHICLES)) -> dict[str, Rows]:
    """Medians, and least and most of the wall clock."""
    spent((PROGRAM, "--help"))  # leaves the bytecode
    rows = [
        _row("Python and libraries", "", [spent(LIBRARIES) for _ in range(repeats)]),
        _row("--help", "", [spent((PROGRAM, "--help")) for _ in range(repeats)]),
    ]
    with tempfile.TemporaryDirectory(prefix="auvident-commands-") as name:
        for trial in trials:
            rows += _of_trial(trial, Path(name) / trial, repeats)
    return {"seconds of commands": rows}


def _of_trial(trial: str, run: Path, repeats: int) -> Rows:
    """The whole chain into a new run directory each time, then stages of it again."""
    log, vehicle = SAMPLES / trial, SAMPLES / f"{VEHICLES[trial]}.toml"
    whole = ("run", log, "--vehicle", vehicle, "--run", run)
    found: dict[str, list[Spent]] = {"run": [], **{stage: [] for stage in STAGES}}
    spent((PROGRAM, *whole))  # compiles
    for _ in range(repeats):
        shutil.rmtree(run)
        found["run"].append(spent((PROGRAM, *whole)))
    for stage in reversed(STAGES):  # the last first: what follows a stage is stale after it
        again = (log, "--vehicle", vehicle, "--run", run) if stage == "ingest" else (run,)
        found[stage] = [spent((PROGRAM, stage, *again)) for _ in range(repeats)]
    return [_row(command, trial, times) for command, times in found.items()]


def spent(command: Sequence[str | Path], environment: Mapping[str, str] = AS_A_USER) -> Spent:
    """Time of one command, with the processes that it starts.

    Raises
    ------
    subprocess.CalledProcessError
        When it ends with an error.
    """
    before, began = _of_children(), perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=environment)
    return Spent(perf_counter() - began, _of_children() - before)


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _row(command: str, trial: str, times: Sequence[Spent]) -> dict[str, Any]:
    walls = [t.wall_s for t in times]
    return {
        "command": command,
        "trial": trial,
        "wall_s": median(walls),
        "from": min(walls),
        "to": max(walls),
        "processor_s": median(t.processor_s for t in times),
    }
