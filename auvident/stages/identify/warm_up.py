"""What calls every kernel of a run, for the first use on a machine.

Half of the time that compiling takes goes into the pass of the filter, half into simulations, the
smoothing of states and the maneuvers that a validation flies: two pieces of work, each on the
shortest maneuvers of the problem at hand.
"""

from dataclasses import replace
from functools import partial
from typing import get_args

import numpy as np

from auvident.engines.carried import allowed
from auvident.engines.estimator import filter_pass, task_of
from auvident.engines.free_run import likelihood, residual_of, white_error
from auvident.engines.noise import effective_noise
from auvident.engines.records import Record
from auvident.engines.setup import Setup
from auvident.engines.states import smoothed_states
from auvident.estimation.coloured import colour_of
from auvident.first_use import Work, alone, compile_side_by_side, is_first
from auvident.physics.fleet import Fleet, Servos
from auvident.physics.terms import structure_of
from auvident.physics.virtual import held_helm, run_virtual
from auvident.schema.artifacts import AseResult, ManeuverKind, Maneuvers
from auvident.schema.plan import Plan, PlanStage
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.identify.setup import prepare

EVERYTHING = PlanStage(
    name="first use", system="coupled", free=("all",), maneuvers=get_args(ManeuverKind)
)
FEW = 2  # maneuvers are enough to compile with
ANY_TIME_S = 30.0  # process noise does not matter for it
ANY_NOISE = {"u_mps": 0.005, "v_mps": 0.005, "r_radps": 0.001, "heading_rad": 0.005}


def compile_first(setup: Setup) -> None:
    """Compile what an identification needs, if no one has yet."""
    if setup.engine == "compiled" and is_first(setup.filter):
        with alone():
            if is_first(setup.filter):  # else another process did while this one waited
                compile_side_by_side(pieces_of(setup))


def compile_for(
    trial: Trial, maneuvers: Maneuvers, ase: AseResult, vehicle: Vehicle, plan: Plan, kind: str
) -> None:
    """Compile what an identification of a trial in the horizontal plane would need."""
    setup = prepare(
        [trial],
        maneuvers,
        ase,
        vehicle,
        ANY_NOISE,
        plane="horizontal",
        plan=plan,
        filter=kind,
        engine="compiled",
        carried=allowed(plan.nuisance, "horizontal", ase.length_m),
    )
    compile_first(setup)


def pieces_of(setup: Setup) -> tuple[Work, ...]:
    """Pieces of work that together call every kernel."""
    short = shortest(setup)
    return partial(run_filter, short), partial(simulate, short)


def shortest(setup: Setup) -> Setup:
    """The problem with its shortest maneuvers alone."""
    short = sorted(setup.records.items(), key=lambda item: (len(item[1][1]), item[0]))
    return replace(setup, records=dict(short[:FEW]))


def simulate(setup: Setup) -> None:
    """Run what the filter does not: simulations with slopes, the smoothing of states, maneuvers."""
    task = task_of(setup, EVERYTHING)
    output, record = task.output, task.output.records[0]
    effective_noise(output, setup.start, setup.sensor_std)
    likelihood(output, setup.start, task.free)
    left = residual_of(output, output.at(setup.start), record)
    if left is not None:
        colour_of([left.error[:, 0]], setup.dt_s)
        white_error(left.error, output.colours, setup.dt_s)
    smoothed_states(
        setup.structure,
        setup.start,
        record,
        output.active,
        setup.sensor,
        setup.sensor_std,
        setup.dt_s,
    )
    _fly(setup, record)


def _fly(setup: Setup, record: Record) -> None:
    """One step of models side by side, and of one by itself, as a validation flies them."""
    fleet, still = Fleet(setup.structure, setup.start[None]), np.zeros(1)
    states, servos = record.start[:, None].copy(), Servos(fleet, still.copy(), setup.dt_s)
    fleet.rates(states, still, still)
    fleet.step(states, fleet.felt(servos.follow(still)), still, setup.dt_s)
    run_virtual(setup.structure, setup.start, record.start, 0.0, setup.dt_s, held_helm(0.0))


def run_filter(setup: Setup) -> None:
    """Run the pass of the filter; the other piece compiles what effects need."""
    bare = _without_effects(setup)
    filter_pass(task_of(bare, EVERYTHING), bare.start, bare.sensor_std, ANY_TIME_S)


def _without_effects(setup: Setup) -> Setup:
    """The problem without what the model carries beside its coefficients."""
    structure = structure_of(setup.structure.plane)
    n = len(structure.parameters)
    return replace(
        setup,
        structure=structure,
        prior=setup.prior[:n],
        prior_std=setup.prior_std[:n],
        start=setup.start[:n],
    )
