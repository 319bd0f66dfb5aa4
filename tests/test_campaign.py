"""A campaign: its file, its processes, what is skipped, and what stands in its output."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pandas as pd
import pytest

from auvident.errors import GateError, InputError, UsageError
from auvident.pipeline.campaign import (
    OPTION_NAMES,
    CampaignPlan,
    arguments_of,
    gathered,
    options_of,
    refuse_among_logs,
    refuse_changes,
    run_campaign,
    with_results,
)
from auvident.pipeline.campaign_jobs import PROGRAM, Job, JobDone, LocalProcesses, problem_of
from auvident.pipeline.campaign_page import write_page
from auvident.pipeline.campaign_pooling import pooled_by_plane, trials_by_plane
from auvident.pipeline.left_out_runs import left_out_errors
from auvident.pipeline.observer import Observer
from auvident.pipeline.pooling import (
    PooledRuns,
    date_of,
    logs_behind,
    pool_runs,
    refuse_change,
)
from auvident.pipeline.predict import find_model
from auvident.report.campaign_page import render_campaign
from auvident.report.tables import Number
from auvident.report.tables_campaign import campaign_trials, repeats, summary, told_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.campaign import (
    Campaign,
    CampaignResult,
    CampaignTrial,
    CampaignVehicleResult,
    RunOptions,
)
from auvident.schema.changes import Changes, VehicleChange
from auvident.schema.pooled import PooledModel
from auvident.schema.quoting import first_words
from auvident.storage.artifacts import sha256_of
from auvident.storage.campaign_file import PlannedTrial, read_campaign, trials_in_folders
from tests.command_line import ROOT, SAMPLES, call

OPTIONS = RunOptions()  # type: ignore[call-arg]


class Told(Observer):
    def __init__(self) -> None:
        self.lines: list[str] = []

    def note(self, text: str) -> None:
        self.lines.append(text)


class Refusing:
    """Every trial is one that cannot be read."""

    def __init__(self, why: str = "gyro: there is no such file") -> None:
        self.jobs: list[Job] = []
        self.why = why

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        self.jobs += jobs
        for job in jobs:
            yield JobDone(job.key, 3, self.why, 0.1)


class Runs:
    """Every trial as its process would run it, in this one."""

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        for job in jobs:
            called = call(*job.arguments)
            yield JobDone(job.key, called.code, problem_of(called.err), 0.1)


class Ends:
    """Every trial ends with this code, after something was done."""

    def __init__(self, code: int, does: Callable[[], object]) -> None:
        self.code, self.does = code, does

    def each(self, jobs: Sequence[Job]) -> Iterator[JobDone]:
        for job in jobs:
            self.does()
            yield JobDone(job.key, self.code, "its reason", 0.1)


def planned(vehicle: str, name: str, log: str) -> PlannedTrial:
    file = Path("sample_logs/remus100.toml")
    return PlannedTrial(vehicle, name, Path(log), file, None, OPTIONS)


@pytest.fixture
def plan(demo: Path) -> CampaignPlan:
    """A finished run where the campaign has it, and a trial that is none."""
    trials = [
        planned("runs", demo.name, "sample_logs/harbour_trial"),
        planned("runs", "second", "sample_logs/nothing"),
    ]
    return CampaignPlan(demo.parents[1], trials)


def test_what_is_up_to_date_is_skipped_and_what_failed_is_a_row(plan: CampaignPlan) -> None:
    runner, told, warmed = Refusing(), Told(), []
    before = {p: p.read_bytes() for p in (plan.output / "runs" / "demo").rglob("*.json")}
    done = run_campaign(plan, told, runner=runner, warm=warmed.append)
    first, second = done.result.trials
    assert [job.key for job in runner.jobs] == ["runs/second"]
    assert warmed == [told]
    assert (first.state, second.state) == ("up to date", "failed")
    assert second.problem == "gyro: there is no such file" and second.exit_code == 3
    assert first.pooled and first.verdict and first.nrmse.keys() >= {"u", "v", "r"}
    assert re.match(r"\[1/1\] runs/second: gyro: there is no such file \(0 s left\)", told.lines[0])
    assert before == {p: p.read_bytes() for p in before}
    (vehicle,) = done.result.vehicles
    assert (vehicle.trials, vehicle.pooled) == (2, 1)
    assert vehicle.repeat == ({"trial": "second", "why": second.problem},)
    model = IdentifiedModel.model_validate_json(Path(vehicle.model).read_text())
    assert model.vehicle == "REMUS 100"


def only(demo: Path) -> CampaignPlan:
    """A campaign of the finished run alone."""
    return CampaignPlan(demo.parents[1], [planned("runs", demo.name, "sample_logs/harbour_trial")])


def test_results_of_an_earlier_run_do_not_stand_for_one_that_fails(demo: Path) -> None:
    samples = Path("sample_logs")
    samples.unlink()
    shutil.copytree(SAMPLES / "harbour_trial", samples / "harbour_trial")
    shutil.copy(SAMPLES / "remus100.toml", samples)
    assert run_campaign(only(demo), Observer(), runner=Runs()).result.trials[0].pooled
    (samples / "harbour_trial" / "rudder.csv").unlink()
    pooled = [demo.parent / name for name in ("pooled.json", "changes.json")]
    assert all(file.is_file() for file in pooled)
    done = run_campaign(only(demo), Observer(), runner=Runs()).result
    assert not any(file.exists() for file in pooled)  # of that earlier run
    (trial,), (vehicle,) = done.trials, done.vehicles
    assert (trial.state, trial.exit_code) == ("failed", 3)
    assert "rudder_rad" in trial.problem
    assert (trial.verdict, trial.rmse, trial.pooled) == ("", {}, False)
    assert (vehicle.pooled, vehicle.problem) == (0, "no trial came to a model")


def nothing() -> None:
    """Leave the run as it is."""


@pytest.mark.parametrize("code", [1, 2, 3, 4, 6, 70, 130, -9])
def test_a_trial_that_did_not_come_to_its_end_is_failed(demo: Path, code: int) -> None:
    """A full disk ends a run with 3 as a refused log does, a program that cannot start with 1."""
    (demo / "report" / "report.html").unlink()
    (trial,) = run_campaign(only(demo), Observer(), runner=Ends(code, nothing)).result.trials
    assert (trial.state, trial.problem, trial.nrmse) == ("failed", "its reason", {})


@pytest.mark.parametrize("code", [1, 3])
def test_a_gate_or_a_log_set_aside_is_told_of_a_run_that_stands(demo: Path, code: int) -> None:
    page = demo / "report" / "report.html"
    text = page.read_bytes()
    page.unlink()
    runner = Ends(code, lambda: page.write_bytes(text))
    (trial,) = run_campaign(only(demo), Observer(), runner=runner).result.trials
    assert (trial.state, trial.exit_code, trial.pooled) == ("done", code, True)
    assert trial.verdict and trial.nrmse


def test_where_the_numbers_of_a_later_stage_fail_the_errors_count(demo: Path) -> None:
    """What an earlier run refined of other diagnosis is not its verdict."""
    (demo / "diagnose" / "diagnosis.json").write_text("{}")
    (trial,) = run_campaign(only(demo), Observer(), runner=Ends(5, nothing)).result.trials
    assert (trial.state, trial.pooled, trial.verdict) == ("done", True, "")
    metrics = json.loads((demo / "validate" / "metrics.json").read_text())
    assert trial.rmse["r"] == metrics["summary"]["validate"]["r"]["rmse"]
    (demo / "validate" / "metrics.json").write_text("{}")
    (trial,) = run_campaign(only(demo), Observer(), runner=Ends(5, nothing)).result.trials
    assert trial.state == "failed"


def test_the_output_is_read_by_others(plan: CampaignPlan) -> None:
    done = run_campaign(plan, Observer(), runner=Refusing())
    page = write_page(plan.output, done).read_text()
    assert '<a href="runs/demo/report/report.html">demo</a>' in page
    assert "gyro: there is no such file" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    result = CampaignResult.model_validate_json((plan.output / "campaign.json").read_text())
    assert result == done.result
    tables = {p.stem: pd.read_parquet(p) for p in plan.output.glob("*.parquet")}
    assert set(tables) == {"trials", "coefficients", "effects"}
    assert list(tables["trials"].state) == ["up to date", "failed"]
    own = tables["coefficients"].set_index("symbol")
    assert own.loc["Y_uud", "std"] < own.loc["Y_uud", "prior_std"]
    assert 0.0 < own.loc["Y_uud", "pooled_data_share"] <= 1.0
    queries_of_the_docs(plan.output)


def test_a_report_is_linked_whatever_its_trial_is_called() -> None:
    names = ("leg #2 (50%)", "a&b", "run:3")
    trials = tuple(
        CampaignTrial(vehicle="boat", trial=n, log=n, run=n, state="done") for n in names
    )
    long = "the log's rudder sign contradicts " + 30 * "what the vehicle file says " + "of it"
    vehicle = CampaignVehicleResult(
        name="boat", plane="horizontal", repeat=({"trial": "a&b", "why": long},)
    )
    result = CampaignResult(program_version="0", trials=trials, vehicles=(vehicle,))
    page = render_campaign(result, {})
    links = [unquote(link) for link in re.findall(r'href="([^#"]+)"', page)]
    assert links == [f"boat/{n}/report/report.html" for n in names]
    assert "#2" not in re.sub(r">[^<]*<", "", page)
    assert unescape(page).count(long) == 1  # the whole of it


def test_trials_of_either_plane_have_their_errors_the_same_on_page_and_terminal() -> None:
    """The first three or four channels of all trials together were those of the turns alone; the
    page had the NRMSE of a heading that turns round and round, which says nothing."""
    nrmse = {
        "turns": {"u": 0.11, "v": 0.12, "r": 0.13, "heading": 0.0014, "track": 0.9},
        "dives": {"u": 0.21, "w": 0.22, "q": 0.23, "pitch": 0.24, "track": 0.9},
    }
    trials = tuple(
        CampaignTrial(
            vehicle="boat", trial=name, log="", run="", state="done", verdict="none_found",
            nrmse=own, rmse=dict.fromkeys(own, 0.1),
        )
        for name, own in nrmse.items()
    )  # fmt: skip
    vehicle = CampaignVehicleResult(name="boat", plane="horizontal", trials=2)
    result = CampaignResult(program_version="0", trials=trials, vehicles=(vehicle,))
    page, table = render_campaign(result, {}), campaign_trials(result)
    heads = [c.head for c in table.columns if "NRMSE" in c.head]
    assert heads == [f"NRMSE {c}" for c in ("u", "v", "r", "w", "q", "pitch")]
    assert all(f">{head}<" in page for head in heads) and "NRMSE heading" not in page
    assert all(f">{value}<" in page for value in ("0.11", "0.22", "0.23", "0.24"))
    dives = [str(cell.value) for cell in table.rows[1] if isinstance(cell, Number)]
    assert dives[:6] == ["0.21", "None", "None", "0.22", "0.23", "0.24"]


def test_days_of_dives_beside_days_of_turns_are_pooled_by_themselves(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in its plane, and neither keeps the other from being pooled."""
    dive = demo.parent / "dive"
    shutil.copytree(demo, dive)
    monkeypatch.setattr(
        "auvident.pipeline.campaign_pooling.planes_of",
        lambda run: ("vertical",) if run.path == dive else ("horizontal",),
    )
    plane_of_file = {"pooled.json": "horizontal", "pooled-vertical.json": "vertical"}
    asked = []

    def pooled_as_asked(runs: list[Path], *, plane: str, **options: Any) -> PooledRuns:
        asked.append(([run.name for run in runs], plane))
        found = pool_runs(runs, **options)
        return replace(found, model=found.model.model_copy(update={"plane": plane}))

    monkeypatch.setattr("auvident.pipeline.campaign_pooling.pool_runs", pooled_as_asked)
    trials = [planned("runs", n, "sample_logs/harbour_trial") for n in ("demo", "dive")]
    plan = CampaignPlan(demo.parents[1], trials)
    rows = {
        f"runs/{t.name}": CampaignTrial(
            vehicle="runs", trial=t.name, log="", run=str(plan.run_of(t)), state="up to date"
        )
        for t in trials
    }
    done = gathered(plan, rows, Observer())
    assert asked == [(["demo"], "horizontal"), (["dive"], "vertical")]
    assert [t.pooled for t in done.result.trials] == [True, True]
    assert [v.title for v in done.result.vehicles] == ["runs", "runs, vertical plane"]
    assert [(v.trials, v.pooled, v.repeat) for v in done.result.vehicles] == [(1, 1, ())] * 2
    for name, plane in plane_of_file.items():
        tree = json.loads((plan.output / "runs" / name).read_text())
        assert tree["plane"] == plane
    table = pd.read_parquet(plan.output / "coefficients.parquet")
    assert {(r.plane, r.trial) for r in table.itertuples()} == {
        ("horizontal", "demo"),
        ("vertical", "dive"),
    }
    models = {n: r.model for n, r in done.pooled.items()}
    page = render_campaign(done.result, models)
    assert_disagreement_shows(done.result, models)
    assert '<h2 class="plane" id="runs-vertical-plane">runs, vertical plane</h2>' in page
    assert page.count("<h3>Trials</h3>") == 1 and '<p class="soft">1 vehicle ' in page


