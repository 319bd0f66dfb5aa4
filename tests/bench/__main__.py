"""``python -m tests.bench [PART ...] [--seeds N] [--json]``; parts as `PARTS` has them.

The study of the residual loop has options of its own: ``python -m tests.bench effects --help``.
"""

import argparse
import json
import sys
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.table import Table

PARTS = ("speed", "identify", "recovery", "plans", "length", "left-out")


def main(arguments: list[str] | None = None) -> None:
    """Run the parts asked for, all of them but the study of effects by default."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["effects"]:
        from tests.bench import effects

        effects.main(arguments[1:], _print)
        return
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--seeds", type=int, default=200, help="trials of the recovery study")
    parser.add_argument("--repeats", type=int, default=5, help="repetitions behind each median")
    parser.add_argument("--json", action="store_true", help="results as JSON on standard output")
    options = parser.parse_args(arguments)
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}; known: {', '.join(PARTS)}")
    results = {}
    for part in options.parts or PARTS:
        print(f"{part} ...", file=sys.stderr)
        results[part] = _run(part, options.repeats, options.seeds)
        if not options.json:
            _show(part, results[part])
    if options.json:
        print(json.dumps(results, indent=2))


def _run(part: str, repeats: int, seeds: int) -> Any:
    from tests.bench import recovery, speed
    from tests.bench.left_out import left_out
    from tests.bench.length import length

    work: dict[str, Callable[[], Any]] = {
        "speed": lambda: {"one pass": speed.passes(repeats)},
        "identify": lambda: {"identification": speed.whole(repeats), "memory": speed.memory()},
        "recovery": lambda: recovery.recovery(seeds),
        "plans": lambda: {"held-out errors": speed.plans()},
        "left-out": lambda: {"each zigzag of the KVLCC2 from the others": left_out()},
        "length": lambda: {"diagnosis by length of the log": length(min(repeats, 3))},
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


def _print(title: str, rows: list[dict[str, Any]]) -> None:
    if not rows:
        print(f"{title}: the logs are not at hand")
        return
    table = Table(title=title, title_justify="left")
    for place, column in enumerate(rows[0]):
        table.add_column(column.replace("_", " "), no_wrap=place == 0)
    for row in rows:
        table.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
