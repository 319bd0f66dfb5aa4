"""Tables of a naval hydrodynamicist: particulars, standard maneuvers, the criteria of ships."""

from collections.abc import Mapping
from dataclasses import dataclass

from auvident.constants import GRAVITY_MPS2
from auvident.report.desk import WORDS, figure_value
from auvident.report.tables import Cell, Interval, Number, Quantity, Rows, Table, columns
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.desk import DeskFigure, DeskResult, StandardManeuvers
from auvident.schema.effects import DEGREES
from auvident.schema.planes import Plane
from auvident.schema.vehicle import Fin, Vehicle

# figures told of each maneuver, in their order
TOLD: dict[str, tuple[str, ...]] = {
    "turning-circle": (
        "advance",
        "transfer",
        "tactical_diameter",
        "steady_diameter",
        "steady_r",
        "steady_drift",
        "speed_loss",
    ),
    "zigzag": (
        "overshoot_1",
        "overshoot_2",
        "initial_turning_time",
        "initial_turning_distance",
        "period",
    ),
    "vertical-zigzag": (
        "overshoot_1",
        "overshoot_2",
        "depth_overshoot_1",
        "initial_turning_time",
        "period",
        "trim_elevator",
        "trim_pitch",
    ),
}
OF_EQUATIONS = ("nomoto_gain", "nomoto_time", "stability_index")
EQUATIONS_WORDS = "linearised equations"
# what a stability index below zero means; in the vertical plane the righting moment is beside it
UNSTABLE: dict[Plane, str] = {
    "horizontal": " The stability index is below zero: it does not keep a straight course by "
    "itself, and K and T are those of an unstable vehicle.",
    "vertical": " The stability index is below zero: beyond some speed it does not keep its pitch "
    "by itself, in spite of the righting moment, which the index leaves out.",
}
# unit -> powers of L and U that make it a number, and what it is then called
WITHOUT_UNIT: dict[str, tuple[int, int, str]] = {
    "m": (-1, 0, "L"),
    "s": (-1, 1, "L/U"),
    "1/s": (1, -1, "U/L"),
    "deg/s": (1, -1, "U/L"),
}


def standard(found: StandardManeuvers) -> Table:
    """Every figure with its interval, in its unit and in hull lengths and L/U."""
    rows: list[list[Cell]] = []
    for result in found.maneuvers:
        first = _order(result)
        for f in _figures(result, TOLD[result.maneuver]):
            rows.append([first, *_figure(f, result)])
            first = ""
    if found.maneuvers:
        first = EQUATIONS_WORDS
        for f in _figures(found.maneuvers[0], OF_EQUATIONS):
            rows.append([first, *_figure(f, found.maneuvers[0])])
            first = ""
    heads = columns(("maneuver", "figure", "unit"), ("value", "90 % interval", "without unit"))
    return Table(heads, rows, caption=_caption(found))


def _figures(result: DeskResult, names: tuple[str, ...]) -> list[DeskFigure]:
    own = {f.name: f for f in result.figures}
    return [own[n] for n in names if n in own and own[n].value is not None]


def _figure(f: DeskFigure, of: DeskResult) -> list[Cell]:
    told: Cell = Interval(f.low, f.high) if f.low is not None else ""
    unit = "" if f.unit == "-" else f.unit
    return [_words(f.name), unit, figure_value(f), told, _without_unit(f, of)]


def _words(name: str) -> str:
    return WORDS.get(name, name.replace("_", " "))


def _without_unit(f: DeskFigure, of: DeskResult) -> Cell:
    """The figure over lengths and times of the hull; empty where it has no such unit."""
    if f.value is None or f.unit not in WITHOUT_UNIT:
        return ""
    length, speed, over = WITHOUT_UNIT[f.unit]
    value = f.value * of.length_m**length * of.speed_mps**speed
    value /= DEGREES if f.unit == "deg/s" else 1.0
    return Number(value, behind=f" {over}")


def _order(result: DeskResult) -> str:
    """``turning circle 20 deg``, ``zigzag 10/10``."""
    angles = "/".join(f"{abs(v):g}" for v in result.parameters.values())
    return f"{result.maneuver.replace('-', ' ')} {angles}"


