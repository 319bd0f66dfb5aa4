"""The vehicle file: geometry, mass, sensors and what the user already knows.

One class per table of the TOML file; `Vehicle` is the whole. Lengths are metres, angles of the
file are degrees (suffix), stations ``x_m`` are body-frame coordinates (forward positive).
"""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from auvident.schema.base import Declared
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.planes import Plane
from auvident.schema.quoting import clipped

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]

FinKind = Literal["rudder", "elevator", "sail"]

# Where on the mean chord a stated fin station lies: midway between the quarter chord, where the
# lift acts, and the half chord. REMUS: x = -0.638 of a fin from -0.611 to -0.685, 0.36 (Prestero).
STATION_CHORD_SHARE = 0.375
# Of a drag coefficient: REMUS has 0.267 in the tow tank and 0.2 at sea (Prestero).
DRAG_SHARE = 0.15
SEVERAL_PROPELLERS = (
    "is one table: of equal propellers at one rate give kt0 and kt1 of one times their number"
)


class Body(Declared):
    """``[vehicle]``: mass properties about the origin O.

    ``buoyancy_std_n``, ``x_g_std_m`` and ``z_g_std_m`` say how well the ballasting is known: weight
    in water, trim and height of the centre of gravity. Zero holds what the file says, and the trim
    at level, whatever ``x_g_m``: it says nothing of the centre of buoyancy.
    """

    name: str = "unnamed vehicle"
    mass_kg: Positive
    izz_kgm2: Positive
    iyy_kgm2: Positive | None = None
    ixx_kgm2: Positive | None = None
    x_g_m: float = 0.0
    z_g_m: float = 0.0
    origin_from_nose_m: NonNegative
    buoyancy_n: Positive | None = None
    displaced_volume_m3: Positive | None = None
    design_speed_mps: Positive | None = None
    buoyancy_std_n: NonNegative | None = None
    x_g_std_m: NonNegative | None = None
    z_g_std_m: NonNegative | None = None

    def inertia_kgm2(self, plane: Plane) -> float:
        """Inertia about the axis that a plane turns about; in pitch that of yaw unless stated."""
        return self.izz_kgm2 if plane == "horizontal" else self.iyy_kgm2 or self.izz_kgm2


class Hull(Declared):
    """``[hull]``: a body of revolution by sections or offsets, or another hull by its sizes.

    Without ``shape`` the keys decide: offsets, if there are any; a Myring hull, if
    ``myring_theta_deg``, ``myring_n`` or a Myring offset is given; else an ellipsoidal nose, a
    cylinder and a conical tail. `auvident.schema.hull_shape` says what each key means.

    ``drag_coefficient`` is that of the whole vehicle on its frontal area, appendages and all,
    straight ahead with the fins amidships; without ``drag_coefficient_std`` it is known to
    `DRAG_SHARE`.
    """

    length_m: Positive
    shape: Literal["myring", "ellipsoid", "suboff", "offsets"] | None = None
    diameter_m: Positive | None = None
    nose_length_m: NonNegative | None = None
    tail_length_m: NonNegative | None = None
    myring_n: Positive = 2.0
    myring_theta_deg: Annotated[float, Field(gt=0, lt=90)] | None = None
    myring_nose_offset_m: NonNegative = 0.0
    myring_tail_offset_m: NonNegative = 0.0
    tail_shape: Literal["cone", "parabola", "ellipsoid"] = "cone"
    tail_base_diameter_m: NonNegative = 0.0
    offsets: str | None = None
    offsets_x_from_nose_m: tuple[float, ...] | None = None
    offsets_radius_m: tuple[float, ...] | None = None
    beam_m: Positive | None = None
    draught_m: Positive | None = None
    drag_coefficient: Positive | None = None
    drag_coefficient_std: Positive | None = None
    displaced_volume_m3: Positive | None = None

    @property
    def is_body_of_revolution(self) -> bool:
        """Whether the semi-empirical formulas apply to this hull."""
        has_offsets = self.offsets_radius_m is not None or self.offsets is not None
        return self.diameter_m is not None or has_offsets

    @property
    def drag_std(self) -> float | None:
        """Standard deviation of the drag coefficient, if there is one."""
        if self.drag_coefficient is None or self.drag_coefficient_std is not None:
            return self.drag_coefficient_std
        return DRAG_SHARE * self.drag_coefficient

    @property
    def family(self) -> Literal["myring", "ellipsoid", "suboff", "offsets"]:
        """The shape that the keys ask for."""
        if self.shape is not None:
            return self.shape
        if self.offsets_radius_m is not None:
            return "offsets"
        keys = {"myring_theta_deg", "myring_n", "myring_nose_offset_m", "myring_tail_offset_m"}
        return "myring" if keys & self.model_fields_set else "ellipsoid"

    @model_validator(mode="after")
    def _is_some_hull(self) -> Self:
        if (self.offsets_x_from_nose_m is None) != (self.offsets_radius_m is None):
            raise ValueError("offsets_x_from_nose_m and offsets_radius_m are needed together")
        if self.offsets is not None and self.offsets_radius_m is not None:
            raise ValueError("give offsets as a file or as two arrays, not both")
        if self.shape == "offsets" and self.offsets is None and self.offsets_radius_m is None:
            raise ValueError("shape = 'offsets' needs offsets")
        if self.shape not in (None, "offsets") and self.diameter_m is None:
            raise ValueError(f"shape = {self.shape!r} needs diameter_m")
        if not self.is_body_of_revolution and (self.beam_m is None or self.draught_m is None):
            raise ValueError(
                "give diameter_m or offsets (body of revolution), or beam_m and draught_m"
            )
        return self

    @model_validator(mode="after")
    def _drag_refers_to_an_area(self) -> Self:
        if self.drag_coefficient is None and self.drag_coefficient_std is not None:
            raise ValueError("drag_coefficient_std needs drag_coefficient")
        if self.drag_coefficient is not None and not self.is_body_of_revolution:
            raise ValueError("drag_coefficient needs diameter_m; else give [coefficients] X_uu")
        return self


