"""How wrong a vehicle file may be: ``python -m tests.bench.wrong_file`` writes its table.

`sample_logs/harbour_trial` is identified with the file of its vehicle, and with one number of it
off at a time. Told are the held-out errors of u, v and r over those of the right file, what becomes
of the coefficients that the data determine, and the findings that come in addition.
"""

import re
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvident.errors import InputError
from auvident.pipeline import run_stage
from tests.bench.written import PLACE, table
from tests.command_line import SAMPLES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "own-vehicle.md"
SECTION = "wrong-file"
STAGES = ("segment", "ase", "identify", "validate")
CHANNELS = ("u", "v", "r")
Tables = dict[str, Any]
DETERMINED = 0.8  # share of the certainty from data of a coefficient that counts


def _times(where: str, key: str, factor: float) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        rows = tables[where] if isinstance(tables[where], list) else [tables[where]]
        for row in rows:
            row[key] = row[key] * factor

    return change


def _add(where: str, key: str, by: float) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        rows = tables[where] if isinstance(tables[where], list) else [tables[where]]
        for row in rows:
            row[key] = row[key] + by

    return change


def _propeller(tables: Tables) -> None:
    for key in ("kt0", "kt1"):
        tables["propeller"][key] *= 1.2


def _thinner(tables: Tables) -> None:
    for key in ("diameter_m", "tail_base_diameter_m"):
        tables["hull"][key] *= 0.95
    radii = tables["hull"]["offsets_radius_m"]
    tables["hull"]["offsets_radius_m"] = [round(0.95 * radius, 4) for radius in radii]


def _signs(tables: Tables) -> None:
    tables["signs"]["rudder_positive_turns"] = "starboard"


WRONG: dict[str, Callable[[Tables], None]] = {
    "nothing": lambda tables: None,
    "mass 2 % more": _times("vehicle", "mass_kg", 1.02),
    "mass 10 % more": _times("vehicle", "mass_kg", 1.1),
    "inertia 20 % more": _times("vehicle", "izz_kgm2", 1.2),
    "inertia 50 % more": _times("vehicle", "izz_kgm2", 1.5),
    "centre of gravity 2 cm forward": _add("vehicle", "x_g_m", 0.02),
    "hull 5 % thinner": _thinner,
    "fins 5 cm forward": _add("fin", "x_m", 0.05),
    "span of the fins 20 % less": _times("fin", "exposed_span_m", 0.8),
    "thrust 20 % more": _propeller,
    "DVL 10 cm forward": _add("dvl", "x_m", 0.1),
    "rudder to the other side": _signs,
}


def main() -> None:
    """Measure every row, and write the table."""
    rows = []
    right = _tried(WRONG.pop("nothing"))
    assert right is not None
    for what, change in WRONG.items():
        found = _tried(change)
        rows.append({"wrong": what, **(_told(found, right) if found else REFUSED)})
        print(rows[-1], flush=True)
    text = PAGE.read_text(encoding="utf-8")
    place = re.compile(PLACE.format(name=SECTION), re.DOTALL)
    PAGE.write_text(place.sub(lambda _: f"\n{table(rows)}\n\n", text), encoding="utf-8")


@dataclass(frozen=True)
class Tried:
    """Held-out errors by channel, coefficients from data by symbol, codes of findings."""

    errors: dict[str, float]
    coefficients: dict[str, float]
    codes: set[str]


REFUSED = dict.fromkeys((*CHANNELS, "coefficients"), "-") | {"said in addition": "refused"}


def _told(found: Tried, right: Tried) -> dict[str, str]:
    """A row of the table: everything over what the right file has."""
    ratios = [
        v / right.coefficients[s] for s, v in found.coefficients.items() if s in right.coefficients
    ]
    return {
        **{c: f"{found.errors[c] / right.errors[c]:.2f}" for c in CHANNELS},
        "coefficients": f"{min(ratios):.2f} to {max(ratios):.2f}",
        "said in addition": ", ".join(f"`{c}`" for c in sorted(found.codes - right.codes)) or "-",
    }


def _tried(change: Callable[[Tables], None]) -> Tried | None:
    """What comes of a file; None where it is refused."""
    tables = tomllib.loads((SAMPLES / "remus100.toml").read_text(encoding="utf-8"))
    change(tables)
    with tempfile.TemporaryDirectory() as folder:
        run, file = Path(folder) / "run", Path(folder) / "vehicle.toml"
        file.write_text(_toml(tables), encoding="utf-8")
        logs = (SAMPLES / "harbour_trial",)
        try:
            found = {"ingest": run_stage("ingest", run, {"logs": logs, "vehicle": file})}
        except InputError:
            return None
        found |= {stage: run_stage(stage, run, {}) for stage in STAGES}
    metrics = found["validate"]["validate/metrics.json"]
    rows = found["identify"]["identify/model.json"].coefficients
    return Tried(
        {c: metrics.summary["validate"][c].rmse for c in CHANNELS},
        {row.symbol: row.value for row in rows if row.data_share > DETERMINED},
        {f.code for outputs in found.values() for f in _findings(outputs)},
    )


def _findings(outputs: Any) -> list[Any]:
    return [f for artifact in outputs.values() for f in getattr(artifact, "findings", ())]


def _toml(tables: Tables) -> str:
    lines = []
    for name, own in tables.items():
        for row in own if isinstance(own, list) else [own]:
            lines.append(f"[[{name}]]" if isinstance(own, list) else f"[{name}]")
            lines += [f"{k} = {repr(v).replace(chr(39), chr(34))}" for k, v in row.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
