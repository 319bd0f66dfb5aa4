"""What a person sees of pooled trials and of a campaign."""

from rich.console import RenderableType
from rich.text import Text

from auvident.report import tables_campaign as tables
from auvident.report.console_style import findings_lines, rich_table
from auvident.schema.campaign import CampaignResult
from auvident.schema.changes import Changes
from auvident.schema.pooled import PooledModel

ABOUT_CHANGES = ("few-trials", "order-as-given", "small-changes")  # findings of a search


def pooled_pieces(model: PooledModel, found: Changes) -> list[RenderableType]:
    """Trials, coefficients with the shares of the data, what to know of them, changes."""
    pieces: list[RenderableType] = [
        rich_table(tables.pooled_trials(model.pooling.trials)),
        rich_table(tables.pooled_parameters(model)),
        Text(tables.seen(model)),
        *findings_lines(model.findings),
        *change_pieces(found),
    ]
    return pieces


def change_pieces(found: Changes) -> list[RenderableType]:
    """Changes, or that there is none."""
    pieces: list[RenderableType] = []
    if found.changes:
        pieces += [rich_table(tables.changes(found))]
    if text := tables.no_change(found):
        pieces += [Text(text)]
    return [*pieces, *findings_lines([f for f in found.findings if f.code in ABOUT_CHANGES])]


def campaign_pieces(result: CampaignResult) -> list[RenderableType]:
    """Trials, what each vehicle's say together and what changed, what to repeat."""
    pieces: list[RenderableType] = [rich_table(tables.campaign_trials(result))]
    for v in result.vehicles:
        pieces.append(Text(f"{v.title}: {tables.told_of(v)}"))
        if v.changes is not None:
            pieces += change_pieces(v.changes)
    if any(v.repeat for v in result.vehicles):
        pieces.append(rich_table(tables.repeats(result)))
    return pieces
