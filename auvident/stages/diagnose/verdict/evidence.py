"""The evidence of a diagnosis, and the verdict it supports."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.artifacts import Verdict
from auvident.schema.diagnosis import EffectFound
from auvident.schema.effects import BY_ID
from auvident.schema.likeness import nested
from auvident.schema.mattering import share_that_matters
from auvident.schema.planes import Plane
from auvident.stages.diagnose.checks.events import Event
from auvident.stages.diagnose.checks.waves import Wave
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.free_forces import FREE_GAIN, FreeForce
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.select.rules import RULES_LEFT_OUT

Array = npt.NDArray[np.float64]

# [standard errors] A free force that explains much is something where it brings so much to what is
# left out. The vehicle of seed 28 lacks nothing, and two forces that gain 574 and 354 nats in its
# fit bring -1.0 and -1.6; where a hull has a memory (126) two bring 4.2 and 4.3.
FREE_HELPS = 2.0
BEATEN = 1.08  # a free force that gains so many times what the named effect does beats it
DVL_NOISES = 3.0  # a residual beyond it means something is left
# [L] It matters by the share of what the channel varies (`share_that_matters`), or of the rate on a
# path of this radius: in a straight run or a steady turn alone the rate varies by little more than
# turbulence stirs it (`harbour_trial`: 0.8 and 0.2 of it are left)
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
    least_push : (float, float), optional
        Changes of sway and yaw within L/U that would be an event together; see `smallest_push`.
    """

    traced: Traced
    candidates: tuple[str, ...]
    events: tuple[Event, ...]
    wave: Wave | None
    free: tuple[FreeForce, ...]
    rival: FreeForce | None
    missing: tuple[str, ...]
    least_push: tuple[float, float] | None = None


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


def nearest_of(evidence: Evidence) -> str | None:
    """The named effect, if a free force in its place does clearly better.

    What is taken along without a claim is not held against any: that it is small was said.
    """
    rival, accepted = evidence.rival, evidence.traced.claimed
    if rival is None or not accepted:
        return None
    named = next(t for t in accepted[-1].tried if t.id == accepted[-1].accepted)
    beaten = rival.gain > BEATEN * named.gain and rival.gain > FREE_GAIN
    beside = something(evidence) and max(f.gain for f in evidence.free) > 0.5 * named.gain
    return named.id if beaten or beside else None


def closest_of(evidence: Evidence) -> str | None:
    """The candidate of most gain that was sound but for what it does to maneuvers left out.

    Where nothing is named it is what a user looks at next. A hull with linear damping was told
    that it lacks nothing, with that damping refused at its true size for helping half of them.
    """
    last, by = evidence.traced.rounds[-1], {rule.code for rule in RULES_LEFT_OUT}
    refused = [t for t in last.tried if t.refusal is not None and t.refusal.code in by]
    best = max(refused, key=lambda t: t.gain, default=None)
    return best.id if best is not None else None


@dataclass(frozen=True)
class Remainder:
    """What is left of a channel, where that is more than a complete model leaves.

    Attributes
    ----------
    channel : str
    noises : float
        The residual over the noise of the sensor.
    share : float
        The residual over the standard deviation of the channel in these maneuvers.
    matters : bool
        Whether a prediction would be the better for it by a share worth having.
    """

    channel: str
    noises: float
    share: float
    matters: bool

    def as_told(self) -> dict[str, Any]:
        """As the artifact has it."""
        return {"channel": self.channel, "noises": self.noises, "share": self.share}


def remainders(case: Case, fitted: Fitted, length_m: float) -> list[Remainder]:
    """Channels whose residual is larger than any complete model leaves it.

    Of a velocity it is held against the noise of its sensor and what it varies; of the rate what
    is beyond the noise of the gyro is held against what the rate varies.

    Parameters
    ----------
    case : Case
    fitted : Fitted
        The model with all that was found.
    length_m : float
        Of the hull.
    """
    rms, noise = fitted.rms[:3].copy(), case.setup.sensor_std[:3]
    noises = rms / noise
    rms[2] = np.sqrt(max(rms[2] ** 2 - noise[2] ** 2, 0.0))
    shares = rms / _variation(case, length_m)
    velocities = [
        Remainder(
            name, float(noises[c]), float(shares[c]), bool(shares[c] > share_that_matters(name))
        )
        for c, name in enumerate(case.channels[:2])
        if noises[c] > DVL_NOISES
    ]
    if shares[2] <= share_that_matters(case.channels[2]):
        return velocities
    return [*velocities, Remainder(case.channels[2], float(noises[2]), float(shares[2]), True)]


def mattering(rest: Sequence[Remainder]) -> list[str]:
    """Channels in which what is left matters."""
    return [r.channel for r in rest if r.matters]


def _variation(case: Case, length_m: float) -> Array:
    """Standard deviations (3,) of velocities and rate; of the rate at least a gentle turn's."""
    measured = np.concatenate([r.measured[:, :3] for r in case.records])
    speed = float(np.median(np.concatenate([r.given[:, 0] for r in case.records])))
    varies: Array = np.nanstd(measured, axis=0)
    varies[2] = max(varies[2], speed / (GENTLE[case.plane.name] * length_m))
    return varies
