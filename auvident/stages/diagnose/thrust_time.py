"""When the thrust fell: the time of a step of the thrust, which no slope can find."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.stages.diagnose.case import Case
from auvident.stages.diagnose.fits import Fitted
from auvident.stages.diagnose.joint import joint_about, score

Array = npt.NDArray[Any]

STEP = "thrust_step"
APART_S = 120.0  # steps of thrust are looked for this far apart
REACHES = (0.75, 0.19)  # ... and then about the best one [of that]


def with_best_time(case: Case, fitted: Fitted) -> Fitted:
    """The model with the time at which a step of the thrust would explain most.

    A model that carries a step already stays as it is.
    """
    if STEP in fitted.effects:
        return fitted
    sources = [r.source for r in case.records if r.source is not None]
    end = max(s.elapsed_s[-1] for s in sources)
    coarse = np.arange(min(s.elapsed_s[0] for s in sources), end, APART_S)
    best = _best(case, fitted, coarse[1:])
    for reach in REACHES:
        best = _best(case, fitted, best + reach * APART_S * np.linspace(-1, 1, 5))
    return at_time(case, fitted, best)


def _best(case: Case, fitted: Fitted, times: Sequence[float] | Array) -> float:
    gains = {}
    for time in times:
        joint = joint_about(case, at_time(case, fitted, time), (STEP,))
        gains[float(time)] = score(joint, (STEP,)).gain if joint else 0.0
    return max(gains, key=lambda t: gains[t])


def at_time(case: Case, fitted: Fitted, time: float) -> Fitted:
    """A fitted model with another time of the step."""
    p = fitted.parameters.copy()
    p[case.position(f"{STEP}.time_s")] = time
    return replace(fitted, parameters=p)
