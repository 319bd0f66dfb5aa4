"""The outcome of a command as Markdown that fits the comment of a pull request.

Names and messages come from outside: nothing in them is markup, a link or a mention.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from auvident import __version__
from auvident.report.held_out_words import doubts_of
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import Finding
from auvident.schema.outcome import (
    ORDER,
    CommandOutcome,
    GateResult,
    HeldOutError,
    PlaneOutcome,
    severity,
)
from auvident.schema.quoting import clipped, comment
from auvident.schema.spin import share

ENDS = {
    0: "passed",
    1: "gate not met",
    2: "wrong usage",
    3: "unusable input",
    4: "an earlier stage is missing or stale",
    5: "numerical failure",
    6: "the run directory is in use",
}
BUG = "fault of the program"
LONGEST = 300  # characters of a sentence
MOST_FINDINGS, MOST_EFFECTS, MOST_GATES = 6, 4, 6
MARKUP = re.compile(r"([\\`*_{}\[\]()#+!|<>~&$])")
number = TERMINAL.number


def markdown(outcome: CommandOutcome) -> str:
    """The whole text, with an end of line."""
    blocks = [
        f"## {_name(outcome.command)}: {ENDS.get(outcome.exit_code, BUG)}",
        *_error(outcome),
        *_gates(outcome.gates),
        *(block for plane in outcome.planes for block in _plane(plane, outcome)),
        *(_side_by_side(table) for table in outcome.compared),
        *_checks(outcome),
        *_findings(outcome.findings),
        _last_line(outcome),
    ]
    return "\n\n".join(blocks) + "\n"


def escaped(text: str) -> str:
    """A sentence as Markdown shows it: one line, no markup, nobody mentioned."""
    flat = " ".join(clipped(text, LONGEST).split())
    text = MARKUP.sub(r"\\\1", comment(flat))
    return re.sub(r"@|:(?=//)|www(?=\.)", "\\g<0>\u2060", text)  # neither mention nor link


def _name(text: str) -> str:
    """A name or a command, as code."""
    flat = comment(" ".join(clipped(text, LONGEST).split())).replace("`", "'")
    return f"`{flat}`" if flat else ""


def _error(outcome: CommandOutcome) -> Iterator[str]:
    if outcome.problem and outcome.exit_code != 1:
        where = f"{_name(outcome.where)}: " if outcome.where else ""
        yield f"**{where}{escaped(outcome.problem)}** {escaped(outcome.remedy)}".rstrip()


def _gates(gates: Sequence[GateResult]) -> Iterator[str]:
    """What is not met, else that all are."""
    unmet = [g for g in gates if g.unmet]
    if unmet:
        lines = [f"- {_name(g.of)}{': ' if g.of else ''}{escaped(g.unmet)}" for g in unmet]
        yield _list(f"**{len(unmet)} of {len(gates)} gates not met**", lines, MOST_GATES)
    elif gates:
        yield f"All gates are met ({len(gates)})."


def _list(title: str, lines: Sequence[str], most: int) -> str:
    left = len(lines) - most
    more = [f"- and {left} more"] if left > 0 else []
    return "\n".join([title, "", *lines[:most], *more])


def _plane(plane: PlaneOutcome, outcome: CommandOutcome) -> Iterator[str]:
    heading = f"**{plane.plane.capitalize()} plane.**" if len(outcome.planes) > 1 else ""
    if heading or plane.statement:
        yield " ".join(part for part in (heading, escaped(plane.statement)) if part)
    if plane.effects:
        lines = [f"- {escaped(effect)}" for effect in plane.effects]
        yield _list("Effects in the model:", lines, MOST_EFFECTS)
    if plane.errors:
        yield _errors(plane, {g.channel: g.limit for g in outcome.gates})
    else:
        yield "Nothing is held out: the model is not tested on data that it has not seen."


def _errors(plane: PlaneOutcome, limits: Mapping[str, float | None]) -> str:
    """Errors by channel, each with its limit."""
    refined = any(e.refined is not None for e in plane.errors)
    limited = any(limits.get(e.channel) is not None for e in plane.errors)
    heads = ["RMSE, held out", "unit", "geometry", "identified"]
    heads += ["with effects"] * refined + ["NRMSE", "in 95 % band"] + ["limit"] * limited
    rows = [_row(e, limits.get(e.channel), refined, limited) for e in plane.errors]
    count = len(plane.maneuvers)
    names = ", ".join(_name(m) for m in plane.maneuvers[:MOST_GATES])
    more = f" and {count - MOST_GATES} more" if count > MOST_GATES else ""
    return f"{_table(heads, rows)}\n\nHeld out: {names}{more}."


def _row(e: HeldOutError, limit: float | None, refined: bool, limited: bool) -> list[str]:
    last = e.identified if e.refined is None else e.refined
    cells = [escaped(e.channel), escaped(e.unit), number(e.geometry), number(e.identified)]
    cells += [number(e.refined)] * refined
    cells += [
        number(share(e.channel, last, e.nrmse)),
        "" if e.covered is None else f"{100.0 * e.covered:.0f} %",
    ]
    met = limit is not None and last is not None and last <= limit
    shown = "" if limit is None else f"{limit:g}" if met else f"**{limit:g}, not met**"
    return cells + [shown] * limited


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [list(heads), [":--", *["--:"] * (len(heads) - 1)], *(list(row) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _side_by_side(table: Mapping[str, Any]) -> str:
    """Held-out errors of several runs, the baseline last."""
    names = [_name(run["run"]).replace("|", "\\|") for run in table["runs"]]
    rows = []
    for row in table["held_out"]:
        *own, last = row["rmse"]
        first = own[0] if own else None
        change = _change(first, last) if first is not None and last else ""
        cells = [escaped(row["channel"]), escaped(row["unit"]), *(number(x) for x in row["rmse"])]
        rows.append([*cells, change])
    heads = ["RMSE, held out", "unit", *names, "first against last"]
    note = "".join(f"\n\n{escaped(line)}" for line in doubts_of(table))
    plane = table["runs"][0]["plane"].capitalize()
    return f"**{plane} plane**\n\n{_table(heads, rows)}{note}"


def _change(new: float, old: float) -> str:
    """By how much an error is above or below another one, in whole percent of it."""
    percent = round(100.0 * (new / old - 1.0))
    return f"{percent:+d} %" if percent else "0 %"


def _checks(outcome: CommandOutcome) -> Iterator[str]:
    made = [case for case in outcome.cases if case.group == "checks"]
    against = [case for case in made if case.result == "failed"]
    if made:
        left = sum(case.result == "skipped" for case in made)
        title = f"Checks of the log: {len(made) - left - len(against)} agree, {left} untested"
        lines = [f"- {escaped(c.name)}: {escaped(c.message)}" for c in against]
        yield _list(f"{title}, **{len(against)} contradict**", lines, 3) if lines else f"{title}."


def _findings(findings: Sequence[Finding]) -> Iterator[str]:
    """The first findings that ask for something; how many others there are."""
    told = sorted((f for f in findings if severity(f) != "note"), key=_rank)
    notes = len(findings) - len(told)
    if told:
        of = f"Findings: {len(told)}" + (f", and {notes} notes" if notes else "")
        yield _list(of, [_finding(f) for f in told], MOST_FINDINGS)


def _rank(finding: Finding) -> int:
    return ORDER.index(severity(finding))


def _finding(finding: Finding) -> str:
    where = f"{_name(finding.where)}: " if finding.where else ""
    return f"- {severity(finding)}, {where}{escaped(finding.message)}"


def _last_line(outcome: CommandOutcome) -> str:
    pieces = [f"vehicle {_name(outcome.vehicle)}" if outcome.vehicle else ""]
    pieces += [f"report {_name(outcome.report)}" if outcome.report else ""]
    return "<sub>" + ", ".join(p for p in (*pieces, f"auvident {__version__}") if p) + "</sub>"
