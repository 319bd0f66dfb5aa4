"""The vehicle file: geometry, mass, sensors and what the user already knows.

One class per table of the TOML file; `Vehicle` is the whole. Lengths are metres, angles of the
file are degrees (suffix), stations ``x_m`` are body-frame coordinates (forward positive).
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from auvident.schema.base import Declared
from auvident.schema.coefficients import BY_SYMBOL

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]

FinKind = Literal["rudder", "elevator", "sail"]


class Body(Declared):
    """``[vehicle]``: mass properties about the origin O."""

    name: str = "unnamed vehicle"
    mass_kg: Positive
    izz_kgm2: Positive
    iyy_kgm2: Positive | None = None
    x_g_m: float = 0.0
    z_g_m: float = 0.0
    origin_from_nose_m: NonNegative
    buoyancy_n: Positive | None = None
    displaced_volume_m3: Positive | None = None
    design_speed_mps: Positive | None = None


class Hull(Declared):
    """``[hull]``: a body of revolution by sections or offsets, or another hull by its sizes."""

    length_m: Positive
    shape: Literal["myring", "ellipsoid", "suboff", "offsets"] | None = None
    diameter_m: Positive | None = None
    nose_length_m: NonNegative | None = None
    tail_length_m: NonNegative | None = None
    myring_n: Positive = 2.0
    myring_theta_deg: Annotated[float, Field(gt=0, lt=90)] | None = None
    tail_base_diameter_m: NonNegative = 0.0
    offsets: str | None = None
    offsets_x_from_nose_m: tuple[float, ...] | None = None
    offsets_radius_m: tuple[float, ...] | None = None
    beam_m: Positive | None = None
    draught_m: Positive | None = None
    displaced_volume_m3: Positive | None = None

    @property
    def is_body_of_revolution(self) -> bool:
        """Whether the semi-empirical formulas apply to this hull."""
        return self.diameter_m is not None or self.offsets_radius_m is not None


class Fin(Declared):
    """``[[fin]]``: a set of equal fins, or the sail."""

    kind: FinKind
    count: Annotated[int, Field(ge=1, le=8)] = 2
    x_m: float
    exposed_span_m: Positive
    root_chord_m: Positive
    tip_chord_m: Positive
    sweep_deg: Annotated[float, Field(gt=-80, lt=80)] = 0.0
    tip: Literal["square", "faired"] = "square"
    cd0: NonNegative | None = None
    efficiency: NonNegative = 1.0
    dihedral_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0


class Propeller(Declared):
    """``[propeller]``: K_T = kt0 + kt1 J, or a table of K_T against J."""

    diameter_m: Positive
    x_m: float = 0.0
    kt0: float | None = None
    kt1: float | None = None
    table_j: tuple[float, ...] | None = None
    table_kt: tuple[float, ...] | None = None
    wake_fraction: Fraction = 0.0
    thrust_deduction: Fraction = 0.0

    @model_validator(mode="after")
    def _has_a_curve(self) -> Self:
        line = self.kt0 is not None and self.kt1 is not None
        table = self.table_j is not None and self.table_kt is not None
        if line == table:
            raise ValueError("give either kt0 and kt1, or table_j and table_kt")
        if table and (
            len(self.table_j or ()) != len(self.table_kt or ()) or len(self.table_j or ()) < 2
        ):
            raise ValueError("table_j and table_kt need the same length, at least 2")
        return self


class Dvl(Declared):
    """``[dvl]``: position in body axes, mounting angle, accuracy, reference."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    mounting_yaw_deg: float = 0.0
    std_mps: Positive | None = None
    reference: Literal["ground", "water"] = "ground"


class Gyro(Declared):
    """``[gyro]``: accuracy."""

    std_radps: Positive | None = None


class Fluid(Declared):
    """``[fluid]``: sea water at 10 to 15 degrees Celsius unless stated."""

    density_kgpm3: Positive = 1025.0
    kinematic_viscosity_m2ps: Positive = 1.19e-6


class Signs(Declared):
    """``[signs]``: which way the logged control angles work."""

    rudder_positive_turns: Literal["port", "starboard"] = "port"
    elevator_positive_pitches: Literal["down", "up"] = "down"


class Known(Declared):
    """A coefficient the user already knows; it takes the place of the ASE value as prior."""

    value: float
    std: NonNegative


class AseOptions(Declared):
    """``[ase]``: alternatives among the semi-empirical formulas (defaults: the method's)."""


class Vehicle(Declared):
    """The whole vehicle file."""

    body: Body = Field(alias="vehicle")
    hull: Hull
    fin: tuple[Fin, ...] = ()
    propeller: Propeller | None = None
    dvl: Dvl = Dvl()
    gyro: Gyro = Gyro()
    fluid: Fluid = Fluid()
    signs: Signs = Signs()
    coefficients: dict[str, Known] = {}
    ase: AseOptions = AseOptions()

    @model_validator(mode="after")
    def _symbols_are_known(self) -> Self:
        unknown = [s for s in self.coefficients if s not in BY_SYMBOL]
        if unknown:
            raise ValueError(f"unknown coefficient {unknown[0]!r}; see `auvident coefficients`")
        return self

    @property
    def rudder_sign(self) -> int:
        """Factor that turns a logged rudder angle into the internal one (positive to port)."""
        return 1 if self.signs.rudder_positive_turns == "port" else -1

    @property
    def elevator_sign(self) -> int:
        """Factor that turns a logged elevator angle into the internal one (positive: down)."""
        return 1 if self.signs.elevator_positive_pitches == "down" else -1
