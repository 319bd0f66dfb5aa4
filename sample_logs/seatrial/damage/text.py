"""Damage: how the text of a file is written."""

from __future__ import annotations

import csv
import re

import numpy as np

from seatrial.damage.kind import REFUSED, RIGHT, Kind, family
from seatrial.damage.log import TIME, Log, as_rows

FORM, ROWS_LOST, COLUMNS = "form of the text", "rows that cannot be read", "columns"


def everywhere(change):
    """Apply: the text of every file changed."""
    return lambda log, *_: log.edit_all(change)


def in_dvl(change):
    """Apply: the lines of the DVL's file changed."""
    return lambda log, *_: log.edit_lines("dvl", change)


def encoded(code: str):
    """Apply: another encoding in every file."""

    def apply(log: Log, *_: object) -> None:
        for sensor in log.sensors():
            log.edit_bytes(sensor, lambda b: b.decode("utf-8").encode(code))

    return apply


def decimal_comma(text: str) -> str:
    """Semicolons between cells, commas in numbers."""
    return text.replace(",", ";").replace(".", ",")


def half_commas(lines: list[str]) -> list[str]:
    """Decimal commas from mid-file on; points before."""
    half = len(lines) // 2
    return [
        line.replace(",", ";") if k < half else decimal_comma(line) for k, line in enumerate(lines)
    ]


def quoted_commas(log: Log, *_: object) -> None:
    """Commas in numbers, which are quoted."""
    for sensor in log.sensors():
        table = log.read(sensor).map(lambda cell: cell.replace(".", ","))
        log.file(sensor).write_text(as_rows(table, csv.QUOTE_ALL), encoding="utf-8")


def quoted(log: Log, *_: object) -> None:
    """All cells in quotes."""
    for sensor in log.sensors():
        log.file(sensor).write_text(as_rows(log.read(sensor), csv.QUOTE_ALL), encoding="utf-8")


def aligned(log: Log, *_: object) -> None:
    """Columns aligned by spaces."""
    for sensor in log.sensors():
        rows = [["-" if c == "" else c for c in row] for row in log.read(sensor).to_numpy()]
        head = list(log.read(sensor).columns)
        lines = ["".join(f"{c:>14}" for c in row) for row in [head, *rows]]
        log.file(sensor).write_text("\n".join(lines) + "\n", encoding="utf-8")


def stray(share: float, place: float):
    """Apply: quotes that nobody closes, the first at a share of the file."""

    def apply(log: Log, *_: object) -> None:
        log.lost += 1
        log.edit_lines("dvl", lambda lines: with_quote(lines, share, place))

    return apply


def with_quote(lines: list[str], first: float, last: float) -> list[str]:
    """A quote at the start of a cell in one row, and another in a later one (or none)."""
    lines = list(lines)
    for share in {first, last}:
        if share < 1.0:
            row = int(share * len(lines))
            lines[row] = lines[row].replace(",", ',"', 1)
    return lines


def never_closed(log: Log, *_: object) -> None:
    """All cells in quotes, one of which is not closed."""
    quoted(log)
    log.lost += 1

    def opened(lines: list[str]) -> list[str]:
        row = len(lines) // 2
        lines[row] = lines[row].replace('","', ',"', 1)
        return lines

    log.edit_lines("dvl", opened)


def quotes_scattered(log: Log, share: float, rng: np.random.Generator) -> None:
    """A quote in the middle of a number, in some rows."""

    def scattered(lines: list[str]) -> list[str]:
        hit = rng.random(len(lines)) < share
        hit[0] = False
        log.lost += int(hit.sum())
        return [x.replace(",", ',"', 1) if b else x for x, b in zip(lines, hit, strict=True)]

    log.edit_lines("dvl", scattered)


def quote_in_header(lines: list[str]) -> list[str]:
    """A quote before a name."""
    return [lines[0].replace(",", ',"', 1), *lines[1:]]


def ragged(log: Log, share: float, rng: np.random.Generator) -> None:
    """Some rows end early."""

    def cut(lines: list[str]) -> list[str]:
        short = rng.random(len(lines)) < share
        short[0] = False
        log.lost += int(short.sum())
        return [
            line.rpartition(",")[0].rpartition(",")[0] if bad else line
            for line, bad in zip(lines, short, strict=True)
        ]

    log.edit_lines("dvl", cut)


