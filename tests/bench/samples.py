"""Held-out errors of the sample trials and of the tanker: estimate, filters, and the loop."""

import json
import tempfile
from pathlib import Path
from typing import Any

from auvident.pipeline import STAGES, run_stage
from auvident.pipeline.observer import Observer
from auvident.schema.artifacts import ManeuverMetrics, Metrics
from tests.bench.floor import floor
from tests.bench.left_out import KVLCC2
from tests.engines.chain import SAMPLES, Chain, chain_of, plan_named, sample

CLEAN = {"harbour_trial": "horizontal", "sound_trial": "horizontal", "dive_trial": "vertical"}
CHANNELS = ("u", "v", "w", "r", "q", "pitch")
LOOP = {"bay_trial": "tern180", "harbour_trial": "remus100", "sound_trial": "tern180"}
LOOP_CHANNELS = ("u", "v", "r", "heading")
DIVES = {"dive_trial": "remus100", "shelf_trial": "tern180"}
DIVE_CHANNELS = ("u", "w", "q", "pitch")
FOUR = ("hsva_Z_10_05", "hsva_Z_15_01", "hsva_Z_20_10_P", "hsva_Z_35_05")
OVERSHOOTS = ("overshoot_1_deg", "overshoot_2_deg")

Rows = list[dict[str, Any]]


def held_out() -> Rows:
    """Pooled RMSE over standard deviation of the clean samples, by channel.

    The last column is what an exact model would leave (`tests.bench.floor`).
    """
    found = []
    for name, plane in CLEAN.items():
        ways = {f"identified ({kind})": ("refined", kind) for kind in ("ekf", "ukf")}
        metrics = _metrics(sample(name), plane, ways)
        least = _least(name, metrics["identified (ekf)"])
        found += [
            {"trial": name, **row, "exact model": least[row["channel"]]} for row in _errors(metrics)
        ]
    return found


def _least(name: str, metrics: Metrics) -> dict[str, float]:
    """Error of an exact model over the standard deviation of the channel."""
    held_out = {m.id for m in metrics.maneuvers if m.role == "validate"}
    maneuvers = [m for m in sample(name).maneuvers.maneuvers if m.id in held_out]
    found, said = floor(name, maneuvers), metrics.summary["validate"]
    return {c: rmse * e.nrmse / e.rmse for c, rmse in found.items() if (e := said.get(c))}


def _metrics(chain: Chain, plane: str, ways: dict[str, tuple[str, str]]) -> dict[str, Metrics]:
    """Errors of the models that some plans and filters end at, by the name of the way."""
    found = {}
    for name, (plan, kind) in ways.items():
        model = chain.identify(plane, kind, plan=plan_named(plan)).model
        found[name] = chain.validate(model).metrics
    return found


def _errors(metrics: dict[str, Metrics]) -> Rows:
    """Errors by channel: of what the identification starts from, and of each way."""
    prior = next(iter(metrics.values())).ase.summary["validate"]
    return [
        {
            "channel": channel,
            "starting values": prior[channel].nrmse,
            **{name: m.summary["validate"][channel].nrmse for name, m in metrics.items()},
        }
        for channel in CHANNELS
        if channel in prior
    ]


def tanker() -> dict[str, Rows]:
    """Four zigzags of the KVLCC2 from the other nine."""
    chain = chain_of([KVLCC2], KVLCC2 / "vehicle.toml", FOUR)
    ways = {"refined (ekf)": ("refined", "ekf"), "spiral (ekf)": ("spiral", "ekf")}
    metrics = _metrics(chain, "horizontal", ways)
    held_out = [m for m in metrics["refined (ekf)"].maneuvers if m.role == "validate"]
    return {
        "four zigzags from the other nine": _errors(metrics),
        "the same four as virtual tests": [_overshoots(m) for m in held_out],
        "the nine, each left out in turn, before and after `refine`": _crossed(
            _comparison(KVLCC2, KVLCC2 / "vehicle.toml", FOUR)
        ),
    }


def _overshoots(maneuver: ManeuverMetrics) -> dict[str, Any]:
    """Overshoot angles as measured, and where the model's own heading reverses the rudder."""
    told = maneuver.zigzag or {}
    ways = {way: told.get(way, {}) for way in ("measured", "virtual")}
    return {
        "zigzag": maneuver.trial,
        **{f"{key} {way}": v.get(key, "-") for key in OVERSHOOTS for way, v in ways.items()},
    }


def loop() -> dict[str, Rows]:
    """Verdict of each trial, and its held-out errors before and after `refine`."""
    found = [_closed(SAMPLES / n, SAMPLES / f"{v}.toml") for n, v in LOOP.items()]
    dives = [_closed(SAMPLES / n, SAMPLES / f"{v}.toml", DIVE_CHANNELS) for n, v in DIVES.items()]
    tanker = _closed(KVLCC2, KVLCC2 / "vehicle.toml", LOOP_CHANNELS, FOUR)
    return {
        "held-out errors before and after": [*found, tanker],
        "the same in the vertical plane": dives,
    }


def _closed(
    logs: Path,
    vehicle: Path,
    channels: tuple[str, ...] = LOOP_CHANNELS,
    hold_out: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Verdict and held-out errors of one run to its end."""
    found = _comparison(logs, vehicle, hold_out)
    before, after = found["held_out"]["before"], found["held_out"]["after"]
    return {
        "trial": logs.name,
        "verdict": found["verdict"],
        "used": " + ".join(e["id"] for e in (*found["effects"], *found["not_confirmed"])) or "-",
        **{c: _both(before, after, c) for c in channels},
    }


def _comparison(logs: Path, vehicle: Path, hold_out: tuple[str, ...]) -> dict[str, Any]:
    """What a run ends with."""
    options = {"ingest": {"logs": (logs,), "vehicle": vehicle}, "segment": {"hold_out": hold_out}}
    with tempfile.TemporaryDirectory(prefix="auvident-loop-") as name:
        for stage in (s.name for s in STAGES if s.name != "report"):
            run_stage(stage, Path(name), options.get(stage), observer=Observer())
        text = (Path(name) / "refine/comparison.json").read_text(encoding="utf-8")
    return json.loads(text)  # type: ignore[no-any-return]


def _crossed(found: dict[str, Any]) -> Rows:
    """Left-out errors over the standard deviation, with their standard errors."""
    before, after = (found["cross_validation"][when] for when in ("before", "after"))

    def told(e: dict[str, Any]) -> str:
        return f"{e['nrmse']:.3f} ± {e['nrmse'] * e['se'] / e['rmse']:.3f}"

    return [
        {"channel": c, "before": told(before[c]), "after": told(after[c])}
        for c in LOOP_CHANNELS
        if c in before and c in after
    ]


def _both(before: dict[str, Any], after: dict[str, Any], channel: str) -> str:
    if channel not in before or channel not in after:
        return "-"
    return f"{before[channel]['nrmse']:.3f}, {after[channel]['nrmse']:.3f}"
