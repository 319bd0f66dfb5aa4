"""What a trial of a drawn vehicle says: pure functions from outcomes to scores and tables."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import mean, median
from typing import Any

from tests.bench.effects import GENERATOR
from tests.bench.effects_bars import rises_surely
from tests.bench.effects_score import Score, least_chance, most_strength, score, uniformity
from tests.bench.effects_summary import CHANCE

ALL = "all"
VELOCITIES = ("u", "v", "w", "q", "r")
# Of the power of what a part of the vehicle changes, the share that an effect as it is said has to
# make good to stand for it: so it has the right form, the right sign and about the right size.
STANDS_FOR = 0.5
BY_LIKELIHOOD = 10.0  # [nats] by chance so much comes of two parameters once in 20,000 trials
STATES = ("failed", "none", "own", "named", "unexplained")

Table = list[dict[str, Any]]
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Drawn:
    """Score of one trial.

    ``clean`` is one of `STATES` for a trial with nothing planted: the chain failed, nothing was
    named, only what the vehicle has of itself by the rule of visibility, something that it has
    not, or something without a name. ``shows``: every planted effect is visible by that rule.
    ``false``: names that are neither planted, nor alike to a planted one, nor the vehicle's own.
    The vehicle's own is what shows when it is taken away from the plant, linear damping where
    its share of the plant's damping is large (`population_trial._own`), and what stands for a part
    of the plant at the size that is said of it (`STANDS_FOR`); ``faint`` are those which only the
    last rule makes its own. ``zero_inside``: of each
    named effect with intervals, whether zero lies in all of them; ``ships_worse``: the refined
    model predicts the identifying maneuvers worse when they are left out, ``surely_worse``: by
    more than the standard error (None where nothing was refined). ``chance`` is the least ``p`` of
    the candidates that are large enough and that the vehicle has not of itself; 1 without any;
    ``strength`` the largest of the same. ``likelihood`` is the most that a candidate which the
    vehicle has not of itself gains where it was fitted [nats].
    ``broken``: of each model that was written, whether it breaks what physics knows (`physical`).
    """

    seed: int
    kind: str
    classes: tuple[str, ...]
    loop: Score
    failed_at: str
    error: str
    clean: str
    shows: bool | None
    own: tuple[str, ...]
    false: tuple[str, ...]
    faint: tuple[str, ...] = ()
    missed: tuple[Row, ...] = ()
    extra_maneuvers: int = 0
    true_maneuvers: int = 0
    refused: tuple[str, ...] = ()
    nrmse: dict[str, float] = field(default_factory=dict)
    nrmse_ase: dict[str, float] = field(default_factory=dict)
    coverage: dict[str, float] = field(default_factory=dict)
    size: dict[str, float] = field(default_factory=dict)
    zero_inside: tuple[bool, ...] = ()
    ships_worse: bool | None = None
    surely_worse: bool | None = None
    chance: float = 1.0
    strength: float = 0.0
    likelihood: float = 0.0
    broken: tuple[bool, ...] = ()


Scores = Sequence[Drawn]


def scored(outcome: Row) -> Drawn:
    """Score of one outcome."""
    loop, truth = score(outcome), outcome["truth"]
    plant, found = outcome.get("own") or {}, outcome.get("diagnosis") or {}
    sees = [n for n in plant if plant[n].get("visible")]
    shows = [n for n in loop.named if plant.get(n, {}).get("visible")]
    own = tuple(n for n in loop.named if n in shows or _stands(plant.get(n, {})))
    false = tuple(n for n in loop.extra if n not in own)
    segmentation = outcome.get("segmentation") or {}
    visible = outcome.get("visible") or {}
    planted = outcome["case"]["planted"]
    return Drawn(
        seed=outcome["case"]["seed"],
        kind=loop.kind,
        classes=tuple(truth.get("classes", ())),
        loop=loop,
        failed_at=outcome.get("stage", ""),
        error=last_line(outcome.get("error", "")),
        clean=clean_state(loop, bool(outcome.get("error")), own, false),
        shows=all(visible.get(n, {}).get("visible") for n in planted) if planted else None,
        own=own,
        false=false,
        faint=tuple(n for n in own if n not in shows),
        missed=tuple(segmentation.get("missed", ())),
        extra_maneuvers=len(segmentation.get("extra", ())),
        true_maneuvers=sum(segmentation.get("true", {}).values()),
        refused=tuple(truth.get("refused", ())),
        nrmse=outcome.get("nrmse", {}),
        nrmse_ase=outcome.get("nrmse_ase", {}),
        coverage=outcome.get("coverage", {}),
        size=truth.get("size", {}),
        zero_inside=zero_inside(outcome.get("comparison") or {}),
        ships_worse=worse_by(outcome.get("comparison") or {}, errors=0.0),
        surely_worse=worse_by(outcome.get("comparison") or {}, errors=1.0),
        broken=tuple(bool(what) for what in outcome.get("broken", {}).values()),
        chance=least_chance(found, sees),
        strength=most_strength(found, sees),
        likelihood=max(
            (c["gain"] for c in found.get("candidates", ()) if c["id"] not in sees), default=0.0
        ),
    )


def _stands(own: Row) -> bool:
    explained = own.get("explained")
    return explained is not None and explained >= STANDS_FOR


def zero_inside(comparison: Row) -> tuple[bool, ...]:
    """Of each effect named in the end: whether zero lies in the intervals of all its sizes."""
    found = []
    for effect in comparison.get("effects", []):
        spans = [p["interval"] for p in effect["parameters"] if p.get("interval")]
        if spans:
            found.append(all(low <= 0.0 <= high for low, high in spans))
    return tuple(found)


def worse_by(comparison: Row, errors: float) -> bool | None:
    """Whether the attempt taken leaves larger errors of maneuvers left out than the old model.

    By more than so many standard errors; None where the old model stays, or none can be left out.
    """
    for attempt in comparison.get("attempts", []):
        if attempt["taken"] and attempt["effects"] and attempt.get("balance") is not None:
            return bool(attempt["balance"] > errors * attempt["balance_se"])
    return None


def last_line(error: str | None) -> str:
    """What an error says; of a traceback, its last line."""
    lines = (error or "").strip().splitlines()
    return lines[-1] if lines else ""


def clean_state(loop: Score, failed: bool, own: Sequence[str], false: Sequence[str]) -> str:
    """One of `STATES`, as if nothing had been planted."""
    if failed or loop.verdict == "failed":
        return "failed"
    if false:
        return "named"
    if own:
        return "own"
    return "none" if loop.verdict == "none_found" else "unexplained"


def by_class(scores: Scores, classes: Iterable[str]) -> dict[str, list[Drawn]]:
    """All trials, and those of each class."""
    found = {ALL: list(scores)}
    for name in classes:
        found[name] = [s for s in scores if name in s.classes]
    return {name: rows for name, rows in found.items() if rows}


def tables(
    scores: Scores, classes: Iterable[str], with_seeds: bool, whole: bool = True
) -> dict[str, Table]:
    """Everything that is printed, in order; single trials only where they may be looked at.

    Of a chain that was not run to its end (`whole` is false) there are the maneuvers alone. What
    the generator could not sail is no trial.
    """
    lost = [s for s in scores if s.failed_at == GENERATOR]
    scores = [s for s in scores if s.failed_at != GENERATOR]
    groups = by_class(scores, classes)
    found = loop_tables(groups, scores) if whole else {}
    found["maneuvers and failures"] = [{"class": n, **chain_row(g)} for n, g in groups.items()]
    found["why maneuvers were missed"] = counted(w for s in scores for w in missed_reasons(s))
    found["could not be sailed"] = counted(s.error for s in lost)
    found["refused draws"] = counted(reason for s in scores for reason in s.refused)
    if with_seeds:
        wrong = [s for s in scores if (is_wrong(s) if whole else s.failed_at or s.missed)]
        found["trials that went wrong"] = [wrong_row(s) for s in wrong]
    return found


def loop_tables(groups: Mapping[str, Scores], scores: Scores) -> dict[str, Table]:
    """What was named and how well the models predict."""
    return {
        "nothing planted": [{"class": n, **clean_row(rows)} for n, rows in groups.items()],
        CHANCE: [{"class": n, **chance_row(rows)} for n, rows in groups.items()],
        "planted": [{"class": n, **planted_row(rows)} for n, rows in groups.items()],
        "prediction": [{"class": n, **prediction_row(rows)} for n, rows in groups.items()],
        "named and not there": counted(name for s in scores for name in s.false),
    }


def clean_row(rows: Scores) -> dict[str, Any]:
    """Counts of the states of the trials with nothing planted."""
    states = Counter(s.clean for s in rows if s.kind == "none")
    return {"n": states.total(), **{state: states[state] for state in STATES}}


def chance_row(rows: Scores) -> dict[str, Any]:
    """Whether `least_chance` is uniform, or cautious; see `effects_score.uniformity`.

    The last column is why no chance could be uniform by likelihood: how many of the trials have a
    candidate that gains more than `BY_LIKELIHOOD`, though nothing is planted.
    """
    clean = [s for s in rows if s.kind == "none" and s.clean != "failed"]
    gains = {f"gain > {BY_LIKELIHOOD:g} nats": sum(s.likelihood > BY_LIKELIHOOD for s in clean)}
    return uniformity([s.chance for s in clean]) | gains


def planted_row(rows: Scores) -> dict[str, Any]:
    """Counts of the trials with one or two effects that show, and of those outside the table.

    ``seen``: of these, above the size that the program itself says it would see; an effect that
    shows and is not seen is taken up by coefficients.
    """
    told = [s for s in rows if s.kind in ("single", "pair") and s.clean != "failed"]
    shown, hidden = [s for s in told if s.shows], [s for s in told if not s.shows]
    seen = [s for s in shown if s.loop.visible]
    sizes = [z.inside for s in shown for z in s.loop.sizes if z.inside is not None]
    outside = [s for s in rows if s.kind == "outside" and s.clean != "failed"]
    return {
        "shown": len(shown),
        "declared": sum(s.loop.declared for s in shown),
        "id or group": sum(s.loop.right_or_group or s.loop.by_finding for s in shown),
        "seen": len(seen),
        "seen, id or group": sum(s.loop.right_or_group or s.loop.by_finding for s in seen),
        "wrong": sum(is_wrong_name(s) for s in shown),
        "false beside": sum(bool(s.false) and s.loop.right_or_group for s in shown),
        "hidden": len(hidden),
        "hidden wrong": sum(is_wrong_name(s) for s in hidden),
        "outside": len(outside),
        "confident": sum(s.loop.confident and bool(s.false) for s in outside),
        "size in 95": f"{sum(sizes)}/{len(sizes)}",
    }


def is_wrong_name(s: Drawn) -> bool:
    """Whether something is named, nothing of a planted family, and not the vehicle's own."""
    return s.loop.wrong_name and bool(s.false)


