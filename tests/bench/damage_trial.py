"""One damaged trial: what the program says of it, kept as evidence that is judged afterwards."""

import json
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

from auvident.errors import AuvidentError
from auvident.pipeline import run_stage
from auvident.pipeline.given import Given
from auvident.report.check_words import coarse, left_open
from auvident.report.console import stage_report
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.logs import TrialQuality
from auvident.storage.run_directory import RunDirectory
from tests.bench.damage_score import difference
from tests.bench.effects_trial import WANTED
from tests.bench.population_trial import alarm
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

CLEAN = "clean"  # every sensor on board
AS_DRAWN = "as drawn"  # clean as well, with the sensors that the seed has drawn
LONGEST_S = 300  # processor time of the stages of one trial; what takes longer hangs
ARTIFACTS = (
    "ase/coefficients.json",
    "identify/model.json",
    "validate/metrics.json",
    "diagnose/diagnosis.json",
)
SHOWN_LETTERS = 40  # of a message, that show it to be in the terminal's summary
WIDTH = 400  # of the terminal: no message is broken

Evidence = dict[str, Any]


@dataclass(frozen=True)
class Base:
    """A clean trial on disk, and the run of the program on it."""

    place: tempfile.TemporaryDirectory[str]
    evidence: Evidence

    @property
    def folder(self) -> Path:
        """Trial, vehicle file and run directory."""
        return Path(self.place.name)


@lru_cache(maxsize=1)
def base(seed: int, until: str = "validate", name: str = CLEAN) -> Base:
    """The clean trial of a seed, in which nothing is planted."""
    from seatrial.population import draw

    place = tempfile.TemporaryDirectory(prefix="auvident-damage-")
    folder = Path(place.name)
    drawn = draw(seed, True, planted=())
    if name == CLEAN:
        drawn = replace(drawn, equipment=replace(drawn.equipment, missing=()))
    drawn.write(drawn.sail(), folder / "trial", folder / "vehicle.toml")
    evidence = chain(folder, [folder / "trial"], None, until)
    return Base(place, {"case": case_of(seed, name), **evidence})


def case_of(seed: int, *names: str) -> Evidence:
    """What is planted where."""
    return {"key": f"{seed}/{'+'.join(names)}", "seed": seed, "damage": list(names)}


def outcome(
    seed: int, names: tuple[str, ...], until: str = "validate", run: Callable[..., Any] = run_stage
) -> Evidence:
    """Evidence of a trial with some kinds of damage, or of the clean one."""
    from seatrial.damage import CASES, Log, damage

    found: Evidence = {"case": case_of(seed, *names)}
    as_sailed = names in ((CLEAN,), (AS_DRAWN,))
    try:
        clean = base(seed, until, *names) if as_sailed else base(seed, until)
    except FloatingPointError:  # a vehicle that was lost
        return {**found, "stage": "generator", "error": traceback.format_exc()}
    if as_sailed:
        return clean.evidence
    began = perf_counter()
    with tempfile.TemporaryDirectory(prefix="auvident-damaged-") as name:
        folder = Path(name)
        shutil.copytree(clean.folder / "trial", folder / "trial")
        shutil.copy(clean.folder / "vehicle.toml", folder / "vehicle.toml")
        log = Log(folder / "trial", folder / "vehicle.toml")
        try:
            damage(log, tuple(CASES[n] for n in names), seed)
        except Exception:
            return {**found, "stage": "generator", "error": traceback.format_exc()}
        found |= chain(folder, log.logs, log.map, until, run, clean) | {"lost": log.lost}
        if "error" not in clean.evidence and difference(found, clean.evidence)[0]:
            found["ratio"] = held_out_ratio(clean.folder / "run", folder / "run")
    return {**found, "took_s": round(perf_counter() - began, 1)}


def chain(
    folder: Path,
    logs: list[Path],
    column_map: Path | None,
    until: str,
    run: Callable[..., Any] = run_stage,
    clean: Base | None = None,
) -> Evidence:
    """Run the stages; a refusal, a bug and a hang are evidence as well.

    Where the ingested trial is that of the `clean` log to the last bit, so is all that follows.
    """
    options: Evidence = {"logs": tuple(logs), "vehicle": folder / "vehicle.toml"}
    options |= {} if column_map is None else {"map": column_map}
    found: Evidence = {}
    stage, shown, unchanged = "", "", False
    alarm(LONGEST_S)
    try:
        for stage in WANTED[: WANTED.index(until) + 1]:
            outputs = run(stage, folder / "run", options if stage == "ingest" else None)
            shown += _terminal(stage, outputs)
            unchanged = clean is not None and _is_same(clean.folder / "run", folder / "run")
            if unchanged:
                break
    except AuvidentError as error:
        found = {"stage": stage, "exit_code": error.exit_code, "remedy": error.remedy}
        found["error"] = f"{error.problem} ({error.where})".replace(str(folder), "")
    except Exception:
        found = {"stage": stage, "error": traceback.format_exc().replace(str(folder), "")}
    finally:
        alarm(0)
    found |= {"unchanged": unchanged, **evidence_of(folder / "run", shown)}
    if unchanged and clean is not None:
        found |= {key: clean.evidence[key] for key in ("coefficients", "maneuvers", "effects")}
    return found


def _is_same(clean: Path, damaged: Path) -> bool:
    """Whether trial and vehicle came out of the ingest alike."""
    names = [path.name for path in sorted((damaged / "ingest").glob("*.parquet"))]
    if names != [path.name for path in sorted((clean / "ingest").glob("*.parquet"))]:
        return False
    both = [
        [(run / "ingest" / n).read_bytes() for n in (*names, "vehicle.json")]
        for run in (clean, damaged)
    ]
    return both[0] == both[1] and _noise(clean) == _noise(damaged)


