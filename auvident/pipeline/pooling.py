"""Trials pooled from their run directories: models, maneuvers and vehicle files, but no log."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import GateError, InputError, StageError
from auvident.pipeline.observer import Observer
from auvident.pipeline.predict import VEHICLE, find_model
from auvident.pipeline.remedies import made_again, run_around
from auvident.pipeline.replays import MANEUVERS, QUALITY, replay_behind
from auvident.pipeline.steps import begin_with_kernels
from auvident.schema.pooled import POOLED
from auvident.storage.artifacts import json_bytes, read_json, read_model, write_bytes
from auvident.storage.run_directory import MANIFEST, RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.changes import Changes
    from auvident.schema.pooled import PooledModel
    from auvident.stages.pool import PoolTrial

SAME_FILE = "Pool trials that were run with the same vehicle file; leave the others out."
ANOTHER = "See to the vehicle and to the log; another trial tells whether the vehicle changed."
SHOWN = 3  # keys that differ
ALONG = "along.json"  # beside the model that a run ends with


@dataclass(frozen=True)
class PooledRuns:
    """The pooled model of runs, and what changed over them."""

    model: "PooledModel"
    changes: "Changes"


def pool_runs(
    targets: Sequence[Path],
    *,
    plane: str | None = None,
    keep: bool = False,
    false_alarms: float | None = None,
    seed: int = 0,
    names: Mapping[Path, str] | None = None,
    observer: Observer | None = None,
) -> PooledRuns:
    """Pool the trials of runs of one vehicle, in the order of their dates.

    Where it changed, the model is of the vehicle as it is since then.

    Parameters
    ----------
    targets : sequence of Path
        Run directories, or files of models.
    plane : str, optional
        Of runs of both planes; without it the first one.
    keep : bool
        Whether a trial that fits no other goes in all the same.
    false_alarms : float, optional
        Probability of one change or more where there is none.
    seed : int
        Of the series drawn where nothing changes.
    names : mapping, optional
        What to call the trials; without it as their folders, with what is above these where two
        have one name.
    observer : Observer, optional
        Who is told where the first use takes longer.

    Raises
    ------
    InputError
        They are of different vehicles, with what differs.
    StageError
        A run without a model.
    """
    import numpy as np

    from auvident.stages.pool import changes_of, pool
    from auvident.stages.pool.changes import FALSE_ALARMS

    _refuse_other_files(targets)
    called = told_apart(targets) if names is None else [names.get(t, t.name) for t in targets]
    trials = in_order([pool_trial(t, plane, n) for t, n in zip(targets, called, strict=True)])
    begin_with_kernels(observer or Observer())
    result = pool(trials, keep=keep)
    rate = FALSE_ALARMS if false_alarms is None else false_alarms
    changes = changes_of(result, np.random.default_rng(seed), rate)
    if changes.changes:
        result = pool(trials, keep=keep, changes=changes.changes)
    return PooledRuns(result.model, changes)


def in_order(trials: "Sequence[PoolTrial]") -> "list[PoolTrial]":
    """By date where every trial has one, else as given."""
    if not all(t.date for t in trials):
        return list(trials)
    return sorted(trials, key=lambda t: datetime.fromisoformat(t.date))


def told_apart(paths: Sequence[Path]) -> list[str]:
    """The last parts of paths, as many as tell those of different places apart."""
    places = [path.resolve() for path in paths]
    names = [path.name or place.name for path, place in zip(paths, places, strict=True)]
    for parts in range(2, max((len(place.parts) for place in places), default=0)):
        of: dict[str, set[Path]] = {}
        for name, place in zip(names, places, strict=True):
            of.setdefault(name, set()).add(place)
        if all(len(own) == 1 for own in of.values()):
            break
        names = [
            name if len(of[name]) == 1 else Path(*place.parts[-parts:]).as_posix()
            for name, place in zip(names, places, strict=True)
        ]
    return names


def pool_trial(target: Path, plane: str | None, name: str) -> "PoolTrial":
    """A run as it is pooled: its model, its date, its logs, and how its maneuvers are loaded."""
    from auvident.stages.pool import PoolTrial

    path, model = find_model(target, plane)
    if "symbols" not in model.covariance:
        problem = "the model has no covariance, without which it cannot be pooled"
        raise StageError(problem, str(path), made_again(path))
    logs, full = logs_behind(path, model), with_small_effects(path, model)
    replay = partial(replay_behind, path, full)
    return PoolTrial(name, full, date_of(target), str(path), logs, replay)


def with_small_effects(path: Path, model: "IdentifiedModel") -> "IdentifiedModel":
    """The model of a run that carries small effects, where the run ends with one without any."""
    from auvident.schema.artifacts import IdentifiedModel

    along = path.with_name(ALONG)
    there = run_around(path) is not None and along.exists()
    return read_model(along, IdentifiedModel, made_again(along)) if there else model


def logs_behind(file: Path, model: "IdentifiedModel") -> dict[str, str]:
    """Trials that a model was identified from, by the hash of the log of their gyro.

    The noise of a gyro is that of one trial alone; a file of orders may be that of many. A pooled
    model says itself which went into it; empty for another one outside of a run directory.
    """
    if model.plan == POOLED:
        from auvident.schema.pooled import PooledModel

        used = [t for t in read_model(file, PooledModel).pooling.trials if t.used]
        return {digest: log for t in used for digest, log in t.logs.items()}
    run = run_around(file)
    if run is None or not (run / QUALITY).exists() or not (run / MANEUVERS).exists():
        return {}
    own = {m for stage in model.stages for m in stage.maneuvers}
    flown = {m["trial"] for m in _tree(run / MANEUVERS) if m["id"] in own}
    return logs_of(run, flown)


def logs_of(run: Path, names: Collection[str] | None = None) -> dict[str, str]:
    """Trials of a run, all or those of some names, by the hash of the log of their gyro."""
    if not (run / QUALITY).exists():
        return {}
    entry = RunDirectory(run).existing().stages.get("ingest")
    found = _tree(run / QUALITY).get("trials", ())
    trials = [t for t in found if names is None or t["trial"] in names]
    hashes = {_hash(_gyro_of(t), entry.inputs if entry else {}): t["trial"] for t in trials}
    return {digest: trial for digest, trial in hashes.items() if digest}


def _tree(file: Path) -> Any:
    """Plain content of an artifact."""
    return read_json(file, made_again(file))


def _gyro_of(trial: Mapping[str, Any]) -> Path:
    """File of the gyro as the report names it, without the table of a container."""
    files = [s["file"] for s in trial["sensors"] if s["sensor"] == "gyro"]
    return Path(str(files[0]).partition(", topic ")[0] if files else "")


def _hash(file: Path, inputs: Mapping[str, str]) -> str:
    """Hash of the input whose path ends most like that of a file; empty where that is in doubt."""
    alike = {name: _alike(file, Path(name)) for name in inputs}
    most = max(alike.values(), default=0)
    found = {inputs[name] for name, count in alike.items() if count == most > 0}
    return found.pop() if len(found) == 1 else ""


def date_of(run: Path) -> str:
    """When the first trial of a run began (ISO 8601), empty where its log has no dates."""
    file = run / QUALITY
    if not run.is_dir() or not file.exists():
        return ""
    tree = _tree(file)
    starts = [
        datetime.fromisoformat(trial["origin"]) + timedelta(seconds=trial["t_start_s"])
        for trial in tree.get("trials", ())
        if trial.get("origin")
    ]
    return min(starts).isoformat(timespec="seconds") if starts else ""


def _alike(one: Path, other: Path) -> int:
    """How many parts two paths have in common, from their ends on."""
    pairs = zip(one.parts[::-1], other.parts[::-1], strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


def _refuse_other_files(targets: Sequence[Path]) -> None:
    """Refuse runs whose vehicle files differ, with the keys that do."""
    told = [t for t in targets if (t / MANIFEST).exists() and (t / VEHICLE).exists()]
    if not told:
        return
    first = _flat(_tree(told[0] / VEHICLE))
    for other in told[1:]:
        tree = _flat(_tree(other / VEHICLE))
        keys = [k for k in {**first, **tree} if first.get(k) != tree.get(k)]
        if keys:
            pairs = (f"{k} {tree.get(k)} (there {first.get(k)})" for k in keys[:SHOWN])
            more = f" and {len(keys) - SHOWN} more" if len(keys) > SHOWN else ""
            raise InputError(
                f"was run with another vehicle file than {told[0]}: {', '.join(pairs)}{more}",
                str(other),
                SAME_FILE,
            )


def _flat(tree: Any, at: str = "") -> dict[str, Any]:
    """Keys with dots, and their values."""
    if isinstance(tree, dict):
        pairs = [_flat(value, f"{at}.{key}" if at else str(key)) for key, value in tree.items()]
        return {k: v for pair in pairs for k, v in pair.items()}
    return {at: tree}


def write_pooled(model: "PooledModel", file: Path) -> None:
    """Write a pooled model to a file."""
    write_bytes(file, json_bytes(model, str(file)))


def refuse_change(changes: "Changes") -> None:
    """The gate of ``--fail-on-change``.

    Raises
    ------
    GateError
        Something changed, with what; or the last trial fits no other.
    """
    if changes.changes:
        raise GateError(
            "; ".join(alarms(changes)),
            changes.vehicle,
            f"Probability of such an alarm where nothing changed: {changes.false_alarms:g}.",
        )
    if changes.left_out_last:
        raise GateError(changes.left_out_last, changes.vehicle, ANOTHER)


def alarms(changes: "Changes") -> list[str]:
    """What keeps the gate from being met: changes, and a last trial that fits no other."""
    last = [changes.left_out_last] if changes.left_out_last else []
    return [*(change.sentence for change in changes.changes), *last]
