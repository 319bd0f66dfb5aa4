"""What the equations lack in every trial: an error that does not average out.

Maneuvers of one trial scatter by more than their noise where the equations lack something. Another
trial flies the same kinds of maneuvers and is pulled the same way: what goes beyond noise counts as
one and the same error of all trials, however many they are. It is seen from two sides: all
parameters together by the squared scatter over that of noise (``noise_claim`` of a model), and
single coefficients that a model widened to a scatter beyond chance.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import bdtrc, chdtri

from auvident.estimation.pooling import Pooled, TrialData
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.pool.collect import Collected

Array = npt.NDArray[Any]

# As in a single trial: a coefficient is widened where maneuvers scatter so in one case of twenty.
BY_CHANCE = 0.05
ROUNDING = 1.0e-9  # of the prior's variance: what is added is less of none that was widened


def structural_covariance(data: Collected, found: Pooled, between: Array) -> Array:
    """Covariance (n, n) of an error common to all trials, in units of the prior."""
    together = beyond_noise([t.model for t in data.trials])
    gain = found.covariance @ sum(_weight(t, between) for t in data.told)
    covariance = together * gain @ gain.T
    single = np.maximum(data.widened_variance - together * data.expected.mean(axis=0), 0.0)
    return np.asarray(covariance + np.diag(np.where(_often(data), single, 0.0)))


def _weight(told: TrialData, between: Array) -> Array:
    """(I + J T)^-1 J^1/2: how an error as large as a trial's own enters the sum of scores."""
    values, vectors = np.linalg.eigh(told.information)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    weight = np.linalg.solve(np.eye(len(values)) + told.information * between, root)
    return np.asarray(weight)


def beyond_noise(models: list[IdentifiedModel]) -> float:
    """Squared scatter of maneuvers, as a share of that of noise, beyond it; zero within chance."""
    claims = [m.noise_claim for m in models if m.noise_claim is not None]
    freedom = sum(c.freedom for c in claims)
    if freedom <= 0.0:
        return 0.0
    ratio = sum(c.ratio * c.freedom for c in claims) / freedom
    return ratio - 1.0 if ratio > chdtri(freedom, BY_CHANCE) / freedom else 0.0


def _often(data: Collected) -> npt.NDArray[np.bool_]:
    """Coefficients that were widened in more trials than chance makes of it."""
    count = np.count_nonzero(data.widened > ROUNDING, axis=0)
    chance = np.where(count > 0, bdtrc(count - 1, len(data.trials), BY_CHANCE), 1.0)
    return np.asarray(chance <= BY_CHANCE + 1e-9)


def maneuvers_of(model: IdentifiedModel) -> int:
    """Number of maneuvers that a model was identified from."""
    return len(model.stages[-1].maneuvers) if model.stages else 0