def prediction_row(rows: Scores) -> dict[str, Any]:
    """Held-out errors: over their spread, against the ASE, after over before; rises; coverage.

    Of the coverage the mean over the trials: it is a share of samples, and none exceeds one, so
    that a median would hide the trials in which the band is too narrow.
    """
    refined = [s for s in rows if s.loop.held_out]
    named = [s for s in refined if s.loop.named]
    found: dict[str, Any] = {"n": len(refined)}
    channels = channels_of(rows)
    for channel in channels:
        found[f"nrmse {channel}"] = _median(s.nrmse[channel] for s in rows if channel in s.nrmse)
    worse = [s for s in rows if any(_exceeds(s, c) for c in s.nrmse_ase)]
    found["worse than ase"] = len(worse)
    found["ratio if named"] = _median(worst_ratio(s) for s in named)
    found["rises surely"] = sum(rises_surely(s.loop) for s in refined)
    for channel in channels:
        told = [s.coverage[channel] for s in rows if channel in s.coverage]
        found[f"cover {channel}"] = mean(told) if told else "-"
    return found


def _exceeds(s: Drawn, channel: str) -> bool:
    """Whether a model predicts worse than the estimate; it may run away where that does not."""
    return s.nrmse.get(channel, math.inf) > s.nrmse_ase[channel]


