"""One trial of a drawn vehicle: sail it, run the program's stages, keep what they say."""

import cmath
import json
import math
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd

from auvident.errors import AuvidentError
from auvident.pipeline import run_stage
from tests.bench.effects import GENERATOR
from tests.bench.effects_score import EVENT
from tests.bench.effects_trial import (
    COMPARISON,
    DIAGNOSIS,
    WANTED,
    Clock,
    artifact,
    identifying,
)
from tests.bench.effects_truth import planted_of
from tests.bench.physical import broken_in
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

PASSED = "passed"  # in place of a stage, where a trial is none of those that are looked at
LONGEST_S = 1500  # of one trial; a program that has not ended by then has failed
WAITING = 10  # a machine that does other work as well is no hang
OVERLAP = 0.5  # of the true maneuver, from which a found one of its kind is that maneuver
LINEAR_DAMPING, DEPTH_STEP = "linear_damping", "depth_step"
TURNED_RAD = 0.35  # 20 degrees
HEADING = 11  # column of the generator's record
CHANNELS = {
    "horizontal": {"u": "u_mps", "v": "v_mps", "r": "r_radps"},
    "vertical": {"u": "u_mps", "w": "w_mps", "q": "q_radps"},
}

Outcome = dict[str, Any]
Rows = list[dict[str, Any]]


def outcome(
    seed: int,
    short: bool = True,
    until: str = WANTED[-1],
    plane: str = "horizontal",
    planted: tuple[str, ...] | None = None,
    shown: tuple[str, ...] = (),
    times: float = 1.0,
    run: Callable[..., Any] = run_stage,
) -> Outcome:
    """What the program says of a trial; a refusal is an outcome, and so is a bug.

    With `until` the chain ends behind that stage, and the effects are not looked at. `planted`
    takes the place of what is drawn. Of `shown` kinds the program sees those trials alone in which
    all that is planted shows by the rule of the generator; the others are `PASSED`. What is planted
    has so many `times` its usual size.
    """
    from seatrial.population import draw, kind_of

    key = key_of(seed, short, until, plane, planted, shown, times)
    began, found = perf_counter(), _case(seed, key, "none", ())
    if shown and kind_of(seed, planted, plane) not in shown:
        return {**found, "stage": PASSED}
    with tempfile.TemporaryDirectory(prefix="auvident-population-") as name:
        folder = Path(name)
        try:
            drawn = draw(seed, short, planted, plane=plane, times=times)
            found = _case(seed, key, drawn.kind, tuple(drawn.planted))
            sailed = drawn.sail()
            judged = _judged_by_rule(drawn, sailed) if shown or until == WANTED[-1] else {}
            if shown and not all(v["visible"] for v in judged["visible"].values()):
                return {**found, "stage": PASSED}
            drawn.write(sailed, folder / "trial", folder / "vehicle.toml")
            truth = drawn.truth(sailed)
            planted = [asdict(p) for p in planted_of(truth, drawn.vehicle)]
            if "attitude" in drawn.equipment.missing:
                planted = [from_the_bow(p, float(sailed.record[0, HEADING])) for p in planted]
            found["truth"] = {**truth, "planted": planted}
            found |= judged
            if judged:
                found["truth"]["planted"] = [_with_size(p, found["sudden"]) for p in planted]
        except Exception:
            return {**found, "stage": GENERATOR, "error": traceback.format_exc()}
        found["generator_s"] = round(perf_counter() - began, 1)
        found |= chain(folder, run, until, plane)
        found["segmentation"] = segmentation(folder / "run", truth, plane)
        found["own"] = _own(drawn, sailed, found)
        found["broken"] = broken_in(folder / "run")
    return found


def from_the_bow(planted: Mapping[str, Any], heading_rad: float) -> dict[str, Any]:
    """Directions from the bow at the start of a log without a heading, as the program has them."""
    told = dict(planted["parameters"])
    for name in [name for name in told if name.startswith("north")]:
        east = name.replace("north", "east", 1)
        along = complex(told[name], told[east]) * cmath.exp(-1j * heading_rad)
        told[name], told[east] = along.real, along.imag
    return {**planted, "parameters": told}


def key_of(
    seed: int,
    short: bool,
    until: str,
    plane: str = "horizontal",
    planted: tuple[str, ...] | None = None,
    shown: tuple[str, ...] = (),
    times: float = 1.0,
) -> str:
    """Name of a trial in the file of outcomes."""
    ways = {plane: plane != "horizontal", "long": not short, until: until != WANTED[-1]}
    ways |= {"clean": planted == (), **{f"shown-{kind}": True for kind in shown}}
    ways |= {f"{times:g}-times": times != 1.0}
    return "-".join([str(seed), *(way for way, told in ways.items() if told), *(planted or ())])


