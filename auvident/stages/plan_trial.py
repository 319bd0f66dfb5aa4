"""Which maneuver would add most to what a trial has already told."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.carried import structure_behind, vector_behind
from auvident.engines.records import sensor_matrix
from auvident.errors import NumericsError, StageError
from auvident.physics.dynamics import ALL_STATES, N_STATES, simulate_with_sensitivities
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure, structure_of, symbol_in
from auvident.physics.virtual import (
    Helm,
    combined_helm,
    healthy,
    held_helm,
    run_virtual,
    steady_approach,
    thrust_helm,
    zigzag_helm,
)
from auvident.schema.artifacts import IdentifiedModel, Maneuver, TrialCandidate, TrialPlan
from auvident.schema.planes import BY_PLANE, STATE_COLUMNS, Plane
from auvident.schema.trial import Trial

Array = npt.NDArray[Any]

CIRCLE_S: VehicleTime = 75.0  # usual lengths of a maneuver
ZIGZAG_S: VehicleTime = 90.0
LEVEL_S: VehicleTime = 35.0
ZIGZAGS_DEG = ((10, 10), (20, 20), (20, 5), (30, 10))
CIRCLES_DEG = (-20, -10, 10, 20)
NAMED = 4  # coefficients named per candidate
ONE_RATE, STEP_DOWN = 1.05, 0.2  # rates up to this ratio are one; the step down from it
LEAST_NAMED = 0.05  # a standard deviation that falls by less is not worth naming
VELOCITIES = np.array([True, True, True, False])
ASTERN_REMEDY = (
    "If it drove the vehicle ahead, its sign in the log is the other one: give `auvident run` "
    "--fix rpm_sign, or set sign = -1 for rpm in a map (--map)."
)


@dataclass(frozen=True)
class ManeuverDesign:
    """A maneuver that could be added: what to do, for how long, and at which approach rpm."""

    name: str
    what: str
    duration_s: float
    rpm: float
    helm: Helm


def plan_trial(
    trials: Sequence[Trial], maneuvers: Sequence[Maneuver], model: IdentifiedModel
) -> TrialPlan:
    """Rank candidate maneuvers by what each would add to the information of the trial.

    Each is simulated with the model at rates and amplitudes of the trial, the forces of its effects
    included; its Fisher information, with the noise found in the trial, is added to the posterior.

    Parameters
    ----------
    trials, maneuvers : sequences
        For the range of rpm the vehicle was run at.
    model : IdentifiedModel

    Returns
    -------
    TrialPlan
        Best first; ``gain_nats`` is the expected fall of the entropy of the coefficients, and
        ``shrinks`` the factor by which the standard deviations of those that gain most shrink.
    """
    if not model.covariance:
        raise StageError("the model has no covariance", "identify", "Run `auvident identify`.")
    structure, own = structure_behind(model), structure_of(model.plane).parameters
    named = list(model.covariance["symbols"])
    kept = [i for i, name in enumerate(named) if name in own]  # no parameters of effects
    symbols = [named[i] for i in kept]
    posterior = np.array(model.covariance["matrix"])[np.ix_(kept, kept)]
    stds = dict(zip(symbols, np.sqrt(np.diag(posterior)), strict=True))
    dt_s = 1.0 / trials[0].rate_hz  # the noise found in the trial is that of a sample at its rate
    found = []
    for candidate in candidates(model.plane, *rpm_levels(trials, maneuvers)):
        information = expected_information(model, structure, stds, candidate, dt_s)
        if information is not None:
            found.append(_judge(candidate, symbols, posterior, information))
    if not found:
        raise NumericsError("no candidate maneuver can be simulated with this model")
    found.sort(key=lambda c: -c.gain_nats)
    return TrialPlan(vehicle=model.vehicle, plane=model.plane, candidates=tuple(found))


def candidates(plane: Plane, low: float, cruise: float, high: float) -> list[ManeuverDesign]:
    """Maneuvers worth asking for, at a low, middle and high propeller rate [rpm]."""
    row = BY_PLANE[plane]
    fin, angle = row.fin, row.states[3].symbol
    found = []
    for degrees, switch in ZIGZAGS_DEG:
        helm = zigzag_helm(math.radians(degrees), math.radians(switch))
        for label, rpm in (("slow", low), ("fast", high)):
            what = f"{fin} ±{degrees} deg, reversed at ±{switch} deg of {angle}, {rpm:.0f} rpm"
            found.append(
                ManeuverDesign(f"zigzag {degrees}/{switch}, {label}", what, ZIGZAG_S, rpm, helm)
            )
    if "turn" in row.maneuvers:
        found += _circles(low, cruise, high)
    rates = [rate for rate, _ in groupby((cruise, high, low, cruise))]  # a step changes something
    steps = thrust_helm([rate / cruise for rate in rates], LEVEL_S)
    what = f"{fin} amidships, {', '.join(f'{rate:.0f}' for rate in rates)} rpm"
    found.append(ManeuverDesign("thrust steps", what, len(rates) * LEVEL_S, cruise, steps))
    what = f"{fin} amidships, propeller stopped from {high:.0f} rpm"
    found.append(ManeuverDesign("coast-down", what, LEVEL_S, high, thrust_helm((0.0,), LEVEL_S)))
    return found


def _circles(low: float, cruise: float, high: float) -> list[ManeuverDesign]:
    found = []
    for degrees in CIRCLES_DEG:
        side = "starboard" if degrees < 0 else "port"
        what = f"rudder held {abs(degrees)} deg to {side}, {cruise:.0f} rpm"
        name, helm = f"circle {abs(degrees)} deg {side}", held_helm(math.radians(degrees))
        found.append(ManeuverDesign(name, what, CIRCLE_S, cruise, helm))
    what = f"rudder held 20 deg, {low:.0f} rpm, then {high:.0f} rpm in the second half"
    helm = combined_helm(held_helm(math.radians(20)), thrust_helm((1.0, high / low), LEVEL_S))
    return [*found, ManeuverDesign("circle with thrust step", what, 2 * LEVEL_S, low, helm)]


def rpm_levels(
    trials: Sequence[Trial], maneuvers: Sequence[Maneuver]
) -> tuple[float, float, float]:
    """Low, middle and high rpm within the maneuvers of the trial.

    Of a trial at one rate the low one is a fifth lower, which every propeller can do: thrust steps
    are what such a trial lacks.

    Raises
    ------
    NumericsError
        When the propeller never turns ahead in them.
    """
    by_name = {trial.name: trial.columns for trial in trials}
    used = []
    for m in maneuvers:
        columns = by_name[m.trial]
        inside = (columns["time_s"] >= m.t_start_s) & (columns["time_s"] <= m.t_end_s)
        used.append(columns["rpm"][inside])
    rpm = np.concatenate(used)
    ahead = rpm[rpm > 0]
    if not ahead.size:
        raise NumericsError(
            "the propeller never turns ahead in the maneuvers of the log, so there is no rate to "
            "plan a maneuver at",
            remedy=ASTERN_REMEDY,
        )
    low, middle, high = np.nanquantile(ahead, [0.05, 0.5, 0.95])
    if high < ONE_RATE * low:
        low = (1.0 - STEP_DOWN) * low
    return float(low), float(middle), float(high)


def expected_information(
    model: IdentifiedModel,
    structure: Structure,
    stds: Mapping[str, float],
    candidate: ManeuverDesign,
    dt_s: float,
) -> Array | None:
    """Fisher information (n, n) of a candidate, in units of the posterior standard deviations.

    `stds` has these by symbol. None when the model cannot be run through it.
    """
    p, n_rps = vector_behind(model), candidate.rpm / 60.0
    start = steady_approach(structure, p, n_rps)
    if not np.isfinite(start).all():
        return None
    run = run_virtual(structure, p, start, n_rps, candidate.duration_s, candidate.helm, dt_s=dt_s)
    column = np.full(len(p), -1, dtype=np.int64)
    for i, symbol in enumerate(stds):
        column[structure.index(symbol)] = i
    follower, leader = (symbol_in(model.plane, name) for name in ("B_adot", "A_bdot"))
    column[structure.index(follower)] = column[structure.index(leader)]
    spread = np.array(list(stds.values()))
    sensor = sensor_matrix(model.plane, model.sensing)
    noise = model.stages[-1].noise_std
    sigma = np.array([noise[c] for c in STATE_COLUMNS[model.plane]])
    n = len(run.states)
    slopes = np.zeros((n, N_STATES, 1 + N_STATES + len(stds)))
    if not simulate_with_sensitivities(
        run.states[0],
        np.array([healthy(row) for row in run.inputs]),
        np.zeros((n, N_INPUTS, 0)),
        np.zeros(0, dtype=np.int64),
        run.states,
        np.zeros(N_STATES),
        dt_s,
        p,
        ALL_STATES,
        structure.equations,
        column,
        spread,
        slopes,
    ):
        return None
    shown = np.matmul(sensor, slopes[:, :, 1 + N_STATES :]) / sigma[:, None]
    flat = shown[:, VELOCITIES].reshape(-1, len(stds))
    information: Array = flat.T @ flat
    return information


def _judge(
    candidate: ManeuverDesign, symbols: Sequence[str], posterior: Array, information: Array
) -> TrialCandidate:
    """What the candidate would do to the posterior."""
    spread = np.sqrt(np.diag(posterior))
    relative = posterior / np.outer(spread, spread)
    system = np.eye(len(symbols)) + relative @ information
    after = np.linalg.solve(system, relative)
    shrink = np.sqrt(np.clip(np.diag(after), 0.0, 1.0))
    best = [i for i in np.argsort(shrink)[:NAMED] if 1.0 - shrink[i] >= LEAST_NAMED]
    return TrialCandidate(
        name=candidate.name,
        what=candidate.what,
        duration_s=candidate.duration_s,
        gain_nats=0.5 * float(np.linalg.slogdet(system)[1]),
        shrinks={symbols[i]: round(float(shrink[i]), 3) for i in best},
    )
