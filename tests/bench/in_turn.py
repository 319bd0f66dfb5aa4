"""Whole commands by this program and by another version in turn: which share of the time it takes.

``python -m tests.bench in_turn FOLDER``, with a checkout of the other version (``git worktree add
FOLDER COMMIT``). A machine is a third slower in one hour than in the next; two programs that take
turns are as fast as they are. Both are run by this Python with its libraries, and have compiled
before.
"""

import argparse
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tests.bench import written
from tests.bench.commands import AS_A_USER, STAGES, VEHICLES, Spent, spent
from tests.bench.effects import program
from tests.command_line import ROOT

OTHER, OWN = "other", "own"
Rows = list[dict[str, Any]]


def main(arguments: list[str], show: Callable[[str, Rows], None]) -> None:
    """Time both programs; with ``--write`` replace the section of the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench in_turn", description=__doc__)
    parser.add_argument("folder", type=Path, help="checkout of the other version")
    parser.add_argument("--repeats", type=int, default=5, help="pairs behind each median")
    parser.add_argument("--write", action="store_true", help="replace the section of the page")
    options = parser.parse_args(arguments)
    other = options.folder.resolve()
    rows = in_turn({OTHER: other, OWN: ROOT}, options.repeats)
    show("commands in turn", rows)
    if options.write:
        programs = f"Program `{program(whole=True)}` and, before it, `{program(True, other)}`"
        how = f"{programs}; medians of {options.repeats} pairs, two cores with no other work."
        written.write("in_turn", how, {"commands in turn": rows})


def in_turn(
    programs: Mapping[str, Path], repeats: int, trials: Sequence[str] = tuple(VEHICLES)
) -> Rows:
    """Seconds of each command by both programs, and shares pair by pair."""
    with tempfile.TemporaryDirectory(prefix="auvident-in-turn-") as name:
        return [row for trial in trials for row in _of_trial(trial, Path(name), programs, repeats)]


def _of_trial(trial: str, place: Path, programs: Mapping[str, Path], repeats: int) -> Rows:
    def whole(which: str) -> Spent:
        logs, run = programs[which] / "sample_logs", place / which / trial
        shutil.rmtree(run, ignore_errors=True)
        vehicle = logs / f"{VEHICLES[trial]}.toml"
        return _spent(programs[which], "run", logs / trial, "--vehicle", vehicle, "--run", run)

    def stage(name: str) -> Callable[[str], Spent]:
        return lambda which: _spent(programs[which], name, place / which / trial)

    rows = [_row("run", trial, _pairs(whole, repeats))]
    for name in reversed(STAGES[1:]):  # the last first: what follows a stage is stale after it
        rows.append(_row(name, trial, _pairs(stage(name), repeats)))
    return rows


def _spent(root: Path, *command: str | Path) -> Spent:
    """Time of a command of the program in a folder, from where there is no other one."""
    there = {**AS_A_USER, "PYTHONPATH": str(root)}
    return spent((sys.executable, "-P", "-m", "auvident", *command), there)


def _pairs(work: Callable[[str], Spent], repeats: int) -> list[dict[str, Spent]]:
    """What both take, the one that begins taking turns as well; the first pair compiles."""
    pairs = [
        {which: work(which) for which in ((OTHER, OWN), (OWN, OTHER))[k % 2]}
        for k in range(repeats + 1)
    ]
    return pairs[1:]


def _row(command: str, trial: str, pairs: list[dict[str, Spent]]) -> dict[str, Any]:
    shares = [pair[OWN].wall_s / pair[OTHER].wall_s for pair in pairs]
    return {
        "command": command,
        "trial": trial,
        "before s": median(pair[OTHER].wall_s for pair in pairs),
        "now s": median(pair[OWN].wall_s for pair in pairs),
        "share": median(shares),
        "from": min(shares),
        "to": max(shares),
        "share of processor s": median(
            pair[OWN].processor_s / pair[OTHER].processor_s for pair in pairs
        ),
    }
