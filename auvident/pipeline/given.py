"""What a stage is given: the artifacts it reads, its options, and who watches."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel

from auvident.pipeline.helper import Helper
from auvident.pipeline.observer import Observer
from auvident.pipeline.remedies import made_again
from auvident.schema.manifest import Manifest
from auvident.schema.places import BY_PLANE_STAGES, beside
from auvident.schema.planes import Plane
from auvident.schema.trial import Columns, Trial
from auvident.storage.artifacts import as_model, read_arrays, read_json, read_model, read_table
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    import pandas as pd

    from auvident.schema.artifacts import AseResult, IdentifiedModel, Maneuvers, Metrics
    from auvident.schema.diagnosis import Comparison, Diagnosis
    from auvident.schema.logs import Quality
    from auvident.schema.vehicle import Vehicle

Model = TypeVar("Model", bound=BaseModel)
TRIALS = "ingest/*.parquet"
OF_ALL_PLANES = ("vehicle", "quality", "trials", "maneuvers", "ase")  # read once for both


def matching(manifest: Manifest | None, patterns: tuple[str, ...]) -> list[str]:
    """Artifacts of all stages done that match one of the patterns, in order."""
    entries = manifest.stages.values() if manifest else ()
    names = [name for entry in entries for name in entry.outputs]
    return sorted(name for name in names if fits(name, patterns))


def fits(name: str, patterns: tuple[str, ...]) -> bool:
    """Whether an artifact matches one of the patterns."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


@dataclass(frozen=True)
class Given:
    """Loads artifacts when asked for; each once.

    ``also`` are the stages that the stage shows where they are, and that are up to date.
    ``planes`` are those of the run, the first one first; ``plane`` is the one that is looked at,
    and ``former`` what the stage has made of the first plane when it comes to the other.
    ``kept`` is what stages of one run leave for later ones, so that they need not make it again;
    ``helper`` does what can be done beside something else.
    """

    run: RunDirectory
    manifest: Manifest | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    observer: Observer = field(default_factory=Observer)
    also: frozenset[str] = frozenset()
    planes: tuple[Plane, ...] = ()
    plane: Plane | None = None
    former: Mapping[str, Any] = field(default_factory=dict)
    kept: dict[tuple[str, Plane | None], Any] = field(default_factory=dict)
    helper: Helper = field(default_factory=Helper)

    def within(self, plane: Plane, former: Mapping[str, Any] | None = None) -> "Given":
        """The same for one plane: its artifacts in place of those of the first."""
        other = replace(self, plane=plane, former=former or {})
        known = {name: vars(self)[name] for name in OF_ALL_PLANES if name in vars(self)}
        vars(other).update(known)
        return other

    def views(self) -> "list[Given]":
        """Each plane of the run by itself; of a run without a list of them the first."""
        return [self.within(plane) for plane in self.planes] or [self]

    @property
    def is_beside(self) -> bool:
        """Whether the plane that is looked at stands beside the first one."""
        return bool(self.planes) and self.plane not in (None, self.planes[0])

    def place(self, name: str) -> str:
        """Where an artifact of the plane stands."""
        by_plane = name.partition("/")[0] in BY_PLANE_STAGES
        return beside(name) if by_plane and self.is_beside else name

    def read(self, name: str, model: type[Model]) -> Model:
        """A JSON artifact as its class."""
        return read_model(self.run / self.place(name), model, self.remedy(name))

    def table(self, name: str) -> "pd.DataFrame":
        """A Parquet artifact."""
        return read_table(self.run / self.place(name), self.remedy(name))

    def arrays(self, name: str) -> Columns:
        """A Parquet artifact of numbers and flags."""
        return read_arrays(self.run / self.place(name), self.remedy(name))

    def has(self, name: str) -> bool:
        """Whether an artifact is there."""
        return (self.run / self.place(name)).exists()

    def remedy(self, name: str) -> str:
        """What to do where an artifact cannot be used."""
        return made_again(self.run / self.place(name))

    @cached_property
    def vehicle(self) -> "Vehicle":
        """The vehicle as it was at ingest."""
        from auvident.schema.vehicle import Vehicle

        return self.read("ingest/vehicle.json", Vehicle)

    @cached_property
    def quality(self) -> "Quality":
        """Quality of the logs."""
        from auvident.schema.logs import Quality

        return self.read("ingest/quality.json", Quality)

    @cached_property
    def trials(self) -> list[Trial]:
        """The ingested trials, in the order in which they were given."""
        return [
            Trial(t.trial, self.arrays(f"ingest/{t.trial}.parquet"), t.rate_hz)
            for t in self.quality.trials
        ]

    @cached_property
    def maneuvers(self) -> "Maneuvers":
        """The maneuvers with their roles; the file itself is a plain list."""
        from auvident.schema.artifacts import Maneuvers

        name = "segment/maneuvers.json"
        path = self.run / name
        tree = {"maneuvers": read_json(path, self.remedy(name))}
        return as_model(tree, Maneuvers, path, self.remedy(name))

    @cached_property
    def ase(self) -> "AseResult":
        """The estimate from geometry."""
        from auvident.schema.artifacts import AseResult

        return self.read("ase/coefficients.json", AseResult)

    @cached_property
    def model(self) -> "IdentifiedModel":
        """The identified model."""
        from auvident.schema.artifacts import IdentifiedModel

        return self.read("identify/model.json", IdentifiedModel)

    @cached_property
    def refined(self) -> "IdentifiedModel":
        """The refined model."""
        from auvident.schema.artifacts import IdentifiedModel

        return self.read("refine/model.json", IdentifiedModel)

    @cached_property
    def metrics(self) -> "Metrics":
        """How well the model predicts."""
        from auvident.schema.artifacts import Metrics

        return self.read("validate/metrics.json", Metrics)

    @cached_property
    def diagnosis(self) -> "Diagnosis":
        """What the model lacks."""
        from auvident.schema.diagnosis import Diagnosis

        return self.read("diagnose/diagnosis.json", Diagnosis)

    @cached_property
    def comparison(self) -> "Comparison":
        """What adding it changed."""
        from auvident.schema.diagnosis import Comparison

        return self.read("refine/comparison.json", Comparison)

    def noise(self) -> dict[str, float]:
        """Noise of each measured channel by column: root mean square over the trials."""
        squares: dict[str, list[float]] = {}
        for trial in self.quality.trials:
            for channel in (c for sensor in trial.sensors for c in sensor.channels):
                if channel.noise_std is not None:
                    squares.setdefault(channel.column, []).append(channel.noise_std**2)
        return {column: (sum(s) / len(s)) ** 0.5 for column, s in squares.items()}
