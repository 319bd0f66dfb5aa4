"""The evidence of a diagnosis, and the verdict it supports."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from auvident.schema.artifacts import Verdict
from auvident.schema.diagnosis import EffectFound
from auvident.schema.effects import BY_ID, parts_of
from auvident.schema.planes import Plane
from auvident.stages.diagnose.checks.events import Event
from auvident.stages.diagnose.checks.waves import Wave
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.free_forces import FREE_GAIN, FreeForce
from auvident.stages.diagnose.select.candidates import Traced

# [standard errors] A free force that explains much is something where it brings so much to what is
# left out. The vehicle of seed 28 lacks nothing, and two forces that gain 574 and 354 nats in its
# fit bring -1.0 and -1.6; where a hull has a memory (126) two bring 4.2 and 4.3.
FREE_HELPS = 2.0
BEATEN = 1.08  # a free force that gains so many times what the named effect does beats it
DVL_NOISES = 3.0  # a residual beyond it means something is left
# ... and one of the rate beyond this share of the rate's standard deviation. Turbulence stirs pitch
# as it does yaw, but a dive pitches at a third of the rate that a turn has: six dives with nothing
# missing, or with all of it found, left 0.04 to 0.08.
RATE_NRMSE: dict[Plane, float] = {"horizontal": 0.06, "vertical": 0.12}
# [L] ... or of the rate on a path of this radius: in a straight run or a steady turn alone the rate
# varies by little more than turbulence stirs it (`harbour_trial`: 0.8 and 0.2 of it are left)
GENTLE: dict[Plane, float] = {"horizontal": 10.0, "vertical": 30.0}


@dataclass(frozen=True)
class Evidence:
    """All that a verdict rests on.

    Attributes
    ----------
    traced : Traced
    candidates : tuple of str
        Effects that could be tested.
    events : tuple of Event
    wave : Wave or None
        The strongest one in the final residual, found or not.
    free : tuple of FreeForce
        Forces without physics beside the final model, best first.
    rival : FreeForce or None
        The best of them in place of the effect accepted last.
    missing : tuple of str
        Columns whose absence hides effects.
    """

    traced: Traced
    candidates: tuple[str, ...]
    events: tuple[Event, ...]
    wave: Wave | None
    free: tuple[FreeForce, ...]
    rival: FreeForce | None
    missing: tuple[str, ...]


def verdict_of(
    effects: Sequence[EffectFound],
    evidence: Evidence,
    left: Sequence[str],
    nearest: str | None,
    groups: Sequence[Sequence[str]],
) -> Verdict:
    """What the evidence supports; see `Diagnosis`.

    What was accepted stands: a remainder makes a verdict partial and takes nothing back.
    """
    if not effects:
        return "unexplained" if left or nearest or something(evidence) else "none_found"
    unmodelled = any(e.id == "wave" for e in effects)  # a wave itself is what is left
    if nearest or (left and not unmodelled):
        return "partly_explained"
    across = any(len({BY_ID[e].family for e in g}) > 1 and not nested(g) for g in groups)
    return "ambiguous" if across else "effect_found"


def something(evidence: Evidence) -> bool:
    """Whether a free force explains much of what is left, in maneuvers left out of its fit too."""
    return any(f.helps is not None and f.helps >= FREE_HELPS for f in evidence.free)


def nested(group: Sequence[str]) -> bool:
    """Whether the effect named is a special case of all others of its group."""
    named, *others = group
    return all(any(named in parts for parts in parts_of(other)) for other in others)


def nearest_of(evidence: Evidence) -> str | None:
    """The named effect, if a free force in its place does clearly better."""
    rival, accepted = evidence.rival, [r for r in evidence.traced.rounds if r.accepted]
    if rival is None or not accepted:
        return None
    named = next(t for t in accepted[-1].tried if t.id == accepted[-1].accepted)
    beaten = rival.gain > BEATEN * named.gain and rival.gain > FREE_GAIN
    beside = something(evidence) and max(f.gain for f in evidence.free) > 0.5 * named.gain
    return named.id if beaten or beside else None


def left_channels(case: Case, fitted: Fitted, length_m: float) -> list[str]:
    """Channels whose residual is larger than any complete model leaves it.

    Parameters
    ----------
    case : Case
    fitted : Fitted
        The model with all that was found.
    length_m : float
        Of the hull.
    """
    found = [
        name
        for c, name in enumerate(case.channels[:2])
        if fitted.rms[c] > DVL_NOISES * case.setup.sensor_std[c]
    ]
    rate = np.concatenate([r.measured[:, 2] for r in case.records])
    speed = float(np.median(np.concatenate([r.given[:, 0] for r in case.records])))
    usual = max(float(np.nanstd(rate)), speed / (GENTLE[case.plane.name] * length_m))
    if fitted.rms[2] > RATE_NRMSE[case.plane.name] * usual:
        found.append(case.channels[2])
    return found
