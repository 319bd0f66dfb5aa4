"""What a person sees of a model of six degrees of freedom."""

from rich.console import RenderableType
from rich.text import Text

from auvident.report.console_style import findings_lines, rich_table
from auvident.report.tables import Column, Rows, Table, Unit, WithStd, columns
from auvident.report.tables_whole import PLACE, rests_on
from auvident.schema.combined import CombinedModel


def combined_pieces(model: CombinedModel) -> list[RenderableType]:
    """Coefficients and constants with their origin; what no data stand behind."""
    title = f"{model.vehicle}: six degrees of freedom"
    rows: Rows = [
        [e.symbol, Unit(e.unit), WithStd(e.value, e.std), e.origin] for e in model.entries
    ]
    heads = (*columns(("symbol", "unit"), ("value ± std",)), Column("origin"))
    return [rich_table(Table(heads, rows, title)), *findings_lines(model.findings)]


def combined_brief(model: CombinedModel) -> list[RenderableType]:
    """Where it stands in a run, what its entries rest on, and what no data stand behind."""
    line = Text(f"Whole vehicle, six degrees of freedom: {PLACE}, {rests_on(model)}")
    return [line, *findings_lines(model.findings)]
