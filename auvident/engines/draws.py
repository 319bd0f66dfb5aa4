"""Models drawn from the covariance of an identified one."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import (
    LEADERS,
    fitted_covariance,
    structure_behind,
    vector_behind,
)
from auvident.schema.artifacts import IdentifiedModel

Array = npt.NDArray[Any]


def drawn_vectors(
    model: IdentifiedModel,
    samples: int,
    rng: np.random.Generator,
    claim: Callable[[IdentifiedModel], Array] = fitted_covariance,
) -> list[Array]:
    """Parameter vectors: the model's own first, then some from its covariance.

    Parameters
    ----------
    model : IdentifiedModel
    samples : int
    rng : numpy.random.Generator
    claim : callable
        Which covariance: `fitted_covariance` or `claimed_covariance`.
    """
    values = model.values()
    vectors = [vector_behind(model)]
    symbols = list(model.covariance.get("symbols", ()))
    if not symbols or samples < 1:
        return vectors
    covariance = claim(model)
    # eigenvalues may be rounded below zero; the method takes them as zero
    drawn = rng.multivariate_normal(
        np.zeros(len(symbols)), covariance, size=samples, method="eigh", check_valid="ignore"
    )
    followers = {c.symbol for c in model.coefficients if c.origin == "kinematic"}
    for deviation in drawn:
        moved = dict(zip(symbols, deviation, strict=True))
        for follower in followers:
            moved[follower] = moved.get(LEADERS[follower], 0.0)
        changed = {s: v + moved.get(s, 0.0) for s, v in values.items()}
        vector, names = vector_behind(model, changed), structure_behind(model).parameters
        for name in (moved.keys() & set(names)) - values.keys():  # a parameter of an effect
            vector[names.index(name)] += moved[name]
        vectors.append(vector)
    return vectors
