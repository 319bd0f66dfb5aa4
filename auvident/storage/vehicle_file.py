"""The vehicle file: read, offsets resolved, impossible geometry refused with the reason."""

import csv
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from auvident.errors import InputError
from auvident.schema.quoting import LONGEST_TEXT, clipped
from auvident.schema.vehicle import Vehicle
from auvident.schema.vehicle_checks import contradictions
from auvident.storage.declared import MOST_BYTES, file_named_in, parse, read_toml
from auvident.storage.regular import read_small

OFFSETS = "[hull] offsets"
MOST_FINS = 50  # sets of equal fins
# Ending of a key, and the sizes that a number under it may have unless it is zero: from a tank
# model of a few centimetres to the largest ship, so that no formula over- or underflows.
LIMITS = (
    ("length_m", 1e-4, 1e4),
    ("tail_base_diameter_m", 0.0, 1e3),  # some tails end in a point, or nearly so
    ("diameter_m", 1e-4, 1e3),
    ("chord_m", 1e-4, 1e3),
    ("span_m", 1e-4, 1e3),
    ("beam_m", 1e-4, 1e3),
    ("draught_m", 1e-4, 1e3),
    ("kgm2", 1e-9, 1e16),
    ("mass_kg", 1e-4, 1e10),
    ("density_kgpm3", 1.0, 1e5),
    ("viscosity_m2ps", 1e-9, 1.0),
    ("_m3", 1e-9, 1e8),
    ("_mps", 1e-9, 100.0),
    ("_m", 0.0, 1e4),
    ("", 0.0, 1e15),
)
LIMITS_REMEDY = "Check the unit, which is the ending of the key."
OFFSET_COLUMNS = ("x_from_nose_m", "radius_m")
REMEDY = "`auvident schema vehicle` lists the tables and keys."


def load_vehicle(path: Path) -> Vehicle:
    """Read a vehicle file.

    Parameters
    ----------
    path : Path
        TOML; ``offsets = "hull.csv"`` is taken relative to it.

    Returns
    -------
    Vehicle
        With the offsets as arrays.

    Raises
    ------
    InputError
        Missing or unreadable file, unknown key, wrong value, impossible geometry; names file,
        table and key, and the two numbers that contradict each other.
    """
    path = Path(path)
    return vehicle_from(read_toml(path), path)


def vehicle_from(tables: Mapping[str, Any], path: Path) -> Vehicle:
    """A vehicle from the tables of its file, as `load_vehicle` reads it.

    Parameters
    ----------
    tables : mapping
        Table -> key -> value; left as it is.
    path : Path
        The file, for messages and for the folder of an offsets file.
    """
    data = deepcopy(dict(tables))
    _resolve_offsets(data, path)
    _refuse_many(data, path)
    vehicle = parse(Vehicle, data, path, REMEDY)
    for key, value, least, most in beyond_limits(vehicle):
        raise InputError(
            f"{value:g} is not between {least:g} and {most:g}", f"{path}: {key}", LIMITS_REMEDY
        )
    for fault in contradictions(vehicle):
        raise InputError(fault.problem, f"{path}: {fault.where}", fault.remedy)
    return vehicle


def _refuse_many(data: dict[str, Any], path: Path) -> None:
    """Refuse what is too long to be a vehicle, before much work is done with it."""
    body, fins = data.get("vehicle"), data.get("fin")
    name = body.get("name") if isinstance(body, dict) else None
    if isinstance(name, str) and len(name) > LONGEST_TEXT:
        raise InputError(
            f"a name of {len(name)} characters",
            f"{path}: [vehicle] name",
            f"Use at most {LONGEST_TEXT}.",
        )
    if isinstance(fins, list) and len(fins) > MOST_FINS:
        raise InputError(f"{len(fins)} sets of fins", f"{path}: [[fin]]", f"{MOST_FINS} at most.")


def beyond_limits(vehicle: Vehicle) -> Iterator[tuple[str, float, float, float]]:
    """Numbers that no vehicle has: key, value, and the limits of its size."""
    yield from _beyond(vehicle.model_dump(by_alias=True), "")


def _beyond(tree: Any, place: str) -> Iterator[tuple[str, float, float, float]]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _beyond(value, f"{place}.{key}" if place else f"[{key}]")
    elif isinstance(tree, list | tuple):
        if tree and isinstance(tree[0], float):  # of stations the smallest may be rounding
            tree = (max(tree, key=abs),)
        for value in tree:
            yield from _beyond(value, place)
    elif isinstance(tree, int | float) and tree:
        least, most = next((a, b) for end, a, b in LIMITS if place.endswith(end))
        if not least <= abs(tree) <= most:
            yield place, tree, least, most


def _resolve_offsets(data: dict[str, Any], path: Path) -> None:
    """Replace the name of an offsets file by its two columns."""
    hull = data.get("hull")
    if not isinstance(hull, dict) or not isinstance(hull.get("offsets"), str):
        return
    if hull.keys() & {"offsets_x_from_nose_m", "offsets_radius_m"}:
        raise InputError(
            "offsets are given as a file and as arrays",
            f"{path}: {OFFSETS}",
            "Keep one of them.",
        )
    file = file_named_in(path, hull.pop("offsets"), OFFSETS)
    stations, radii = read_offsets(file, path)
    hull["offsets_x_from_nose_m"], hull["offsets_radius_m"] = stations, radii


def read_offsets(path: Path, named_in: Path) -> tuple[list[float], list[float]]:
    """Stations and radii of an offsets file.

    Parameters
    ----------
    path : Path
        CSV with the columns ``x_from_nose_m,radius_m``; comma or semicolon, ``#`` comments.
    named_in : Path
        The vehicle file, for the error of a missing file.

    Returns
    -------
    x_from_nose_m, radius_m : list of float

    Raises
    ------
    InputError
        Missing file or column, a cell that is no number; names file, row and column.
    """
    try:
        text = read_small(path, MOST_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"the offsets file {path} cannot be read: {why}",
            f"{named_in}: {OFFSETS}",
            "The path is relative to the vehicle file.",
        ) from None
    rows = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    delimiter = ";" if rows and ";" in rows[0][1] else ","
    header = _cells(rows[0][1], delimiter) if rows else []
    missing = [c for c in OFFSET_COLUMNS if c not in header]
    if missing:
        raise InputError(
            f"no column {missing[0]!r}", str(path), f"Its header is {','.join(OFFSET_COLUMNS)}."
        )
    columns: tuple[list[float], list[float]] = ([], [])
    for number, line in rows[1:]:
        cells = _cells(line, delimiter)
        for values, column in zip(columns, OFFSET_COLUMNS, strict=True):
            values.append(_number(cells, header.index(column), path, number, column, delimiter))
    return columns


def _cells(line: str, delimiter: str) -> list[str]:
    """Cells of one line, without blanks around them."""
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:  # a cell of more than 131,072 characters, which is no number
        return [line]


def _number(
    cells: list[str], index: int, path: Path, row: int, column: str, delimiter: str
) -> float:
    """One cell as a number, or an error with its place."""
    text = cells[index] if index < len(cells) else ""
    try:
        return float(text.replace(",", ".") if delimiter == ";" else text)
    except ValueError:
        raise InputError(
            f"{clipped(text)!r} is not a number", f"{path}: row {row}, column {column}", "Metres."
        ) from None
