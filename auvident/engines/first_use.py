"""The first use on a machine: two helper processes compile the kernels side by side.

Half of the time goes into the pass of the filter, half into simulations and the smoothing of
states. Each helper runs one of the two on the shortest maneuvers of the problem at hand; afterwards
this process finds both in the cache, and its own memory has not grown by what compiling takes.
"""

import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import get_args

import numpy as np

from auvident.engines.estimator import filter_pass, free_positions, stage_records
from auvident.engines.free_run import effective_noise, likelihood_of, white
from auvident.engines.setup import Setup, active_states
from auvident.engines.states import smoothed_states
from auvident.jit import cache_is_writable, compiled_already, remove_unused
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import ManeuverKind
from auvident.schema.plan import PlanStage

EVERYTHING = PlanStage(
    name="first use", system="coupled", free=("all",), maneuvers=get_args(ManeuverKind)
)
FEW = 2  # maneuvers are enough to compile with
ANY_TIME_S = 30.0  # process noise does not matter for it


def compile_side_by_side(setup: Setup) -> None:
    """Compile what an identification needs, if no one has yet.

    Whatever becomes of a helper, nothing is lost but time: what it does not leave in the cache
    is compiled when it is called.

    Parameters
    ----------
    setup : Setup
        Of the identification.
    """
    if setup.engine != "compiled" or not cache_is_writable() or compiled_already(setup.filter):
        return
    remove_unused()
    problem = pickle.dumps(_shortest(setup))
    helpers = [_helper(part) for part in PARTS]
    try:
        for helper in helpers:
            _tell(helper, problem)
        for helper in helpers:
            helper.wait()
    except BaseException:
        for helper in helpers:
            helper.kill()
        raise


def _helper(part: str) -> subprocess.Popen[bytes]:
    """A process that runs one part of the problem it is told."""
    return subprocess.Popen(
        [sys.executable, "-m", "auvident.engines.first_use", part],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _tell(helper: subprocess.Popen[bytes], problem: bytes) -> None:
    assert helper.stdin is not None  # it was asked for
    with suppress(BrokenPipeError):  # it did not get as far as to read
        helper.stdin.write(problem)
        helper.stdin.close()


def _shortest(setup: Setup) -> Setup:
    """The problem with its shortest maneuvers alone."""
    short = sorted(setup.records.items(), key=lambda item: (len(item[1][1]), item[0]))
    return replace(setup, records=dict(short[:FEW]))


def simulate(setup: Setup) -> None:
    """Run what the filter does not: simulations with slopes, and the smoothing of states."""
    records, active = stage_records(setup, EVERYTHING), _active(setup)
    noise = effective_noise(setup, setup.start, records, active)
    free = free_positions(setup, EVERYTHING)
    likelihood_of(setup, setup.start, free, records, active, white(noise))(np.zeros(len(free)))
    smoothed_states(
        setup.structure, setup.start, records[0], active, setup.sensor, setup.sensor_std, setup.dt_s
    )


def run_filter(setup: Setup) -> None:
    """Run the pass of the filter; the other part compiles what effects need."""
    bare = _without_effects(setup)
    records, free = stage_records(bare, EVERYTHING), free_positions(bare, EVERYTHING)
    filter_pass(bare, bare.start, free, records, _active(bare), bare.sensor_std, ANY_TIME_S)


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


def _active(setup: Setup) -> np.ndarray:
    return active_states(EVERYTHING.system, setup.structure.plane)


PARTS: dict[str, Callable[[Setup], None]] = {"filter": run_filter, "simulation": simulate}

if __name__ == "__main__":
    PARTS[sys.argv[1]](pickle.load(sys.stdin.buffer))
