"""What the program prints at a width, command by command, from a finished run."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from auvident.cli import COMMANDS
from auvident.pipeline.table import STAGES
from auvident.report.console import stage_report
from auvident.schema.artifacts import AseResult, Finding, IdentifiedModel, Maneuver, Metrics
from auvident.schema.combined import CombinedModel
from auvident.schema.diagnosis import Comparison, Diagnosis
from auvident.schema.logs import Quality
from auvident.schema.places import beside
from tests.command_line import Called

NAMES = [name for names in COMMANDS.values() for name in names]
NARROW = 80
SHOWN = ("segment", "ase", "identify", "validate", "diagnose", "refine", "combine", "ingest")
CLASSES: dict[str, Any] = {
    "ingest/quality.json": Quality,
    "segment/maneuvers.json": tuple[Maneuver, ...],
    "ase/coefficients.json": AseResult,
    "identify/model.json": IdentifiedModel,
    "validate/metrics.json": Metrics,
    "diagnose/diagnosis.json": Diagnosis,
    "refine/comparison.json": Comparison,
    "combine/model.json": CombinedModel,
}
VEHICLE = "sample_logs/remus100.toml"
# Commands that take a second at most, by the name of the file that keeps what they print; the
# stages themselves are shown from their artifacts.
CALLS: dict[str, tuple[str, ...]] = {
    "run": ("run", "--run", "runs/demo"),
    "run-quiet": ("run", "--run", "runs/demo", "--quiet"),
    "status": ("status", "runs/demo"),
    "compare": ("compare", "runs/demo", "runs/other"),
    "plan-trial": ("plan-trial", "runs/demo"),
    "inspect": ("inspect", "sample_logs/harbour_trial"),
    "ase-designs": ("ase", VEHICLE, "sample_logs/tern180.toml"),
    "ase-sweep": ("ase", "--vehicle", VEHICLE, "--sweep", "rudder.exposed_span_m=0.08:0.1:3"),
    "simulate-spiral": ("simulate", "runs/demo", "--maneuver", "spiral", "--samples", "5"),
    "simulate-inputs": (
        "simulate",
        "runs/demo",
        "--inputs",
        "sample_logs/harbour_trial",
        "--from",
        "1373",
        "--to",
        "1380",
    ),
    "combine": ("combine", "runs/demo", "--output", "whole.json"),
    "export": ("export", "runs/demo", "--output", "model.json"),
    "new-vehicle": ("new-vehicle", "--output", "new.toml"),
    "coefficients": ("coefficients",),
    "effects": ("effects",),
    "schema": ("schema",),
}


# what takes most of the time is looked at in one width
ONCE = ("run", "plan-trial", "ase-designs", "simulate-spiral", "simulate-inputs")


def outputs_of(run: Path, stage: str) -> dict[str, Any]:
    """Artifacts of a stage as the stage returns them."""
    found: dict[str, Any] = {}
    for name, kind in CLASSES.items():
        for place in (name, beside(name)):
            if name.startswith(f"{stage}/") and (run / place).exists():
                found[place] = TypeAdapter(kind).validate_json((run / place).read_bytes())
    if stage == "segment":
        rejected = json.loads((run / "segment/rejected.json").read_bytes())
        rejected["findings"] = [Finding.model_validate(f) for f in rejected["findings"]]
        found["segment/rejected.json"] = rejected
    return found


def printed(run: Path, width: int, call: Callable[..., Called]) -> Iterator[tuple[str, str]]:
    """Name and text of everything that is shown; the width is that of COLUMNS."""
    from tests.report.test_console import text_of

    for stage in (s.name for s in STAGES if (run / s.name).exists() and s.name in SHOWN):
        pieces = stage_report(stage, outputs_of(run, stage))
        yield stage, text_of(pieces, width)
    for name, arguments in CALLS.items():
        if width != NARROW and name in ONCE:
            continue
        called = call(*arguments)
        assert called.code == 0, called.err
        yield name, called.err + called.out
    for name in ("", *NAMES) if width == NARROW else ():
        yield f"help-{name or 'auvident'}", call(*([name] if name else []), "--help").out
