"""How much each maneuver moves the result: leave-one-maneuver-out without running it again."""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.estimator import (
    Outcome,
    Setup,
    active_states,
    stage_records,
    tuning_of,
)
from auvident.engines.free_run import likelihood_of
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

LEAST_MANEUVERS = 3  # fewer say nothing about the scatter between maneuvers


def influences(setup: Setup, outcome: Outcome, stage: PlanStage) -> dict[str, Array]:
    """Move of the free coefficients when one maneuver is left out, by one Newton step.

    With H the curvature of all maneuvers and the prior, g_f and H_f those of maneuver f:
    move = (H - H_f)^-1 g_f.

    Returns
    -------
    dict of str to (n_free,) array
        By maneuver id, in units of the prior standard deviations.
    """
    active = active_states(stage.system, setup.structure.plane)
    records = stage_records(setup, stage)
    at_rest = np.zeros(len(outcome.free))
    parts = {
        record.id: likelihood_of(
            setup, outcome.parameters, outcome.free, [record], active, outcome.colours
        )(at_rest)
        for record in records
    }
    factors, _ = tuning_of(setup, outcome.free)
    whole = np.diag(1.0 / factors**2) + sum(curvature for _, _, curvature in parts.values())
    return {
        name: np.linalg.solve(whole - curvature, gradient)
        for name, (_, gradient, curvature) in parts.items()
    }


def jackknife_covariance(moves: dict[str, Array]) -> Array | None:
    """Covariance of the coefficients from the scatter between maneuvers.

    (F - 1)/F times the sum over the F maneuvers of the outer products of the centred moves.

    Returns
    -------
    (n, n) array or None
        None with fewer than `LEAST_MANEUVERS`.
    """
    if len(moves) < LEAST_MANEUVERS:
        return None
    table = np.array(list(moves.values()))
    table = table - table.mean(axis=0)
    return (len(table) - 1) / len(table) * table.T @ table
