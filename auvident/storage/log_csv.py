"""Columns of a text log as arrays: a fast parser first, a careful one to handle or name faults."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import csv as pacsv

from auvident.errors import InputError
from auvident.schema.logs import FIRST_FEW
from auvident.schema.quoting import clipped
from auvident.storage.log_blocks import BLOCK_BYTES, OddBytes, blocks
from auvident.storage.log_layout import (
    COMMENT_MARKS,
    MISSING,
    NUMBER,
    WHITESPACE,
    Layout,
    is_missing,
    is_value,
    plain_name,
    split,
)
from auvident.storage.log_quotes import FEW, MOST_SHARE, blank_stray_quotes
from auvident.storage.log_text import read_text

MAX_RAGGED_SHARE = 0.01  # rows with too few or too many fields: above it the file is no table
MAX_RAGGED_FEW = 3  # so many are dropped from a short file, too
PEEK_ROWS = 200  # rows looked at to tell numbers from text
DECIMALS_LINES = 20  # rows whose number of decimals the last row is held against
# fmt: off
DECIMAL_COMMA = re.compile(
    rb"(?:^|[;\t ])[ \"]*[+-]?\d*,\d+(?:[eE][+-]?\d+)?[ \"]*(?=[;\t \n]|\Z)", re.MULTILINE
)
# fmt: on
DECIMAL_POINT = re.compile(
    rb"(?:^|[,;\t ])[ \"]*[+-]?\d*\.\d+(?:[eE][+-]?\d+)?[ \"]*(?=[,;\t \n]|\Z)", re.MULTILINE
)
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+(?:\.\d*)?")
THOUSANDS_BY_POINTS = re.compile(r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d*)?")
THOUSAND = 1000.0
DELIMITER_REMEDY = "Check the delimiter (a decimal comma needs semicolons or tabs between columns)."
OTHER_COLUMNS = (
    "Make a file of its own of this row and all below it: they stand in other columns than those "
    "above."
)
NULLS = sorted({w for m in MISSING for w in (m, m.upper(), m.capitalize())} | {"NaN", "N/a"})
Kind = Literal["number", "text"]


@dataclass(frozen=True)
class LogTable:
    """Columns of a log file, shape (n,) each: float64, or objects for text.

    `rows` are lines of the file (1-based); `dropped` counts rows by reason.
    """

    columns: dict[str, np.ndarray]
    rows: np.ndarray
    rows_read: int
    dropped: dict[str, int] = field(default_factory=dict)
    dropped_rows: dict[str, tuple[int, ...]] = field(default_factory=dict)


def read_csv(path: Path, layout: Layout, wanted: Mapping[str, Kind | None]) -> LogTable:
    """Read some columns of a text log.

    Parameters
    ----------
    path : Path
        The file.
    layout : Layout
        Its layout, from `find_layout`.
    wanted : mapping of str to {"number", "text", None}
        Columns to read and what they hold; None: look.

    Raises
    ------
    InputError
        When a number column holds text (with row, column and the text), or too many rows do
        not have the fields that the header names.
    """
    found = _read_blocks(path, layout, wanted) if _is_long(path) else None
    return found or _read_body(path, _body(path, layout), layout, wanted)


def _is_long(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > BLOCK_BYTES


def _read_blocks(path: Path, layout: Layout, wanted: Mapping[str, Kind | None]) -> LogTable | None:
    """Read a long log block by block; None where only the whole of it tells what is wrong."""
    parts: list[LogTable] = []
    head: bytes | None = None
    try:
        for line, block in blocks(path, layout.data_line):
            if head is None and block.count(b"\n") < PEEK_ROWS:
                return None
            head = head or block
            if layout.delimiter != "," and b"," in block:  # a decimal comma may come late
                return None
            if block:
                part = _read_body(path, block, replace(layout, data_line=line), wanted, head)
                parts.append(part)
                wanted = {name: _kind_of(x) for name, x in part.columns.items()}
    except (OddBytes, InputError):
        return None
    pa.default_memory_pool().release_unused()
    return _joined(parts)


def _kind_of(values: np.ndarray) -> Kind:
    return "text" if values.dtype == object else "number"


def _joined(parts: list[LogTable]) -> LogTable | None:
    """One table of all blocks; None where so much was dropped that the whole has to judge."""
    counts = Counter[str]()
    where: dict[str, tuple[int, ...]] = {}
    for part in parts:
        counts.update(part.dropped)
        for reason, lines in part.dropped_rows.items():
            where[reason] = (*where.get(reason, ()), *lines)[:FIRST_FEW]
    rows = np.concatenate([part.rows for part in parts])
    most = min(MOST_SHARE, MAX_RAGGED_SHARE) * rows.size
    if max(counts["wrong_number_of_fields"], counts["stray_quote"]) > most:
        return None
    names = list(parts[0].columns)
    # one column after the other, so that there are never two copies of all
    columns = {name: np.concatenate([part.columns.pop(name) for part in parts]) for name in names}
    read = sum(part.rows_read for part in parts)
    return LogTable(columns, rows, read, {k: n for k, n in counts.items() if n}, where)


def _read_body(
    path: Path,
    body: bytes,
    layout: Layout,
    wanted: Mapping[str, Kind | None],
    head: bytes | None = None,
) -> LogTable:
    """Read the rows of a log, or of a block of it that ends at the end of a line.

    Parameters
    ----------
    path : Path
        For messages.
    body : bytes
        Lines in UTF-8.
    layout : Layout
        With `data_line`, the line of the file at which `body` begins.
    wanted : mapping of str to {"number", "text", None}
        Columns to read.
    head : bytes, optional
        The first rows of the file, which tell whether the last one was cut off; `body` has them
        unless it is a later block.
    """
    if layout.delimiter == WHITESPACE:
        body = re.sub(rb"[ \t]+", b" ", re.sub(rb"^[ \t]+|[ \t]+$", b"", body, flags=re.M))
    body, stray = blank_stray_quotes(body, layout.delimiter, COMMENT_MARKS)
    _refuse_many_strays(path, body, layout, stray)
    body, cut_off = _without_cut_tail(body, layout, body if head is None else head)
    if not body.strip():
        raise InputError("has column names but no data", str(path))
    kinds = {name: kind or _peek(body, layout, name) for name, kind in wanted.items()}
    bad: list[str] = []
    comma = _has_decimal_comma(body, layout)
    try:
        table = _parse(body, layout, kinds, comma, bad)
        columns = {name: _to_numpy(table.column(name), kinds[name]) for name in kinds}
        kept = np.ones(len(table), dtype=bool)
        lines = _lines(body, layout, len(table))
    except pa.ArrowInvalid:
        columns, kept, lines = _parse_carefully(path, body, layout, kinds, comma, bad)
    dropped, dropped_rows = _count_dropped(path, body, layout, bad, kept, lines, cut_off)
    if stray:
        dropped["stray_quote"] = len(stray)
        dropped_rows["stray_quote"] = tuple(layout.data_line + 1 + k for k in stray[:FIRST_FEW])
    read = int(kept.sum()) + sum(dropped.values())
    if not kept.any():
        raise InputError("has column names but no data", str(path))
    if not kept.all():
        columns = {name: values[kept] for name, values in columns.items()}
        lines = lines[kept]
    return LogTable(columns, lines, read, dropped, dropped_rows)


def _body(path: Path, layout: Layout) -> bytes:
    content, _ = read_text(path)
    start = 0
    for _ in range(layout.data_line):
        start = content.index(b"\n", start) + 1
    body = content[start:]
    try:
        body.decode()
    except UnicodeDecodeError:  # the parser stops at bytes that are no text
        body = body.decode(errors="replace").encode()
    return body


def _refuse_many_strays(path: Path, body: bytes, layout: Layout, stray: Sequence[int]) -> None:
    if len(stray) > max(FEW, MOST_SHARE * body.count(b"\n")):
        raise InputError(
            f"{len(stray)} rows have a quote that does not close on its line",
            f"{path}, row {layout.data_line + 1 + stray[0]}",
            "Remove the quotes, or write both of a pair on one line.",
        )


def _without_cut_tail(body: bytes, layout: Layout, head: bytes) -> tuple[bytes, int]:
    """Drop a last line that was cut off while it was written; 1 when there was one."""
    if not body or body.endswith(b"\n"):
        return body, 0
    last = body[body.rfind(b"\n") + 1 :]
    if not _is_cut(last, head, layout):
        return body, 0
    return body[: len(body) - len(last)], 1


def _is_cut(last: bytes, head: bytes, layout: Layout) -> bool:
    fields = split(last.decode(errors="replace"), layout.delimiter)
    if len(fields) < len(layout.names):
        return bool(last.strip())
    above = [
        split(line.decode(errors="replace"), layout.delimiter)[-1:]
        for line in head.split(b"\n", DECIMALS_LINES)[:DECIMALS_LINES]
    ]
    words = [word[0] for word in above if word and NUMBER.fullmatch(word[0])]
    if len(words) < DECIMALS_LINES // 2:  # text, or too short to tell
        return False
    if not is_value(fields[-1]):
        return True
    return _decimals(fields[-1]) < min(_decimals(word) for word in words)


def _decimals(number: str) -> int:
    return len(re.split("[.,]", number)[1]) if re.search("[.,]", number) else 0


def _peek(body: bytes, layout: Layout, name: str) -> Kind:
    place = layout.names.index(name)
    for line in body.split(b"\n", PEEK_ROWS)[:PEEK_ROWS]:
        fields = split(line.decode(errors="replace"), layout.delimiter)
        if len(fields) > place and not is_missing(fields[place]):
            return "number" if NUMBER.fullmatch(fields[place]) else "text"
    return "number"


def _has_decimal_comma(body: bytes, layout: Layout) -> bool:
    return layout.delimiter != "," and b"," in body and bool(DECIMAL_COMMA.search(body))


def _parse(
    body: bytes, layout: Layout, kinds: Mapping[str, Kind], comma: bool, bad: list[str]
) -> pa.Table:
    """Parse with the fast reader; rows with a wrong number of fields are collected in `bad`."""
    keys = [f"{i}" for i in range(len(layout.names))]
    wanted = {keys[layout.names.index(name)]: name for name in kinds}
    types = {"number": pa.float64(), "text": pa.string()}

    def note(row: pacsv.InvalidRow) -> str:
        bad.append(row.text)
        return "skip"

    bad.clear()
    table = pacsv.read_csv(
        pa.BufferReader(body),
        pacsv.ReadOptions(column_names=keys),
        pacsv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=note),
        pacsv.ConvertOptions(
            column_types={key: types[kinds[name]] for key, name in wanted.items()},
            include_columns=list(wanted),
            null_values=NULLS,
            strings_can_be_null=True,
            decimal_point="," if comma else ".",
            check_utf8=False,
        ),
    )
    return table.rename_columns([wanted[key] for key in table.column_names])


def _to_numpy(column: pa.ChunkedArray, kind: Kind) -> np.ndarray:
    if kind == "text":
        return np.asarray(column.to_pandas().astype(object))
    return column.to_numpy().astype(float)


def _parse_carefully(
    path: Path,
    body: bytes,
    layout: Layout,
    kinds: Mapping[str, Kind],
    comma: bool,
    bad: list[str],
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Parse as text, leave out comments and repeated headers, name the first text left."""
    first = layout.names[0]
    as_text: dict[str, Kind] = dict.fromkeys((first, *kinds), "text")
    try:
        table = _parse(body, layout, as_text, False, bad)
    except pa.ArrowInvalid as error:  # lines of megabytes
        problem = f"cannot be read as a table: {clipped(str(error))}"
        raise InputError(problem, str(path), "Export it again.") from None
    texts = {
        name: table.column(name).to_pandas().astype(object).fillna("").str.strip()
        for name in as_text
    }
    lines = _lines(body, layout, len(table))
    header = texts[first] == first
    for name in kinds:
        header &= texts[name].isin([name, ""]) | (texts[name] == name)
    header |= _repeats_units(texts, layout)
    again = _headers_again(path, texts, layout, lines)
    header |= np.isin(np.arange(len(lines)), again)
    comment = texts[first].str.startswith(COMMENT_MARKS)
    kept = ~np.asarray(header | comment, dtype=bool)
    has_point = bool(DECIMAL_POINT.search(body))
    columns = {}
    for name, kind in kinds.items():
        text = _without_thousands(texts[name]) if has_point else texts[name]
        text = _without_points(text) if has_point and comma else text
        columns[name] = (
            _numbers(path, name, text, kept, lines) if kind == "number" else text.to_numpy(object)
        )
    return columns, kept, lines


