"""The table of stages: what each reads, writes, takes and calls.

A new stage is one more row here and one function in `auvident.pipeline.steps`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auvident.pipeline import ingesting, steps
from auvident.pipeline.given import Given
from auvident.pipeline.planes import FOUND
from auvident.schema.coefficients import PLANES
from auvident.schema.places import BY_PLANE_STAGES, also_beside

Outputs = Mapping[str, Any]
Sources = Callable[[Mapping[str, Any]], list[Path]]


def _no_sources(options: Mapping[str, Any]) -> list[Path]:
    return []


@dataclass(frozen=True)
class Stage:
    """Declaration of one stage.

    Attributes
    ----------
    name : str
        Also its command and its folder in the run directory.
    job : str
        What it does, for people.
    after : tuple of str
        Stages that must be up to date before.
    also : tuple of str
        Stages it shows where they are up to date, and does without where not.
    planes : tuple of str
        Planes of motion that it knows; a run goes on without it in another plane.
    needs_both : bool
        Whether a run of one plane goes on without it.
    reads : tuple of str
        Artifacts it reads, as patterns.
    writes : tuple of str
        Artifacts it writes under fixed names; those of ingest named for a trial come besides, and
        those of another plane under the same names in a folder of that plane.
    main : str
        The artifact that ``--json`` prints.
    function : callable
        `Given` -> artifact by path.
    options : mapping
        Options with their defaults.
    sources : callable
        Files outside of the run directory that it reads.
    paths : tuple of str
        Options that are paths; the manifest keeps them relative to the run directory.
    draws : bool
        Whether it draws random numbers, so that the seed matters.
    helped : bool
        Whether it does a part of its work beside the other.
    """

    name: str
    job: str
    after: tuple[str, ...]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    main: str
    function: Callable[[Given], Outputs]
    options: Mapping[str, Any] = field(default_factory=dict)
    sources: Sources = _no_sources
    paths: tuple[str, ...] = ()
    draws: bool = False
    also: tuple[str, ...] = ()
    planes: tuple[str, ...] = PLANES
    needs_both: bool = False
    helped: bool = False

    @property
    def by_plane(self) -> bool:
        """Whether it is called for each plane of the run."""
        return self.name in BY_PLANE_STAGES


STAGES: tuple[Stage, ...] = (
    Stage(
        "ingest",
        "logs on one clock, cleaned, with a quality report",
        after=(),
        reads=(),
        writes=("ingest/vehicle.json", "ingest/quality.json"),
        main="ingest/quality.json",
        function=ingesting.ingest,
        options={
            "logs": (),
            "vehicle": None,
            "map": None,
            "rate_hz": 10.0,
            "max_gap_s": 5.0,
            "allow_outside": None,
            "fix": (),
        },
        sources=ingesting.ingest_sources,
        paths=("logs", "vehicle", "map"),
    ),
    Stage(
        "segment",
        "maneuvers and their roles",
        after=("ingest",),
        reads=("ingest/*.parquet",),
        writes=("segment/maneuvers.json", "segment/rejected.json"),
        main="segment/maneuvers.json",
        function=steps.segment,
        options={"hold_out": ()},
    ),
    Stage(
        "ase",
        "coefficients from geometry",
        after=("ingest",),
        reads=("ingest/vehicle.json", "ingest/*.parquet"),
        writes=("ase/coefficients.json",),
        main="ase/coefficients.json",
        function=steps.ase,
    ),
    Stage(
        "identify",
        "coefficients from the maneuvers",
        after=("segment", "ase"),
        reads=("ingest/*", "segment/maneuvers.json", "ase/coefficients.json"),
        writes=("identify/model.json", "identify/history.parquet", "identify/states.parquet"),
        main="identify/model.json",
        function=steps.identify,
        options={
            "plane": FOUND,
            "filter": "ekf",
            "engine": "compiled",
            "plan": steps.DEFAULT_PLAN,
        },
        sources=steps.plan_source,
        paths=("plan",),
    ),
    Stage(
        "validate",
        "prediction of the held-out maneuvers",
        after=("identify",),
        reads=also_beside(
            "ingest/*",
            "segment/maneuvers.json",
            "ase/coefficients.json",
            "identify/model.json",
        ),
        writes=(
            "validate/metrics.json",
            "validate/simulation.parquet",
            "validate/standard.json",
        ),
        main="validate/metrics.json",
        function=steps.validate,
    ),
    Stage(
        "diagnose",
        "what the model lacks",
        after=("identify",),
        reads=also_beside(
            "ingest/*",
            "segment/maneuvers.json",
            "ase/coefficients.json",
            "identify/model.json",
        ),
        writes=("diagnose/diagnosis.json", "diagnose/residuals.parquet"),
        main="diagnose/diagnosis.json",
        function=steps.diagnose,
    ),
    Stage(
        "refine",
        "the model with what it lacked",
        after=("diagnose",),
        reads=also_beside(
            "ingest/*",
            "segment/maneuvers.json",
            "ase/coefficients.json",
            "identify/model.json",
            "diagnose/diagnosis.json",
        ),
        writes=(
            "refine/model.json",
            "refine/comparison.json",
            "refine/history.parquet",
            "refine/simulation.parquet",
            "refine/metrics.json",
            "refine/standard.json",
            "refine/along.json",
        ),
        main="refine/comparison.json",
        function=steps.refine,
        options={"filter": None, "with_unexplained": None},
        draws=True,
    ),
    Stage(
        "combine",
        "one model of six degrees of freedom",
        after=("identify",),
        reads=also_beside(
            "ingest/*",
            "segment/maneuvers.json",
            "ase/coefficients.json",
            "identify/model.json",
            "refine/model.json",
        ),
        writes=("combine/model.json",),
        main="combine/model.json",
        function=steps.combine,
        also=("refine",),
        needs_both=True,
    ),
    Stage(
        "report",
        "everything in one HTML file",
        after=("validate",),
        reads=(
            "ingest/*",
            "segment/*",
            "ase/*",
            "identify/*",
            "validate/*",
            "diagnose/*",
            "refine/*",
            "combine/*",
        ),
        writes=("report/report.html",),
        main="report/report.html",
        function=steps.report,
        options={"interactive": None},
        helped=True,
        also=("diagnose", "refine", "combine"),
    ),
)
BY_NAME: dict[str, Stage] = {stage.name: stage for stage in STAGES}


def before(name: str) -> list[Stage]:
    """Stages that a stage rests on, directly or not, in the order of the table."""
    wanted: set[str] = set()
    pending = list(BY_NAME[name].after)
    while pending:
        stage = pending.pop()
        if stage in BY_NAME and stage not in wanted:
            wanted.add(stage)
            pending += BY_NAME[stage].after
    return [stage for stage in STAGES if stage.name in wanted]
