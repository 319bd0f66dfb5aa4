"""Are the stated uncertainties true? Error over claimed standard deviation, over many trials."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2

from auvident.constants import NORMAL_95
from auvident.errors import NumericsError
from auvident.schema.artifacts import AseResult
from auvident.schema.plan import Plan
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from auvident.stages.identify import identify
from auvident.storage.vehicle_file import load_vehicle
from tests.bench.world import CRUISE_MPS, DVL_STD_MPS, GYRO_STD_RADPS, World, make_world
from tests.engines.chain import SAMPLES, plan_named

SEEN = 0.8  # data share above which a coefficient or a combination is judged
NOISE = {"u_mps": DVL_STD_MPS, "v_mps": DVL_STD_MPS, "r_radps": GYRO_STD_RADPS}
TARGET = (0.90, 0.98)
SUMS = ("combinations", "all coefficients")  # rows of a summary that are no coefficient


@dataclass
class Score:
    """Errors over claimed standard deviations, by name; widened to the scatter, and not."""

    widened: dict[str, list[float]] = field(default_factory=dict)
    own: dict[str, list[float]] = field(default_factory=dict)
    failed: int = 0

    def add(self, kind: str, name: str, value: float) -> None:
        getattr(self, kind).setdefault(name, []).append(float(value))


def recovery(seeds: int, plans=("refined", "coloured"), filters=("ekf", "ukf")) -> dict[str, Any]:
    """The study: coverage by plan and filter, with the table of every coefficient."""
    vehicle, ase = vehicle_and_prior()
    scores = {(plan, kind): Score() for plan in plans for kind in filters}
    for seed in range(seeds):
        world = make_world(ase, vehicle, seed)
        for (plan, kind), score in scores.items():
            judge(world, ase, vehicle, plan_named(plan), kind, score)
    return {
        f"{plan} {kind}": {
            "failed": score.failed,
            "claimed": summary(score.widened),
            "filter_own": summary(score.own),
        }
        for (plan, kind), score in scores.items()
    }


def vehicle_and_prior() -> tuple[Vehicle, AseResult]:
    """The vehicle of the samples and its estimate from geometry."""
    vehicle = load_vehicle(SAMPLES / "remus100.toml")
    return vehicle, estimate(vehicle, CRUISE_MPS)


def judge(
    world: World, ase: AseResult, vehicle: Vehicle, plan: Plan, kind: str, score: Score
) -> None:
    """Identify one trial and add its errors to the score."""
    try:
        model = identify(
            [world.trial], world.maneuvers, ase, vehicle, NOISE, plan=plan, filter=kind
        ).model
    except NumericsError:
        score.failed += 1
        return
    for c in model.coefficients:
        if c.origin == "identified" and c.data_share > SEEN:
            score.add("widened", c.symbol, (c.value - world.truth[c.symbol]) / c.std)
            own = getattr(c, "std_filter", None) or c.std
            score.add("own", c.symbol, (c.value - world.truth[c.symbol]) / own)
    for z, widened in combinations(model, world.truth):
        score.add("widened" if widened else "own", "combinations", z)


def combinations(model, truth: dict[str, float]):
    """Errors along what the data told best, over the posterior's claim about it.

    Eigenvectors of the posterior in units of the prior, with a share of the data above `SEEN`;
    what the plan allows beside coefficients is left free.
    """
    rows = {c.symbol: c for c in model.coefficients}
    kept = [i for i, s in enumerate(model.covariance["symbols"]) if s in rows]
    symbols = [model.covariance["symbols"][i] for i in kept]
    prior = np.array([rows[s].prior_std for s in symbols])
    error = np.array([rows[s].value - truth[s] for s in symbols]) / prior
    claimed = np.array(model.covariance["matrix"])[np.ix_(kept, kept)] / np.outer(prior, prior)
    shrink = np.array([(rows[s].std_filter or rows[s].std) / rows[s].std for s in symbols])
    for widened, matrix in ((True, claimed), (False, claimed * np.outer(shrink, shrink))):
        values, vectors = np.linalg.eigh(matrix)
        for value, vector in zip(values, vectors.T, strict=True):
            if value < 1.0 - SEEN:
                yield float(vector @ error / np.sqrt(value)), widened


def summary(errors: dict[str, list[float]]) -> dict[str, dict[str, Any]]:
    """Number, mean, mean square with its chi-square band, and coverage, by name and in all."""
    rows = dict(sorted(errors.items()))
    single = [z for name, values in rows.items() if name != "combinations" for z in values]
    return {name: _row(values) for name, values in {**rows, "all coefficients": single}.items()}


def _row(values: list[float]) -> dict[str, Any]:
    z, n = np.array(values), max(len(values), 1)
    low, high = chi2.ppf([0.025, 0.975], n) / n
    return {
        "n": len(z),
        "mean": float(z.mean()) if len(z) else 0.0,
        "mean_square": float(np.mean(z**2)) if len(z) else 0.0,
        "low": float(low),
        "high": float(high),
        "coverage": float(np.mean(np.abs(z) < NORMAL_95)) if len(z) else 0.0,
    }


def in_short(found: dict[str, Any]) -> list[dict[str, Any]]:
    """One row for every plan and filter, from the result of `recovery`."""
    return [_in_short(case, scores["failed"], scores["claimed"]) for case, scores in found.items()]


def _in_short(case: str, failed: int, claimed: dict[str, dict[str, Any]]) -> dict[str, Any]:
    single = [r["coverage"] for name, r in claimed.items() if name not in SUMS]
    every, along = (claimed.get(name, {}) for name in reversed(SUMS))
    return {
        "plan and filter": case,
        "failed": failed,
        "mean square, coefficients": every.get("mean_square", "-"),
        "95 % covers": _percent(every.get("coverage")),
        "of single ones": f"{100 * min(single):.1f} to {_percent(max(single))}" if single else "-",
        "mean square, combinations": along.get("mean_square", "-"),
        "95 % covers (combinations)": _percent(along.get("coverage")),
    }


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"