def garbled(log: Log, share: float, rng: np.random.Generator) -> None:
    """Some rows are not text."""

    def spoilt(lines: list[str]) -> list[str]:
        bad = rng.random(len(lines)) < share
        bad[0] = False
        log.lost += int(bad.sum())
        return [
            "".join(chr(c) for c in rng.integers(33, 126, len(line))) if b else line
            for line, b in zip(lines, bad, strict=True)
        ]

    log.edit_lines("dvl", spoilt)


def merged(log: Log, share: float, rng: np.random.Generator) -> None:
    """Some line ends are lost."""

    def joined(text: str) -> str:
        pieces = text.splitlines()
        lost = rng.random(len(pieces)) < share
        lost[0] = False
        log.lost += 2 * int(lost.sum())
        return "".join(p if b else p + "\n" for p, b in zip(pieces, lost, strict=True))

    log.edit("dvl", joined)


def units_row(lines: list[str]) -> list[str]:
    """A row of units below the header, whose names have none."""
    names = [re.sub(r"_(mps|degps|radps|deg|m|s)$", "", n) for n in lines[0].split(",")]
    words = {"mps": "m/s", "degps": "deg/s", "radps": "rad/s"}
    ends = [n.rpartition("_")[2] for n in lines[0].split(",")]
    units = [words.get(e, e if e in ("deg", "m", "s", "rpm") else "") for e in ends]
    names[0] = "time"
    return [",".join(names), ",".join(units), *lines[1:]]


def headers_twice(log: Log, *_: object) -> None:
    """Every file is made of two, each with its header."""

    def twice(lines: list[str]) -> list[str]:
        half = len(lines) // 2
        return [*lines[:half], lines[0], *lines[half:]]

    for sensor in log.sensors():
        log.edit_lines(sensor, twice)


def log_twice(log: Log, *_: object) -> None:
    """Two logs in one file: the header and the clock of zero come again at mid-file."""
    for sensor in log.sensors():
        begin, end = log.span()
        log.retime(sensor, lambda t, b=begin, e=end: np.where(t > (b + e) / 2, t - (b + e) / 2, t))
    headers_twice(log)


def shuffled(log: Log, _: float, rng: np.random.Generator) -> None:
    """Rows in no order."""
    for sensor in log.sensors():
        table = log.read(sensor)
        log.write(sensor, table.iloc[rng.permutation(len(table))])


def reversed_rows(log: Log, *_: object) -> None:
    """The newest row first."""
    for sensor in log.sensors():
        log.write(sensor, log.read(sensor).iloc[::-1])


def duplicated(log: Log, share: float, rng: np.random.Generator) -> None:
    """Some rows twice."""
    for sensor in log.sensors():
        table = log.read(sensor)
        again = 1 + (rng.random(len(table)) < share)
        log.write(sensor, table.loc[np.repeat(table.index, again)])


def exponents(log: Log, *_: object) -> None:
    """Numbers as 1.5E+00."""
    for sensor in log.sensors():
        table = log.read(sensor)
        for name in table.columns.drop(TIME):
            table[name] = [f"{float(c):.5E}" if c else c for c in table[name]]
        log.write(sensor, table)


def two_columns(log: Log, *_: object) -> None:
    """Two columns of one name, the second one smoothed."""
    table = log.read("dvl")
    table.insert(1, "other", [f"{x:.4f}" for x in 0.9 * log.values("dvl", "u")])
    log.file("dvl").write_text(as_rows(table).replace("other", "u_mps", 1), encoding="utf-8")