def channels_of(rows: Scores) -> list[str]:
    """Velocities and rates that a model of the plane predicts."""
    found = {c for s in rows for c in s.nrmse}
    return [c for c in VELOCITIES if c in found] or list("uvr")


def worst_ratio(s: Drawn) -> float:
    """Held-out error after over before of the velocity or rate that changes most."""
    pairs = [s.loop.held_out[c] for c in VELOCITIES if c in s.loop.held_out]
    ratios = [after / before for before, after in pairs if before > 0.0] or [1.0]
    return max(ratios, key=lambda x: abs(x - 1.0))


def chain_row(rows: Scores) -> dict[str, Any]:
    """Maneuvers found and missed, and where the chain ended."""
    missed = Counter(m["kind"] for s in rows for m in s.missed)
    ended = Counter(s.failed_at for s in rows if s.failed_at)
    return {
        "trials": len(rows),
        "maneuvers": sum(s.true_maneuvers for s in rows),
        "missed": ", ".join(f"{k} {n}" for k, n in missed.most_common()) or "-",
        "invented": sum(s.extra_maneuvers for s in rows),
        "failed at": ", ".join(f"{k} {n}" for k, n in ended.most_common()) or "-",
    }


def missed_reasons(s: Drawn) -> list[str]:
    """Reasons of the missed maneuvers, without their numbers."""
    found = []
    for maneuver in s.missed:
        reasons = {why.split(":")[1].strip() if ":" in why else why for why in maneuver["why"]}
        kind = maneuver["kind"]
        if maneuver.get("about", "amidships") != "amidships":
            kind = f"{kind} about an elevator {maneuver['about']}"
        if maneuver.get("other", 1.0) != 1.0:
            kind = f"{kind} of unequal executes"
        found += [f"{kind}: {r}" for r in sorted(reasons) or ["nothing said"]]
    return found


