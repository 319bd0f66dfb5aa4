"""The estimate from geometry: vehicle in, coefficients with parts and uncertainty out."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import InputError
from auvident.physics.ase import facts as ase_facts
from auvident.physics.ase.accuracy import NOMINAL
from auvident.physics.ase.assembly import Parts, coefficient_parts
from auvident.physics.ase.ballast import ballast
from auvident.physics.ase.findings import findings, undecided
from auvident.physics.ase.geometry import HullGeometry, hull_geometry
from auvident.physics.ase.prior import contributions, residuals, standard_deviations
from auvident.physics.ase.propeller import thrust_coefficients
from auvident.physics.ase.roll import ROLL_ROWS, roll_estimate
from auvident.schema.artifacts import AseCoefficient, AseResult, AseRoll, Finding
from auvident.schema.coefficients import COEFFICIENTS, Coefficient, prime_unit, symbols_of
from auvident.schema.vehicle import Vehicle
from auvident.schema.vehicle_checks import contradictions


def estimate(vehicle: Vehicle, speed_mps: float | None = None) -> AseResult:
    """Estimate every coefficient of both planes from the geometry, and the constants.

    Parameters
    ----------
    vehicle : Vehicle
    speed_mps : float, optional
        From the log; the vehicle's own design speed comes first, 1.5 m/s last. It sets the
        Reynolds numbers only.

    Returns
    -------
    AseResult
        Dimensional SI and prime values, parts, standard deviations > 0, stability facts and
        findings. For a hull that is no body of revolution ``applies`` is False and the given
        coefficients are passed on.

    Raises
    ------
    InputError
        Impossible geometry, or missing coefficients of a hull that is no body of revolution.
    NumericsError
        When the integrals over the hull do not converge.
    """
    speed = vehicle.body.design_speed_mps or speed_mps or USUAL_SPEED_MPS
    if not vehicle.hull.is_body_of_revolution:
        return _given_only(vehicle, speed)
    for fault in contradictions(vehicle):
        raise InputError(fault.problem, f"{vehicle.body.name}: {fault.where}", fault.remedy)
    geometry = hull_geometry(vehicle)
    parts = coefficient_parts(vehicle, speed, geometry=geometry)
    effects = contributions(vehicle, speed, geometry)
    std = standard_deviations(effects, residuals(vehicle, parts, geometry))
    rows = tuple(_row(vehicle, c, parts, std[c.symbol]) for c in COEFFICIENTS)
    values = {row.symbol: row.value for row in rows}
    facts = ase_facts.motion_facts(vehicle, values, _stds(rows), effects, speed)
    return AseResult(
        vehicle=vehicle.body.name,
        speed_mps=speed,
        length_m=vehicle.hull.length_m,
        density_kgpm3=vehicle.fluid.density_kgpm3,
        coefficients=rows,
        constants=ballast(vehicle, float(geometry.diameter_m)),
        roll=_roll(vehicle, speed, geometry),
        geometry=ase_facts.geometry_facts(vehicle, geometry, speed),
        facts=facts,
        accuracy_effects=effects,
        findings=(*findings(vehicle, geometry, values, speed), *undecided(facts)),
    )


def _roll(vehicle: Vehicle, speed: float, geometry: HullGeometry | None) -> tuple[AseRoll, ...]:
    """Terms of roll; the righting moment is one of the vertical plane too and stands there."""
    found = roll_estimate(vehicle, speed, geometry)
    return tuple(
        AseRoll(
            symbol=row.symbol,
            equation=row.equation,
            regressor=row.regressor,
            unit=row.unit,
            **found[row.symbol]._asdict(),
        )
        for row in ROLL_ROWS
        if row.symbol in found and row.symbol != "z_GW"
    )


def _stds(rows: Iterable[AseCoefficient]) -> dict[str, float]:
    """Standard deviations by symbol."""
    return {row.symbol: row.std for row in rows}


def _row(vehicle: Vehicle, declared: Coefficient, parts: Parts, std: float) -> AseCoefficient:
    """One coefficient; a given one takes the place of the estimate."""
    symbol = declared.symbol
    shares = {part: float(v) for part, v in parts[symbol].items() if float(v) != 0.0}
    value, origin = float(sum(shares.values())), "ase"
    known = vehicle.coefficients.get(symbol)
    if symbol == "X_uu" and vehicle.hull.drag_coefficient is not None:
        origin = "given"
    if known is not None:
        value, std, origin = known.value, known.std, "given"
    return _coefficient(vehicle, declared, value, std, origin, shares)


def _coefficient(
    vehicle: Vehicle,
    declared: Coefficient,
    value: float,
    std: float,
    origin: Any,
    parts: dict[str, float],
) -> AseCoefficient:
    """Artifact row with prime value and the rigid body's share."""
    unit = prime_unit(declared.symbol, vehicle.fluid.density_kgpm3, vehicle.hull.length_m)
    return AseCoefficient(
        symbol=declared.symbol,
        plane="both" if len(declared.planes) == 2 else declared.planes[0],
        value=value,
        std=std,
        unit=declared.unit,
        prime=value / unit,
        parts=parts,
        rigid_body=ase_facts.rigid_body_terms(vehicle).get(declared.symbol, 0.0),
        origin=origin,
    )


