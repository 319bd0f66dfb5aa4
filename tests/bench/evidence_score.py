"""What the evidence of many trials is worth: thresholds, false names, power. Pure functions.

A trial names the first candidate, largest gain first, that meets the rules which are common to all
kinds of evidence and exceeds the threshold of the kind, or of both of a pair. A threshold is the
least that names something false in at most `FALSE` of the trials without a listed effect, in one of
them where they are few.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import kstest

from auvident.schema.effects import BY_ID
from auvident.schema.likeness import partners
from auvident.stages.diagnose.score.left_out import clipped, explained_share, t_value
from auvident.stages.diagnose.select.rules import (
    CHECK_GAIN,
    LEAST_EXPLAINED,
    LEAST_GAIN,
    LEAST_SHARE,
    LEAST_T,
    OF_BEST,
    suffices,
)

Array = npt.NDArray[Any]
Row = Mapping[str, Any]
Table = list[dict[str, Any]]
Kind = Callable[[Row], float]

FALSE = 0.03
INDIFFERENT = 10.0  # [nats] as in `left_out`
FLIPS = 9999  # of signs; among 28 effects the least p is then 0.003
SHARES = (0.2, 0.3, 0.4)  # second thresholds of pairs


def blocks(row: Row) -> Array:
    """Gains of all blocks left out [nats]."""
    return np.concatenate([clipped(np.array(b)) for b in row["blocks_own"]])


def over_maneuvers(row: Row) -> float:
    """Mean gain of the maneuvers left out over its standard error."""
    sums = np.array([clipped(np.array(b)).sum() for b in row["blocks_own"]])
    error = float(sums.std(ddof=1) / len(sums) ** 0.5) if len(sums) > 1 else 0.0
    return with_sensors(float(sums.mean() / error) if error > 0.0 else 0.0, row)


def over_blocks(row: Row) -> float:
    """Gain of the blocks left out over its standard error."""
    return with_sensors(t_value(blocks(row)), row)


def with_sensors(t: float, row: Row) -> float:
    """What sensors say of each other, in standard errors, where that says more."""
    gained = row["checks"][0] - row["checks"][1]
    return max(t, (2.0 * gained) ** 0.5) if gained >= CHECK_GAIN else t


def share(row: Row) -> float:
    """Share of the power above the noise of the sensors that is explained where left out."""
    before, after = (np.array(p).sum(axis=0)[None] for p in row["power_own"])
    std = np.minimum(row["sensor_std"], row["noise"][1][:3])
    found = explained_share(before, after, np.array(row["readings"]) * std**2)
    old, new = row["checks"]
    return max(found, 1.0 - new / old) if old - new >= CHECK_GAIN else found


def wald(by: str) -> Kind:
    """Root of the robust Wald statistic by parameter."""
    return lambda row: ((row["wald"][by] or 0.0) / row["parameters"]) ** 0.5


KINDS: dict[str, Kind] = {
    "gain, nats": lambda row: row["gain"],
    "t over maneuvers left out": over_maneuvers,
    "t over blocks left out": over_blocks,
    "-log10 of the chance of the best": lambda row: -float(np.log10(row["chance"])),
    "robust Wald by maneuver": wald("maneuver"),
    "robust Wald by block": wald("block"),
    "fall of the rms": lambda row: max(row["falls"].values()),
    "explained share": share,
}
PAIRED = (
    "gain, nats",
    "t over blocks left out",
    "-log10 of the chance of the best",
    "robust Wald by block",
)


def chances(rows: Sequence[Row], draws: int = FLIPS) -> list[float]:
    """How often the best of all candidates tried would help as much with signs drawn.

    One statistic for observed and drawn, the signs of a block the same for all candidates: the
    step-down family of Westfall and Young (1993) without its steps.
    """
    if not rows:
        return []
    gains = np.array([blocks(row) for row in rows])
    norm = np.maximum(np.sqrt(np.sum(gains**2, axis=1)), 1e-9)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(draws, gains.shape[1]))
    best = ((signs @ gains.T) / norm).max(axis=1)
    return [float((1 + np.sum(best >= t - 1e-12)) / (1 + draws)) for t in gains.sum(axis=1) / norm]


def with_chances(trial: Row) -> dict[str, Any]:
    """A trial with the chance of each of its candidates."""
    rows = sorted(trial.get("candidates", ()), key=lambda row: -row["gain"])
    told = zip(rows, chances(rows), strict=True)
    return {**trial, "candidates": [{**row, "chance": p} for row, p in told]}


def eligible(row: Row) -> bool:
    """Whether a candidate meets what is asked for besides evidence."""
    sums = np.array([clipped(np.array(b)).sum() for b in row["blocks_own"]])
    told = sums[np.abs(sums) > INDIFFERENT]
    helps = max(np.mean(sums > 0.0), np.mean(told > 0.0) if len(told) else 0.0)
    sensed = row["checks"][0] - row["checks"][1] >= CHECK_GAIN
    large = row["size"] >= 1.0 and row["gain"] >= max(OF_BEST * row["by_others"], LEAST_GAIN)
    return bool(large and not row.get("impossible") and (sensed or helps >= LEAST_SHARE))


def named(trial: Row, asked: Sequence[tuple[Kind, float]]) -> Row | None:
    """The candidate that a trial names with some thresholds."""
    for row in trial["candidates"]:
        if eligible(row) and all(kind(row) >= threshold for kind, threshold in asked):
            return dict(row)
    return None


def what_is(trial: Row, row: Row | None) -> str:
    """Is a name ``right``, of a group with a planted effect (``alike``), ``own``, ``false``?"""
    if row is None:
        return "none"
    planted = [p for p in trial["case"]["planted"] if p in BY_ID]
    if row["id"] in planted:
        return "right"
    if any(row["id"] in partners(p) for p in planted):
        return "alike"
    return "own" if trial.get("own", {}).get(row["id"], {}).get("visible") else "false"


def is_empty(trial: Row) -> bool:
    """Whether a trial has nothing that is listed, so that every name in it is false."""
    return bool(trial["case"]["kind"] in ("none", "outside"))


def shows(trial: Row) -> bool:
    """Whether a planted effect is visible that a search can name."""
    return any(
        told["visible"] and name in BY_ID and BY_ID[name].enters != "disturbance"
        for name, told in trial.get("visible", {}).items()
    )


def outcome_of(trials: Sequence[Row], asked: Sequence[tuple[Kind, float]]) -> dict[str, Any]:
    """False names of the empty trials, and what is found of the visible planted effects."""
    empty, full = [t for t in trials if is_empty(t)], [t for t in trials if shows(t)]
    wrong = [what_is(t, named(t, asked)) for t in empty].count("false")
    said = [what_is(t, named(t, asked)) for t in full]
    return {
        "empty": len(empty),
        "false": wrong,
        "visible": len(full),
        "right": said.count("right"),
        "right or alike": said.count("right") + said.count("alike"),
        "wrong": said.count("false"),
    }


def least(trials: Sequence[Row], kind: Kind, beside: Sequence[tuple[Kind, float]] = ()) -> float:
    """Least threshold of a kind with which few enough empty trials name something false."""
    empty = [t for t in trials if is_empty(t)]
    values = sorted({kind(row) for t in empty for row in t["candidates"] if eligible(row)})
    allowed = max(1, round(FALSE * len(empty)))
    for threshold in [0.0, *(v * 1.0001 + 1e-9 for v in values)]:
        asked = [(kind, threshold), *beside]
        if [what_is(t, named(t, asked)) for t in empty].count("false") <= allowed:
            return threshold
    return float("inf")


def tables(outcomes: Sequence[Row]) -> dict[str, Table]:
    """Everything that is printed, in order."""
    trials = [with_chances(o) for o in outcomes if not o.get("error") and "candidates" in o]
    if not trials:
        return {}
    return {
        "evidence by kind": [single_row(trials, name) for name in KINDS],
        "with the explained share": [
            pair_row(trials, name, second) for name, second in product(PAIRED, SHARES)
        ],
        "by the rules as they are": [{"rules": n, **f(trials)} for n, f in RULES.items()],
        "chance in clean trials": uniform(trials),
    }


def single_row(trials: Sequence[Row], name: str) -> dict[str, Any]:
    """One kind alone at its least threshold."""
    threshold = least(trials, KINDS[name])
    return {
        "evidence": name,
        "threshold": threshold,
        **outcome_of(trials, [(KINDS[name], threshold)]),
    }


def pair_row(trials: Sequence[Row], name: str, second: float) -> dict[str, Any]:
    """One kind at its least threshold beside one of the explained share."""
    threshold = least(trials, KINDS[name], [(share, second)])
    asked = [(KINDS[name], threshold), (share, second)]
    return {
        "evidence": name,
        "threshold": threshold,
        "share": second,
        **outcome_of(trials, asked),
    }


def before(trials: Sequence[Row]) -> dict[str, Any]:
    """A gain of 100 nats and a fall of some channel by 20 %, as it was."""
    return outcome_of(trials, [(KINDS["gain, nats"], 100.0), (KINDS["fall of the rms"], 0.2)])


def now(trials: Sequence[Row]) -> dict[str, Any]:
    """The rules of the search."""
    return outcome_of(trials, [(standard_errors, LEAST_T), (share, LEAST_EXPLAINED)])


def standard_errors(row: Row) -> float:
    """As the search counts them: what explains nearly everything has more than enough."""
    t = over_blocks(row)
    return float("inf") if suffices(share(row), t) else t


RULES: dict[str, Callable[[Sequence[Row]], dict[str, Any]]] = {
    "100 nats and a fall by 20 %": before,
    "standard errors and share of the search": now,
}


def uniform(trials: Sequence[Row]) -> Table:
    """Is the chance of the best candidate of clean trials uniform, or cautious?

    Of those that could be named and that the vehicle has not of itself; 1 where there is none.
    ``excess`` is how far the share of trials below some p exceeds that p at most (Kolmogorov and
    Smirnov, to the side that would be a false alarm); ``p`` is how often that much is chance.
    """
    clean = [t for t in trials if t["case"]["kind"] == "none"]
    ways: dict[str, Kind] = {
        "best of those measured, signs in common": lambda row: row["chance"],
        "of one, times all candidates": by_itself,
    }
    rows = []
    for name, chance in ways.items():
        values = [min((chance(row) for row in nameable(t)), default=1.0) for t in clean]
        if values:
            found = kstest(values, "uniform", alternative="greater")
            told = {"least": min(values), "excess": float(found.statistic)}
            rows.append({"chance": name, "trials": len(values), **told, "p": float(found.pvalue)})
    return rows


def nameable(trial: Row) -> list[Row]:
    """Candidates that would be a false name."""
    return [r for r in trial["candidates"] if eligible(r) and what_is(trial, r) == "false"]


def by_itself(row: Row) -> float:
    """Chance of one candidate, times the candidates that there are."""
    return min(1.0, row["among"] * chance_of(blocks(row), np.random.default_rng(0)))


def chance_of(gains: Array, rng: np.random.Generator, draws: int = FLIPS) -> float:
    """How often gains (n,) of blocks left out add up to as much with their signs drawn.

    An effect that means nothing changes what was left out for the worse as often as for the
    better. A randomisation test (Fisher 1935): the sum that is observed and the sums that are
    drawn are one statistic. What a parameter costs for nothing makes it cautious.

    Returns
    -------
    float
        1 / (1 + draws) at least.
    """
    signs = rng.choice([-1.0, 1.0], size=(draws, len(gains)))
    return float((1 + np.sum(signs @ gains >= gains.sum())) / (1 + draws))
