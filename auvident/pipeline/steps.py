"""One function a stage: artifacts in, the stage's own function called, artifacts out.

Imports stand inside for speed: a command loads only what it uses.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.parallel import load_beside
from auvident.pipeline.flights import Flights
from auvident.pipeline.given import Given
from auvident.pipeline.observer import Observer

if TYPE_CHECKING:
    import pandas as pd

    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.diagnosis import Attempt, Comparison, UnexplainedForce
    from auvident.schema.plan import Plan
    from auvident.schema.planes import Plane
    from auvident.schema.trial import Columns, Trial
    from auvident.stages.identify import Identification, Shared
    from auvident.stages.validate import Validation

    _Again = tuple[Identification, Validation]

COMPILING = "Compiling the numerical kernels, once on this machine: about half a minute."
COMPILING_EACH_TIME = (
    "Compiling the numerical kernels, about half a minute in every run: the folder that "
    "caches them is not writable. Set NUMBA_CACHE_DIR to one that is."
)
NOT_ALONG = (
    "A model with all small effects, which `pool` would take, could not be identified: {problem}"
)
DEFAULT_PLAN = "refined"
LEAST_UNDER_WAY_MPS = 0.3  # slower samples do not belong to a run at speed
PREDICTED = "prediction and standard maneuvers of the identified model"
# figures of the trials, which the helper draws while the model is refined
TRIALS_DRAWN = ("figures of the trials", None)
# of a prediction, while the diagnosis runs: that of an hour at 10 Hz has 10 MB
MOST_KEPT_BYTES = 2**26


# --- segment, ase -------------------------------------------------------------------------


def segment(given: Given) -> dict[str, Any]:
    """Find the maneuvers; the plain list is the artifact, what was rejected stands beside it."""
    from auvident.stages.segment import segment_both

    found = segment_both(given.trials, given.options["hold_out"])
    return {
        "segment/maneuvers.json": found.maneuvers,
        "segment/rejected.json": {
            "schema": "auvident/rejected/1",
            "rejected": found.rejected,
            "findings": found.findings,
        },
    }


def ase(given: Given) -> dict[str, Any]:
    """Estimate the coefficients from geometry."""
    from auvident.stages.ase import estimate

    stated = given.vehicle.body.design_speed_mps
    speed = stated or cruising_speed(given.trials)
    return {"ase/coefficients.json": estimate(given.vehicle, speed)}


def cruising_speed(trials: "list[Trial]") -> float | None:
    """Median speed under way, None when the vehicle never is."""
    import numpy as np

    speeds = np.concatenate([trial.columns["u_mps"] for trial in trials])
    under_way = speeds[speeds > LEAST_UNDER_WAY_MPS]  # NaN compares false
    return float(np.median(under_way)) if under_way.size else None


# --- identify -----------------------------------------------------------------------------


def plan_source(options: Mapping[str, Any]) -> list[Path]:
    """Files of the plan; read at once, so that a fault stops the run before anything is done."""
    from auvident.storage.plan_file import plan_files, read_plan

    read_plan(options["plan"])
    return plan_files(options["plan"])


def begin_with_kernels(observer: Observer, filter: str = "ekf") -> None:
    """Begin with the kernels, and tell the user why the first use takes longer.

    Another thread loads what they need, and what tells of the result, while this one does what is
    not compiled.
    """
    from auvident.jit import begin_beside, cache_is_writable, compiled_already

    begin_beside()
    load_beside("auvident.report.console")
    if not cache_is_writable():
        observer.note(COMPILING_EACH_TIME)
    elif not compiled_already(filter):
        observer.note(COMPILING)


def identify(given: Given) -> dict[str, Any]:
    """Estimate the coefficients from the maneuvers that identify."""
    begin_with_kernels(given.observer, given.options["filter"])
    from auvident.stages.identify import identify as estimate_jointly
    from auvident.storage.plan_file import read_plan

    plan = read_plan(given.options["plan"])
    result = estimate_jointly(
        given.trials,
        given.maneuvers,
        given.ase,
        given.vehicle,
        given.noise(),
        plane=_plane(given),
        plan=plan,
        filter=given.options["filter"],
        engine=given.options["engine"],
        shared=_shared(given.former.get("identify/model.json") if given.is_beside else None),
        progress=given.observer.progress,
    )
    return {
        "identify/model.json": result.model,
        "identify/history.parquet": result.history,
        "identify/states.parquet": result.states,
    }


def _plane(given: Given) -> "Plane":
    """The plane that a stage works on."""
    assert given.plane is not None
    return given.plane


def _shared(first: "IdentifiedModel | None") -> "Shared | None":
    """What the first plane of the run knows of the coefficients of both; None in that plane."""
    from auvident.stages.identify import shared_of

    return shared_of(first) if first is not None else None


def _first_model(given: Given) -> "IdentifiedModel | None":
    """The identified model of the first plane of the run, None in that plane."""
    return given.within(given.planes[0]).model if given.is_beside else None


# --- validate -----------------------------------------------------------------------------


def validate(given: Given) -> dict[str, Any]:
    """Re-simulate the maneuvers with the identified model and with the estimate."""
    begin_with_kernels(given.observer)
    result = _predicted(given)
    standard = Flights(given).of(given.model, result)
    if result.simulation.memory_usage().sum() <= MOST_KEPT_BYTES:
        given.kept[PREDICTED, given.plane] = result, standard
    return {
        "validate/metrics.json": result.metrics,
        "validate/simulation.parquet": result.simulation,
        "validate/standard.json": standard,
    }


def _predicted(given: Given) -> "Validation":
    """The prediction with the identified model."""
    from auvident.stages.validate import validate as predict_again

    return predict_again(given.trials, given.maneuvers, given.model, estimated=given.ase.applies)


# --- diagnose, refine ---------------------------------------------------------------------


def identifying_plan(given: Given) -> "Plan":
    """The plan that the model was identified with; a changed one has made it stale already."""
    from auvident.storage.plan_file import read_plan

    entry = given.manifest.stages["identify"] if given.manifest else None
    name = entry.options["plan"] if entry else DEFAULT_PLAN
    file = given.run.located(name)
    return read_plan(file if file.exists() or file.suffix == ".toml" else name)


def diagnose(given: Given) -> dict[str, Any]:
    """Trace what the model does not explain to an effect that it lacks."""
    begin_with_kernels(given.observer, given.model.filter)
    from auvident.stages.diagnose import diagnose as trace
    from auvident.stages.diagnose import told_by
    from auvident.stages.identify import prepare, without_held_out

    load_beside("scipy.optimize")  # its fits at the edge of what physics allows need it
    first = given.former.get("diagnose/diagnosis.json") if given.is_beside else None
    told = told_by(first, given.maneuvers) if first else []
    setup = prepare(
        given.trials,
        given.maneuvers,
        given.ase,
        given.vehicle,
        given.noise(),
        plane=given.model.plane,
        plan=identifying_plan(given),
        filter=given.model.filter,
        engine=given.model.engine,
        # a model that lacks what was found has it in its drag and thrust
        shared=None if told else _shared(_first_model(given)),
    )
    seen = [without_held_out(t, given.maneuvers, given.model.plane) for t in given.trials]
    result = trace(
        seen,
        given.maneuvers,
        given.vehicle,
        setup,
        given.model,
        told=told,
        progress=given.observer.progress,
    )
    return {
        "diagnose/diagnosis.json": result.diagnosis,
        "diagnose/residuals.parquet": result.residuals,
    }


@dataclass(frozen=True)
class _Refined:
    """A model that a refinement may end with, the history of its coefficients, its prediction."""

    model: "IdentifiedModel"
    history: "pd.DataFrame | Columns"
    prediction: "Validation"


def refine(given: Given) -> dict[str, Any]:
    """Add the traced effects, identify again, compare the errors of what was held out."""
    from auvident.stages.desk import greatest_laid_deg

    filter = given.options["filter"] or given.model.filter
    begin_with_kernels(given.observer, filter)
    kept, standard = given.kept.pop((PREDICTED, given.plane), (None, None))
    history = given.table("identify/history.parquet")
    before = _Refined(given.model, history, kept or _predicted(given))
    flights = Flights(given, greatest_laid_deg(before.prediction.simulation))
    again = partial(_identified_again, given, filter, flights)
    carried, named, tried = _with_effects(given, filter, before, again)
    final, force = named, None
    if given.options.get("with_unexplained"):
        final, force = _with_force(given, carried, named, again)
    comparison = _compared(given, before, named, final, tried, force)
    along = _estimated_along(given, filter, comparison, final.model, final.prediction)
    return {
        "refine/model.json": final.model,
        "refine/comparison.json": comparison,
        "refine/history.parquet": final.history,
        "refine/simulation.parquet": final.prediction.simulation,
        "refine/metrics.json": final.prediction.metrics,
        "refine/standard.json": (final is before and standard)
        or flights.of(final.model, final.prediction),
        **along,
    }


def _with_effects(
    given: Given, filter: str, before: _Refined, again: "Callable[[Any], _Again]"
) -> "tuple[Any, _Refined, tuple[Attempt, ...]]":
    """What is carried and the model with it, the one before where that predicts better; attempts.

    Another filter than that of the model before is a reason to identify again by itself.
    """
    from auvident.stages.refine import carried_of, choose

    found, small = carried_of(given.diagnosis), _small_effects(given, before)
    made, tried = choose(found, given.model, before.prediction, again, small)
    if made is not None:
        return made.carried, _refined(made.found, before), tried
    if found is None and filter != given.model.filter:
        return None, _refined(again(None), before), tried
    return None, before, tried


def _refined(found: "_Again | None", before: _Refined) -> _Refined:
    """What was identified again; the model before where nothing was."""
    return _Refined(found[0].model, found[0].history, found[1]) if found else before


def _compared(
    given: Given,
    before: _Refined,
    named: _Refined,
    final: _Refined,
    tried: "tuple[Attempt, ...]",
    force: "UnexplainedForce | None",
) -> "Comparison":
    """The model before beside the one that the refinement ends with."""
    from auvident.schema.diagnosis import CrossValidated
    from auvident.stages.refine import compare

    old, new = before.prediction.metrics, final.prediction.metrics
    return compare(
        given.diagnosis,
        given.maneuvers,
        before.model,
        final.model,
        before.prediction.simulation,
        final.prediction.simulation,
        attempts=tried,
        seed=given.seed or 0,
        predicted=new.findings,
        cross_validation=CrossValidated(before=old.cross_validation, after=new.cross_validation),
        force=force,
        named=named.model,
    ).model_copy(update={"coverage": new.coverage})


def _small_effects(given: Given, before: _Refined) -> Any:
    """What is tried without a claim where the identified model is far off; None: it is not."""
    from auvident.stages.refine import gives_away, unclaimed
    from auvident.stages.refine.errors import cruise_of

    simulation = before.prediction.simulation
    if not gives_away(given.diagnosis, given.maneuvers, simulation):
        return None
    return unclaimed(given.diagnosis, before.model, cruise_of(simulation)[0])


def _estimated_along(
    given: Given,
    filter: str,
    comparison: "Comparison",
    model: "IdentifiedModel",
    prediction: "Validation",
) -> dict[str, Any]:
    """The model that the trial is pooled by, where the run ends with one that has less."""
    from auvident.errors import NumericsError
    from auvident.stages.identify import headings_compare
    from auvident.stages.refine import along
    from auvident.stages.refine.errors import cruise_of

    claimed, (speed, _) = {e.id for e in comparison.effects}, cruise_of(prediction.simulation)
    heading = headings_compare(given.trials, given.maneuvers, model.plane)
    carried = along(given.diagnosis, claimed, model, speed, heading=heading)
    if carried is None:
        return {}
    plan = _from_here(identifying_plan(given))
    try:
        return {"refine/along.json": _identified_with(given, filter, carried, plan).model}
    except NumericsError as error:
        given.observer.note(NOT_ALONG.format(problem=error.problem))
        return {}


def _from_here(plan: "Plan") -> "Plan":
    """The refinement of the prediction alone, where a plan ends with it.

    It ends where it does after all stages, as the diagnosis has brought the coefficients near.
    """
    last = plan.stage[-1]
    if last.method != "output_error":
        return plan
    return plan.model_copy(update={"stage": (last,), "cycles": 1})


def _with_force(
    given: Given, carried: Any, named: _Refined, again: "Callable[[Any], _Again]"
) -> "tuple[_Refined, UnexplainedForce]":
    """The model with a force without a name beside what it carries, if that predicts better."""
    from auvident.stages.refine import Base, with_unexplained

    nuisance = identifying_plan(given).nuisance
    made, force = with_unexplained(
        Base.of(carried, nuisance, named.model, named.prediction),
        again,
        given.maneuvers,
        heading=any(t.has_heading for t in given.trials),
        seed=given.seed or 0,
    )
    return _refined(made.found if made else None, named), force


def _identified_again(given: Given, filter: str, flights: Flights, carried: Any) -> "_Again":
    """Identify with what was found, and predict."""
    from auvident.stages.validate import validate as predict_again

    result = _identified_with(given, filter, carried)
    flights.begin(result.model)
    return result, predict_again(
        given.trials, given.maneuvers, result.model, estimated=given.ase.applies
    )


def _identified_with(
    given: Given, filter: str, carried: Any, plan: "Plan | None" = None
) -> "Identification":
    """Identify with effects carried, by the plan of the identification or another one."""
    from auvident.stages.identify import identify as estimate_jointly

    return estimate_jointly(
        given.trials,
        given.maneuvers,
        given.ase,
        given.vehicle,
        given.noise(),
        plane=given.model.plane,
        plan=plan or identifying_plan(given),
        filter=filter,
        engine=given.model.engine,
        carried=carried,
        shared=_shared(given.former.get("refine/model.json") or _first_model(given)),
        progress=given.observer.progress,
    )


# --- combine ------------------------------------------------------------------------------


def combine(given: Given) -> dict[str, Any]:
    """One model of six degrees of freedom from the models that the planes end with."""
    from auvident.stages.combine import combine as join

    views = [given.within(plane) for plane in given.planes]
    refined = ["refine" in given.also and v.has("refine/model.json") for v in views]
    models = [v.refined if new else v.model for v, new in zip(views, refined, strict=True)]
    logs = [(given.trials, given.maneuvers)]
    joined = join(models, given.vehicle, given.ase, logs=logs)
    files = [
        v.place("refine/model.json" if new else "identify/model.json")
        for v, new in zip(views, refined, strict=True)
    ]
    sources = tuple(
        source.model_copy(update={"file": file})
        for source, file in zip(joined.models, files, strict=True)
    )
    return {"combine/model.json": joined.model_copy(update={"models": sources})}


# --- report -------------------------------------------------------------------------------


def report(given: Given) -> dict[str, Any]:
    """Everything that the run knows as one HTML file."""
    from auvident.pipeline.reporting import figures_of_run, report_data, shared_out
    from auvident.report.html import draw, render

    early = given.kept.pop(TRIALS_DRAWN, None)
    theirs, own = shared_out(with_trials=early is None)
    others = given.helper.begin(figures_of_run, given.run.path, given.also, given.planes, theirs)
    data = report_data(given)
    if given.helper.is_beside:
        _ = [view.plan for view in data.planes]  # while the other process draws
        drawn = draw(data, parts=own).beside(others())
        drawn = replace(drawn, trials=early()) if early else drawn
        pages = {"report/report.html": render(data, drawn=drawn)}
    else:
        pages = {"report/report.html": render(data)}
    if given.options["interactive"]:
        pages["report/interactive.html"] = render(data, live=True)
    return pages
