"""One function a stage: artifacts in, the stage's own function called, artifacts out.

Imports stand inside for speed: a command loads only what it uses.
"""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import AuvidentError, InputError
from auvident.pipeline.given import Given
from auvident.pipeline.naming import named_alike, not_here
from auvident.pipeline.observer import Observer

if TYPE_CHECKING:
    from auvident.schema.artifacts import Finding, IdentifiedModel
    from auvident.schema.diagnosis import Attempt, UnexplainedForce
    from auvident.schema.logs import ColumnMap, SetAside, TrialQuality
    from auvident.schema.plan import Plan
    from auvident.schema.planes import Plane
    from auvident.schema.trial import Trial
    from auvident.schema.vehicle import Vehicle
    from auvident.stages.identify import Identification, Shared
    from auvident.stages.ingest import Fingerprint
    from auvident.stages.validate import Validation
    from auvident.storage.log_find import TrialSource

    _Again = tuple[Identification, Validation]

COMPILING = "Compiling the numerical kernels, once on this machine: about half a minute."
COMPILING_EACH_TIME = (
    "Compiling the numerical kernels, about half a minute in every run: the folder that "
    "caches them is not writable. Set NUMBA_CACHE_DIR to one that is."
)
DEFAULT_PLAN = "refined"
NAMED_FEW = 5  # paths in one finding
LEAST_UNDER_WAY_MPS = 0.3  # slower samples do not belong to a run at speed


# --- ingest -------------------------------------------------------------------------------


def ingest(given: Given) -> dict[str, Any]:
    """Read the logs and the vehicle file, bring every trial to one clock."""
    from auvident.schema.logs import Quality
    from auvident.stages.ingest import refuse_unproposed, stated_noise_for
    from auvident.storage.declared import outside_allowed
    from auvident.storage.vehicle_file import load_vehicle

    with outside_allowed(bool(given.options.get("allow_outside"))):
        vehicle = load_vehicle(Path(given.options["vehicle"]))
    aside = _Aside(given)
    used: dict[str, _Ingested] = {}
    sources = _trial_sources(given, aside)
    for source in sources:
        with aside.instead_of(source):
            _add(given, vehicle, source, used, aside, alone=len(sources) == 1)
    if not used:
        raise aside.none_left()
    proposed = {name for done in used.values() for name in done.proposed}
    refuse_unproposed(tuple(given.options.get("fix", ())), proposed)
    outputs: dict[str, Any] = {
        f"ingest/{name}.parquet": done.trial.table for name, done in used.items()
    }
    qualities = tuple(done.quality for done in used.values())
    outputs["ingest/vehicle.json"] = stated_noise_for(vehicle, qualities)
    report = Quality.model_validate(
        {
            "vehicle": vehicle.body.name,
            "rate_hz": given.options["rate_hz"],
            "trials": qualities,
            "findings": (*aside.findings(), *_left_out_findings(given.options)),
            "set_aside": aside.told(),
        }
    )
    outputs["ingest/quality.json"] = named_alike(report, given.options["logs"])
    return outputs


@dataclass(frozen=True)
class _Ingested:
    """A trial in use, what tells whether another one is the same, and corrections it proposes."""

    source: "TrialSource"
    trial: "Trial"
    quality: "TrialQuality"
    fingerprint: "Fingerprint | None"
    proposed: frozenset[str]


def _add(
    given: Given,
    vehicle: "Vehicle",
    source: "TrialSource",
    used: dict[str, _Ingested],
    aside: "_Aside",
    *,
    alone: bool,
) -> None:
    """Read one trial, hold it against the others, bring it to one clock."""
    from auvident.stages.ingest import fingerprint, ingest_fixed, without_copies
    from auvident.storage.logs import read_trial

    given.observer.progress(f"reading {source.place}")
    raw = read_trial(source, _column_map(given.options))
    _refuse_namesake(raw.name, used)
    own = None if alone else fingerprint(raw)
    parts: tuple[str, ...] = ()
    if own is not None:
        known = [done.fingerprint for done in used.values() if done.fingerprint is not None]
        raw, parts = without_copies(raw, own, known, replaceable=aside.may_lack(used))
    done = ingest_fixed(
        raw,
        vehicle,
        tuple(given.options.get("fix", ())),
        rate_hz=given.options["rate_hz"],
        max_gap_s=given.options["max_gap_s"],
    )
    for name in parts:
        aside.replaced(used.pop(name).source, raw.name)
    used[done.trial.name] = _Ingested(source, done.trial, done.quality, own, done.proposed)


