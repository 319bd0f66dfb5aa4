"""The estimate from geometry, before there is any log."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from auvident.api.frames import estimate_frame, finding_frame, part_frame
from auvident.api.maneuver import FlownManeuver
from auvident.pipeline.observer import Observer

if TYPE_CHECKING:
    from auvident.schema.artifacts import AseResult
    from auvident.schema.vehicle import Vehicle

DRAWS = 100


class GeometryEstimate:
    """Coefficients from geometry alone (analytical and semi-empirical), with their uncertainty.

    From `auvident.estimate_from_geometry` or `Run.estimate`; SI, SNAME axes.

    Attributes
    ----------
    artifact : pydantic model
        Everything that ``ase/coefficients.json`` has.
    vehicle : Vehicle
    """

    def __init__(self, artifact: "AseResult", vehicle: "Vehicle") -> None:
        self.artifact, self.vehicle = artifact, vehicle

    def __repr__(self) -> str:
        return f"<GeometryEstimate of {self.artifact.vehicle} at {self.artifact.speed_mps:g} m/s>"

    @cached_property
    def coefficients(self) -> pd.DataFrame:
        """Coefficients and constants of both planes, by symbol.

        Columns: ``plane``, ``value``, ``std``, ``unit``, ``prime`` (NaN of a constant), ``source``
        (ase, given; of a constant what it rests on), ``regressor``, ``description``.
        """
        return estimate_frame(self.artifact)

    @cached_property
    def parts(self) -> pd.DataFrame:
        """What hull, sail, fins, propeller and appendages contribute to each coefficient."""
        return part_frame(self.artifact)

    @property
    def facts(self) -> dict[str, Any]:
        """Stability, turning and speed that follow, with what is uncertain under ``spread``."""
        return dict(self.artifact.facts)

    @cached_property
    def findings(self) -> pd.DataFrame:
        """What to know before the numbers are trusted."""
        return finding_frame(("ase", "", finding) for finding in self.artifact.findings)

    def maneuver(
        self,
        order: str,
        draws: int = DRAWS,
        *,
        speed_mps: float | None = None,
        rpm: float | None = None,
        rudder_rate_degps: float | None = None,
        seed: int = 0,
        observer: Observer | None = None,
    ) -> FlownManeuver:
        """Fly a standard maneuver with the estimate; arguments as of `Model.maneuver`."""
        from auvident.pipeline.desk import Asked, fly_estimate
        from auvident.schema.desk import desk_order

        asked = Asked(speed_mps, rpm, rudder_rate_degps, draws, seed)
        name, told = self.artifact.vehicle, observer or Observer()
        desk = fly_estimate(self.artifact, self.vehicle, name, desk_order(order), asked, told)
        return FlownManeuver(desk)


def vehicle_of(vehicle: "str | Path | Mapping[str, Any] | Vehicle") -> "Vehicle":
    """A vehicle from a file, from the tables of one as a mapping, or as it is."""
    from auvident.schema.vehicle import Vehicle
    from auvident.storage.vehicle_file import load_vehicle, vehicle_from

    if isinstance(vehicle, Vehicle):
        return vehicle
    if isinstance(vehicle, Mapping):
        return vehicle_from(vehicle, Path("vehicle"))
    return load_vehicle(Path(vehicle))
