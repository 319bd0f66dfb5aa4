"""Standard maneuvers flown on the desk: models, approach, flight, and what is told of it."""

from auvident.stages.desk.models import (
    DeskModel,
    combined_models,
    estimated_models,
    identified_models,
)
from auvident.stages.desk.stage import Approach, Desk, fly_maneuver
from auvident.stages.desk.standard import greatest_laid_deg, standard_maneuvers

__all__ = [
    "Approach",
    "Desk",
    "DeskModel",
    "combined_models",
    "estimated_models",
    "fly_maneuver",
    "greatest_laid_deg",
    "identified_models",
    "standard_maneuvers",
]
