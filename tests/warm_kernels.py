"""Compile what the tests call, in two processes side by side, if no one has yet.

With several workers nobody would find anything in the cache yet, and each would compile it all.
`python -m tests.warm_kernels` does it by itself.
"""

import os
import subprocess
import sys

import numpy as np

from auvident.jit import cache_is_writable, compiled_already
from tests.command_line import ROOT, SAMPLES

KINDS = ("ekf", "ukf")


def generator() -> None:
    """The generator of trials, which has kernels of its own."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    few = {"straights": 1, "turns": 1, "zigzags_10": 0, "zigzags_20": 1}
    generate({"name": "short", "vehicle": "tern180", "seed": 5, "schedule": few}, None)


def filter_of(kind: str) -> None:
    from auvident.stages.identify.warm_up import run_filter
    from tests.engines.chain import setup_of

    run_filter(setup_of(filter=kind))


def simulation() -> None:
    from auvident.stages.identify.warm_up import simulate
    from tests.engines.chain import setup_of

    simulate(setup_of())


def actuation() -> None:
    """The inputs that act, as tests call them outside of a simulation."""
    from auvident.physics.actuation import COMMAND, acting_inputs

    still, time = np.zeros((2, 3)), np.arange(2.0)
    acting_inputs(still, time, time, time, time, 0.1, np.zeros(len(COMMAND)))


# what one process compiles after the other, of about equal length
SHARES = ("ekf generator", "ukf simulation actuation")
PARTS = {
    "ekf": lambda: filter_of("ekf"),
    "ukf": lambda: filter_of("ukf"),
    "simulation": simulation,
    "generator": generator,
    "actuation": actuation,
}


def warm() -> None:
    """Whatever fails here is compiled, or fails, in the test that needs it."""
    if not cache_is_writable() or all(compiled_already(kind) for kind in KINDS):
        return
    command = [sys.executable, "-m", "tests.warm_kernels"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    started = [
        subprocess.Popen([*command, *share.split()], env=environment, cwd=ROOT) for share in SHARES
    ]
    for process in started:
        process.wait()


if __name__ == "__main__":
    for part in sys.argv[1:]:
        PARTS[part]()
    if not sys.argv[1:]:
        warm()