def is_wrong(s: Drawn) -> bool:
    """Whether a trial is worth a look."""
    if s.clean == "failed" or s.missed or rises_surely(s.loop):
        return True
    if s.kind == "none":
        return s.clean not in ("none", "own")
    if s.kind == "outside":
        return s.loop.confident and bool(s.false)
    lost = bool(s.shows) and not (s.loop.right_or_group or s.loop.by_finding)
    return lost or bool(s.false) or any(z.inside is False for z in s.loop.sizes)


def wrong_row(s: Drawn) -> dict[str, Any]:
    """One trial that went wrong, with its seed."""
    ends = [f"{k} {v:g}" for k, v in s.size.items()]
    return {
        "seed": s.seed,
        "classes": ", ".join(s.classes),
        "planted": s.loop.label if s.shows is not False else f"{s.loop.label} (hidden)",
        "verdict": s.loop.verdict,
        "named": " ".join(s.loop.named) or "-",
        "false": " ".join(s.false) or "-",
        "missed": " ".join(m["kind"] for m in s.missed) or "-",
        "error": f"{s.failed_at}: {s.error}" if s.failed_at else "-",
        "size": ", ".join(ends),
    }


def counted(words: Iterable[str]) -> Table:
    """Words with their counts, most frequent first."""
    return [{"what": word, "n": n} for word, n in Counter(words).most_common()]


def _median(values: Iterable[float]) -> float | str:
    values = list(values)
    return median(values) if values else "-"
