"""Tables of the study of damaged logs, and the page of the documentation that they make."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tests.bench import written
from tests.bench.damage_names import may_name
from tests.bench.damage_score import OUTCOMES, QUIETLY_WRONG, WELL, Row
from tests.bench.written import table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "damaged-logs.md"
LONGEST_MESSAGE = 140  # letters
HEAD = """# Damaged logs

<!-- written by `python -m tests.bench damage --write`; not to be edited -->

An instrument may refuse; it may not be quietly wrong. {kinds} kinds of damage ({cases} with their
sizes) were done to clean logs of drawn vehicles, which carry every sensor; the chain ran to the
validation, and the coefficients were held against those of the clean log.
`sample_logs/seatrial/damage` has the kinds as rows of a table;
`python -m tests.bench damage --kinds NAME --seeds N` tries single ones.

{measured}

"""
OF_OUTCOMES = """## What the outcomes mean

"""
SHARES = """
*Well* is right, refused, said or untested; *at best* is what no program could better (a log that
can be read right is not refused); *quietly wrong* is misnamed or quiet. *Off* is the largest
difference of an informed coefficient, the *held-out error* that of the damaged log's model on the
clean log, over that of the clean log's own model; of several vehicles the worst.
"""
OF_CHECKS = """
Of the faults that a check may name, alone in a log: how many it told, how many were refused (by it
or by another), and how many did no harm; several checks may name one fault.
"""
Table = list[dict[str, Any]]


def tables(rows: list[Row]) -> dict[str, Table]:
    """Everything that is printed."""
    return {
        "by family": by_family(rows),
        "not well": by_case([r for r in rows if r.outcome not in WELL]),
        "every kind": by_case(rows),
    }


def family_of(row: Row) -> str:
    """Family of the only kind, or how many kinds there are."""
    from seatrial.damage import CASES

    return CASES[row.damage[0]].kind.family if len(row.damage) == 1 else "several at once"


def by_family(rows: list[Row]) -> Table:
    """Counts of the outcomes, and shares.

    Well is right, refused, said or untested; at best is what no program could better (a log that
    could be read right is not refused); quietly wrong is misnamed or quiet.
    """
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(family_of(row), []).append(row)
    groups["all"] = rows
    seen = [o for o in OUTCOMES if any(row.outcome == o for row in rows)]
    return [{"family": name, **_counted(found, seen)} for name, found in groups.items() if found]


def _counted(rows: list[Row], seen: list[str]) -> dict[str, Any]:
    counts = Counter(row.outcome for row in rows)
    well, wrong = (sum(counts[o] for o in some) for some in (WELL, QUIETLY_WRONG))
    return {
        "n": len(rows),
        **{outcome: counts[outcome] for outcome in seen},
        "well %": round(100 * well / len(rows)),
        "at best %": round(100 * sum(row.as_best for row in rows) / len(rows)),
        "quietly wrong %": round(100 * wrong / len(rows), 1),
    }


def by_check(rows: list[Row], clean: Table) -> Table:
    """What each check did for the faults that it may name, and how often it cried wolf."""
    from seatrial.damage import CASES

    from auvident.stages.ingest.checks import CHECKS
    from auvident.stages.ingest.clocks import LIMITS, PREFIX

    logs = next((row["of"] for row in clean if row["code"] == "any"), 0)
    alarms = {row["code"]: row["n"] for row in clean}
    codes = {check.name: {check.name, check.finding} for check in CHECKS}
    codes |= {PREFIX + sensor: {PREFIX + sensor} for sensor in LIMITS}
    alone = [(row, CASES[row.damage[0]].kind.fault) for row in rows if len(row.damage) == 1]
    found = []
    for name, own in codes.items():
        faults = [row for row, fault in alone if may_name(name, fault)]
        counts = Counter(row.outcome for row in faults)
        found.append(
            {
                "check": f"`{name}`",
                "faults": len(faults),
                "told by it": sum(bool(own & set(row.named)) for row in faults),
                "refused": counts["refused"],
                "harmless": counts["right"],
                "quietly wrong": sum(counts[o] for o in QUIETLY_WRONG),
                f"false alarms of {logs}": max((alarms.get(code, 0) for code in own), default=0),
            }
        )
    return found


def by_case(rows: list[Row]) -> Table:
    """One row a case: outcomes on the vehicles, what was said, how far off."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(row.damage, []).append(row)
    return [_case(found) for found in groups.values()]


def _case(rows: list[Row]) -> dict[str, Any]:
    counts = Counter(row.outcome for row in rows)
    worst = max(rows, key=lambda row: list(OUTCOMES).index(row.outcome))
    stds = max((row.stds for row in rows if row.stds is not None), default=None)
    ratio = max((row.ratio for row in rows if row.ratio is not None), default=None)
    return {
        "damage": " + ".join(rows[0].damage),
        "what": words(rows[0]),
        "best": rows[0].best,
        "outcome": ", ".join(f"{o} {n}" if len(rows) > 1 else o for o, n in counts.items()),
        "off [std]": "-" if stds is None else f"{stds:.1f}",
        "held-out error": "-" if ratio is None else f"x {ratio:.2f}",
        "message": shortened(worst.message),
    }


def words(row: Row) -> str:
    """What was done."""
    from seatrial.damage import CASES

    return "; ".join(CASES[name].words for name in row.damage)


def shortened(text: str) -> str:
    """A message that fits into a table."""
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_MESSAGE else text[: LONGEST_MESSAGE - 3] + "..."


def page(rows: list[Row], clean: Table, how: str) -> str:
    """The page as it should be."""
    from seatrial.damage import CASES, KINDS

    alone = [row for row in rows if len(row.damage) == 1]
    several = [row for row in rows if len(row.damage) > 1]
    wrong = [row for row in alone if row.outcome in QUIETLY_WRONG]
    cases = len({row.damage for row in alone})
    how += f" {cases} of the {len(CASES)} cases were run." * (cases < len(CASES))
    pieces = [
        HEAD.format(kinds=len(KINDS), cases=len(CASES), measured=how),
        table(by_family(rows)) + "\n\n",
        OF_OUTCOMES,
        table([{"outcome": f"`{o}`", "means": text} for o, text in OUTCOMES.items()]) + "\n",
        SHARES,
        *_section("Quietly wrong", by_case(wrong), "Nothing: every fault was said or harmless."),
    ]
    for family in dict.fromkeys(family_of(row) for row in alone):
        some = [row for row in alone if family_of(row) == family]
        pieces += _section(family.capitalize(), by_case(some))
    if clean:
        pieces += [*_section("Checks", by_check(rows, clean)), OF_CHECKS]
        pieces += _section("Clean logs", clean)
    if several:
        pieces += _section("Several at once", by_case(several))
    return "".join(pieces)


def _section(title: str, rows: Table, nothing: str = "") -> Iterable[str]:
    body = table(rows) if rows else nothing
    return (f"\n## {title}\n\n", body, "\n")


def write(rows: list[Row], clean: Table, how: str) -> None:
    """Write the page, and the section of the benchmarks."""
    PAGE.write_text(page(rows, clean, how), encoding="utf-8")
    found = {"outcomes by family": by_family(rows), "said of clean logs": clean}
    written.write("damage", how, {title: some for title, some in found.items() if some})
