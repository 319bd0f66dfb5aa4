"""Which evidence holds on vehicles never seen? ``python -m tests.bench evidence``.

Each trial of the population (`tests.bench.population`) is run to its first round of candidates,
for the best of which several kinds of evidence are measured. For each kind the threshold is
looked for that names nothing false in trials without a listed effect, and what is found with it.
Even seeds choose (``--half tune``), odd seeds report.
"""

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.bench.effects import ONE_THREAD, append, program, read_outcomes
from tests.bench.evidence_score import tables
from tests.bench.halves import measured, options_of, seeds
from tests.bench.written import write

Outcome = dict[str, Any]
Show = Callable[[str, list[dict[str, Any]]], None]
WRITTEN = "evidence"  # section of the page


def main(arguments: list[str], show: Show) -> None:
    """Sail, score and print."""
    options = _options(arguments)
    wanted = seeds(options.first, options.count, options.half)
    if options.score is not None:
        kept = read_outcomes(options.score)
    else:
        for name in ONE_THREAD:
            os.environ[name] = "1"
        kept = sail(wanted, options.resume)
    found = [kept[str(seed)] for seed in wanted if str(seed) in kept]
    told = tables(found)
    for title, rows in told.items():
        show(f"{title} ({options.half}, {len(found)} trials)", rows)
    if options.write and told:
        write(WRITTEN, measured(found, options.half), told)


def sail(wanted: list[int], resume: Path | None) -> dict[str, Outcome]:
    """Outcomes of all the trials wanted; those of this very program are not sailed again."""
    from tests.bench.evidence_trial import outcome

    version = program()
    kept = {} if resume is None else read_outcomes(resume)
    kept = {key: found for key, found in kept.items() if found.get("program") == version}
    missing = [seed for seed in wanted if str(seed) not in kept]
    for number, seed in enumerate(missing, 1):
        found = {**outcome(seed), "program": version}
        kept[str(seed)] = found
        if resume is not None:
            append(resume, found)
        best = ", ".join(f"{c['id']} {c['gain']:.0f}" for c in found.get("candidates", [])[:3])
        planted = "+".join(found["case"]["planted"]) or "none"
        said = (found.get("error") or best).strip().splitlines()[-1:]
        print(
            f"{number}/{len(missing)} {seed} [{planted}]: {said} ({found['seconds']:.0f} s)",
            file=sys.stderr,
        )
    return kept


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = options_of("evidence", __doc__, 60)
    parser.add_argument("--score", type=Path, help="sail nothing, score the outcomes in a file")
    return parser.parse_args(arguments)
