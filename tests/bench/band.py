"""Does the band hold what was held out, on clean trials of vehicles never seen, by class?"""

import itertools
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
import pandas as pd

from auvident.engines.predictive import NOMINAL, TRACK
from auvident.errors import AuvidentError
from auvident.schema.planes import BY_PLANE
from tests.engines.chain import SAMPLES, Chain, chain_of, plan_named

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

STATES = {s.symbol: s for s in BY_PLANE["horizontal"].states}
CHANNELS = (*STATES, TRACK)
TRIALS = 100
FIRST_SEED = 6601  # odd seeds report, and no study before drew these
UNSTABLE, UNSTABLE_TRIALS, UNSTABLE_FROM = "unstable", 120, 23101  # one in 25 is of the class

Rows = list[dict[str, Any]]


def clean_trials(count: int) -> Iterator[tuple[int, tuple[str, ...], Chain]]:
    """Seed, classes and chain of the first trials of odd seeds in which nothing is planted."""
    from seatrial.population import draw

    drawn = (draw(seed, True) for seed in itertools.count(FIRST_SEED, 2))
    return _sailed(itertools.islice((d for d in drawn if d.kind == "none"), count))


def unstable_trials(count: int) -> Iterator[tuple[int, tuple[str, ...], Chain]]:
    """The same of the first vehicles that do not keep their course, nothing planted in any."""
    from seatrial.population import draw

    drawn = (_or_none(draw, seed) for seed in itertools.count(UNSTABLE_FROM, 2))
    return _sailed(itertools.islice((d for d in drawn if d and UNSTABLE in d.classes), count))


def _or_none(draw: Callable[..., Any], seed: int) -> Any:
    from seatrial.population import Refused

    try:
        return draw(seed, True, ())
    except Refused:
        return None


def _sailed(every: Iterable[Any]) -> Iterator[tuple[int, tuple[str, ...], Chain]]:
    """Chains of those that can be sailed: some vehicles leave their bounds, or do not come down."""
    for drawn in every:
        with tempfile.TemporaryDirectory(prefix="auvident-band-") as name:
            log, vehicle = Path(name) / "trial", Path(name) / "vehicle.toml"
            try:
                drawn.write(drawn.sail(), log, vehicle)
            except FloatingPointError:
                continue
            yield drawn.seed, tuple(drawn.classes), chain_of([log], vehicle)


def band(count: int = TRIALS) -> dict[str, Rows]:
    """Coverage and width, by channel and by class of vehicle."""
    kept, failed = _kept(clean_trials(count))
    return tables(kept) | failed


def unstable(count: int = UNSTABLE_TRIALS) -> dict[str, Rows]:
    """Coverage and width, by channel, of vehicles that do not keep their course."""
    kept, failed = _kept(unstable_trials(count))
    return by_channel(kept) | failed


def _kept(trials: Iterable[tuple[int, tuple[str, ...], Chain]]) -> tuple[Rows, dict[str, Rows]]:
    """Rows of the trials, and the seeds of those that were not identified, if there are any."""
    kept, failed = [], []
    for seed, classes, chain in trials:
        try:
            kept += [{**row, "classes": classes} for row in trial_rows(chain)]
        except AuvidentError:
            failed.append(seed)
    return kept, ({"not identified": [{"seed": s} for s in failed]} if failed else {})


def trial_rows(chain: Chain) -> Rows:
    """Share covered, and mean width over that of the narrowest constant band, by channel."""
    result = chain.validate(chain.identify(plan=plan_named("refined")).model)
    held = result.simulation[result.simulation["role"] == "validate"]
    return [
        {
            "channel": name,
            "covered": cover.covered,
            "width": cover.width / (2.0 * float(np.quantile(error_of(held, name), NOMINAL))),
        }
        for name, cover in result.metrics.coverage.items()
    ]


def error_of(table: pd.DataFrame, channel: str) -> np.ndarray:
    """Distances of the readings of a channel from their prediction."""
    names = ("north_m", "east_m") if channel == TRACK else (STATES[channel].column,)
    away = np.column_stack([table[f"{n}_measured"] - table[f"{n}_simulated"] for n in names])
    if channel != TRACK and STATES[channel].wraps:
        away = np.angle(np.exp(1j * away))
    return np.linalg.norm(away[np.isfinite(away).all(axis=1)], axis=1)


def tables(kept: Rows) -> dict[str, Rows]:
    """Means and medians over the trials, of all and of each class."""
    from seatrial.population import CLASSES

    return by_channel(kept) | {
        "share of the held-out samples within the band, by class": [
            _by_class(name, [r for r in kept if name in r["classes"]], "covered", mean)
            for name in CLASSES
        ],
        "mean width over that of the narrowest constant band, by class": [
            _by_class(name, [r for r in kept if name in r["classes"]], "width", median)
            for name in CLASSES
        ],
    }


def by_channel(kept: Rows) -> dict[str, Rows]:
    """Means and medians over all trials."""
    whole = [_row({"channel": c}, [r for r in kept if r["channel"] == c]) for c in CHANNELS]
    return {"held-out samples within the band, by channel": whole}


def _row(head: dict[str, Any], rows: Rows) -> dict[str, Any]:
    shares, widths = ([r[key] for r in rows] for key in ("covered", "width"))
    return {
        **head,
        "trials": len(rows),
        "covered": mean(shares) if rows else "-",
        "least": min(shares, default="-"),
        "width over narrowest, median": median(widths) if rows else "-",
        "quarter above": float(np.quantile(widths, 0.75)) if rows else "-",
    }


def _by_class(name: str, rows: Rows, key: str, what: Any) -> dict[str, Any]:
    told = {c: [r[key] for r in rows if r["channel"] == c] for c in CHANNELS}
    count = max(len(v) for v in told.values())
    return {"class": name, "trials": count} | {c: what(v) if v else "-" for c, v in told.items()}
