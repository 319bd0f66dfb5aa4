"""Profiles of the few parameters that a Gaussian may not describe."""

from collections.abc import Sequence

import numpy as np

from auvident.constants import NORMAL_95
from auvident.engines.profile import profile_of
from auvident.engines.setup import Outcome, Setup
from auvident.schema.artifacts import Finding, ProfileInterval
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.effects import parameter_of
from auvident.schema.plan import PlanStage

# the coefficient that carries the common scale of the surge equation, where only ratios are seen
SURGE_SCALE = "X_uu"
SECANT = 0.1  # [priors] the slope of an effect taken over so much is no derivative
DIFFERS = 1.0 / 3.0  # of the Gaussian's half width
ROUND_ONE = 1.0e-12


def profiles_of(
    setup: Setup, final: Outcome, stage: PlanStage, effects: Sequence[str]
) -> tuple[tuple[ProfileInterval, ...], list[Finding]]:
    """Profiles of the surge scale and of the sizes of the effects that are estimated.

    Values are the internal ones of `engines.carried`, as in the covariance of the model.
    """
    rows = []
    for column, name in enumerate(setup.names(final.free)):
        found = profile_of(setup, final, stage, column) if _matters(name, effects) else None
        if found is None:
            continue
        half = NORMAL_95 * float(np.sqrt(final.covariance[column, column]))
        half *= float(setup.prior_std[final.free[column]])
        rows.append(
            ProfileInterval(
                symbol=name,
                low=found.low,
                high=found.high,
                gaussian_low=found.best - half,
                gaussian_high=found.best + half,
                values=tuple(found.values.tolist()),
                root=tuple(found.root.tolist()),
            )
        )
    return tuple(rows), [f for row in rows if (f := _finding(row)) is not None]


def _matters(name: str, effects: Sequence[str]) -> bool:
    """Whether a parameter is the surge scale or the size of an effect with a slope of its own."""
    if name.partition(".")[0] not in effects:
        return name == SURGE_SCALE
    return parameter_of(name).practical > 0.0 and parameter_of(name).step < SECANT


def _finding(row: ProfileInterval) -> Finding | None:
    middle = 0.5 * (row.gaussian_low + row.gaussian_high)
    half = max(row.gaussian_high - middle, ROUND_ONE * abs(middle))
    differs = max(abs(row.low - row.gaussian_low), abs(row.high - row.gaussian_high)) / half
    if not differs > DIFFERS:
        return None
    return Finding(
        code="not-gaussian",
        where=row.symbol,
        value=differs,
        threshold=DIFFERS,
        message=f"the likelihood is not Gaussian: the 95 % interval is "
        f"{_shown(row.symbol, row.low, row.high)}, not "
        f"{_shown(row.symbol, row.gaussian_low, row.gaussian_high)}",
        remedy="Use the interval of the profile likelihood.",
    )


def _shown(symbol: str, low: float, high: float) -> str:
    """An interval of internal values as people read it: angles in degrees, limits upside up."""
    if "." not in symbol:
        return f"{low:.4g} to {high:.4g} {ESTIMATED[symbol].unit}"
    declared = parameter_of(symbol)
    least, most = sorted(declared.shown(end)[0] for end in (low, high))
    return f"{least:.4g} to {most:.4g} {declared.unit}".removesuffix(" -")
