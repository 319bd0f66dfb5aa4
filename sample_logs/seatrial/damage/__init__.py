"""What goes wrong with logs, as rows: each damages a written trial, and says what is best then.

``CASES`` has every row with each of its sizes, ``damage`` does one or several of them to a log.
"""

from seatrial.damage import axes, clocks, dropouts, files, text, units, values, vehicle
from seatrial.damage.kind import BEST, REFUSED, RIGHT, SAID, Case, Kind
from seatrial.damage.log import Log
from seatrial.trial import stream

KINDS: tuple[Kind, ...] = (
    *units.ROWS,
    *axes.ROWS,
    *clocks.ROWS,
    *dropouts.ROWS,
    *values.ROWS,
    *text.ROWS,
    *files.ROWS,
    *vehicle.VEHICLE_ROWS,
    *vehicle.MAP_ROWS,
)
CASES: dict[str, Case] = {case.id: case for kind in KINDS for case in kind.cases()}

__all__ = ["BEST", "CASES", "KINDS", "REFUSED", "RIGHT", "SAID", "Case", "Kind", "Log", "damage"]


def damage(log: Log, cases: tuple[Case, ...], seed: int) -> None:
    """Do it to a log, one after the other."""
    for case in cases:
        case.apply(log, stream(seed, f"damage {case.id}"))