def _given_only(vehicle: Vehicle, speed: float) -> AseResult:
    """The user's own coefficients and the propeller, where the formulas do not apply."""
    rows: dict[str, AseCoefficient] = {}
    thrust = _thrust(vehicle)
    for declared in COEFFICIENTS:
        known = vehicle.coefficients.get(declared.symbol)
        if known is not None:
            rows[declared.symbol] = _coefficient(
                vehicle, declared, known.value, known.std, "given", {}
            )
        elif declared.symbol in thrust:
            value, std = thrust[declared.symbol]
            parts = {"propeller": value}
            rows[declared.symbol] = _coefficient(vehicle, declared, value, std, "ase", parts)
    missing = [s for s in symbols_of("horizontal") if s not in rows]
    if missing:
        raise InputError(
            "the hull is not a body of revolution, so nothing can be estimated from its "
            f"geometry, and [coefficients] lacks {', '.join(missing)}",
            f"{vehicle.body.name}: [coefficients]",
            "State value and std of each (dimensional), or diameter_m for a body of revolution.",
        )
    values = {symbol: row.value for symbol, row in rows.items()}
    facts = ase_facts.motion_facts(vehicle, values, _stds(rows.values()), {}, speed)
    return AseResult(
        vehicle=vehicle.body.name,
        applies=False,
        speed_mps=speed,
        length_m=vehicle.hull.length_m,
        density_kgpm3=vehicle.fluid.density_kgpm3,
        coefficients=tuple(rows.values()),
        constants=ballast(vehicle, float(vehicle.hull.draught_m or 0.0)),
        roll=_roll(vehicle, speed, None),
        facts=facts,
        findings=(
            Finding(
                code="ase_does_not_apply",
                message="The hull is not a body of revolution: the given coefficients are "
                "used as they are, and only the thrust is estimated, from the "
                "propeller curve.",
                where="[hull]",
            ),
            *undecided(facts),
        ),
    )


def _thrust(vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of T_nn and T_nu, where there is a propeller."""
    if vehicle.propeller is None:
        return {}
    from auvident.physics.ase.accuracy import one_at_a_time

    density = vehicle.fluid.density_kgpm3
    nominal = thrust_coefficients(vehicle.propeller, density, NOMINAL)
    spread = thrust_coefficients(vehicle.propeller, density, one_at_a_time())
    result = {}
    for symbol, value, moved in zip(("T_nn", "T_nu"), nominal, spread, strict=True):
        std = float(np.sqrt(np.sum((0.5 * (moved[1::2] - moved[2::2])) ** 2)))
        result[symbol] = (float(value), std)
    return result
