"""The prior against the data: what the data alone say of each coefficient."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.setup import Outcome, Setup
from auvident.estimation.prior_data import DataAgainstPrior, compared
from auvident.schema.artifacts import AgainstPrior, AseResult, Finding, PriorAgainstData
from auvident.schema.coefficients import BY_SYMBOL, Group

Array = npt.NDArray[Any]

LEAST_SHARE = 0.1  # of the data; below it they say too little of a coefficient
CONTRADICTED = 2.5  # [std of both]; one of eighty by chance
UNLIKELY = 0.01  # probability of all distances together
REMEDIES: dict[Group, str] = {
    "surge_inertia": "Check mass and hull in the vehicle file.",
    "drag": "Check drag, thrust and mass in the vehicle file.",
    "thrust": "Check drag, thrust and mass in the vehicle file.",
    "turning_drag": "Check hull and fins in the vehicle file.",
    "inertia": "Check mass, moment of inertia, hull and fins in the vehicle file.",
    "lift": "Check hull and fins in the vehicle file.",
    "cross_flow": "Check hull and fins in the vehicle file.",
    "control": "Check the fins in the vehicle file and the unit of their angle in the log.",
}
ORIGINS = {"ase": "the estimate of", "given": "the given value of"}


def prior_against_data(
    setup: Setup,
    final: Outcome,
    gradients: Mapping[str, Array],
    curvatures: Mapping[str, Array],
    prior: Array,
    ase: AseResult,
) -> tuple[PriorAgainstData, list[Finding]]:
    """Compare the prior with what the maneuvers say at the final coefficients, with findings.

    Parameters
    ----------
    setup : Setup
    final : Outcome
    gradients, curvatures, prior
        As `engines.jackknife.information_by_maneuver` gives them.
    ase : AseResult
        Where the prior came from.
    """
    names, scale = setup.names(final.free), setup.prior_std[final.free]
    own = np.array([i for i, name in enumerate(names) if name in BY_SYMBOL], dtype=np.int64)
    found = compared(
        (final.parameters - setup.prior)[final.free] / scale,
        sum(gradients.values(), np.zeros(len(names))),
        sum(curvatures.values(), np.zeros_like(prior)),
        prior,
        own,
    )
    before = np.sqrt(np.diag(np.linalg.inv(prior)))
    rows = tuple(
        AgainstPrior(
            symbol=names[i],
            prior=float(setup.prior[final.free[i]]),
            prior_std=float(before[i] * scale[i]),
            data=float(setup.prior[final.free[i]] + found.data[k] * scale[i]),
            data_std=float(found.data_std[k] * scale[i]),
            away=float(found.away[k]),
        )
        for k, i in enumerate(own)
        if found.share[k] >= LEAST_SHARE
    )
    told = PriorAgainstData(
        coefficients=rows, chi_square=found.chi_square, directions=found.directions, p=found.p
    )
    return told, _findings(found, [names[i] for i in own], ase)


def _findings(found: DataAgainstPrior, symbols: list[str], ase: AseResult) -> list[Finding]:
    """Coefficients whose prior the data contradict, the worst first, and all together."""
    worst = [k for k in np.argsort(-np.abs(found.away)) if found.share[k] >= LEAST_SHARE]
    rows = [_contradicted(symbols[k], float(found.away[k]), ase) for k in worst]
    rows = [row for row in rows if (row.value or 0.0) >= CONTRADICTED]
    if found.p >= UNLIKELY:
        return rows
    together = Finding(
        code="priors-contradicted",
        value=found.p,
        threshold=UNLIKELY,
        message=f"the data and the prior contradict each other: chi-square {found.chi_square:.0f} "
        f"in {found.directions} directions that the data see (probability)",
        remedy="Check the vehicle file, or give the coefficients that are surely off a larger "
        "standard deviation under [coefficients].",
    )
    return [*rows, together]


def _contradicted(symbol: str, away: float, ase: AseResult) -> Finding:
    origin = next((c.origin for c in ase.coefficients if c.symbol == symbol), "ase")
    return Finding(
        code="prior-contradicted",
        where=symbol,
        value=abs(away),
        threshold=CONTRADICTED,
        message=f"the data contradict {ORIGINS[origin]} {symbol} by {abs(away):.1f} "
        "standard deviations",
        remedy=REMEDIES[BY_SYMBOL[symbol].group],
    )