class _Aside:
    """Trials that cannot be used: raised at once, unless the others do without them."""

    def __init__(self, given: Given) -> None:
        self.given = given
        self.faults: list[tuple[str, AuvidentError]] = []

    def may_fail(self, source: "TrialSource") -> bool:
        """Whether the run goes on without a trial."""
        return source.among_others or bool(self.given.options.get("keep_going"))

    def may_lack(self, used: Mapping[str, _Ingested]) -> frozenset[str]:
        """Names of the trials in use that could give way to another one."""
        return frozenset(name for name, done in used.items() if self.may_fail(done.source))

    @contextmanager
    def instead_of(self, source: "TrialSource") -> Iterator[None]:
        """Note why a trial cannot be used."""
        try:
            yield
        except InputError as error:
            if not self.may_fail(source):
                raise
            self.note(source.name, error)

    def note(self, trial: str, error: AuvidentError) -> None:
        """Set a trial aside."""
        self.given.observer.refused(str(error))
        self.faults.append((trial, error))

    def replaced(self, source: "TrialSource", by: str) -> None:
        """Set a trial aside that is a part of a longer one."""
        problem = f"trial {source.name} is a part of trial {by}, which is used"
        remedy = "Leave it out: a maneuver of both would be held out in one and seen in the other."
        self.note(source.name, InputError(problem, str(source.place), remedy))

    def none_left(self) -> AuvidentError:
        """The error when no trial is left, with the reason of each."""
        from auvident.storage.log_find import Fault, none_usable

        return none_usable([Fault(Path(t), e) for t, e in self.faults if isinstance(e, InputError)])

    def findings(self) -> "tuple[Finding, ...]":
        """What leads the findings of the run."""
        from auvident.schema.artifacts import Finding

        return tuple(
            Finding(code="log_refused", message=e.problem, where=e.where, remedy=e.remedy)
            for _, e in self.faults
        )

    def told(self) -> "tuple[SetAside, ...]":
        """The trials and why."""
        from auvident.schema.logs import SetAside

        return tuple(
            SetAside(trial=t, reason=e.problem, where=e.where, remedy=e.remedy)
            for t, e in self.faults
        )


def _trial_sources(given: Given, aside: _Aside) -> "list[TrialSource]":
    """Every trial among the logs; those that are none are noted where the others do without."""
    from auvident.storage.log_find import Fault, find_trials

    column_map = _column_map(given.options)
    found: list[TrialSource] = []
    for group in _groups(given.options):
        faults: list[Fault] = []
        try:
            found += find_trials(group, column_map, faults)
        except InputError as error:
            if not given.options.get("keep_going"):
                raise
            aside.note(group[0].stem, error)
        for fault in faults:
            aside.note(fault.path.stem, fault.error)
    return found


def _groups(options: Mapping[str, Any]) -> list[list[Path]]:
    """All logs together; one by one where one may fail (sensor files belong together)."""
    paths = [not_here(Path(p)) for p in options["logs"]]
    if not options.get("keep_going"):
        return [paths]
    files = [p for p in paths if p.is_file()]
    alone = [[p] for p in paths if not p.is_file()]
    return [*alone, files] if files else alone


def _refuse_namesake(name: str, known: Collection[str]) -> None:
    """Refuse a second trial of one name; logs that are searched one by one may have such."""
    if name in known:
        raise InputError(
            f"two trials are named {name!r}",
            f"trial {name}",
            "Rename one of the files or folders: a trial is named after it.",
        )


