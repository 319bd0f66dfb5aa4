"""One model of six degrees of freedom from those of the planes, geometry and vehicle file."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from auvident.constants import GRAVITY_MPS2
from auvident.engines.carried import structure_behind
from auvident.errors import InputError, UsageError
from auvident.physics.ase.roll import roll_estimate
from auvident.physics.six_dof_terms import (
    COEFFICIENTS,
    DRAG_OF,
    FIN_DRAG,
    ROLL_SIGNS,
    ROLL_UNITS,
    whole_name,
    whole_names,
)
from auvident.schema.artifacts import AseResult, Finding, IdentifiedModel, Sensing
from auvident.schema.coefficients import BY_SYMBOL, prime_unit
from auvident.schema.combined import (
    CombinedEntry,
    CombinedModel,
    CombinedSource,
    CovarianceBlock,
)
from auvident.schema.places import BESIDE, beside
from auvident.schema.planes import BY_FIN, PLANES
from auvident.schema.vehicle import Vehicle
from auvident.stages.combine.band import band_of_planes
from auvident.stages.combine.roll import Logs, with_roll
from auvident.stages.combine.shared import JointPosterior, followed, join

GEOMETRY, FILE = "geometry", "vehicle file"
BALLAST = ("W-B", "x_GW", "z_GW")
INERTIAS = ("m", "I_xx", "I_yy", "I_zz")
UNITS = {"m": "kg", "I_yy": "kg m^2", "I_zz": "kg m^2", "W-B": "N", "x_GW": "N m", "z_GW": "N m"}
TORQUE = ("K_nn", "K_nu")  # no curve of K_Q in the vehicle file: zero, and said
SAME_MASS = 0.05  # share within which two runs are of one vehicle, ballasted anew

Roll = Mapping[str, Sequence[float]]

# of a run of both planes that was refined
OF_ONE_PLANE = {PLANES[0]: "refine/model.json", BESIDE: beside("refine/model.json")}


def combine(
    models: Sequence[IdentifiedModel],
    vehicle: Vehicle,
    ase: AseResult,
    roll: Roll | None = None,
    logs: Logs = (),
) -> CombinedModel:
    """Make one model of six degrees of freedom.

    Parameters
    ----------
    models : sequence of IdentifiedModel
        At most one of each plane; without any it is the estimate from geometry alone.
    vehicle : Vehicle
    ase : AseResult
        For the plane that no model covers.
    roll : mapping, optional
        Value, then standard deviation of the terms of roll by symbol; those of
        `auvident.physics.ase.roll.roll_estimate` unless given.
    logs : sequence of (trials, maneuvers), optional
        Of the runs: roll is identified from them where they show it.

    Returns
    -------
    CombinedModel
        Every entry with its origin, the covariance in independent blocks.

    Raises
    ------
    UsageError
        Two models of one plane.
    InputError
        A model of another vehicle.
    """
    _check(models, vehicle)
    rolling = _rolling(vehicle, roll)
    joined = followed(join(models), models)
    entries = {e.symbol: e for e in _geometry(ase)}
    entries |= {e.symbol: e for e in _constants(vehicle, ase, rolling)}
    entries |= {e.symbol: e for e in _rows_of_models(models, joined, ase)}
    known = [entries[s] for s in (*COEFFICIENTS, *ROLL_UNITS) if s in entries and s not in INERTIAS]
    combined = CombinedModel(
        vehicle=vehicle.body.name,
        length_m=ase.length_m,
        density_kgpm3=ase.density_kgpm3,
        x_g_m=vehicle.body.x_g_m,
        fin_x_m={fin: vehicle.station_of(fin) for fin in BY_FIN},
        coefficients=tuple(known),
        constants=tuple(entries[s] for s in (*INERTIAS, *BALLAST)),
        covariance=tuple(_blocks(entries, joined, ase)),
        effects={m.plane: m.effects for m in models},
        parameters=_effect_parameters(models, joined),
        sensing={p: _sensing(vehicle) for p in PLANES} | {m.plane: m.sensing for m in models},
        flown={m.plane: m.flown for m in models if m.flown},
        band=band_of_planes(models),
        pushes={m.plane: m.left_out.push for m in models if m.left_out and m.left_out.push},
        models=tuple(_source(m) for m in models),
        findings=(*joined.findings, *_findings(models, entries)),
    )
    return with_roll(combined, vehicle, logs)


def _check(models: Sequence[IdentifiedModel], vehicle: Vehicle) -> None:
    """Refuse two models of one plane, or of another vehicle."""
    for plane in PLANES:
        if sum(m.plane == plane for m in models) > 1:
            other = next(p for p in PLANES if p != plane)
            raise UsageError(
                f"there are two models of the {plane} plane",
                remedy=f"Give one of the {plane} plane and one of the {other} plane; of a run of "
                f"both planes, RUN/{OF_ONE_PLANE[other]} is the {other} one alone.",
            )
    for model in models:
        structure_behind(model)  # refuses effects that this version does not know
        mass, own = model.rigid_body.mass_kg, vehicle.body.mass_kg
        same = np.isclose(model.length_m, vehicle.hull.length_m) and model.vehicle == (
            vehicle.body.name
        )
        if not same or abs(mass - own) > SAME_MASS * own:
            raise InputError(
                f"the model of the {model.plane} plane is of another vehicle: {model.vehicle}, "
                f"{model.length_m:g} m, {mass:g} kg, not {vehicle.body.name}, "
                f"{vehicle.hull.length_m:g} m, {own:g} kg",
                remedy="Combine runs of one vehicle, with the same vehicle file.",
            )


def _rolling(vehicle: Vehicle, roll: Roll | None) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each term of roll."""
    estimated = roll_estimate(vehicle) if roll is None else roll
    rows = {symbol: (row[0], row[1]) for symbol, row in estimated.items()}
    return {s: (float(value), float(std)) for s, (value, std) in rows.items() if s in ROLL_UNITS}


