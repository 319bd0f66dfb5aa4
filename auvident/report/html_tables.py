"""Rows of the tables of the HTML report, as text ready to show."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import PurePath
from typing import Any

from auvident.report.html_data import number, percent
from auvident.report.numbers import unit_text
from auvident.report.tables import Table, columns
from auvident.schema.artifacts import IdentifiedModel, ManeuverMetrics, StageRecord
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.logs import Quality
from auvident.schema.manifest import Manifest, StageEntry

MOST_COLUMNS = 5  # maneuvers side by side in one table of figures
OVERSHOOTS_SHOWN = 2  # the others of a long zigzag as their mean
HASH_DIGITS = 12
WORTH_SAYING = 0.02  # relative difference of a figure below which it is not marked

# Figure of a maneuver -> words, unit. Those not listed are shown under their own name.
TURN_FIGURES = {
    "rudder_deg": ("rudder", "deg"),
    "approach_speed_mps": ("approach speed", "m/s"),
    "advance_m": ("advance", "m"),
    "transfer_m": ("transfer", "m"),
    "time_to_90_s": ("time to 90° of heading", "s"),
    "tactical_diameter_m": ("tactical diameter", "m"),
    "time_to_180_s": ("time to 180° of heading", "s"),
    "steady_diameter_m": ("steady diameter", "m"),
    "steady_r_degps": ("steady yaw rate", "deg/s"),
    "steady_speed_mps": ("steady speed", "m/s"),
    "steady_drift_deg": ("steady drift angle", "deg"),
    "speed_loss": ("loss of speed", ""),
    "heading_change_deg": ("change of heading", "deg"),
}
ZIGZAG_FIGURES = {
    "rudder_deg": ("control angle", "deg"),
    "switch_deg": ("heading at the switch", "deg"),
    "initial_turning_time_s": ("initial turning time", "s"),
    "time_to_check_yaw_s": ("time to check yaw", "s"),
    "overshoot_1_deg": ("1st overshoot", "deg"),
    "overshoot_2_deg": ("2nd overshoot", "deg"),
    "later_overshoots_deg": ("later overshoots, mean", "deg"),
    "reach_s": ("reach", "s"),
    "period_s": ("period", "s"),
}


def figure_tables(metrics: Sequence[ManeuverMetrics], kind: str) -> Iterator[Table]:
    """Figures of turns or zigzags, measured and simulated, maneuvers side by side."""
    words = TURN_FIGURES if kind == "turn" else ZIGZAG_FIGURES
    found = [(m.id, getattr(m, kind)) for m in metrics if m.kind == kind and getattr(m, kind)]
    for start in range(0, len(found), MOST_COLUMNS):
        piece = [(i, _condensed(f)) for i, f in found[start : start + MOST_COLUMNS]]
        rows = []
        for name, (label, unit) in words.items():
            cells = [_measured_simulated(figures, name) for _, figures in piece]
            if any(cells):
                rows.append([label, unit, *(c or "–" for c in cells)])
        yield Table(columns(("measured → model", ""), [i for i, _ in piece]), rows)


def _condensed(figures: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Overshoots beyond the first as their mean."""
    found = {}
    for side, values in figures.items():
        later = [
            v
            for k, v in values.items()
            if k.startswith("overshoot_") and int(k.split("_")[1]) > OVERSHOOTS_SHOWN
        ]
        found[side] = dict(values)
        if later:
            found[side]["later_overshoots_deg"] = sum(later) / len(later)
    return found


def _measured_simulated(figures: Mapping[str, Mapping[str, float]], name: str) -> str:
    m, s = (figures.get(side, {}).get(name) for side in ("measured", "simulated"))
    if m is None and s is None:
        return ""
    text = f"{number(m)} → {number(s)}"
    if m and s is not None and abs(s / m - 1.0) >= WORTH_SAYING:
        text += f" ({100.0 * (s / m - 1.0):+.0f} %)".replace("-", "−")
    return text


