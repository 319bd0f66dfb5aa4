"""The standard maneuvers of the field, flown with the model that a stage ends with."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from auvident.errors import InputError, NumericsError
from auvident.schema.artifacts import Finding, IdentifiedModel
from auvident.schema.desk import BY_MANEUVER, DeskOrder, DeskResult, StandardManeuvers
from auvident.schema.planes import Plane
from auvident.stages.desk.models import identified_models
from auvident.stages.desk.stage import Approach, fly_maneuver

SAMPLES = 40  # models drawn: an interval of 90 % leaves two of them out on either side
GREATEST_DEG = 35.0  # rudder of the turning circle of a ship, IMO MSC.137(76) 5.2
LAID_SHARE = 0.99  # quantile of the fin's angle that counts as the greatest one laid
NEARLY_DEG = 1.0  # a fin laid to 19.5 deg has shown what it does at 20
# maneuver and its numbers [deg] that are flown where the fin was laid so far
SWINGS: dict[Plane, tuple[tuple[str, float, float], ...]] = {
    "horizontal": (("zigzag", 10.0, 10.0), ("zigzag", 20.0, 20.0)),
    "vertical": (("vertical-zigzag", 10.0, 5.0),),
}


def standard_maneuvers(
    model: IdentifiedModel,
    speed_mps: float,
    laid_deg: float,
    is_ship: bool = False,
    *,
    seed: int = 0,
) -> StandardManeuvers:
    """Fly the turning circle and the zigzags that ITTC and IMO ask for.

    Parameters
    ----------
    model : IdentifiedModel
    speed_mps : float
        Of the approach.
    laid_deg : float
        Greatest angle that the fin was laid to, by `greatest_laid_deg`.
    is_ship : bool
        Whether the criteria of ships apply, whose rudder is laid to 35 deg wherever it was.
    seed : int
        Of the models drawn.

    Returns
    -------
    StandardManeuvers
        With a finding for each that the model cannot fly.
    """
    models = identified_models(model, "model.json", SAMPLES, np.random.default_rng(seed))
    flown: list[DeskResult] = []
    findings: list[Finding] = []
    for order in orders_of(model.plane, laid_deg, is_ship):
        try:
            result = fly_maneuver(models, order, Approach(usual_speed_mps=speed_mps)).result
        except (InputError, NumericsError) as error:
            findings.append(
                Finding(code="standard-not-flown", where=order.text, message=error.problem)
            )
            continue
        flown.append(result.model_copy(update={"curves": ()}))
    return StandardManeuvers(
        vehicle=model.vehicle,
        plane=model.plane,
        greatest_laid_deg=laid_deg,
        maneuvers=tuple(flown),
        findings=tuple(findings),
    )


def greatest_laid_deg(simulation: pd.DataFrame) -> float:
    """Greatest angle of the fin in the maneuvers that identify [deg], but for single samples.

    By the simulation as `validate` writes it, which has the angles as they were logged.
    """
    angles = simulation.loc[simulation["role"] == "identify", "control_rad"].abs().dropna()
    return float(np.degrees(angles.quantile(LAID_SHARE))) if len(angles) else 0.0


def orders_of(plane: Plane, laid_deg: float, is_ship: bool) -> Sequence[DeskOrder]:
    """Maneuvers to fly: at angles that were laid, at those of the criteria for a ship."""
    reach = GREATEST_DEG if is_ship else laid_deg
    found = []
    circle = BY_MANEUVER["turning-circle"]
    angle = float(np.floor(min(reach + 0.5, GREATEST_DEG)))
    if plane == circle.plane and angle >= 1.0:
        found.append(DeskOrder(circle, (angle,)))
    rows = [row for row in SWINGS[plane] if row[1] <= reach + NEARLY_DEG] or SWINGS[plane][:1]
    return [*found, *(DeskOrder(BY_MANEUVER[name], tuple(angles)) for name, *angles in rows)]
