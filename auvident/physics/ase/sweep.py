"""Design sweeps: thousands of geometry variants in one vectorised evaluation."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import UsageError
from auvident.physics.ase.assembly import coefficient_parts, totals
from auvident.physics.ase.stability import (
    horizontal_stability,
    linear_turning_gain,
    vertical_stability,
)
from auvident.schema.vehicle import Vehicle
from auvident.schema.vehicle_checks import contradictions

if TYPE_CHECKING:
    import pandas as pd

FIN_KINDS = ("rudder", "elevator", "sail")
TABLES = {"vehicle": "body", "hull": "hull", "propeller": "propeller", "fluid": "fluid"}
CHUNK = 2500  # variants at a time: about 100 MB of intermediate arrays
MOST_VARIANTS = 1_000_000
EXAMPLE = "for example rudder.exposed_span_m=0.08:0.16:100"


def parse_sweep(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Turn ``key=start:stop:count`` (or ``key=a,b,c``) into the values of each swept key.

    Parameters
    ----------
    texts : sequence of str
        ``rudder.exposed_span_m=0.08:0.16:100``: table and key of the vehicle file; fins by kind.

    Returns
    -------
    dict of str to ndarray, shape (count,)

    Raises
    ------
    UsageError
        What cannot be read, a key twice, or too many variants.
    """
    grid: dict[str, np.ndarray] = {}
    for text in texts:
        key, equals, values = text.partition("=")
        if not equals or "." not in key:
            raise UsageError("is not table.key=start:stop:count", f"--sweep {text}", EXAMPLE)
        if key in grid:
            raise UsageError(f"{key} is swept twice", f"--sweep {text}")
        grid[key] = _parse_values(values, text)
    _refuse_many(grid)
    return grid


def _parse_values(values: str, text: str) -> np.ndarray:
    """The numbers of one sweep."""
    try:
        if ":" not in values:
            numbers = np.array([float(v) for v in values.split(",")])
        else:
            start, stop, count = values.split(":")
            if not 1 <= int(count) <= MOST_VARIANTS:
                raise UsageError(
                    f"the count {count} is not between 1 and {MOST_VARIANTS}",
                    f"--sweep {text}",
                    EXAMPLE,
                )
            numbers = np.linspace(float(start), float(stop), int(count))
    except ValueError:
        raise UsageError(
            f"{values!r} is not start:stop:count", f"--sweep {text}", EXAMPLE
        ) from None
    if not np.all(np.isfinite(numbers)):
        raise UsageError(f"{values!r} is not finite", f"--sweep {text}", EXAMPLE)
    return numbers


def _refuse_many(grid: Mapping[str, np.ndarray]) -> None:
    """A factorial grid grows quickly; say so before the memory does."""
    count = math.prod(len(v) for v in grid.values())
    if count > MOST_VARIANTS:
        raise UsageError(
            f"{count} variants are more than {MOST_VARIANTS}", "--sweep", "Use smaller counts."
        )


def sweep(
    vehicle: Vehicle, grid: Mapping[str, Any], speed_mps: float | None = None
) -> "pd.DataFrame":
    """Coefficients of every combination of the swept values.

    Parameters
    ----------
    vehicle : Vehicle
        The design that the other numbers come from; a body of revolution.
    grid : mapping of str to array_like
        Values by key, as `parse_sweep` returns them; ``rudder.x_m`` sets all fins of that kind.
    speed_mps : float, optional
        For the Reynolds numbers, when the vehicle file has no design speed.

    Returns
    -------
    pandas.DataFrame
        One row a variant, the first key varying slowest: the swept keys, every coefficient
        (dimensional SI), ``G_H``, ``G_V``, ``turning_gain_per_m`` (linear r/(u delta)), and
        ``problem``: empty, or why the variant is impossible, its coefficients then being null.

    Raises
    ------
    UsageError
        A key that cannot be swept, or a hull that is no body of revolution.
    """
    import pandas as pd

    if not vehicle.hull.is_body_of_revolution:
        raise UsageError("only a body of revolution can be swept", "[hull]")
    _refuse_many(grid)
    columns = [np.atleast_1d(np.asarray(v, dtype=float)) for v in grid.values()]
    mesh = [m.ravel() for m in np.meshgrid(*columns, indexing="ij")]
    count = mesh[0].size if mesh else 1
    for key in grid:
        _check_key(vehicle, key)
    tables = []
    for start in range(0, count, CHUNK):
        piece = {k: m[start : start + CHUNK] for k, m in zip(grid, mesh, strict=True)}
        tables.append(_evaluate(vehicle, piece, min(CHUNK, count - start), speed_mps))
    return pd.concat(tables, ignore_index=True)


