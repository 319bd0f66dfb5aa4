"""``python -m tests.bench [PART ...] [--seeds N] [--json] [--write]``; parts as `PARTS` has them.

With ``--write`` each part replaces its own section of docs/benchmarks.md. The studies on generated
trials (`STUDIES`) have options of their own: ``python -m tests.bench population --help``.
"""

import argparse
import importlib
import json
import sys
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.table import Table

STUDIES = (
    "damage",
    "effects",
    "population",
    "totals",
    "evidence",
    "geometry",
    "in_turn",
)  # with options of their own
OF_A_STUDY = (
    "population-vertical",
    "population-current_drift",
    "population-clean",
    "population-shown-single",
    "population-shown-pair-2-times-long",
    "season",
    "season-steady",
    "left-out-trials",
)  # sections besides the one of its name, or of what is a study of `SEASONS`
BY_HAND = ("casadi", "campaign-cost")  # what `make bench` leaves out: other libraries, or long
SEASONS = ("pool", "season", "cluster")  # as well; their results depend on what they were asked for
PARTS = (
    "samples",
    "loop",
    "tanker",
    "left-out",
    "splits",
    "band",
    "band-unstable",
    "recovery",
    "plans",
    "speed",
    "identify",
    "commands",
    "length",
    "day",
    "whole",
    "exports",
)
# What is said of the measurement, behind the version of the program.
HOW = {
    "recovery": "; {seeds} trials, seeds 0 to {last}",
    "speed": "; medians of {repeats} repetitions",
    "identify": "; processor time, medians of {repeats} repetitions once compiled",
    "commands": "; medians of {repeats} repetitions, two cores with no other work",
    "length": "; medians of {few} repetitions",
    "day": "; medians of {few} repetitions",
    "campaign-cost": "; season of the generator in which nothing happens, seed 0; processor time",
    "casadi": "; seconds of the processor, of auvident the median of {repeats} fits",
    "splits": "; the first clean trials of even seeds, five random splits each",
    "whole": "; models of the harbour trial and of the dive trial, joined",
    "exports": "; models of the harbour trial and of the dive trial",
    "band": "; the first 100 clean trials of odd seeds from 6601",
    "band-unstable": "; the first 120 of odd seeds from 23101 that do not keep their course",
}


def main(arguments: list[str] | None = None) -> None:
    """Run the parts asked for, all of them but the study of effects by default."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] and arguments[0] in (*STUDIES, *SEASONS):
        importlib.import_module(f"tests.bench.{arguments[0]}").main(arguments[1:], _print)
        return
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join((*PARTS, *BY_HAND)))
    parser.add_argument("--seeds", type=int, default=200, help="trials of the recovery study")
    parser.add_argument("--repeats", type=int, default=5, help="repetitions behind each median")
    parser.add_argument("--json", action="store_true", help="results as JSON on standard output")
    parser.add_argument("--write", action="store_true", help="replace sections of the page")
    options = parser.parse_args(arguments)
    known = (*PARTS, *BY_HAND)
    unknown = set(options.parts) - set(known)
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}; known: {', '.join(known)}")
    results = {}
    for part in options.parts or PARTS:
        print(f"{part} ...", file=sys.stderr)
        results[part] = _run(part, options.repeats, options.seeds)
        if not options.json:
            _show(part, results[part])
        if options.write:
            _write(part, results[part], options)
    if options.json:
        print(json.dumps(results, indent=2))


def _run(part: str, repeats: int, seeds: int) -> Any:
    from tests.bench import recovery, samples, speed
    from tests.bench.against_casadi import casadi
    from tests.bench.band import band, unstable
    from tests.bench.campaign_cost import campaign_cost
    from tests.bench.commands import commands
    from tests.bench.day import day
    from tests.bench.exports import exports
    from tests.bench.left_out import left_out
    from tests.bench.length import length
    from tests.bench.splits import splits
    from tests.bench.whole import whole

    work: dict[str, Callable[[], Any]] = {
        "samples": lambda: {"held-out errors": samples.held_out()},
        "loop": samples.loop,
        "tanker": lambda: samples.tanker(),
        "speed": lambda: {"one pass": speed.passes(repeats)},
        "identify": lambda: {
            "identification": speed.whole(repeats),
            "both planes": speed.both_planes(repeats),
            "memory": speed.memory(),
        },
        "commands": lambda: commands(repeats),
        "recovery": lambda: recovery.recovery(seeds),
        "plans": lambda: {"held-out errors": speed.plans()},
        "left-out": lambda: {"each zigzag of the KVLCC2 from the others": left_out()},
        "splits": splits,
        "band": band,
        "band-unstable": unstable,
        "whole": whole,
        "exports": exports,
        "casadi": lambda: casadi(repeats),
        "campaign-cost": campaign_cost,
        "day": lambda: day(min(repeats, 3)),
        "length": lambda: length(min(repeats, 3)),
    }
    return work[part]()


def _show(part: str, result: dict[str, Any]) -> None:
    """Tables of one part."""
    if part != "recovery":
        for title, rows in result.items():
            _print(title, rows)
        return
    for case, scores in result.items():
        for claim in ("claimed", "filter_own"):
            rows = [{"name": name, **row} for name, row in scores[claim].items()]
            _print(f"{case}: error over std ({claim}), {scores['failed']} failed", rows)


def _write(part: str, result: dict[str, Any], options: argparse.Namespace) -> None:
    """The section of one part, unless it had nothing to measure."""
    from tests.bench import recovery, written
    from tests.bench.effects import program

    if part == "recovery":
        result = {"errors over claimed standard deviations": recovery.in_short(result)}
    if not all(result.values()):
        print(f"{part}: nothing was measured, its section stays as it is", file=sys.stderr)
        return
    how = HOW.get(part, "").format(
        seeds=options.seeds,
        last=options.seeds - 1,
        repeats=options.repeats,
        few=min(options.repeats, 3),
    )
    written.write(part, f"Program `{program(whole=True)}`{how}.", result)


def _print(title: str, rows: list[dict[str, Any]]) -> None:
    if not rows:
        print(f"{title}: nothing was measured")
        return
    table = Table(title=title, title_justify="left")
    for place, column in enumerate(rows[0]):
        table.add_column(column.replace("_", " "), no_wrap=place == 0)
    for row in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