def tail_cut(log: Log, *_: object) -> None:
    """Every file ends in the middle of a line."""
    log.edit_all(lambda text: text[: -len(text.splitlines()[-1]) // 2 - 2])


ROWS = family(
    "text format",
    Kind("decimal-comma", FORM, "semicolons and decimal commas", RIGHT, everywhere(decimal_comma)),
    Kind("decimal-comma-quoted", FORM, "decimal commas in quoted cells", RIGHT, quoted_commas),
    Kind(
        "decimal-comma-half",
        FORM,
        "decimal commas from the middle of the DVL's file on",
        RIGHT,
        in_dvl(half_commas),
        (),
        "dvl",
    ),
    Kind(
        "tabs",
        FORM,
        "tabs between the cells",
        RIGHT,
        everywhere(lambda text: text.replace(",", "\t")),
    ),
    Kind(
        "pipes",
        FORM,
        "bars between the cells",
        RIGHT,
        everywhere(lambda text: text.replace(",", "|")),
    ),
    Kind("spaces", FORM, "columns aligned by spaces, a dash for none", RIGHT, aligned),
    Kind(
        "padded",
        FORM,
        "spaces behind the commas",
        RIGHT,
        everywhere(lambda text: text.replace(",", ", ")),
    ),
    Kind("byte-order-mark", FORM, "UTF-8 with a byte order mark", RIGHT, encoded("utf-8-sig")),
    Kind("utf-16", FORM, "UTF-16", RIGHT, encoded("utf-16")),
    Kind(
        "windows-lines",
        FORM,
        "lines end in CR LF",
        RIGHT,
        everywhere(lambda text: text.replace("\n", "\r\n")),
    ),
    Kind(
        "mac-lines",
        FORM,
        "lines end in CR",
        RIGHT,
        everywhere(lambda text: text.replace("\n", "\r")),
    ),
    Kind(
        "blank-lines",
        FORM,
        "an empty line behind every line",
        RIGHT,
        everywhere(lambda text: text.replace("\n", "\n\n")),
    ),
    Kind("quoted", FORM, "all cells in quotes", RIGHT, quoted),
    Kind(
        "stray-quote",
        ROWS_LOST,
        "one quote that nobody closes, at half of the DVL's file",
        RIGHT,
        stray(0.5, 1.0),
        (),
        "dvl",
    ),
    Kind(
        "two-stray-quotes",
        ROWS_LOST,
        "two quotes, a third of the DVL's file between them",
        RIGHT,
        stray(0.33, 0.66),
        (),
        "dvl",
    ),
    Kind(
        "quote-not-closed",
        ROWS_LOST,
        "all cells of the DVL in quotes, one of them not closed",
        RIGHT,
        never_closed,
        (),
        "dvl",
    ),
    Kind(
        "quotes-scattered",
        ROWS_LOST,
        "a stray quote in a share of {} of the DVL's rows",
        RIGHT,
        quotes_scattered,
        (0.005, 0.05),
        "dvl",
    ),
    Kind(
        "quote-in-header",
        COLUMNS,
        "a stray quote in the header of the DVL's file",
        REFUSED,
        in_dvl(quote_in_header),
        (),
        "dvl",
    ),
    Kind(
        "comments",
        FORM,
        "text above the header",
        RIGHT,
        everywhere(lambda text: "# logger 3.2\n# vehicle 7, trial 12\n" + text),
    ),
    Kind(
        "preamble",
        FORM,
        "text without a mark above the header",
        RIGHT,
        everywhere(lambda text: "Logger 3.2\nVehicle: 7; Trial: 12\n\n" + text),
    ),
    Kind(
        "units-row",
        FORM,
        "units in a row below the header",
        RIGHT,
        lambda log, *_: (
            [log.edit_lines(s, units_row) for s in log.sensors() if s != "rpm"] and None
        ),
    ),
    Kind(
        "footer",
        ROWS_LOST,
        "a line of text at the end",
        RIGHT,
        everywhere(lambda text: text + "END OF LOG\n"),
    ),
    Kind("headers-twice", ROWS_LOST, "the header again at mid-file", RIGHT, headers_twice),
    Kind(
        "logs-concatenated",
        ROWS_LOST,
        "header and clock start again at mid-file",
        REFUSED,
        log_twice,
    ),
    Kind(
        "no-header",
        COLUMNS,
        "no header in the DVL's file",
        REFUSED,
        in_dvl(lambda lines: lines[1:]),
        (),
        "dvl",
    ),
    Kind(
        "upper-case",
        COLUMNS,
        "column names in capitals",
        RIGHT,
        lambda log, *_: (
            [log.edit_lines(s, lambda lines: [lines[0].upper(), *lines[1:]]) for s in log.sensors()]
            and None
        ),
    ),
    Kind(
        "brackets",
        COLUMNS,
        "units in brackets: u [m/s]",
        RIGHT,
        in_dvl(lambda lines: [re.sub(r"_mps", " [m/s]", lines[0]), *lines[1:]]),
        (),
        "dvl",
    ),
    Kind(
        "unknown-name",
        COLUMNS,
        "u is named speed",
        REFUSED,
        lambda log, *_: log.rename("dvl", {"u": "along"}),
        (),
        "dvl",
    ),
    Kind(
        "no-unit",
        COLUMNS,
        "no unit in the names of the DVL's columns",
        REFUSED,
        lambda log, *_: log.rename("dvl", {"u": "u", "v": "v", "w": "w"}),
        (),
        "dvl",
    ),
    Kind("name-twice", COLUMNS, "two columns named u_mps", REFUSED, two_columns, (), "dvl"),
    Kind(
        "extra-column",
        COLUMNS,
        "a column of text between the others",
        RIGHT,
        in_dvl(lambda lines: [lines[0] + ",status", *(line + ",OK" for line in lines[1:])]),
        (),
        "dvl",
    ),
    Kind(
        "index-column",
        COLUMNS,
        "a column without a name in front",
        RIGHT,
        in_dvl(lambda lines: ["," + lines[0], *(f"{k},{x}" for k, x in enumerate(lines[1:]))]),
        (),
        "dvl",
    ),
    Kind(
        "index-unnamed",
        COLUMNS,
        "a number in front of every row, not in the header",
        REFUSED,
        in_dvl(lambda lines: [lines[0], *(f"{k},{x}" for k, x in enumerate(lines[1:]))]),
        (),
        "dvl",
    ),
    Kind(
        "trailing-separator",
        FORM,
        "a comma at the end of every line",
        RIGHT,
        everywhere(lambda text: text.replace("\n", ",\n")),
    ),
    Kind(
        "ragged",
        ROWS_LOST,
        "a share of {} of the DVL's rows ends early",
        RIGHT,
        ragged,
        (0.01, 0.3),
        "dvl",
    ),
    Kind(
        "garbled",
        ROWS_LOST,
        "a share of {} of the DVL's rows is no text",
        RIGHT,
        garbled,
        (0.01, 0.3),
        "dvl",
    ),
    Kind(
        "lines-merged",
        ROWS_LOST,
        "a share of {} of the DVL's line ends lost",
        RIGHT,
        merged,
        (0.01,),
        "dvl",
    ),
    Kind(
        "nul-bytes",
        ROWS_LOST,
        "a block of zero bytes in the DVL's file",
        RIGHT,
        lambda log, *_: log.edit_bytes(
            "dvl", lambda b: b[: len(b) // 2] + bytes(512) + b[len(b) // 2 + 512 :]
        ),
        (),
        "dvl",
    ),
    Kind("tail-cut", ROWS_LOST, "every file ends in the middle of a line", RIGHT, tail_cut),
    Kind("shuffled", "order of the rows", "rows in no order", RIGHT, shuffled),
    Kind("reversed", "order of the rows", "the newest row first", RIGHT, reversed_rows),
    Kind(
        "duplicated",
        "copied rows",
        "a share of {} of the rows twice",
        RIGHT,
        duplicated,
        (0.1, 1.0),
    ),
    Kind("exponents", FORM, "numbers as 1.5E+00", RIGHT, exponents),
    Kind(
        "plus-signs",
        FORM,
        "numbers with a plus",
        RIGHT,
        in_dvl(lambda lines: [lines[0], *(re.sub(r"(^|,)(\d)", r"\1+\2", x) for x in lines[1:])]),
        (),
        "dvl",
    ),
    Kind(
        "units-in-cells",
        FORM,
        "units behind the numbers",
        RIGHT,
        in_dvl(lambda lines: [lines[0], *(re.sub(r"(\.\d{4})", r"\1 m/s", x) for x in lines[1:])]),
        (),
        "dvl",
    ),
)