def _evaluate(
    vehicle: Vehicle, values: dict[str, np.ndarray], count: int, speed_mps: float | None
) -> "pd.DataFrame":
    """One chunk of variants."""
    import pandas as pd

    problems = _problems(vehicle, values, count)
    possible = problems == ""
    kept = {key: v[possible] for key, v in values.items()}
    frame = pd.DataFrame({**values, "problem": problems})
    if not np.any(possible):
        return frame
    variants = with_values(vehicle, kept)
    design_speed: Any = variants.body.design_speed_mps
    speed = (speed_mps or USUAL_SPEED_MPS) if design_speed is None else design_speed
    result = totals(coefficient_parts(variants, speed))
    for symbol, known in vehicle.coefficients.items():
        result[symbol] = np.asarray(known.value)
    result |= _facts(variants, result)
    size = int(np.count_nonzero(possible))
    table = {}
    for name, value in result.items():
        column = np.full(count, np.nan)
        column[possible] = np.broadcast_to(value, (size,))
        table[name] = column
    return pd.concat([frame, pd.DataFrame(table)], axis=1)


def _facts(variants: Vehicle, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Stability and turning of all variants; NaN (null) without lift or rudder."""
    mass = np.asarray(variants.body.mass_kg, float)
    x_g = np.asarray(variants.body.x_g_m, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "G_H": horizontal_stability(values, mass, x_g),
            "G_V": vertical_stability(values, mass, x_g),
            "turning_gain_per_m": linear_turning_gain(values, mass, x_g),
        }


def _problems(vehicle: Vehicle, values: Mapping[str, np.ndarray], count: int) -> np.ndarray:
    """Why each variant is impossible; empty where it is not."""
    problems = np.full(count, "", dtype=object)
    positive = _not_positive(with_values(vehicle, values), count)
    problems[positive] = "a size is zero or negative"
    left = np.flatnonzero(~positive)
    if left.size == 0:
        return problems
    kept = {key: v[left] for key, v in values.items()}
    for fault in contradictions(with_values(vehicle, kept)):
        concerned = left[np.broadcast_to(fault.mask, left.shape)]
        first = concerned[problems[concerned] == ""]
        problems[first] = f"{fault.where}: {fault.problem}"
    return problems


def _not_positive(variants: Vehicle, count: int) -> np.ndarray:
    """Variants in which a swept size that must be positive is not."""
    wrong = np.zeros(count, dtype=bool)
    for table in (variants.body, variants.hull, variants.fluid, variants.propeller, *variants.fin):
        if table is None:
            continue
        for name, info in type(table).model_fields.items():
            value = getattr(table, name)
            if not isinstance(value, np.ndarray):
                continue
            for rule in _rules(info):
                if getattr(rule, "gt", None) == 0:
                    wrong |= value <= 0.0
                elif getattr(rule, "ge", None) == 0:
                    wrong |= value < 0.0
    return wrong


def _rules(info: Any) -> list[Any]:
    """Bounds declared for a field, also those inside ``Positive | None``."""
    rules = list(info.metadata)
    for option in getattr(info.annotation, "__args__", ()):
        for extra in getattr(option, "__metadata__", ()):
            rules += list(getattr(extra, "metadata", [extra]))
    return rules


def with_values(vehicle: Vehicle, values: Mapping[str, np.ndarray]) -> Vehicle:
    """The vehicle with arrays in place of some numbers, for the functions that broadcast."""
    for key, array in values.items():
        table, _, name = key.partition(".")
        if table in FIN_KINDS:
            fins = tuple(
                f.model_copy(update={name: array}) if f.kind == table else f for f in vehicle.fin
            )
            vehicle = vehicle.model_copy(update={"fin": fins})
        else:
            part: BaseModel = getattr(vehicle, TABLES[table])
            vehicle = vehicle.model_copy(
                update={TABLES[table]: part.model_copy(update={name: array})}
            )
    return vehicle


def _check_key(vehicle: Vehicle, key: str) -> None:
    """Refuse a key that names no number of this vehicle."""
    table, _, name = key.partition(".")
    where = f"--sweep {key}"
    if table in FIN_KINDS:
        targets: list[Any] = [f for f in vehicle.fin if f.kind == table]
    elif table in TABLES:
        targets = [t for t in (getattr(vehicle, TABLES[table]),) if t is not None]
    else:
        raise UsageError(
            f"there is no table {table!r}", where, f"One of {', '.join((*TABLES, *FIN_KINDS))}."
        )
    if not targets:
        raise UsageError(f"the vehicle file has no {table}", where)
    numbers = [n for n in type(targets[0]).model_fields if _is_number(targets[0], n)]
    if name not in numbers:
        raise UsageError(
            f"{name!r} is not a number of {table}", where, f"One of {', '.join(numbers)}."
        )
    if table == "hull" and vehicle.hull.family == "offsets":
        raise UsageError("a hull of offsets has a fixed shape", where, "Sweep a Myring hull.")


def _is_number(table: BaseModel, name: str) -> bool:
    """Whether a field holds one number (a count is part of the structure, not a size)."""
    annotation = str(type(table).model_fields[name].annotation)
    return "float" in annotation and "tuple" not in annotation and name not in ("dihedral_deg",)
