"""Where the columns of a text log stand: delimiter, header, units row, first row of data."""

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from auvident.errors import InputError
from auvident.schema.logs import TIME_UNITS, unit_name
from auvident.storage.log_quotes import closes
from auvident.storage.log_text import OR_WITHOUT

HEADER_LINES = 400  # a longer preamble is no log of ours
COMMENT_MARKS = ("#", "//", "%")
ALSO_NAMES = ("rpm", "rps")  # units that are the name of a column as well
LONE_ROWS = 5  # of single values below a single name: a table of one column
DELIMITERS = ("\t", ";", ",")
WHITESPACE = " "
INDEX = "index"  # name given to the index of a data frame that has none
# fmt: off
MISSING = frozenset((
    "", "-", "--", "?", "nan", "-nan", "+nan", "nan(ind)", "-nan(ind)", "null", "none", "nil",
    "nat", "n/a", "na", "n.a.", "<na>", "inf", "-inf", "+inf", "infinity", "-infinity",
    "1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind", "1.#inf", "-1.#inf", "nan(snan)", "-nan(snan)",
    "#n/a", "#div/0!", "#value!", "#num!", "#ref!", "#null!", "missing", "undefined", "*", ".",
))
# fmt: on
TIME_NAMES = (
    "time_s",
    "timestamp",
    *(f"time_{unit}" for unit in TIME_UNITS if unit != "s"),
    *(f"timestamp_{unit}" for unit in TIME_UNITS),
)
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
INSTANT = re.compile(r"\d{4}-?\d\d-?\d\d([T ].*)?|\d\d?:\d\d(:\d\d([.,]\d+)?)?")
BRACKETS = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]$")
REMEDY = "The first row should name the columns, e.g. time_s,u_mps,v_mps."


@dataclass(frozen=True)
class Layout:
    """Layout of a text log; lines count from 0.

    `units` holds the text of a units row or of brackets behind the name, "" where none.
    """

    delimiter: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    header_line: int
    data_line: int


def split(line: str, delimiter: str) -> list[str]:
    """Fields of one line, quotes and blanks removed."""
    if delimiter == WHITESPACE:
        return line.split()
    if not closes(line, delimiter):  # a stray quote, which would hide the delimiters behind it
        line = line.replace('"', "")
    try:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a field of more than 131,072 characters, which is no value
        fields = line.replace('"', "").split(delimiter)
    return [field.strip() for field in fields]


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return line.lstrip().startswith(COMMENT_MARKS)


def is_missing(field: str) -> bool:
    """Whether a field is a recognised marker of a missing value."""
    return field.strip().lower() in MISSING


def is_value(field: str) -> bool:
    """Whether a field is a number, an instant or a missing value."""
    return is_missing(field) or bool(NUMBER.fullmatch(field) or INSTANT.fullmatch(field))


def find_layout(text: str, where: str, time_names: Collection[str]) -> Layout:
    """Find the row of column names and the first row of data.

    Parameters
    ----------
    text : str
        The beginning of the file.
    where : str
        File, for messages.
    time_names : collection of str
        Names of a time column, lower case: a row that has one is the header.

    Raises
    ------
    InputError
        When there is no header, or nothing but a header.
    """
    lines = text.split("\n")
    header = _header_by_name(lines, time_names)
    if header is None:
        header = _header_by_structure(lines) or _header_in_comment(lines) or _lone_name(lines)
    if header is None:
        first = next((line.strip() for line in lines if line.strip()), "")
        raise InputError(
            f"has no row of column names; it starts with {first[:60]!r}", where, REMEDY
        )
    index, delimiter = header
    names, units = _names_and_units(split(_uncommented(lines[index]), delimiter))
    start = _next_content(lines, index + 1)
    if start is not None and _is_units_row(split(lines[start], delimiter)):
        units = _merge_units(units, split(lines[start], delimiter), where, start + 1)
        start = _next_content(lines, start + 1)
    if start is None:
        raise InputError("has column names but no data", where, OR_WITHOUT)
    row = split(lines[start], delimiter)
    extra = len(row) - len(names)
    if extra == 1 and row[-1] == "":  # rows end in a delimiter
        names, units = (*names, ""), (*units, "")
    return Layout(delimiter, _with_index(names, row, time_names), units, index, start)


def _with_index(
    names: tuple[str, ...], row: Sequence[str], time_names: Collection[str]
) -> tuple[str, ...]:
    """Names, with one for the index of a data frame: a first column that has none.

    Instants are the time, where no other column is; numbers with a fraction may be, counts are not.
    """
    known = {name.lower() for name in names}
    if names[0] or len(names) < 2 or INDEX in known:
        return names
    is_time = bool(INSTANT.fullmatch(row[0])) and not row[0].isdigit()
    if is_time and not known & {*time_names}:
        return ("timestamp", *names[1:])
    return (INDEX, *names[1:]) if "." in row[0] else names


def _uncommented(line: str) -> str:
    stripped = line.strip("\n ")
    for mark in COMMENT_MARKS:
        if stripped.startswith(mark):
            return stripped.lstrip("#/% ")
    return stripped


