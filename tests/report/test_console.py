"""What a person sees: tables of the stages as text."""

import io
import json
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType

from auvident.pipeline.given import Given
from auvident.report.console import findings_lines, number, stage_report
from auvident.schema.artifacts import Finding
from auvident.storage.run_directory import RunDirectory


def text_of(pieces: list[RenderableType]) -> str:
    console = Console(file=io.StringIO(), width=140)
    for piece in pieces:
        console.print(piece)
    return console.file.getvalue()  # type: ignore[attr-defined]


def outputs_of(run: Path) -> dict[str, Any]:
    given = Given(RunDirectory(run))
    return {
        "ingest/quality.json": given.quality,
        "segment/maneuvers.json": given.maneuvers.maneuvers,
        "segment/rejected.json": {"rejected": (), "findings": ()},
        "ase/coefficients.json": given.ase,
        "identify/model.json": given.model,
        "validate/metrics.json": given.metrics,
    }


def test_the_tables_show_what_the_artifacts_say(demo: Path) -> None:
    outputs = outputs_of(demo)
    maneuvers = json.loads((demo / "segment" / "maneuvers.json").read_text())
    text = text_of(stage_report("segment", outputs))
    assert all(m["id"] in text for m in maneuvers)
    text = text_of(stage_report("identify", outputs))
    assert all(c.symbol in text and number(c.value) in text
               for c in outputs["identify/model.json"].coefficients)  # fmt: skip
    text = text_of(stage_report("validate", outputs))
    held_out = outputs["validate/metrics.json"].summary["validate"]
    assert all(number(channel.rmse, 3) in text for channel in held_out.values())
    assert "gyro" in text_of(stage_report("ingest", outputs))
    assert "N_uud" in text_of(stage_report("ase", outputs))
    assert "N_uud" not in text_of(stage_report("ase", outputs, brief=True))


def test_many_trials_have_one_row_each(demo: Path) -> None:
    quality = outputs_of(demo)["ingest/quality.json"]
    trial = quality.trials[0]
    trials = tuple(trial.model_copy(update={"trial": f"trial-{i}"}) for i in range(5))
    many = {"ingest/quality.json": quality.model_copy(update={"trials": trials})}
    text = text_of(stage_report("ingest", many))
    assert all(t.trial in text for t in trials)
    assert "gyro" not in text


def test_the_same_finding_of_several_places_is_said_once() -> None:
    same = [Finding(code="a", message="short of data", where=f"t{i}") for i in range(9)]
    text = text_of(findings_lines([*same, Finding(code="b", message="wrong sign")]))
    assert text.count("short of data") == 1
    assert "t4, t5, 3 more: short of data" in text
    assert "wrong sign" in text
    many = [Finding(code=f"c{i}", message=f"m{i}") for i in range(20)]
    assert "and 8 more findings" in text_of(findings_lines(many))
