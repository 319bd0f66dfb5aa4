"""The estimate for people: one vehicle with parts and facts, or several designs side by side."""

from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Group, RenderableType

from auvident.report.console_style import finding_line, rich_table
from auvident.report.numbers import TERMINAL
from auvident.report.tables import Cell, Column, Fixed, Number, Rows, Table, WithStd, columns
from auvident.schema.artifacts import AseCoefficient, AseConstant, AseResult
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.planes import PLANES

Estimated = AseCoefficient | AseConstant
number = TERMINAL.number
OFTEN = 0.95  # share of the draws above which a figure is told without it
BODY = "body"  # of roll: what stands in the vehicle file, or a uniform body
PARTS = ("hull", "sail", "rudder", "elevator", "propeller", "appendages")
TITLES: dict[str, str] = {"both": "both planes", **{plane: f"{plane} plane" for plane in PLANES}}
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
HEADS = {
    "rudder_deg": "rudder, deg",
    "rate_per_speed_degpm": "rate ÷ speed, deg/m",
    "drift_deg": "drift angle, deg",
    "diameter_m": "diameter, m",
    "speed_ratio": "speed ÷ approach",
    "speed_mps": "speed, m/s",
}
# figures with their spread; by group, key and words, with the rudder or the rate they are for
SPREAD_FACTS = (
    ("horizontal", "G", "G horizontal (> 0 stable)"),
    ("horizontal", "unstable_probability", "probability of being directionally unstable"),
    ("horizontal", "weathercock_probability", "probability of N_uv > 0 (bow into the flow)"),
    ("horizontal", "tactical_diameter_m", "tactical diameter at {circle_rudder_deg:g}° rudder, m"),
    ("horizontal", "overshoot_1_deg", "first overshoot of a zigzag at {zigzag_rudder_deg:g}°, deg"),
    ("horizontal", "overshoot_2_deg", "second overshoot, deg"),
    ("horizontal", "servo_degps", "with a servo of, deg/s"),
    ("vertical", "G", "G vertical (> 0 stable)"),
    ("vertical", "unstable_probability", "probability of G vertical < 0"),
    ("speed", "speed_mps", "speed at {rpm:.0f} rpm, m/s"),
)
DESIGN_FACTS = (
    ("vertical", "stable_below_mps", "vertical: stable below, m/s"),
    (
        "horizontal",
        "linear_rate_per_speed_and_rudder_perm",
        "rate of turn per speed and rudder, 1/m",
    ),
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
    tables = [*coefficient_tables(result)]
    if result.constants:
        tables.append(constant_table(result))
    if result.roll:
        tables.append(roll_table(result))
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


def coefficient_tables(result: AseResult) -> Iterator[Table]:
    """Value, deviation, prime value and contribution of each part: a table for each plane.

    A plane shows the parts that it has, so that it stands side by side in a narrow terminal.
    """
    for plane, title in TITLES.items():
        own = [c for c in result.coefficients if c.plane == plane]
        parts = [p for p in PARTS if any(p in c.parts for c in own)]
        numbers = ("value ± std", "1000 × prime", *parts, "rigid body")
        if not any(c.rigid_body for c in own):
            numbers = numbers[:-1]
        heads = (*columns(("", "unit")), *columns(numbers=numbers))
        cells = [_coefficient_cells(c, parts)[: len(heads)] for c in own]
        if own:
            yield Table(heads, cells, f"{result.vehicle}: {title} at {result.speed_mps:g} m/s")


def roll_table(result: AseResult) -> Table:
    """Terms of roll with deviation and contribution of each part."""
    parts = [p for p in (BODY, *PARTS) if any(p in row.parts for row in result.roll)]
    rows: Rows = [
        [
            row.symbol,
            row.regressor,
            row.unit,
            WithStd(row.value, row.std),
            *(Number(row.parts[p], 4) if p in row.parts else "" for p in parts),
        ]
        for row in result.roll
    ]
    heads = (*columns(("", "multiplies", "unit")), *columns(numbers=("value ± std", *parts)))
    return Table(heads, rows, f"{result.vehicle}: roll at {result.speed_mps:g} m/s")


def _coefficient_cells(row: AseCoefficient, parts: Sequence[str]) -> list[Cell]:
    """Cells of one coefficient; a given one is marked."""
    mark = " (given)" if row.origin == "given" else ""
    return [
        row.symbol + mark,
        row.unit,
        WithStd(row.value, row.std),
        Number(1e3 * row.prime, 4),
        *(Number(row.parts[p], 4) if p in row.parts else "" for p in parts),
        Number(row.rigid_body, 4) if row.rigid_body else "",
    ]


def constant_table(result: AseResult) -> Table:
    """Weight in water, trim and righting moment with their deviation, and what they rest on."""
    rows: Rows = [
        [c.symbol, ESTIMATED[c.symbol].meaning, c.unit, WithStd(c.value, c.std), c.source]
        for c in result.constants
    ]
    heads = (*columns(("", "meaning", "unit"), ("value ± std",)), Column("rests on"))
    return Table(heads, rows, "Constants of the vertical plane, from the vehicle file")


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
    rows: list[Sequence[Cell]] = _spread_rows(results)
    for group, key, name in DESIGN_FACTS:
        cells = [_cell(r.facts.get(group, {}).get(key)) for r in results]
        rows += [[name, *cells]] if any(cells) else []
    for angle in _turn_angles(results):
        diameters = [_cell(_turn(r, angle).get("diameter_m")) for r in results]
        rows.append([f"turning diameter at {angle:g}° rudder, m", *diameters])
    return Table(columns(("",), [r.vehicle for r in results]), rows, "Derived figures")


def _spread_rows(results: Sequence[AseResult]) -> list[Sequence[Cell]]:
    """Figures with their standard deviation, and probabilities; rudder or rate of the first."""
    rows: list[Sequence[Cell]] = []
    for group, key, words in SPREAD_FACTS:
        groups = [r.facts.get("spread", {}).get(group, {}) for r in results]
        own = next((g for g in groups if key in g), None)
        if own is not None:
            numbers = {k: v for k, v in own.items() if isinstance(v, float)}
            rows.append([words.format(**numbers), *(_spread_cell(g.get(key)) for g in groups)])
    return rows


def _spread_cell(fact: Any) -> Cell:
    """A figure with its standard deviation, and how often it exists; or a probability."""
    if not isinstance(fact, dict):
        return "" if fact is None else Fixed(fact, ".2f")
    if "value" not in fact:
        return ""
    share = fact.get("share", 1.0)
    seldom = "" if share > OFTEN else f" (in {100.0 * share:.0f} %)"
    return WithStd(fact["value"], fact.get("std"), seldom)


def side_by_side(results: Sequence[AseResult]) -> RenderableType:
    """Several designs: coefficients, the change against the first, and the facts.

    Parameters
    ----------
    results : sequence of AseResult, at least 1

    Returns
    -------
    rich renderable
    """
    rows = [{c.symbol: c for c in r.estimates} for r in results]
    cells = [
        [s, c.unit, *(_with_change(row.get(s), rows[0].get(s)) for row in rows)]
        for s, c in ESTIMATED.items()
        if any(s in row for row in rows)
    ]
    heads = columns(("", "unit"), [r.vehicle for r in results])
    title = "Coefficients side by side (change against the first)"
    return Group(rich_table(Table(heads, cells, title)), rich_table(facts_table(results)))


def _with_change(row: Estimated | None, first: Estimated | None) -> str:
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
        columns(numbers=[HEADS.get(key, key) for key in keys]),
        [[_cell(row.get(key)) for key in keys] for row in rows],
        title,
    )


def _cell(value: Any) -> str:
    """A fact as text; empty when it does not exist."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(float(value), 4)
