"""How does the program do on vehicles it has never seen? ``python -m tests.bench population``.

Every seed is another vehicle, with its own equipment, programme and vehicle file
(`sample_logs/seatrial/population`). Even seeds choose thresholds, odd seeds report: ``--half tune``
(the default) sails the even ones and lists single trials with their seeds, ``--half report`` sails
the odd ones and tells rates alone, so that nobody can tune to what is reported.
"""

import argparse
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from tests.bench import written
from tests.bench.effects import GENERATOR, append, program, read_outcomes, side_by_side
from tests.bench.halves import measured, options_of, seeds
from tests.bench.population_bars import bars
from tests.bench.population_healthy import healthy_tables
from tests.bench.population_score import is_wrong, scored, tables
from tests.bench.population_trial import CHANNELS, PASSED, WANTED, key_of, outcome

SHOWN = "only trials of this kind in which what is planted shows by the generator's rule"

Outcome = dict[str, Any]
Show = Callable[[str, list[dict[str, Any]]], None]


def main(arguments: list[str], show: Show) -> None:
    """Sail, score and print."""
    from seatrial.population import CLASSES

    options = _options(arguments)
    wanted = seeds(options.first, options.count, options.half)
    short, plane = not options.long, options.plane
    planted = () if options.clean else tuple(options.planted) or None
    shown = tuple(options.shown)
    ways = {"short": short, "until": options.until, "plane": plane}
    ways |= {"planted": planted, "shown": shown, "times": options.times}
    if options.score is not None:
        kept = read_outcomes(options.score, with_bugs=True)
    else:
        kept = sail(wanted, partial(outcome, **ways), options.workers, options.resume)
    keys = [key_of(seed, **ways) for seed in wanted]
    keys = [key for key in keys if key in kept and kept[key].get("stage") != PASSED]
    scores = [scored(kept[key]) for key in keys]
    trials = [s for s in scores if s.failed_at != GENERATOR]
    whole = options.until == WANTED[-1]
    found = {"bars": bars(trials)} if whole else {}
    found |= healthy_tables(trials) if options.clean else {}
    found |= tables(scores, CLASSES, with_seeds=options.half == "tune", whole=whole)
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    for title, rows in found.items():
        if rows:
            show(f"{title} ({options.half}, {len(trials)} trials)", rows)
    if options.write:
        every = [kept[key] for key in keys]
        done = [one for one in every if one.get("stage") != GENERATOR]
        parts = ["population", *([plane] if plane != "horizontal" else []), *options.planted]
        parts += ["clean"] * options.clean + [f"shown-{kind}" for kind in shown]
        parts += [f"{options.times:g}-times"] * (options.times != 1.0) + ["long"] * options.long
        written.write("-".join(parts), measured(done, options.half), without_empty(found))


def without_empty(found: dict[str, Any]) -> dict[str, Any]:
    """Tables that have rows."""
    return {title: rows for title, rows in found.items() if rows}


def sail(
    wanted: list[int], outcome: partial[Outcome], workers: int, resume: Path | None
) -> dict[str, Outcome]:
    """Outcomes of all the trials wanted; those of this very program are not sailed again."""
    version = program()
    kept = {} if resume is None else read_outcomes(resume)
    kept = {key: found for key, found in kept.items() if found.get("program") == version}
    missing = [seed for seed in wanted if key_of(seed, **outcome.keywords) not in kept]
    began = perf_counter()
    for number, found in enumerate(side_by_side(outcome, missing, workers), 1):
        kept[found["case"]["key"]] = found = {**found, "program": version}
        if resume is not None:
            append(resume, found)
        pace = (perf_counter() - began) / number
        _tell(found, f"{number}/{len(missing)}", pace * (len(missing) - number))
    return kept


def _tell(found: Outcome, number: str, left_s: float) -> None:
    """One line about a trial that is done."""
    if found.get("stage") == PASSED:
        return
    s = scored(found)
    whole = found.get("comparison") is not None
    said = f"{s.loop.verdict} {' '.join(s.loop.named)}" if whole else ""
    said = s.error if s.failed_at else said
    said += f" missed: {' '.join(m['kind'] for m in s.missed)}" * bool(s.missed)
    mark = "look" if s.failed_at or s.missed or (whole and is_wrong(s)) else "good"
    planted = s.loop.label
    left = f"{left_s / 60:.0f} min left"
    print(f"{number} {mark} {s.seed} [{planted}]: {said} ({left})", file=sys.stderr)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = options_of("population", __doc__, 30)
    parser.add_argument("--workers", type=int, default=2, help="trials at a time")
    parser.add_argument("--until", choices=WANTED, default=WANTED[-1], help="the last stage")
    parser.add_argument("--plane", choices=CHANNELS, default="horizontal", help="of the maneuvers")
    parser.add_argument("--planted", nargs="+", default=[], help="effects, in place of drawn ones")
    parser.add_argument("--clean", action="store_true", help="nothing is planted in any of them")
    parser.add_argument("--shown", nargs="+", default=[], choices=("single", "pair"), help=SHOWN)
    parser.add_argument("--times", type=float, default=1.0, help="size of what is planted")
    parser.add_argument("--long", action="store_true", help="logs of 10 to 60 minutes")
    parser.add_argument("--score", type=Path, help="sail nothing, score the outcomes in a file")
    parser.add_argument("--json", type=Path, help="file for the tables")
    return parser.parse_args(arguments)
