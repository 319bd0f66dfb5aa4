"""Does the residual loop name what was planted? ``python -m tests.bench effects [...]``.

Trials come from the independent generator of the sample logs, with sizes drawn at random; the
program's stages run as ``auvident run`` calls them. Outcomes are kept line by line in a file, so
that an interrupted study can be taken up again and scored anew.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from auvident.pipeline.campaign_trial import STARTED_BY, end_with_starter
from tests.bench.effects_cases import (
    DEVELOPMENT,
    KINDS,
    LATER,
    OUTSIDE,
    PAIRS,
    REPORTED,
    SINGLES,
    VEHICLES,
    Case,
)
from tests.bench.effects_cases import cases as listed
from tests.bench.effects_score import score
from tests.bench.effects_summary import CHANCE, as_json, is_good, tables
from tests.bench.written import write
from tests.engines.chain import SAMPLES

ONE_THREAD = ("AUVIDENT_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
LABELS = frozenset((*SINGLES, *LATER, *OUTSIDE, *("+".join(p) for p in PAIRS), "none", *KINDS))
GENERATOR = "generator"  # in place of a stage, where a trial could not be made
SHOWN = ("api", "cli", "report")  # packages that show artifacts and make none
WRITTEN = "effects"  # section of the page, and its tables in order
SECTION = ("bars", CHANCE, "by planted effect", "planted against named", "costs")

Item = TypeVar("Item")
Outcome = dict[str, Any]
Show = Callable[[str, list[dict[str, Any]]], None]


def main(arguments: list[str], show: Show) -> None:
    """Sail, score and print."""
    options = _options(arguments)
    wanted = listed(options.seed_base, options.trials, options.only, options.vehicle)
    if options.score is not None:
        kept = read_outcomes(options.score)
    else:
        kept = sail(wanted, options.workers, options.resume)
    scores = [score(kept[case.key]) for case in wanted if case.key in kept]
    if options.json is not None:
        options.json.write_text(as_json(scores), encoding="utf-8")
    for title, rows in tables(scores).items() if scores else ():
        show(title, rows)
    if options.write and scores:
        write(WRITTEN, measured(wanted, kept), {t: tables(scores)[t] for t in SECTION})


def measured(wanted: list[Case], kept: dict[str, Outcome]) -> str:
    """What the section says of the study: program, number of trials, seeds."""
    found = [kept[case.key] for case in wanted if case.key in kept]
    versions = sorted({outcome.get("program", "unknown") for outcome in found})
    seeds = [case.seed for case in wanted]
    number = f"{len(found)} of {len(wanted)}" if len(found) < len(wanted) else str(len(found))
    listed = ", ".join(f"`{version}`" for version in versions)
    return f"Program {listed}; {number} trials, seeds {min(seeds)} to {max(seeds)}."


def sail(wanted: list[Case], workers: int, resume: Path | None) -> dict[str, Outcome]:
    """Outcomes of all the trials wanted; those of this very program are not sailed again."""
    kept, version = {} if resume is None else read_outcomes(resume), program()
    kept = {key: found for key, found in kept.items() if found.get("program") == version}
    missing = [case for case in wanted if case.key not in kept]
    started = perf_counter()
    for number, found in enumerate(side_by_side(outcome_of, missing, workers), 1):
        kept[found["case"]["key"]] = found = {**found, "program": version}
        if resume is not None:
            append(resume, found)
        pace = (perf_counter() - started) / number
        _tell(found, f"{number}/{len(missing)}", pace * (len(missing) - number))
    return kept


def program(whole: bool = False, root: Path = SAMPLES.parent) -> str:
    """Hash of everything that an outcome hangs on: the program and the generator.

    What people see of artifacts is no part of it: no stage may use it (`test_architecture`). With
    `whole` it is, as for times of commands.
    """
    digest = sha256()
    for folder in ("auvident", "sample_logs"):
        for path in sorted(p for s in ("py", "toml") for p in (root / folder).rglob(f"*.{s}")):
            if whole or path.relative_to(root).parts[1] not in SHOWN:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench effects", description=__doc__)
    for name, (kind, default, words) in OPTIONS.items():
        parser.add_argument(name, type=kind, default=default, help=words)
    parser.add_argument("--write", action="store_true", help="replace the section of the page")
    return parser.parse_args(arguments)


def _some_of(known: Iterable[str]) -> Callable[[str], tuple[str, ...]]:
    """Reader of a list with commas."""

    def names(text: str) -> tuple[str, ...]:
        unknown = sorted(set(text.split(",")) - set(known))
        if unknown:
            raise argparse.ArgumentTypeError(f"no such thing: {', '.join(unknown)}")
        return tuple(text.split(","))

    return names


OPTIONS: dict[str, tuple[Callable[[str], Any], Any, str]] = {
    "--trials": (int, None, "the first so many of the list; 204 without it"),
    "--seed-base": (int, DEVELOPMENT, f"{DEVELOPMENT} to develop (default), {REPORTED} to report"),
    "--workers": (int, 2, "trials at a time"),
    "--only": (_some_of(LABELS), (), f"effects, pairs as ID+ID, or kinds: {', '.join(KINDS)}"),
    "--vehicle": (_some_of(VEHICLES), VEHICLES, ", ".join(VEHICLES)),
    "--resume": (Path, None, "outcomes line by line; those of the same program are taken from it"),
    "--score": (Path, None, "sail nothing, score the outcomes in such a file, of any program"),
    "--json": (Path, None, "file for the tables and the failed trials"),
}


def side_by_side(
    outcome: Callable[[Item], Outcome], items: Iterable[Item], workers: int
) -> Iterator[Outcome]:
    """What the program says of each trial, as they come in; one thread a worker."""
    for name in ONE_THREAD:
        os.environ[name] = "1"
    with processes(workers) as pool:
        pending = [pool.submit(outcome, item) for item in items]
        try:
            for done in as_completed(pending):
                yield done.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def processes(workers: int) -> ProcessPoolExecutor:
    """Workers that end with this process, also if it is killed (on Linux)."""
    os.environ[STARTED_BY] = str(os.getpid())
    return ProcessPoolExecutor(workers, get_context("spawn"), initializer=end_with_starter)


def outcome_of(case: Case) -> Outcome:
    """One trial, in a worker."""
    from tests.bench.effects_trial import outcome

    return outcome(case)


def read_outcomes(path: Path, with_bugs: bool = False) -> dict[str, Outcome]:
    """Outcomes kept in a file; a line cut short and a trial that met a bug are sailed again.

    With `with_bugs` a trial that met one is an outcome.
    """
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            outcome = json.loads(line)
        except json.JSONDecodeError:
            continue
        met_a_bug = (outcome.get("error") or "").startswith("Traceback")
        if with_bugs or not met_a_bug:
            found[outcome["case"]["key"]] = outcome
    return found


def append(path: Path, outcome: Outcome) -> None:
    """Add one line, after whatever was cut short."""
    whole = not path.exists() or path.read_bytes()[-1:] in (b"", b"\n")
    with path.open("a", encoding="utf-8") as stream:
        stream.write(("" if whole else "\n") + json.dumps(outcome) + "\n")


def _tell(outcome: Outcome, number: str, left_s: float) -> None:
    """One line about a trial that is done."""
    found = score(outcome)
    took = sum(found.seconds.get(stage, 0.0) for stage in ("diagnose", "refine"))
    print(
        f"{number} {'good' if is_good(found) else 'BAD '} {found.key}: {found.verdict} "
        f"{' '.join(found.named)} ({took:.0f} s; {left_s / 60:.0f} min left)",
        file=sys.stderr,
    )
