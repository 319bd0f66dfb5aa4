"""How the time and memory of `diagnose` and `refine` grow with the length of a trial.

A longer trial shows more, so that the search may take another round: the time of `diagnose` is
given by round and second of what identifies as well.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from tests.engines.chain import SAMPLES

VEHICLE, SEED = "remus100", 1001  # a seed of development
KINDS = {"straights": 2, "turns": 4, "zigzags_10": 3, "zigzags_20": 3}  # twelve maneuvers
TIMES = (1, 2, 4)
# In a process of its own, as the peak of memory is that of a process. Seconds of the processor:
# those of a clock depend on what else the machine does.
STAGES = """
import json, resource, sys, time
from pathlib import Path
from auvident.pipeline import run_stage
from auvident.pipeline.observer import Observer
run, vehicle, *logs = (Path(a) for a in sys.argv[1:])
first = {"logs": tuple(logs), "vehicle": vehicle}
spent = {}
for stage in ("ingest", "segment", "ase", "identify", "diagnose", "refine"):
    start = time.process_time()
    run_stage(stage, run, first if stage == "ingest" else None, observer=Observer())
    spent[stage] = time.process_time() - start
spent["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps(spent))
"""


def length(repeats: int = 3, times: Sequence[int] = TIMES) -> list[dict[str, Any]]:
    """Medians for one, two and four trials of about 12 maneuvers each."""
    with tempfile.TemporaryDirectory(prefix="auvident-length-") as name:
        return [_one(Path(name), n, repeats) for n in times]


def _one(folder: Path, times: int, repeats: int) -> dict[str, Any]:
    logs = [folder / f"log{times}-{k}" for k in range(times)]
    seconds = sum(_sail(log, SEED + k) for k, log in enumerate(logs))
    runs = [_run(logs, folder / f"run{times}-{k}") for k in range(repeats)]
    first = folder / f"run{times}-0"
    maneuvers = json.loads((first / "segment/maneuvers.json").read_text())
    used = [m["t_end_s"] - m["t_start_s"] for m in maneuvers if m["role"] == "identify"]
    rounds = 1 + len(json.loads((first / "diagnose/diagnosis.json").read_text())["steps"])
    spent = {stage: median(r[stage] for r in runs) for stage in ("diagnose", "refine")}
    return {
        "maneuvers": len(maneuvers),
        "log_s": seconds,
        "identifying_s": sum(used),
        "rounds": rounds,
        **{f"{stage}_s": value for stage, value in spent.items()},
        "diagnose_ms_by_round_and_s": 1000.0 * spent["diagnose"] / (rounds * sum(used)),
        "peak_mb": median(r["peak_mb"] for r in runs),
    }


def _sail(log: Path, seed: int) -> float:
    """One trial of twelve maneuvers (the generator ends a trial after 2100 s); its seconds."""
    if str(SAMPLES) not in sys.path:
        sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    recipe = {"name": log.name, "vehicle": VEHICLE, "seed": seed, "schedule": KINDS}
    return float(generate(recipe, log)["duration_s"])


def _run(logs: Sequence[Path], run: Path) -> dict[str, float]:
    arguments = [sys.executable, "-c", STAGES, run, SAMPLES / f"{VEHICLE}.toml", *logs]
    done = subprocess.run([str(a) for a in arguments], check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found
