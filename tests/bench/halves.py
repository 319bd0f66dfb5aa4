"""What the studies on drawn vehicles share: the halves of the seeds, options, what was measured."""

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

HALVES = ("tune", "report")  # even seeds, odd seeds


def seeds(first: int, count: int, half: str) -> list[int]:
    """The first `count` seeds of a half, from `first` on."""
    return [s for s in range(first, first + 2 * count + 1) if HALVES[s % 2] == half][:count]


def measured(found: Iterable[Mapping[str, Any]], half: str) -> str:
    """Which programs, how many trials, which seeds."""
    found = list(found)
    versions = ", ".join(f"`{v}`" for v in sorted({str(one.get("program")) for one in found}))
    numbers = [one["case"]["seed"] for one in found]
    parity = "even" if HALVES[0] == half else "odd"
    span = f"{parity} seeds between {min(numbers)} and {max(numbers)}"
    return f"Program {versions}; {len(numbers)} trials, {span}."


def options_of(name: str, description: str | None, count: int) -> argparse.ArgumentParser:
    """The options that every study has; `count` trials unless asked otherwise."""
    parser = argparse.ArgumentParser(prog=f"python -m tests.bench {name}", description=description)
    parser.add_argument("--first", type=int, default=0, help="seeds from here on")
    parser.add_argument("--count", type=int, default=count, help="number of trials")
    parser.add_argument("--half", choices=HALVES, default=HALVES[0], help="even or odd seeds")
    parser.add_argument("--resume", type=Path, help="file of outcomes; those in it are taken")
    parser.add_argument("--write", action="store_true", help="replace the section of the page")
    return parser