def _best_split(line: str) -> tuple[str, list[str]]:
    """Delimiter that gives the most fields; blanks only when no other splits at all."""
    options = [(d, split(line, d)) for d in DELIMITERS]
    delimiter, fields = max(options, key=lambda option: len(option[1]))
    if len(fields) > 1:
        return delimiter, fields
    words = line.split()
    return (WHITESPACE, words) if len(words) > 1 else (",", fields)


def _next_content(lines: Sequence[str], start: int) -> int | None:
    for index in range(start, len(lines)):
        if lines[index].strip() and not is_comment(lines[index]):
            return index
    return None


def _header_by_name(lines: Sequence[str], names: Collection[str]) -> tuple[int, str] | None:
    """First row with a known name of the time column; a comment only right before data."""
    for index, line in enumerate(lines[:HEADER_LINES]):
        if not line.strip():
            continue
        delimiter, fields = _best_split(_uncommented(line))
        known = any(plain_name(name)[0].lower() in names for name in fields)
        if not known or any(NUMBER.fullmatch(field) for field in fields):
            continue
        if is_comment(line):
            below = _next_content(lines, index + 1)
            row = split(lines[below], delimiter) if below is not None else []
            if len(row) != len(fields) or not all(is_value(field) for field in row):
                continue
        return index, delimiter
    return None


def _header_by_structure(lines: Sequence[str]) -> tuple[int, str] | None:
    """First row of two or more words above a row of as many fields, half of them values."""
    for index, line in enumerate(lines[:HEADER_LINES]):
        if not line.strip() or is_comment(line):
            continue
        delimiter, fields = _best_split(line)
        if len(fields) < 2 or any(is_value(field) for field in fields if field):
            continue
        below = _next_content(lines, index + 1)
        if below is not None and _is_units_row(split(lines[below], delimiter)):
            below = _next_content(lines, below + 1)
        if below is None:
            return None
        row = split(lines[below], delimiter)
        values = sum(is_value(field) for field in row)
        if len(row) - len(fields) in (0, 1) and 2 * values >= len(row):
            return index, delimiter
    return None


def _header_in_comment(lines: Sequence[str]) -> tuple[int, str] | None:
    """The comment right above the data, of as many words (``%time,u`` of ROS, ``# t u``)."""
    start = _next_content(lines, 0)
    above = max((k for k in range(start or 0) if lines[k].strip()), default=None)
    if start is None or above is None:
        return None
    delimiter, fields = _best_split(_uncommented(lines[above]))
    row = split(lines[start], delimiter)
    are_names = len(fields) > 1 and not any(is_value(field) for field in fields)
    values = sum(is_value(field) for field in row)
    fits = are_names and len(row) == len(fields) and 2 * values >= len(row)
    return (above, delimiter) if fits else None


def _lone_name(lines: Sequence[str]) -> tuple[int, str] | None:
    """A name above a column of values: a file whose time is missing, which is told of it."""
    content = [k for k, line in enumerate(lines) if line.strip() and not is_comment(line)]
    for place, index in enumerate(content[:HEADER_LINES]):
        below = content[place + 1 : place + 2 + LONE_ROWS]
        unit = lines[below[0]].strip() if below else ""
        if _is_units_row([unit]) and unit.lower() not in ALSO_NAMES:
            del below[0]
        delimiter, fields = _best_split(lines[index])
        is_name = len(fields) == 1 or delimiter == WHITESPACE  # of several words
        if (
            is_name
            and not is_value(lines[index].strip())
            and below
            and all(_is_lone_value(lines[k]) for k in below[:LONE_ROWS])
        ):
            return index, ","
    return None


def _is_lone_value(line: str) -> bool:
    """Whether a line is one value; a decimal comma parts none."""
    field = line.strip().strip('"')
    return is_value(field) and (bool(NUMBER.fullmatch(field)) or len(_best_split(field)[1]) == 1)


def plain_name(name: str) -> tuple[str, str]:
    """Name and unit of a column as its header has them (``u [m/s]``)."""
    name = name.replace('"', "")
    found = BRACKETS.match(name)
    return (found["name"], found["unit"]) if found else (name, "")


def _names_and_units(fields: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    pairs = [plain_name(field) for field in fields]
    return tuple(name for name, _ in pairs), tuple(unit for _, unit in pairs)


def _is_units_row(fields: Sequence[str]) -> bool:
    """Only words, at least one of them a unit."""
    units = [f for f in fields if unit_name(f) or f.strip("[]()").lower() in TIME_UNITS]
    return bool(units) and not any(NUMBER.fullmatch(f) or INSTANT.fullmatch(f) for f in fields)


def _merge_units(
    brackets: tuple[str, ...], row: Sequence[str], where: str, line: int
) -> tuple[str, ...]:
    if len(row) != len(brackets):
        raise InputError(
            f"the units row has {len(row)} fields, the header {len(brackets)}",
            f"{where}, row {line}",
            "Give every column its unit, or remove the row.",
        )
    return tuple(own or other for own, other in zip(brackets, row, strict=True))