def assert_disagreement_shows(result: CampaignResult, models: dict[str, PooledModel]) -> None:
    """Two trials with another thruster each (p = 2e-39) had a green card without a word of it."""
    name, model = next(iter(models.items()))
    graded = re.compile('<section class="verdict ([a-z]+)">')
    assert graded.findall(render_campaign(result, models))[0] == "good"
    pooling = model.pooling.model_copy(update={"p": 2e-39})
    against = model.model_copy(update={"pooling": pooling})
    assert graded.findall(render_campaign(result, {**models, name: against}))[0] == "fair"
    assert "The trials disagree (p = 2e-39), most in" in summary(against)
    assert "disagree" not in summary(model)
    assert told_of(result.vehicles[0]).startswith("1 of 1 trial pooled. ")
    assert "coefficients come mostly from its data." in told_of(result.vehicles[0])
    none = {"pooled": 0, "trials": 2, "summary": "", "problem": "no trial came to a model"}
    text = told_of(result.vehicles[0].model_copy(update=none))
    assert text == "0 of 2 trials pooled: no trial came to a model."
    missing = result.vehicles[0].model_copy(update={"trials": 2})
    result = result.model_copy(update={"vehicles": (missing, *result.vehicles[1:])})
    assert graded.findall(render_campaign(result, models))[0] == "fair"


