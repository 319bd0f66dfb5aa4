"""What the HTML report is made of, and how its numbers are shown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from auvident.report.numbers import PAGE
from auvident.report.tables_evidence import Way, ways
from auvident.report.tables_run import kinds_of
from auvident.schema.artifacts import (
    AseResult,
    ChannelMetrics,
    Coverage,
    IdentifiedModel,
    ManeuverMetrics,
    Maneuvers,
    Metrics,
    ResidualTests,
    Role,
    TrialPlan,
)
from auvident.schema.combined import CombinedModel
from auvident.schema.desk import StandardManeuvers
from auvident.schema.diagnosis import ChannelError, Comparison, Diagnosis
from auvident.schema.logs import Quality
from auvident.schema.manifest import Manifest
from auvident.schema.planes import BY_PLANE, PLANE_ROWS, STATES
from auvident.schema.prior_errors import pooled_by_prior
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle

if TYPE_CHECKING:
    import pandas as pd

# Channels of a prediction in the order of the report: name in the metrics, stem of the columns
# of the simulation table, unit of the column, words.
CHANNELS = tuple((s.symbol, s.column, s.unit, s.words) for s in STATES)
number, quantity = PAGE.number, PAGE.quantity
# what the equations predict; heading and track are sums of it
DYNAMIC = tuple(dict.fromkeys(name for row in PLANE_ROWS for name in row.velocities))


@dataclass(frozen=True)
class ReportData:
    """Artifacts of a run, as far as they are there; what is missing is None or empty.

    Attributes
    ----------
    trials : sequence of Trial
    vehicle, quality, maneuvers, ase, model, metrics, manifest
        The artifacts of the stages.
    history, simulation : pandas.DataFrame or None
        ``identify/history.parquet`` and ``validate/simulation.parquet``.
    diagnosis, comparison
        What the model lacks, and what adding it changed.
    residuals, refined : pandas.DataFrame or None
        ``diagnose/residuals.parquet`` and ``refine/simulation.parquet``.
    refined_model, refined_history
        ``refine/model.json`` and ``refine/history.parquet``.
    refined_metrics
        ``refine/metrics.json``: how well the refined model predicts.
    standard
        Standard maneuvers flown with the model that the run ends with.
    planned : callable or None
        What another maneuver would add, which takes a while to find out.
    whole : CombinedModel or None
        Of six degrees of freedom, from both planes.
    others : sequence of ReportData
        The same of the planes beside the first one.
    """

    trials: Sequence[Trial] = ()
    vehicle: Vehicle | None = None
    quality: Quality | None = None
    maneuvers: Maneuvers | None = None
    ase: AseResult | None = None
    model: IdentifiedModel | None = None
    history: "pd.DataFrame | None" = None
    metrics: Metrics | None = None
    simulation: "pd.DataFrame | None" = None
    manifest: Manifest | None = None
    diagnosis: Diagnosis | None = None
    comparison: Comparison | None = None
    residuals: "pd.DataFrame | None" = None
    refined: "pd.DataFrame | None" = None
    refined_model: IdentifiedModel | None = None
    refined_history: "pd.DataFrame | None" = None
    refined_metrics: Metrics | None = None
    standard: StandardManeuvers | None = None
    planned: Callable[[], TrialPlan | None] | None = None
    whole: CombinedModel | None = None
    others: "Sequence[ReportData]" = ()

    @property
    def planes(self) -> "list[ReportData]":
        """Every plane by itself, the first one first."""
        return [replace(self, others=()), *self.others]

    @property
    def plan(self) -> TrialPlan | None:
        """What another maneuver would add."""
        return self.planned() if self.planned else None

    @property
    def plane(self) -> str:
        """The plane of the model; empty without one."""
        return self.model.plane if self.model else ""

    @property
    def fin(self) -> str:
        """The control surface that steers in its plane."""
        return BY_PLANE[self.model.plane].fin if self.model else "control"

    @property
    def tag(self) -> str:
        """What the names of its figures end in, so that those of two planes differ."""
        return "" if self.plane in ("", PLANE_ROWS[0].name) else f"-{self.plane}"

    @property
    def final_model(self) -> IdentifiedModel | None:
        """The model that the run ends with: the refined one, where it is another."""
        return self.refined_model if self.is_refined and self.refined_model else self.model

    @property
    def final_history(self) -> "pd.DataFrame | None":
        """How the coefficients of the final model came about."""
        refined = self.is_refined and self.refined_history is not None
        return self.refined_history if refined else self.history

    @property
    def superseded(self) -> IdentifiedModel | None:
        """The identified model, where the run ends with another."""
        return self.model if self.final_model is not self.model else None

    @property
    def final_simulation(self) -> "pd.DataFrame | None":
        """What the final model predicts; of the identified one where `final_metrics` is."""
        of_final = self.is_refined and self.refined_metrics is not None
        return self.refined if of_final and self.refined is not None else self.simulation

    @cached_property
    def ways(self) -> "list[Way]":
        """How the coefficients of the final model came to their values."""
        model, passes = self.final_model, self.final_history
        return ways(model, passes) if model is not None and passes is not None else []

    @property
    def final_metrics(self) -> Metrics | None:
        """How well the final model predicts; of the identified one where it is not known."""
        return self.refined_metrics if self.is_refined and self.refined_metrics else self.metrics

    @property
    def final_tests(self) -> Mapping[str, ResidualTests]:
        """Tests of what the final model leaves of the maneuvers that the errors are of."""
        return self.final_metrics.residuals.get(self.role, {}) if self.final_metrics else {}

    @property
    def earlier(self) -> str:
        """``identified `` where figures can only be those of the model before the final one."""
        known = not self.is_refined or self.refined_metrics is not None
        return "" if known else "identified "

    @property
    def name(self) -> str:
        """Name of the vehicle, from whatever knows it."""
        for source in (self.model, self.ase, self.quality):
            if source is not None:
                return source.vehicle
        return self.vehicle.body.name if self.vehicle else "unknown vehicle"

    @property
    def prior_name(self) -> str:
        """What the model is compared with: the estimate from geometry, else given values."""
        return "prior" if self.ase is not None and not self.ase.applies else "ASE"

    def held_out(self) -> tuple[ManeuverMetrics, ...]:
        """Predictions of the maneuvers that were held out."""
        return _held_out(self.metrics)

    def finally_held_out(self) -> tuple[ManeuverMetrics, ...]:
        """The same with the final model."""
        return _held_out(self.final_metrics)

    def before(self, maneuver: str) -> ManeuverMetrics | None:
        """The same maneuver predicted by the estimate from geometry."""
        ase = self.metrics.ase if self.metrics else None
        return next((m for m in ase.maneuvers if m.id == maneuver), None) if ase else None

    @property
    def is_refined(self) -> bool:
        """Whether `refine` made another model, which is then the final one."""
        rows = self.comparison.coefficients if self.comparison else ()
        return any(c.after != c.before for c in rows)

    @property
    def role(self) -> Role:
        """Maneuvers that the errors at the top are of: held out, where there are such."""
        held = self.metrics is None or "validate" in self.metrics.summary
        return "validate" if held else "identify"

    def identified_errors(self) -> dict[str, ChannelError]:
        """Pooled errors of the identified model."""
        pooled = self.metrics.summary.get(self.role, {}) if self.metrics else {}
        return {
            name: ChannelError(rmse=m.rmse, nrmse=m.nrmse, unit=m.unit)
            for name, m in pooled.items()
        }

    def final_errors(self) -> dict[str, ChannelError]:
        """Pooled errors of the final model: the refined one, where there is one.

        Over the same standard deviations as those of the identified one.
        """
        errors = self.identified_errors()
        if not self.is_refined or self.comparison is None:
            return errors
        held = self.role == "validate"
        pooled = (self.comparison.held_out if held else self.comparison.identify).after
        rmse = {name: e.rmse for name, e in pooled.items()}
        return {
            name: _with_rmse(e, rmse[name])
            for name, e in errors.items()
            if name in rmse and e.rmse > 0.0
        }

    @property
    def coverage(self) -> Mapping[str, Coverage]:
        """Coverage of the band of the final model, by channel."""
        if self.is_refined and self.comparison and self.comparison.coverage:
            return self.comparison.coverage
        return self.metrics.coverage if self.metrics else {}

    @property
    def kinds(self) -> dict[str, str]:
        """What each maneuver is called, by its id; empty where they are not known."""
        return kinds_of(self.maneuvers.maneuvers) if self.maneuvers else {}

    def refined_channels(self) -> dict[str, Mapping[str, ChannelMetrics | ChannelError]]:
        """Errors of every maneuver with the refined model; empty where there is none."""
        rows = self.comparison.maneuvers if self.comparison and self.is_refined else ()
        return {m.id: m.after for m in rows}

    def pooled_before(self, role: str) -> Mapping[str, ChannelMetrics]:
        """Pooled errors of the prior; empty when it did not predict the same maneuvers."""
        return pooled_by_prior(self.metrics, role) if self.metrics else {}


def _held_out(metrics: Metrics | None) -> tuple[ManeuverMetrics, ...]:
    return tuple(m for m in (metrics.maneuvers if metrics else ()) if m.role == "validate")


def _with_rmse(e: ChannelMetrics | ChannelError, rmse: float) -> ChannelError:
    """Another error of the same channel, over the same standard deviation."""
    nrmse = e.nrmse * rmse / e.rmse if e.rmse > 0.0 else 0.0
    return ChannelError(rmse=rmse, nrmse=nrmse, unit=e.unit)


def percent(share: float) -> str:
    """A share in percent, whole above 10 %."""
    return f"{100.0 * share:.0f}\u00a0%" if share >= 0.1 else f"{number(100.0 * share, 2)}\u00a0%"


def gain(
    before: ChannelMetrics | ChannelError | None, after: ChannelMetrics | ChannelError
) -> float | None:
    """Error before over error after: how many times smaller it is; None when unknown."""
    if before is None or after.rmse <= 0.0:
        return None
    return before.rmse / after.rmse
