"""What becomes of damaged logs? ``python -m tests.bench damage [...]``.

Clean trials of drawn vehicles (even seeds to develop, odd ones to report) are damaged by the rows
of `sample_logs/seatrial/damage`, one at a time or four together, and go through the chain. The
evidence is kept line by line; ``--score FILE`` judges it anew, for instance with more patterns in
`tests/bench/damage_names.py`.
"""

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict
from fnmatch import fnmatch
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from tests.bench import damage_page
from tests.bench.damage_score import REFUSED, Row, false_alarms, judge
from tests.bench.damage_trial import AS_DRAWN, CLEAN, outcome
from tests.bench.effects import ONE_THREAD, append, processes, program
from tests.bench.effects_trial import WANTED
from tests.bench.halves import HALVES, measured, seeds

JUDGED = WANTED[WANTED.index("validate") :]  # there is nothing to compare before
Job = tuple[int, tuple[str, ...], str]
Kept = dict[str, dict[str, Any]]
Show = Callable[[str, list[dict[str, Any]]], None]


def main(arguments: list[str], show: Show) -> None:
    """Damage, run, judge and print."""
    options = _options(arguments)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    jobs = [*wanted(options), *clean_ones(options)]
    kept = evidence_in(options.score) if options.score else sail(jobs, options)
    kept = {key_of(job): kept[key_of(job)] for job in jobs if key_of(job) in kept}
    kept |= evidence_in(options.also) if options.also else {}
    rows, clean = judged(kept), alarms(kept)
    tables = damage_page.tables(rows) | {"said of clean logs": clean}
    for title in ("by family", "not well", "said of clean logs"):
        if tables[title]:
            show(f"{title} ({len(rows)} trials)" if rows else title, tables[title])
    if options.json is not None:
        found = {"rows": [asdict(row) for row in rows], **tables}
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    if options.write:
        damage_page.write(rows, clean, studied_as(list(kept.values())))


def studied_as(found: list[dict[str, Any]]) -> str:
    """Which programs, trials and seeds of each half, and what was done to each vehicle."""
    clean = [e for e in found if e["case"]["damage"] == [AS_DRAWN]]
    damaged = [e for e in found if e["case"]["damage"] != [AS_DRAWN]]
    seeds_seen = dict.fromkeys(e["case"]["seed"] for e in damaged)
    told = [*_by_half(damaged), *(_done_to(seed, damaged) for seed in seeds_seen)]
    return " ".join([*told, *(f"Clean logs: {words}" for words in _by_half(clean))])


def _by_half(found: list[dict[str, Any]]) -> list[str]:
    """Programs, trials and seeds of the halves that there are."""
    halves = [[e for e in found if e["case"]["seed"] % 2 == k] for k in range(len(HALVES))]
    return [measured(some, half) for some, half in zip(halves, HALVES, strict=True) if some]


def _done_to(seed: int, found: list[dict[str, Any]]) -> str:
    """Families of the kinds that one vehicle had, with their counts."""
    from seatrial.damage import CASES

    cases = [e["case"]["damage"] for e in found if e["case"]["seed"] == seed]
    families = Counter(CASES[names[0]].kind.family for names in cases if names[0] in CASES)
    return f"Seed {seed}: " + ", ".join(f"{name} {n}" for name, n in families.items()) + "."


def wanted(options: argparse.Namespace) -> list[Job]:
    """The clean trial of every vehicle and the damaged ones."""
    numbers = options.seeds or seeds(options.first, options.vehicles, options.half)
    names = chosen(options.kinds, options.sizes == "all")
    jobs: list[Job] = []
    for seed in numbers:
        together = fours(names, options.fours, seed)
        sets = [(CLEAN,), *(() if options.fours_alone else ((n,) for n in names)), *together]
        jobs += [(seed, found, options.until) for found in sets]
    return jobs


def clean_ones(options: argparse.Namespace) -> list[Job]:
    """Clean trials with the sensors that were drawn, as far as the ingest."""
    numbers = seeds(options.first, options.clean, options.half)
    return [(seed, (AS_DRAWN,), "ingest") for seed in numbers]


def chosen(patterns: Iterable[str], all_sizes: bool) -> list[str]:
    """Cases by kind, case or family; of every kind the first size, or all of them."""
    from seatrial.damage import KINDS

    cases = [c for kind in KINDS for c in (kind.cases() if all_sizes else kind.cases()[:1])]
    known = [c for kind in KINDS for c in kind.cases()]
    patterns = list(patterns)
    if not patterns:
        return [case.id for case in cases]
    named = [c for c in known if any(fnmatch(c.id, p) for p in patterns if ":" in p)]
    plain = [p for p in patterns if ":" not in p]
    more = [
        c for c in cases if any(fnmatch(w, p) for w in (c.kind.id, c.kind.family) for p in plain)
    ]
    if not named and not more:
        raise SystemExit(f"no kind of damage is named {', '.join(patterns)}")
    return list(dict.fromkeys(c.id for c in (*more, *named)))


def fours(names: list[str], number: int, seed: int) -> list[tuple[str, ...]]:
    """Sets of four kinds that hit what a set before has not changed beyond recognition.

    Text and files come last, as the others need a log as it was written.
    """
    from seatrial.damage import CASES

    last = ("text format", "files", "vehicle file", "map")
    early = [n for n in names if CASES[n].kind.family not in last]
    late = [n for n in names if CASES[n].kind.family in last]
    rng, found = np.random.default_rng(seed), []
    for _ in range(number):
        three = [str(n) for n in rng.choice(early, 3, replace=False)]
        found.append((*three, str(rng.choice(late))))
    return found


