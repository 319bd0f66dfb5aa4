"""Does the split flatter? Held-out errors by the rule over those of random splits."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from auvident.errors import AuvidentError
from auvident.schema.artifacts import Maneuver
from auvident.stages.segment.split import split
from tests.bench.band import clean_trials
from tests.engines.chain import Chain, plan_named

TRIALS, DRAWS = 12, 5
CHANNELS = ("u", "v", "r", "heading")

Rows = list[dict[str, Any]]


def splits(trials: int = TRIALS, draws: int = DRAWS) -> dict[str, Rows]:
    """Error by the rule over the mean of random splits, over clean trials of even seeds."""
    ratios = [
        ratio
        for seed, _, chain in clean_trials(trials)
        if (ratio := ratio_of(chain, draws, np.random.default_rng(seed)))
    ]
    return {"held-out error by the rule over the mean of random splits": summary(ratios)}


def ratio_of(chain: Chain, draws: int, rng: np.random.Generator) -> dict[str, float]:
    """Ratio of each channel of one trial; empty where a split could not be identified from."""
    found = chain.maneuvers.maneuvers
    held = held_out(found)
    try:
        own = errors_of(chain, held)
        others = [errors_of(chain, drawn(found, held, rng)) for _ in range(draws)]
    except AuvidentError:
        return {}
    return {c: own[c] / float(np.mean([e[c] for e in others])) for c in CHANNELS if c in own}


def held_out(maneuvers: Sequence[Maneuver]) -> list[str]:
    """IDs of the whole maneuvers that are held out."""
    return sorted({_whole(m) for m in maneuvers if m.role == "validate"})


def drawn(maneuvers: Sequence[Maneuver], held: Sequence[str], rng: np.random.Generator) -> list:
    """As many of each kind at random."""
    kinds = {_whole(m): (m.kind, m.planes) for m in maneuvers}
    numbers = Counter(kinds[name] for name in held)
    chosen: list[str] = []
    for kind, number in sorted(numbers.items()):
        same = sorted(name for name, k in kinds.items() if k == kind)
        chosen += [str(name) for name in rng.choice(same, number, replace=False)]
    return chosen


def errors_of(chain: Chain, held: Sequence[str]) -> dict[str, float]:
    """Pooled held-out errors over their spread, with these maneuvers held out."""
    found, _ = split(chain.maneuvers.maneuvers, [t.name for t in chain.trials], held)
    maneuvers = chain.maneuvers.model_copy(update={"maneuvers": found})
    other = replace(chain, maneuvers=maneuvers)
    metrics = other.validate(other.identify(plan=plan_named("refined")).model).metrics
    return {c: m.nrmse for c, m in metrics.summary["validate"].items()}


def summary(ratios: Sequence[dict[str, float]]) -> Rows:
    """Median and spread over the trials."""
    rows = []
    for channel in CHANNELS:
        told = [r[channel] for r in ratios if channel in r]
        low, high = (float(x) for x in np.quantile(told, [0.25, 0.75]))
        rows.append(
            {
                "channel": channel,
                "trials": len(told),
                "median": median(told),
                "quarter below": low,
                "quarter above": high,
                "least": min(told),
                "most": max(told),
            }
        )
    return rows


def _whole(m: Maneuver) -> str:
    """ID of a maneuver before it was cut into parts."""
    return str(m.features.get("whole", m.id))
