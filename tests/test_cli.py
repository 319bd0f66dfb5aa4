"""The command line: help, examples, output, exit codes."""

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import click
import pandas as pd
import pytest

from auvident.cli import COLLECTED_AFTER, COMMANDS, cli, interrupt
from auvident.pipeline import STAGES
from tests import loop_world
from tests.command_line import ENVIRONMENT, PROGRAM, Called

ALL = [name for names in COMMANDS.values() for name in names]
HELP_SECONDS = 0.3  # what the user is promised; of processor time, the best of several attempts


def command_of(name: str) -> click.Command:
    found = cli.get_command(click.Context(cli), name)
    assert found is not None
    return found


def examples_of(name: str) -> list[str]:
    lines = (command_of(name).epilog or "").replace(" \\\n      ", " ").splitlines()
    return [line.strip() for line in lines if line.strip().startswith("auvident ")]


@pytest.mark.parametrize("name", ALL)
def test_every_command_has_help_that_ends_in_an_example(
    auvident: Callable[..., Called], name: str
) -> None:
    called = auvident(name, "--help")
    assert called.code == 0
    assert command_of(name).help
    assert examples_of(name)
    flat = called.out.replace(" \\\n       ", "").strip()
    assert flat.splitlines()[-1].strip() == examples_of(name)[-1]


@pytest.mark.parametrize("name", ALL)
def test_every_option_is_explained(name: str) -> None:
    for parameter in command_of(name).params:
        if isinstance(parameter, click.Option):
            assert parameter.help, parameter.name


@pytest.mark.parametrize("example", [e for name in ALL for e in examples_of(name)])
def test_every_example_works(
    demo: Path, auvident: Callable[..., Called], example: str, tmp_path: Path
) -> None:
    import shutil

    shutil.copytree(demo, tmp_path / "runs" / "other")
    called = auvident(*example.split()[1:])
    assert called.code == 0, called.err


def test_every_stage_has_a_command() -> None:
    assert {stage.name for stage in STAGES} <= set(ALL)


@pytest.mark.parametrize("command", ["stage", "run"])
@pytest.mark.parametrize("stage", STAGES, ids=lambda s: s.name)
def test_the_help_tells_the_defaults_of_the_stages(
    auvident: Callable[..., Called], stage: object, command: str
) -> None:
    text = auvident(stage.name if command == "stage" else "run", "--help").out  # type: ignore
    flat = " ".join(text.split())
    for key, default in stage.options.items():  # type: ignore[attr-defined]
        if default not in (None, ()):
            shown = f"{default:g}" if isinstance(default, float) else str(default)
            option = f"--{key.removesuffix('_hz').removesuffix('_s').replace('_', '-')} "
            assert option in flat
            assert f"[default: {shown}]" in flat.split(option, 1)[1].split(" --")[0]


def test_help_is_there_at_once() -> None:
    """Nothing heavy is imported for it; seconds are those of the fastest of five."""

    def of_children() -> float:
        spent = os.times()
        return spent.children_user + spent.children_system

    seconds = []
    for _ in range(5):
        before = of_children()
        subprocess.run([PROGRAM, "--help"], check=True, capture_output=True, env=ENVIRONMENT)
        seconds.append(of_children() - before)
    assert 0.0 < min(seconds) < HELP_SECONDS


NUMBERS = {"scipy", "numba", "matplotlib", "jinja2"}
TABLES = {"pandas", "pyarrow"}
BASE = {"numpy", "pydantic", "rich"}
SAMPLE = ("sample_logs/harbour_trial", "--vehicle", "sample_logs/remus100.toml", "--run")
WITHOUT = [
    (("--help",), BASE | TABLES | NUMBERS),
    (("ingest", "--help"), BASE | TABLES | NUMBERS),
    (("ase", "--vehicle", SAMPLE[2]), TABLES | NUMBERS),
    (("ingest", *SAMPLE), NUMBERS),
]


@pytest.mark.parametrize(("arguments", "heavy"), WITHOUT, ids=[" ".join(a[:2]) for a, _ in WITHOUT])
def test_a_command_loads_no_library_that_it_does_not_need(
    arguments: tuple[str, ...], heavy: set[str], tmp_path: Path
) -> None:
    own = str(tmp_path / "run")
    loaded = loaded_by([*arguments, own] if "--run" in arguments else arguments)
    assert len(loaded) > 50 and not heavy & loaded