def _geometry(ase: AseResult) -> Iterator[CombinedEntry]:
    """The coefficients of both planes before any data."""
    for c in ase.coefficients:
        origin = FILE if c.origin == "given" else GEOMETRY
        for symbol in DRAG_OF.values() if c.symbol == FIN_DRAG else (c.symbol,):
            yield CombinedEntry(
                symbol=symbol,
                value=c.value,
                std=c.std,
                unit=c.unit,
                origin=origin,
                prime=c.prime,
                sign=BY_SYMBOL[c.symbol].sign,
            )


def _constants(
    vehicle: Vehicle, ase: AseResult, rolling: Mapping[str, tuple[float, float]]
) -> Iterator[CombinedEntry]:
    """Mass, inertia, ballast and roll, as far as file and geometry say."""
    body = vehicle.body
    weight = body.mass_kg * GRAVITY_MPS2
    buoyancy = body.buoyancy_n or weight
    known = {"m": body.mass_kg, "I_zz": body.izz_kgm2, "I_yy": body.inertia_kgm2("vertical")}
    # a vehicle is ballasted to lie level: no trim moment unless one is known
    known |= {"W-B": weight - buoyancy, "x_GW": 0.0, "z_GW": body.z_g_m * weight}
    stds = dict.fromkeys(known, 0.0)
    for row in ase.constants:
        known[row.symbol], stds[row.symbol] = row.value, row.std
    for symbol, value in known.items():
        yield CombinedEntry(
            symbol=symbol, value=value, std=stds[symbol], unit=UNITS[symbol], origin=FILE
        )
    for symbol, (value, std) in rolling.items():
        yield CombinedEntry(
            symbol=symbol,
            value=value,
            std=std,
            unit=ROLL_UNITS[symbol],
            origin=GEOMETRY,
            sign=ROLL_SIGNS.get(symbol, 0),
        )


def _rows_of_models(
    models: Sequence[IdentifiedModel], joined: JointPosterior, ase: AseResult
) -> Iterator[CombinedEntry]:
    """What the models hold, with the values that they have together."""
    spread = np.sqrt(np.diag(joined.covariance)) if joined.names else np.zeros(0)
    values = dict(zip(joined.names, joined.mean.tolist(), strict=True))
    stds = dict(zip(joined.names, spread.tolist(), strict=True))
    for model in models:
        for c in model.estimates:
            symbol = whole_name(model.plane, c.symbol)
            if symbol not in values:  # held: as geometry or the file has it
                continue
            planes = joined.of.get(symbol, (model.plane,))
            value = values[symbol]
            yield CombinedEntry(
                symbol=symbol,
                value=value,
                std=stds[symbol] if symbol in joined.of else c.std,
                unit=c.unit,
                origin=f"identified, {planes[0] if len(planes) == 1 else 'both'}",
                prime=_prime(c.symbol, value, ase),
                data_share=c.data_share,
            )


