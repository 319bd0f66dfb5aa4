"""The last lines of a command: the report, and what to do next, as a command to copy."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import RenderableType
from rich.text import Text

from auvident.schema.logs import Quality

if TYPE_CHECKING:
    from auvident.schema.diagnosis import Comparison

REPORT = "report/report.html"
ADDED = ("effect_found", "ambiguous", "partly_explained")  # verdicts with something to add
OPEN = ("partly_explained", "unexplained")  # ... that leave something without a cause
TO_ADD = "Next, add what was found and compare the held-out errors:"
TO_LOOK = "Next, see all of it on one page:"
TO_FIX = "Next, apply the correction and run again:"
TO_TAKE = "Next, try an unnamed force for what no effect explains:"
TO_FLY = "Next, see which maneuver would tell most about the coefficients:"


def after_diagnose(run: Path, verdicts: Sequence[str]) -> list[RenderableType]:
    """What follows on a diagnosis with these verdicts, one of each plane."""
    if any(verdict in ADDED for verdict in verdicts):
        return _next(TO_ADD, "refine", str(run))
    return _next(TO_LOOK, "report", str(run))


def after_refine(run: Path) -> list[RenderableType]:
    """What follows on a refinement."""
    return _next(TO_LOOK, "report", str(run))


def after_run(
    run: Path, comparisons: "Sequence[Comparison]", quality: Quality | None
) -> list[RenderableType]:
    """Where the report of a run is, and what follows."""
    report = [Text.assemble(("Report: ", "bold"), str(run / REPORT), no_wrap=True, overflow="fold")]
    trials = quality.trials if quality else ()
    contradicted = [c for t in trials for c in t.checks_made if c.outcome == "contradicts"]
    fixes = dict.fromkeys(check.name for check in contradicted if check.fix)
    if fixes:
        named = [word for name in fixes for word in ("--fix", name)]
        return [*report, *_next(TO_FIX, "run", "--run", str(run), *named)]
    if any(c.verdict in OPEN and c.unexplained_force is None for c in comparisons):
        return [*report, *_next(TO_TAKE, "refine", str(run), "--with-unexplained")]
    return [*report, *_next(TO_FLY, "plan-trial", str(run))]


def in_one_line(run: Path, told: "Sequence[tuple[str, Comparison | None]]") -> str:
    """What a quiet run leaves: the verdict of each plane in a sentence, and the report."""
    names = ["horizontal", *(plane for plane, _ in told[1:])] if len(told) > 1 else [""]
    sentences = [
        f"{name} plane: {_first_sentence(found.statement)}" if name else found.statement
        for name, (_, found) in zip(names, told, strict=False)
        if found is not None
    ]
    said = [_first_sentence(sentence) for sentence in sentences]
    text = " ".join(sentence[:1].upper() + sentence[1:] for sentence in said)
    return f"{text or 'No verdict.'} Report: {run / REPORT}"


def _first_sentence(text: str) -> str:
    return text.split(". ")[0].rstrip(".") + "."


def _next(why: str, *words: str) -> list[RenderableType]:
    """A command on a line of its own, which no line break takes apart."""
    line = Text(f"  {shlex.join(('auvident', *words))}", style="bold", no_wrap=True)
    line.overflow = "fold"
    return [Text(why), line]