def _headers_again(
    path: Path, texts: Mapping[str, pd.Series], layout: Layout, lines: np.ndarray
) -> list[int]:
    """Rows that name the columns once more, with units in brackets or letters of other size.

    Raises
    ------
    InputError
        When one names them in another order: what follows it would be read into wrong columns.
    """
    names = {name.lower() for name in layout.names if name}
    first = next(iter(texts.values())).str.strip('"').str.lower()
    found = []
    for k in np.flatnonzero(first.str.startswith(tuple(names))):
        cells = {name: plain_name(text.iloc[k])[0].lower() for name, text in texts.items()}
        if all(cell in (name.lower(), "") for name, cell in cells.items()):
            found.append(int(k))
        elif set(cells.values()) <= names:
            raise InputError(
                "names the columns again, in another order",
                f"{path}, row {lines[k]}",
                OTHER_COLUMNS,
            )
    return found


def _repeats_units(texts: Mapping[str, pd.Series], layout: Layout) -> pd.Series | bool:
    """Rows that hold the units of the columns once more, below a header written again."""
    units = {name: layout.units[layout.names.index(name)] for name in texts}
    if not any(units.values()):
        return False
    return np.logical_and.reduce([texts[name] == unit for name, unit in units.items()])


def _without_thousands(text: pd.Series) -> pd.Series:
    """Numbers such as 1,170 as 1170, in a file that has decimals behind a point.

    Where one number with a comma is none of these, the commas of the column are decimal ones.
    """
    plain = text.str.strip('"')
    with_comma = plain.str.contains(",", regex=False)
    if not with_comma.any() or not plain[with_comma].str.fullmatch(THOUSANDS).all():
        return text
    return plain.where(~with_comma, plain.str.replace(",", "", regex=False))