class Fin(Declared):
    """``[[fin]]``: a set of equal fins, or the sail (any fixed fin or pod).

    ``count`` is 2 (one fin on either side) unless stated, and 1 for a sail. Fins stand in the
    vertical plane (rudder, sail) or in the horizontal plane (elevator), turned out of it by
    ``dihedral_deg``: an X-tail is a rudder pair and an elevator pair at 45 degrees.
    ``moved_by`` names the commands that deflect the set; by default its own kind, both for a
    set with dihedral, none for a sail.
    """

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
    dihedral_deg: Annotated[float, Field(ge=0, le=90)] = 0.0
    moved_by: tuple[Literal["rudder", "elevator"], ...] | None = None

    @model_validator(mode="before")
    @classmethod
    def _a_sail_is_single(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("kind") == "sail" and "count" not in data:
            return {**data, "count": 1}
        return data

    @property
    def mid_chord_x_m(self) -> float:
        """Station of the half chord at mid-span; the hull radius there is that of the fin."""
        chord = 0.5 * (self.root_chord_m + self.tip_chord_m)
        return self.x_m - (0.5 - STATION_CHORD_SHARE) * chord

    @property
    def commands(self) -> tuple[str, ...]:
        """The commands that deflect this set."""
        if self.moved_by is not None:
            return self.moved_by
        if self.kind == "sail":
            return ()
        return ("rudder", "elevator") if 0.0 < self.dihedral_deg < 90.0 else (self.kind,)


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
    """``[dvl]``: position in body axes, mounting angle, accuracy, reference.

    Where ``z_m`` is not stated, how deep it sits is estimated along.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float | None = None
    mounting_yaw_deg: float = 0.0
    std_mps: Positive | None = None
    reference: Literal["ground", "water"] = "ground"

    @property
    def down_m(self) -> float:
        """How deep it sits; on the axis where the file does not say."""
        return self.z_m or 0.0


class Gyro(Declared):
    """``[gyro]``: accuracy."""

    std_radps: Positive | None = None


class Fluid(Declared):
    """``[fluid]``: sea water at 10 to 15 degrees Celsius unless stated."""

    density_kgpm3: Positive = 1025.0
    kinematic_viscosity_m2ps: Positive = 1.19e-6


class Signs(Declared):
    """``[signs]``: which way the logged control angles work: to port and down unless stated."""

    rudder_positive_turns: Literal["port", "starboard"] = "port"
    elevator_positive_pitches: Literal["down", "up"] = "down"

    def assumed(self, key: str) -> str:
        """The value of a key that the file does not state; "" of one that it does."""
        return "" if key in self.model_fields_set else str(getattr(self, key))


class Known(Declared):
    """A coefficient or constant the user already knows: the prior in place of the ASE value."""

    value: float
    std: NonNegative

    @model_validator(mode="before")
    @classmethod
    def _has_a_deviation(cls, data: Any) -> Any:
        """A bare number does not say how well it is known, and what weight it has."""
        if isinstance(data, dict | cls):
            return data
        raise ValueError(
            f"{clipped(repr(data))} has no standard deviation: write {{ value = ..., std = ... }}"
        )


class AseOptions(Declared):
    """``[ase]``: alternatives among the semi-empirical formulas (defaults: the method's).

    Attributes
    ----------
    surge_spheroid : X_udot of the spheroid of equal volume, or of the hull's diameter (Prestero).
    finite_length : multiply the hull's strips by the spheroid's factors (strips run 20 % high).
    coriolis_added_mass : X_vr, X_rr, N_ur with the added mass of the bare hull or with fins.
    hull_station : where potential flow ends: middle of the tail, DATCOM's station, or the end
        of the hull (Munk's couple, no lift).
    hull_slenderness : k2 - k1 of the equal-volume spheroid or DATCOM's chart.
    hull_rate_lift : add x_s Y_uv to Y_ur and x_s^2 Y_uv to N_ur, a slender body cut at x_s.
    hull_rate_crossflow : add the cross-flow of a turning hull to Y_r|r| and N_r|r|.
    friction_line : flat-plate friction of the hull.
    base_drag : add DATCOM's drag of a flat tail end.
    crossflow_drag : C_dn against the cross-flow Reynolds number at ``crossflow_angle_deg``, or
        the constant ``crossflow_cd``.
    crossflow_finite_length : factor for the finite hull, DATCOM or Jorgensen fig. 4, or none.
    fin_lift : lift slope of the fins.
    fin_cd0 : profile drag coefficient of fins without ``cd0`` (W-F: 0.0065); by Hoerner, from
        friction, thickness and the corner with the hull, unless given.
    appendage_cd : drag coefficient on the frontal area of what the file does not show (antennas,
        sensors, openings, propeller hub); midway between 0.06 and 0.12, which REMUS at sea and
        in the tow tank has beyond its hull and fins (Prestero 2001). 0 for a bare model.
    incidence_interference : (1 + tau)^2 on the lift of fin pairs at incidence, or none.
    deflection_interference : K_W(B), the factor of incidence, or none on deflected fins.
    induced_drag_scaling : induced drag with the factor of the lift or its square.
    sail_interference : (1 + 6 tau + tau^2)/2 with aspect ratio 2 h^2/S, twice that with h^2/S,
        or none.
    """

    surge_spheroid: Literal["equal_volume", "diameter"] = "equal_volume"
    finite_length: bool = False
    coriolis_added_mass: Literal["bare", "finned"] = "bare"
    hull_station: Literal["mid_tail", "datcom", "end"] = "mid_tail"
    hull_slenderness: Literal["spheroid", "datcom"] = "spheroid"
    hull_rate_lift: bool = False
    hull_rate_crossflow: bool = False
    friction_line: Literal["ittc57", "prandtl_schlichting", "schoenherr"] = "ittc57"
    base_drag: bool = False
    crossflow_drag: Literal["table", "constant"] = "table"
    crossflow_angle_deg: Annotated[float, Field(gt=0, lt=90)] = 10.0
    crossflow_cd: Positive = 1.2
    crossflow_finite_length: Literal["datcom", "jorgensen", "none"] = "datcom"
    fin_lift: Literal["whicker_fehlner", "hoerner"] = "whicker_fehlner"
    fin_cd0: NonNegative | None = None
    appendage_cd: NonNegative = 0.09
    incidence_interference: Literal["naca1307", "none"] = "naca1307"
    deflection_interference: Literal["k_wb", "incidence", "none"] = "k_wb"
    induced_drag_scaling: Literal["linear", "squared"] = "linear"
    sail_interference: Literal["mirror", "no_mirror", "none"] = "mirror"


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

    @field_validator("propeller", mode="before")
    @classmethod
    def _one_propeller(cls, given: Any) -> Any:
        if isinstance(given, list):
            raise ValueError(SEVERAL_PROPELLERS)
        return given

    @model_validator(mode="after")
    def _symbols_are_known(self) -> Self:
        unknown = [s for s in self.coefficients if s not in ESTIMATED]
        if unknown:
            raise ValueError(f"unknown coefficient {unknown[0]!r}; see `auvident coefficients`")
        if self.hull.drag_coefficient is not None and "X_uu" in self.coefficients:
            raise ValueError("give [hull] drag_coefficient or [coefficients] X_uu, not both")
        return self

    @property
    def is_ship(self) -> bool:
        """Whether the criteria of ships apply: a hull by beam and draught, without an elevator."""
        dives = any("elevator" in fin.commands for fin in self.fin)
        return not self.hull.is_body_of_revolution and not dives

    def station_of(self, command: str) -> float:
        """Mean station of the fins that a command deflects, by area [m]; 0 without any."""
        own = [fin for fin in self.fin if command in fin.commands]
        areas = [f.count * f.exposed_span_m * (f.root_chord_m + f.tip_chord_m) for f in own]
        return sum(f.x_m * a for f, a in zip(own, areas, strict=True)) / sum(areas) if own else 0.0

    @property
    def rudder_sign(self) -> int:
        """Factor that turns a logged rudder angle into the internal one (positive to port)."""
        return 1 if self.signs.rudder_positive_turns == "port" else -1

    @property
    def elevator_sign(self) -> int:
        """Factor that turns a logged elevator angle into the internal one (positive: down)."""
        return 1 if self.signs.elevator_positive_pitches == "down" else -1
