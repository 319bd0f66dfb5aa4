"""JSON schemas of the artifacts and of the files that users write."""

from typing import Any

from pydantic import BaseModel, TypeAdapter

from auvident.schema.artifacts import AseResult, IdentifiedModel, Maneuver, Metrics, TrialPlan
from auvident.schema.diagnosis import Comparison, Diagnosis
from auvident.schema.logs import ColumnMap, Quality
from auvident.schema.manifest import Manifest
from auvident.schema.plan import Plan
from auvident.schema.vehicle import Vehicle

# Name -> file it describes and its class.
SCHEMAS: dict[str, tuple[str, Any]] = {
    "vehicle": ("the vehicle file (TOML)", Vehicle),
    "map": ("the column map (TOML)", ColumnMap),
    "plan": ("a plan of the identification (TOML)", Plan),
    "run": ("run.json", Manifest),
    "quality": ("ingest/quality.json", Quality),
    "maneuvers": ("segment/maneuvers.json", list[Maneuver]),
    "ase": ("ase/coefficients.json", AseResult),
    "model": ("identify/model.json", IdentifiedModel),
    "trial-plan": ("what plan-trial prints", TrialPlan),
    "metrics": ("validate/metrics.json", Metrics),
    "diagnosis": ("diagnose/diagnosis.json", Diagnosis),
    "comparison": ("refine/comparison.json", Comparison),
}
# Other names that users try: the stems of the files.
ALIASES = {"coefficients": "ase", "manifest": "run"}


def json_schema(name: str) -> dict[str, Any]:
    """JSON schema by a name of `SCHEMAS`."""
    model = SCHEMAS[name][1]
    if isinstance(model, type) and issubclass(model, BaseModel):
        return model.model_json_schema(by_alias=True)
    return TypeAdapter(model).json_schema(by_alias=True)