@pytest.mark.parametrize(
    ("planes", "pooled"),
    [
        ("hv", {"horizontal": "a", "vertical": "b"}),
        ("hvv", {"vertical": "bc", "horizontal": "a"}),
        ("bvv", {"vertical": "abc", "horizontal": "a"}),
        ("b", {"horizontal": "a", "vertical": "a"}),
        ("hh", {"horizontal": "ab"}),
    ],
)
def test_the_plane_that_most_trials_have_comes_first(
    tmp_path: Path, planes: str, pooled: dict[str, str]
) -> None:
    """h: turns, v: dives, b: both."""
    first = {"h": "horizontal", "v": "vertical", "b": "horizontal"}
    rows = []
    for name, plane in zip("abc", planes, strict=False):
        stage = tmp_path / name / "identify"
        (stage / "vertical").mkdir(parents=True)
        (stage / "model.json").write_text(json.dumps({"plane": first[plane]}))
        if plane == "b":
            (stage / "vertical" / "model.json").write_text("{}")
        run = str(tmp_path / name)
        rows.append(CampaignTrial(vehicle="boat", trial=name, log="", run=run, state="done"))
    found = {p: "".join(r.trial for r in own) for p, own in trials_by_plane(rows).items()}
    assert list(found.items()) == list(pooled.items())


