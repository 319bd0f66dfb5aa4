"""The page of a campaign: one HTML file, nothing outside of it but links to the runs, no script."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from auvident import __version__
from auvident.report import tables_campaign as tables
from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.schema.campaign import CampaignResult, CampaignVehicleResult
from auvident.schema.pooled import PooledModel
from auvident.schema.quoting import LONGEST_PROBLEM

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

FOLDER = Path(__file__).resolve().parent


@dataclass(frozen=True)
class TrialLine:
    """A row of the table of trials; the address of its report, empty where there is none."""

    address: str
    cells: Sequence[str]
    failed: bool


def render_campaign(result: CampaignResult, models: Mapping[str, PooledModel]) -> str:
    """The page; reports are linked by their place in the output."""
    from auvident.report.figures import style

    with style():
        vehicles = [_vehicle(v, models.get(v.title), result) for v in result.vehicles]
    return _template().render(
        version=__version__,
        vehicles=vehicles,
        count=len({v.name for v in result.vehicles}),
        trials=len(result.trials),
        failed=sum(t.state == "failed" for t in result.trials),
        repeats=tables.repeats(result, longest=LONGEST_PROBLEM),
    )


@cache
def _template() -> "Template":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(FOLDER), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["written"] = lambda table: written(table, PAGE)
    return environment.get_template("campaign.html")


def _vehicle(
    vehicle: CampaignVehicleResult, model: PooledModel | None, result: CampaignResult
) -> dict[str, Any]:
    """What the page shows of a vehicle."""
    own = [t for t in result.trials if t.vehicle == vehicle.name]
    found = vehicle.changes
    channels = tables.channels_of(own)
    return {
        "name": vehicle.title,
        "id": vehicle.title.replace(" ", "-").replace(",", ""),
        "told": tables.told_of(vehicle),
        "grade": _grade(vehicle, model),
        "sentences": [c.sentence for c in found.changes] if found else [],
        "unchanged": tables.no_change(found) if found else "",
        "changes": tables.changes(found) if found and found.changes else None,
        "figure": _drawn(found),
        "parameters": tables.pooled_parameters(model) if model else None,
        "findings": [
            *vehicle.findings,
            *(f for f in (found.findings if found else ()) if f not in vehicle.findings),
        ],
        "heads": ("trial", "began", "result", *(f"NRMSE {c}" for c in channels), "from data",
                  "distance", "pooled"),
        "lines": [] if vehicle.second else [_line(t, channels) for t in own],
    }  # fmt: skip


def _grade(vehicle: CampaignVehicleResult, model: PooledModel | None) -> str:
    """Poor with a problem or a change, fair where a trial is missing or trials disagree."""
    if vehicle.problem or (vehicle.changes and vehicle.changes.changes):
        return "poor"
    missing = vehicle.pooled < vehicle.trials
    return "fair" if missing or (model is not None and tables.disagree(model)) else "good"


def _drawn(found: Any) -> "Markup | str":
    from markupsafe import Markup

    if found is None or not found.series:
        return ""
    from auvident.report.figures_campaign import over_trials

    return Markup(over_trials(found))


def _line(t: Any, channels: Sequence[str]) -> TrialLine:
    failed = t.state == "failed"
    address = "" if failed else quote(f"{t.vehicle}/{t.trial}/report/report.html")
    return TrialLine(
        address,
        (
            t.trial,
            t.date.replace("T", " ")[:16],
            tables.outcome(t),
            *(PAGE.number(error, 2) for error in tables.errors_in(t, channels)),
            f"{t.from_data} of {t.coefficients}" if t.coefficients else "",
            PAGE.number(t.fits, 2),
            tables.pooled_word(t),
        ),
        failed,
    )
