"""How the time and memory of the stages grow with the number of maneuvers.

The logs are of six maneuvers each, and of each the same two are held out: left to itself the
program holds out a larger share of few maneuvers. More of them show more, so that the search may
take another round: the time of `diagnose` is given by round, and by second of what identifies as
well. An exponent of 1 is growth in step with the maneuvers.
"""

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from tests.engines.chain import SAMPLES

VEHICLE, SEED = "remus100", 1001  # a seed of development
KINDS = {"straights": 2, "turns": 4, "zigzags_10": 3, "zigzags_20": 3}  # twelve maneuvers
SIX = {"straights": 1, "turns": 2, "zigzags_10": 2, "zigzags_20": 1}
HELD_OUT = ("turn-1", "zigzag-1")  # of each log
LOGS = (1, 4, 16)
STAGES_TOLD = ("ingest", "segment", "identify", "diagnose", "refine")
GROWING = ("ingest_s", "segment_s", "identify_s", "diagnose_a_round_s", "refine_s")
# In a process of its own, as the peak of memory is that of a process. Seconds of the processor:
# those of a clock depend on what else the machine does.
STAGES = """
import json, resource, sys, time
from itertools import pairwise
from pathlib import Path
from auvident.pipeline import run_stage
from auvident.pipeline.observer import Observer
import auvident.stages.ingest, auvident.stages.segment, auvident.storage.log_csv, scipy.linalg
held, (run, vehicle, *logs) = sys.argv[1].split(","), (Path(a) for a in sys.argv[2:])
options = {
    "ingest": {"logs": tuple(logs), "vehicle": vehicle},
    "segment": {"hold_out": tuple(f"{log.name}-{which}" for log in logs for which in held)},
}
spent = {}
for stage in ("ingest", "segment", "ase", "identify", "diagnose", "refine"):
    start = time.process_time()
    run_stage(stage, run, options.get(stage), observer=Observer())
    spent[stage] = time.process_time() - start
spent["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps(spent))
"""


def length(repeats: int = 3, logs: Sequence[int] = LOGS) -> dict[str, list[dict[str, Any]]]:
    """Medians for so many logs of six maneuvers each, and exponents between them."""
    with tempfile.TemporaryDirectory(prefix="auvident-length-") as name:
        rows = [_one(Path(name), n, repeats) for n in logs]
    return {"stages by number of maneuvers": rows, "exponents": exponents(rows)}


def exponents(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Growth of each stage from one number of maneuvers to the next, and over all."""
    pairs = [*pairwise(rows), (rows[0], rows[-1])]
    return [
        {
            "maneuvers": f"{one['maneuvers']} to {other['maneuvers']}",
            **{
                key.removesuffix("_s"): round(
                    math.log(other[key] / one[key])
                    / math.log(other["maneuvers"] / one["maneuvers"]),
                    2,
                )
                for key in GROWING
            },
        }
        for one, other in pairs
    ]


def _one(folder: Path, count: int, repeats: int) -> dict[str, Any]:
    logs = [folder / f"log{count}-{k}" for k in range(count)]
    seconds = sum(_sail(log, SEED + k) for k, log in enumerate(logs))
    runs = [_run(logs, folder / f"run{count}-{k}") for k in range(repeats)]
    first = folder / f"run{count}-0"
    maneuvers = json.loads((first / "segment/maneuvers.json").read_text())
    used = [m["t_end_s"] - m["t_start_s"] for m in maneuvers if m["role"] == "identify"]
    rounds = 1 + len(json.loads((first / "diagnose/diagnosis.json").read_text())["steps"])
    spent = {f"{stage}_s": median(r[stage] for r in runs) for stage in STAGES_TOLD}
    return {
        "maneuvers": len(maneuvers),
        "log_s": seconds,
        "identifying_s": sum(used),
        "rounds": rounds,
        **spent,
        "diagnose_a_round_s": spent["diagnose_s"] / rounds,
        "diagnose_ms_by_round_and_s": 1000.0 * spent["diagnose_s"] / (rounds * sum(used)),
        "peak_mb": median(r["peak_mb"] for r in runs),
    }


def _sail(log: Path, seed: int) -> float:
    """One trial of six maneuvers (the generator ends a trial after 2100 s); its seconds."""
    if str(SAMPLES) not in sys.path:
        sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    recipe = {"name": log.name, "vehicle": VEHICLE, "seed": seed, "schedule": SIX}
    return float(generate(recipe, log)["duration_s"])


def _run(logs: Sequence[Path], run: Path) -> dict[str, float]:
    held = ",".join(HELD_OUT)
    arguments = [sys.executable, "-c", STAGES, held, run, SAMPLES / f"{VEHICLE}.toml", *logs]
    done = subprocess.run([str(a) for a in arguments], check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found
