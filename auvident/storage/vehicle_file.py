"""The vehicle file: read, offsets resolved, impossible geometry refused with the reason."""

import csv
from pathlib import Path
from typing import Any

from auvident.errors import InputError
from auvident.schema.vehicle import Vehicle
from auvident.schema.vehicle_checks import contradictions
from auvident.storage.declared import parse, read_toml

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
    data = read_toml(path)
    _resolve_offsets(data, path)
    vehicle = parse(Vehicle, data, path, REMEDY)
    for fault in contradictions(vehicle):
        raise InputError(fault.problem, f"{path}: {fault.where}", fault.remedy)
    return vehicle


def _resolve_offsets(data: dict[str, Any], path: Path) -> None:
    """Replace the name of an offsets file by its two columns."""
    hull = data.get("hull")
    if not isinstance(hull, dict) or not isinstance(hull.get("offsets"), str):
        return
    if hull.keys() & {"offsets_x_from_nose_m", "offsets_radius_m"}:
        raise InputError(
            "offsets are given as a file and as arrays",
            f"{path}: [hull] offsets",
            "Keep one of them.",
        )
    stations, radii = read_offsets(path.parent / hull.pop("offsets"), path)
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
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"the offsets file {path} cannot be read: {error}",
            f"{named_in}: [hull] offsets",
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
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _number(
    cells: list[str], index: int, path: Path, row: int, column: str, delimiter: str
) -> float:
    """One cell as a number, or an error with its place."""
    text = cells[index] if index < len(cells) else ""
    try:
        return float(text.replace(",", ".") if delimiter == ";" else text)
    except ValueError:
        raise InputError(
            f"{text!r} is not a number", f"{path}: row {row}, column {column}", "Metres."
        ) from None