def coefficient_rows(model: IdentifiedModel) -> list[dict[str, Any]]:
    """Coefficients with everything about them."""
    rows = []
    for c in model.coefficients:
        declared = BY_SYMBOL[c.symbol]
        wrong = declared.sign and c.value * declared.sign < 0.0
        rows.append(
            {
                "symbol": c.symbol,
                "meaning": declared.meaning,
                "regressor": declared.regressor,
                "equation": declared.equation,
                "unit": unit_text(c.unit),
                "value": number(c.value, 4),
                "std": number(c.std, 2),
                "prime": number(1000.0 * c.prime, 4),
                "prior": number(c.prior, 4),
                "prior_std": number(c.prior_std, 2),
                "origin": c.origin,
                "share": 100.0 * c.data_share,
                "wrong_sign": bool(wrong),
            }
        )
    return rows


def lag_table(quality: Quality) -> Table:
    """Delays between the sensors' clocks."""
    rows = [
        [
            t.trial,
            f"{a.second} behind {a.first}",
            f"{1000.0 * a.lag_s:.0f}".replace("-", "−"),
            f"{1000.0 * a.std_s:.1f}",
            percent(a.explained),
        ]
        for t in quality.trials
        for a in t.alignment
    ]
    return Table(columns(("trial", "clocks"), ("lag, ms", "std, ms", "explained")), rows)


def pass_table(model: IdentifiedModel) -> Table:
    """The passes of the plan as they were done."""
    channels = list(dict.fromkeys(c for s in model.stages for c in (*s.nis_mean, *s.fitted_noise)))
    heads = [
        "cycle",
        "stage",
        "system",
        "free",
        "maneuvers",
        "samples",
        "log likelihood",
        *(f"noise {c}" for c in channels),
        *(f"NIS {c}" for c in channels),
    ]
    rows = []
    for s in model.stages:
        noise = [_noise(s, c) for c in channels]
        nis = [number(s.nis_mean[c], 2) if c in s.nis_mean else "" for c in channels]
        rows.append(
            [
                str(s.cycle),
                s.stage,
                s.system,
                str(len(s.free)),
                str(len(s.maneuvers)),
                str(s.samples),
                number(s.log_likelihood, 5),
                *noise,
                *nis,
            ]
        )
    return Table(columns(heads[:3], heads[3:]), rows)


def _noise(record: StageRecord, column: str) -> str:
    """Noise of a channel in a pass; of a fit that of the sensor and that of the disturbance."""
    fitted = record.fitted_noise.get(column)
    if fitted is not None:
        slow = f"{number(fitted.slow_std, 2)} over {number(fitted.slow_time_s, 2)} s"
        return f"{number(fitted.white_std, 2)}, {slow}"
    return number(record.noise_std.get(column), 2) if column in record.nis_mean else ""


def manifest_table(manifest: Manifest) -> Table:
    """Stages of the run: when, with which options and seed."""
    rows = []
    for name, entry in manifest.stages.items():
        options = ", ".join(
            f"{k} = {_option(v)}" for k, v in entry.options.items() if v not in (None, (), [])
        )
        rows.append(
            [
                name,
                entry.outcome.replace("_", " "),
                options,
                entry.started_at[:19].replace("T", " "),
                _seconds(entry),
                "–" if entry.seed is None else str(entry.seed),
                entry.program_version,
            ]
        )
    heads = ("stage", "outcome", "options", "started, UTC", "s", "seed", "version")
    return Table(columns(heads[:3], heads[3:]), rows)


def _option(value: Any) -> str:
    """An option, paths by their last part: the report may travel."""
    if isinstance(value, list | tuple):
        return ", ".join(_option(v) for v in value)
    return PurePath(value).name if isinstance(value, str) and "/" in value else str(value)


def _seconds(entry: StageEntry) -> str:
    try:
        ended, started = (datetime.fromisoformat(t) for t in (entry.ended_at, entry.started_at))
    except ValueError:
        return "–"
    return number((ended - started).total_seconds(), 2)


def hash_table(manifest: Manifest) -> Table:
    """The files the run rests on, with the start of their sha256."""
    found: dict[str, str] = {}
    made = {name for entry in manifest.stages.values() for name in entry.outputs}
    for entry in manifest.stages.values():
        found |= {name: sha for name, sha in entry.inputs.items() if name not in made}
        found |= entry.program_files
    rows = [["/".join(PurePath(n).parts[-2:]), s[:HASH_DIGITS]] for n, s in found.items()]
    return Table(columns(("file", "sha256 begins")), rows)