def _without_points(text: pd.Series) -> pd.Series:
    """Numbers such as 1.170 as 1170, in a file that has decimals behind a comma.

    As some files mix decimal commas and points, it has to show in the column: by a number with
    both marks, or by others, none of them a thousand or more, that have no point.
    """
    plain = text.str.strip('" ')
    with_point = plain.str.contains(".", regex=False)
    pointed, others = plain[with_point], plain[~with_point & ~plain.str.lower().isin(MISSING)]
    if not len(pointed) or not pointed.str.fullmatch(THOUSANDS_BY_POINTS).all():
        return text
    sizes = pd.to_numeric(others.str.replace(",", ".", regex=False), errors="coerce").abs()
    are_smaller = bool(len(sizes)) and bool((sizes < THOUSAND).all())
    if not are_smaller and not pointed.str.contains(",", regex=False).any():
        return text
    return plain.where(~with_point, plain.str.replace(".", "", regex=False))


def _numbers(
    path: Path, name: str, text: pd.Series, kept: np.ndarray, lines: np.ndarray
) -> np.ndarray:
    plain = text.str.replace(",", ".", regex=False).str.strip('"')
    numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float, copy=True)
    suspect = np.flatnonzero(np.isnan(numbers) & kept)
    wrong = suspect[~text.iloc[suspect].str.strip('" ').str.lower().isin(MISSING)]
    if wrong.size:
        raise InputError(
            f"{text.iloc[wrong[0]]!r} in column {name} is not a number",
            f"{path}, row {lines[wrong[0]]}",
            "Correct or remove the row, or leave the cell empty where there is no value.",
        )
    return numbers


