"""A maneuver flown on the desk, for the terminal: figures, curves, findings."""

from rich.console import RenderableType
from rich.text import Text

from auvident.constants import NORMAL_90
from auvident.report.console_style import findings_lines, rich_table
from auvident.report.held_out_words import beyond
from auvident.report.tables import (
    Cell,
    Column,
    Interval,
    Joined,
    Number,
    Rounded,
    Table,
    columns,
)
from auvident.schema.desk import BY_MANEUVER, DeskCurve, DeskFigure, DeskResult
from auvident.schema.planes import Plane

# figures that do not say by their name what they are
WORDS = {
    "steady_r": "steady yaw rate",
    "steady_drift": "steady drift (bow inside)",
    "stability_index": "stability index G",
    "nomoto_gain": "Nomoto K, linear model",
    "nomoto_time": "Nomoto T, linear model",
    "zigzag_gain": "Nomoto K, from the zigzag",
    "zigzag_time": "Nomoto T, from the zigzag",
    "reach": "reach (back on the course)",
    "depth_overshoot": "depth overshoot",
    "greatest_pitch": "greatest change of pitch",
    "r_from_starboard": "rate from starboard",
    "r_from_port": "rate from port",
    "residual_starboard": "residual rate after starboard",
    "residual_port": "residual rate after port",
    "residual_difference": "residual rate, difference",
    "time_to_90": "time to 90 deg of heading",
    "time_to_180": "time to 180 deg of heading",
    "steady_starboard": "steady rate to starboard",
    "steady_port": "steady rate to port",
}
# of names that both planes have, what they are in the vertical one
WORDS_VERTICAL = {
    "time_to_check_yaw": "time to check pitch",
    "reach": "reach (back at the first pitch)",
}
CURVE_TITLES = {
    "spiral": "Steady yaw rate by rudder; rates and rudder positive to starboard",
    "trim": "Elevator (positive up) and pitch that hold the depth, by speed",
}
SOURCES = {
    "identified": "identified model",
    "estimated": "estimate from geometry",
    "given": "given coefficients",
}
INTERVAL_HEAD = "90 % interval"
SMALLEST = 4  # decimals of a curve: what is left of a rate that dies away is no rate
NOTHING = 5e-7  # in the unit of any figure, no size at all: a rate that has died away


def desk_pieces(result: DeskResult) -> list[RenderableType]:
    """What a person sees of a maneuver."""
    pieces: list[RenderableType] = [rich_table(figure_table(result))]
    pieces += [rich_table(curve_table(curve)) for curve in result.curves]
    row = BY_MANEUVER[result.maneuver]
    line = (
        f"{row.steered[:1].upper()}{row.steered[1:]}; ends {row.ends}. Servo speed: {result.servo}."
    )
    far = [Text(t, style="yellow") for t in beyond({"The maneuver": result.extrapolation})]
    return [*pieces, Text(line, style="dim"), *far, *findings_lines(result.findings)]


def figure_table(result: DeskResult) -> Table:
    """Every figure with its interval."""
    rows: list[list[Cell]] = [
        [_words(f, result.plane), "" if f.unit == "-" else f.unit, figure_value(f), _interval(f)]
        for f in map(_without_traces, result.figures)
    ]
    numbers = "/".join(f"{v:g}" for v in result.parameters.values())
    speed = f"{result.speed_mps:.3g} m/s"
    rate = "speed held" if result.rpm is None else f"{result.rpm:.0f} rpm"
    title = (
        f"{result.vehicle}: {result.maneuver} {numbers}, {speed}, {rate} ({SOURCES[result.source]})"
    )
    heads = columns(("figure", "unit"), ("value", INTERVAL_HEAD))
    return Table(heads, rows, title)


def curve_table(curve: DeskCurve) -> Table:
    """A curve, one row for each place."""
    first = curve.figures[0] if curve.figures else ()
    heads = [Column(f"{curve.along}, {curve.unit}", numeric=True)]
    for f in first:
        heads += [Column(f"{_words(f)}, {f.unit}", numeric=True), Column(INTERVAL_HEAD)]
    rows: list[list[Cell]] = []
    for at, figures in zip(curve.at, curve.figures, strict=True):
        cells: list[Cell] = [Number(at, 4)]
        for f in figures:
            value, low, high = (_rounded(x) for x in (f.value, f.low, f.high))
            cells += [Number(value, 3), Interval(low, high) if low is not None else ""]
        rows.append(cells)
    return Table(heads, rows, CURVE_TITLES[curve.name])


def _rounded(value: float | None) -> float | None:
    """As many decimals as a curve shows; a zero has no sign."""
    return None if value is None else round(value, SMALLEST) + 0.0


def _without_traces(f: DeskFigure) -> DeskFigure:
    """A figure in which what is no size at all is zero, without a sign."""
    ends = {"value": f.value, "low": f.low, "high": f.high}
    told = {k: 0.0 if x is not None and abs(x) < NOTHING else x for k, x in ends.items()}
    return f.model_copy(update=told)


def figure_value(f: DeskFigure) -> Cell:
    """A figure, as exact as its interval is wide."""
    if f.value is None or f.low is None or f.high is None or not f.low < f.high:
        return Number(f.value, 4)
    return Rounded(f.value, (f.high - f.low) / (2.0 * NORMAL_90))


def _interval(f: DeskFigure) -> Cell:
    if f.low is None or f.high is None:
        return ""
    told = Interval(f.low, f.high)
    if f.share is not None and f.share < 1.0:
        return Joined((told, f"({f.share:.0%} of the sampled models)"), " ")
    return told


def _words(f: DeskFigure, plane: Plane = "horizontal") -> str:
    own = WORDS_VERTICAL if plane == "vertical" else {}
    return own.get(f.name) or WORDS.get(f.name, f.name.replace("_", " "))
