"""Do the stated uncertainties hold on plants of another structure? (``tests.bench totals``)

A drawn vehicle (`sample_logs/seatrial/population`) has other terms than the model: strips, stall,
cubic damping, roll. What the two have in common are total forces over total masses, that is the
accelerations in a given state of motion. Here they are compared at states that the vehicle was in
while it was identified, with nothing planted: ahead at two speeds, turning to both sides, rudder
put over ahead, rudder laid against the turn. The claim is that of the readings and the prior, alone
and with the scatter between maneuvers. Even seeds choose, odd seeds report, as in `population`.
"""

import json
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import NORMAL_95
from auvident.engines.carried import (
    claimed_covariance,
    frame_of,
    free_behind,
    vector_behind,
)
from auvident.engines.prediction import Frame, Free
from auvident.physics.actuation import acting_inputs, command_values
from auvident.physics.dynamics import N_STATES, simulate_with_sensitivities
from auvident.schema.artifacts import IdentifiedModel
from tests.bench import written
from tests.bench.effects import ONE_THREAD, append, program, read_outcomes
from tests.bench.halves import measured, options_of, seeds
from tests.bench.population_trial import chain

Array = npt.NDArray[Any]
Outcome = dict[str, Any]

STEP_S = 1.0e-4  # of the difference behind an acceleration: far below any time of a vehicle
TURNING, AHEAD = 0.8, 0.3  # quantiles of the yaw rate above and below which it turns, goes ahead
SEEN = 0.8  # share of the data above which a total is one that was seen, as in `recovery`
SURGE, SWAY, YAW = 0, 1, 2
PLANAR = [0, 1, 5]  # u, v, r among the six velocities of the plant
NAMES = ("u'", "v'", "r'")
HELM = "rudder"  # totals of this name are of states off the balance that maneuvers keep to


def main(arguments: list[str], show: Callable[[str, list[dict[str, Any]]], None]) -> None:
    """Identify, compare and print."""
    options = options_of("totals", __doc__, 20).parse_args(arguments)
    for name in ONE_THREAD:
        os.environ[name] = "1"
    version, wanted = program(), seeds(options.first, options.count, options.half)
    kept = {} if options.resume is None else read_outcomes(options.resume)
    kept = {k: found for k, found in kept.items() if found.get("program") == version}
    for seed in wanted:
        if str(seed) not in kept:
            kept[str(seed)] = {**outcome(seed), "program": version}
            if options.resume is not None:
                append(options.resume, kept[str(seed)])
    found = [kept[str(seed)] for seed in wanted]
    title = f"error of an acceleration over its claimed standard deviation ({options.half})"
    result = {title: summary(found)}
    for name, rows in result.items():
        show(name, rows)
    if options.write:
        written.write("totals", measured(found, options.half), result)


def outcome(seed: int) -> Outcome:
    """Errors, claimed and prior standard deviations of the totals of one drawn vehicle."""
    from seatrial.population import draw

    with tempfile.TemporaryDirectory(prefix="auvident-totals-") as name:
        folder = Path(name)
        drawn = draw(seed, True, ())
        found = {"case": {"key": str(seed), "seed": seed}, "classes": list(drawn.classes)}
        try:
            sailed = drawn.sail()
        except FloatingPointError as error:  # it went out of bounds: no trial
            return {**found, "error": str(error), "rows": []}
        drawn.write(sailed, folder / "trial", folder / "vehicle.toml")
        ran = chain(folder, until="identify")
        if "error" in ran:
            return {**found, "error": ran["error"], "rows": []}
        model = IdentifiedModel.model_validate_json(
            (folder / "run/identify/model.json").read_text(encoding="utf-8")
        )
        rows = _identifying(folder / "run", sailed.record, drawn.origin)
    return {**found, "rows": [*compared(model, drawn.vehicle.body, rows)]}


def _identifying(run: Path, record: Array, origin: float) -> Array:
    """Rows of the record in the maneuvers that identify."""
    from seatrial.simulate import STEP_S as APART_S

    maneuvers = json.loads((run / "segment/maneuvers.json").read_text(encoding="utf-8"))
    kept = np.zeros(len(record), dtype=bool)
    for m in (m for m in maneuvers if m["role"] == "identify"):
        first, last = ((m[k] - origin) / APART_S for k in ("t_start_s", "t_end_s"))
        kept[max(int(first), 0) : max(int(last), 0)] = True
    return record[kept]


def compared(model: IdentifiedModel, body: Any, rows: Array) -> Iterator[dict[str, Any]]:
    """One row for every state and acceleration that is compared."""
    frame, p, (free, fitted) = frame_of(model, STEP_S), vector_behind(model), free_behind(model)
    claims = (
        free_behind(model, claimed_covariance)[1],
        fitted,
        prior_covariance(model, frame, free),
    )
    for name, (state, rudder, revs), axes in states_of(rows):
        true = true_rates(body, state, rudder, revs)
        told = model_rates(frame, p, free, state, rudder, revs)
        for axis in axes:
            slope = told[axis, 1:]
            std, own, before = (float(np.sqrt(slope @ c @ slope)) for c in claims)
            yield {
                "total": f"{NAMES[axis]} {name}",
                "error": float(told[axis, 0] - true[axis]),
                "std": std,
                "fitted_std": own,
                "prior_std": before,
            }


def prior_covariance(model: IdentifiedModel, frame: Frame, free: Free) -> Array:
    """Covariance of the free parameters before the data, in units of the scale."""
    names = frame.structure.parameters
    stds = {c.symbol: c.prior_std for c in model.coefficients}
    own = [stds.get(names[i]) or scale for i, scale in zip(free.positions, free.scale, strict=True)]
    return np.diag((np.array(own) / free.scale) ** 2)


