"""What artifacts hold as data frames, one row a coefficient, channel, maneuver or finding."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from auvident.report.tables_model import SIGHT
from auvident.schema.artifacts import (
    AseCoefficient,
    AseResult,
    ChannelMetrics,
    Extrapolation,
    Finding,
    IdentifiedModel,
    Maneuver,
    ModelCoefficient,
    ModelConstant,
)
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.diagnosis import ChannelError
from auvident.schema.planes import Plane

if TYPE_CHECKING:
    from auvident.report.html_data import ReportData
    from auvident.schema.combined import CombinedModel
    from auvident.schema.desk import DeskFigure

COEFFICIENTS = (
    "symbol",
    "plane",
    "value",
    "std",
    "unit",
    "prior",
    "prior_std",
    "prime",
    "data_share",
    "status",
    "source",
    "regressor",
    "description",
)
MODELS = ("ase", "identified", "refined")
HELD_OUT = (
    "channel",
    "plane",
    "unit",
    *(f"rmse_{model}" for model in MODELS),
    *(f"nrmse_{model}" for model in MODELS),
    "r2",
    "coverage",
    "coverage_nominal",
    "band_width",
)
MANEUVERS = (
    "id",
    "trial",
    "kind",
    "plane",
    "role",
    "t_start_s",
    "t_end_s",
    "reason",
    "features",
)
FINDINGS = ("stage", "plane", "code", "message", "where", "value", "threshold", "remedy")
GIVEN = ("identified", "kinematic")  # origins of which the share of the data tells
HELD = "not estimated"


# --- models -------------------------------------------------------------------------------


def coefficient_frame(model: IdentifiedModel) -> pd.DataFrame:
    """Coefficients and constants of a model, by symbol."""
    rows = [_coefficient(c, model.plane) for c in model.estimates]
    return pd.DataFrame(rows, columns=COEFFICIENTS).set_index("symbol")


def _coefficient(c: ModelConstant, plane: Plane) -> dict[str, Any]:
    declared = ESTIMATED[c.symbol]
    return {
        "symbol": c.symbol,
        "plane": plane,
        "value": c.value,
        "std": c.std,
        "unit": c.unit,
        "prior": c.prior,
        "prior_std": c.prior_std,
        "prime": c.prime if isinstance(c, ModelCoefficient) else np.nan,
        "data_share": c.data_share,
        "status": status_of(c),
        "source": c.origin,
        "regressor": declared.regressor,
        "description": declared.meaning,
    }


def status_of(c: ModelConstant) -> str:
    """What the data say of a coefficient, in the words of the report."""
    if c.origin not in GIVEN:
        return HELD
    return next(name for least, name in SIGHT if c.data_share >= least)


def effect_frame(model: IdentifiedModel) -> pd.DataFrame:
    """Parameters of the effects of a model, by effect and parameter."""
    rows = [
        {
            "effect": effect["id"],
            "parameter": p["symbol"],
            "value": p["value"],
            "std": p["std"],
            "unit": p["unit"],
            "family": effect["family"],
            "nuisance": bool(effect.get("nuisance", False)),
        }
        for effect in model.effects
        for p in effect["parameters"]
    ]
    names = ("effect", "parameter", "value", "std", "unit", "family", "nuisance")
    return pd.DataFrame(rows, columns=names).set_index(["effect", "parameter"])


def correlation_frame(model: IdentifiedModel) -> pd.DataFrame:
    """Correlations of what was estimated together."""
    from auvident.report.figures_coefficients import correlations_of

    symbols = list(model.covariance.get("symbols", ()))
    return pd.DataFrame(correlations_of(model.covariance), index=symbols, columns=symbols)


def whole_frame(model: "CombinedModel") -> pd.DataFrame:
    """Coefficients and constants of a model of six degrees of freedom, by symbol."""
    rows = [e.model_dump(exclude={"sign"}) for e in model.entries]
    table = pd.DataFrame(rows).set_index("symbol").rename(columns={"origin": "source"})
    return table.astype({"prime": float})


# --- geometry -----------------------------------------------------------------------------


def estimate_frame(ase: AseResult) -> pd.DataFrame:
    """Coefficients and constants of an estimate from geometry, by symbol, with their parts."""
    rows = [
        {
            "symbol": c.symbol,
            "plane": c.plane,
            "value": c.value,
            "std": c.std,
            "unit": c.unit,
            "prime": c.prime if isinstance(c, AseCoefficient) else np.nan,
            "source": c.origin if isinstance(c, AseCoefficient) else c.source,
            "regressor": ESTIMATED[c.symbol].regressor,
            "description": ESTIMATED[c.symbol].meaning,
        }
        for c in ase.estimates
    ]
    return pd.DataFrame(rows).set_index("symbol")


def part_frame(ase: AseResult) -> pd.DataFrame:
    """What each part of the vehicle contributes to each coefficient; zero where nothing."""
    parts = {c.symbol: c.parts for c in ase.coefficients}
    return pd.DataFrame.from_dict(parts, orient="index").fillna(0.0).rename_axis("symbol")


# --- runs ---------------------------------------------------------------------------------


def held_out_frame(planes: Sequence["ReportData"]) -> pd.DataFrame:
    """Pooled errors of the held-out maneuvers, a row a channel and plane."""
    rows = [row for data in planes for row in _held_out(data)]
    return pd.DataFrame(rows, columns=HELD_OUT).set_index("channel")


def _held_out(data: "ReportData") -> list[dict[str, Any]]:
    metrics, found = data.metrics, []
    if metrics is None or "validate" not in metrics.summary:
        return []
    before, final = data.pooled_before("validate"), data.final_errors()
    refined = data.comparison if data.is_refined else None
    coverage = refined.coverage if refined else metrics.coverage
    for channel, own in metrics.summary["validate"].items():
        errors: dict[str, ChannelMetrics | ChannelError | None] = {}
        errors |= {"ase": before.get(channel), "identified": own}
        errors["refined"] = final.get(channel) if refined else None
        last = errors["refined"] or own
        row: dict[str, Any] = {"channel": channel, "plane": data.plane, "unit": own.unit}
        row |= {f"rmse_{name}": e.rmse if e else np.nan for name, e in errors.items()}
        row |= {f"nrmse_{name}": e.nrmse if e else np.nan for name, e in errors.items()}
        # both are over the variance of what was measured
        row["r2"] = own.r2 if last is own else 1.0 - last.nrmse**2
        band = coverage.get(channel)
        row["coverage"] = band.covered if band else np.nan
        row["coverage_nominal"] = band.nominal if band else np.nan
        row["band_width"] = band.width if band else np.nan
        found.append(row)
    return found


def maneuver_frame(maneuvers: Iterable[Maneuver]) -> pd.DataFrame:
    """Maneuvers by their id: trial, kind, plane, role, times, and what was measured of each."""
    rows = [
        {
            "id": m.id,
            "trial": m.trial,
            "kind": m.kind,
            "plane": m.plane,
            "role": m.role,
            "t_start_s": m.t_start_s,
            "t_end_s": m.t_end_s,
            "reason": m.reason,
            "features": m.features,
        }
        for m in maneuvers
    ]
    return pd.DataFrame(rows, columns=MANEUVERS).set_index("id")


def finding_frame(found: Iterable[tuple[str, str, Finding]]) -> pd.DataFrame:
    """Findings of stages (stage, plane, finding), in their order."""
    rows = [
        {
            "stage": stage,
            "plane": plane,
            "code": f.code,
            "message": f.message,
            "where": f.where,
            "value": np.nan if f.value is None else f.value,
            "threshold": np.nan if f.threshold is None else f.threshold,
            "remedy": f.remedy,
        }
        for stage, plane, f in found
    ]
    return pd.DataFrame(rows, columns=FINDINGS)


def figure_frame(figures: Iterable["DeskFigure"]) -> pd.DataFrame:
    """Figures of a maneuver by name: value, 90 % interval, unit."""
    rows = [f.model_dump(include={"name", "value", "low", "high", "unit"}) for f in figures]
    return pd.DataFrame(rows, columns=["name", "value", "low", "high", "unit"]).set_index("name")


def range_frame(found: Mapping[str, Extrapolation]) -> pd.DataFrame:
    """Quantities by which a motion leaves what was flown: reaches, identified, unit."""
    rows = [{"quantity": name, **far.model_dump()} for name, far in found.items()]
    columns = ["quantity", "reaches", "identified", "unit"]
    return pd.DataFrame(rows, columns=columns).set_index("quantity")