def _prime(symbol: str, value: float, ase: AseResult) -> float | None:
    """Value without dimension of a coefficient of a plane."""
    if symbol not in BY_SYMBOL:
        return None
    return value / prime_unit(symbol, ase.density_kgpm3, ase.length_m)


def _blocks(
    entries: Mapping[str, CombinedEntry], joined: JointPosterior, ase: AseResult
) -> Iterator[CovarianceBlock]:
    """Covariance of what was identified, of the geometry, of the file."""
    if joined.names:
        yield _block("identified", joined.names, joined.covariance)
    rest = [e for e in entries.values() if not e.origin.startswith("identified") and e.std > 0.0]
    symbols = tuple(e.symbol for e in rest)
    if symbols:
        yield _block(f"{GEOMETRY} and {FILE}", symbols, _prior_covariance(rest, ase))


def _block(origin: str, symbols: tuple[str, ...], matrix: np.ndarray) -> CovarianceBlock:
    rows = tuple(tuple(row) for row in matrix.tolist())
    return CovarianceBlock(origin=origin, symbols=symbols, matrix=rows)


def _prior_covariance(rest: Sequence[CombinedEntry], ase: AseResult) -> np.ndarray:
    """Covariance of estimates: an inaccurate formula moves all that rest on it at once."""
    variance = np.array([e.std**2 for e in rest])
    symbols = [COEFFICIENTS.get(e.symbol, e.symbol) if e.origin == GEOMETRY else "" for e in rest]
    moved = np.array(
        [
            [effect.get(symbol, 0.0) for symbol in symbols]
            for effect in ase.accuracy_effects.values()
        ]
    ).reshape(-1, len(rest))
    together = moved.T @ moved
    own = np.maximum(variance - np.diag(together), 0.0)
    return np.asarray(together + np.diag(own))


def _effect_parameters(
    models: Sequence[IdentifiedModel], joined: JointPosterior
) -> dict[str, float]:
    """Parameters of the effects: as their model has them, those of both planes as joined."""
    found: dict[str, float] = {}
    for model in models:
        names = whole_names(model.plane, tuple(str(e["id"]) for e in model.effects))
        for effect in model.effects:
            for name, value in effect["internal"].items():
                found.setdefault(names.get(name, name), float(value))
    means = dict(zip(joined.names, joined.mean.tolist(), strict=True))
    return {name: means[name] if name in joined.of else value for name, value in found.items()}


def _sensing(vehicle: Vehicle) -> Sensing:
    """Where the DVL sits, for a plane without a model: what readings say of the start."""
    dvl = vehicle.dvl
    return Sensing(
        dvl_x_m=dvl.x_m,
        dvl_y_m=dvl.y_m,
        dvl_z_m=dvl.down_m,
        dvl_mounting_yaw_rad=math.radians(dvl.mounting_yaw_deg),
        noise_std={},
    )


def _source(model: IdentifiedModel) -> CombinedSource:
    maneuvers = model.stages[-1].maneuvers if model.stages else ()
    return CombinedSource(
        plane=model.plane, vehicle=model.vehicle, filter=model.filter, maneuvers=maneuvers
    )


def _findings(
    models: Sequence[IdentifiedModel], entries: Mapping[str, CombinedEntry]
) -> Iterator[Finding]:
    """What no data stand behind."""
    for plane in PLANES:
        if models and not any(m.plane == plane for m in models):
            yield Finding(
                code="plane-from-geometry",
                message=f"nothing was identified in the {plane} plane: it is the estimate from "
                "geometry",
                where=plane,
                remedy=f"Add a run with maneuvers of the {plane} plane.",
            )
    if not any(symbol in entries for symbol in TORQUE):
        yield Finding(
            code="no-torque",
            message="the propeller torque is unknown and left out: the simulated vehicle runs "
            "without the heel it causes",
            where=", ".join(TORQUE),
        )
    yield Finding(
        code="roll-from-geometry",
        message="roll is the estimate from geometry and the righting moment",
        where=", ".join(s for s in ROLL_UNITS if s in entries),
    )
