"""How strong the strongest candidate is on vehicles that lack nothing of the table.

A vehicle is built of other terms than any model, and what stands in for these helps the maneuvers
left out by more than luck: with signs drawn at random 18 of 60 healthy vehicles have a candidate
with a chance below 0.05. How often a healthy vehicle has one as strong is therefore counted, on
258 drawn vehicles with nothing planted (``python -m tests.bench population --clean --until diagnose
--first 40000 --count 260``, even seeds; odd seeds report). Of 100 of them 45 have none that helps
what was left out: these are counted by what the candidates gain where they were fitted, so that
each has a chance.
"""

import numpy as np

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import rules

# Strength of the strongest candidate [standard errors], and share of healthy vehicles in which it
# is that or more. The last share is the least that so many vehicles can tell.
STRENGTHS = (
    -1.0, -0.137, -0.118, -0.107, -0.0731, -0.0619, -0.0535, -0.0484, -0.0261, -0.0142,
    -0.00765, 0.0145, 0.184, 0.366, 0.771, 1.08, 1.8, 2.02, 2.46, 2.67, 3.18, 3.38, 3.7, 4.2,
    4.43, 4.85,
)  # fmt: skip
SHARES = (
    1.0, 0.99, 0.97, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.45, 0.4, 0.35,
    0.3, 0.25, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01,
)  # fmt: skip


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