def test_a_trial_of_both_planes_tells_of_both(demo: Path) -> None:
    """Errors of either plane, the verdict of the one that lacks something, the effects of both."""
    for stage in ("identify", "validate", "refine"):
        (demo / stage / "vertical").mkdir()
    model = json.loads((demo / "identify" / "model.json").read_text())
    (demo / "identify" / "vertical" / "model.json").write_text(json.dumps(model))
    (demo / "validate" / "vertical" / "metrics.json").write_text(
        json.dumps({"summary": {"validate": {c: {"rmse": 9.0, "nrmse": 0.9} for c in "uwq"}}})
    )
    after = {"w": {"rmse": 1.0, "nrmse": 0.1}}
    lacks = {"verdict": "effect_found", "effects": [{"id": "elevator_lag"}]}
    (demo / "refine" / "vertical" / "comparison.json").write_text(
        json.dumps({**lacks, "held_out": {"after": after}})
    )
    row = CampaignTrial(vehicle="runs", trial="demo", log="", run=str(demo), state="up to date")
    trial = with_results(row)
    assert [c for c in trial.nrmse if c in "uvrwq"] == ["u", "v", "r", "w", "q"]
    assert trial.nrmse["u"] < 0.5 and (trial.nrmse["w"], trial.nrmse["q"]) == (0.1, 0.9)
    assert (trial.verdict, trial.effects) == ("effect_found", ("elevator_lag",))
    for stage in ("validate", "refine"):  # the second plane was identified, and then it failed
        shutil.rmtree(demo / stage / "vertical")
    alone = with_results(row)
    assert alone.state == "up to date" and "w" not in alone.nrmse
    assert (alone.nrmse["u"], alone.effects) == (trial.nrmse["u"], ())


def test_a_run_that_cannot_be_read_is_the_problem_of_its_vehicle_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(run: Any) -> Any:
        raise InputError("is no JSON", str(run.path))

    monkeypatch.setattr("auvident.pipeline.campaign_pooling.planes_of", broken)
    row = CampaignTrial(vehicle="boat", trial="a", log="", run=str(tmp_path / "a"), state="done")
    (found,) = pooled_by_plane(tmp_path, [row], 0.01, 0)
    assert (found.runs, found.told.problem) == (None, f"{tmp_path / 'a'}: is no JSON")


