"""What these maneuvers can show, cannot show and cannot separate; no residual is looked at."""

from collections.abc import Sequence

import numpy as np

from auvident.schema.diagnosis import Detectable, Lookalikes
from auvident.schema.effects import BY_ID, parameter_of
from auvident.schema.likeness import LIKENESSES
from auvident.stages.diagnose.fit.fits import check_cost
from auvident.stages.diagnose.score.first_order import Joint, cosine, unabsorbed
from auvident.stages.diagnose.select.rules import LEAST_FALL, LEAST_GAIN
from auvident.stages.diagnose.select.search import CHECK_GAIN

MARGIN = 1.3  # stated sizes leave room for the scatter of an estimate
PLAUSIBLE = 3.0  # an effect that must exceed so many priors to be seen is not visible
ABSORBED = 0.015  # of the signature left by the coefficients: no size is stated
SEPARABLE = 0.98  # cosine from which on two effects are not told apart
# relative rms that adds up to a fall by LEAST_FALL when it is removed
SHARE_OF_RMS = float(np.sqrt((1.0 - LEAST_FALL) ** -2 - 1.0))


def detectable(joint: Joint, candidates: Sequence[str]) -> tuple[Detectable, ...]:
    """Smallest size of each parameter of each effect that would be declared."""
    return tuple(row for effect in candidates for row in _rows(joint, effect))


def _rows(joint: Joint, effect: str) -> list[Detectable]:
    case, found = joint.case, []
    positions = case.positions(effect)
    information, kept, rms = unabsorbed(joint, positions)
    for k, i in enumerate(positions):
        declared = parameter_of(case.names[i])
        unit = case.setup.prior_std[i] / declared.prior  # internal value of one table unit
        by_gain = np.sqrt(2.0 * LEAST_GAIN / max(information[k, k], 1e-12))
        by_fall = np.min(SHARE_OF_RMS * joint.fitted.rms / np.maximum(rms[k], 1e-15))
        size = max(by_gain, float(by_fall)) * MARGIN * declared.prior
        size = max(min(size, _by_checks(joint, i)), declared.practical)
        visible = size < PLAUSIBLE * declared.prior and (
            kept[k] > ABSORBED or np.isfinite(_by_checks(joint, i))
        )
        found.append(
            Detectable(
                id=effect,
                family=BY_ID[effect].family,
                symbol=declared.symbol,
                size=declared.shown(min(size, 1e3 * declared.prior) * unit)[0],
                unit=declared.unit,
                visible=bool(visible),
                kept=float(np.clip(kept[k], 0.0, 1.0)),
                why="" if visible else _why(float(kept[k]), joint, effect),
            )
        )
    return found


def _by_checks(joint: Joint, position: int) -> float:
    """Size, in table units, that the sensors alone would show; infinite without a check."""
    case, name = joint.case, joint.case.names[position]
    for check in case.checks:
        if name in check.names:
            k = check.names.index(name)
            spread = np.sqrt(check.covariance[k, k])
            declared = parameter_of(name)
            unit = case.setup.prior_std[position] / declared.prior
            return float(MARGIN * spread * np.sqrt(2.0 * max(LEAST_GAIN, CHECK_GAIN)) / unit)
    return float("inf")


def _why(kept: float, joint: Joint, effect: str) -> str:
    needs = BY_ID[effect].needs
    if kept < 0.05:
        return "absorbed by the coefficients"
    if needs and not check_cost(joint.case, joint.fitted.parameters) and not joint.case.checks:
        return f"needs {', '.join(needs)} in the log"
    return "these maneuvers hardly excite it"


def lookalikes(joint: Joint, candidates: Sequence[str]) -> tuple[Lookalikes, ...]:
    """Pairs of effects of one group that these maneuvers cannot tell apart."""
    found = []
    for group, separate_by in LIKENESSES.items():
        there = [e for e in candidates if BY_ID[e].alike == group]
        for k, a in enumerate(there):
            for b in there[k + 1 :]:
                value = cosine(joint, joint.case.positions(a), joint.case.positions(b))
                if value > SEPARABLE:
                    found.append(Lookalikes(ids=(a, b), cosine=value, separate_by=separate_by))
    return tuple(found)
