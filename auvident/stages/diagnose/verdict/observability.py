"""What these maneuvers can show, cannot show and cannot separate; no residual is looked at."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.diagnosis import Detectable, Lookalikes
from auvident.schema.effects import BY_ID, BY_MANEUVERS, parameter_of
from auvident.stages.diagnose.fit.fits import check_cost
from auvident.stages.diagnose.score.first_order import Joint, cosine, unabsorbed
from auvident.stages.diagnose.score.left_out import LEAST_ABOVE, noise_floor, readings_of
from auvident.stages.diagnose.select.rules import CHECK_GAIN, LEAST_EXPLAINED, LEAST_GAIN

Array = npt.NDArray[Any]

MARGIN = 1.3  # stated sizes leave room for the scatter of an estimate
PLAUSIBLE = 3.0  # an effect that must exceed so many priors to be seen is not visible
ABSORBED = 0.015  # of the signature left by the coefficients: no size is stated
SEPARABLE = 0.98  # cosine from which on two effects are not told apart
# power over that of the rest, of which it is LEAST_EXPLAINED when both are there
POWER_OF_REST = LEAST_EXPLAINED / (1.0 - LEAST_EXPLAINED)


def detectable(joint: Joint, candidates: Sequence[str]) -> tuple[Detectable, ...]:
    """Smallest size of each parameter of each effect that would be declared."""
    return tuple(row for effect in candidates for row in _rows(joint, effect))


def _rows(joint: Joint, effect: str) -> list[Detectable]:
    positions = joint.case.positions(effect)
    information, kept, rms = unabsorbed(joint, positions)
    return [
        _row(joint, effect, i, float(information[k, k]), float(kept[k]), rms[k])
        for k, i in enumerate(positions)
    ]


def _row(
    joint: Joint, effect: str, i: int, information: float, kept: float, rms: Array
) -> Detectable:
    """One parameter, by its position, with what the fitted model cannot take up of it."""
    declared = parameter_of(joint.case.names[i])
    unit = joint.case.setup.prior_std[i] / declared.prior  # internal value of one table unit
    by_gain = np.sqrt(2.0 * LEAST_GAIN / max(information, 1e-12))
    by_share = np.min(_explainable(joint) / np.maximum(rms, 1e-15))
    size = max(by_gain, float(by_share)) * MARGIN * declared.prior
    size = max(min(size, _by_checks(joint, i)), declared.practical)
    told = kept > ABSORBED or bool(np.isfinite(_by_checks(joint, i)))
    visible = bool(size < PLAUSIBLE * declared.prior and told)
    return Detectable(
        id=effect,
        family=BY_ID[effect].family,
        symbol=declared.symbol,
        size=declared.shown(min(size, 1e3 * declared.prior) * unit)[0],
        unit=declared.unit,
        visible=visible,
        kept=float(np.clip(kept, 0.0, 1.0)),
        why="" if visible else _why(kept, joint, effect),
    )


def _explainable(joint: Joint) -> Array:
    """Root mean square (3,) in each channel that would explain enough of it."""
    case, fitted = joint.case, joint.fitted
    power, readings = fitted.rms**2, readings_of(case).sum(axis=0)
    floor = noise_floor(case, fitted.colours).sum(axis=0) / np.maximum(readings, 1)
    above = np.maximum(power - floor, LEAST_ABOVE * power)
    return np.asarray(np.sqrt(POWER_OF_REST * above))


def _by_checks(joint: Joint, position: int) -> float:
    """Size, in table units, that the sensors alone would show; infinite without a check."""
    case, name = joint.case, joint.case.names[position]
    for check in case.checks:
        if name in check.names:
            _, spread = check.alone(name)
            declared = parameter_of(name)
            unit = case.setup.prior_std[position] / declared.prior
            return float(MARGIN * spread * np.sqrt(2.0 * max(LEAST_GAIN, CHECK_GAIN)) / unit)
    return float("inf")


def _why(kept: float, joint: Joint, effect: str) -> str:
    needs = () if BY_ID[effect].by_rate else BY_ID[effect].needs  # it has the yaw rate
    if kept < 0.05:
        return "indistinguishable from the coefficients"
    if needs and not check_cost(joint.case, joint.fitted.parameters) and not joint.case.checks:
        return f"needs {', '.join(needs)} in the log"
    return "these maneuvers hardly excite it"


def lookalikes(joint: Joint, candidates: Sequence[str]) -> tuple[Lookalikes, ...]:
    """Pairs of effects of one group that these maneuvers cannot tell apart."""
    found = []
    for group, separate_by in BY_MANEUVERS[joint.case.plane.name].items():
        there = [e for e in candidates if BY_ID[e].alike == group]
        for k, a in enumerate(there):
            for b in there[k + 1 :]:
                value = cosine(joint, joint.case.positions(a), joint.case.positions(b))
                if value > SEPARABLE:
                    found.append(Lookalikes(ids=(a, b), cosine=value, separate_by=separate_by))
    return tuple(found)
