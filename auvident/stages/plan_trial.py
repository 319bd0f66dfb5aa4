"""Which maneuver would add most to what a trial has already told."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from auvident.engines.records import STATE_COLUMNS, sensor_matrix
from auvident.errors import NumericsError, StageError
from auvident.physics.dynamics import inverse_mass, output_error, step
from auvident.physics.terms import Structure, parameter_vector, structure_of, symbol_in
from auvident.schema.artifacts import (
    IdentifiedModel,
    Maneuver,
    TrialCandidate,
    TrialPlan,
)
from auvident.schema.trial import Trial

Array = npt.NDArray[np.float64]

DT_S = 0.1
SETTLE_S = 60.0  # the approach is simulated this long before the maneuver begins
CIRCLE_S, ZIGZAG_S, LEVEL_S = 75.0, 90.0, 35.0  # usual lengths of a maneuver
NAMED = 4  # coefficients named per candidate
LEAST_NAMED = 0.05  # a standard deviation that falls by less is not worth naming
ACTIVE = np.array([True, True, True, True])
VELOCITIES = np.array([True, True, True, False])

# time since the start [s], angle since the start [rad], last command [rad] -> control, rpm ratio
Helm = Callable[[float, float, float], tuple[float, float]]


@dataclass(frozen=True)
class Candidate:
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

    Each is simulated with the identified model at rates and amplitudes of the trial; its Fisher
    information, with the noise found in the trial, is added to the posterior.

    Parameters
    ----------
    trials, maneuvers : sequences
        For the range of rpm and control angles the vehicle was run at.
    model : IdentifiedModel

    Returns
    -------
    TrialPlan
        Best first; ``gain_nats`` is the expected fall of the entropy of the coefficients, and
        ``shrinks`` the factor by which the standard deviations of those that gain most shrink.
    """
    if not model.covariance:
        raise StageError("the model has no covariance", "identify", "Run `auvident identify`.")
    structure = structure_of(model.plane)
    symbols = list(model.covariance["symbols"])
    posterior = np.array(model.covariance["matrix"])
    found = []
    for candidate in candidates(trials, maneuvers):
        information = expected_information(model, structure, symbols, candidate)
        if information is not None:
            found.append(_judge(candidate, symbols, posterior, information))
    if not found:
        raise NumericsError("no candidate maneuver can be simulated with this model")
    found.sort(key=lambda c: -c.gain_nats)
    return TrialPlan(vehicle=model.vehicle, plane=model.plane, candidates=tuple(found))


def candidates(trials: Sequence[Trial], maneuvers: Sequence[Maneuver]) -> list[Candidate]:
    """Maneuvers worth asking for, within the rpm and control angles of the trial."""
    low, cruise, high = _rpm_levels(trials, maneuvers)
    found = []
    for degrees, switch in ((10, 10), (20, 20), (20, 5), (30, 10)):
        for label, rpm in (("slow", low), ("fast", high)):
            what = f"rudder +-{degrees} deg, reversed at +-{switch} deg of heading, {rpm:.0f} rpm"
            name = f"zigzag {degrees}/{switch}, {label}"
            found.append(Candidate(name, what, ZIGZAG_S, rpm, _zigzag(degrees, switch)))
    for degrees in (-20, -10, 10, 20):
        side = "starboard" if degrees < 0 else "port"
        what = f"rudder held {abs(degrees)} deg to {side}, {cruise:.0f} rpm"
        name = f"circle {abs(degrees)} deg {side}"
        found.append(Candidate(name, what, CIRCLE_S, cruise, _held(degrees)))
    steps = (1.0, high / cruise, low / cruise, 1.0)
    what = f"rudder amidships, {cruise:.0f}, {high:.0f}, {low:.0f}, {cruise:.0f} rpm"
    found.append(Candidate("thrust steps", what, 4 * LEVEL_S, cruise, _steps(steps)))
    what = f"rudder amidships, propeller stopped from {high:.0f} rpm"
    found.append(Candidate("coast-down", what, LEVEL_S, high, _steps((0.0,))))
    what = f"circle of 20 deg with {high:.0f} rpm in its second half"
    helm = _both(_held(20), _steps((1.0, high / low)))
    found.append(Candidate("circle with thrust step", what, 2 * LEVEL_S, low, helm))
    return found


