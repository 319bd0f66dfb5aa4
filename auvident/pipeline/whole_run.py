"""A whole run: what `auvident run` and `auvident.run` are asked for, and the gates of its end."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import UsageError
from auvident.pipeline.gates import Judged, check_planes, predicted, refined
from auvident.pipeline.observer import Observer
from auvident.pipeline.run import SILENT, RunResult, last_options, run_all
from auvident.schema.places import BESIDE
from auvident.storage.artifacts import as_model

if TYPE_CHECKING:
    from auvident.schema.artifacts import Metrics
    from auvident.schema.diagnosis import Comparison

OF_INGEST = ("logs", "vehicle", "map", "rate_hz", "max_gap_s", "allow_outside", "fix", "keep_going")
OF_IDENTIFY = ("plane", "filter", "engine", "plan")
# stage and its options that a whole run takes; the other stages have none
TAKES = {"ingest": OF_INGEST, "segment": ("hold_out",), "identify": OF_IDENTIFY}
Ended = list[tuple[str, "Metrics", "Comparison | None"]]


def run_logs(
    run: Path,
    options: Mapping[str, Any],
    *,
    seed: int | None = None,
    observer: Observer = SILENT,
) -> RunResult:
    """Run every stage that is not up to date.

    Parameters
    ----------
    run : Path
        Run directory; created if needed.
    options : mapping
        By name, as `TAKES` has them; None and empty ones have their defaults. Without logs and
        vehicle they all are those of the last run, but for those given now.
    seed, observer
        As for `auvident.pipeline.run.run_all`.

    Raises
    ------
    UsageError
        Neither the call nor the last run names logs and a vehicle file.
    AuvidentError
        As the stages raise them.
    """
    chosen = by_stage(options)
    if not {"logs", "vehicle"} & chosen["ingest"].keys():
        chosen = remembered(run, chosen)
    for name, what in (("logs", "logs"), ("vehicle", "vehicle file")):
        if not chosen["ingest"].get(name):
            raise UsageError(f"there is no {what}", name, "Name the logs and the vehicle file.")
    return run_all(run, chosen, seed=seed, observer=observer)


def by_stage(options: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The options that were given, by the stage that takes them."""
    return {
        stage: {n: options[n] for n in names if options.get(n) not in (None, (), [])}
        for stage, names in TAKES.items()
    }


def remembered(path: Path, chosen: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The options of the last run, with those that were given now."""
    former = last_options(path)
    return {name: {**former.get(name, {}), **chosen.get(name, {})} for name in former | chosen}


def check_run(run: Path, result: RunResult, limits: Mapping[str, float]) -> None:
    """Hold the models that a run ends with against the gates; see `check_planes`."""
    planes = ended(run, result)
    check_planes([judged(metrics, comparison) for _, metrics, comparison in planes], limits)


def ended(run: Path, result: RunResult) -> Ended:
    """What a run ends with in each plane: its errors, and what the refinement changed."""
    from auvident.schema.artifacts import Metrics
    from auvident.schema.diagnosis import Comparison

    told: Ended = []
    for plane, mains in (("", result.mains), (BESIDE, result.beside)):
        if "validate" not in mains:
            continue
        place = run / "validate" / plane / "metrics.json"
        metrics = as_model(mains["validate"], Metrics, place)
        is_refined = "refine" not in result.left_out and "refine" in mains
        place = run / "refine" / plane / "comparison.json"
        comparison = as_model(mains["refine"], Comparison, place) if is_refined else None
        told.append((plane, metrics, comparison))
    return told


def judged(metrics: "Metrics", comparison: "Comparison | None") -> Judged:
    """What the gates look at: the refined model where there is one."""
    return refined(comparison) if comparison else predicted(metrics)