def test_to_identify_needs_no_tables_and_no_special_functions(demo: Path) -> None:
    loaded = loaded_by(["identify", str(demo), "--plan", "together"])
    assert "numba" in loaded
    assert not {"pandas", "scipy.special", "matplotlib", "jinja2"} & loaded


@pytest.mark.parametrize("stage", ["segment", "diagnose"])
def test_to_find_maneuvers_or_effects_needs_no_tables(stage: str, demo: Path) -> None:
    loaded = loaded_by([stage, str(demo)])
    assert "numpy" in loaded
    assert not {"pandas", "matplotlib", "jinja2"} & loaded


def loaded_by(command: Sequence[str]) -> set[str]:
    """Modules that a command has loaded when it ends."""
    script = (
        "import sys; from auvident.cli import _run\n"
        "assert not _run(sys.argv[1:]); print('loaded', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *command],
        check=True, capture_output=True, text=True, env=ENVIRONMENT,
    )  # fmt: skip
    return set(done.stdout.rpartition("\nloaded")[2].split())


# `combine` of a run of one plane writes where it is told to: tests/test_cli_combine.py
OF_ONE_PLANE = [s for s in STAGES if s.name != "ingest" and not s.needs_both]


@pytest.mark.usefixtures("quick_loop")
@pytest.mark.parametrize("stage", OF_ONE_PLANE, ids=lambda s: s.name)
def test_json_is_the_main_artifact_and_nothing_else(
    demo: Path, auvident: Callable[..., Called], stage: object
) -> None:
    name, main = stage.name, stage.main  # type: ignore[attr-defined]
    if not main.endswith(".json"):
        pytest.skip("its main artifact is no JSON")
    called = auvident(name, demo, "--json")
    assert called.code == 0, called.err
    assert called.out.encode() == (demo / main).read_bytes()


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_a_quiet_run_says_one_line(demo: Path, auvident: Callable[..., Called]) -> None:
    called = auvident("run", "--run", demo, "--rate", "5", "--quiet")
    assert (called.code, called.err) == (0, "")
    report = f"Report: {demo}/report/report.html"
    assert called.out == f"{loop_world.NONE.split('. ')[0].rstrip('.')}. {report}\n"
    called = auvident("run", "--run", demo, "--quiet", "--json")
    assert json.loads(called.out)["run"] == str(demo) and called.err == ""


def test_a_quiet_stage_says_nothing(demo: Path, auvident: Callable[..., Called]) -> None:
    called = auvident("segment", demo, "--quiet")
    assert (called.code, called.out, called.err) == (0, "", "")


def test_there_is_no_progress_bar_in_a_pipe(demo: Path) -> None:
    done = subprocess.run(
        [PROGRAM, "identify", str(demo)], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stderr
    assert "\r" not in done.stderr


def test_status_says_what_is_stale_and_why(demo: Path, auvident: Callable[..., Called]) -> None:
    (demo / "segment" / "maneuvers.json").write_text("[]\n")
    called = auvident("status", demo, "--json")
    stages = {s["stage"]: s for s in json.loads(called.out)["stages"]}
    assert stages["ingest"]["state"] == "done"
    assert stages["segment"]["state"] == "stale"
    assert stages["segment"]["reason"] == "segment/maneuvers.json was changed after it was written"
    assert stages["identify"]["reason"] == "segment is stale"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("segmnt", "x"), "segment"),
        (("segment",), "RUN"),
        (("ingest", "log", "--run", "r"), "--vehicle"),
        (("ingest", "--vehicle", "v", "--run", "r"), "LOG"),
        (("identify", "runs/demo", "--filter", "kalman"), "ukf"),
        (("segment", "runs/demo", "--hold-out", "nothing"), "nothing"),
        (
            (
                "ingest",
                "sample_logs/harbour_trial",
                "--vehicle",
                "sample_logs/remus100.toml",
                "--run",
                "runs/new",
                "--rate",
                "-3",
            ),
            "rate",
        ),
        (("status", "sample_logs/remus100.toml"), "run directory"),
        (("schema", "nothing"), "vehicle"),
        (("compare", "runs/demo"), "two"),
        (("ase", "runs/demo", "--sweep", "a.b=1:2:3"), "--vehicle"),
    ],
)
def test_wrong_usage_ends_with_2(
    demo: Path, auvident: Callable[..., Called], arguments: tuple[str, ...], word: str
) -> None:
    called = auvident(*arguments)
    assert called.code == 2, called.err
    assert word in called.err
    assert "Traceback" not in called.err
    assert called.out == ""


