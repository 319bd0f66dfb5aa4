"""Are changes of a vehicle found, and no others? (``tests.bench season``)

A season from the generator (`sample_logs/seatrial/season`), run as a campaign. Bent fin, fouling
and new thruster are looked for among the changes of their vehicle; every other change is a false
alarm, as is every change of a season in which nothing happens (``--steady``). The trial under the
wrong name and the bad logs are looked for among the trials that failed or fit no other.
``--left-out`` has each trial of a steady season predicted by the model of all others of its
vehicle, beside its own fit; and by one that has seen even what the trial held out. Of a season with
changes it has some of the trials since them predicted so.
"""

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np

from auvident.pipeline.campaign import CampaignPlan, run_campaign
from auvident.pipeline.left_out_runs import left_out_errors
from auvident.pipeline.observer import Observer
from auvident.pipeline.pooling import pool_runs, pool_trial
from auvident.pipeline.warming import warm_for_runs
from auvident.schema.campaign import CampaignResult
from auvident.schema.changes import LeftOutTrialError
from auvident.stages.pool import pool
from auvident.storage.campaign_file import read_campaign
from tests.bench import written
from tests.bench.effects import program
from tests.bench.seen import errors_having_seen
from tests.bench.totals import true_rates
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

WORSE = 0.1  # an error that is larger by no more than this share is told as well
BY_CHANCE = 0.05  # probability of so much larger an error by chance below which it is worse
WITHIN = 3  # trials: so near to the true one a step counts as found
# what happens, and the changes that tell of it: drag and thrust are known by their ratio best
TELLS = {
    "bent fin": {"fin", "Y_uud", "N_uud"},
    "fouling": {"drag", "X_uu", "linear_drag.X_u", "thrust", "T_nn", "T_nu"},
    "new thruster": {"thrust", "T_nn", "T_nu", "drag", "X_uu", "linear_drag.X_u"},
}
MOST_SINCE = 6  # trials since a change that are predicted, evenly among them
AHEAD_MPS = 1.5  # at which drag is compared
TRIAL_SEEDS = 10_000  # of a season are so many times its own, and more
# a fault that a trial names among its effects, and is pooled without
EFFECTS_OF = {"gyro scale": "gyro_scale"}


class _Told(Observer):
    def note(self, text: str) -> None:
        print(text, file=sys.stderr)


