"""Standard maneuvers flown by the helper as soon as there is a model, while this process predicts.

Imports stand inside for speed: a command loads only what it uses.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from auvident.pipeline.given import Given

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.desk import StandardManeuvers
    from auvident.stages.validate import Validation


class Flights:
    """What the models of a stage do in the standard maneuvers of the field.

    Parameters
    ----------
    given : Given
    laid_deg : float, optional
        Greatest angle that the fin was laid to, as it is known before a model has predicted; None:
        nothing is flown before it is asked for.
    """

    def __init__(self, given: Given, laid_deg: float | None = None) -> None:
        self._given, self._laid_deg = given, laid_deg
        self._begun: list[tuple[IdentifiedModel, Callable[[], StandardManeuvers]]] = []

    def begin(self, model: "IdentifiedModel") -> None:
        """Have a model flown that a stage may end with, where another process has the time."""
        if self._laid_deg is not None and self._given.helper.is_beside:
            self._begun.append((model, self._flown(model, self._laid_deg)))

    def of(self, model: "IdentifiedModel", found: "Validation") -> "StandardManeuvers":
        """What a model does, by its prediction of the maneuvers."""
        from auvident.stages.desk import greatest_laid_deg

        laid_deg = greatest_laid_deg(found.simulation)
        begun = [flown for known, flown in self._begun if known is model]
        if begun and laid_deg == self._laid_deg:
            return begun[0]()
        return self._flown(model, laid_deg)()

    def _flown(
        self, model: "IdentifiedModel", laid_deg: float
    ) -> "Callable[[], StandardManeuvers]":
        from auvident.stages.desk import standard_maneuvers

        speed_mps, is_ship = self._given.ase.speed_mps, self._given.vehicle.is_ship
        return self._given.helper.begin(standard_maneuvers, model, speed_mps, laid_deg, is_ship)
