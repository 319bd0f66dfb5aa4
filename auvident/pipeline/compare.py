"""Several run directories side by side: coefficients, and errors on what was held out."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.pipeline.freshness import is_of_this_run, outdated
from auvident.pipeline.given import Given
from auvident.pipeline.planes import planes_of
from auvident.pipeline.predict import REFINED, find_model
from auvident.pipeline.table import BY_NAME
from auvident.schema.artifacts import RAN_AWAY, Finding
from auvident.schema.places import BESIDE
from auvident.schema.planes import PLANES
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel

METRICS = "validate/metrics.json"
VALIDATE = BY_NAME["validate"]
FIN_DRAG = "X_uudd"  # of the fin that steers in the plane


def compare_runs(paths: Sequence[Path]) -> dict[str, Any]:
    """Coefficients and held-out errors.

    Parameters
    ----------
    paths : sequence of Path
        Run directories with an identified model, or files of models, which have no errors.

    Returns
    -------
    dict
        ``runs`` (path, vehicle, its length, plane, filter, model file, maneuvers held out, those
        whose prediction diverges, verdict of the refinement, what changed since it was made),
        ``coefficients`` (symbol, unit, and by run value and std; ``apart``: greatest difference
        from the first run in standard deviations of the difference), ``effects`` (the same of
        the parameters of effects that were added), ``held_out`` (channel, unit, and by run rmse
        and nrmse). A refined model and its errors take the place of the identified ones. None
        stands where a run has no such value. Where a run has another plane beside the first,
        ``planes`` has the same for that plane, over all runs that have it.

    Raises
    ------
    StageError
        A run directory without a model.
    """
    compared = _compared(paths, None)
    planes = {path: planes_of(RunDirectory(path)) for path in paths if path.is_dir()}
    if any(len(found) > 1 for found in planes.values()):
        own = [path for path in paths if BESIDE in planes.get(path, ())]
        compared["planes"] = {BESIDE: _compared(own, BESIDE)}
    return compared


def _compared(paths: Sequence[Path], plane: str | None) -> dict[str, Any]:
    """The runs in their first plane, or in that of a name."""
    models = [find_model(path, plane) for path in paths]
    held_out = [_held_out(path, file) for path, (file, _) in zip(paths, models, strict=True)]
    return {
        "schema": "auvident/compare/1",
        "runs": [
            {
                "run": str(path),
                "vehicle": model.vehicle,
                "length_m": model.length_m,
                "plane": model.plane,
                "filter": model.filter,
                "engine": model.engine,
                "plan": model.plan,
                "model": str(file),
                "held_out": errors["maneuvers"],
                "ran_away": errors.get("ran_away", []),
                "verdict": errors.get("verdict"),
                "outdated": outdated(path) if path.is_dir() else "",
            }
            for path, (file, model), errors in zip(paths, models, held_out, strict=True)
        ],
        "coefficients": _coefficients([model for _, model in models]),
        "effects": _rows([errors.get("effects", {}) for errors in held_out]),
        "held_out": _errors([errors["channels"] for errors in held_out]),
    }


def _held_out(path: Path, model_file: Path) -> dict[str, Any]:
    """Maneuvers that validate, and pooled errors by channel; empty before `validate`.

    A model by itself (a pooled one, a copy) has none.
    """
    if not path.is_dir():
        return {"maneuvers": [], "channels": {}}
    given = Given(RunDirectory(path), planes=PLANES)
    given = given.within(PLANES[model_file.parent.name == BESIDE])
    if model_file == given.run / given.place(REFINED):
        comparison = given.comparison
        return {
            "maneuvers": list(comparison.held_out.maneuvers),
            "ran_away": _ran_away(comparison.findings),
            "channels": comparison.held_out.after,
            "verdict": comparison.verdict,
            "effects": {f"{e.id}.{p.symbol}": p for e in comparison.effects for p in e.parameters},
        }
    if not given.has(METRICS) or not is_of_this_run(VALIDATE, given.run, given.run.existing()):
        return {"maneuvers": [], "channels": {}}
    metrics = given.metrics
    maneuvers = [m.id for m in metrics.maneuvers if m.role == "validate"]
    return {
        "maneuvers": maneuvers,
        "ran_away": _ran_away(metrics.findings),
        "channels": metrics.summary.get("validate", {}),
    }


def _ran_away(findings: Sequence[Finding]) -> list[str]:
    """Where the prediction diverges."""
    return [f.where for f in findings if f.code == RAN_AWAY]


def _coefficients(models: "Sequence[IdentifiedModel]") -> list[dict[str, Any]]:
    """Values by symbol; the drag of the rudder is no other value of that of the elevator."""
    rows = _rows([{c.symbol: c for c in m.estimates} for m in models])
    if len({m.plane for m in models}) > 1:
        return [{**row, "apart": None} if row["symbol"] == FIN_DRAG else row for row in rows]
    return rows


def _rows(tables: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Values with their standard deviations by name, one column a run."""
    rows = []
    for symbol in dict.fromkeys(s for table in tables for s in table):
        found = [table.get(symbol) for table in tables]
        first = found[0]
        apart = [
            abs(c.value - first.value) / (c.std**2 + first.std**2) ** 0.5
            for c in found[1:]
            if c is not None and first is not None and c.std + first.std > 0.0
        ]
        rows.append(
            {
                "symbol": symbol,
                "unit": next(c.unit for c in found if c is not None),
                "value": [c.value if c else None for c in found],
                "std": [c.std if c else None for c in found],
                "apart": max(apart, default=None),
            }
        )
    return rows


def _errors(tables: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for channel in dict.fromkeys(c for table in tables for c in table):
        found = [table.get(channel) for table in tables]
        rows.append(
            {
                "channel": channel,
                "unit": next(c.unit for c in found if c is not None),
                "rmse": [c.rmse if c else None for c in found],
                "nrmse": [c.nrmse if c else None for c in found],
            }
        )
    return rows
