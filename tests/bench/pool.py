"""Are the claims of a pooled model true? (``tests.bench pool``)

Trials of one vehicle, drawn from the prior, by equations of their own (`tests.bench.world`); each
trial flies a part of the programme. They are identified one by one and pooled. ``--rate 20`` has
rows, and with them steps of the equations, of half the length: what the integration leaves out is
one error of all trials.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from auvident.estimation.pooling import seen_axes
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.identify import Replay, identify, replay_in
from auvident.stages.pool import PoolTrial, pool
from auvident.stages.pool.carry import carrier
from auvident.stages.pool.collect import collect
from tests.bench.recovery import NOISE, SEEN, vehicle_and_prior
from tests.bench.world import PROGRAMME, RATE_HZ, World, draw_truth, make_world
from tests.engines.chain import plan_named

PART = 6  # maneuvers of the programme that a trial flies, a straight run among them


def main(arguments: list[str], show: Callable[[str, list[dict[str, Any]]], None]) -> None:
    """Identify, pool, compare and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench pool", description=__doc__)
    parser.add_argument("--vehicles", type=int, default=30)
    parser.add_argument("--trials", type=int, default=8)
    parser.add_argument("--models-alone", action="store_true", help="without maneuvers")
    parser.add_argument("--rate", type=float, default=RATE_HZ, help="rows a second")
    options = parser.parse_args(arguments)
    rows, shares = [], []
    for seed in range(options.vehicles):
        truth, trials = trials_of_one(seed, options.trials, rate_hz=options.rate)
        if options.models_alone:
            trials = [replace(t, replay=None) for t in trials]
        for count in (1, 2, 4, options.trials):
            if count <= len(trials):
                rows += list(errors(trials[:count], truth))
                shares.append({"trials": count, **seen(trials[:count])})
    show("error over claimed standard deviation", summary(rows))
    show("coefficients that the data tell", _mean_by_count(shares))


def trials_of_one(
    seed: int, count: int, part: int = PART, plan: str = "refined", rate_hz: float = RATE_HZ
) -> tuple[dict[str, float], list[PoolTrial]]:
    """So many trials of one vehicle with their models and maneuvers, and the truth."""
    vehicle, ase = vehicle_and_prior()
    truth = draw_truth(ase, vehicle, np.random.default_rng(seed))
    worlds = [world_of(truth, 1000 * seed + k, part, rate_hz) for k in range(count)]
    done = (
        identify([w.trial], w.maneuvers, ase, vehicle, NOISE, plan=plan_named(plan)) for w in worlds
    )
    pairs = enumerate(zip(worlds, (found.model for found in done), strict=True))
    return truth, [PoolTrial(f"trial-{k}", m, replay=loading(w, m)) for k, (w, m) in pairs]


def loading(world: World, model: IdentifiedModel) -> Callable[[], Replay | None]:
    """How the maneuvers of a trial are loaded."""
    return partial(replay_in, [world.trial], world.maneuvers, model)


def world_of(
    truth: dict[str, float], seed: int, part: int = PART, rate_hz: float = RATE_HZ
) -> World:
    """One trial of a vehicle: a straight run and some other maneuvers of the programme."""
    vehicle, ase = vehicle_and_prior()
    rng = np.random.default_rng([seed, 1])
    others = rng.choice(np.arange(2, len(PROGRAMME)), part - 1, replace=False)
    chosen = [PROGRAMME[int(rng.integers(2))], *(PROGRAMME[i] for i in np.sort(others))]
    return make_world(ase, vehicle, seed, chosen, truth, rate_hz)


def pooled_of(trials: list[PoolTrial]) -> IdentifiedModel:
    """The pooled model of some trials, none of them left out."""
    return pool(trials).model


def errors(trials: list[PoolTrial], truth: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Errors over claims, of coefficients and along what the data told best."""
    found = pooled_of(trials)
    for c in found.coefficients:
        if c.origin == "identified" and c.data_share > SEEN:
            z = (c.value - truth[c.symbol]) / c.std
            yield {"trials": len(trials), "of": "coefficients", "z": z}
    for z in along_seen(trials, truth):
        yield {"trials": len(trials), "of": "combinations", "z": z}


def along_seen(given: list[PoolTrial], truth: dict[str, float]) -> list[float]:
    """Errors over claims of the data alone, along what they see about the true coefficients."""
    data = collect(given)
    pairs = zip(data.names, data.origin, data.unit, strict=True)
    theta = np.array([(truth.get(name, 0.0) - origin) / unit for name, origin, unit in pairs])
    trials = carrier(data)(theta)
    information = sum(t.information for t in trials)
    axes = seen_axes(information)
    return list(axes.T @ (sum(t.score for t in trials) - information @ theta))


def seen(trials: list[PoolTrial]) -> dict[str, float]:
    """Coefficients that rest on the data: of a trial in the mean, of all together."""
    alone = [sum(c.data_share > 0.5 for c in t.model.coefficients) for t in trials]
    together = sum(c.data_share > 0.5 for c in pooled_of(trials).coefficients)
    return {"in one trial": float(np.mean(alone)), "pooled": float(together)}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean square and coverage by number of trials."""
    groups = dict.fromkeys((r["trials"], r["of"]) for r in rows)
    found = []
    for count, kind in groups:
        z = np.array([r["z"] for r in rows if (r["trials"], r["of"]) == (count, kind)])
        found.append(
            {
                "trials": count,
                "of": kind,
                "n": len(z),
                "mean square": float(np.mean(z**2)),
                "95 % covers": f"{100.0 * np.mean(np.abs(z) < 1.96):.1f} %",
            }
        )
    return found


def _mean_by_count(rows: list[dict[str, float]]) -> list[dict[str, Any]]:
    counts = dict.fromkeys(r["trials"] for r in rows)
    return [
        {k: float(np.mean([r[k] for r in rows if r["trials"] == count])) for k in rows[0]}
        for count in counts
    ]


__all__ = ["main", "pooled_of", "trials_of_one", "world_of"]
