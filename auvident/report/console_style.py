"""House style of the console: tables and lines of findings."""

from collections.abc import Sequence
from typing import IO

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from auvident.report import tables
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import Finding

MOST_PLACES = 6  # places named of a finding that several share
MOST_FINDINGS = 12  # lines of findings a stage; the artifact has all of them


def console_for(stream: IO[str], width: int | None = None) -> Console:
    """A console that shows text as it is: names of the user are no markup and no emoji.

    Parameters
    ----------
    stream : text stream
    width : int, optional
        Columns; by default those of the terminal.
    """
    return Console(file=stream, width=width, markup=False, emoji=False, highlight=False)


def house_table(title: str, left: Sequence[str] = (), right: Sequence[str] = ()) -> Table:
    """The house style: no vertical rules, title on the left, numbers on the right."""
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in left:
        table.add_column(name)
    for name in right:
        table.add_column(name, justify="right")
    return table


def rich_table(table: tables.Table) -> Table:
    """A table of the report in the house style."""
    text = tables.written(table, TERMINAL)
    shown = house_table(text.title)
    for head, numeric in zip(text.heads, text.numeric, strict=True):
        shown.add_column(head, justify="right" if numeric else "left")
    for row, marked in zip(text.rows, text.marked, strict=True):
        shown.add_row(*row, style="cyan" if marked else "")
    shown.caption, shown.caption_justify = text.caption or None, "left"
    return shown


def findings_lines(findings: Sequence[Finding]) -> list[RenderableType]:
    """The first findings, the same of several places as one, and how many more there are."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.code, finding.message), []).append(finding)
    lines: list[RenderableType] = []
    for same in list(groups.values())[:MOST_FINDINGS]:
        if len(same) > 1:
            places = list(dict.fromkeys(finding.where for finding in same))
            more = [f"{len(places) - MOST_PLACES} more"] if len(places) > MOST_PLACES else []
            where = ", ".join(places[:MOST_PLACES] + more)
            first = same[0].model_copy(update={"where": where, "value": None})
            lines.append(finding_line(first))
        else:
            lines.append(finding_line(same[0]))
    if len(groups) > MOST_FINDINGS:
        lines.append(Text(f"... and {len(groups) - MOST_FINDINGS} more findings", style="dim"))
    return lines


def finding_line(finding: Finding) -> Text:
    """One finding with its place and remedy."""
    text = Text(f"{finding.where}: " if finding.where else "", style="yellow")
    text.append(finding.message, style="default")
    if finding.value is not None and finding.threshold is not None:
        text.append(f" ({finding.value:.3g}, limit {finding.threshold:.3g})")
    if finding.remedy:
        stop = "" if text.plain.endswith(".") else "."
        text.append(f"{stop} {finding.remedy}", style="dim")
    return text
