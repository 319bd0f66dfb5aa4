"""Quotes that do not close on their line: damage of that line, not of all up to the next quote.

No log needs a field over several lines, so a quote without a partner on its own line is a byte
gone wrong. A parser that is left alone with it takes the lines that follow for one field.
"""

import re
from functools import cache

FEW = 3  # damaged lines are dropped from a short file, too
MOST_SHARE = 0.01  # of the lines: above it the file is no table, or quotes mean something else


def blank_stray_quotes(
    body: bytes, delimiter: str, comments: tuple[str, ...]
) -> tuple[bytes, tuple[int, ...]]:
    """Empty the lines with a stray quote.

    Parameters
    ----------
    body : bytes
        Lines of data with ``\\n`` ends.
    delimiter : str
        Between the fields.
    comments : tuple of str
        Marks at the start of a comment, which is emptied but not counted.

    Returns
    -------
    body : bytes
        With as many lines as before.
    lines : tuple of int
        Numbers of the emptied lines that were none of comment, from 0.

    Notes
    -----
    A quote within or behind a word (``5"``) hides no delimiter; where many lines have one it
    belongs there, and the lines stay.
    """
    if b'"' not in body:
        return body, ()
    good, suspect = _patterns(delimiter)
    found = [m for m in suspect.finditer(body) if _is_stray(m[0], good)]
    most = max(FEW, MOST_SHARE * body.count(b"\n"))
    if len(found) > most:
        found = [m for m in found if not good.fullmatch(m[0])]
    marks = tuple(mark.encode() for mark in comments)
    counted = [m.start() for m in found if not m[0].lstrip().startswith(marks)]
    return _without(body, found), tuple(_line_numbers(body, counted))


def closes(line: str, delimiter: str) -> bool:
    """Whether every quote that opens a field of a line is closed on it."""
    return '"' not in line or bool(_patterns(delimiter)[0].fullmatch(line.encode()))


def _is_stray(line: bytes, good: re.Pattern[bytes]) -> bool:
    return line.count(b'"') % 2 == 1 or not good.fullmatch(line)


@cache
def _patterns(delimiter: str) -> tuple[re.Pattern[bytes], re.Pattern[bytes]]:
    """A line whose quotes close as the parser reads them; lines that need that question."""
    d = re.escape(delimiter.encode())
    quoted = rb'"(?:[^"\n]|"")*+"'
    word = rb"(?:%b[^%b\n]*+|(?!\")[^%b\n]*+)" % (quoted, d, d)
    plain = rb"(?:%b|[^\"%b\n]*+)" % (quoted, d)
    good = re.compile(rb"%b(?:%b%b)*+" % (word, d, word))
    suspect = re.compile(rb"^(?!%b(?:%b%b)*+$)[^\n]+$" % (plain, d, plain), re.MULTILINE)
    return good, suspect


def _without(body: bytes, found: list[re.Match[bytes]]) -> bytes:
    parts, end = [], 0
    for match in found:
        parts.append(body[end : match.start()])
        end = match.end()
    return b"".join((*parts, body[end:]))


def _line_numbers(body: bytes, places: list[int]) -> list[int]:
    numbers, number, before = [], 0, 0
    for place in places:
        number += body.count(b"\n", before, place)
        numbers.append(number)
        before = place
    return numbers
