"""What both planes identify: a vehicle has one drag and one propeller.

The plane that is identified first makes the prior of the other one, with its correlations: drag and
thrust are known together far better than each alone. Readings of the speed that have counted there
count no more: the other plane leaves them out of the straight runs that serve both.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import NOT_MOVED
from auvident.engines.carried import claimed_covariance
from auvident.engines.records import Record
from auvident.engines.setup import Correlated
from auvident.schema.artifacts import AseResult, Finding, IdentifiedModel, ModelCoefficient
from auvident.schema.coefficients import BY_SYMBOL, Coefficient, Group
from auvident.schema.planes import PLANES, Plane

Array = npt.NDArray[Any]

SURGE = 0  # channel of the speed
# The drag of a deflected fin stands beside that of the motion it makes, and takes up what this
# lacks: in trials drawn by seed the planes put it up to five standard deviations apart.
APART: tuple[Group, ...] = ("turning_drag",)


@dataclass(frozen=True)
class Shared:
    """Coefficients of both planes as the first one left them.

    Attributes
    ----------
    plane : str
        That one.
    values, stds : mapping
        By symbol; the standard deviations at most those of the prior there.
    joint : Correlated
        Their correlations.
    counted : frozenset of str
        Maneuvers that it identified from.
    """

    plane: Plane
    values: Mapping[str, float]
    stds: Mapping[str, float]
    joint: Correlated
    counted: frozenset[str]

    def uncounted(self, record: Record) -> Record:
        """A record without the readings of the speed that have counted already."""
        if record.id not in self.counted:
            return record
        measured = record.measured.copy()
        measured[:, SURGE] = np.nan
        return replace(record, measured=measured)


def shared_of(model: IdentifiedModel) -> Shared:
    """What a model knows of the coefficients that stand in the equations of both planes.

    Its covariance is that of the fit and of the scatter between maneuvers: what the equations of
    one plane lack is not what those of the other lack.
    """
    told = list(model.covariance["symbols"])
    symbols = [s for s in told if s in BY_SYMBOL and _is_shared(BY_SYMBOL[s])]
    at = [told.index(s) for s in symbols]
    covariance = claimed_covariance(model)[np.ix_(at, at)]
    spread = np.sqrt(np.diag(covariance))
    rows = {c.symbol: c for c in model.coefficients}
    stds = {s: min(float(std), rows[s].prior_std) for s, std in zip(symbols, spread, strict=True)}
    return Shared(
        plane=model.plane,
        values={s: rows[s].value for s in symbols},
        stds=stds,
        joint=Correlated(tuple(symbols), covariance / np.outer(spread, spread)),
        counted=frozenset(model.stages[-1].maneuvers),
    )


def _is_shared(c: Coefficient) -> bool:
    """Whether both planes identify it, and mean the same by it."""
    return set(c.planes) == set(PLANES) and c.group not in APART


def with_both(model: IdentifiedModel, shared: Shared, ase: AseResult) -> IdentifiedModel:
    """A model of the other plane, saying which of its coefficients come from the data of both."""
    before = ase.by_symbol()
    rows = tuple(
        _of_both(c, before[c.symbol].value, before[c.symbol].std, shared.plane)
        if c.symbol in shared.values
        else c
        for c in model.coefficients
    )
    seen = {c.symbol for c in rows if c.shared_with and c.data_share >= NOT_MOVED}
    kept = [f for f in model.findings if not (f.code == "not-seen" and f.where in seen)]
    findings = tuple(_said(f, model.plane, shared) for f in kept)
    return model.model_copy(update={"coefficients": rows, "findings": findings})


def _of_both(c: ModelCoefficient, prior: float, prior_std: float, plane: Plane) -> ModelCoefficient:
    """A coefficient beside the estimate from geometry, which is its prior before any data."""
    share = 1.0 - (c.std / prior_std) ** 2 if prior_std > 0.0 else 0.0
    update = {"prior": prior, "prior_std": prior_std, "data_share": min(max(share, 0.0), 1.0)}
    return c.model_copy(update={**update, "shared_with": plane})


def _said(finding: Finding, plane: Plane, shared: Shared) -> Finding:
    """A prior that the data contradict, in words: here it is what the other plane says."""
    if finding.code != "prior-contradicted" or finding.where not in shared.values:
        return finding
    return finding.model_copy(
        update={
            "code": "planes-disagree",
            "message": f"the {plane} maneuvers contradict the {shared.plane} ones about "
            f"{finding.where} by {finding.value:.1f} standard deviations",
            "remedy": "One of the planes lacks an effect on the speed, or the vehicle was changed "
            "between the trials. Compare with `auvident identify RUN --plane "
            f"{plane}`.",
        }
    )
