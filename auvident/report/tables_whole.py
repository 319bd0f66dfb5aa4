"""Tables of a model of six degrees of freedom; for the terminal and for the page."""

from collections import Counter

from auvident.report.tables import Column, Number, Rows, Table, Unit, WithStd, columns
from auvident.schema.combined import CombinedModel

PLACE = "combine/model.json"  # in a run of both planes


def entries(model: CombinedModel) -> Table:
    """Coefficients and constants with their origin."""
    heads = (
        *columns(("",)),
        Column("unit"),
        *columns(numbers=("value, ± std", "1000 × prime", "from data")),
        Column("origin"),
    )
    rows: Rows = [
        [
            e.symbol,
            Unit(e.unit),
            WithStd(e.value, e.std) if e.std > 0.0 else Number(e.value, 4),
            Number(1000.0 * e.prime, 4) if e.prime is not None else "",
            f"{100.0 * e.data_share:.0f} %" if e.origin.startswith("identified") else "",
            e.origin,
        ]
        for e in model.entries
    ]
    return Table(heads, rows, f"{model.vehicle}: six degrees of freedom")


def rests_on(model: CombinedModel) -> str:
    """How many entries rest on what: ``58 entries: 21 identified, vertical; 6 geometry``."""
    counts = Counter(e.origin for e in model.entries)
    told = "; ".join(f"{count} {origin}" for origin, count in counts.most_common())
    return f"{len(model.entries)} entries: {told}"
