"""A run directory as an object: models, errors, maneuvers, findings, signals, figures."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from auvident.api import frames
from auvident.api.geometry import GeometryEstimate
from auvident.api.model import Model
from auvident.api.signals import predictions, with_smoothed
from auvident.api.whole import WholeModel
from auvident.errors import StageError
from auvident.pipeline.ask import need, opened
from auvident.pipeline.freshness import outdated
from auvident.pipeline.given import Given
from auvident.pipeline.observer import Observer
from auvident.schema.planes import Plane

if TYPE_CHECKING:
    from auvident.api.plots import Plots
    from auvident.report.html_data import ReportData
    from auvident.schema.artifacts import Finding
    from auvident.schema.diagnosis import Comparison, Diagnosis
    from auvident.schema.logs import Quality
    from auvident.schema.vehicle import Vehicle


@dataclass(frozen=True)
class PlaneModels:
    """Models of one plane of a run.

    Attributes
    ----------
    identified : Model
        From the maneuvers, before what it lacks was traced.
    refined : Model or None
        With what it lacked; None before `refine`, or where nothing was added.
    """

    identified: Model
    refined: Model | None

    @property
    def final(self) -> Model:
        """The one that the run ends with."""
        return self.refined or self.identified


class Run:
    """A run directory: what `auvident.run` made, or a command line, here or on another machine.

    Artifacts are read when they are first asked for, and kept. A result whose stage is missing or
    stale raises `StageError`, which names the command to run.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, path: "str | Path") -> None:
        self.path = Path(path)
        self._given: Given = opened(self.path)

    def __repr__(self) -> str:
        planes = " and ".join(self.planes)
        return f"<Run {self.path}: {self.vehicle.body.name}, {planes or 'not identified'}>"

    # --- models ---------------------------------------------------------------------------

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Planes of motion that it has a model of, the first one first."""
        return self._given.planes

    @cached_property
    def vehicle(self) -> "Vehicle":
        """The vehicle file as it was read."""
        return self._given.vehicle

    @cached_property
    def models(self) -> dict[str, PlaneModels]:
        """Models by plane: ``run.models["horizontal"].identified``, ``.refined``, ``.final``.

        Warns where the run has changed since, or its refined model is gone or out of date.
        """
        need(self._given, "identify")
        told = outdated(self.path)
        if told:
            warnings.warn(told, stacklevel=3)
        return {view.plane or "": self._models(view) for view in self._views()}

    def _models(self, view: Given) -> PlaneModels:
        names = ("identify/model.json", "refine/model.json")
        own, new = (view.run / view.place(name) for name in names)
        refined = None
        if self._is_done("refine") and view.refined != view.model:
            refined = Model(view.refined, new)
        return PlaneModels(Model(view.model, own), refined)

    @property
    def model(self) -> Model:
        """The model that the run ends with; of a run of both planes that of the first one."""
        return next(iter(self.models.values())).final

    @cached_property
    def whole(self) -> WholeModel:
        """The model of six degrees of freedom of a run of both planes."""
        from auvident.pipeline.reporting import WHOLE
        from auvident.schema.combined import CombinedModel

        if len(self.planes) == 1:
            raise StageError(
                f"the run has a model of the {self.planes[0]} plane alone",
                str(self.path),
                f'`auvident.combine("{self.path}")` makes one of the whole vehicle, with the other '
                "plane from geometry.",
            )
        need(self._given, "combine")
        return WholeModel(self._given.read(WHOLE, CombinedModel), self.path / WHOLE, self.vehicle)

    @cached_property
    def estimate(self) -> GeometryEstimate:
        """The estimate from geometry (ASE) that the identification started from."""
        need(self._given, "ase")
        return GeometryEstimate(self._given.ase, self._given.vehicle)

    @cached_property
    def coefficients(self) -> pd.DataFrame:
        """Coefficients of the final models, by symbol; columns as of `Model.coefficients`.

        Of a run of both planes with the rows of both: ``plane`` tells them apart.
        """
        return pd.concat([models.final.coefficients for models in self.models.values()])

    # --- errors, findings -----------------------------------------------------------------

    @cached_property
    def heldout(self) -> pd.DataFrame:
        """Errors of the free-running prediction of the held-out maneuvers, by channel.

        Columns: ``plane``; ``unit``; ``rmse_ase``, ``rmse_identified``, ``rmse_refined`` (in the
        unit of the channel; NaN where there is no such model) and the same as ``nrmse_...`` (over
        the standard deviation of what was measured); ``r2`` of the final model; ``coverage``: the
        share of the samples within its band, ``coverage_nominal``, and the mean ``band_width``.
        """
        return frames.held_out_frame(self._data)

    @cached_property
    def maneuvers(self) -> pd.DataFrame:
        """Maneuvers by id: trial, kind, plane, role, times [s], why held out, features."""
        need(self._given, "segment")
        return frames.maneuver_frame(self._given.maneuvers.maneuvers)

    @property
    def quality(self) -> "Quality":
        """What `ingest` cleaned and remarked in the logs (the pydantic artifact)."""
        return self._given.quality

    @property
    def diagnosis(self) -> "Diagnosis":
        """What the model lacks (the pydantic artifact), in the first plane."""
        return next(iter(self.diagnoses.values()))

    @cached_property
    def diagnoses(self) -> "dict[str, Diagnosis]":
        """The same by plane."""
        need(self._given, "diagnose")
        return {view.plane or "": view.diagnosis for view in self._views()}

    @property
    def comparison(self) -> "Comparison":
        """What adding it changed (the pydantic artifact), in the first plane."""
        return next(iter(self.comparisons.values()))

    @cached_property
    def comparisons(self) -> "dict[str, Comparison]":
        """The same by plane."""
        need(self._given, "refine")
        return {view.plane or "": view.comparison for view in self._views()}

    @cached_property
    def findings(self) -> pd.DataFrame:
        """What every stage has to say before its numbers are trusted.

        Columns: ``stage``, ``plane`` (empty where it is of the whole run), ``code``, ``message``,
        ``where``, ``value``, ``threshold``, ``remedy``.
        """
        return frames.finding_frame(self._findings())

    def _findings(self) -> "Iterator[tuple[str, str, Finding]]":
        given = self._given
        yield from (("ingest", "", f) for f in given.quality.findings)
        yield from (("ingest", "", f) for t in given.quality.trials for f in t.findings)
        if self._is_done("ase"):
            yield from (("ase", "", f) for f in given.ase.findings)
        for stage, name in OF_A_PLANE.items():
            for view in self._views() if self._is_done(stage) else ():
                told: tuple[Finding, ...] = getattr(view, name).findings
                yield from ((stage, view.plane or "", f) for f in told)

    # --- series ---------------------------------------------------------------------------

    @cached_property
    def signals(self) -> pd.DataFrame:
        """Every trial on one clock, cleaned, in SI, with the smoothed states of the maneuvers.

        A row a time and ``trial``: ``time_s``, the channels (``u_mps``, ``rudder_rad``, ``rpm``,
        ...; signs of the axes, whatever those of the log were), ``<sensor>_sampled`` and
        ``record`` as `ingest` wrote them; ``maneuver``, and ``<state>_smoothed`` with
        ``<state>_smoothed_std``, as the identification estimated them; NaN elsewhere.
        """
        need(self._given, "ingest")
        states = []
        if self._is_done("identify"):
            states = [view.table("identify/states.parquet") for view in self._views()]
        return with_smoothed(self._given.trials, self.maneuvers if states else None, states)

    @cached_property
    def prediction(self) -> pd.DataFrame:
        """Every maneuver measured and predicted from its inputs alone.

        A row a time and ``maneuver``, with ``trial``, ``kind``, ``role``, ``plane``:
        ``<channel>_measured``, ``..._ase``, ``..._simulated`` (identified model), ``..._refined``
        (where there is one) and the band of the final model, ``..._lo`` to ``..._hi``.
        """
        return predictions(self._data)

    # --- report ---------------------------------------------------------------------------

    @property
    def plot(self) -> "Plots":
        """The figures of the report: ``run.plot.held_out()``, ``.coefficients()``, ``.track()``."""
        from auvident.api.plots import Plots

        return Plots(lambda: self._data)

    def report(self, observer: Observer | None = None) -> Path:
        """Write the HTML report, if it is not up to date, and say where it is."""
        from auvident.pipeline.run import run_stage
        from auvident.pipeline.table import BY_NAME

        if "report" not in opened(self.path).also:
            run_stage("report", self.path, observer=observer or Observer())
        return self.path / BY_NAME["report"].main

    def plan_trial(self, plane: Plane | None = None) -> pd.DataFrame:
        """Further maneuvers, ranked by what they would tell about the coefficients.

        Columns: ``what``, ``duration_s``, ``gain_nats`` and ``shrinks`` (by how much the standard
        deviations would), by name.
        """
        from auvident.pipeline.ask import plan_trial

        plan = plan_trial(self.path, Observer(), plane)
        return pd.DataFrame([c.model_dump() for c in plan.candidates]).set_index("name")

    @property
    def status(self) -> pd.DataFrame:
        """Which stages are done, stale, missing or not needed now, and why."""
        from auvident.pipeline.run import status

        decisions, _ = status(self.path)
        rows = [{"stage": d.stage, "state": d.state, "reason": d.reason} for d in decisions]
        return pd.DataFrame(rows).set_index("stage")

    # --- what it is made of ---------------------------------------------------------------

    def _views(self) -> list[Given]:
        """The artifacts of each plane."""
        return self._given.views()

    def _is_done(self, stage: str) -> bool:
        return stage in self._given.also

    @cached_property
    def _data(self) -> "tuple[ReportData, ...]":
        """What the report knows of each plane."""
        from auvident.pipeline.reporting import report_data

        need(self._given, "validate")
        return tuple(report_data(self._given, plans=False).planes)


# attribute of `Given` that has the findings of a stage
OF_A_PLANE = {
    "identify": "model",
    "validate": "metrics",
    "diagnose": "diagnosis",
    "refine": "comparison",
}