def _rpm_levels(
    trials: Sequence[Trial], maneuvers: Sequence[Maneuver]
) -> tuple[float, float, float]:
    """Low, middle and high rpm within the maneuvers of the trial."""
    by_name = {trial.name: trial.table for trial in trials}
    used = []
    for m in maneuvers:
        table = by_name[m.trial]
        inside = (table["time_s"] >= m.t_start_s) & (table["time_s"] <= m.t_end_s)
        used.append(table["rpm"].to_numpy()[inside.to_numpy()])
    rpm = np.concatenate(used)
    low, middle, high = np.nanquantile(rpm[rpm > 0], [0.05, 0.5, 0.95])
    return float(low), float(middle), float(high)


def _zigzag(degrees: float, switch: float) -> Helm:
    amplitude, limit = math.radians(degrees), math.radians(switch)

    def helm(time: float, angle: float, last: float) -> tuple[float, float]:
        control = last or amplitude
        if control * angle < 0.0 and abs(angle) >= limit:  # a positive control turns to port
            control = -control
        return control, 1.0

    return helm


def _held(degrees: float) -> Helm:
    return lambda time, angle, last: (math.radians(degrees), 1.0)


def _steps(ratios: Sequence[float]) -> Helm:
    return lambda time, angle, last: (0.0, ratios[min(int(time / LEVEL_S), len(ratios) - 1)])


def _both(control: Helm, thrust: Helm) -> Helm:
    return lambda t, angle, last: (control(t, angle, last)[0], thrust(t, angle, last)[1])


def expected_information(
    model: IdentifiedModel, structure: Structure, symbols: Sequence[str], candidate: Candidate
) -> Array | None:
    """Fisher information (n, n) of a candidate, in units of the posterior standard deviations.

    None when the model cannot be run through it.
    """
    p = parameter_vector(model.plane, model.values(), model.rigid_body)
    run = _run(structure, p, candidate)
    if run is None:
        return None
    start, inputs, states = run
    column = np.full(len(p), -1, dtype=np.int64)
    spread = np.sqrt(np.diag(np.array(model.covariance["matrix"])))
    for i, symbol in enumerate(symbols):
        column[structure.index(symbol)] = i
    follower, leader = (symbol_in(model.plane, name) for name in ("B_adot", "A_bdot"))
    column[structure.index(follower)] = column[structure.index(leader)]
    sensor = sensor_matrix(model.plane, model.sensing)
    noise = model.stages[-1].noise_std
    sigma = np.array([noise[c] for c in STATE_COLUMNS[model.plane]])
    gradient, curvature = np.zeros(len(symbols)), np.zeros((len(symbols), len(symbols)))
    half = output_error(
        start, inputs, states, states @ sensor.T, sensor, sigma, VELOCITIES, DT_S, p, ACTIVE,
        *structure.arrays, column, spread, gradient, curvature,
    )  # fmt: skip
    if not np.isfinite(half):
        return None
    return curvature + np.tril(curvature, -1).T


def _run(structure: Structure, p: Array, candidate: Candidate) -> tuple[Array, Array, Array] | None:
    """Start state, inputs (n, 3) and states (n, 4) of a candidate after its approach."""
    inverse = np.empty((3, 3))
    inverse_mass(p, structure.mass, structure.mass_weights, ACTIVE, inverse)
    x = np.array([1.0, 0.0, 0.0, 0.0])
    n = candidate.rpm / 60.0

    def advance(x: Array, inputs: Array) -> Array:
        out = np.empty(4)
        step(x, inputs, x, x, DT_S, p, inverse, ACTIVE, structure.terms, structure.weights, out)
        return out

    for _ in range(round(SETTLE_S / DT_S)):
        x = advance(x, np.array([0.0, 0.0, n]))
        x[1:] = 0.0
    inputs, states, control = [], [x], 0.0
    for k in range(round(candidate.duration_s / DT_S)):
        control, ratio = candidate.helm(k * DT_S, states[-1][3], control)
        inputs.append(np.array([control, 0.0, n * ratio]))
        states.append(advance(states[-1], inputs[-1]))
    table = np.array(states[:-1])
    return (x, np.array(inputs), table) if np.isfinite(table).all() else None


def _judge(
    candidate: Candidate, symbols: Sequence[str], posterior: Array, information: Array
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
