"""The commands `diagnose`, `refine` and `effects`, and what `run` and `compare` say of the loop."""

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import pytest

from auvident.cli import COMMANDS
from auvident.schema.effects import EFFECTS
from auvident.schema.planes import PLANES
from tests import loop_world
from tests.command_line import Called
from tests.test_pipeline import RUN

FAMILIES = ("environment", "actuation", "sensing", "hydrodynamics")


@pytest.fixture
def run(demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run in which hand-made stages have found a current."""
    loop_world.put_in_place(monkeypatch)
    for stage in ("diagnose", "refine"):
        assert auvident(stage, demo, "--quiet").code == 0
    return demo


def test_the_commands_stand_in_their_place() -> None:
    names = [name for names in COMMANDS.values() for name in names]
    place = names.index("validate")
    assert names[place : place + 4] == ["validate", "diagnose", "refine", "report"]
    assert names[names.index("coefficients") + 1] == "effects"


@pytest.mark.parametrize(("stage", "main"), [("diagnose", "diagnosis"), ("refine", "comparison")])
def test_json_is_the_artifact_and_nothing_else(
    run: Path, auvident: Callable[..., Called], stage: str, main: str
) -> None:
    called = auvident(stage, run, "--json")
    assert called.out == (run / stage / f"{main}.json").read_text()
    assert loop_world.STATEMENT in called.err
    called = auvident(stage, run)
    assert called.out == "" and loop_world.STATEMENT in called.err
    called = auvident(stage, run, "--quiet")
    assert (called.out, called.err) == ("", "")


def test_the_gate_of_a_refinement_is_the_error_after(
    run: Path, auvident: Callable[..., Called]
) -> None:
    before, after = loop_world.BEFORE["u"], loop_world.AFTER["u"]
    assert auvident("refine", run, "--fail-above", f"u={1.01 * after}").code == 0
    called = auvident("refine", run, "--fail-above", f"u={0.99 * after}", "--fail-above", "r=9")
    assert called.code == 1
    assert "u: RMSE 0.0061 m/s" in called.err and "r: RMSE" not in called.err
    assert after < before
    for wrong in ("w=1", "u", "u=x"):
        assert auvident("refine", run, "--fail-above", wrong).code == 2


def test_the_gate_of_a_run_is_that_of_the_model_it_leaves(
    run: Path, auvident: Callable[..., Called]
) -> None:
    metrics = json.loads((run / "validate/metrics.json").read_text())["summary"]["validate"]
    assert metrics["u"]["rmse"] > 1.01 * loop_world.AFTER["u"]  # the gates of both would differ

    def code(limit: str) -> int:
        return auvident("run", "--run", run, "--fail-above", limit).code

    assert code(f"u={1.01 * loop_world.AFTER['u']}") == 0
    assert code(f"u={0.99 * loop_world.AFTER['u']}") == 1
    far = loop_world.TRACK_M * loop_world.AFTER["u"]
    assert metrics["track"]["rmse"] > 1.01 * far
    assert (code(f"track={1.01 * far}"), code(f"track={0.99 * far}")) == (0, 1)


def test_gates_of_a_refinement_that_ran_away_or_held_nothing_out() -> None:
    from auvident.errors import GateError
    from auvident.pipeline.gates import check_planes, refined
    from auvident.schema.artifacts import Finding

    compared = loop_world.comparison(loop_world.diagnosis())
    check_planes([refined(compared)], {})
    away = Finding(code="prediction-ran-away", message="", where="zigzag-9")
    with pytest.raises(GateError, match="diverges"):
        check_planes([refined(compared.model_copy(update={"findings": (away,)}))], {"u": 9.0})
    empty = compared.held_out.model_copy(update={"after": {}, "maneuvers": ()})
    with pytest.raises(GateError, match="no held-out maneuver measures"):
        check_planes([refined(compared.model_copy(update={"held_out": empty}))], {"u": 9.0})


def test_a_run_ends_with_the_discovery(run: Path, auvident: Callable[..., Called]) -> None:
    called = auvident(*RUN, run, "--plan", "together")  # everything from `identify` on again
    assert called.code == 0, called.err
    assert called.err.count(loop_world.STATEMENT) == 1
    assert called.err.index("report: runs again") < called.err.index(loop_world.STATEMENT)
    ending = called.err[called.err.index("report: runs again") :]
    assert "-0.129 to -0.113" in ending
    assert ending.splitlines()[-4:] == [
        f"Verdict: {loop_world.STATEMENT}",
        f"Report: {run}/report/report.html",
        "Next, see which maneuver would tell most about the coefficients:",
        f"  auvident plan-trial {run}",
    ]
    assert "held-out maneuvers without and with the effects" in ending
    assert called.out.strip() == str(run / "report/report.html")
    assert "Effects that these maneuvers would and would not show" in called.err


def test_a_run_with_nothing_to_do_still_tells_what_is_known(
    run: Path, auvident: Callable[..., Called]
) -> None:
    auvident("report", run)
    called = auvident(*RUN, run)
    assert called.err.count("up to date") == 8
    assert loop_world.STATEMENT in called.err
    assert auvident(*RUN, run, "--quiet").err == ""


def test_json_of_a_run_has_diagnosis_and_comparison(
    run: Path, auvident: Callable[..., Called]
) -> None:
    found = json.loads(auvident("run", "--run", run, "--json").out)
    assert found["diagnose"] == json.loads((run / "diagnose/diagnosis.json").read_text())
    assert found["refine"]["held_out"]["after"]["u"]["rmse"] == loop_world.AFTER["u"]


def test_compare_takes_the_refined_model_and_its_errors(
    run: Path, auvident: Callable[..., Called]
) -> None:
    shutil.copytree(run, "runs/other")
    auvident("identify", "runs/other", "--filter", "ukf", "--quiet")  # its refinement is stale now
    auvident("validate", "runs/other", "--quiet")
    called = auvident("compare", run, "runs/other", "--json")
    found = json.loads(called.out)
    assert [r["model"].split("/")[-2] for r in found["runs"]] == ["refine", "identify"]
    assert [r["verdict"] for r in found["runs"]] == ["effect_found", None]
    row = next(r for r in found["held_out"] if r["channel"] == "u")
    other = json.loads(Path("runs/other/validate/metrics.json").read_text())
    assert row["rmse"] == [loop_world.AFTER["u"], other["summary"]["validate"]["u"]["rmse"]]
    effect = next(e for e in found["effects"] if e["symbol"] == "current.north_mps")
    assert effect["value"] == [-0.121, None] and effect["std"] == [0.004, None]
    moved = next(c for c in found["coefficients"] if c["symbol"] == "N_ur")
    refined = json.loads((run / "refine/model.json").read_text())["coefficients"]
    assert moved["value"][0] == next(c["value"] for c in refined if c["symbol"] == "N_ur")
    assert "current.north_mps" in called.err and "-0.1210 ± 0.0040" in called.err


def test_effects_of_a_plane_are_told_in_its_terms(auvident: Callable[..., Called]) -> None:
    up, aside = (auvident("effects", "--plane", p).out for p in ("vertical", "horizontal"))
    assert "Z_0, M_0" in up and "Y_0" not in up and "N_vvr" not in up and "dy_m" not in up
    assert "Y_0, N_0" in aside and "M_0" not in aside and "N_vvr, N_rrr" in aside
    assert "u and v" not in up and "u residual that turns with the heading" in up
    heads, *lines = up.splitlines()
    assert all(line[heads.index("how it shows") - 1] == " " for line in lines)


def test_effects_are_listed_from_the_table(auvident: Callable[..., Called]) -> None:
    lines = auvident("effects").out.splitlines()
    assert len(lines) == len(EFFECTS) + 1
    start = lines[0].index("how it shows")
    for line, effect in zip(lines[1:], EFFECTS, strict=True):
        assert line.split()[:2] == [effect.id, effect.family]
        assert all(p.symbol in line and p.unit in line for p in effect.parameters)
        assert line[start:] == effect.signature  # the columns stand in line
    rows = json.loads(auvident("effects", "--json").out)["effects"]
    assert rows == json.loads(json.dumps([asdict(effect) for effect in EFFECTS]))


@pytest.mark.parametrize("family", FAMILIES)
def test_effects_of_one_family(auvident: Callable[..., Called], family: str) -> None:
    rows = json.loads(auvident("effects", "--family", family, "--json").out)["effects"]
    assert rows and {row["family"] for row in rows} == {family}
    shown = auvident("effects", "--family", family).out.splitlines()[1:]
    assert [line.split()[0] for line in shown] == [row["id"] for row in rows]


@pytest.mark.parametrize("plane", PLANES)
def test_effects_of_one_plane(auvident: Callable[..., Called], plane: str) -> None:
    rows = json.loads(auvident("effects", "--plane", plane, "--json").out)["effects"]
    assert [row["id"] for row in rows] == [e.id for e in EFFECTS if plane in e.planes]


def test_every_family_can_be_asked_for(auvident: Callable[..., Called]) -> None:
    assert {effect.family for effect in EFFECTS} == set(FAMILIES)
    called = auvident("effects", "--family", "magic")
    assert called.code == 2
    assert "hydrodynamics" in called.err


@pytest.mark.parametrize(("name", "key"), [("diagnosis", "sees"), ("comparison", "held_out")])
def test_schemas_of_the_loop(auvident: Callable[..., Called], name: str, key: str) -> None:
    schema = json.loads(auvident("schema", name).out)
    assert key in schema["properties"]
    assert f"{name}.json" in auvident("schema").out
