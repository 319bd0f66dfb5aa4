"""What the README says of trust: ``python -m tests.bench.headline`` writes it.

The figures stand in docs/benchmarks.md, where the studies have written them; here they are put
into sentences. A test holds the README to them.
"""

import re
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.bench.written import PAGE, PLACE

README = Path(__file__).resolve().parents[2] / "README.md"
SECTION, WIDTH = "trust", 118
A_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")

SAMPLES = """
On trials of an independent 6-DOF simulator, held-out errors fall from {before} of the standard
deviation (geometry alone) to {fast} in surge and yaw, {v} in sway, {q} in pitch rate, {w} in heave.
"""
SHELF = """
On `sample_logs/shelf_trial`, a dive with a fault that nobody declared, the loop names it
(`{used}`): errors fall from {u} in surge, {w} in heave, {q} in pitch rate.
"""
POPULATION = """
Of trials of vehicles drawn at random, on which nothing was tuned, {false} with nothing planted get
a false name and {unexplained} end `unexplained`; of the planted effects that the program says it
would see {named} get their name or one of their group; a wrong name stands in {wrong}.
"""
TANKER = """
On measured zigzags of a tanker model, which is far from an AUV, the errors fall from {before} (a
regression formula) to {after} with what the loop finds; those of the zigzags it is found on, each
left out in turn, are {own} before and {left} after. The heading is not predicted.
"""
DAMAGE = """
Of {n} logs of drawn vehicles that were damaged on purpose, {well} were read right, refused, or the
fault was said; {quiet} gave a wrong model without a word.
"""
INTERVALS = """
Stated 95 % intervals cover {own} % of coefficients where the vehicle is as the equations say,
{other} % of steady motions of vehicles that are not, {helm} % of those with the rudder put over.
"""

Row = dict[str, str]
Tables = dict[str, list[Row]]


def tables(name: str) -> Tables:
    """Tables of a section of the benchmarks, rows by title."""
    text = PAGE.read_text(encoding="utf-8")
    (body,) = re.findall(PLACE.format(name=re.escape(name)), text, re.DOTALL)
    pieces = re.split(r"^\*\*(.+)\*\*$", body, flags=re.MULTILINE)
    return {title: _rows(own) for title, own in zip(pieces[1::2], pieces[2::2], strict=True)}


def _rows(body: str) -> list[Row]:
    heads, _, *rows = (line[2:-2].split(" | ") for line in body.strip().splitlines())
    return [dict(zip(heads, row, strict=True)) for row in rows]


def row_of(rows: Iterable[Row], column: str, value: str) -> Row:
    """The row that has a value in a column."""
    (found,) = (row for row in rows if row[column] == value)
    return found


def number(cell: str) -> float:
    """The first number of a cell."""
    found = A_NUMBER.search(cell)
    if found is None:
        raise ValueError(f"no number in {cell!r}")
    return float(found[0])


def span(cells: Iterable[str]) -> str:
    """Smallest and largest of some errors; once if they are alike."""
    values = sorted(map(float, cells))
    ends = (f"{x:.1f}" if x >= 1.0 else f"{x:.2f}" for x in (values[0], values[-1]))
    return " to ".join(dict.fromkeys(ends))


def before_and_after(cell: str) -> str:
    """The two errors of a cell, rounded."""
    return " to ".join(f"{float(x):.2f}" for x in cell.split(", "))


def of_100(percent: str) -> str:
    """A share among a hundred; of less than one its first digit."""
    share = number(percent)
    return f"{share:.1f} of 100" if 0.0 < share < 1.0 else f"{share:.0f} of 100"


def bars_of(name: str) -> dict[str, str]:
    """What was found, by bar, in a study on drawn vehicles."""
    return {row["what"]: row["found"] for row in tables(name)["bars"]}


def sentences() -> Iterator[str]:
    """What is said, one sentence for each study."""
    clean, loop = tables("samples")["held-out errors"], tables("loop")
    own = {c: [r["identified (ekf)"] for r in clean if r["channel"] == c] for c in "uvrwq"}
    yield SAMPLES.format(
        before=span(r["starting values"] for r in clean),
        fast=span(own["u"] + own["r"]),
        **{channel: span(own[channel]) for channel in "vqw"},
    )
    shelf = row_of(loop["the same in the vertical plane"], "trial", "shelf_trial")
    yield SHELF.format(used=shelf["used"], **{c: before_and_after(shelf[c]) for c in "uwq"})
    found, more = (bars_of(name) for name in ("population", "population-shown-single"))
    yield POPULATION.format(
        false=of_100(found["nothing planted: a name the vehicle has not"]),
        unexplained=of_100(found["nothing planted: unexplained"]),
        named=of_100(more["visible: named or in its group"]),
        wrong=of_100(found["planted: a wrong name"]),
    )
    measured = row_of(loop["held-out errors before and after"], "trial", "kvlcc2")
    formula = tables("tanker")["four zigzags from the other nine"]
    nine = tables("tanker")["the nine, each left out in turn, before and after `refine`"]
    own, left = (
        span(row[key].split(" ")[0] for row in nine if row["channel"] in "uvr")
        for key in ("before", "after")
    )
    yield TANKER.format(
        own=own,
        left=left,
        before=span(row["starting values"] for row in formula),
        after=span(measured[c].split(", ")[1] for c in "uvr"),
    )
    damaged = row_of(tables("damage")["outcomes by family"], "family", "all")
    yield DAMAGE.format(
        n=damaged["n"],
        well=of_100(damaged["well %"]),
        quiet=of_100(damaged["quietly wrong %"]),
    )
    (plans,), (totals,) = tables("recovery").values(), tables("totals").values()
    flown = row_of(totals, "total", "ahead and turning")
    put_over = row_of(totals, "total", "rudder put over")
    yield INTERVALS.format(
        own=f"{number(plans[0]['95 % covers']):.0f}",
        other=f"{number(flown['95 % covers']):.0f}",
        helm=f"{number(put_over['95 % covers']):.0f}",
    )


def section() -> str:
    """The list as it stands in the README."""
    lines = (f"* {' '.join(sentence.split())}" for sentence in sentences())
    filled = (textwrap.fill(line, WIDTH, subsequent_indent="  ") for line in lines)
    return "\n".join(filled) + "\n"


def main() -> None:
    """Write the list into the README."""
    text = README.read_text(encoding="utf-8")
    place = re.compile(PLACE.format(name=SECTION), re.DOTALL)
    README.write_text(place.sub(lambda _: section(), text), encoding="utf-8")


if __name__ == "__main__":
    main()
