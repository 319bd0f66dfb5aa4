"""What the diagnosis of the first plane of a run says of effects that stand in both.

A current, a scale of the DVL or a late clock is one thing, whichever way the vehicle turned. What
was found of it in one plane counts in the other like what sensors say about each other.
"""

import numpy as np

from auvident.schema.artifacts import Maneuvers
from auvident.schema.diagnosis import Diagnosis, EffectFound, ParameterValue
from auvident.schema.effect import EffectParameter
from auvident.schema.effects import BY_ID
from auvident.schema.planes import PLANES, Plane
from auvident.stages.diagnose.checks.kinematics import SensorCheck


def told_by(first: Diagnosis, maneuvers: Maneuvers) -> list[SensorCheck]:
    """What a diagnosis has to say of the other plane, an effect each.

    What belongs to a trial counts where both planes were flown in the same trials.

    Parameters
    ----------
    first : Diagnosis
        Of the plane that is diagnosed first.
    maneuvers : Maneuvers
        Of all planes.
    """
    together = _trials(maneuvers, PLANES[0]) == _trials(maneuvers, PLANES[1])
    own = [e for e in first.effects if together or not BY_ID[e.id].of_trial]
    found = [_as_check(e, first.plane) for e in own if e.frame == "north"]
    return [check for check in found if check is not None]


def _trials(maneuvers: Maneuvers, plane: Plane) -> set[str]:
    return {m.trial for m in maneuvers.maneuvers if m.plane == plane and m.role == "identify"}


def _as_check(effect: EffectFound, plane: str) -> SensorCheck | None:
    """Values and standard deviations of the parameters that both planes have, if any."""
    row = BY_ID[effect.id]
    declared = {p.symbol: p for p in row.parameters}
    both = [
        (declared[p.symbol], p)
        for p in effect.parameters
        if _is_shared(row.planes, declared[p.symbol], p)
    ]
    if not both or row.instant is not None:  # its time was looked for in one plane alone
        return None
    return SensorCheck(
        names=tuple(f"{effect.id}.{d.symbol}" for d, _ in both),
        mean=np.array([d.internal(p.value) for d, p in both]),
        covariance=np.diag([((p.std or 0.0) / d.factor) ** 2 for d, p in both]),
        samples=0,
        residual_rms=0.0,
        what=f"{effect.id} by the {plane} plane",
    )


def _is_shared(planes: tuple[Plane, ...], declared: EffectParameter, found: ParameterValue) -> bool:
    """Whether a size is known to both sides, and stands in both planes."""
    alike = set(planes) == set(declared.planes) == set(PLANES)
    size = declared.form == "plain" and declared.practical > 0.0
    return alike and size and found.bound is None and bool(found.std)
