"""Pooled models among the models that are pooled, predicted with and compared; the gate."""

import json
import shutil
from pathlib import Path

import pytest

from auvident.errors import GateError, InputError
from auvident.pipeline.compare import compare_runs
from auvident.pipeline.gates import baseline_gates
from auvident.pipeline.left_out_runs import left_out_errors
from auvident.pipeline.pooling import pool_runs, refuse_change, told_apart, write_pooled
from auvident.pipeline.predict import find_model
from auvident.schema.changes import Changes
from tests.command_line import call


def changed(run: Path, other: Path, old: str, new: str) -> None:
    """A copy of a run whose models are a little otherwise."""
    shutil.copytree(run, other)
    for name in ("identify/model.json", "refine/model.json", "refine/along.json"):
        file = other / name
        file.write_text(file.read_text().replace(old, new))


def test_a_trial_that_a_pooled_model_has_counts_once(demo: Path) -> None:
    """A pooled model is pooled again with what came since, and with what it has already."""
    pooled = Path("pooled.json")
    write_pooled(pool_runs([demo]).model, pooled)
    both = pool_runs([pooled, demo]).model
    kept, out = both.pooling.trials
    assert (kept.used, out.used) == (True, False)
    assert out.reason == "its log harbour_trial is in pooled.json too"
    assert both.values() == pytest.approx(pool_runs([pooled]).model.values(), rel=1e-6)


def test_runs_of_one_name_are_told_apart(demo: Path) -> None:
    for day in ("may", "june"):
        shutil.copytree(demo, Path(day) / "leg")
    paths = [Path("may/leg"), Path("june/leg"), demo, Path("may/../june/leg")]
    assert told_apart(paths) == ["may/leg", "june/leg", "demo", "june/leg"]
    found = pool_runs([Path("may/leg"), Path("june/leg")]).model
    assert [t.trial for t in found.pooling.trials] == ["may/leg", "june/leg"]
    assert found.pooling.trials[1].reason == "it is the same as may/leg"


def test_another_vehicle_is_not_predicted_with_a_pooled_model(demo: Path) -> None:
    changed(demo, Path("other"), '"vehicle": "REMUS 100"', '"vehicle": "Tern 180"')
    model = pool_runs([demo]).model
    with pytest.raises(InputError, match="vehicle is Tern 180, there REMUS 100"):
        left_out_errors(model, [Path("other")])


def test_a_pooled_model_is_compared_with_a_run_and_has_no_errors(demo: Path) -> None:
    pooled = Path("pooled.json")
    write_pooled(pool_runs([demo]).model, pooled)
    found = compare_runs([pooled, demo])
    (row,) = [r for r in found["coefficients"] if r["symbol"] == "Y_uud"]
    assert row["apart"] is not None and None not in row["value"]
    assert all(r["rmse"][0] is None and r["rmse"][1] is not None for r in found["held_out"])
    (gate,) = baseline_gates(found, 0.1)
    assert gate.unmet == "pooled.json is a model by itself, which has no held-out error"
    called = call("compare", "pooled.json", str(demo))
    assert (called.code, called.err.count("Error")) == (0, 0)


def test_a_last_trial_that_fits_no_other_does_not_pass_the_gate() -> None:
    """A fin that is bent before the last trial changes more than a step search can tell yet."""
    found = Changes(
        vehicle="boat", plane="horizontal", trials=("a", "b"), false_alarms=0.01,
        left_out_last="c: it fits no other trial",
    )  # fmt: skip
    with pytest.raises(GateError, match="c: it fits no other trial"):
        refuse_change(found)
    refuse_change(found.model_copy(update={"left_out_last": ""}))


def test_the_logs_of_a_pooled_model_stand_in_it(demo: Path) -> None:
    (trial,) = pool_runs([demo]).model.pooling.trials
    assert list(trial.logs.values()) == ["harbour_trial"]
    assert json.loads(find_model(demo)[0].read_text())["plan"] != "pooled"