def main(arguments: list[str], show: Callable[[str, list[dict[str, Any]]], None]) -> None:
    """Make a season, run it, judge it and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench season", description=__doc__)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--steady", action="store_true", help="nothing happens")
    parser.add_argument("--long", action="store_true", help="trials of 25 minutes in place of 15")
    parser.add_argument("--write", action="store_true", help="replace the section of the page")
    parser.add_argument("--left-out", action="store_true", help="trials left out in turn")
    parser.add_argument("--folder", type=Path, help="keep it here, and go on where it was")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="auvident-season-") as name:
        folder = options.folder or Path(name)
        made(folder, options.trials, options.seed, options.steady, options.long)
        _, trials = read_campaign(folder / "campaign.toml")
        plan = CampaignPlan(folder / "out", trials, options.jobs)
        done = run_campaign(plan, _Told(), warm=warm_for_runs)
        if options.left_out and options.steady:
            found, section = left_out_and_seen(folder / "out"), "left-out-trials"
        else:
            truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
            found = judged(done.result, truth)
            if options.left_out:
                found |= since_change(folder / "out", truth)
            section = "season-steady" if options.steady else "season"
        for title, rows in found.items():
            show(title, rows)
        if options.write:
            seed = f"Program `{program()}`; {options.trials} trials, seed {options.seed}."
            written.write(section, seed, {title: rows for title, rows in found.items() if rows})


def made(folder: Path, trials: int, seed: int, steady: bool, long: bool = False) -> None:
    """The season in a folder, unless it is there."""
    from seatrial.season import BOATS, LONG_SCHEDULE, SCHEDULE, STEADY, season

    if not (folder / "truth.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        schedule = LONG_SCHEDULE if long else SCHEDULE
        season(folder, trials, seed, STEADY if steady else BOATS, not steady, schedule)


def left_out_and_seen(out: Path) -> dict[str, list[dict[str, Any]]]:
    """Errors of trials left out in turn; and what no model of all trials could do better."""
    left: list[LeftOutTrialError] = []
    seen: list[LeftOutTrialError] = []
    for vehicle in (place for place in sorted(out.iterdir()) if place.is_dir()):
        runs = sorted(place.parent for place in vehicle.glob("*/run.json"))
        for target in runs:
            model = pool_runs([run for run in runs if run != target]).model
            left += left_out_errors(model, [target])
            seen += errors_having_seen(runs, target)
    return {
        "held-out errors of trials left out in turn": against_own(left),
        "the same where the pooled model has seen what was held out": against_own(seen),
    }


def against_own(errors: Sequence[LeftOutTrialError]) -> list[dict[str, Any]]:
    """By channel: in how many trials all predict as well as its own fit, and how well."""
    rows = []
    for channel in dict.fromkeys(e.channel for e in errors):
        own = [e for e in errors if e.channel == channel]
        ratios = [e.pooled / e.own for e in own]
        rows.append(
            {
                "channel": channel,
                "trials": len(own),
                "not worse": f"{mean(r <= 1.0 for r in ratios):.0%}",
                f"by {WORSE:.0%} at most": f"{mean(r <= 1.0 + WORSE for r in ratios):.0%}",
                "not worse but by chance": f"{mean(e.p >= BY_CHANCE for e in own):.0%}",
                "median of pooled over own": median(ratios),
                "rms pooled": root_mean_square([e.pooled for e in own]),
                "rms own": root_mean_square([e.own for e in own]),
                "unit": own[0].unit,
            }
        )
    return rows


def since_change(out: Path, truth: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Held-out errors of trials since a change, of a slow one of the last, left out in turn."""
    spoilt = {tuple(key) for key in truth["faults"].values()}
    rows = []
    for name in (n for n, v in truth.items() if n != "faults" and v["happening"]):
        names = [t["trial"] for t in truth[name]["trials"] if (name, t["trial"]) not in spoilt]
        runs = [out / name / trial for trial in names]
        first = truth[name]["first"] or names[-1]
        since = [run for run in runs if run.name >= first]
        chosen = since[:: math.ceil(len(since) / MOST_SINCE)]
        errors = [_beside_own(runs, run) for run in chosen]
        rows += [by_change(name, channel, errors) for channel in errors[0]]
    return {"held-out errors of trials since the change, left out in turn": rows}


def _beside_own(runs: Sequence[Path], target: Path) -> dict[str, tuple[float, float]]:
    """By channel, over the trial's own: errors by the model of all others, and as of one vehicle.

    That is what they are if what changed is not seen to.
    """
    others = [run for run in runs if run != target]
    alike = pool([pool_trial(run, None, run.name) for run in others]).model
    both = (pool_runs(others).model, alike)
    now, one = (left_out_errors(model, [target]) for model in both)
    return {a.channel: (a.pooled / a.own, b.pooled / b.own) for a, b in zip(now, one, strict=True)}


def by_change(
    name: str, channel: str, errors: Sequence[dict[str, tuple[float, float]]]
) -> dict[str, Any]:
    """Errors over the trial's own, by the model of all others and by that of one vehicle."""
    now, one = zip(*(e[channel] for e in errors), strict=True)
    return {
        "vehicle": name,
        "channel": channel,
        "trials": len(errors),
        "median of pooled over own": median(now),
        "largest": max(now),
        "median, changes ignored": median(one),
    }


def root_mean_square(values: Sequence[float]) -> float:
    """Of some errors."""
    return math.sqrt(mean(value**2 for value in values))


