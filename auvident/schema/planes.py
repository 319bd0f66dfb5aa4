"""The planes of motion, each declared once.

The equations, the filters and the metrics know four states (u, a, b, angle) of whichever plane;
what these are called, which column of a trial measures them, which fin steers and to which sides
is taken from here. Units and sensors are those of `auvident.schema.channels`; the coefficients of
a plane are those of `auvident.schema.coefficients` that name it.
"""

from dataclasses import dataclass
from typing import Literal

from auvident.schema.channels import BY_COLUMN, BY_QUANTITY

Plane = Literal["horizontal", "vertical"]
ManeuverKind = Literal["straight", "turn", "zigzag"]


@dataclass(frozen=True)
class State:
    """A state of a plane: its symbol, the column of a trial that measures it, words for people."""

    symbol: str
    column: str
    words: str

    @property
    def unit(self) -> str:
        """SI unit."""
        return BY_COLUMN[self.column].unit

    @property
    def wraps(self) -> bool:
        """Whether it returns after a turn: a heading counts from where a maneuver begins."""
        return BY_COLUMN[self.column].is_angle


@dataclass(frozen=True)
class PlaneRow:
    """Declaration of one plane.

    Attributes
    ----------
    name : str
    states : tuple of State
        Surge velocity u, lateral velocity a, rate b, angle.
    axes : tuple of str
        Of the forces along u and a and of the moment about b.
    fins : tuple of str
        The control surface that steers in this plane, and the other one.
    sides : tuple of str
        To which a positive and a negative angle of its fin steer.
    sign_key : str
        Key of ``[signs]`` in the vehicle file that says what a logged angle means.
    sigma : float
        Sign of the coupling between translation and rotation (theory 1.3 and 1.4).
    maneuvers : tuple of str
        Kinds that are run in it.
    """

    name: Plane
    states: tuple[State, State, State, State]
    axes: tuple[str, str, str]
    fins: tuple[str, str]
    sides: tuple[str, str]
    sign_key: str
    sigma: float
    maneuvers: tuple[ManeuverKind, ...]

    @property
    def fin(self) -> str:
        """Its control surface."""
        return self.fins[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Column of each state."""
        return tuple(state.column for state in self.states)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Symbols of the states that the equations of motion are of."""
        return tuple(state.symbol for state in self.states[:3])

    @property
    def control_columns(self) -> tuple[str, ...]:
        """Column of its own and of the other control surface."""
        return tuple(BY_QUANTITY[fin].column for fin in self.fins)

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns without which nothing identifies in it: its velocities and its fin."""
        return (*self.columns[:3], self.control_columns[0])

    @property
    def names(self) -> dict[str, str]:
        """Symbols of the generic axes A, B and velocities a, b."""
        return dict(zip("ABab", (*self.axes[1:], *self.velocities[1:]), strict=True))


SURGE = State("u", "u_mps", "surge u")
HORIZONTAL = PlaneRow(
    name="horizontal",
    states=(
        SURGE,
        State("v", "v_mps", "sway v"),
        State("r", "r_radps", "yaw rate r"),
        State("heading", "heading_rad", "heading"),
    ),
    axes=("X", "Y", "N"),
    fins=("rudder", "elevator"),
    sides=("port", "starboard"),
    sign_key="rudder_positive_turns",
    sigma=1.0,
    maneuvers=("straight", "turn", "zigzag"),
)
VERTICAL = PlaneRow(
    name="vertical",
    states=(
        SURGE,
        State("w", "w_mps", "heave w"),
        State("q", "q_radps", "pitch rate q"),
        State("pitch", "pitch_rad", "pitch"),
    ),
    axes=("X", "Z", "M"),
    fins=("elevator", "rudder"),
    sides=("down", "up"),
    sign_key="elevator_positive_pitches",
    sigma=-1.0,
    maneuvers=("straight", "zigzag"),
)

PLANE_ROWS = (HORIZONTAL, VERTICAL)
PLANES: tuple[Plane, ...] = tuple(row.name for row in PLANE_ROWS)
BY_PLANE: dict[Plane, PlaneRow] = {row.name: row for row in PLANE_ROWS}
BY_FIN: dict[str, PlaneRow] = {row.fin: row for row in PLANE_ROWS}
STATE_COLUMNS: dict[Plane, tuple[str, ...]] = {row.name: row.columns for row in PLANE_ROWS}
CONTROL_COLUMNS: dict[Plane, tuple[str, ...]] = {
    row.name: row.control_columns for row in PLANE_ROWS
}
# states of all planes, those that correspond side by side
STATES: tuple[State, ...] = tuple(
    dict.fromkeys(s for pair in zip(*(row.states for row in PLANE_ROWS), strict=True) for s in pair)
)

TRACK = "track"  # north and east, reckoned from the states; predicted in the horizontal plane
# what an error of prediction is told of, in either plane
JUDGED = (*(s.symbol for s in STATES), TRACK)


def symbol_in(plane: Plane, generic: str) -> str:
    """Coefficient symbol of a plane from its generic name, e.g. ``B_ua`` -> ``N_uv``."""
    axis, _, rest = generic.partition("_")
    names = BY_PLANE[plane].names
    if rest.endswith("dot"):
        return f"{names.get(axis, axis)}_{names.get(rest[0], rest[0])}dot"
    return f"{names.get(axis, axis)}_{''.join(names.get(c, c) for c in rest)}"
