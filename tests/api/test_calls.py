"""`auvident.run` and what it leaves behind: nothing but the run directory."""

import json
import os
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from threadpoolctl import threadpool_info

import auvident
from auvident.pipeline import run as pipeline_run
from tests.command_line import ENVIRONMENT, Called

AGAIN: dict[str, Any] = {
    "logs": "sample_logs/harbour_trial",
    "vehicle": "sample_logs/remus100.toml",
    "run": "runs/demo",
}


class Told(auvident.Observer):
    """Notes what was decided."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def decided(self, stage: str, sentence: str) -> None:
        self.sentences.append(sentence)


def test_what_the_command_has_made_is_up_to_date(demo: Path) -> None:
    told = Told()
    run = auvident.run(**AGAIN, observer=told)
    assert run.path == demo
    done = [s for s in told.sentences if "up to date" in s]
    assert len(done) == 8 and "combine: skipped, it needs both planes" in told.sentences


def test_without_logs_those_of_the_last_run_are_taken(demo: Path) -> None:
    told = Told()
    auvident.run(run=demo, observer=told)
    assert not [s for s in told.sentences if "runs" in s]


def test_an_option_reaches_its_stage(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the work: the decisions say what would run, and why."""
    told = Told()
    monkeypatch.setattr(pipeline_run._Progress, "_run", lambda *_: None)
    auvident.run(run=demo, hold_out="harbour_trial-turn-1", plan="together", observer=told)
    said = "\n".join(told.sentences)
    assert "option hold_out changed from none to harbour_trial-turn-1" in said
    assert "option plan changed from refined to together" in said


def test_nothing_is_printed_unless_asked_for(demo: Path, capfd: pytest.CaptureFixture) -> None:
    run = auvident.run(**AGAIN)
    _ = run.coefficients, run.heldout, run.findings, run.model.maneuver("zigzag", draws=0)
    assert capfd.readouterr() == ("", "")
    auvident.run(**AGAIN, progress=True)
    out, err = capfd.readouterr()
    assert out == "" and "identify: up to date" in err.splitlines()


def state_of_the_process() -> dict[str, Any]:
    return {
        "folder": os.getcwd(),
        "environment": dict(os.environ),
        "warnings": list(warnings.filters),
        "signal": signal.getsignal(signal.SIGINT),
        "errors": np.geterr(),
        "blas": [(i["internal_api"], i["num_threads"]) for i in threadpool_info()],
    }


def use(run: Path) -> None:
    """A stage that is run again, and most of what a notebook does with a run."""
    made = auvident.run(run=run, seed=0)
    pipeline_run.run_stage("ase", run)
    made.plot.track()._repr_png_()
    made.model.simulate(made.signals, draws=2, to_s=410.0, from_s=400.0)
    made.model.start(speed_mps=1.0).step(0.1, 600.0)


def test_nothing_of_the_process_is_changed_in_a_thread_either(demo: Path) -> None:
    use(demo)  # what libraries do when they are loaded is theirs
    before = state_of_the_process()
    failed: list[BaseException] = []

    def work() -> None:
        try:
            use(demo)
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert failed == []
    assert state_of_the_process() == before


def test_stages_in_two_threads_take_turns(demo: Path, tmp_path: Path) -> None:
    """The number of threads of linear algebra is one for all, and put back once."""
    import shutil

    other = tmp_path / "other"
    shutil.copytree(demo, other)
    inside, most = [], []

    def look(given: Any) -> dict[str, Any]:
        inside.append(given)
        most.append(len(inside))
        threading.Event().wait(0.05)
        inside.pop()
        return {"ase/coefficients.json": given.ase}

    from dataclasses import replace

    stage = pipeline_run.BY_NAME["ase"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(pipeline_run.BY_NAME, "ase", replace(stage, function=look))
        both = [
            threading.Thread(target=pipeline_run.run_stage, args=("ase", run))
            for run in (demo, other)
        ]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()
    assert most == [1, 1]


# --- errors -------------------------------------------------------------------------------


def test_a_gate_that_is_not_met_is_an_error_and_the_run_is_there(demo: Path) -> None:
    auvident.run(run=demo, fail_above={"u": 1.0})
    with pytest.raises(auvident.GateError, match="u: RMSE"):
        auvident.run(run=demo, fail_above={"u": 1e-6})
    assert auvident.load_run(demo).heldout.loc["u", "rmse_identified"] > 1e-6


@pytest.mark.parametrize(
    ("given", "kind", "said"),
    [
        ({"run": "new"}, auvident.StageError, "new"),
        ({"run": "new", "logs": "sample_logs/harbour_trial"}, auvident.UsageError, "vehicle file"),
        ({**AGAIN, "run": "new", "logs": "nowhere"}, auvident.InputError, "nowhere"),
        ({**AGAIN, "run": "new", "vehicle": "no.toml"}, auvident.InputError, "no.toml"),
        ({**AGAIN, "filter": "kalman"}, auvident.UsageError, "ekf, ukf"),
        ({**AGAIN, "plan": "nothing"}, auvident.InputError, "nothing"),
    ],
)
def test_what_cannot_be_run_is_one_of_the_family(given, kind, said, demo: Path) -> None:
    with pytest.raises(kind, match=said):
        auvident.run(**given)
    assert not Path("new").exists()


def test_errors_say_what_where_and_what_to_do() -> None:
    with pytest.raises(auvident.AuvidentError) as caught:
        auvident.load_run("nowhere")
    assert caught.value.exit_code == 4
    assert caught.value.where == "nowhere" and "auvident ingest" in caught.value.remedy


def test_to_import_it_loads_nothing_heavy() -> None:
    script = (
        "import sys, auvident; auvident.InputError; dir(auvident);"
        "print({'numpy', 'pandas', 'numba', 'pydantic', 'click', 'rich'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", script]
    told = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "set()"


def test_trials_are_pooled_as_by_the_command(demo: Path, auvident: Callable[..., Called]) -> None:
    import auvident as interface

    told = json.loads(auvident("pool", demo, "--output", "told.json", "--json").out)
    made = interface.pool(demo)
    values = {c["symbol"]: c["value"] for c in told["coefficients"]}
    assert made.coefficients.loc[list(values), "value"].to_dict() == pytest.approx(values)
    assert made.artifact.pooling.trials[0].trial == "demo"  # type: ignore[attr-defined]
    table = {"time_s": np.arange(50) * 0.1, "rudder_deg": -5.0, "rpm": 800.0}
    flown = [m.simulate(pd.DataFrame(table), 0) for m in (made, interface.load_model("told.json"))]
    pd.testing.assert_frame_equal(*flown)
    with pytest.raises(interface.UsageError, match="nothing to pool"):
        interface.pool([])