def judged(result: CampaignResult, truth: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """What happened beside what was said; trials that were spoilt beside what became of them."""
    faults = truth.get("faults", {})
    told = [v for v in result.vehicles if not v.second or (v.changes and v.changes.changes)]
    changes = [_of_vehicle(v, truth[v.name]) for v in told]
    rows = {(t.vehicle, t.trial): t for t in result.trials}
    spoilt = []
    for kind, key in faults.items():
        t = rows[tuple(key)]
        is_named = EFFECTS_OF.get(kind) in t.effects
        named = t.state == "failed" or not t.pooled or is_named
        why = t.problem or t.reason or ", ".join(t.effects) * is_named
        why = why.replace(f"{t.log}/", "").replace(f"{t.log}: ", "")
        spoilt.append({"fault": kind, "trial": "/".join(key), "named": named, "why": why[:60]})
    own = {tuple(key) for key in faults.values()}
    others = [t for key, t in rows.items() if key not in own and not t.pooled]
    lost = [{"trial": f"{t.vehicle}/{t.trial}", "why": t.problem or t.reason} for t in others]
    counts = [{"trials": len(rows), "spoilt": len(own), "left out beside these": len(others)}]
    return {"changes": changes, "spoilt trials": spoilt, "trials": counts, "others left out": lost}


def _of_vehicle(vehicle: Any, truth: dict[str, Any]) -> dict[str, Any]:
    """Whether what happened is among the changes, with which size; what else is told."""
    told = vehicle.changes.changes if vehicle.changes else ()
    names = [t["trial"] for t in truth["trials"]]
    right = [c for c in told if _tells(c, truth, names)]
    size = f"{right[0].size:+.3f} ({right[0].low:+.3f} to {right[0].high:+.3f})" if right else "-"
    return {
        "vehicle": vehicle.name,
        "happened": truth["happening"] or "nothing",
        "size": truth["size"],
        "in the model": f"{in_model(vehicle.name, truth):+.3f}" if truth["happening"] else "-",
        "since": truth["first"] or "-",
        "found": "; ".join(c.sentence for c in right) or "-",
        "found size": size,
        "other changes": "; ".join(c.sentence for c in told if c not in right) or "-",
    }


def in_model(name: str, truth: dict[str, Any]) -> float:
    """Size of what happened in the terms of the model.

    The thrust of a propeller has a part that falls with the square of the speed. The model has it
    in its drag, and nothing fouls it.
    """
    if truth["happening"] != "fouling":
        return -float(truth["size"])
    before, after = (_drag(name, truth, share) for share in (0.0, 1.0))
    return after / before - 1.0


def _drag(name: str, truth: dict[str, Any], share: float) -> float:
    """Acceleration against a vehicle ahead that no rate of the propeller has a part in."""
    from seatrial.season import BOATS, changed_plant, plant_of
    from seatrial.vehicles import build_body, load_vehicle

    (boat,) = (b for b in BOATS if b.name == name)
    plant = changed_plant(plant_of(boat, truth["trials"][0]["seed"] // TRIAL_SEEDS), boat, share)
    body = build_body(load_vehicle(boat.table).file, plant)
    revs = np.array([0.8, 1.0, 1.2]) * plant.cruise_rpm / 60.0
    rates = [true_rates(body, np.array([AHEAD_MPS, 0.0, 0.0]), 0.0, n)[0] for n in revs]
    return float(np.polyfit(revs, rates, 2)[-1])


def _tells(change: Any, truth: dict[str, Any], names: list[str]) -> bool:
    """Whether a change tells what happened, in time."""
    if truth["happening"] not in TELLS:
        return False
    if not {change.what, *change.symbols} & TELLS[truth["happening"]]:
        return False
    if truth["happening"] == "fouling":
        return True
    return abs(names.index(change.trial) - names.index(truth["first"])) <= WITHIN