def _noise(run: Path) -> list[Any]:
    """Noise of every channel, which the identification takes from the quality report."""
    trials = (_json(run / "ingest/quality.json") or {}).get("trials", [])
    channels = [c for t in trials for s in t["sensors"] for c in s["channels"]]
    return [(c["column"], c["noise_std"]) for c in channels]


def _terminal(stage: str, outputs: Mapping[str, Any]) -> str:
    """What a stage shows, without spaces."""
    from rich.console import Console

    console = Console(width=WIDTH, color_system=None)
    with console.capture() as capture:
        for piece in stage_report(stage, outputs):
            console.print(piece)
    return _dense(capture.get())


def _dense(text: str) -> str:
    return "".join(text.split())


def evidence_of(run: Path, shown: str) -> Evidence:
    """Findings, checks, readings dropped and coefficients of a run directory."""
    quality = _json(run / "ingest/quality.json")
    model = _json(run / "identify/model.json")
    maneuvers = _json(run / "segment/maneuvers.json") or []
    trials = quality.get("trials", []) if quality else []
    tellings = [*_findings("ingest", quality or {}), *_set_aside(quality or {})]
    tellings += [*(f for t in trials for f in _of_trial(t))]
    for name in ARTIFACTS:
        tellings += _findings(name.partition("/")[0], _json(run / name) or {})
    for telling in tellings:
        telling["shown"] = _dense(telling["message"])[:SHOWN_LETTERS] in shown
    return {
        "told": tellings,
        "dropped": _dropped(trials),
        "gaps": {s["sensor"]: _gaps(s) for t in trials[:1] for s in t.get("sensors", [])},
        "maneuvers": len(maneuvers),
        "coefficients": _coefficients(model or {}),
        "effects": [
            e["id"] for e in (_json(run / "diagnose/diagnosis.json") or {}).get("effects", [])
        ],
    }


def _json(path: Path) -> Any:
    with suppress(FileNotFoundError):
        return json.loads(path.read_text(encoding="utf-8"))
    return None


def _findings(stage: str, content: Mapping[str, Any]) -> list[Evidence]:
    keys = ("code", "message", "where", "value")
    return [
        {
            "stage": stage,
            "kind": "finding",
            **{k: f.get(k) for k in keys},
            "where": f["where"] or "",
        }
        for f in content.get("findings", [])
    ]


def _set_aside(quality: Mapping[str, Any]) -> list[Evidence]:
    """Trials that were not used."""
    told = {"stage": "ingest", "kind": "finding", "code": "set_aside", "value": None}
    rows = quality.get("set_aside", [])
    return [{**told, "message": r["reason"], "where": r.get("where", "")} for r in rows]


def _of_trial(trial: Mapping[str, Any]) -> list[Evidence]:
    """Findings of a trial, contradictions, and checks that the first line leaves open."""
    read = TrialQuality.model_validate(trial)
    first, roughly = left_open([read]), coarse([read])
    told = []
    for c in read.checks_made:
        where = f"{c.what} against {c.against}"
        row = {"stage": "ingest", "code": c.name, "where": where, "value": c.value}
        if c.outcome == "contradicts":
            told.append({**row, "kind": "check", "message": c.message})
        elif c.outcome == "untested" and c.what in first:
            told.append({**row, "kind": "untested", "message": c.message})
        elif c.only and c.what in roughly:
            told.append({**row, "kind": "coarse", "message": c.only, "value": c.within})
    return [*_findings("ingest", trial), *told]


def _dropped(trials: list[Any]) -> dict[str, dict[str, int]]:
    """Readings dropped by sensor and reason: those of the channel that lost most."""
    found: dict[str, dict[str, int]] = {}
    for sensor in (s for t in trials[:1] for s in t.get("sensors", [])):
        counts = {reason: d["count"] for reason, d in sensor.get("dropped", {}).items()}
        for channel in sensor.get("channels", []):
            for reason, d in channel.get("dropped", {}).items():
                counts[reason] = max(counts.get(reason, 0), d["count"])
        found[sensor["sensor"]] = counts
    return found


def _gaps(sensor: Mapping[str, Any]) -> float:
    """Seconds of the longest gap of a sensor's channels, and how many there are."""
    channels = sensor.get("channels", [])
    return sum(c.get("gaps", 0) for c in channels) + max(
        (c.get("longest_gap_s", 0.0) for c in channels), default=0.0
    )


def _coefficients(model: Mapping[str, Any]) -> dict[str, list[float]]:
    """Value, standard deviation and share of the data, of what was identified."""
    return {
        c["symbol"]: [c["value"], c["std"], c["data_share"]]
        for c in model.get("coefficients", [])
        if c["origin"] == "identified"
    }


def held_out_ratio(clean: Path, damaged: Path) -> float | None:
    """Error of the damaged log's model over that of the clean log's, on what is held out there.

    The largest of u, v and r, all on the clean log.
    """
    from auvident.stages.validate import validate

    given = Given(RunDirectory(clean))
    rows = tuple(m for m in given.maneuvers.maneuvers if m.role == "validate")
    held_out = Maneuvers(maneuvers=rows)
    text = (damaged / "identify/model.json").read_text(encoding="utf-8")
    model = IdentifiedModel.model_validate_json(text)
    before = _json(clean / "validate/metrics.json")["summary"]["validate"]
    try:
        after = validate(given.trials, held_out, model, estimated=False).metrics.summary["validate"]
    except (AuvidentError, ValueError, KeyError):
        return None
    return max(after[c].rmse / before[c]["rmse"] for c in ("u", "v", "r") if c in after)
