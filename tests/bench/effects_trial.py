"""One trial of the study: sail it, run the program's stages, keep what they say."""

import json
import resource
import tempfile
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from auvident.errors import AuvidentError
from auvident.pipeline import STAGES, run_stage
from auvident.pipeline.observer import Observer
from tests.bench.effects_cases import SPREAD, Case
from tests.bench.effects_truth import planted_of
from tests.engines.chain import SAMPLES

WANTED = tuple(s.name for s in STAGES if s.name != "report" and not s.needs_both)
DIAGNOSIS, COMPARISON = "diagnose/diagnosis.json", "refine/comparison.json"
# Said twice or by maneuver, and long: not kept.
LEFT_OUT = {DIAGNOSIS: ("lookalikes",), COMPARISON: ("maneuvers", "candidates")}

Outcome = dict[str, Any]


class Clock(Observer):
    """Seconds of every stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def finished(self, stage: str, outputs: Mapping[str, Any], seconds: float) -> None:
        """Note the time of a stage."""
        self.seconds[stage] = round(seconds, 3)


def sail(case: Case, folder: Path) -> Outcome:
    """Write the log of a trial; returns its truth in the program's terms."""
    from seatrial.trial import generate, stream
    from seatrial.vehicles import load_vehicle

    truth = generate(case.recipe(), folder)
    vehicle = load_vehicle(case.vehicle, SPREAD, stream(case.seed, "spread"))
    return {
        "duration_s": truth["duration_s"],
        "planted": [asdict(p) for p in planted_of(truth, vehicle)],
    }


def outcome(case: Case, run: Callable[..., Any] = run_stage) -> Outcome:
    """What the program says of a trial; a refusal is an outcome, and so is a bug."""
    clock = Clock()
    found: Outcome = {"case": {"key": case.key, **asdict(case)}, "truth": {"planted": []}}
    with tempfile.TemporaryDirectory(prefix="auvident-effects-") as name:
        log, directory = Path(name) / "trial", Path(name) / "run"
        options = {"ingest": {"logs": (log,), "vehicle": SAMPLES / f"{case.vehicle}.toml"}}
        try:
            found["truth"] = sail(case, log)
            for stage in WANTED:
                run(stage, directory, options.get(stage), observer=clock)
        except AuvidentError as error:
            found["error"] = f"{error.problem} ({error.where})"
        except Exception:
            found["error"] = traceback.format_exc()
        found |= {Path(path).stem: artifact(directory, path) for path in LEFT_OUT}
        found["identifying_s"] = identifying(directory)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {**found, "seconds": clock.seconds, "peak_mb": round(peak, 1)}


def identifying(directory: Path) -> list[tuple[float, float]] | None:
    """Start and end of every maneuver that identifies; None where there was no segmentation."""
    path = directory / "segment/maneuvers.json"
    if not path.is_file():
        return None
    maneuvers = json.loads(path.read_text(encoding="utf-8"))
    return [(m["t_start_s"], m["t_end_s"]) for m in maneuvers if m["role"] == "identify"]


def artifact(directory: Path, name: str) -> Outcome | None:
    """An artifact without its long parts; None where it was not written."""
    path = directory / name
    if not path.is_file():
        return None
    content = json.loads(path.read_text(encoding="utf-8"))
    return {key: value for key, value in content.items() if key not in LEFT_OUT[name]}
