"""Sections of docs/benchmarks.md, each written by the part that measured it.

A section stands between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; what stands outside of
these marks is written by people and left alone.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md"
ELSEWHERE = {  # sections of other pages
    "exports": "exports.md",
    "campaign-cost": "campaigns.md",
    "season": "campaigns.md",
    "season-steady": "campaigns.md",
    "left-out-trials": "campaigns.md",
}
PLACE = r"(?<=<!-- begin {name} -->\n).*?(?=<!-- end {name} -->\n)"

Rows = list[dict[str, Any]]


def write(name: str, measured: str, tables: Mapping[str, Rows]) -> None:
    """Replace one section of the page.

    Parameters
    ----------
    name : str
        Of the section.
    measured : str
        One sentence: which program, how many trials, which seeds.
    tables : mapping of str to list of dict
        Rows by title.

    Raises
    ------
    ValueError
        When the page has no place for the section, or several.
    """
    page = PAGE.with_name(ELSEWHERE.get(name, PAGE.name))
    text = page.read_text(encoding="utf-8")
    place = re.compile(PLACE.format(name=re.escape(name)), re.DOTALL)
    if len(place.findall(text)) != 1:
        raise ValueError(f"{page.name} needs one pair of marks 'begin {name}', 'end {name}'")
    pieces = [measured, *(f"**{title}**\n\n{table(rows)}" for title, rows in tables.items())]
    body = "\n" + "\n\n".join(piece for piece in pieces if piece) + "\n\n"
    page.write_text(place.sub(lambda _: body, text), encoding="utf-8")


def table(rows: Rows) -> str:
    """Rows as a table in Markdown; the first says what the columns are."""
    heads = [str(name).replace("_", " ") for name in rows[0]] if rows else []
    lines = [heads, ["---"] * len(heads), *([cell(v) for v in row.values()] for row in rows)]
    return "\n".join(_line(line) for line in lines)


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def cell(value: Any) -> str:
    """A value as the console shows it, safe between the bars of a table."""
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ")
