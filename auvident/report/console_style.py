"""House style of the console: tables and lines of findings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any, Literal

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderHook, RenderResult
from rich.control import Control
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from auvident.report import tables
from auvident.report.finding_words import evidence
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import Finding
from auvident.schema.quoting import printable

Justify = Literal["left", "right"]

MOST_PLACES = 6  # places named of a finding that several share
READABLE = 18  # least width of a column of sentences
LONGEST_WORD = 34  # columns; longer ones (names of files) go on in the next line
MOST_FINDINGS = 12  # lines of findings a stage; the artifact has all of them


def console_for(stream: IO[str], width: int | None = None) -> Console:
    """A console that shows text as it is: names of the user are no markup and no emoji.

    Parameters
    ----------
    stream : text stream
    width : int, optional
        Columns; by default those of the terminal.
    """
    console = Console(file=stream, width=width, markup=False, emoji=False, highlight=False)
    console.push_render_hook(_Printable())
    return console


class _Printable(RenderHook):
    """Wraps what is printed, so that a name of the user gives no orders to the terminal."""

    def process_renderables(self, renderables: list[Any]) -> list[Any]:
        return [
            _Wrapped(piece) if not isinstance(piece, Control) else piece for piece in renderables
        ]


@dataclass(frozen=True)
class _Wrapped:
    piece: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for text, style, control in console.render(self.piece, options):
            yield Segment(text if control else printable(text), style, control)


def rich_table(table: tables.Table, accents: Mapping[str, str] | None = None) -> "Shown":
    """A table of the report in the house style.

    Parameters
    ----------
    table : Table
    accents : mapping, optional
        Style of cells by their text.
    """
    return Shown(tables.written(table, TERMINAL), accents or {})


@dataclass(frozen=True)
class Shown:
    """The house style: no vertical rules, title on the left, numbers on the right.

    Nothing is cut. Where the terminal has no room for all columns, the others follow in a second
    block, with the first column again.
    """

    table: tables.Written
    accents: Mapping[str, str]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """One block of columns after the other."""
        widths = [_widths(self.table, k) for k in range(len(self.table.heads))]
        blocks = in_blocks([least for least, _ in widths], options.max_width)
        for b, block in enumerate(blocks):
            given = fitted([widths[k] for k in block], options.max_width)
            yield self._block(block, given, b == 0, b == len(blocks) - 1)

    def _block(self, block: Sequence[int], widths: Sequence[int], first: bool, last: bool) -> Table:
        text = self.table
        title = text.title if first else ""
        shown = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD)
        shown.pad_edge = False
        shown.show_header = any(text.heads[k] for k in block)
        for k, width in zip(block, widths, strict=True):
            justify: Justify = "right" if text.numeric[k] else "left"
            shown.add_column(text.heads[k], justify=justify, width=width, overflow="fold")
        for row, marked in zip(text.rows, text.marked, strict=True):
            cells = (Text(row[k], style=self.accents.get(row[k], "")) for k in block)
            shown.add_row(*cells, style="cyan" if marked else "")
        shown.caption, shown.caption_justify = (text.caption if last else None) or None, "left"
        return shown


def _widths(table: tables.Written, k: int) -> tuple[int, int]:
    """Least and full width of a column: of its longest word or number, of its longest line."""
    cells = [row[k] for row in table.rows]
    texts, whole = [table.heads[k], *cells], cells if table.numeric[k] else []
    pieces = [*whole, *(word for text in texts for word in text.split())]
    words = max((cell_len(piece) for piece in pieces), default=1)
    lines = max(cell_len(line) for text in texts for line in (*text.splitlines(), ""))
    readable = 0 if table.numeric[k] else min(READABLE, lines)
    return max(min(words, LONGEST_WORD), readable, 1), max(lines, 1)


def in_blocks(least: Sequence[int], room: int) -> list[list[int]]:
    """Columns that stand side by side: as many as there is room for, the first one in each."""
    blocks = [[0]]
    for k in range(1, len(least)):
        block = [*blocks[-1], k]
        if sum(least[c] for c in block) + _between(len(block)) > room and len(block) > 2:
            blocks.append([0])
        blocks[-1].append(k)
    return blocks


def fitted(widths: Sequence[tuple[int, int]], room: int) -> list[int]:
    """Width of every column: narrow ones get all they want first, wide ones share the rest."""
    given = [least for least, _ in widths]
    rest = room - _between(len(widths)) - sum(given)
    order = sorted(range(len(widths)), key=lambda k: widths[k][1])
    for k in order:
        more = max(min(widths[k][1] - given[k], rest), 0)
        given[k], rest = given[k] + more, rest - more
    return given


def _between(columns: int) -> int:
    """What stands at the edges and between columns."""
    return 2 + 3 * (columns - 1)


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
        lines.append(Text(f"and {len(groups) - MOST_FINDINGS} more findings", style="dim"))
    return lines


def finding_line(finding: Finding) -> Text:
    """One finding with its place and remedy."""
    text = Text(f"{finding.where}: " if finding.where else "", style="yellow")
    text.append(finding.message, style="default")
    if finding.threshold is not None:
        text.append(evidence(finding))
    if finding.remedy:
        stop = "" if text.plain.endswith(".") else "."
        text.append(f"{stop} {finding.remedy}", style="dim")
    return text
