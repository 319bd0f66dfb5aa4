"""What a person sees: tables of the stages as text."""

import io
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import RenderableType

from auvident.pipeline.given import Given
from auvident.report import console_style
from auvident.report.console import findings_lines, stage_report
from auvident.report.console_style import console_for, rich_table
from auvident.report.held_out_words import doubts_of
from auvident.report.numbers import TERMINAL
from auvident.report.tables import Column, Table
from auvident.schema.artifacts import Finding
from auvident.storage.run_directory import RunDirectory


def text_of(pieces: list[RenderableType], width: int = 140) -> str:
    console = console_for(io.StringIO(), width=width)
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
    assert all(
        c.symbol in text and TERMINAL.with_std(c.value, c.std) in text
        for c in outputs["identify/model.json"].coefficients
    )
    text = text_of(stage_report("validate", outputs))
    held_out = outputs["validate/metrics.json"].summary["validate"]
    for channel in held_out.values():  # a heading in degrees
        assert TERMINAL.number(TERMINAL.shown(channel.rmse, channel.unit), 3) in text
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


NASTY = (
    "[/dev]",
    "[bold]x",
    "[red]x[/red]",
    ":warning:",
    "[link=a]b",
    "\\[x]",
    "[/]",
    "[[]]",
    "a]",
)
BRACKETS = st.text(alphabet="[]/\\:@=#ab1", min_size=1, max_size=12)


def assert_verbatim(name: str, pieces: list[RenderableType], times: int = 1) -> None:
    console = console_for(io.StringIO(), width=1000)
    for piece in pieces:
        console.print(piece)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert text.count(f" {name} ") + text.count(f"{name}:") >= times, text


@settings(max_examples=60, deadline=None)
@given(BRACKETS)
def test_names_of_the_user_stand_in_the_tables_as_they_are(name: str) -> None:
    """As title, head of a column, cell, caption and finding."""
    wide = "-" * 80  # so that no text is broken
    heads = (Column(f"x {name} ."), Column(wide), Column(f"y {name} .", numeric=True))
    rows = [[f"x {name} ", wide, f" {name} ."]]
    table = rich_table(Table(heads, rows, f"Run directory {name} .", f"and {name} more"))
    finding = Finding(code="a", message=f"{name} .", where=name)
    assert_verbatim(name, [table], times=6)
    assert_verbatim(name, [*findings_lines([finding])], times=2)


@pytest.mark.parametrize("name", NASTY)
def test_every_stage_shows_the_names_as_they_are(demo: Path, name: str) -> None:
    outputs = outputs_of(demo)
    quality, model = outputs["ingest/quality.json"], outputs["identify/model.json"]
    trial = quality.trials[0].model_copy(update={"trial": name})
    odd = {
        "ingest/quality.json": quality.model_copy(update={"trials": (trial,)}),
        "segment/maneuvers.json": [
            outputs["segment/maneuvers.json"][0].model_copy(update={"id": name, "trial": name})
        ],
        "segment/rejected.json": {"rejected": (), "findings": ()},
        "ase/coefficients.json": outputs["ase/coefficients.json"].model_copy(
            update={"vehicle": name}
        ),
        "identify/model.json": model.model_copy(
            update={
                "vehicle": name,
                "coefficients": (
                    model.coefficients[0].model_copy(update={"unit": name}),
                    *model.coefficients[1:],
                ),
            }
        ),
    }
    for stage in ("ingest", "segment", "ase", "identify"):
        console = console_for(io.StringIO(), width=1000)
        for piece in stage_report(stage, odd):
            console.print(piece)
        assert name in console.file.getvalue()  # type: ignore[attr-defined]


def test_the_style_has_the_only_console() -> None:
    """So that none reads names as markup."""
    package = Path(console_style.__file__).parents[1]
    makers = [p.name for p in package.rglob("*.py") if re.search(r"\bConsole\(", p.read_text())]
    assert makers == ["console_style.py"]


@pytest.mark.parametrize("name", NASTY)
def test_the_bar_shows_the_text_as_it_is(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    from auvident.cli import watch

    stream = io.StringIO()
    monkeypatch.setattr(watch.sys, "stderr", stream)
    bar, task = watch._start_bar()
    bar.update(task, description=f"reading {name} .")
    console = console_for(io.StringIO(), width=200)
    console.print(bar.get_renderable())
    bar.stop()
    assert f"reading {name} ." in console.file.getvalue()  # type: ignore[attr-defined]


@pytest.mark.parametrize("width", [60, 80, 140])
def test_nothing_is_cut_whatever_the_width(width: int) -> None:
    """Columns without room follow in a second block; a long name goes on in the next line."""
    names = [f"value of the {k}. kind" for k in range(9)]
    heads = (Column("name"), *(Column(name, numeric=True) for name in names))
    long = "a_trial_with_a_name_that_is_longer_than_any_column-zigzag-1"
    cells = [f"{1000.0 + k:.3f}" for k in range(9)]
    console = console_for(io.StringIO(), width=width)
    console.print(rich_table(Table(heads, [[long, *cells]], "Numbers", "a caption")))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    assert all(len(line) <= width for line in text.splitlines())
    assert all(cell in text for cell in cells)
    firsts = "".join(line.strip().split("  ")[0] for line in text.splitlines())
    assert long in firsts.replace(" ", "")


def side_by_side(*vehicles: str, held: Sequence[tuple[str, ...]] = ((), ())) -> dict[str, Any]:
    rows = zip(vehicles, held, strict=True)
    return {"runs": [{"vehicle": v, "length_m": 2.0, "held_out": list(h)} for v, h in rows]}


@pytest.mark.parametrize(
    ("comparison", "said"),
    [
        (side_by_side("A", "A"), ()),
        (side_by_side("A", "B"), ("different vehicles: A (2 m), B (2 m)",)),
        (side_by_side("A", "A", held=(("x",), ("y",))), ("different maneuvers",)),
        (side_by_side("A", "A", held=(("x",), ())), ()),  # the second one has no errors yet
        (side_by_side("A", "B", held=(("x",), ("y",))), ("different vehicles", "different man")),
    ],
)
def test_runs_side_by_side_say_in_what_they_differ(comparison, said) -> None:
    lines = doubts_of(comparison)
    assert len(lines) == len(said) and all(s in line for s, line in zip(said, lines, strict=True))