def test_a_fault_of_the_program_asks_for_a_report(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path) -> None:
        raise KeyError("oops")

    monkeypatch.setattr("auvident.pipeline.status", fail)
    monkeypatch.setattr("tempfile.tempdir", str(demo))
    called = auvident("status", demo)
    assert called.code == 70
    assert len(list(demo.glob("auvident-crash-*.txt"))) == 1
    assert "with the file" in called.err
    assert "Traceback" not in called.err
    assert "Traceback" in auvident("status", demo, "--verbose").err


def test_interruption_is_no_fault(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(path: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("auvident.pipeline.status", interrupt)
    called = auvident("status", demo)
    assert called.code == 130
    assert "Traceback" not in called.err


def test_ase_of_vehicle_files(demo: Path, auvident: Callable[..., Called]) -> None:
    files = ("sample_logs/remus100.toml", "sample_logs/tern180.toml")
    one = json.loads(auvident("ase", "--vehicle", files[0], "--json").out)
    assert one["vehicle"] == "REMUS 100"
    assert {"symbol", "plane", "value", "std", "unit", "prime", "parts"} <= set(
        one["coefficients"][0]
    )
    two = json.loads(auvident("ase", *files, "--json").out)
    assert [result["vehicle"] for result in two] == ["REMUS 100", "Tern 180"]


def test_a_sweep_goes_to_a_file(demo: Path, auvident: Callable[..., Called]) -> None:
    called = auvident(
        "ase",
        "--vehicle",
        "sample_logs/tern180.toml",
        "--sweep",
        "rudder.exposed_span_m=0.08:0.16:5",
        "--output",
        "sweep.parquet",
    )
    assert called.code == 0, called.err
    table = pd.read_parquet("sweep.parquet")
    assert len(table) == 5
    assert table["N_uud"].is_monotonic_decreasing  # a larger rudder turns harder


def test_coefficients_and_schemas_come_from_the_program(auvident: Callable[..., Called]) -> None:
    from auvident.pipeline.schemas import SCHEMAS
    from auvident.schema.coefficients import COEFFICIENTS, CONSTANTS, ESTIMATED

    listed = json.loads(auvident("coefficients", "--json").out)
    assert [c["symbol"] for c in listed["coefficients"]] == [c.symbol for c in COEFFICIENTS]
    assert [c["symbol"] for c in listed["constants"]] == [c.symbol for c in CONSTANTS]
    shown = auvident("coefficients").out
    assert all(symbol in shown for symbol in ESTIMATED)
    for name in SCHEMAS:
        schema = json.loads(auvident("schema", name).out)
        assert properties(schema)


def properties(schema: dict) -> dict:
    """Keys of a schema, of its elements, or of the class it refers to."""
    if "$ref" in schema:
        return properties(schema["$defs"][schema["$ref"].rsplit("/", 1)[-1]])
    found = schema.get("properties") or schema["$defs"]["Maneuver"]["properties"]
    assert isinstance(found, dict)
    return found


def test_artifacts_fit_their_schemas(demo: Path) -> None:
    """Every key that an artifact has is in its schema."""
    from auvident.pipeline.schemas import SCHEMAS, json_schema

    checked = 0
    for name, (file, _) in SCHEMAS.items():
        if not (demo / file).exists() or name == "maneuvers":
            continue
        tree = json.loads((demo / file).read_text())
        assert set(tree) <= set(properties(json_schema(name)))
        checked += 1
    assert checked >= 4


def test_inspect_proposes_a_map_that_works(demo: Path, auvident: Callable[..., Called]) -> None:
    import shutil

    odd = Path("odd_trial")
    shutil.copytree("sample_logs/harbour_trial", odd)
    text = (odd / "rudder.csv").read_text().replace("rudder_deg", "delta_cmd", 1)
    (odd / "servo.csv").write_text(text)
    (odd / "rudder.csv").unlink()
    arguments = ("ingest", odd, "--vehicle", "sample_logs/remus100.toml", "--run", "runs/odd")
    assert auvident(*arguments).code == 3
    called = auvident("inspect", odd, "--output", "map.toml")
    assert called.code == 0
    assert called.out == ""
    called = auvident(*arguments, "--map", "map.toml", "--quiet")
    assert called.code == 0, called.err
    same = [
        pd.read_parquet(p)["rudder_rad"]
        for p in ("runs/odd/ingest/odd_trial.parquet", demo / "ingest/harbour_trial.parquet")
    ]
    pd.testing.assert_series_equal(*same)


def test_compare_puts_runs_side_by_side(demo: Path, auvident: Callable[..., Called]) -> None:
    import shutil

    shutil.copytree(demo, "runs/other")
    auvident("identify", "runs/other", "--filter", "ukf", "--quiet")
    comparison = json.loads(auvident("compare", demo, "runs/other", "--json").out)
    assert [run["filter"] for run in comparison["runs"]] == ["ekf", "ukf"]
    model = json.loads((demo / "refine" / "model.json").read_text())
    row = next(r for r in comparison["coefficients"] if r["symbol"] == "N_uud")
    assert row["value"][0] == next(
        c["value"] for c in model["coefficients"] if c["symbol"] == "N_uud"
    )
    assert row["apart"] > 0.0


def test_what_a_command_prints_as_json_names_its_schema(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    for command in (
        ("inspect", "sample_logs/harbour_trial/rpm.csv"),
        ("status", demo),
        ("compare", demo, demo),
        ("plan-trial", demo),
        ("export", demo),
        ("new-vehicle",),
    ):
        assert json.loads(auvident(*command, "--json").out)["schema"].startswith("auvident/")


def test_a_model_that_is_taken_as_it_is_says_what_changed_since(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """`plan-trial` refuses it; what is exported, flown or compared was of before without a word."""
    log = ("--inputs", "sample_logs/harbour_trial", "--from", "1373", "--to", "1380")
    commands = (
        ("export", demo, "--format", "toml"),
        ("simulate", demo, "--maneuver", "zigzag:10/10", "--samples", "2"),
        ("simulate", demo, *log, "--samples", "2", "--output", "flown.csv"),
        ("combine", demo),
        ("compare", demo, demo),
    )
    said = "vehicle.toml changed since its model was identified"
    vehicle = Path("vehicle.toml")
    text = Path("sample_logs/remus100.toml").read_text()
    vehicle.write_text(text)
    manifest = demo / "run.json"
    manifest.write_text(manifest.read_text().replace("sample_logs/remus100.toml", "vehicle.toml"))
    assert all(said not in auvident(*command).err for command in commands)
    vehicle.write_text(text.replace("mass_kg = 30.48", "mass_kg = 30.6"))
    for command in commands:
        called = auvident(*command)
        assert called.code == 0, called.err
        told = " ".join(called.err.split())
        assert said in told and "`auvident run --run runs/demo`" in told
        assert said not in called.out
    (compared, _) = json.loads(auvident("compare", demo, demo, "--json").out)["runs"]
    assert said in compared["outdated"]
    vehicle.unlink()  # what is gone says nothing
    assert all(said not in auvident(*command).err for command in commands)


def test_gates_decide_by_the_held_out_error(demo: Path, auvident: Callable[..., Called]) -> None:
    metrics = json.loads((demo / "validate" / "metrics.json").read_text())
    error = metrics["summary"]["validate"]["r"]["rmse"]
    assert auvident("validate", demo, "--fail-above", f"r={1.001 * error}").code == 0
    called = auvident("validate", demo, "--fail-above", f"r={0.999 * error}", "--fail-above", "u=9")
    assert called.code == 1
    assert "r: RMSE" in called.err
    assert "u: RMSE" not in called.err
    assert auvident("run", "--run", demo, "--fail-above", "u=1e-6").code == 1
    assert auvident("run", "--run", demo, "--fail-above", "u=9").code == 0
    for wrong in ("nothing=1", "u", "u=x", "=1"):
        assert auvident("validate", demo, "--fail-above", wrong).code == 2
    early = auvident("run", "no", "--vehicle", "no.toml", "--run", "r", "--fail-above", "x=1")
    assert early.code == 2 and "One of u, v, w, r, q, heading, pitch, track." in early.err


def test_a_run_that_is_worse_than_the_baseline_fails(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    import shutil

    shutil.copytree(demo, "runs/baseline")
    file = Path("runs/baseline/refine/comparison.json")
    content = json.loads(file.read_text())
    errors = content["held_out"]["after"]
    errors["r"]["rmse"] *= 0.8  # the baseline was better
    text = json.dumps(content).encode()
    manifest = Path("runs/baseline/run.json")
    known = manifest.read_text().replace(
        hashlib.sha256(file.read_bytes()).hexdigest(), hashlib.sha256(text).hexdigest()
    )
    file.write_bytes(text)
    manifest.write_text(known)
    gate = ("compare", demo, "runs/baseline", "--fail-if-worse")
    assert auvident(*gate, "26%").code == 0
    called = auvident(*gate, "0.24")
    assert called.code == 1
    assert "r RMSE" in called.err and "u RMSE" not in called.err
    assert auvident("compare", "runs/baseline", demo, "--fail-if-worse", "0").code == 0
    for wrong in ("much", "-1", "nan", "inf%"):
        assert auvident(*gate, wrong).code == 2


def test_a_gate_with_nothing_held_out_is_not_met(demo: Path) -> None:
    from auvident.errors import GateError
    from auvident.pipeline.gates import check_planes, predicted
    from auvident.schema.artifacts import Finding, Metrics

    metrics = Metrics.model_validate_json((demo / "validate" / "metrics.json").read_bytes())
    identify = {"identify": metrics.summary["identify"]}
    with pytest.raises(GateError, match="no held-out maneuver measures"):
        check_planes([predicted(metrics.model_copy(update={"summary": identify}))], {"u": 9.0})
    escaped = Finding(code="prediction-ran-away", message="", where="zigzag-9")
    with pytest.raises(GateError, match="diverges"):
        lost = metrics.model_copy(update={"findings": (escaped,)})
        check_planes([predicted(lost)], {"u": 9.0})


def test_json_of_a_whole_run_has_the_main_artifacts(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    called = auvident("run", "--run", demo, "--json")
    found = json.loads(called.out)
    states = ["not needed" if s.needs_both else "done" for s in STAGES]
    assert [d["state"] for d in found["decisions"]] == states
    assert found["identify"] == json.loads((demo / "identify" / "model.json").read_text())


def test_the_module_is_the_program_and_ctrl_c_leaves_a_message(demo: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "auvident", "run", "--run", str(demo), "--rate", "20"],
        stderr=subprocess.PIPE,
        env=ENVIRONMENT,
        text=True,
        # whoever runs the tests in the background may have told them to ignore Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    assert process.stderr.readline().startswith("ingest: runs again")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Interrupted" in err
    assert "Traceback" not in err


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C is heard, also where whoever runs the tests in the background had it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    interrupt.listen()
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_ctrl_c_that_a_library_swallowed_is_raised_at_the_next_word() -> None:
    from auvident.cli.watch import Watch

    watch = Watch(quiet=True)
    interrupt.listen()
    watch.decided("ingest", "runs")  # nobody asked for anything
    with contextlib.suppress(KeyboardInterrupt):  # as a library's bare `except` does
        signal.raise_signal(signal.SIGINT)
    for word in (lambda: watch.decided("segment", "runs"), lambda: watch.progress("half")):
        with pytest.raises(KeyboardInterrupt):
            word()
    interrupt.listen()
    watch.decided("ingest", "runs")  # another command, in the same process


@pytest.mark.usefixtures("heard")
def test_an_interrupt_that_a_library_makes_its_own_error_of_is_no_bug(monkeypatch, capsys) -> None:
    from auvident import cli as program

    def library(**_):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise ValueError("no schema")

    monkeypatch.setattr(program.cli, "main", library)
    with pytest.raises(SystemExit) as caught:
        program.main([])
    assert caught.value.code == 130
    assert capsys.readouterr().err.startswith("Interrupted")


def test_an_interrupt_within_an_exec_leaves_the_exit_code_as_it_is(tmp_path: Path) -> None:
    """Run as a module, as `python -m auvident` is: there CPython ends by the signal otherwise."""
    lines = [
        "import sys",
        "from auvident.cli import interrupt",
        "try:",
        "    exec('raise KeyboardInterrupt')",
        "except KeyboardInterrupt:",
        "    if len(sys.argv) > 1: interrupt.heeded()",
        "sys.exit(130)",
    ]
    (tmp_path / "stopped.py").write_text("\n".join(lines))
    command = [sys.executable, "-m", "stopped"]
    assert subprocess.run([*command, "heeded"], cwd=tmp_path, env=ENVIRONMENT).returncode == 130


def test_plan_trial_needs_a_model_that_is_up_to_date(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    plan = json.loads(auvident("plan-trial", demo, "--json").out)
    gains = [c["gain_nats"] for c in plan["candidates"]]
    assert len(gains) > 3
    assert gains == sorted(gains, reverse=True)
    auvident("segment", demo, "--hold-out", "harbour_trial-turn-4", "--quiet")
    called = auvident("plan-trial", demo)
    assert called.code == 4
    assert f"auvident identify {demo}" in called.err


def test_the_program_looks_for_cycles_of_garbage_less_often_than_python_does() -> None:
    script = (
        "import gc; from auvident.cli import _run; _run(['--version']); print(gc.get_threshold())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, env=ENVIRONMENT
    )
    assert str(COLLECTED_AFTER) in done.stdout
