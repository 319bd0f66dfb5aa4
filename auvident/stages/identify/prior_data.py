"""The prior against the data: what the data alone say of each coefficient."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.engines.setup import Outcome, Setup
from auvident.estimation.prior_data import DataAgainstPrior, compared
from auvident.schema.artifacts import (
    ESTIMATE_CONTRADICTED,
    AgainstPrior,
    AseResult,
    Finding,
    PriorAgainstData,
)
from auvident.schema.coefficients import BY_SYMBOL, ESTIMATED, Group

Array = npt.NDArray[Any]


class _OfTheFile(NamedTuple):
    """A constant in words, and where to look when the data contradict it."""

    what: str
    remedy: str


LEAST_SHARE = 0.1  # of the data; below it they say too little of a coefficient
CONTRADICTED = 2.5  # [std of both]; one of eighty by chance
# Beyond what right logs of right vehicles come to: of 380 runs on samples and drawn vehicles none
# has a coefficient 4.8 standard deviations away, or more than five that are contradicted.
OTHER_VEHICLE, OTHER_VEHICLE_COUNT = 6.0, 8
UNLIKELY = 0.01  # probability of all distances together
# Of 189 drawn clean trials one is below 9e-7, of 24 with the file of another vehicle 8 below this.
OTHER_VEHICLE_P = 1e-7
REMEDIES: dict[Group, str] = {
    "surge_inertia": "Check mass and hull in the vehicle file.",
    "drag": "Check drag, thrust and mass in the vehicle file.",
    "thrust": "Check drag, thrust and mass in the vehicle file.",
    "turning_drag": "Check hull and fins in the vehicle file.",
    "inertia": "Check mass, moment of inertia, hull and fins in the vehicle file.",
    "lift": "Check hull and fins in the vehicle file.",
    "cross_flow": "Check hull and fins in the vehicle file.",
    "control": "Check the fins in the vehicle file and the unit of their angle in the log.",
    "restoring": "Check mass and ballasting in the vehicle file.",
}
OF_THE_FILE = {
    "W-B": _OfTheFile("the weight in water", "Check mass_kg and buoyancy_n in the vehicle file."),
    "x_GW": _OfTheFile(
        "the trim moment",
        "Check the ballasting, or state x_g_std_m: in metres what this moment is over the weight, "
        "or more.",
    ),
    "z_GW": _OfTheFile("the righting moment", "Check z_g_m and mass_kg in the vehicle file."),
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
    own = np.array([i for i, name in enumerate(names) if name in ESTIMATED], dtype=np.int64)
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
    return told, _findings(found, rows, ase)


def _findings(
    found: DataAgainstPrior, told: Sequence[AgainstPrior], ase: AseResult
) -> list[Finding]:
    """Coefficients whose prior the data contradict, the worst first, and all together."""
    worst = sorted(told, key=lambda row: -abs(row.away))
    rows = [_contradicted(row, ase) for row in worst if abs(row.away) >= CONTRADICTED]
    leads = _leads(worst, found, ase)
    if found.p >= UNLIKELY:
        return [*leads, *rows]
    together = Finding(
        code="priors-contradicted",
        value=found.p,
        threshold=UNLIKELY,
        message=f"the data and the prior contradict each other: chi-square {found.chi_square:.0f} "
        f"with {found.directions} degrees of freedom",
        remedy="Check the vehicle file, or give the coefficients that are surely off a larger "
        "standard deviation under [coefficients].",
    )
    return [*leads, *rows, together]


def _leads(worst: Sequence[AgainstPrior], found: DataAgainstPrior, ase: AseResult) -> list[Finding]:
    """That so much contradicts the estimate that log and vehicle file hardly belong together.

    Constants of the ballasting are left out: they are often wrong in the file of the right vehicle.
    """
    own = [row for row in worst if row.symbol in BY_SYMBOL]
    away = [row for row in own if abs(row.away) >= CONTRADICTED]
    if not away:
        return []
    alone = abs(own[0].away) >= OTHER_VEHICLE or len(away) >= OTHER_VEHICLE_COUNT
    if not alone and found.p >= OTHER_VEHICLE_P:
        return []
    estimate = "estimate from geometry" if ase.applies else "given values"
    verb = "contradicts" if len(away) == 1 else "contradict"
    many = "" if alone else f" (chi-square {found.chi_square:.0f} of {found.directions} in all)"
    return [
        Finding(
            code=ESTIMATE_CONTRADICTED,
            value=abs(own[0].away) if alone else found.p,
            threshold=OTHER_VEHICLE if alone else OTHER_VEHICLE_P,
            message=f"{len(away)} of {len(own)} coefficients {verb} the {estimate}, "
            f"{own[0].symbol} by {abs(own[0].away):.0f} standard deviations{many}: is this the "
            "vehicle file of this vehicle, and are the units of the log right?",
            remedy="Check the vehicle file against the vehicle, and scale and unit of rudder, "
            "speed and rpm; the coefficients are not to be trusted until that is clear.",
        )
    ]


def _contradicted(row: AgainstPrior, ase: AseResult) -> Finding:
    symbol, away = row.symbol, f"{abs(row.away):.1f} standard deviations"
    origin = next((c.origin for c in ase.coefficients if c.symbol == symbol), "ase")
    message = f"the data contradict {ORIGINS[origin]} {symbol} by {away}"
    remedy = REMEDIES[ESTIMATED[symbol].group]
    if symbol in OF_THE_FILE:
        message, unit = OF_THE_FILE[symbol].what, ESTIMATED[symbol].unit
        message += f" is {row.data:+.3g} ± {row.data_std:.2g} {unit} by the data; the vehicle file "
        message += f"says {row.prior:+.3g} ± {row.prior_std:.2g} {unit}, {away} away"
        remedy = OF_THE_FILE[symbol].remedy
    return Finding(
        code="prior-contradicted",
        where=symbol,
        value=abs(row.away),
        threshold=CONTRADICTED,
        message=message,
        remedy=remedy,
    )
