"""What many trials take: measured on a few, calculated for many (``tests.bench campaign-cost``).

Some trials of a season are run one by one as a user would, and as a campaign; processor time,
bytes of logs, of run directories and of what pooling reads are measured. Pooling is measured with
as many trials as a vehicle is taken to have: models of these trials with coefficients drawn anew
from their own claims, and apart from these the maneuvers of the trials predicted again. What 10^4
and 10^6 trials take is calculated from that.
"""

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from auvident.engines.carried import internal_values
from auvident.pipeline.campaign import CampaignPlan, arguments_of, run_campaign
from auvident.pipeline.observer import Observer
from auvident.pipeline.pooling import pool_runs
from auvident.pipeline.predict import find_model
from auvident.pipeline.replays import replay_behind
from auvident.pipeline.warming import warm_for_runs
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.pool.again import ROUNDS
from auvident.storage.artifacts import read_model
from auvident.storage.campaign_file import PlannedTrial, read_campaign
from tests.bench.season import made
from tests.command_line import ENVIRONMENT

TRIALS, SEED = 4, 0
A_VEHICLE = 200  # trials of a vehicle, in what is calculated
MANY = (100, 10_000, 1_000_000)
CORES = (2, 64, 1000)
HOUR_PRICE, GB_MONTH_PRICE = 0.04, 0.023  # of a rented processor; of storage, in dollars
MIB, GB, HOUR = 2.0**20, 1e9, 3600.0
Rows = list[dict[str, Any]]


def campaign_cost(trials: int = TRIALS) -> dict[str, Rows]:
    """Parts as measured, and what follows from them."""
    with tempfile.TemporaryDirectory(prefix="auvident-cost-") as name:
        folder = Path(name)
        made(folder, trials, SEED, steady=True)
        _, planned = read_campaign(folder / "campaign.toml")
        warm_for_runs(Observer())
        parts = measured(folder, planned)
    return {
        "a trial, measured": [{k: _rounded(v) for k, v in parts.items()}],
        "calculated from that": [calculated(parts, count) for count in MANY],
    }


def measured(folder: Path, planned: Sequence[PlannedTrial]) -> dict[str, float]:
    """Means over the trials."""
    count = len(planned)
    single_s = _of_children(
        lambda: [_alone(t, folder / "alone" / t.vehicle / t.name) for t in planned]
    )
    plan = CampaignPlan(folder / "out", planned)
    own_s = -process_time()
    campaign_s = _of_children(lambda: run_campaign(plan, Observer()))
    own_s += process_time()
    again_s = -process_time()
    done = run_campaign(plan, Observer())
    again_s += process_time()
    if not all(t.state == "up to date" for t in done.result.trials):
        raise RuntimeError(f"not all trials ended well: {done.result.trials}")
    runs = [plan.run_of(t) for t in planned]
    models = [find_model(run)[0] for run in runs]
    return {
        "minutes": sum(_minutes(t.log) for t in planned) / count,
        "alone s": single_s / count,
        "in a campaign s": (campaign_s + own_s) / count,
        "over alone": (campaign_s + own_s) / single_s,
        "found up to date s": again_s / count,
        "log MiB": sum(_bytes(t.log) for t in planned) / count / MIB,
        "run directory MiB": sum(_bytes(run) for run in runs) / count / MIB,
        "model KiB": sum(p.stat().st_size for p in models) / count / 1024.0,
        "maneuvers MiB": sum(_bytes(run / "ingest") for run in runs) / count / MIB,
        f"pooling {A_VEHICLE} s": pooling_s(models[0], folder / "drawn", A_VEHICLE),
        f"predicting {A_VEHICLE} again s": A_VEHICLE * ROUNDS * again_of_one_s(models),
    }


def _alone(trial: PlannedTrial, run: Path) -> None:
    """As a command, with the threads that it takes by itself."""
    words = [sys.executable, "-m", "auvident", *arguments_of(trial, run, False)]
    subprocess.run(words, env=ENVIRONMENT, check=True, capture_output=True)


def _of_children(work: Callable[[], Any]) -> float:
    """Processor time of the processes that some work starts and waits for."""

    def now() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before = now()
    work()
    return now() - before


def _minutes(log: Path) -> float:
    """How long a trial lasts, by its gyro."""
    time_s = [float(line.partition(",")[0]) for line in (log / "gyro.csv").open() if line[0] != "t"]
    return (time_s[-1] - time_s[0]) / 60.0


def _bytes(place: Path) -> int:
    return sum(p.stat().st_size for p in place.rglob("*") if p.is_file())


def pooling_s(model: Path, folder: Path, count: int) -> float:
    """Processor time of pooling, its search for changes included."""
    files = list(drawn(model, folder, count))
    start = process_time()
    pool_runs(files)
    return process_time() - start


def again_of_one_s(models: Sequence[Path]) -> float:
    """Processor time in which the maneuvers of a trial are read and predicted once, in the mean."""
    start = process_time()
    for file in models:
        model = read_model(file, IdentifiedModel, "")
        found = replay_behind(file, model)
        if found is None:
            raise RuntimeError(f"{file}: its maneuvers are not there")
        told = model.covariance
        values = {**model.values(), **internal_values(model.effects)}
        common = {s: values[s] for s in told["symbols"] if "." not in s}
        scale = dict(zip(told["symbols"], told["scale"], strict=True))
        found.about(common, np.array([scale[s] for s in common]))
    return (process_time() - start) / len(models)


def drawn(model: Path, folder: Path, count: int) -> Iterator[Path]:
    """Models of as many trials, each coefficient drawn from what this one claims."""
    rng = np.random.default_rng(SEED)
    for k in range(count):
        tree = json.loads(model.read_text(encoding="utf-8"))
        for row in tree["coefficients"]:
            row["value"] += row["std"] * float(rng.standard_normal())
        file = folder / f"trial-{k:03}" / "model.json"
        file.parent.mkdir(parents=True)
        file.write_text(json.dumps(tree), encoding="utf-8")
        yield file


def calculated(parts: dict[str, float], count: int) -> dict[str, Any]:
    """What so many trials take, of vehicles with `A_VEHICLE` trials each."""
    vehicles = max(count / A_VEHICLE, 1.0)
    share = min(count / A_VEHICLE, 1.0)
    of_one = parts[f"pooling {A_VEHICLE} s"] + parts[f"predicting {A_VEHICLE} again s"]
    pooling = vehicles * share * of_one
    hours = (count * parts["in a campaign s"] + pooling) / HOUR
    logs, runs = (count * parts[k] * MIB / GB for k in ("log MiB", "run directory MiB"))
    return {
        "trials": f"{count:,}",
        "processor hours": _rounded(hours),
        **{f"h on {cores}": _rounded(hours / cores) for cores in CORES},
        "of it pooling h": _rounded(pooling / HOUR),
        "logs GB, read": _rounded(logs),
        "runs GB, written": _rounded(runs),
        "read to pool GB": _rounded(count * _read_to_pool(parts) / GB),
        "dollars, compute": _rounded(hours * HOUR_PRICE),
        "dollars a month, storage": _rounded((logs + runs) * GB_MONTH_PRICE),
    }


def _read_to_pool(parts: dict[str, float]) -> float:
    """Bytes of a trial: its model, and its maneuvers in every round."""
    return parts["model KiB"] * 1024.0 + ROUNDS * parts["maneuvers MiB"] * MIB


def _rounded(value: float) -> str:
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"