def _lines(body: bytes, layout: Layout, rows: int) -> np.ndarray:
    """Line of the file (1-based) of each parsed row."""
    first = layout.data_line + 1
    total = body.count(b"\n") + (not body.endswith(b"\n"))
    if total == rows:
        return numbered(first, rows)
    good = [k for k, line in enumerate(body.split(b"\n")) if _is_row(line, layout)]
    return first + np.asarray(good[:rows] if len(good) >= rows else np.arange(rows))


def numbered(first: int, count: int) -> np.ndarray:
    """Row numbers, shape (count,), in four bytes each where they fit: a day has millions."""
    narrow = first + count <= np.iinfo(np.int32).max
    return np.arange(first, first + count, dtype=np.int32 if narrow else np.int64)


def _is_row(line: bytes, layout: Layout) -> bool:
    if not line:
        return False
    mark = layout.delimiter.encode()
    if b'"' in line:
        return len(split(line.decode(errors="replace"), layout.delimiter)) == len(layout.names)
    return line.count(mark) + 1 == len(layout.names)


def _count_dropped(
    path: Path,
    body: bytes,
    layout: Layout,
    bad: Sequence[str],
    kept: np.ndarray,
    lines: np.ndarray,
    cut_off: int,
) -> tuple[dict[str, int], dict[str, tuple[int, ...]]]:
    """Rows left out, by reason; too many with a wrong number of fields are refused."""
    ragged = [row for row in bad if row.strip() and not row.lstrip().startswith(COMMENT_MARKS)]
    where: dict[str, tuple[int, ...]] = {}
    if ragged:
        where["wrong_number_of_fields"] = _find_rows(body, layout, ragged[:FIRST_FEW])
        if len(ragged) > max(MAX_RAGGED_FEW, MAX_RAGGED_SHARE * len(kept)):
            row = where["wrong_number_of_fields"][:1]
            raise InputError(
                f"{len(ragged)} rows do not have the {len(layout.names)} fields of the header, "
                f"e.g. {ragged[0][:60]!r}",
                f"{path}, row {row[0]}" if row else str(path),
                OTHER_COLUMNS if _names_columns(ragged[0], layout) else DELIMITER_REMEDY,
            )
    if cut_off:
        where["incomplete_last_row"] = (layout.data_line + 1 + body.count(b"\n"),)
    counts = {
        "wrong_number_of_fields": len(ragged),
        "incomplete_last_row": cut_off,
        "repeated_header": int((~kept).sum()),
    }
    if counts["repeated_header"]:
        where["repeated_header"] = tuple(int(k) for k in lines[~kept][:FIRST_FEW])
    return {reason: n for reason, n in counts.items() if n}, where


def _names_columns(row: str, layout: Layout) -> bool:
    """Whether a row is a header with other columns, as of a logger that was started again."""
    cells = {plain_name(cell)[0].strip().lower() for cell in split(row, layout.delimiter)}
    return len(cells & {name.lower() for name in layout.names if name}) > 1


def _find_rows(body: bytes, layout: Layout, texts: Sequence[str]) -> tuple[int, ...]:
    wanted = {text.encode() for text in texts}
    found = [k for k, line in enumerate(body.split(b"\n")) if line in wanted]
    return tuple(layout.data_line + 1 + k for k in found[:FIRST_FEW])
