"""The estimate for people: one vehicle with parts and facts, or several designs side by side."""

from collections.abc import Sequence
from typing import Any

from rich.console import Group, RenderableType

from auvident.report.console_style import finding_line, rich_table
from auvident.report.numbers import TERMINAL
from auvident.report.tables import Cell, Column, Number, Rows, Table, WithStd, columns
from auvident.schema.artifacts import AseCoefficient, AseResult
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.planes import PLANES

number = TERMINAL.number
PARTS = ("hull", "sail", "rudder", "elevator", "propeller", "appendages")
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
    tables = [coefficient_table(result)]
    if result.geometry:
        tables.append(geometry_table(result))
    tables.append(facts_table((result,)))
    turns = result.facts.get("horizontal", {}).get("turns")
    if turns:
        tables.append(_row_table("Steady turns, rudder to port", turns))
    speeds = result.facts.get("speed", {}).get("table")
    if speeds:
        tables.append(_row_table("Straight run", speeds))
    return Group(*map(rich_table, tables), *map(finding_line, result.findings))


def coefficient_table(result: AseResult) -> Table:
    """Value, deviation, prime value and contribution of each part, by plane."""
    heads = (*columns(("", "unit")), *columns(numbers=("value ± std", "1000 × prime", *PARTS)))
    rows: list[Sequence[Cell]] = []
    for plane, title in TITLES.items():
        own = [_coefficient_cells(c) for c in result.coefficients if c.plane == plane]
        rows += [[title] + [""] * (len(heads)), *own] if own else []
    return Table(
        (*heads, *columns(numbers=("rigid body",))),
        rows,
        f"{result.vehicle}: coefficients at {result.speed_mps:g} m/s",
    )


def _coefficient_cells(row: AseCoefficient) -> list[Cell]:
    """Cells of one coefficient; a given one is marked."""
    mark = " (given)" if row.origin == "given" else ""
    return [
        row.symbol + mark,
        row.unit,
        WithStd(row.value, row.std),
        Number(1e3 * row.prime, 4),
        *(Number(row.parts[p], 4) if p in row.parts else "" for p in PARTS),
        Number(row.rigid_body, 4) if row.rigid_body else "",
    ]


def geometry_table(result: AseResult) -> Table:
    """Sizes, centroids and numbers that the formulas use."""
    rows: Rows = [
        [name, Number(result.geometry[key], 4), unit]
        for key, name, unit in SIZES
        if key in result.geometry
    ]
    return Table((*columns(("",), ("value",)), Column("unit")), rows, "Geometry")


def facts_table(results: Sequence[AseResult]) -> Table:
    """Stability, turning and speed, one column a vehicle."""
    rows: list[Sequence[Cell]] = []
    for group, key, name in DESIGN_FACTS:
        cells = [_cell(r.facts.get(group, {}).get(key)) for r in results]
        rows += [[name, *cells]] if any(cells) else []
    for angle in _turn_angles(results):
        diameters = [_cell(_turn(r, angle).get("diameter_m")) for r in results]
        rows.append([f"turning diameter at {angle:g}° rudder, m", *diameters])
    return Table(columns(("",), [r.vehicle for r in results]), rows, "Derived figures")


def side_by_side(results: Sequence[AseResult]) -> RenderableType:
    """Several designs: coefficients, the change against the first, and the facts.

    Parameters
    ----------
    results : sequence of AseResult, at least 1

    Returns
    -------
    rich renderable
    """
    rows = [r.by_symbol() for r in results]
    cells = [
        [s, BY_SYMBOL[s].unit, *(_with_change(row.get(s), rows[0].get(s)) for row in rows)]
        for s in BY_SYMBOL
        if any(s in row for row in rows)
    ]
    heads = columns(("", "unit"), [r.vehicle for r in results])
    title = "Coefficients side by side (change against the first)"
    return Group(rich_table(Table(heads, cells, title)), rich_table(facts_table(results)))


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
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return Table(
        columns(numbers=keys), [[_cell(row.get(key)) for key in keys] for row in rows], title
    )


def _cell(value: Any) -> str:
    """A fact as text; empty when it does not exist."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(float(value), 4)