def _caption(found: StandardManeuvers) -> str:
    """How they were flown, and which lie beyond what the model was identified from."""
    if not found.maneuvers:
        return ""
    first = found.maneuvers[0]
    text = (
        f"Flown with the final model from a straight run at {first.speed_mps:.3g} m/s, L = "
        f"{first.length_m:.4g} m; servo of the fin: {first.servo}. Intervals: "
        f"{first.models_drawn} models drawn from its covariance."
    )
    beyond = [
        _order(r)
        for r in found.maneuvers
        if abs(next(iter(r.parameters.values()))) > found.greatest_laid_deg + 1.0
    ]
    if beyond:
        text += f" Beyond the {found.greatest_laid_deg:.0f} deg that it was identified with: "
        text += f"{', '.join(beyond)}."
    index = next((f.value for f in first.figures if f.name == "stability_index"), None)
    if index is not None and index < 0.0:
        text += UNSTABLE[found.plane]
    doubts = [f"{_order(r)}: {f.message}." for r in found.maneuvers for f in r.findings]
    text = " ".join([text, *(f"{d[:1].upper()}{d[1:]}" for d in doubts)])
    lost = [f"{f.where} ({f.message})" for f in found.findings]
    return text + (f" Not flown: {'; '.join(lost)}." if lost else "")


# --- IMO ----------------------------------------------------------------------------------

SHORT_S, LONG_S = 10.0, 30.0  # L/U between which the limits of the overshoots rise
MET, NOT_MET, OPEN = "met", "not met", "undecided: the interval holds the limit"


@dataclass(frozen=True)
class Criterion:
    """A criterion of IMO resolution MSC.137(76), section 5.

    Attributes
    ----------
    words : str
    maneuver, parameters : str, tuple
        That it is judged by; None of a parameter stands for any.
    figure : str
    limits : tuple
        At L/U up to 10 s and from 30 s on; a line between.
    in_lengths : bool
        Whether the limit is in lengths of the ship; else in degrees.
    """

    words: str
    maneuver: str
    parameters: tuple[float, ...]
    figure: str
    limits: tuple[float, float]
    in_lengths: bool = False

    def limit(self, hull_time_s: float) -> float:
        """The limit at a length over speed [s]."""
        low, high = self.limits
        share = (hull_time_s - SHORT_S) / (LONG_S - SHORT_S)
        return low + min(max(share, 0.0), 1.0) * (high - low)


CRITERIA = (
    Criterion("advance", "turning-circle", (), "advance", (4.5, 4.5), True),
    Criterion("tactical diameter", "turning-circle", (), "tactical_diameter", (5.0, 5.0), True),
    Criterion(
        "way to 10° of heading with 10° of rudder",
        "zigzag",
        (10.0, 10.0),
        "initial_turning_distance",
        (2.5, 2.5),
        True,
    ),
    Criterion("1st overshoot, zigzag 10/10", "zigzag", (10.0, 10.0), "overshoot_1", (10.0, 20.0)),
    Criterion("2nd overshoot, zigzag 10/10", "zigzag", (10.0, 10.0), "overshoot_2", (25.0, 40.0)),
    Criterion("1st overshoot, zigzag 20/20", "zigzag", (20.0, 20.0), "overshoot_1", (25.0, 25.0)),
)
IMO_CAPTION = (
    "Limits of overshoots are those at the L/U of the vehicle file; of a model of a ship, compare "
    "with the L/U of the ship. The stopping ability (15 L) is not judged: no trial stops the ship. "
    "Applied where the hull is given by beam and draught and there is no elevator."
)


def imo(found: StandardManeuvers) -> Table:
    """The criteria of ships, each with its limit and whether it is met."""
    rows: list[list[Cell]] = []
    for c in CRITERIA:
        for result in found.maneuvers:
            own = tuple(abs(v) for v in result.parameters.values())
            if result.maneuver != c.maneuver or (c.parameters and own != c.parameters):
                continue
            figure = next((f for f in result.figures if f.name == c.figure), None)
            if figure is not None and figure.value is not None:
                rows.append(_judged(c, figure, result))
    heads = columns(("criterion", "unit"), ("value", "90 % interval", "limit"))
    return Table((*heads, *columns(("judged",))), rows, caption=IMO_CAPTION)


def _judged(c: Criterion, f: DeskFigure, of: DeskResult) -> list[Cell]:
    over = of.length_m if c.in_lengths else 1.0
    limit = c.limit(of.length_m / of.speed_mps)
    value, low, high = (None if x is None else x / over for x in (f.value, f.low, f.high))
    told: Cell = Interval(low, high) if low is not None else ""
    words = judged(value, low, high, limit)
    return [c.words, "L" if c.in_lengths else "deg", Number(value), told, Number(limit), words]


