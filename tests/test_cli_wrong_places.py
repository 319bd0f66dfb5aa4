"""Commands that are given another folder or file than the one they take: what they advise."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import Called


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("export", "runs/demo/refine"), 4, "It is a folder of the run demo; give that one."),
        (("report", "runs/demo/report"), 4, "It is a folder of the run demo; give that one."),
        (
            ("status", "sample_logs/harbour_trial"),
            4,
            "`auvident run sample_logs/harbour_trial --vehicle V.toml --run RUN` makes a run of it",
        ),
        (("status", "runs"), 4, "Give one of the runs in it: runs/demo."),
        (("inspect", "runs/demo"), 3, "is a run directory of auvident, not a log"),
        (("inspect", "runs/demo/ingest"), 3, "contains only files that auvident wrote"),
        (("export", "nothing"), 4, "Run `auvident ingest LOG... --vehicle V.toml --run nothing`"),
        (("plan-trial", "runs/demo/identify/model.json"), 2, "Give the run directory, runs/demo."),
        (("compare", "runs/demo", "runs/demo/run.json"), 4, "Give a model.json that auvident has"),
        (
            ("compare", "runs/demo", "sample_logs/remus100.toml"),
            3,
            "is a vehicle file, not a run or a model",
        ),
        (("compare", "runs/demo", "sample_logs/README.md"), 3, "README.md: is no model Give a run"),
        (("export", "runs/demo/ingest/quality.json"), 4, "its schema is 'auvident/quality/1'"),
        (("pool", "runs/demo/run.json"), 4, "Give a model.json that auvident has written."),
    ],
)
def test_what_is_no_run_or_no_model_is_told_with_what_to_give(
    words: tuple[str, ...], code: int, said: str, demo: Path, auvident: Callable[..., Called]
) -> None:
    shutil.copy(demo / "identify" / "model.json", "model.json")
    called = auvident(*words)
    assert called.code == code and said in " ".join(called.err.split())


def test_a_command_to_type_has_its_paths_in_quotes(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    run, log = Path("runs/first run"), Path("the log")
    demo.rename(run)
    called = auvident("export", run, "--format", "csv", "--plane", "vertical")
    assert called.code == 4 and "`auvident identify 'runs/first run' --plane both`" in called.err
    shutil.copytree("sample_logs/harbour_trial", log)
    called = auvident("export", log)
    assert "`auvident run 'the log' --vehicle V.toml --run RUN`" in " ".join(called.err.split())


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda m: m["coefficients"].pop(), "model.json: lacks N_uud"),
        (lambda m: m.update(length_m=0.0), "model.json: length_m is 0"),
        (
            lambda m: m.update(effects=[{"id": "rudder_lag", "parameters": []}]),
            "the effect rudder_lag has no internal value of rudder_lag.lag_s",
        ),
        (
            lambda m: m.update(effects=[{"id": "warp_drive", "internal": {}}]),
            "the effects warp_drive are unknown to this version",
        ),
    ],
)
def test_a_model_file_that_lacks_something_is_not_flown(
    spoil: Callable[[dict], None], said: str, demo: Path, auvident: Callable[..., Called]
) -> None:
    """Without the moment of its rudder it flew straight on; others ended as by a bug."""
    tree = json.loads((demo / "identify" / "model.json").read_text())
    spoil(tree)
    Path("model.json").write_text(json.dumps(tree))
    for words in (("simulate", "--maneuver", "zigzag:10/10", "--samples", "0"), ("combine",)):
        vehicle = ("--vehicle", "sample_logs/remus100.toml") if words[0] == "combine" else ()
        called = auvident(words[0], "model.json", *words[1:], *vehicle)
        assert called.code == 4 and said in " ".join(called.err.split())


def test_a_model_without_covariance_is_not_pooled(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    tree = json.loads((demo / "identify" / "model.json").read_text())
    Path("model.json").write_text(json.dumps(tree | {"covariance": {}}))
    called = auvident("pool", "model.json")
    assert called.code == 4 and "the model has no covariance" in " ".join(called.err.split())


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda m: m["constants"].pop(), "whole.json: lacks z_GW"),
        (lambda m: m.update(parameters={}), "rudder_rate_limit.rate_degps"),
        (lambda m: m.update(length_m=0.0), "length_m is 0"),
        (lambda m: m["effects"]["horizontal"][0].update(id="warp"), "effects warp are unknown"),
    ],
)
def test_a_combined_model_that_lacks_something_is_not_flown(
    spoil: Callable[[dict], None], said: str, demo: Path, auvident: Callable[..., Called]
) -> None:
    tree = json.loads(auvident("combine", demo, "--json").out)
    spoil(tree)
    Path("whole.json").write_text(json.dumps(tree))
    flown = ("simulate", "whole.json", "--maneuver", "zigzag:10/10", "--samples", "0")
    for words in (flown, ("export", "whole.json", "--format", "pvs")):
        called = auvident(*words)
        told = " ".join(called.err.split())
        assert called.code == 4 and said in told and "auvident combine" in told
