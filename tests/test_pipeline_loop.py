"""How `diagnose` and `refine` stand among the stages: what they are given, when they are stale."""

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from auvident.engines.setup import Setup
from auvident.errors import NumericsError
from auvident.pipeline import STAGES, run_stage, status
from auvident.pipeline.predict import find_model
from auvident.pipeline.table import BY_NAME
from auvident.schema.trial import Trial
from tests import loop_world
from tests.command_line import Called
from tests.test_pipeline import RUN, decisions, states


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> loop_world.HandMade:
    """Hand-made stages that find a current."""
    return loop_world.put_in_place(monkeypatch)


def seed_of(run: Path, stage: str) -> int:
    return json.loads((run / "run.json").read_text())["stages"][stage]["seed"]


def forget(run: Path, *stages: str) -> None:
    """As if the stages had never been run."""
    manifest = json.loads((run / "run.json").read_text())
    for stage in stages:
        del manifest["stages"][stage]
        shutil.rmtree(run / stage)
    (run / "run.json").write_text(json.dumps(manifest))


def test_the_loop_comes_after_validation_and_before_the_report() -> None:
    names = [stage.name for stage in STAGES]
    assert names[-5:] == ["validate", "diagnose", "refine", "combine", "report"]


def test_their_artifacts_stand_where_users_look(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    assert auvident("diagnose", demo, "--quiet").code == 0
    assert auvident("refine", demo, "--quiet").code == 0
    assert sorted(p.name for p in (demo / "diagnose").iterdir()) == [
        "diagnosis.json",
        "residuals.parquet",
    ]
    assert sorted(p.name for p in (demo / "refine").iterdir()) == [
        "comparison.json",
        "history.parquet",
        "model.json",
        "simulation.parquet",
    ]
    assert states(demo) | {"diagnose": "done", "refine": "done"} == states(demo)
    assert states(demo)["report"] == "stale"


def test_they_take_the_plan_and_filter_of_the_identification(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    import auvident as package

    setups = []

    def note(*given: object, **options: object) -> SimpleNamespace:
        setups.extend(x for x in given if isinstance(x, Setup))
        return SimpleNamespace(diagnosis=loop_world.nothing(), residuals=pd.DataFrame())

    monkeypatch.setattr("auvident.stages.diagnose.diagnose", note)
    plan = Path("mine.toml")
    text = (Path(package.__file__).parent / "plans" / "together.toml").read_text()
    plan.write_text(text.replace('name = "together"', 'name = "mine"', 1))
    arguments = ("identify", demo, "--plan", plan, "--filter", "ukf", "--quiet")
    assert auvident(*arguments).code == 0
    assert auvident("diagnose", demo, "--quiet").code == 0
    assert [(s.plan.name, s.filter) for s in setups] == [("mine", "ukf")]
    for option, filter in (((), "ukf"), (("--filter", "ekf"), "ekf")):
        assert auvident("refine", demo, *option, "--quiet").code == 0
        model = json.loads((demo / "refine/model.json").read_text())
        assert (model["plan"], model["filter"]) == ("mine", filter)
    assert states(demo)["refine"] == "done"


def test_a_plan_that_is_gone_is_named(demo: Path, auvident: Callable[..., Called]) -> None:
    import auvident as package

    shutil.copy(Path(package.__file__).parent / "plans" / "together.toml", "mine.toml")
    assert auvident("identify", demo, "--plan", "mine.toml", "--quiet").code == 0
    Path("mine.toml").unlink()
    called = auvident("diagnose", demo)
    assert called.code == 3
    assert "mine.toml" in called.err


def test_a_changed_plan_refuses_them_until_it_is_identified_again(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    import auvident as package

    text = (Path(package.__file__).parent / "plans" / "together.toml").read_text()
    Path("mine.toml").write_text(text)
    auvident("identify", demo, "--plan", "mine.toml", "--quiet")
    Path("mine.toml").write_text(text + "# changed\n")
    for stage in ("diagnose", "refine"):
        called = auvident(stage, demo)
        assert called.code == 4
        assert f"auvident identify {demo}" in called.err


@pytest.mark.usefixtures("quick_report")
def test_the_seed_is_kept_until_another_is_given(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    forget(demo, "refine")
    auvident("refine", demo, "--quiet")
    assert (found.calls["refine"].seed, seed_of(demo, "refine")) == (0, 0)
    auvident("refine", demo, "--seed", 7, "--quiet")
    auvident("refine", demo, "--quiet")
    assert (found.calls["refine"].seed, seed_of(demo, "refine")) == (7, 7)
    said = decisions(auvident(*RUN, demo))
    assert said["refine"] == "up to date"  # no seed was asked for
    said = decisions(auvident(*RUN, demo, "--seed", 3))
    assert said["refine"] == "runs again because option seed changed from 7 to 3"
    assert said["identify"] == said["diagnose"] == "up to date"  # they draw nothing
    assert (seed_of(demo, "diagnose"), seed_of(demo, "refine")) == (None, 3)


def test_a_new_model_makes_both_stale_a_new_diagnosis_only_the_refinement(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    auvident("diagnose", demo, "--quiet")  # another diagnosis than that of the finished run
    reasons = {d.stage: d.reason for d in status(demo)[0]}
    assert reasons["diagnose"] == reasons["validate"] == ""
    assert reasons["refine"] == "diagnose/diagnosis.json changed"
    auvident("refine", demo, "--quiet")
    auvident("identify", demo, "--filter", "ukf", "--quiet")
    reasons = {d.stage: d.reason for d in status(demo)[0]}
    assert reasons["diagnose"] == "identify/model.json changed"
    assert reasons["refine"] == "diagnose is stale"


def test_a_report_needs_no_diagnosis_but_shows_no_stale_one(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    forget(demo, "diagnose", "refine")
    assert auvident("report", demo, "--quiet").code == 0
    assert states(demo)["report"] == "done"
    assert "What the model lacks" not in (demo / "report/report.html").read_text()
    auvident("diagnose", demo, "--quiet")
    assert {d.stage: d.reason for d in status(demo)[0]}["report"] == (
        "diagnose/diagnosis.json is new"
    )
    assert auvident("report", demo, "--quiet").code == 0
    assert "It lacked</dt><dd>A current of 0.15 m/s" in (demo / "report/report.html").read_text()
    auvident("identify", demo, "--filter", "ukf", "--quiet")
    auvident("validate", demo, "--quiet")
    assert auvident("report", demo, "--quiet").code == 0
    assert states(demo) | {"diagnose": "stale", "report": "done"} == states(demo)
    assert "What the model lacks" not in (demo / "report/report.html").read_text()


@pytest.mark.usefixtures("quick_report")
def test_a_run_goes_on_without_stages_that_do_not_know_its_plane(
    demo: Path,
    auvident: Callable[..., Called],
    found: loop_world.HandMade,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("diagnose", "refine"):
        monkeypatch.setitem(BY_NAME[name].__dict__, "planes", ("horizontal",))
    run = (
        "run",
        "sample_logs/dive_trial",
        "--vehicle",
        "sample_logs/remus100.toml",
        "--run",
        "runs/dive",
        "--plane",
        "vertical",
    )
    called = auvident(*run)
    assert called.code == 0, called.err
    said = decisions(called)
    assert said["diagnose"] == said["refine"] == "skipped, it covers only the horizontal plane"
    assert found.calls == {}
    assert Path(called.out.strip()).exists()
    assert auvident(*run, "--fail-above", "w=1e-6").code == 1
    assert auvident(*run, "--fail-above", "w=9").code == 0
    assert json.loads(auvident(*run, "--json").out)["validate"]["summary"]


def test_the_refined_model_is_used_until_another_is_identified(
    demo: Path, auvident: Callable[..., Called], found: loop_world.HandMade
) -> None:
    auvident("diagnose", demo, "--quiet")
    assert find_model(demo)[0] == demo / "identify/model.json"  # the refinement is an old one
    auvident("refine", demo, "--quiet")
    path, model = find_model(demo)
    assert path == demo / "refine/model.json"
    assert [effect["id"] for effect in model.effects] == ["current"]
    auvident("identify", demo, "--filter", "ukf", "--quiet")
    assert find_model(demo)[0] == demo / "identify/model.json"


def test_messages_of_the_stages_pass_through(
    demo: Path,
    auvident: Callable[..., Called],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*arguments: object, progress: Callable[..., None], **options: object) -> None:
        progress("trying 32 effects", 0.5)
        raise NumericsError("the fit diverged", "turn-1, 12.3 s", "Hold out turn-1.")

    monkeypatch.setattr("auvident.stages.diagnose.diagnose", fail)
    called = auvident("diagnose", demo)
    assert called.code == 5
    assert "turn-1, 12.3 s: the fit diverged" in called.err and "Hold out turn-1." in called.err
    assert status(demo)[1].failed["diagnose"].problem == "the fit diverged"


def test_a_run_goes_on_when_the_numbers_of_the_diagnosis_fail(
    demo: Path,
    auvident: Callable[..., Called],
    found: loop_world.HandMade,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The report tells the rest, without a diagnosis of another model; the exit code is 5."""

    def fail(given: object) -> dict:
        raise NumericsError("the fit diverged", "turn-1", "Hold out turn-1.")

    auvident("diagnose", demo, "--quiet")
    auvident("refine", demo, "--quiet")
    loop_world.replace_stage(monkeypatch, "diagnose", fail)
    called = auvident(*RUN, demo, "--filter", "ukf")
    assert called.code == 5
    assert called.err.rstrip().splitlines()[-1].strip() == "Hold out turn-1."
    said = decisions(called)
    assert said["refine"] == "skipped, an earlier stage failed numerically"
    assert said["report"].startswith("runs again")
    assert "What the model lacks" not in (demo / "report/report.html").read_text()
    assert states(demo) | {"validate": "done", "diagnose": "stale"} == states(demo)
    summary = auvident(*RUN, demo, "--filter", "ukf", "--json")
    assert summary.code == 5 and json.loads(summary.out)["validate"]["summary"]


def test_validation_and_refinement_are_told_what_the_prior_is(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from auvident.pipeline import steps
    from auvident.pipeline.given import Given
    from auvident.stages import validate as stage
    from auvident.storage.run_directory import RunDirectory

    given = Given(RunDirectory(demo), RunDirectory(demo).manifest(), {"filter": None})
    given.__dict__["ase"] = given.ase.model_copy(update={"applies": False})
    told = []

    def predicted(*parts, estimated=True):  # type: ignore[no-untyped-def]
        told.append(estimated)
        return SimpleNamespace(
            metrics=given.metrics, simulation=given.table("validate/simulation.parquet")
        )

    monkeypatch.setattr(stage, "validate", predicted)
    assert steps.validate(given)["validate/metrics.json"] == given.metrics
    assert told == [False]


def test_findings_on_the_refined_model_reach_the_comparison(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from auvident.pipeline import steps
    from auvident.pipeline.given import Given
    from auvident.schema.artifacts import Finding
    from auvident.storage.run_directory import RunDirectory

    given = Given(RunDirectory(demo), RunDirectory(demo).manifest(), {"filter": "ukf"})
    rows = tuple(c.model_copy(update={"value": 2.0 * c.value}) for c in given.model.coefficients)
    model = given.model.model_copy(update={"coefficients": rows})
    said = Finding(code="no-better", where="r", message="r is predicted no better")
    after = SimpleNamespace(
        metrics=given.metrics.model_copy(update={"findings": (said,)}),
        simulation=given.table("validate/simulation.parquet"),
    )
    result = SimpleNamespace(model=model, history=given.table("identify/history.parquet"))
    given.__dict__["diagnosis"] = loop_world.nothing().model_copy(update={"effects": ()})
    monkeypatch.setattr(steps, "_identified_again", lambda *parts: (result, after))
    comparison = steps.refine(given)["refine/comparison.json"]
    assert said in comparison.findings


def test_a_refinement_by_itself_makes_the_bytes_that_it_makes_in_a_run(demo: Path) -> None:
    """There it takes over what the validation predicted."""
    made = {f: f.read_bytes() for f in (demo / "refine").iterdir()}
    assert len(made) == len(BY_NAME["refine"].writes)
    run_stage("refine", demo)
    assert {f: f.read_bytes() for f in made} == made


@pytest.mark.parametrize(
    ("column", "logged"),
    [
        ({"r_radps": [0.0]}, False),
        ({"heading_rad": [math.nan]}, False),
        ({"heading_rad": [0.1]}, True),
    ],
)
def test_a_log_may_have_no_heading_at_all(column: dict[str, list[float]], logged: bool) -> None:
    """Without an attitude there is no such column in the table of a trial."""
    assert Trial.from_table("log", pd.DataFrame(column), 10.0).has_heading is logged
