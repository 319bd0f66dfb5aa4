"""The functions of the interface: run, load, estimate."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from auvident.api.geometry import GeometryEstimate, vehicle_of
from auvident.api.model import Model
from auvident.api.progress import Lines
from auvident.api.results import Run
from auvident.api.whole import WholeModel
from auvident.errors import InputError, UsageError
from auvident.pipeline.observer import Observer
from auvident.schema.planes import Plane

if TYPE_CHECKING:
    from auvident.schema.vehicle import Vehicle

PathLike = str | Path


def run(
    logs: "PathLike | Sequence[PathLike]" = (),
    *,
    run: PathLike,
    vehicle: PathLike | None = None,
    map: PathLike | None = None,
    rate_hz: float | None = None,
    max_gap_s: float | None = None,
    allow_outside: bool | None = None,
    fix: Sequence[str] = (),
    keep_going: bool | None = None,
    hold_out: Sequence[str] = (),
    filter: Literal["ekf", "ukf"] | None = None,
    engine: Literal["compiled", "filterpy"] | None = None,
    plane: Literal["horizontal", "vertical", "both", "found"] | None = None,
    plan: PathLike | None = None,
    fail_above: Mapping[str, float] | None = None,
    seed: int | None = None,
    observer: Observer | None = None,
    progress: bool = False,
) -> Run:
    """Run all stages in order, as ``auvident run`` does; those up to date are skipped.

    Parameters
    ----------
    logs : path or sequence of paths
        Trial folders, wide files or folders of trials. Without logs and vehicle, those of the last
        run of this directory are taken, with its options.
    run : path
        Run directory; created if needed.
    vehicle : path
        Vehicle file (TOML).
    map : path, optional
        Column map: names, units and signs.
    rate_hz, max_gap_s : float, optional
        Rows per second after ingest (10); longest gap that is bridged (5 s).
    allow_outside : bool, optional
        Read files that the vehicle file or the map names outside of its folder.
    fix : sequence of str
        Corrections that a check proposes, to be applied.
    keep_going : bool, optional
        Set unusable logs aside and continue; `Run.quality` names them.
    hold_out : sequence of str
        Maneuvers or trials to hold out, in place of the automatic choice.
    filter, engine, plane, plan : optional
        ``ekf`` or ``ukf``; ``compiled`` or ``filterpy``; plane of motion (``found``: those with
        maneuvers of their own); name or file of the identification plan.
    fail_above : mapping, optional
        Greatest held-out RMSE by channel: ``{"u": 0.05}``.
    seed : int, optional
        Of the random numbers; by default that of the last run, at first 0.
    observer : Observer, optional
        Told what happens; without one nothing is printed.
    progress : bool
        A line on standard error for each stage, in place of an observer.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        A log, the vehicle file, the map or the plan cannot be used.
    NumericsError
        The numbers failed; where only the report can do without them, at the end of the run.
    GateError
        A held-out error is above its limit in `fail_above`; the run directory is complete.
    InUseError
        Another process works in the run directory.
    """
    from auvident.pipeline.whole_run import check_run, run_logs

    options: dict[str, Any] = {
        "logs": _paths(logs),
        "vehicle": _path(vehicle),
        "map": _path(map),
        "rate_hz": rate_hz,
        "max_gap_s": max_gap_s,
        "allow_outside": allow_outside or None,
        "fix": _names(fix),
        "keep_going": keep_going or None,
        "hold_out": _names(hold_out),
        "filter": _one_of("filter", filter, ("ekf", "ukf")),
        "engine": _one_of("engine", engine, ("compiled", "filterpy")),
        "plane": _one_of("plane", plane, ("horizontal", "vertical", "both", "found")),
        "plan": None if plan is None else str(plan),
    }
    watch = observer or (Lines() if progress else Observer())
    place = Path(run)
    result = run_logs(place, options, seed=seed, observer=watch)
    if result.failure is not None:
        raise result.failure
    check_run(place, result, fail_above or {})
    return Run(place)


def load_run(path: PathLike) -> Run:
    """A run directory, whoever made it.

    Parameters
    ----------
    path : path

    Raises
    ------
    StageError
        There is no run, or a later version of the program made it.
    """
    return Run(path)


def load_model(path: PathLike, plane: Plane | None = None) -> Model:
    """An identified model from its file, or the final one of a run directory.

    Parameters
    ----------
    path : path
        ``model.json``, as `identify`, `refine` and ``export --format json`` write it, or a run
        directory.
    plane : str, optional
        Of a run of both planes; by default the first.

    Raises
    ------
    InputError, StageError
        There is no model, or it is of another plane.
    """
    from auvident.pipeline.predict import find_model
    from auvident.pipeline.whole import is_whole

    if is_whole(Path(path)):
        raise InputError(
            "is a model of six degrees of freedom or a vehicle file, and of no plane",
            str(path),
            "Use auvident.load_whole_model.",
        )
    file, artifact = find_model(Path(path), plane)
    return Model(artifact, file)


def load_whole_model(path: PathLike) -> WholeModel:
    """A model of six degrees of freedom from its file, or that of a run of both planes.

    Parameters
    ----------
    path : path
        What ``auvident combine`` has written, a run directory, or a vehicle file (TOML), which
        gives a model from geometry and its own ``[coefficients]`` alone.

    Raises
    ------
    InputError, StageError
        There is no such model.
    """
    from auvident.pipeline.reporting import WHOLE
    from auvident.pipeline.whole import find_whole

    file = Path(path)
    if (file / WHOLE).exists():
        return load_run(file).whole
    artifact, vehicle = find_whole(file)
    return WholeModel(artifact, file, vehicle)


def combine(runs: "PathLike | Sequence[PathLike]", vehicle: PathLike | None = None) -> WholeModel:
    """One model of six degrees of freedom from runs of both planes, as ``auvident combine`` does.

    Parameters
    ----------
    runs : path or sequence of paths
        Run directories, of one plane or of both, or files of models. A plane without a run is the
        estimate from geometry, as is roll.
    vehicle : path, optional
        In place of the vehicle file of the runs; needed where no run is given.

    Raises
    ------
    InputError, UsageError
        Two models of one plane, or of different vehicles.
    """
    from auvident.pipeline.whole import combine_runs

    artifact, _ = combine_runs(_paths(runs), _path(vehicle))
    return WholeModel(artifact)


def pool(
    runs: "PathLike | Sequence[PathLike]", plane: Plane | None = None, *, keep: bool = False
) -> Model:
    """One model of all trials of a vehicle, as ``auvident pool`` makes it.

    Parameters
    ----------
    runs : path or sequence of paths
        Run directories, or files of models. The maneuvers of a run directory are predicted again
        with the common coefficients; no log is read again.
    plane : str, optional
        Of runs of both planes; by default the first.
    keep : bool
        Also pool a trial that fits no other.

    Returns
    -------
    Model
        A model as any other; `Model.artifact` has ``pooling``: the trials with their distance from
        the others, and what each coefficient scatters by between them.

    Raises
    ------
    InputError, StageError
        Runs of different vehicles or planes; a run without a model.
    UsageError
        No run.
    """
    from auvident.pipeline.pooling import pool_runs

    targets = _paths(runs)
    if not targets:
        raise UsageError("there is nothing to pool", "runs", "Name run directories or models.")
    return Model(pool_runs(targets, plane=plane, keep=keep).model)


def load_vehicle(
    vehicle: "PathLike | Mapping[str, Any] | Vehicle", *, allow_outside: bool = False
) -> "Vehicle":
    """A vehicle from its file (TOML), or from the same tables as a dictionary.

    Parameters
    ----------
    vehicle : path, mapping or Vehicle
        ``{"vehicle": {"mass_kg": 31.0, ...}, "hull": {...}, "fin": [{...}], ...}``; ``auvident
        new-vehicle`` prints a file with every key.
    allow_outside : bool
        Read a file of offsets outside of the folder of the vehicle file (of a dictionary: of the
        current one).

    Raises
    ------
    InputError
        An unknown key, a wrong value, or impossible geometry; names table and key.
    """
    from auvident.storage.declared import outside_allowed

    with outside_allowed(allow_outside):
        return vehicle_of(vehicle)


def estimate_from_geometry(
    vehicle: "PathLike | Mapping[str, Any] | Vehicle", speed_mps: float | None = None
) -> GeometryEstimate:
    """Coefficients of both planes from geometry alone, as ``auvident ase`` estimates them.

    Parameters
    ----------
    vehicle : path, mapping or Vehicle
        See `load_vehicle`.
    speed_mps : float, optional
        For the Reynolds numbers, where the vehicle states no design speed (1.5 m/s).

    Raises
    ------
    InputError
        See `load_vehicle`; a hull that is no body of revolution and states no coefficients.
    """
    from auvident.stages.ase import estimate

    known = vehicle_of(vehicle)
    return GeometryEstimate(estimate(known, speed_mps), known)


def _path(path: PathLike | None) -> Path | None:
    return None if path is None else Path(path)


def _paths(paths: "PathLike | Sequence[PathLike]") -> tuple[Path, ...]:
    return tuple(map(Path, (paths,) if isinstance(paths, str | Path) else paths))


def _names(names: Sequence[str]) -> tuple[str, ...]:
    """Names; a single one may come as it is."""
    return (names,) if isinstance(names, str) else tuple(names)


def _one_of(option: str, value: str | None, known: tuple[str, ...]) -> str | None:
    if value not in (None, *known):
        raise UsageError(f"there is no {option} {value!r}", option, f"One of {', '.join(known)}.")
    return value
