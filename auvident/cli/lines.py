"""Texts in lines that end between words, on a terminal."""

import os
import shutil
import sys
import textwrap


def in_lines(text: str) -> str:
    """A text as wide as the terminal that standard error is, or as COLUMNS says; else as it is.

    A path or a command stays whole, as it is there to be copied, and what follows an indented line
    is as far in.
    """
    if not (sys.stderr.isatty() or "COLUMNS" in os.environ):
        return text
    columns = shutil.get_terminal_size().columns
    return "\n".join(_wrapped(line, columns) for line in text.split("\n"))


def _wrapped(line: str, columns: int) -> str:
    indent = line[: len(line) - len(line.lstrip())]
    lines = textwrap.wrap(
        line,
        columns,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines)
