"""How strong the strongest candidate is on vehicles that lack nothing of the table.

A vehicle is built of other terms than any model, and what stands in for these helps the maneuvers
left out by more than luck: with signs drawn at random 18 of 60 healthy vehicles have a candidate
with a chance below 0.05. How often a healthy vehicle has one as strong is therefore counted, on 70
drawn vehicles of even seeds with nothing planted (``python -m tests.bench population --clean
--until diagnose``); odd seeds report. Half of them have none that helps what was left out: these
are counted by what the candidates gain where they were fitted, so that every vehicle has a chance.
"""

import numpy as np

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import rules

# Strength of the strongest candidate [standard errors], and share of healthy vehicles in which it
# is that or more. The last share is the least that so many vehicles can tell.
STRENGTHS = (0.0, 0.16, 0.8, 1.19, 1.81, 2.41, 2.62, 3.04, 3.34, 3.66, 3.79)
SHARES = (1.0, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02)


def strength(found: Helped) -> float:
    """Standard errors of what is gained, fewer where too few are helped or too little explained.

    At least as many as are needed where fewer do, so much being explained.
    """
    helped = max(found.share, found.deciding) / rules.LEAST_SHARE
    explained = max(found.explained, 0.0) / rules.LEAST_EXPLAINED
    told = found.t * min(helped, 1.0) * min(explained, 1.0)
    if min(helped, explained) >= 1.0 and rules.suffices(found.explained, found.t):
        return max(told, rules.LEAST_T)
    return told


def standing(found: Helped | None, gain: float) -> float:
    """Strength of a candidate, and below zero where it helps nothing that was left out.

    There, or where it did not come so far (None), the more it gains where it was fitted [nats] the
    nearer it comes to zero.
    """
    told = found.strength if found else 0.0
    return told if told > 0.0 else -1.0 / (1.0 + max(gain, 0.0))


def share_of_healthy(told: float) -> float:
    """Share of healthy vehicles whose strongest candidate has this strength or more."""
    return float(np.exp(np.interp(told, STRENGTHS, np.log(SHARES))))
