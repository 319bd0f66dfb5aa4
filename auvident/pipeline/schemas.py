"""JSON schemas of the artifacts and of the files that users write."""

from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import JsonSchemaMode

from auvident.schema.artifacts import AseResult, IdentifiedModel, Maneuver, Metrics, TrialPlan
from auvident.schema.base import Declared
from auvident.schema.campaign import Campaign, CampaignResult
from auvident.schema.changes import Changes
from auvident.schema.combined import CombinedModel
from auvident.schema.desk import DeskResult, StandardManeuvers
from auvident.schema.diagnosis import Comparison, Diagnosis
from auvident.schema.logs import ColumnMap, Quality
from auvident.schema.manifest import Manifest
from auvident.schema.plan import Plan
from auvident.schema.pooled import PooledModel
from auvident.schema.vehicle import Vehicle

# Name -> file it describes and its class.
SCHEMAS: dict[str, tuple[str, Any]] = {
    "vehicle": ("the vehicle file (TOML)", Vehicle),
    "map": ("the column map (TOML)", ColumnMap),
    "plan": ("a plan of the identification (TOML)", Plan),
    "campaign": ("a campaign file (TOML)", Campaign),
    "campaign-result": ("campaign.json", CampaignResult),
    "run": ("run.json", Manifest),
    "quality": ("ingest/quality.json", Quality),
    "maneuvers": ("segment/maneuvers.json", list[Maneuver]),
    "ase": ("ase/coefficients.json", AseResult),
    "model": ("identify/model.json", IdentifiedModel),
    "pooled": ("what pool writes", PooledModel),
    "changes": ("what pool --changes writes", Changes),
    "combined": ("what combine writes", CombinedModel),
    "trial-plan": ("what plan-trial prints", TrialPlan),
    "desk": ("what simulate --maneuver prints", DeskResult),
    "metrics": ("validate/metrics.json", Metrics),
    "standard": ("validate/standard.json", StandardManeuvers),
    "diagnosis": ("diagnose/diagnosis.json", Diagnosis),
    "comparison": ("refine/comparison.json", Comparison),
}
# Other names that users try: the stems of the files.
ALIASES = {"coefficients": "ase", "manifest": "run"}


def json_schema(name: str) -> dict[str, Any]:
    """JSON schema by a name of `SCHEMAS`; of an artifact as it is written, of a file as read."""
    model = SCHEMAS[name][1]
    written = not (isinstance(model, type) and issubclass(model, Declared))
    mode: JsonSchemaMode = "serialization" if written else "validation"
    return TypeAdapter(model).json_schema(by_alias=True, mode=mode)