def test_what_an_earlier_campaign_pooled_is_gone(tmp_path: Path) -> None:
    names = ("pooled.json", "changes.json", "pooled-vertical.json", "changes-vertical.json")
    for name in names:
        (tmp_path / name).write_text("{}")
    failed = CampaignTrial(vehicle="boat", trial="a", log="", run="", state="failed", problem="no")
    (found,) = pooled_by_plane(tmp_path, [failed], 0.01, 0)
    assert found.told.problem == "no trial came to a model"
    assert found.told.repeat == ({"trial": "a", "why": "no"},)
    assert not list(tmp_path.iterdir())


def queries_of_the_docs(output: Path) -> None:
    """The examples of docs/campaigns.md, on this output."""
    text = (ROOT / "docs" / "campaigns.md").read_text()
    blocks = [b for b in re.findall(r"```python\n(.*?)```", text, re.S) if "answer = " in b]
    assert len(blocks) == 3
    for block in blocks:
        code = block.replace('"campaign/', f'"{output}/').replace("'campaign/", f"'{output}/")
        if "duckdb" in code:
            try:
                import duckdb  # noqa: F401
            except ImportError:
                continue
        found: dict[str, object] = {}
        exec(code, found)
        assert found["answer"] is not None


def test_a_run_that_may_not_be_read_stops_no_other(
    plan: CampaignPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made by another user on a shared disk: its process says so."""

    def refused(path: Path) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("auvident.pipeline.freshness.sha256_of", refused)
    runner = Refusing()
    done = run_campaign(plan, Observer(), runner=runner)
    assert [job.key for job in runner.jobs] == ["runs/demo", "runs/second"]
    assert [t.state for t in done.result.trials] == ["failed", "failed"]


def test_a_dry_run_does_nothing(plan: CampaignPlan) -> None:
    runner = Refusing()
    done = run_campaign(plan, Observer(), dry_run=True, runner=runner)
    assert [t.state for t in done.result.trials] == ["up to date", "planned"]
    assert runner.jobs == [] and not (plan.output / "campaign.json").exists()


def test_the_options_of_a_trial_are_those_of_a_single_run(demo: Path) -> None:
    values = {"rate_hz": 5.0, "max_gap_s": 2.0, "filter": "ukf", "plane": "both", "plan": "likely"}
    options = RunOptions(**values, fix=("gyro-scale",), hold_out=("a", "b"))
    trial = PlannedTrial("v", "t", Path("log"), Path("v.toml"), Path("m.toml"), options)
    arguments = arguments_of(trial, Path("out"), True)
    assert set(OPTION_NAMES) == set(RunOptions.model_fields)
    assert set(OPTION_NAMES.values()) <= set(arguments)
    assert arguments.count("--hold-out") == 2
    stages = options_of(trial, True)
    assert stages["ingest"] == {
        "logs": (Path("log"),), "vehicle": Path("v.toml"), "map": Path("m.toml"),
        "allow_outside": True, "rate_hz": 5.0, "max_gap_s": 2.0, "fix": ("gyro-scale",),
    }  # fmt: skip
    assert stages["segment"] == {"hold_out": ("a", "b")}
    called = call(*arguments)  # the command knows them all; the log is none
    assert called.code == 3, called.err


# --- processes ------------------------------------------------------------------------------


def started(code: str):
    """Processes that do something else than the program."""
    calls: list[list[str]] = []

    def start(command: list[str], **options: object) -> subprocess.Popen[str]:
        calls.append(command)
        own = [sys.executable, "-c", code, *command[3:]]
        return subprocess.Popen(own, **options)  # type: ignore[call-overload]

    return start, calls


def test_each_trial_is_a_process_and_its_error_is_told() -> None:
    code = "import sys; sys.stderr.write('Error: a: is empty\\n  Fill it.\\n'); sys.exit(3)"
    start, calls = started(f"import sys\nif sys.argv[1] == 'bad':\n    {code}")
    jobs = [Job("v/a", ("good",)), Job("v/b", ("bad",))]
    found = {d.key: d for d in LocalProcesses(2, start).each(jobs)}
    assert (found["v/a"].exit_code, found["v/a"].problem) == (0, "")
    assert (found["v/b"].exit_code, found["v/b"].problem) == (3, "a: is empty. Fill it.")
    assert all(command[1:3] == list(PROGRAM) for command in calls)


def test_a_process_that_is_killed_is_tried_again_and_then_told(tmp_path: Path) -> None:
    kill = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    once = f"import pathlib\nf = pathlib.Path({str(tmp_path / 'there')!r})\n"
    once += f"if not f.exists():\n    f.touch(); {kill}"
    start, calls = started(once)
    (done,) = LocalProcesses(1, start).each([Job("v/a", ())])
    assert (done.exit_code, done.problem, len(calls)) == (0, "", 2)
    start, calls = started(kill)
    (done,) = LocalProcesses(1, start).each([Job("v/a", ())])
    assert done.problem.startswith("its process was killed (signal 9), as the system does where")
    assert "(`--jobs`)" in done.problem and len(calls) == 2


def test_a_long_reason_shows_that_it_goes_on() -> None:
    start, _ = started("import sys; sys.exit('Error: ' + 600 * 'word ')")
    (done,) = LocalProcesses(1, start).each([Job("v/a", ())])
    assert 1980 < len(done.problem) <= 2004 and done.problem.endswith("word word ...")


def test_whoever_gives_up_leaves_no_process_behind() -> None:
    start, calls = started("import sys, time; time.sleep(0 if sys.argv[1] == 'short' else 60)")
    jobs = [Job("v/short", ("short",)), *(Job(f"v/{k}", ("long",)) for k in range(3))]
    running = LocalProcesses(2, start).each(jobs)
    assert next(running).key == "v/short"
    running.close()  # type: ignore[attr-defined]
    assert len(calls) <= 3


def test_the_problem_is_the_error_without_what_came_before() -> None:
    assert problem_of("Warning: x\nError: y: z\n  Do it.\n") == "y: z. Do it."
    assert problem_of("") == ""


def test_the_page_says_of_a_trial_to_look_at_all_that_is_wrong_and_what_to_do(
    plan: CampaignPlan,
) -> None:
    why = " ".join(["what is wrong with it"] * 20) + ". Do this."
    done = run_campaign(plan, Told(), runner=Refusing(why), warm=lambda _: None)
    assert why in write_page(plan.output, done).read_text()
    (row,) = repeats(done.result).rows  # of the terminal
    assert str(row[-1]).endswith(" ...") and len(str(row[-1])) < len(why)


def test_a_problem_without_end_is_cut_between_words() -> None:
    assert first_words("one two three", 13) == "one two three"
    assert first_words("one two three", 11) == "one two ..."


# --- what is meant --------------------------------------------------------------------------


def written(folder: Path, text: str) -> Path:
    (folder / "boat.toml").write_text((SAMPLES / "remus100.toml").read_text())
    for trial in ("a", "b", ".hidden"):
        (folder / "logs" / trial).mkdir(parents=True)
        (folder / "logs" / trial / "gyro.csv").write_text("time_s,r_degps\n")
    (folder / "campaign.toml").write_text(text)
    return folder / "campaign.toml"


VEHICLE = '[[vehicle]]\nname = "boat"\nfile = "boat.toml"\ntrials = ["logs/*"]\n'


def test_a_campaign_file_names_vehicles_trials_and_options(tmp_path: Path) -> None:
    text = f'[campaign]\njobs = 3\n[run]\nplane = "both"\n{VEHICLE}'
    campaign, trials = read_campaign(written(tmp_path, text))
    assert (campaign.campaign.jobs, campaign.campaign.false_alarms) == (3, 0.01)
    assert [(t.vehicle, t.name, t.options.plane) for t in trials] == [
        ("boat", "a", "both"),
        ("boat", "b", "both"),
    ]
    assert "campaign" in call("schema", "campaign").out


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (VEHICLE.replace("logs/*", "no/*"), "no log fits 'no/\\*'"),
        (VEHICLE.replace("logs/*", "**logs"), "not a valid pattern"),
        (VEHICLE.replace("logs/*", "../*"), "leads out of the log folder"),
        (VEHICLE + VEHICLE, "two vehicles are named boat"),
        (VEHICLE.replace('"boat.toml"', '"/etc/boat.toml"'), "outside the folder"),
        (VEHICLE + "colour = 1\n", "unknown key"),
        (VEHICLE.replace('"boat"', '"../boat"'), "name"),
        (VEHICLE.replace('"boat"', '"Campaign.html"'), "the vehicle is named Campaign.html, as a"),
        (VEHICLE.replace("boat.toml", "baot.toml"), "baot.toml: no such file"),
        (VEHICLE + 'map = "map.toml"\n', "map.toml: no such file"),
        (VEHICLE + '[vehicle.run]\nplan = "nonesuch"\n', "there is no such plan"),
        ('[run]\nplan = "own.toml"\n' + VEHICLE, "own.toml: no such file"),
        (VEHICLE.replace('["logs/*"]', "[]"), "trials: is an empty list\n"),
        (VEHICLE.replace('["logs/*"]', '"logs/*"'), "trials: is a list: write \\[...\\]"),
    ],
)
def test_what_is_wrong_in_a_campaign_file_is_told(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        read_campaign(written(tmp_path, text))


def test_a_plan_stands_beside_the_campaign_file(tmp_path: Path) -> None:
    """Wherever the program is called from; the plans of the program are known by name."""
    file = written(tmp_path, '[run]\nplan = "own.toml"\n' + VEHICLE)
    (tmp_path / "own.toml").write_text('name = "own"\ncontinues = "together"\n')
    assert {t.options.plan for t in read_campaign(file)[1]} == {str(tmp_path / "own.toml")}
    file.write_text('[run]\nplan = "likely"\n' + VEHICLE)
    assert {t.options.plan for t in read_campaign(file)[1]} == {"likely"}


def test_results_among_the_logs_are_no_trials(tmp_path: Path) -> None:
    """Those of this campaign, of one that went to another folder, and a run."""
    file = written(tmp_path, VEHICLE)
    logs = tmp_path / "logs"
    (logs / "here" / "boat").mkdir(parents=True)
    (logs / "before").mkdir()
    (logs / "before" / "campaign.json").write_text("{}")
    (logs / "run").mkdir()
    (logs / "run" / "run.json").write_text('{"schema": "auvident/run/1"}')
    assert [t.name for t in read_campaign(file, logs / "here")[1]] == ["a", "b"]


def test_a_file_is_a_trial_by_all_of_its_name(tmp_path: Path) -> None:
    file = written(tmp_path, VEHICLE.replace("logs/*", "logs/*.csv.gz"))
    for day in ("2026.05.09", "2026.05.10"):
        (tmp_path / "logs" / f"{day}.csv.gz").write_text("")
    assert [t.name for t in read_campaign(file)[1]] == ["2026.05.09", "2026.05.10"]


def test_a_run_in_the_folder_of_its_log_is_refused_once() -> None:
    trials = [planned("logs", "a", "out/logs/a"), planned("logs", "b", "out/logs/b")]
    with pytest.raises(UsageError, match="run of logs/a would stand in the folder of its log"):
        refuse_among_logs(CampaignPlan(Path("out"), trials))
    refuse_among_logs(CampaignPlan(Path("other"), trials))


def test_what_a_campaign_cannot_be_made_of_is_told(demo: Path) -> None:
    """A vehicle file in place of the campaign, a folder that is none, a file for the output."""
    vehicle = "sample_logs/remus100.toml"
    called = call("campaign", vehicle, "--output", "out")
    assert called.code == 3 and "is a vehicle file, not a campaign file" in called.err
    assert "--vehicle" in called.err
    called = call("campaign", "nothing", "--output", "out")
    assert called.code == 3 and "nothing: no such folder" in called.err
    Path("out").write_text("")
    called = call("campaign", "sample_logs/kvlcc2", "--vehicle", vehicle, "--output", "out")
    assert called.code == 2 and "out: is a file, not a folder" in called.err


def test_a_trial_is_not_named_as_the_pooled_model_beside_its_run(tmp_path: Path) -> None:
    file = written(tmp_path, VEHICLE)
    (tmp_path / "logs" / "pooled.json").mkdir()
    with pytest.raises(InputError, match=r"the trial is named pooled\.json, as a file") as caught:
        read_campaign(file)
    assert caught.value.remedy == "Rename it."


def test_a_folder_needs_a_vehicle(tmp_path: Path) -> None:
    written(tmp_path, VEHICLE)
    with pytest.raises(InputError, match=r"there is no vehicle\.toml"):
        trials_in_folders([tmp_path / "logs"], None, OPTIONS)
    found = trials_in_folders([tmp_path / "logs"], tmp_path / "boat.toml", OPTIONS)
    assert [(t.vehicle, t.name) for t in found] == [("logs", "a"), ("logs", "b")]
    both = [tmp_path / "logs", tmp_path / "logs"]
    with pytest.raises(UsageError, match="two folders are named logs"):
        trials_in_folders(both, tmp_path / "boat.toml", OPTIONS)
    assert Campaign.model_json_schema()["required"] == ["vehicle"]


# --- pooled runs ----------------------------------------------------------------------------


def test_runs_are_pooled_without_their_logs(demo: Path, tmp_path: Path) -> None:
    (tmp_path / "sample_logs").unlink()
    found = pool_runs([demo, demo / "identify" / "model.json"])
    assert [t.trial for t in found.model.pooling.trials] == ["demo", "model.json"]
    assert date_of(demo) == ""


def test_a_run_that_ends_without_effects_is_pooled_by_the_model_with_the_small_ones(
    demo: Path,
) -> None:
    file, model = find_model(demo)
    along = json.loads((file.parent / "along.json").read_text())
    assert not any(e["id"] == "current" for e in model.effects)
    assert any(e["id"] == "current" for e in along["effects"])
    symbols = {p.symbol for p in pool_runs([demo]).model.pooling.parameters}
    assert "propeller_lag.lag_s" in symbols  # the vehicle's own; its water is gone
    shutil.copy(file, "model.json")  # a model by itself is taken as it is
    alone = {p.symbol for p in pool_runs([Path("model.json")]).model.pooling.parameters}
    assert "propeller_lag.lag_s" not in alone


def another_model_of_the_same_log(run: Path, other: Path) -> None:
    """A copy of a run whose model came out a little otherwise."""
    shutil.copytree(run, other)
    file = other / "identify" / "model.json"
    tree = json.loads(file.read_text())
    (row,) = [c for c in tree["coefficients"] if c["symbol"] == "Y_uud"]
    row["value"] *= 1.001
    file.write_text(json.dumps(tree))


def test_two_runs_of_one_log_count_once_though_their_models_differ(demo: Path) -> None:
    another_model_of_the_same_log(demo, Path("runs/other"))
    found = pool_runs([demo, Path("runs/other")]).model
    first, second = found.pooling.trials
    assert (first.used, second.used) == (True, False)
    assert second.reason == "its log harbour_trial is in demo too"
    assert [f.where for f in found.findings if f.code == "same-log"] == ["other"]


def test_the_logs_behind_a_model_are_told_by_their_gyros(demo: Path) -> None:
    file, model = find_model(demo)
    gyro = sha256_of(SAMPLES / "harbour_trial" / "gyro.csv")
    assert logs_behind(file, model) == {gyro: "harbour_trial"}
    manifest, quality = demo / "run.json", demo / "ingest" / "quality.json"
    # through a link of another name, beside a trial that the model is not from
    manifest.write_text(manifest.read_text().replace("harbour_trial/", "latest/"))
    tree = json.loads(quality.read_text())
    tree["trials"].append({**tree["trials"][0], "trial": "dive"})
    quality.write_text(json.dumps(tree))
    assert logs_behind(file, model) == {gyro: "harbour_trial"}
    shutil.copy(file, "model.json")
    assert logs_behind(Path("model.json"), model) == {}


def test_a_run_that_was_left_out_is_predicted_beside_its_own_model(demo: Path) -> None:
    shutil.copy(demo / "identify" / "model.json", "model.json")  # it stands for another trial
    found = pool_runs([Path("model.json")])
    rows = {row.channel: row for row in left_out_errors(found.model, [demo])}
    assert rows.keys() >= {"u", "v", "r", "heading"}
    assert all(0.0 < row.pooled < 20.0 * row.own for row in rows.values())
    with pytest.raises(UsageError, match="went into the pooled model"):
        left_out_errors(pool_runs([demo]).model, [demo])


def test_a_run_that_was_pooled_is_known_by_any_path_and_by_its_log(demo: Path) -> None:
    pooled = pool_runs([demo]).model
    Path("link").symlink_to(demo)
    for path in (demo.resolve(), Path("runs/../runs/demo"), Path("link")):
        with pytest.raises(UsageError, match=": went into the pooled model"):
            left_out_errors(pooled, [path])
    another_model_of_the_same_log(demo, Path("runs/other"))
    with pytest.raises(UsageError, match="the log harbour_trial went into the pooled model"):
        left_out_errors(pooled, [Path("runs/other")])


def test_runs_with_other_vehicle_files_are_refused_with_the_keys(demo: Path) -> None:
    other = Path("runs/other")
    shutil.copytree(demo, other)
    file = other / "ingest" / "vehicle.json"
    tree = json.loads(file.read_text())
    tree["vehicle"]["mass_kg"] += 1.0
    file.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"vehicle\.mass_kg 31\.48 \(there 30\.48\)"):
        pool_runs([demo, other])


def test_a_change_is_a_gate() -> None:
    change = VehicleChange(
        kind="step", what="fin", symbols=("Y_uud",), sentence="since b the rudder gives 18 % less",
        trial="b", earliest="b", latest="b", size=-0.18, std=0.03, low=-0.24, high=-0.12, unit="-",
        share=True, score=-6.0, p=0.0005,
    )  # fmt: skip
    found = Changes(
        vehicle="boat", plane="horizontal", trials=("a", "b"), false_alarms=0.01, changes=(change,)
    )
    with pytest.raises(GateError, match="the rudder gives 18 % less") as caught:
        refuse_change(found)
    assert caught.value.exit_code == 1
    vehicle = CampaignVehicleResult(name="boat", plane="horizontal", changes=found)
    result = CampaignResult(program_version="0", trials=(), vehicles=(vehicle,))
    with pytest.raises(GateError, match="boat: since b"):
        refuse_changes(result)
    refuse_change(found.model_copy(update={"changes": ()}))
