"""The benchmarks still run, on small sizes; their figures are for `make bench`."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from auvident.schema.artifacts import Finding
from auvident.stages.identify import Identification, identify
from auvident.storage.logs import read_trials
from tests.bench import __main__ as bench
from tests.bench import commands, day, floor, in_turn, left_out, recovery, speed
from tests.bench.world import equations, make_world
from tests.engines.chain import chain_of, identified, plan_named, sample


def test_a_pass_is_compared_with_filterpy() -> None:
    rows = speed.passes(repeats=1, rows=60)
    assert [row["filter"] for row in rows] == ["ekf", "ukf"] * len(speed.PASSES)
    assert [row["states"] for row in rows[::2]] == [int(name.split()[0]) for name in speed.PASSES]
    assert all(row["ratio"] > 5.0 for row in rows)


def test_commands_are_timed_whole(monkeypatch) -> None:
    """The chain into a new directory every time, and no stage on what another made stale."""
    real, called = commands.spent, []

    def spent(command) -> commands.Spent:
        called.append(tuple(map(str, command[1:])))
        if command[1] == "run":
            Path(command[-1]).mkdir(parents=True)  # fails where there is one
        return commands.Spent(float(len(called)), 0.5)

    monkeypatch.setattr(commands, "spent", spent)
    (rows,) = commands.commands(3, ("bay_trial",)).values()
    assert [row["command"] for row in rows][2:] == ["run", *commands.STAGES]
    assert [c[0] for c in called[11:]] == [s for s in reversed(commands.STAGES) for _ in "abc"]
    assert all(row["to"] - row["from"] == 2.0 and row["processor_s"] == 0.5 for row in rows)
    monkeypatch.undo()
    assert real((commands.PROGRAM, "--help")).processor_s > 0.0
    with pytest.raises(subprocess.CalledProcessError):
        real((commands.PROGRAM, "status", "nowhere"))


def test_two_programs_take_turns(monkeypatch) -> None:
    """Each with its own samples and runs; shares of pairs, the first of which does not count."""
    called = []

    def spent(command, environment) -> commands.Spent:
        called.append((environment["PYTHONPATH"], *map(str, command[4:])))
        compiles = 100.0 if len(called) % 6 == 2 else 0.0  # in the first of three pairs
        own = environment["PYTHONPATH"] == "own"
        return commands.Spent(*((3.0 + compiles, 2.0) if own else (4.0, 8.0)))

    monkeypatch.setattr(in_turn, "spent", spent)
    rows = in_turn.in_turn({"other": Path("before"), "own": Path("own")}, 2, ("bay_trial",))
    assert [row["command"] for row in rows] == ["run", "report", "diagnose", "identify"]
    assert {(row["share"], row["share of processor s"]) for row in rows} == {(0.75, 0.25)}
    assert {(row["from"], row["to"], row["now s"]) for row in rows} == {(0.75, 0.75, 3.0)}
    assert [who for who, *_ in called[:6]] == ["before", "own", "own", "before", "before", "own"]
    assert called[0][1:5] == ("run", "before/sample_logs/bay_trial", "--vehicle", called[0][4])
    assert {line[-1].split("/")[-2] for line in called} == {"other", "own"}


def test_a_tiled_log_is_read_and_its_growth_told(tmp_path) -> None:
    base = day.generated(tmp_path)
    log = day.tiled(base, 400.0, tmp_path / "log")
    (trial,) = read_trials([log])
    assert {s: x.time_s.size for s, x in trial.sensors.items()} == {
        sensor: 400 * rate for sensor, rate in day.RATES_HZ.items()
    }
    found = day.measured(day.STAGE.format("ingest"), day.as_parquet(log, tmp_path / "other"), 1)
    assert found["s"] > 0.0 and found["peak_mib"] > 0.0


def test_recovery_is_summed_up() -> None:
    found = recovery.recovery(1, plans=("together",), filters=("ekf",))["together ekf"]
    rows = found["claimed"]["all coefficients"]
    assert found["failed"] == 0 and rows["n"] > 0 and 0.0 <= rows["coverage"] <= 1.0


def test_errors_of_one_standard_deviation_are_within_the_band() -> None:
    quantiles = norm.ppf((np.arange(400) + 0.5) / 400)
    row = recovery.summary({"x": list(quantiles)})["x"]
    assert row["low"] < row["mean_square"] < row["high"]
    assert row["coverage"] == pytest.approx(0.95, abs=0.003)


def test_the_world_keeps_a_straight_run_straight() -> None:
    vehicle, ase = recovery.vehicle_and_prior()
    world = make_world(ase, vehicle, seed=3, programme=(("straight", 0, None, (1.0, 1.2)),))
    assert np.abs(world.trial.table["r_radps"]).max() < 6 * 0.0009
    assert equations(world.truth, vehicle)(0.0, [1.5, 0, 0, 0], 0.0, 15.0)[1:] == [0.0, 0.0, 0]


def test_parts_can_be_chosen(monkeypatch, capsys) -> None:
    monkeypatch.setattr(bench, "_run", lambda part, repeats, seeds: {part: [{"x": 1.0}]})
    bench.main(["speed", "plans", "--json"])
    assert list(json.loads(capsys.readouterr().out)) == ["speed", "plans"]
    bench.main(["plans"])
    assert "plans" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        bench.main(["nothing"])


def test_a_table_without_rows_says_that_nothing_was_measured(monkeypatch, capsys) -> None:
    monkeypatch.setattr(left_out, "left_out", list)
    bench.main(["left-out"])
    assert "nothing was measured" in capsys.readouterr().out


def test_a_log_is_predicted_by_a_model_that_never_saw_it(monkeypatch) -> None:
    """Of three of the zigzags, each from the other two: better than no model, worse than seen."""
    monkeypatch.setattr(left_out, "chain_of", lambda paths, file: chain_of(paths[3:12:4], file))
    (row,) = left_out.left_out(plans=("together",))
    assert row["plan"] == "together" and row["filter"] == "ekf"
    assert 0.02 < row["r"] < 1.0


def test_a_filter_claims_what_its_readings_tell() -> None:
    """Nothing but sensor noise: there is nothing to find out."""
    vehicle, ase = recovery.vehicle_and_prior()
    world = make_world(ase, vehicle, 1000)
    model = identify(
        [world.trial], world.maneuvers, ase, vehicle, recovery.NOISE, plan=plan_named("spiral")
    ).model
    assert not [f for f in model.findings if f.code == "filter-overclaims"]


def test_a_filter_that_claims_more_than_its_readings_tell_is_found_out() -> None:
    """A current that nobody declared takes the states where the model would not go."""
    chain = sample("bay_trial")

    def overclaims(found: Identification) -> list[Finding]:
        return [f for f in found.model.findings if f.code == "filter-overclaims"]

    (told,) = overclaims(identified("bay_trial"))
    assert told.value > told.threshold
    assert told.where in {c.symbol for c in chain.ase.coefficients}
    assert not overclaims(chain.identify(plan=plan_named("refined")))


def test_an_exact_model_leaves_what_turbulence_and_sensors_make() -> None:
    """More than the noise of a sensor, and less than what a maneuver moves."""
    chain = sample("harbour_trial")
    held_out = [m for m in chain.maneuvers.maneuvers if m.role == "validate"]
    least = floor.floor("harbour_trial", held_out)
    assert 0.005 < least["u"] < 0.0055 and 0.005 < least["v"] < 0.0065
    assert 0.0009 < least["r"] < 0.005
    again = floor.floor("harbour_trial", held_out[:1])
    assert again["v"] != least["v"] and again["v"] < 0.0065


def test_an_exact_model_of_a_planted_effect_is_not_known() -> None:
    with pytest.raises(ValueError, match="bay_trial"):
        floor.floor("bay_trial", ())