def _left_out_findings(options: Mapping[str, Any]) -> "tuple[Finding, ...]":
    """Outputs of this program among the logs, which are none."""
    from auvident.schema.artifacts import Finding
    from auvident.storage.log_own import left_out

    found = left_out([not_here(Path(p)) for p in options["logs"]])
    if not found:
        return ()
    names = ", ".join(str(p) for p in found[:NAMED_FEW])
    names += ", ..." if len(found) > NAMED_FEW else ""
    return (
        Finding(
            code="own_outputs_left_out",
            message=f"{len(found)} outputs of auvident among the logs were skipped",
            where=names,
            value=float(len(found)),
        ),
    )


def _column_map(options: Mapping[str, Any]) -> "ColumnMap | None":
    from auvident.storage.declared import outside_allowed
    from auvident.storage.logs import read_column_map

    with outside_allowed(bool(options.get("allow_outside"))):
        return read_column_map(Path(options["map"])) if options["map"] else None


def ingest_sources(options: Mapping[str, Any]) -> list[Path]:
    """Files of the logs, the map, the vehicle file and its offsets file."""
    from auvident.storage.declared import file_named_in, outside_allowed, read_toml
    from auvident.storage.log_find import find_trials

    vehicle = Path(options["vehicle"])
    sources = [vehicle]
    hull = read_toml(vehicle).get("hull")
    if isinstance(hull, dict) and isinstance(hull.get("offsets"), str):
        with outside_allowed(bool(options.get("allow_outside"))):
            sources.append(file_named_in(vehicle, hull["offsets"], "[hull] offsets"))
    if options["map"]:
        sources.append(Path(options["map"]))
    column_map = _column_map(options)
    for group in _groups(options):
        try:
            sources += [f for trial in find_trials(group, column_map, []) for f in trial.files]
        except InputError:
            if not options.get("keep_going"):
                raise
    return list(dict.fromkeys(sources))


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

    speeds = np.concatenate([trial.table["u_mps"].to_numpy() for trial in trials])
    under_way = speeds[speeds > LEAST_UNDER_WAY_MPS]  # NaN compares false
    return float(np.median(under_way)) if under_way.size else None


# --- identify -----------------------------------------------------------------------------


def plan_source(options: Mapping[str, Any]) -> list[Path]:
    """Files of the plan; read at once, so that a fault stops the run before anything is done."""
    from auvident.storage.plan_file import plan_files, read_plan

    read_plan(options["plan"])
    return plan_files(options["plan"])


def announce_compilation(observer: Observer, filter: str = "ekf") -> None:
    """Tell the user why the first use takes longer."""
    from auvident.jit import cache_is_writable, compiled_already

    if not cache_is_writable():
        observer.note(COMPILING_EACH_TIME)
    elif not compiled_already(filter):
        observer.note(COMPILING)


def identify(given: Given) -> dict[str, Any]:
    """Estimate the coefficients from the maneuvers that identify."""
    from auvident.stages.identify import identify as estimate_jointly
    from auvident.storage.plan_file import read_plan

    plan = read_plan(given.options["plan"])
    announce_compilation(given.observer, given.options["filter"])
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
    """The identified model of the first plane of the run, None in that plane.

    Also for the refinement, so that a model before and after it differ in the effects alone.
    """
    return given.within(given.planes[0]).model if given.is_beside else None


# --- validate -----------------------------------------------------------------------------


