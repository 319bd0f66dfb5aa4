"""The estimate for people: one vehicle with parts and facts, or several designs side by side."""

from collections.abc import Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from auvident.report.console_style import finding_line, house_table
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import AseCoefficient, AseResult
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.planes import PLANES

number = TERMINAL.number
PARTS = ("hull", "sail", "rudder", "elevator", "propeller")
TITLES: dict[str, str] = {"both": "both planes", **dict(zip(PLANES, PLANES, strict=True))}
SIZES = (
    ("volume_m3", "volume", "m³"),
    ("wetted_m2", "wetted surface", "m²"),
    ("planform_m2", "planform area", "m²"),
    ("planform_x_m", "planform centroid x", "m"),
    ("buoyancy_x_m", "buoyancy x", "m"),
    ("fineness", "fineness", ""),
    ("cut_from_nose_m", "potential flow ends at", "m from nose"),
    ("slenderness_factor", "k2 - k1", ""),
    ("reynolds", "Reynolds number", ""),
    ("crossflow_reynolds", "cross-flow Reynolds number", ""),
    ("crossflow_cd", "cylinder C_dn", ""),
)
DESIGN_FACTS = (
    ("horizontal", "G", "G horizontal (> 0 stable)"),
    ("vertical", "G", "G vertical (> 0 stable)"),
    ("vertical", "stable_below_mps", "vertical: stable below, m/s"),
    ("horizontal", "linear_rate_per_speed_and_rudder_perm", "linear r/(u δ), 1/m"),
    ("speed", "speed_per_rate_m", "speed per propeller rate, m"),
    ("speed", "design_speed_rpm", "rpm at design speed"),
)


def ase_report(result: AseResult) -> RenderableType:
    """Everything about one estimate.

    Parameters
    ----------
    result : AseResult

    Returns
    -------
    rich renderable
        Coefficients with parts, geometry, facts and findings.
    """
    pieces: list[RenderableType] = [coefficient_table(result)]
    if result.geometry:
        pieces.append(geometry_table(result))
    pieces.append(facts_table((result,)))
    turns = result.facts.get("horizontal", {}).get("turns")
    if turns:
        pieces.append(_row_table("Steady turns, rudder to port", turns))
    speeds = result.facts.get("speed", {}).get("table")
    if speeds:
        pieces.append(_row_table("Straight run", speeds))
    pieces += [finding_line(f) for f in result.findings]
    return Group(*pieces)


def coefficient_table(result: AseResult) -> Table:
    """Value, deviation, prime value and contribution of each part, by plane."""
    table = house_table(f"{result.vehicle}: coefficients at {result.speed_mps:g} m/s")
    table.add_column("", style="bold")
    for name in ("value", "± 1σ", "unit", "prime ·10³", *PARTS, "rigid body"):
        table.add_column(name, justify="left" if name == "unit" else "right")
    for plane, title in TITLES.items():
        rows = [c for c in result.coefficients if c.plane == plane]
        if rows:
            table.add_row(Text(title, style="italic dim"))
        for row in rows:
            table.add_row(*_coefficient_cells(row))
    return table


def _coefficient_cells(row: AseCoefficient) -> list[str]:
    """Cells of one coefficient; a given one is marked."""
    mark = " (given)" if row.origin == "given" else ""
    cells = [row.symbol + mark, number(row.value, 4), number(row.std, 4), row.unit]
    cells.append(number(1e3 * row.prime, 4))
    cells += [number(row.parts[p], 4) if p in row.parts else "" for p in PARTS]
    return [*cells, number(row.rigid_body, 4) if row.rigid_body else ""]


def geometry_table(result: AseResult) -> Table:
    """Sizes, centroids and numbers that the formulas use."""
    table = house_table("Geometry")
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for key, name, unit in SIZES:
        if key in result.geometry:
            table.add_row(name, number(result.geometry[key], 4), unit)
    return table


def facts_table(results: Sequence[AseResult]) -> Table:
    """Stability, turning and speed, one column a vehicle."""
    table = house_table("What follows")
    table.add_column("")
    for result in results:
        table.add_column(result.vehicle, justify="right")
    for group, key, name in DESIGN_FACTS:
        cells = [_cell(r.facts.get(group, {}).get(key)) for r in results]
        if any(cells):
            table.add_row(name, *cells)
    for angle in _turn_angles(results):
        cells = [_cell(_turn(r, angle).get("diameter_m")) for r in results]
        table.add_row(f"turning diameter at {angle:g}° rudder, m", *cells)
    return table


def side_by_side(results: Sequence[AseResult]) -> RenderableType:
    """Several designs: coefficients, the change against the first, and the facts.

    Parameters
    ----------
    results : sequence of AseResult, at least 1

    Returns
    -------
    rich renderable
    """
    table = house_table("Coefficients side by side (change against the first)")
    table.add_column("", style="bold")
    table.add_column("unit")
    for result in results:
        table.add_column(result.vehicle, justify="right")
    rows = [r.by_symbol() for r in results]
    for symbol in (s for s in BY_SYMBOL if any(s in r for r in rows)):
        cells = [_with_change(row.get(symbol), rows[0].get(symbol)) for row in rows]
        table.add_row(symbol, BY_SYMBOL[symbol].unit, *cells)
    return Group(table, facts_table(results))


def _with_change(row: AseCoefficient | None, first: AseCoefficient | None) -> str:
    """Value, and the change in percent where there is one."""
    if row is None:
        return ""
    if first is None or first is row or first.value == 0.0 or row.value == first.value:
        return number(row.value, 4)
    return f"{number(row.value, 4)} ({100.0 * (row.value / first.value - 1.0):+.1f} %)"


def _turn_angles(results: Sequence[AseResult]) -> list[float]:
    """Rudder angles that any of the vehicles has a steady turn for."""
    turns = [t for r in results for t in r.facts.get("horizontal", {}).get("turns", [])]
    return sorted({t["rudder_deg"] for t in turns})


def _turn(result: AseResult, angle_deg: float) -> dict[str, float]:
    """The steady turn at one rudder angle, empty when there is none."""
    turns = result.facts.get("horizontal", {}).get("turns", [])
    return next((t for t in turns if t["rudder_deg"] == angle_deg), {})


def _row_table(title: str, rows: Sequence[dict[str, float]]) -> Table:
    """A table of dictionaries with equal keys."""
    table = house_table(title)
    keys = list(dict.fromkeys(key for row in rows for key in row))
    for key in keys:
        table.add_column(key, justify="right")
    for row in rows:
        table.add_row(*[_cell(row.get(key)) for key in keys])
    return table


def _cell(value: Any) -> str:
    """A fact as text; empty when it does not exist."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(float(value), 4)
