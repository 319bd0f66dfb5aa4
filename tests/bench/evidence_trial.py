"""What one trial of a drawn vehicle has to say for the best candidates of a first round.

Raw evidence only: gains by block of time, squared errors by maneuver, Wald statistics. What is
made of it is `evidence_score`, so that a kind of evidence can be thought of afterwards.
"""

import tempfile
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

import numpy as np
import numpy.typing as npt

from auvident.constants import INDEPENDENT_S
from auvident.engines.free_run import best_start, finite_innovations
from auvident.pipeline import run_stage
from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, check_cost, output_error, prior_of
from auvident.stages.diagnose.score.left_out import LeftOut, fits_without, seen_with
from auvident.stages.diagnose.select.candidates import Tried, open_of
from auvident.stages.diagnose.select.instants import with_best_times
from auvident.stages.diagnose.select.refitting import refitted
from auvident.stages.diagnose.select.screen import screen
from auvident.stages.diagnose.select.search import Search
from tests.bench.population_trial import chain

Array = npt.NDArray[Any]
Outcome = dict[str, Any]

UNTIL = "validate"
LOOKED_AT = 3  # candidates of a round, and the planted ones


class Enough(Exception):
    """The first round is over; nothing else of the search is wanted."""


def outcome(seed: int, short: bool = True) -> Outcome:
    """Evidence for the best candidates of a trial; a refusal is an outcome, and so is a bug."""
    from seatrial.population import draw

    began = perf_counter()
    found: Outcome = {"case": {"key": str(seed), "seed": seed, "kind": "none", "planted": []}}
    with tempfile.TemporaryDirectory(prefix="auvident-evidence-") as name:
        folder = Path(name)
        try:
            found |= _round_of(draw(seed, short), folder)
        except Exception:
            found["error"] = traceback.format_exc().replace(str(folder), "")
    return {**found, "seconds": round(perf_counter() - began, 1)}


def _round_of(drawn: Any, folder: Path) -> Outcome:
    """Sail a trial, run the chain, and try the candidates of the first round."""
    from seatrial.population.visible import own_effects, visibility

    sailed, planted = drawn.sail(), list(drawn.planted)
    drawn.write(sailed, folder / "trial", folder / "vehicle.toml")
    case = {"key": str(drawn.seed), "seed": drawn.seed, "kind": drawn.kind, "planted": planted}
    found: Outcome = {"case": case, "classes": list(drawn.classes)}
    found["visible"] = visibility(drawn, sailed)
    done = chain(folder, until=UNTIL)
    if done.get("error"):
        return {**found, "error": done["error"]}
    rows: list[Outcome] = []

    def first_round(search: Search, baseline: Fitted) -> None:
        rows.extend(candidates_of(search, baseline, planted))
        raise Enough

    with patch.object(Search, "trace", first_round), suppress(Enough):
        run_stage("diagnose", folder / "run")
    named: Outcome = {row["id"]: {} for row in rows if row["id"] not in planted}
    found["own"] = own_effects(drawn, sailed, named)
    return {**found, "candidates": rows}


def candidates_of(search: Search, baseline: Fitted, planted: Sequence[str]) -> list[Outcome]:
    """Evidence for the best candidates of a round and for the planted ones."""
    case = search.case
    before = with_best_times(case, baseline, search.candidates)
    before, tried = refitted(case, before, screen(case, before, search.candidates))
    settled = [t for t in tried if t.account.settled]
    chosen = [t for k, t in enumerate(settled) if k < LOOKED_AT or t.id in planted]
    without = fits_without(case, before) if chosen else None
    rows = []
    for t in chosen:
        assert without is not None
        rows.append({**_known(case, before, t), **_left_out(case, before, without, t)})
    return [{**row, "among": len(search.candidates), "all": len(tried)} for row in rows]


def _known(case: Case, before: Fitted, tried: Tried) -> Outcome:
    """What the fit to everything says of a candidate."""
    account, fitted = tried.account, tried.fitted
    costs = [check_cost(case, f.parameters) for f in (before, fitted)]
    names = ("gain", "by_others", "size", "impossible", "parameters", "maneuvers")
    return {
        "id": tried.id,
        "family": BY_ID[tried.id].family,
        **{name: getattr(account, name) for name in names},
        "falls": dict(account.falls),
        "checks": costs,
        "wald": {by: wald(case, fitted, by == "block") for by in ("maneuver", "block")},
        "noise": [
            [float(c.white) for c in f.colours[:3]] + [float(c.slow) for c in f.colours[:3]]
            for f in (before, fitted)
        ],
        "sensor_std": [float(std) for std in case.setup.sensor_std[:3]],
    }


def _left_out(case: Case, before: Fitted, without: Array, tried: Tried) -> Outcome:
    """Gains by block and squared errors by maneuver of what was left out, with both noises."""
    own = fits_without(case, tried.fitted)
    found: Outcome = {}
    for name, colours in (("before", before.colours), ("own", tried.fitted.colours)):
        pair = [
            seen_with(case, fitted, p, colours)
            for fitted, p in ((before, without), (tried.fitted, own))
        ]
        found[f"blocks_{name}"] = gains(*pair)
        found[f"power_{name}"] = [_finite(p.power) for p in pair]
    found["readings"] = [
        int(np.isfinite(np.concatenate([r.measured[:, c] for r in case.records])).sum())
        for c in range(3)
    ]
    return found


def gains(before: LeftOut, after: LeftOut) -> list[list[float]]:
    """Gain of each block of each maneuver [nats], not clipped."""
    pairs = zip(before.blocks, after.blocks, strict=True)
    with np.errstate(invalid="ignore"):
        return [
            np.clip(np.nan_to_num(0.5 * (a - b)), -1e6, 1e6).round(3).tolist() for a, b in pairs
        ]


def _finite(power: Array) -> list[list[float]]:
    return np.where(np.isfinite(power), power, 1e9).tolist()


def wald(case: Case, fitted: Fitted, by_block: bool) -> float | None:
    """Robust Wald statistic of the size of the effect that a fit has last.

    The covariance is the sandwich H^-1 (sum of g g') H^-1 over gradients g of maneuvers or of
    blocks of time, with the factor m / (m - 1) for m of them (White 1982).
    """
    free = case.setup.free(fitted.free)
    output, rows = output_error(case, fitted.colours), list[Array]()
    prior = prior_of(case, free.positions, open_of(case, fitted))
    curvature, k = prior.information.copy(), len(output.channels)
    for record in case.records:
        found = finite_innovations(output, output.at(fitted.parameters, free), record)
        if found is None:
            return None
        start = found.white[:, 1 : 1 + k]
        left = found.white - start @ best_start(output, start.T @ start, start.T @ found.white)
        slopes, n = found.white[:, 1 + k :], len(record.time_s)
        curvature += slopes.T @ left[:, 1 + k :]
        length = INDEPENDENT_S if by_block else np.inf
        number = np.tile((np.arange(n) * case.setup.dt_s // length).astype(int), k)
        for b in range(int(number.max()) + 1):
            rows.append(slopes[number == b].T @ left[number == b, 0])
    g = np.array(rows)
    g -= g.mean(axis=0)
    inverse = np.linalg.inv(0.5 * (curvature + curvature.T))
    covariance = inverse @ (g.T @ g) @ inverse * len(g) / max(len(g) - 1, 1)
    at = np.searchsorted(free.positions, case.positions(fitted.effects[-1]))
    size = ((fitted.parameters - case.setup.prior)[free.positions] / free.scale)[at]
    return float(size @ np.linalg.pinv(covariance[np.ix_(at, at)]) @ size)
