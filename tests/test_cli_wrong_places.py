"""Commands that are given another folder or file than the one they take: what they advise."""

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