Motion = tuple[Array, float, float]  # u, v, r; rudder [rad]; propeller rate [rev/s]


def states_of(rows: Array) -> Iterator[tuple[str, Motion, tuple[int, ...]]]:
    """States to compare at, from (n, 18) rows of the record, and the accelerations to compare."""
    from seatrial.simulate import REVS, RUDDER

    rate = np.abs(rows[:, PLANAR[YAW]])
    turns = rows[rate >= np.quantile(rate, TURNING)]
    ahead = rows[rate <= np.quantile(rate, AHEAD)]
    helm = float(np.quantile(np.abs(rows[:, RUDDER]), TURNING))
    slow, fast = (ahead[_half(ahead[:, REVS], above)] for above in (False, True))
    (u, _, _), _, revs = motion_of(fast)
    for name, part in (("ahead, slow", slow), ("ahead, fast", fast)):
        (speed, _, _), _, rps = motion_of(part)
        yield name, (np.array([speed, 0.0, 0.0]), 0.0, rps), (SURGE,)
    for side, sign in (("to starboard", 1.0), ("to port", -1.0)):
        own = turns[turns[:, PLANAR[YAW]] * sign > 0.0]
        if len(own):
            yield f"turning {side}", motion_of(own), (SURGE, SWAY, YAW)
            against = against_the_turn(rows[rows[:, PLANAR[YAW]] * sign > 0.0], own, helm)
            if len(against):
                yield f"rudder against the turn {side}", motion_of(against), (SWAY, YAW)
        yield f"rudder put over {side}", (np.array([u, 0.0, 0.0]), sign * helm, revs), (SWAY, YAW)


def against_the_turn(rows: Array, turning: Array, helm: float) -> Array:
    """The faster half of the rows of one side in which the rudder is laid against the turn."""
    from seatrial.simulate import RUDDER

    against = -np.sign(turning[:, RUDDER].mean()) * rows[:, RUDDER]
    found = rows[against > 0.5 * helm]
    return found[_half(np.abs(found[:, PLANAR[YAW]]), True)] if len(found) else found


def _half(values: Array, above: bool) -> Array:
    middle = np.median(values)
    return values >= middle if above else values <= middle


def motion_of(rows: Array) -> Motion:
    """Mean motion of some rows."""
    from seatrial.simulate import REVS, RUDDER

    mean = rows.mean(axis=0)
    return mean[PLANAR], float(mean[RUDDER]), float(mean[REVS])


def true_rates(body: Any, state: Array, rudder: float, revs: float) -> Array:
    """Accelerations (3,) of the plant in the horizontal plane, held level."""
    from seatrial.plant import (
        STATES,
        PlantEffects,
        add_coriolis,
        add_fins,
        add_hull,
        propeller,
    )

    full, force = np.zeros(STATES), np.zeros(6)
    full[PLANAR] = state
    thrust, _ = propeller(state[0], revs, body)
    force[0] = thrust
    add_coriolis(full[:6], body.mass, force)
    add_hull(full[:6], body, PlantEffects(), force)
    add_fins(full[:6], rudder, 0.0, thrust, body, PlantEffects(), force)
    found: Array = np.linalg.solve(body.mass[np.ix_(PLANAR, PLANAR)], force[PLANAR])
    return found


def model_rates(
    frame: Frame, p: Array, free: Free, state: Array, rudder: float, revs: float
) -> Array:
    """Accelerations of the model, and their slopes by the free parameters (3, 1 + n_free)."""
    e = command_values(frame.structure.plane, frame.structure.parameters, p)
    raw = np.tile([rudder, 0.0, revs], (2, 1))
    zero = np.zeros(2)
    inputs = acting_inputs(raw, zero, np.full(2, state[0]), zero, zero, frame.dt_s, e)
    start = np.array([*state, 0.0])
    z = np.zeros((2, N_STATES, 1 + N_STATES + len(free.positions)))
    ran = simulate_with_sensitivities(
        start,
        inputs,
        np.zeros((2, inputs.shape[1], 0)),
        np.zeros(0, dtype=np.int64),
        np.tile(start, (2, 1)),
        np.zeros(N_STATES),
        frame.dt_s,
        p,
        np.ones(N_STATES, dtype=bool),
        frame.structure.equations,
        free.column,
        free.scale,
        z,
    )
    assert ran
    rates: Array = (z[1, :3] - np.column_stack([start[:3], np.zeros((3, z.shape[2] - 1))])) / STEP_S
    return np.column_stack([rates[:, :1], rates[:, 1 + N_STATES :]])


def summary(found: list[Outcome]) -> list[dict[str, Any]]:
    """Mean square and coverage by total and in all, of those that the data told."""
    rows = [row for one in found for row in one["rows"]]
    seen = [r for r in rows if r["fitted_std"] ** 2 < (1.0 - SEEN) * r["prior_std"] ** 2]
    names = dict.fromkeys(r["total"] for r in seen)
    flown = [r for r in seen if HELM not in r["total"]]
    helm = [r for r in seen if HELM in r["total"]]
    groups = {"all": seen, "ahead and turning": flown, "rudder put over": helm}
    groups |= {name: [r for r in seen if r["total"] == name] for name in names}
    return [_row(name, group) for name, group in groups.items() if group]


def _row(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    error = np.array([r["error"] for r in rows])
    found: dict[str, Any] = {"total": name, "n": len(rows)}
    for claim, key in (("", "std"), (" (readings alone)", "fitted_std")):
        z = error / np.array([r[key] for r in rows])
        found[f"mean square{claim}"] = float(np.mean(z**2))
        found[f"95 % covers{claim}"] = f"{100.0 * np.mean(np.abs(z) < NORMAL_95):.1f} %"
    return found
