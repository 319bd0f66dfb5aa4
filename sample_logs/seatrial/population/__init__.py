"""A new vehicle for every trial: plant, equipment, programme, and the vehicle file of its owner.

``draw(seed)`` gives a `Drawn`; ``drawn.sail()`` runs the trial, ``drawn.write(...)`` the log folder
and the vehicle file. Everything hydrodynamic stays in the plant.

Even seeds are for choosing thresholds, odd seeds for reporting: a figure that was looked at while
something was tuned says nothing about vehicles not seen. `half_of` tells them apart.
"""

from seatrial.population.drawn import CLASSES, Drawn, draw, half_of, kind_of
from seatrial.population.form import Refused, Size

__all__ = ["CLASSES", "Drawn", "Refused", "Size", "draw", "half_of", "kind_of"]