def _case(seed: int, key: str, kind: str, planted: tuple[str, ...]) -> Outcome:
    case = {"key": key, "seed": seed, "vehicle": "drawn", "kind": kind, "planted": list(planted)}
    return {"case": case, "truth": {"planted": []}}


def _judged_by_rule(drawn: Any, sailed: Any) -> Outcome:
    from seatrial.population.visible import sudden, visibility

    return {"visible": visibility(drawn, sailed), "sudden": sudden(drawn, sailed)}


def _with_size(planted: Outcome, sudden: Mapping[str, float]) -> Outcome:
    """A push with the changes that it makes, by the symbols and in the units of `sees`."""
    if planted["id"] != EVENT:
        return planted
    told = {name.replace("radps", "degps"): size for name, size in sudden.items()}
    told |= {name: math.degrees(size) for name, size in told.items() if name.endswith("degps")}
    return {**planted, "parameters": {**planted["parameters"], **told}}


def _own(drawn: Any, sailed: Any, found: Outcome) -> Outcome:
    """Named effects that were not planted: does the vehicle have them of itself?

    Linear damping is judged by the plant: a hull with more than `LINEAR_SHARE` of its damping
    in sway or yaw in proportion to the velocity has it, whether or not it is visible.
    """
    from seatrial.population.drawn import LINEAR_SHARE
    from seatrial.population.visible import own_effects

    named = {
        e["id"]: {p["symbol"]: p["value"] for p in e["parameters"]}
        for part in ("diagnosis", "comparison")
        for e in _effects(found.get(part))
        if e["id"] not in drawn.planted
    }
    own: Outcome = own_effects(drawn, sailed, named)
    share = max(drawn.damping_shares(0))
    if LINEAR_DAMPING in own and share > LINEAR_SHARE:
        own[LINEAR_DAMPING] = {**own[LINEAR_DAMPING], "visible": True, "share": share}
    return own


def _effects(content: Outcome | None) -> Rows:
    return (content or {}).get("effects", [])


def chain(
    folder: Path,
    run: Callable[..., Any] = run_stage,
    until: str = WANTED[-1],
    plane: str = "horizontal",
) -> Outcome:
    """Run the stages up to one of them; where one fails: which, with what message and code."""
    clock, directory, stage = Clock(), folder / "run", ""
    options: Outcome = {"ingest": {"logs": (folder / "trial",), "vehicle": folder / "vehicle.toml"}}
    if plane != "horizontal":
        options["identify"] = {"plane": plane}
    found: Outcome = {}
    alarm(LONGEST_S)
    try:
        for stage in WANTED[: WANTED.index(until) + 1]:
            run(stage, directory, options.get(stage), observer=clock)
    except AuvidentError as error:
        found = {"stage": stage, "exit_code": error.exit_code}
        found["error"] = f"{error.problem} ({error.where.replace(str(folder), '')})"
    except Exception:
        found = {"stage": stage, "error": traceback.format_exc().replace(str(folder), "")}
    finally:
        alarm(0)
    found |= {Path(path).stem: artifact(directory, path) for path in (DIAGNOSIS, COMPARISON)}
    found |= held_out(directory, CHANNELS[plane])
    return {**found, "identifying_s": identifying(directory), "seconds": clock.seconds}


def alarm(seconds: int) -> None:
    """Stop whatever runs after so many seconds of the processor; zero takes it back.

    What waits for ever takes none: by the clock it has `WAITING` times as long.
    """

    def late(*_: Any) -> None:
        raise TimeoutError(f"not done in {seconds} s")

    signal.signal(signal.SIGPROF, late)
    signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.alarm(WAITING * seconds)


