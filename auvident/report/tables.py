"""Tables as such: heads with units and typed cells; the terminal and the page render them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from auvident.report.numbers import PAGE, Style
from auvident.schema.spin import share


class Value(Protocol):
    """A cell that is more than a text."""

    def text(self, style: Style) -> str:
        """The cell as it is written in a style."""


Cell = str | Value
Rows = Sequence[Sequence[Cell]]


@dataclass(frozen=True)
class Number:
    """A value with significant digits; its unit stands elsewhere in the table."""

    value: float | None
    digits: int = 3
    unit: str = ""
    before: str = ""
    behind: str = ""

    def text(self, style: Style) -> str:
        """The number, in the unit that is shown, and what stands beside it."""
        text = style.number(style.shown(self.value, self.unit), self.digits)
        return f"{self.before}{text}{self.behind}"


@dataclass(frozen=True)
class Fixed:
    """A value in a fixed form (``.1f``, ``+.1f``), with what stands behind it."""

    value: float | None
    form: str
    behind: str = ""

    def text(self, style: Style) -> str:
        """The number and what stands behind it."""
        if self.value is None:
            return style.missing
        return f"{self.value:{self.form}}{self.behind}".replace("-", style.minus)


@dataclass(frozen=True)
class Quantity:
    """A value with its unit beside it."""

    value: float | None
    unit: str
    digits: int = 3

    def text(self, style: Style) -> str:
        """The number with its unit."""
        if self.value is None:
            return style.missing
        return style.quantity(self.value, self.unit, self.digits)


@dataclass(frozen=True)
class WithStd:
    """``value ± std``."""

    value: float
    std: float | None
    behind: str = ""
    unit: str = ""

    def text(self, style: Style) -> str:
        """Both in the unit that is shown, rounded to the standard deviation."""
        value, std = (style.shown(x, self.unit) for x in (self.value, self.std))
        assert value is not None
        return style.with_std(value, std) + self.behind


@dataclass(frozen=True)
class Rounded:
    """A value rounded to its standard deviation, which stands elsewhere in the table."""

    value: float
    std: float

    def text(self, style: Style) -> str:
        """The value alone."""
        return style.with_std(self.value, self.std).split(" ± ")[0]


@dataclass(frozen=True)
class Interval:
    """``low to high``."""

    low: float | None
    high: float | None
    unit: str = ""
    behind: str = ""

    def text(self, style: Style) -> str:
        """Both ends, rounded to the width."""
        low, high = (style.shown(end, self.unit) for end in (self.low, self.high))
        return style.interval(low, high) + self.behind


class AnyError(Protocol):
    """An error of a channel, of whichever artifact."""

    @property
    def rmse(self) -> float:
        """Root mean square error."""

    @property
    def nrmse(self) -> float:
        """It over the standard deviation of what was measured."""

    @property
    def unit(self) -> str:
        """SI unit of the first."""


@dataclass(frozen=True)
class Rmse:
    """The root mean square error of a channel; its unit stands elsewhere in the row."""

    error: AnyError | None

    def text(self, style: Style) -> str:
        """The number, in the unit that is shown."""
        e = self.error
        return style.missing if e is None else Number(e.rmse, 3, e.unit).text(style)


@dataclass(frozen=True)
class Nrmse:
    """The NRMSE of a channel; none of a heading that turned round and round.

    `other` is an error of the same channel over the standard deviation that counts, where its own
    is that of something shorter.
    """

    channel: str
    error: AnyError | None
    other: AnyError | None = None

    def text(self, style: Style) -> str:
        """The number, or what stands for none."""
        e, by = self.error, self.other or self.error
        if e is None or by is None or share(self.channel, by.rmse, by.nrmse) is None:
            return style.missing
        return style.number(e.nrmse)


@dataclass(frozen=True)
class Unit:
    """A unit of a row whose numbers stand without: theirs, or that they are converted to."""

    unit: str
    converted: bool = False

    def text(self, style: Style) -> str:
        """The unit that is shown."""
        return style.unit(self.unit) if self.converted else style.written_unit(self.unit)


@dataclass(frozen=True)
class Words:
    """A text with numbers in it."""

    words: str

    def text(self, style: Style) -> str:
        """The text with the signs of the style."""
        return style.signs(self.words)


@dataclass(frozen=True)
class Joined:
    """Several values in one cell."""

    cells: Sequence[Cell]
    between: str = ", "

    def text(self, style: Style) -> str:
        """Their texts, those that are not empty."""
        texts = (_text(cell, style) for cell in self.cells)
        return self.between.join(text for text in texts if text)


def change(before: float, after: float, unit: str, sure: bool) -> Joined:
    """``before → after``; a star where the difference is no chance."""
    return Joined((Number(before, 3, unit), Number(after, 3, unit, behind=" *" * sure)), " → ")


def beside(value: float, other: float | None, unit: str = "", digits: int = 3) -> Cell:
    """``value (other)``, the other of another model."""
    own = Number(value, 3, unit)
    return own if other is None else Joined((own, Number(other, digits, unit, "(", ")")), " ")


@dataclass(frozen=True)
class Column:
    """Head of a column; `on_page` where the terminal has no room for it."""

    head: str = ""
    unit: str = ""
    numeric: bool = False
    on_page: bool = False

    def text(self, style: Style) -> str:
        """The head with its unit."""
        return f"{self.head}, {style.unit(self.unit)}" if self.unit else self.head


def columns(words: Sequence[str] = (), numbers: Sequence[str] = ()) -> tuple[Column, ...]:
    """Columns of text, then columns of numbers."""
    return (*(Column(w) for w in words), *(Column(n, numeric=True) for n in numbers))


@dataclass(frozen=True)
class Table:
    """Title, columns and rows; rows with the cell `mark` stand out."""

    columns: Sequence[Column]
    rows: Rows
    title: str = ""
    caption: str = ""
    mark: str = ""


@dataclass(frozen=True)
class Written:
    """A table in a style: nothing but text."""

    title: str
    caption: str
    heads: tuple[str, ...]
    numeric: tuple[bool, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: tuple[bool, ...]


def written(table: Table, style: Style) -> Written:
    """Heads and cells as texts, of the columns that the style has room for."""
    kept = [i for i, c in enumerate(table.columns) if style is PAGE or not c.on_page]
    return Written(
        table.title,
        table.caption,
        tuple(table.columns[i].text(style) for i in kept),
        tuple(table.columns[i].numeric for i in kept),
        tuple(tuple(_text(row[i], style) for i in kept) for row in table.rows),
        tuple(bool(table.mark) and table.mark in row for row in table.rows),
    )


def _text(cell: Cell, style: Style) -> str:
    return cell if isinstance(cell, str) else cell.text(style)
