"""The estimate from geometry in the vertical plane and in roll against what is known of vehicles.

``python -m tests.bench geometry [--count N] [--half tune|report] [--write]``: measured derivatives
of SUBOFF, published ones of REMUS, and vehicles drawn by the generator.
"""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from auvident.physics.ase.roll import ROLL_ROWS, roll_estimate
from auvident.schema.artifacts import AseResult
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from auvident.storage.vehicle_file import load_vehicle
from tests.bench import published, written
from tests.bench.effects import program
from tests.bench.geometry_truth import damped, drawn, roll_truth, truth
from tests.bench.halves import HALVES, options_of

Rows = list[dict[str, Any]]

VEHICLES = Path(__file__).parents[1] / "data" / "vehicles"
BAR = 1.5  # root mean square of error over deviation above which a deviation is too narrow
MIRRORED = (
    *(("Z_uw", "Y_uv"), ("M_uw", "N_uv"), ("Z_uq", "Y_ur"), ("M_uq", "N_ur")),
    *(("Z_w|w|", "Y_v|v|"), ("M_w|w|", "N_v|v|"), ("Z_q|q|", "Y_r|r|"), ("M_q|q|", "N_r|r|")),
    *(("Z_uud", "Y_uud"), ("M_uud", "N_uud"), ("Z_wdot", "Y_vdot"), ("Z_qdot", "Y_rdot")),
    *(("M_qdot", "N_rdot"), ("X_ww", "X_vv"), ("X_wq", "X_vr"), ("X_qq", "X_rr")),
)
WHY = {
    "Z_uw": "planes in the wake of the stern; carry-over on a hull that narrows",
    "M_uw": "the same lift turns against the hull's moment",
    "Z_uq": "planes too strong, hull without lift by rate: they offset each other",
    "M_uq": "as Z_uq",
    "Z_wdot": "strips of a finite body, 20-25 % high",
    "M_wdot": "small difference of fore and aft strips",
    "Z_qdot": "as M_wdot",
    "M_qdot": "strips: 21 % high on the hull, 20 % more by short planes",
    "Z_uud": "planes in the wake of the stern, and K_W(B) there",
    "M_uud": "as Z_uud",
}


def main(arguments: list[str], show: Callable[[str, Rows], None]) -> None:
    """Measure, print, and replace the section of the page if asked."""
    options = options_of("geometry", __doc__, 40).parse_args(arguments)
    tables = {
        "DARPA SUBOFF, vertical plane, prime values times 1000 (Roddy 1990)": suboff(),
        "REMUS, vertical plane (Prestero 2001, calculated; both fins of a pair)": remus(),
        "error over deviation on drawn vehicles": on_drawn(options.count, options.half),
        "the same in roll (K_up against the fins alone)": roll_on_drawn(
            options.count, options.half
        ),
    }
    for title, rows in tables.items():
        show(title, rows)
    if options.write:
        parity = "even" if options.half == HALVES[0] else "odd"
        told = f"{options.count} drawn vehicles, {parity} seeds"
        written.write("geometry", f"Program `{program()}`; {told}.", tables)


def of_kinds(vehicle: Vehicle, kinds: Iterable[str]) -> Vehicle:
    """The vehicle with some of its fins."""
    return vehicle.model_copy(update={"fin": tuple(f for f in vehicle.fin if f.kind in kinds)})


def prime(result: AseResult, length_m: float) -> dict[str, tuple[float, float]]:
    """Prime values and deviations on a reference length."""
    half = 0.5 * result.density_kgpm3
    unit = {s: half * length_m**c.length_power for s, c in BY_SYMBOL.items()}
    return {
        c.symbol: (c.value / unit[c.symbol], c.std / unit[c.symbol]) for c in result.coefficients
    }


def suboff() -> Rows:
    """Estimate against measurement, by configuration."""
    vehicle, rows = load_vehicle(VEHICLES / "suboff.toml"), []
    for name, kinds, measured in published.SUBOFF:
        found = prime(estimate(of_kinds(vehicle, kinds)), published.LENGTH_PP)
        for symbol, value in measured.items():
            rows.append({"configuration": name, **_compared(symbol, value, found[symbol], 1e3)})
            appended = kinds == published.SUBOFF_KINDS
            rows[-1]["why it is off"] = WHY.get(symbol, "") if appended else ""
    return rows


def remus() -> Rows:
    """Estimate against the tables of the source."""
    rows = estimate(load_vehicle(VEHICLES / "remus.toml")).by_symbol()
    return [
        _compared(s, value, (rows[s].value, rows[s].std)) for s, value in published.REMUS.items()
    ]


def _compared(
    symbol: str, known: float, found: tuple[float, float], scale: float = 1.0
) -> dict[str, Any]:
    value, std = found
    return {
        "coefficient": symbol,
        "published": scale * known,
        "estimate": scale * value,
        "std": scale * std,
        "ratio": value / known,
        "error over std": (known - value) / std,
    }


@cache
def errors(count: int, half: str = HALVES[0]) -> dict[str, np.ndarray]:
    """Errors over standard deviations (count,) by symbol, and which vehicles have odd damping.

    The two planes share X_udot, X_uu, T_nn and T_nu; terms of roll have ``roll`` before them.
    """
    rows: list[dict[str, float]] = []
    for one in drawn(range(HALVES.index(half), 100 * count, 2), count):
        found = estimate(Vehicle.model_validate(one.stated)).by_symbol()
        true = truth(one.vehicle, one.size)
        row = {s: (value - found[s].value) / found[s].std for s, value in true.items()}
        rolling = roll_estimate(Vehicle.model_validate(one.stated))
        for symbol, value in roll_truth(one.vehicle, one.size).items():
            row[f"roll {symbol}"] = (value - rolling[symbol].value) / rolling[symbol].std
        rows.append(row | {"damped": float(damped(one.vehicle))})
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def on_drawn(count: int, half: str) -> Rows:
    """Mean and root mean square by coefficient, with its mirror image in the horizontal plane."""
    z = errors(count, half)
    plain = z["damped"] == 0.0
    return [
        {
            "coefficient": own,
            "mean": float(np.mean(z[own])),
            "rms": rms(z[own]),
            "rms without other damping": rms(z[own][plain]),
            "horizontal": other,
            "its mean": float(np.mean(z[other])),
            "its rms": rms(z[other]),
        }
        for own, other in MIRRORED
    ]


def roll_on_drawn(count: int, half: str) -> Rows:
    """Mean and root mean square of the roll terms; K_up is the part of the fins."""
    z, rows = errors(count, half), []
    for row in ROLL_ROWS:
        own = z.get(f"roll {row.symbol}")
        if own is not None:
            told = {"mean": float(np.mean(own)), "rms": rms(own)}
            rows.append({"term": row.symbol, "meaning": row.meaning, **told})
    return rows
