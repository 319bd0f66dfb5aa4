"""House style of the console: tables and lines of findings."""

import os
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
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

PLAIN_WIDTH = 140  # columns of a table that goes to a file or a pipe
WHOLE = 8  # columns; a cell as short as that (a unit) is not broken
WHOLE_NAME = 24  # the same for the first column, which has names
ROOMY = 100  # columns; with less a table that would break its cells moves its columns closer
# blanks that no line ends at: those within "0.7 deg", "24 kg m^2 s", "± std", "≥ 0.5"
UNIT = r"(?:kg|N|m|s|deg|rad|Hz|rpm|nats|%)(?:[/^][\w/^]*)?(?![\w|])"
GLUE = re.compile(
    rf"(?<=[\d)]) (?={UNIT})|(?<=\bkg) (?={UNIT})|(?<=\bN) (?={UNIT})"
    rf"|(?<=\^2) (?={UNIT})|(?<=[±≥≤÷]) "
)
GLUED = "\u00a0"
MOST_PLACES = 6  # places named of a finding that several share
READABLE = 18  # least width of a column of sentences
LONGEST_WORD = 34  # columns; longer ones (names of files) go on in the next line
MOST_FINDINGS = 12  # lines of findings a stage; the artifact has all of them


def width_of(stream: IO[str]) -> int | None:
    """Columns of a table: of COLUMNS or of the terminal (None), more in a file or a pipe."""
    return None if stream.isatty() or "COLUMNS" in os.environ else PLAIN_WIDTH


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

    Nothing is cut. Where the terminal has no room for all columns, they move closer together; where
    that is not enough, the others follow in a second block, with the columns that tell the rows
    apart again.
    """

    table: tables.Written
    accents: Mapping[str, str]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Title, one block of columns after the other, caption."""
        if self.table.title:
            yield Text(self.table.title, style="italic")
        widths = [_widths(self.table, k) for k in range(len(self.table.heads))]
        least = [w for w, _, _ in widths]
        full = [w for _, _, w in widths]
        aired = least if options.max_width >= ROOMY else full
        layout = WIDE if WIDE.taken(aired) <= options.max_width else NARROW
        keys = _keys(self.table, least, options.max_width)
        for block in in_blocks(least, options.max_width, layout, keys):
            given = fitted([widths[k] for k in block], options.max_width, layout)
            shown = self._block(block, given, layout)
            lines = console.render_lines(shown, options.update(height=None), pad=False)
            yield from _without_blanks(lines)
        if self.table.caption:
            yield Text(self.table.caption, style="dim italic")

    def _block(self, block: Sequence[int], widths: Sequence[int], layout: "Spacing") -> Table:
        text = self.table
        shown = Table(box=box.SIMPLE_HEAD, show_edge=layout.edge > 0, padding=layout.padding)
        shown.pad_edge = False
        shown.show_header = any(text.heads[k] for k in block)
        for k, width in zip(block, widths, strict=True):
            justify: Justify = "right" if text.numeric[k] else "left"
            head = broken(text.heads[k], width)
            shown.add_column(head, justify=justify, width=width, overflow="fold")
        for row, marked in zip(text.rows, text.marked, strict=True):
            cells = (
                Text(broken(row[k], width), style=self.accents.get(row[k], ""))
                for k, width in zip(block, widths, strict=True)
            )
            shown.add_row(*cells, style="cyan" if marked else "")
        return shown


@dataclass(frozen=True)
class Spacing:
    """What stands at either edge of a table and between its columns; the padding that makes it."""

    edge: int
    between: int
    padding: tuple[int, int, int, int]

    def taken(self, widths: Sequence[int]) -> int:
        """Width of a table with these columns."""
        return sum(widths) + 2 * self.edge + self.between * (len(widths) - 1)


WIDE, NARROW = Spacing(1, 3, (0, 1, 0, 1)), Spacing(0, 2, (0, 1, 0, 0))


def _without_blanks(lines: Sequence[Sequence[Segment]]) -> Iterator[Segment]:
    """Lines without the blanks at their ends and empty ones, and one empty one behind them."""
    full = [line for line in lines if any(segment.text.strip() for segment in line)]
    for line in [*full, []]:
        kept = list(line)
        while kept and not kept[-1].text.strip():
            kept.pop()
        if kept:
            kept[-1] = kept[-1]._replace(text=kept[-1].text.rstrip())
        yield from kept
        yield Segment.line()


def glued(text: str) -> str:
    """A text whose numbers keep to their units."""
    return GLUE.sub(GLUED, text)


def broken(text: str, width: int) -> str:
    """A text in lines of a width, numbers beside their units."""
    lines = (
        textwrap.wrap(glued(line), width, break_on_hyphens=False) or [""]
        for line in text.split("\n")
    )
    return "\n".join(line for of in lines for line in of).replace(GLUED, " ")


def _keys(table: tables.Written, least: Sequence[int], room: int) -> int:
    """How many of the first columns tell the rows apart, if these leave half of the room."""
    for keys in range(1, len(least) + 1):
        if sum(least[:keys]) > room // 2:
            return 1
        if len({row[:keys] for row in table.rows}) == len(table.rows):
            return keys
    return 1


def _widths(table: tables.Written, k: int) -> tuple[int, int, int]:
    """Least, compact and full width of a column.

    That of its longest word or number; that with the head of numbers in two lines; that of its
    longest line.
    """
    cells = [row[k] for row in table.rows]
    texts = [table.heads[k], *cells]
    short = WHOLE if k else WHOLE_NAME
    whole = [cell for cell in cells if table.numeric[k] or cell_len(cell) <= short]
    pieces = [*whole, *(word for text in texts for word in glued(text).split(" "))]
    words = max((cell_len(piece) for piece in pieces), default=1)
    lines = max(cell_len(line) for text in texts for line in (*text.splitlines(), ""))
    readable = 0 if table.numeric[k] else min(READABLE, (lines + 1) // 2)
    least = max(min(words, LONGEST_WORD), readable, 1)
    compact = max(least, (cell_len(table.heads[k]) + 3) // 2) if table.numeric[k] else lines
    return least, compact, max(lines, least, 1)


def in_blocks(least: Sequence[int], room: int, layout: Spacing, keys: int = 1) -> list[list[int]]:
    """Columns that stand side by side: as many as there is room for, the keys in each."""
    first = list(range(keys))
    blocks = [first.copy()]
    for k in range(keys, len(least)):
        block = [*blocks[-1], k]
        if layout.taken([least[c] for c in block]) > room and len(block) > keys + 1:
            blocks.append(first.copy())
        blocks[-1].append(k)
    return blocks


def fitted(widths: Sequence[tuple[int, int, int]], room: int, layout: Spacing) -> list[int]:
    """Width of every column: narrow ones get all they want first, wide ones share the rest."""
    given = [least for least, _, _ in widths]
    rest = room - layout.taken(given)
    for want in (1, 2):
        for k in sorted(range(len(widths)), key=lambda k: widths[k][want]):
            more = max(min(widths[k][want] - given[k], rest), 0)
            given[k], rest = given[k] + more, rest - more
    return given


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
    shown = evidence(finding) if finding.threshold is not None else ""
    message = finding.message.rstrip(".") if shown else finding.message
    text.append(f"{message}{shown}", style="default")
    if finding.remedy:
        stop = "" if text.plain.endswith(".") else "."
        text.append(f"{stop} {finding.remedy}", style="dim")
    return text
