"""Draws of the coefficients from the estimate, correlated as its formulas are."""

from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from auvident.schema.coefficients import ESTIMATED

Array = npt.NDArray[np.float64]

DRAWS = 200  # a probability of one half is then known to 0.035
SEED = 0


def drawn_coefficients(
    values: Mapping[str, float],
    stds: Mapping[str, float],
    effects: Mapping[str, Mapping[str, float]],
    given: Collection[str] = (),
    rng: np.random.Generator | None = None,
    draws: int = DRAWS,
) -> dict[str, Array]:
    """Draw coefficients and constants.

    Parameters
    ----------
    values, stds : mapping of str to float
        By symbol.
    effects : mapping of str to mapping
        One-sigma effect of each formula on each coefficient: a formula is off by one normal
        deviate in all coefficients that it enters. What it does not explain of a standard
        deviation is each coefficient's own.
    given : collection of str
        Symbols whose value is not that of the formulas.
    rng : Generator, optional
        Else of the fixed `SEED`.
    draws : int

    Returns
    -------
    dict of str to ndarray, shape (1 + draws,)
        The estimate itself, then the draws. A coefficient that has the sign declared for it keeps
        it: a wide prior about a small value means that only the size is unknown.
    """
    rng = np.random.default_rng(SEED) if rng is None else rng
    deviates = {name: rng.standard_normal(draws) for name in effects}
    drawn = {}
    for symbol, value in values.items():
        moved, explained = rng.standard_normal(draws), 0.0
        shared = np.zeros(draws)
        for name, effect in effects.items():
            if symbol in effect and symbol not in given:
                shared += effect[symbol] * deviates[name]
                explained += effect[symbol] ** 2
        own = np.sqrt(max(stds[symbol] ** 2 - explained, 0.0))
        draw = value + shared + own * moved
        sign = ESTIMATED[symbol].sign
        if sign * value > 0.0:
            draw = sign * np.abs(draw)
        drawn[symbol] = np.concatenate([[value], draw])
    return drawn