def sail(jobs: list[Job], options: argparse.Namespace) -> Kept:
    """Evidence of all the trials; those of this very program are not run again."""
    version = program()
    kept = {} if options.resume is None else evidence_in(options.resume)
    kept = {key: found for key, found in kept.items() if found.get("program") == version}
    missing = [job for job in jobs if key_of(job) not in kept]
    began = perf_counter()
    for number, found in enumerate(outcomes(missing, options.workers), 1):
        kept[found["case"]["key"]] = found = {**found, "program": version}
        if options.resume is not None:
            append(options.resume, found)
        left = (perf_counter() - began) / number * (len(missing) - number) / 60.0
        _tell(found, kept, f"{number}/{len(missing)}", left)
    return kept


def evidence_in(path: Path) -> Kept:
    """Evidence kept in a file, bugs among it; a line cut short is passed over."""
    found: Kept = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        with suppress(json.JSONDecodeError):
            evidence = json.loads(line)
            found[evidence["case"]["key"]] = evidence
    return found


def outcomes(jobs: list[Job], workers: int) -> Iterator[dict[str, Any]]:
    """Evidence as it comes in; with one worker in this process."""
    if workers < 2:
        yield from map(outcome_of, jobs)
        return
    with processes(workers) as pool:
        yield from pool.map(outcome_of, jobs)


def outcome_of(job: Job) -> dict[str, Any]:
    """One trial."""
    seed, names, until = job
    return outcome(seed, names, until)


def key_of(job: Job) -> str:
    """Name of a trial in the file of evidence."""
    seed, names, _ = job
    return f"{seed}/{'+'.join(names)}"


def judged(kept: Kept) -> list[Row]:
    """Outcome of every damaged trial whose clean one is known, and could be identified."""
    return [row for found in kept.values() if (row := judged_one(found, kept)) is not None]


def judged_one(found: dict[str, Any], kept: Kept) -> Row | None:
    """Outcome of one trial; None for a clean one, and where there is nothing to compare with."""
    from seatrial.damage import CASES

    case = found["case"]
    clean = kept.get(f"{case['seed']}/{CLEAN}")
    if case["damage"] in ([CLEAN], [AS_DRAWN]) or clean is None or clean.get("error"):
        return None
    if found.get("stage") == "generator":  # kinds that cannot be done to one log together
        return None
    return judge(found, clean, [CASES[name] for name in case["damage"]])


def alarms(kept: Kept) -> list[dict[str, Any]]:
    """What is said of clean logs: how many have any false alarm, how many are refused, by code."""
    drawn = [e for e in kept.values() if e["case"]["damage"] == [AS_DRAWN]]
    clean = [e for e in drawn if e.get("stage") != "generator"]
    found = {e["case"]["seed"]: false_alarms(e) for e in clean}
    groups = {"any": [seed for seed, codes in found.items() if codes]}
    groups[REFUSED] = [e["case"]["seed"] for e in clean if e.get("error")]
    for code in sorted({code for codes in found.values() for code in codes} - {REFUSED}):
        groups[code] = [seed for seed, codes in found.items() if code in codes]
    rows = [
        {"code": code, "n": len(some), "of": len(clean), "seeds": " ".join(map(str, some))}
        for code, some in groups.items()
    ]
    return rows if clean else []


def _tell(found: dict[str, Any], kept: Kept, number: str, left_min: float) -> None:
    """One line about a trial that is done."""
    row = judged_one(found, kept)
    words = f"{row.outcome:9} {row.key}: {' '.join(row.named)}" if row else found["case"]["key"]
    print(
        f"{number} {words} ({found.get('took_s', 0)} s; {left_min:.0f} min left)", file=sys.stderr
    )


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.bench damage", description=__doc__)
    parser.add_argument("--vehicles", type=int, default=3, help="how many, from --first on")
    parser.add_argument("--first", type=int, default=0, help="seeds from here on")
    parser.add_argument("--half", choices=HALVES, default=HALVES[0], help="even or odd seeds")
    parser.add_argument("--seeds", type=_numbers, help="these instead, with commas")
    parser.add_argument("--kinds", type=_names, default=(), help="kinds, cases or families")
    parser.add_argument("--sizes", choices=("first", "all"), default="all", help="of every kind")
    parser.add_argument("--fours", type=int, default=0, help="sets of four kinds a vehicle")
    parser.add_argument("--fours-alone", action="store_true", help="no kind by itself")
    parser.add_argument("--until", choices=JUDGED, default="validate", help="the last stage")
    parser.add_argument("--clean", type=int, default=0, help="false alarms, on so many clean logs")
    parser.add_argument("--workers", type=int, default=1, help="trials at a time")
    parser.add_argument("--resume", type=Path, help="file of evidence; what is in it is taken")
    parser.add_argument("--score", type=Path, help="run nothing, judge the evidence in a file")
    parser.add_argument("--also", type=Path, help="evidence kept of other vehicles, put beside")
    parser.add_argument("--json", type=Path, help="file for the outcomes and tables")
    parser.add_argument("--write", action="store_true", help="write docs/damaged-logs.md")
    return parser.parse_args(arguments)


def _numbers(text: str) -> list[int]:
    """Seeds of one half: what is tuned on is not reported."""
    found = [int(n) for n in text.split(",")]
    if len({n % 2 for n in found}) > 1:
        raise argparse.ArgumentTypeError("even and odd seeds together")
    return found


def _names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))