def segmentation(directory: Path, truth: Mapping[str, Any], plane: str = "horizontal") -> Outcome:
    """True maneuvers found and missed, by kind, and maneuvers found where there was none.

    Straight runs with thrust steps are of either plane. Depths also change on the way back from a
    zigzag: a depth step that is found there is not invented, unless the vehicle turns in it. In a
    trial of the horizontal plane every vertical maneuver is.
    """
    path = directory / "segment/maneuvers.json"
    found = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    found = [{**m, "kind": _kind_of(m)} for m in found]
    rows = [m for m in found if m["kind"] == "straight" or _plane_of(m) == plane]
    rejected = directory / "segment/rejected.json"
    why = json.loads(rejected.read_text(encoding="utf-8")) if rejected.is_file() else {}
    true = [m for m in truth["maneuvers"] if m["t_end_s"] > m["t_start_s"]]
    missed = [m for m in true if not any(_is_same(m, row) for row in rows)]
    extra = [row for row in rows if not any(_touches(m, row) for m in true)]
    extra = [row for row in extra if row["kind"] != DEPTH_STEP]
    extra += [m for m in found if m not in rows and plane == "horizontal"]
    extra += [row for row in rows if row["kind"] == DEPTH_STEP and _turned(directory, row)]
    return {
        "true": _counted(m["kind"] for m in true),
        "missed": [{**m, "why": _reasons(m, why.get("rejected", []))} for m in missed],
        "extra": [{k: m[k] for k in ("kind", "t_start_s", "t_end_s")} for m in extra],
        "roles": _counted(f"{m['role']} {m['kind']}" for m in rows),
    }


def _turned(directory: Path, row: Mapping[str, Any]) -> bool:
    """Whether the course changes in a maneuver."""
    path = directory / "ingest/trial.parquet"
    if not path.is_file():
        return False
    table = pd.read_parquet(path, columns=["time_s", "r_radps"])
    during = table[table["time_s"].between(row["t_start_s"], row["t_end_s"])]
    turned = float(during["r_radps"].mean()) * (row["t_end_s"] - row["t_start_s"])
    return abs(turned) > TURNED_RAD


def _plane_of(maneuver: Mapping[str, Any]) -> str:
    return str(maneuver.get("features", {}).get("plane") or "horizontal")


def _kind_of(maneuver: Mapping[str, Any]) -> str:
    """Its kind as the generator names it: depth steps are straight runs of the vertical plane."""
    steps = maneuver["kind"] == "straight" and _plane_of(maneuver) == "vertical"
    return DEPTH_STEP if steps else str(maneuver["kind"])


def _overlap_s(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    first = max(one["t_start_s"], other["t_start_s"])
    return float(min(one["t_end_s"], other["t_end_s"]) - first)


def _is_same(true: Mapping[str, Any], found: Mapping[str, Any]) -> bool:
    """Of a series of depth steps each one is a maneuver of its own: one will do."""
    of = found if true["kind"] == DEPTH_STEP else true
    length = of["t_end_s"] - of["t_start_s"]
    return bool(found["kind"] == true["kind"] and _overlap_s(true, found) >= OVERLAP * length)


def _touches(true: Mapping[str, Any], found: Mapping[str, Any]) -> bool:
    return found["kind"] == true["kind"] and _overlap_s(true, found) > 0.0


def _reasons(true: Mapping[str, Any], rejected: Iterable[Mapping[str, Any]]) -> list[str]:
    """What the program says of the candidates that it refused there."""
    near = [r for r in rejected if _overlap_s(true, r) > 0.0]
    return [f"{r['reason']}: {r['value']:.3g} against {r['threshold']:.3g}" for r in near]


def _counted(words: Iterable[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for word in words:
        found[word] = found.get(word, 0) + 1
    return found


def held_out(directory: Path, channels: Mapping[str, str] = CHANNELS["horizontal"]) -> Outcome:
    """Held-out errors over their spread, model and ASE, and coverage of the 95 % band if told."""
    path = directory / "validate/metrics.json"
    if not path.is_file():
        return {}
    metrics = json.loads(path.read_text(encoding="utf-8"))
    told = metrics.get("summary", {}).get("validate", {})
    ase = (metrics.get("ase") or {}).get("summary", {}).get("validate", {})
    cover = {c: row["covered"] for c, row in (metrics.get("coverage") or {}).items()}
    return {
        "nrmse": {c: told[c]["nrmse"] for c in channels if c in told},
        "nrmse_ase": {c: ase[c]["nrmse"] for c in channels if c in ase},
        "coverage": cover or band_coverage(directory / "validate/simulation.parquet", channels),
        "findings": [f["code"] for f in metrics.get("findings", [])],
    }


def band_coverage(
    path: Path, channels: Mapping[str, str] = CHANNELS["horizontal"]
) -> dict[str, float]:
    """Share of held-out samples between the ends of the band, where the simulation has one."""
    import pandas as pd

    if not path.is_file():
        return {}
    table = pd.read_parquet(path)
    table, found = table[table["role"] == "validate"], {}
    for channel, column in channels.items():
        low, high = f"{column}_lo", f"{column}_hi"
        if {low, high} <= set(table.columns):
            rows = table[[f"{column}_measured", low, high]].dropna().to_numpy()
            found[channel] = float(((rows[:, 0] >= rows[:, 1]) & (rows[:, 0] <= rows[:, 2])).mean())
    return found