def validate(given: Given) -> dict[str, Any]:
    """Re-simulate the maneuvers with the identified model and with the estimate."""
    announce_compilation(given.observer)
    from auvident.stages.validate import validate as predict_again

    result = predict_again(given.trials, given.maneuvers, given.model, estimated=given.ase.applies)
    return {
        "validate/metrics.json": result.metrics,
        "validate/simulation.parquet": result.simulation,
    }


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
    announce_compilation(given.observer, given.model.filter)
    from auvident.stages.diagnose import diagnose as trace
    from auvident.stages.identify import prepare, without_held_out

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
        shared=_shared(_first_model(given)),
    )
    seen = [without_held_out(t, given.maneuvers, given.model.plane) for t in given.trials]
    result = trace(
        seen,
        given.maneuvers,
        given.vehicle,
        setup,
        given.model,
        seed=given.seed or 0,
        progress=given.observer.progress,
    )
    return {
        "diagnose/diagnosis.json": result.diagnosis,
        "diagnose/residuals.parquet": result.residuals,
    }


def refine(given: Given) -> dict[str, Any]:
    """Add the traced effects, identify again, compare the errors of what was held out."""
    filter = given.options["filter"] or given.model.filter
    announce_compilation(given.observer, filter)
    from auvident.schema.diagnosis import CrossValidated
    from auvident.stages.refine import carried_of, choose, compare
    from auvident.stages.validate import validate as predict_again

    before = predict_again(given.trials, given.maneuvers, given.model)
    carried = carried_of(given.diagnosis)
    after: _Again | None = None
    tried: tuple[Attempt, ...] = ()
    if carried is not None:
        made, tried = choose(
            carried, given.model, before, lambda c: _identified_again(given, filter, c)
        )
        carried, after = (made.carried, made.found) if made else (None, None)
    elif filter != given.model.filter:
        after = _identified_again(given, filter, None)
    named, now = (after[0].model, after[1]) if after else (given.model, before)
    force: UnexplainedForce | None = None
    if given.options.get("with_unexplained"):
        stronger, force = _unexplained(given, filter, carried, named, now)
        after = stronger or after
    model, history = given.model, given.table("identify/history.parquet")
    if after is not None:
        model, history, now = after[0].model, after[0].history, after[1]
    comparison = compare(
        given.diagnosis,
        given.maneuvers,
        given.model,
        model,
        before.simulation,
        now.simulation,
        attempts=tried,
        seed=given.seed or 0,
        predicted=now.metrics.findings,
        cross_validation=CrossValidated(
            before=before.metrics.cross_validation, after=now.metrics.cross_validation
        ),
        force=force,
        named=named,
    ).model_copy(update={"coverage": now.metrics.coverage})
    return {
        "refine/model.json": model,
        "refine/comparison.json": comparison,
        "refine/history.parquet": history,
        "refine/simulation.parquet": now.simulation,
    }


def _unexplained(
    given: Given, filter: str, carried: Any, model: "IdentifiedModel", prediction: "Validation"
) -> "tuple[_Again | None, UnexplainedForce]":
    """A force without a name beside what a model carries; None where it predicts nothing."""
    from auvident.stages.refine import Base, with_unexplained

    nuisance = identifying_plan(given).nuisance
    heading = any(t.table["heading_rad"].notna().any() for t in given.trials)
    made, force = with_unexplained(
        Base.of(carried, nuisance, model, prediction),
        lambda c: _identified_again(given, filter, c),
        given.maneuvers,
        heading=heading,
        seed=given.seed or 0,
    )
    return (made.found if made else None), force


def _identified_again(given: Given, filter: str, carried: Any) -> "_Again":
    """Identify with what was found, and predict."""
    from auvident.stages.identify import identify as estimate_jointly
    from auvident.stages.validate import validate as predict_again

    result = estimate_jointly(
        given.trials,
        given.maneuvers,
        given.ase,
        given.vehicle,
        given.noise(),
        plane=given.model.plane,
        plan=identifying_plan(given),
        filter=filter,
        engine=given.model.engine,
        carried=carried,
        shared=_shared(_first_model(given)),
        progress=given.observer.progress,
    )
    return result, predict_again(
        given.trials, given.maneuvers, result.model, estimated=given.ase.applies
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
    from auvident.pipeline.reporting import report_data
    from auvident.report.html import render

    return {"report/report.html": render(report_data(given))}
