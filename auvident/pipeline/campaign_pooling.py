"""The trials of a vehicle pooled, plane by plane; what stands in the way stops no other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvident.errors import AuvidentError
from auvident.pipeline.planes import planes_of
from auvident.pipeline.pooling import PooledRuns, pool_runs
from auvident.schema.campaign import CampaignTrial, CampaignVehicleResult
from auvident.schema.planes import PLANES, Plane
from auvident.storage.artifacts import json_bytes, write_bytes
from auvident.storage.campaign_file import CHANGES, POOLED
from auvident.storage.run_directory import RunDirectory

NEW = 2  # trials since a change, up to which it should be confirmed


@dataclass(frozen=True)
class PooledVehicle:
    """What the result has of a vehicle in a plane, and what was pooled, if anything was."""

    told: CampaignVehicleResult
    runs: PooledRuns | None = None


def pooled_by_plane(
    folder: Path, rows: Sequence[CampaignTrial], false_alarms: float, seed: int
) -> list[PooledVehicle]:
    """Pool the trials of a vehicle in each plane that they have models of, most trials first.

    Parameters
    ----------
    folder : Path
        Of the vehicle in the output; models and changes are written there, without a plane in
        their names for the first one.
    rows : sequence of CampaignTrial
    false_alarms, seed
        As of `pool_runs`.
    """
    _remove_earlier(folder)
    failed = [r for r in rows if r.state == "failed"]
    repeat = tuple({"trial": r.trial, "why": r.problem} for r in failed)
    planes, problem = {}, "no trial came to a model"
    try:
        planes = trials_by_plane([r for r in rows if r.state != "failed"])
    except AuvidentError as error:
        problem = _told(error)
    if not planes:
        nothing = CampaignVehicleResult(
            name=folder.name, plane="", trials=len(rows), problem=problem, repeat=repeat
        )
        return [PooledVehicle(nothing)]
    found = []
    for k, (plane, own) in enumerate(planes.items()):
        told = CampaignVehicleResult(
            name=folder.name,
            plane=plane,
            second=k > 0,
            trials=len(own) + (len(failed) if k == 0 else 0),
            repeat=repeat if k == 0 else (),
        )
        names = [name if k == 0 else of_plane(name, plane) for name in (POOLED, CHANGES)]
        found.append(_pooled(told, own, (folder / names[0], folder / names[1]), false_alarms, seed))
    return found


def of_plane(name: str, plane: Plane) -> str:
    """The file of the second plane of a vehicle: pooled.json, pooled-vertical.json."""
    path = Path(name)
    return f"{path.stem}-{plane}{path.suffix}"


def trials_by_plane(rows: Sequence[CampaignTrial]) -> dict[Plane, list[CampaignTrial]]:
    """Trials by the planes that they have a model of, that of most trials first.

    Days of turns and days of dives stand beside each other in many seasons.
    """
    planes = {r.trial: planes_of(RunDirectory(Path(r.run))) for r in rows}
    of = {p: [r for r in rows if p in planes[r.trial]] for p in PLANES}
    return {p: of[p] for p in sorted(PLANES, key=lambda p: -len(of[p])) if of[p]}


def _pooled(
    told: CampaignVehicleResult,
    rows: Sequence[CampaignTrial],
    files: tuple[Path, Path],
    false_alarms: float,
    seed: int,
) -> PooledVehicle:
    """The trials of a vehicle in a plane, written to a file of the model and one of the changes."""
    plane: Any = told.plane
    try:
        runs = [Path(r.run) for r in rows]
        found = pool_runs(runs, plane=plane, false_alarms=false_alarms, seed=seed)
    except AuvidentError as error:
        return PooledVehicle(told.model_copy(update={"problem": _told(error)}))
    for file, artifact in zip(files, (found.model, found.changes), strict=True):
        write_bytes(file, json_bytes(artifact, file.name))
    from auvident.report.tables_campaign import summary

    update = {
        "model": str(files[0]),
        "pooled": sum(t.used for t in found.model.pooling.trials),
        "summary": summary(found.model),
        "changes": found.changes,
        "findings": found.model.findings,
        "repeat": (*told.repeat, *_to_repeat(found)),
    }
    return PooledVehicle(told.model_copy(update=update), found)


def _told(error: AuvidentError) -> str:
    return f"{error.where}: {error.problem}"


def _remove_earlier(folder: Path) -> None:
    """A pooled model of an earlier campaign is not to be taken for that of this one."""
    for name in (POOLED, CHANGES):
        for file in (name, *(of_plane(name, plane) for plane in PLANES)):
            (folder / file).unlink(missing_ok=True)


def _to_repeat(found: PooledRuns) -> Iterator[dict[str, Any]]:
    """Trials that say nothing of the vehicle, and changes that rest on a trial or two."""
    for t in (t for t in found.model.pooling.trials if not t.used):
        yield {"trial": t.trial, "why": t.reason}
    names = found.changes.trials
    for change in found.changes.changes:
        since = len(names) - names.index(change.trial)
        if change.kind == "step" and since <= NEW:
            why = f"confirm that {change.sentence}: {since} since then"
            yield {"trial": names[-1], "why": why}


def judged(rows: Sequence[CampaignTrial], found: Sequence[PooledVehicle]) -> list[CampaignTrial]:
    """Rows with how each trial fits the others, in the first plane that it was pooled in."""
    fits: dict[str, dict[str, Any]] = {}
    for v in found:
        for t in v.runs.model.pooling.trials if v.runs else ():
            distance = (t.square / t.directions) ** 0.5 if t.directions else None
            fits.setdefault(t.trial, {"fits": distance, "pooled": t.used, "reason": t.reason})
    return [r.model_copy(update=fits.get(r.trial, {})) for r in rows]