def judged(value: float | None, low: float | None, high: float | None, limit: float) -> str:
    """Whether a figure keeps below a limit; undecided where its interval holds the limit."""
    assert value is not None
    if low is not None and high is not None and low <= limit < high:
        return OPEN
    return MET if value <= limit else NOT_MET


# --- ITTC ---------------------------------------------------------------------------------


def particulars(
    vehicle: Vehicle, model: IdentifiedModel | None, found: StandardManeuvers | None
) -> Table:
    """Particulars of the vehicle as ITTC asks for them beside free-running tests."""
    told = {**_hull(vehicle), **_mass(vehicle), **_fins(vehicle)}
    if vehicle.propeller is not None:
        told["propeller diameter"] = Quantity(vehicle.propeller.diameter_m, "m")
    if found is not None and found.maneuvers:
        told |= _approach(vehicle, found.maneuvers[0], model)
    rows: Rows = [[name, value] for name, value in told.items()]
    return Table(columns(("particular",), ("",)), rows)


def _hull(vehicle: Vehicle) -> dict[str, Cell]:
    hull, length = vehicle.hull, vehicle.hull.length_m
    told: dict[str, Cell] = {"length L": Quantity(length, "m", 4)}
    if hull.beam_m is not None and hull.draught_m is not None:
        told["beam B"] = Quantity(hull.beam_m, "m", 4)
        told["draught T"] = Quantity(hull.draught_m, "m", 4)
        told["L/B, B/T"] = f"{length / hull.beam_m:.2f}, {hull.beam_m / hull.draught_m:.2f}"
    elif hull.diameter_m is not None:
        told["diameter D"] = Quantity(hull.diameter_m, "m", 4)
        told["L/D"] = Number(length / hull.diameter_m)
    return told


def _mass(vehicle: Vehicle) -> dict[str, Cell]:
    body, length = vehicle.body, vehicle.hull.length_m
    told: dict[str, Cell] = {"mass m": Quantity(body.mass_kg, "kg", 4)}
    volume = body.displaced_volume_m3 or vehicle.hull.displaced_volume_m3
    if volume is not None:
        told["displaced volume"] = Quantity(volume, "m^3", 4)
    told["centre of gravity from O, x_G"] = Quantity(body.x_g_m, "m")
    if body.z_g_m:
        told["centre of gravity from O, z_G"] = Quantity(body.z_g_m, "m")
    if body.buoyancy_n is not None:
        told["buoyancy B"] = Quantity(body.buoyancy_n, "N", 4)
    for axis, inertia in (("yy", body.iyy_kgm2), ("zz", body.izz_kgm2)):
        if inertia is not None:
            gyration = (inertia / body.mass_kg) ** 0.5 / length
            told[f"radius of gyration k_{axis}"] = Number(gyration, behind=" L")
    return told


def _fins(vehicle: Vehicle) -> dict[str, Cell]:
    told: dict[str, Cell] = {}
    for fin in vehicle.fin:
        area = _area(fin)
        name = f"{fin.kind}, {fin.count} × area"
        told[name] = Quantity(area, "m^2")
        told[f"{fin.kind}, area of all over L²"] = Number(
            fin.count * area / vehicle.hull.length_m**2
        )
    return told


def _area(fin: Fin) -> float:
    return 0.5 * (fin.root_chord_m + fin.tip_chord_m) * fin.exposed_span_m


def _approach(
    vehicle: Vehicle, first: DeskResult, model: IdentifiedModel | None
) -> Mapping[str, Cell]:
    """Speed of the approach with its numbers without dimension."""
    length, speed = first.length_m, first.speed_mps
    told: dict[str, Cell] = {"approach speed U": Quantity(speed, "m/s")}
    if first.rpm is not None:
        told["propeller rate"] = Quantity(first.rpm, "rpm")
    told["L/U"] = Quantity(length / speed, "s")
    if vehicle.is_ship:
        told["Froude number"] = Number(speed / (GRAVITY_MPS2 * length) ** 0.5, 2)
    told["Reynolds number"] = Number(speed * length / vehicle.fluid.kinematic_viscosity_m2ps)
    if model is not None:
        told["density of the water"] = Quantity(model.density_kgpm3, "kg/m^3", 4)
    return told
