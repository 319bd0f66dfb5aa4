"""Whether the steps of the equations are short enough for the vehicle that was found."""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.prediction import at_effects, simulated
from auvident.engines.records import STATE_COLUMNS, Record
from auvident.engines.setup import Setup, active_states
from auvident.physics.dynamics import simulate_states
from auvident.schema.artifacts import Finding

Array = npt.NDArray[Any]

# [sensor noise] a prediction that changes by more with half the step has errors of its own
TOO_LONG = 1.0


def step_findings(setup: Setup, parameters: Array) -> list[Finding]:
    """A warning where half the step would change the prediction by more than a sensor's noise.

    The coefficients would then make up for the integration, and mean something else wherever the
    model is used.

    Parameters
    ----------
    setup : Setup
    parameters : (n_parameters,) array
        Of the model that was found.
    """
    active = active_states("coupled", setup.structure.plane)
    changes = np.array([_change(setup, parameters, r, active) for _, r in setup.records.values()])
    worst = np.max(changes / setup.sensor_std, axis=0, where=active, initial=0.0)
    channel = int(worst.argmax())
    if not worst[channel] > TOO_LONG:
        return []
    return [
        Finding(
            code="steps-too-long",
            where=STATE_COLUMNS[setup.structure.plane][channel],
            value=float(worst[channel]),
            threshold=TOO_LONG,
            message=f"the time step of {setup.dt_s:g} s is too long for the dynamics of this "
            "vehicle: halving it changes the prediction by more than the sensor "
            "noise (ratio)",
            remedy=f"Ingest with `--rate {2.0 / setup.dt_s:g}`.",
        )
    ]


def _change(setup: Setup, p: Array, record: Record, active: Array) -> Array:
    """Root mean square (4,) of what half the step changes in the states of a record.

    Nothing where the prediction runs away: that is told by others, and no step would help.
    """
    acting = at_effects(setup.frame, p, record)
    whole = simulated(setup.frame, p, acting, active)
    between = 0.5 * (acting.given[:-1] + acting.given[1:])
    given = np.insert(acting.given, np.arange(1, len(acting.given)), between, axis=0)
    halves = simulate_states(
        acting.start,
        np.repeat(acting.inputs, 2, axis=0)[:-1],
        given,
        0.5 * setup.dt_s,
        p,
        active,
        setup.structure.equations,
    )[::2]
    if not (np.isfinite(whole[:, active]).all() and np.isfinite(halves[:, active]).all()):
        return np.zeros(whole.shape[1])
    change: Array = np.sqrt(np.mean((halves - whole) ** 2, axis=0))
    return change
