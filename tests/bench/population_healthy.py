"""How strong the strongest candidate of a healthy vehicle is, and whether its chance is uniform."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tests.bench.effects_score import uniformity
from tests.bench.effects_summary import CHANCE
from tests.bench.population_score import Drawn

STRENGTH = "strongest candidate of a healthy vehicle"
SHARES = (1.0, 0.99, 0.97, *(k / 20 for k in range(19, 1, -1)), 0.07, 0.05, 0.03, 0.02, 0.01)
Table = list[dict[str, Any]]


def healthy_tables(trials: Sequence[Drawn]) -> dict[str, Table]:
    """For `select.healthy`: strengths that so many of the healthy vehicles reach; chances."""
    told = [s for s in trials if s.clean != "failed"]
    return {
        STRENGTH: reached([s.strength for s in told]),
        CHANCE: [uniformity([s.chance for s in told])],
    }


def reached(strengths: Sequence[float]) -> Table:
    """Strength that a share of so many vehicles reaches, for shares that they can tell.

    The k-th largest of n is reached by another vehicle as often as k / (n + 1), and -1 by all.
    """
    found, n = np.append(np.sort(strengths)[::-1], -1.0), len(strengths)
    shares = [share for share in SHARES if share * (n + 1) >= 1.0]
    values = np.interp([share * (n + 1) - 1.0 for share in shares], np.arange(n + 1), found)
    return [
        {"share": s, "strength": float(f"{v:.3g}")} for s, v in zip(shares, values, strict=True)
    ]
