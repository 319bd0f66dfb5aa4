"""Text from outside (names, symbols, units) as it may stand in other languages.

Whatever the text holds, it ends no string, no comment and no line, and gives no orders to a
terminal. Of HTML the template engine is the one place.
"""

LONGEST_TEXT = 200  # characters of a name or value that a message quotes
LONGEST_PROBLEM = 2000  # ... of what is wrong with a trial and what to do about it


def quoted(text: str) -> str:
    r"""What stands between double quotes, the same in Python and in TOML.

    Quotes and backslashes come with a backslash; what does not print, ends of lines among it,
    as ``\uXXXX`` or ``\UXXXXXXXX``. It is one line, and has no quotes to end a docstring.
    """
    return "".join(f"\\{c}" if c in '"\\' else c if c.isprintable() else _code(c) for c in text)


def comment(text: str) -> str:
    """What stands in a comment that ends with its line: Python, TOML, MATLAB."""
    return "".join(c if c.isprintable() else _code(c) for c in text)


def xml_comment(text: str) -> str:
    """What stands in a comment of XML, which two hyphens would end; ends of lines stay."""
    lines = (comment(line) for line in text.split("\n"))
    return "\n".join(lines).replace("--", "-\u2010").replace("--", "-\u2010")


def encodable(text: str) -> str:
    r"""A text with ``\udcXX`` for what no encoding has: bytes of a file name that are no UTF-8."""
    return text.encode(errors="backslashreplace").decode()


def printable(text: str) -> str:
    r"""What a terminal may show: ends of lines, tabs, and nothing else that does not print.

    Escape sequences, which would move the cursor or change colours, and bytes of a file name that
    are no text come as ``\uXXXX``.
    """
    return "".join(c if c.isprintable() or c in "\n\t" else _code(c) for c in text)


def clipped(text: str, most: int = LONGEST_TEXT) -> str:
    """A text that is quoted in a message: the middle of a long one is left out, and said."""
    if len(text) <= most:
        return text
    kept = most // 2
    return f"{text[:kept]} ... ({len(text) - 2 * kept} characters) ... {text[-kept:]}"


def first_words(text: str, most: int) -> str:
    """As many words of a sentence as there is room for, with dots where some are left out."""
    return text if len(text) <= most else f"{text[:most].rsplit(' ', 1)[0]} ..."


def _code(character: str) -> str:
    number = ord(character)
    return f"\\u{number:04x}" if number <= 0xFFFF else f"\\U{number:08x}"


def csv_cell(value: str | float) -> str:
    """A cell of a CSV file; commas, quotes and ends of lines stand in quotes."""
    text = encodable(value) if isinstance(value, str) else repr(value)
    if not set(text) & set(',"\r\n'):
        return text
    return '"' + text.replace('"', '""') + '"'
