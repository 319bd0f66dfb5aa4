"""Metrics by hand, tracks in closed form, and predictions of a made world and of samples."""

import json
import math
from functools import cache

import numpy as np
import pandas as pd
import pytest

from auvident.engines.records import STATE_COLUMNS, Record, sensor_matrix
from auvident.physics.dynamics import simulate_states
from auvident.physics.maneuvers import zigzag_figures
from auvident.physics.terms import parameter_vector, structure_of
from auvident.physics.virtual import run_virtual, zigzag_helm
from auvident.schema.artifacts import IdentifiedModel, Maneuver, Maneuvers, Metrics, Sensing
from auvident.schema.trial import Trial
from auvident.stages.validate import Prediction, compare, tracks, validate
from auvident.stages.validate.stage import virtual_zigzag
from tests.engines.chain import identified, sample, validated

# --- metrics -------------------------------------------------------------------------------


def test_metrics_by_hand() -> None:
    measured, simulated = np.array([1.0, 2.0, 3.0, 6.0]), np.array([1.0, 3.0, 3.0, 4.0])
    found = compare(measured, simulated, "m/s")
    assert found.rmse == pytest.approx(math.sqrt(5 / 4))  # errors 0, -1, 0, 2
    assert found.nrmse == pytest.approx(math.sqrt(5 / 14))  # mean 3, squares 4 + 1 + 0 + 9
    assert found.r2 == pytest.approx(1 - 5 / 14)
    # Theil: rmse over the sum of both rms, 50/4 and 35/4
    assert found.theil == pytest.approx(math.sqrt(5) / (math.sqrt(50) + math.sqrt(35)))
    assert (found.unit, found.samples) == ("m/s", 4)


def test_a_perfect_prediction_and_a_useless_one() -> None:
    x = np.array([1.0, -2.0, 0.5])
    perfect, mean, opposite = (compare(x, y, "") for y in (x, np.full(3, x.mean()), -x))
    assert (perfect.rmse, perfect.nrmse, perfect.r2, perfect.theil) == (0.0, 0.0, 1.0, 0.0)
    assert mean.nrmse == pytest.approx(1.0)  # the mean of what was measured explains nothing
    assert mean.r2 == pytest.approx(0.0, abs=1e-12)
    assert opposite.theil == pytest.approx(1.0)


def test_rows_that_were_not_measured_do_not_count() -> None:
    measured = np.array([1.0, np.nan, 3.0, 6.0, np.nan, 2.0])
    simulated = np.array([1.0, 99.0, 3.0, 4.0, np.nan, 3.0])
    found = compare(measured, simulated, "")
    assert found.samples == 4
    assert found.rmse == pytest.approx(math.sqrt(5 / 4))
    assert compare(np.full(3, np.nan), np.zeros(3), "") is None


def test_errors_of_a_track_are_distances() -> None:
    measured = np.array([[0.0, 0.0], [3.0, 4.0]])
    found = compare(measured, np.zeros((2, 2)), "m")
    assert found.rmse == pytest.approx(math.sqrt(25 / 2))
    # standard deviation of the distance from the mean (1.5, 2): 2.5
    assert found.nrmse == pytest.approx(math.sqrt(25 / 2) / 2.5)
    assert found.samples == 2


def test_a_constant_channel_is_not_called_perfect() -> None:
    found = compare(np.ones(5), np.full(5, 3.0), "m/s")
    assert found is None or found.r2 != 1.0


# --- tracks --------------------------------------------------------------------------------


def prediction(states: np.ndarray, predicted: np.ndarray, readings=None, dt=0.1) -> Prediction:
    maneuver = Maneuver(
        id="m",
        trial="t",
        kind="turn",
        t_start_s=0.0,
        t_end_s=1.0,
        role="validate",
        plane="horizontal",
        planes=("horizontal",),
    )
    readings = states if readings is None else readings
    record = Record(
        "m", np.arange(len(states)) * dt, np.zeros((len(states), 3)), states, readings, states[0]
    )
    return Prediction(maneuver, record, readings, predicted, predicted)


def circling(u: float, v: float, r: float, n: int, psi0: float, dt: float) -> np.ndarray:
    time = np.arange(n) * dt
    return np.column_stack([np.full(n, u), np.full(n, v), np.full(n, r), psi0 + r * time])


def test_tracks_of_a_steady_turn_are_circles() -> None:
    u, v, r, psi0, n, dt = 1.6, -0.3, 0.12, 0.7, 600, 0.1
    left = circling(u, v, -r, n, psi0, dt)
    measured, simulated = tracks(prediction(circling(u, v, r, n, psi0, dt), left, dt=dt))
    for track, turn in ((measured, r), (simulated, -r)):
        angle = psi0 + turn * np.arange(n) * dt
        north = (u * np.sin(angle) + v * np.cos(angle)) / turn
        east = (-u * np.cos(angle) + v * np.sin(angle)) / turn
        closed = np.column_stack([north - north[0], east - east[0]])
        # trapezoids in place of arcs: radius times (r dt)^2 / 12 = 2e-4 m
        np.testing.assert_allclose(track, closed, atol=1e-3)


def test_a_gap_of_the_compass_is_bridged_by_the_given_heading() -> None:
    states = circling(1.6, 0.0, 0.1, 100, 0.0, 0.1)
    torn = states.copy()
    torn[30:40, 3] = np.nan
    measured, simulated = tracks(prediction(states, states, torn))
    np.testing.assert_allclose(measured, simulated, atol=1e-12)


# --- a made world: the model itself sails --------------------------------------------------


def with_sensing(model: IdentifiedModel, **place) -> IdentifiedModel:
    origin = {"dvl_x_m": 0.0, "dvl_y_m": 0.0, "dvl_z_m": 0.0, "dvl_mounting_yaw_rad": 0.0}
    sensing = Sensing(**(origin | place), noise_std={})
    return model.model_copy(update={"sensing": sensing})


def base(plane: str = "horizontal") -> IdentifiedModel:
    """A model with the equations of the method alone, which `sailed` integrates."""
    name = "harbour_trial" if plane == "horizontal" else "dive_trial"
    return with_sensing(identified(name, plane).model.model_copy(update={"effects": ()}))


def sailed(model: IdentifiedModel) -> Trial:
    """Two minutes of straight run, then a zigzag and a turn, logged without noise at 10 Hz."""
    n, rest = 3000, 1200
    time = np.arange(n) * 0.1
    inputs = np.zeros((n, 3))
    inputs[rest : rest + 480, 0] = 0.15 * np.where((time[:480] // 8) % 2 == 0, 1, -1)
    inputs[rest + 800 :, 0] = 0.2
    inputs[:, 2] = 15.0
    p = parameter_vector(model.plane, model.values(), model.rigid_body)
    states = simulate_states(
        np.array([1.5, 0, 0, 0.3]),
        inputs,
        np.zeros((n, 4)),
        0.1,
        p,
        np.ones(4, dtype=bool),
        structure_of(model.plane).equations,
    )
    readings = states @ sensor_matrix(model.plane, model.sensing).T
    table = pd.DataFrame(dict(zip(STATE_COLUMNS[model.plane], readings.T, strict=True)))
    table["rudder_rad"], table["elevator_rad"] = inputs[:, 0], 0.0
    table["time_s"], table["rpm"], table["record"] = time, inputs[:, 2] * 60, 0
    for sensor in ("dvl", "gyro", "attitude", "rudder", "elevator", "rpm"):
        table[f"{sensor}_sampled"] = True
    return Trial.from_table("made", table, 10.0)


def maneuvers(plane: str = "horizontal") -> Maneuvers:
    pieces = (("zigzag", 118.0, 180.0, "identify"), ("turn", 198.0, 299.0, "validate"))
    return Maneuvers(
        maneuvers=tuple(
            Maneuver(
                id=f"made-{kind}-1",
                trial="made",
                kind=kind,
                t_start_s=start,
                t_end_s=end,
                role=role,
                plane=plane,
                planes=(plane,),
            )
            for kind, start, end, role in pieces
        )
    )


def summary_of(model: IdentifiedModel, seen: IdentifiedModel | None = None):
    return validate([sailed(model)], maneuvers(), seen or model).metrics.summary


def test_the_true_model_predicts_its_own_world() -> None:
    for role in ("identify", "validate"):
        found = summary_of(base())[role]
        assert set(found) == {"u", "v", "r", "heading", "track"}
        # the start comes from a line through 16 rows of steady motion: exact but for rounding
        assert all(m.nrmse < 1e-6 for m in found.values())


@pytest.mark.parametrize("place", [{"dvl_x_m": 0.6}, {"dvl_mounting_yaw_rad": 0.05}])
def test_the_place_of_the_dvl_does_not_spoil_velocities(place) -> None:
    found = summary_of(with_sensing(base(), **place))["validate"]
    assert all(found[name].nrmse < 1e-6 for name in ("u", "v", "r", "heading"))
    # and it does matter: the same world seen with a sensor taken to be at the origin
    wrong = summary_of(with_sensing(base(), **place), base())["validate"]
    assert wrong["v"].nrmse > 1e-3


@pytest.mark.parametrize("place", [{"dvl_x_m": 0.6}, {"dvl_mounting_yaw_rad": 0.05}])
def test_the_place_of_the_dvl_does_not_spoil_the_track(place) -> None:
    found = summary_of(with_sensing(base(), **place))["validate"]
    assert found["track"].nrmse < 1e-6


@pytest.mark.parametrize("place", [{"dvl_x_m": 0.6}, {"dvl_mounting_yaw_rad": 0.05}])
def test_the_place_of_the_dvl_does_not_spoil_the_figures_of_a_turn(place) -> None:
    model = with_sensing(base(), **place)
    found = validate([sailed(model)], maneuvers(), model).metrics
    (turn,) = [m.turn for m in found.maneuvers if m.kind == "turn"]
    assert turn["simulated"] == pytest.approx(turn["measured"], rel=1e-3)


def test_figures_of_the_true_model_are_the_measured_ones() -> None:
    found = validate([sailed(base())], maneuvers(), base()).metrics
    by_kind = {m.kind: m for m in found.maneuvers}
    turn, zigzag = by_kind["turn"].turn, by_kind["zigzag"].zigzag
    assert turn["measured"] and zigzag["measured"]
    assert turn["simulated"] == pytest.approx(turn["measured"], rel=1e-4)
    assert zigzag["simulated"] == pytest.approx(zigzag["measured"], rel=1e-4)
    assert by_kind["turn"].zigzag is None and by_kind["zigzag"].turn is None


@pytest.mark.parametrize("first", [-1.0, 1.0])
def test_a_zigzag_with_the_helm_of_the_model_is_the_one_that_it_repeats(first) -> None:
    """It turns already at first, so that the side which it is steered to matters."""
    model, angle, slew = base(), math.radians(10.0), math.radians(20.0)
    structure = structure_of(model.plane)
    p = parameter_vector(model.plane, model.values(), model.rigid_body)
    start, helm = np.array([1.5, 0.0, 0.04, 0.3]), zigzag_helm(first * angle, angle)
    run = run_virtual(structure, p, start, 15.0, 60.0, helm, rate_limit_radps=slew)
    record = Record("z", run.time_s, run.inputs, run.states, run.states, start)
    maneuver = maneuvers().maneuvers[0]
    found = virtual_zigzag(
        Prediction(maneuver, record, run.states, run.states, run.states), structure, p
    )
    expected = zigzag_figures(run.time_s, run.states[:, 3], run.inputs[:, 0])
    # a reversal is seen when the rudder has moved by a tenth: the switching angle is half a degree
    # too large, and the one that is repeated with it as much again
    for name in ("time_to_second_execute_s", "time_to_check_yaw_s", "period_s", "reach_s"):
        assert found[name] == pytest.approx(expected[name], abs=0.35), name
    for name in ("rudder_deg", "switch_deg", "overshoot_1_deg", "overshoot_2_deg"):
        assert found[name] == pytest.approx(expected[name], rel=0.06), name


def test_a_zigzag_without_a_reversal_has_no_figures_to_repeat() -> None:
    model, n = base(), 100
    states = circling(1.5, 0.0, 0.1, n, 0.0, 0.1)
    p = parameter_vector(model.plane, model.values(), model.rigid_body)
    held = prediction(states, states)
    assert virtual_zigzag(held, structure_of(model.plane), p) == {}


def test_without_a_compass_the_gyro_is_integrated() -> None:
    trial = sailed(base())
    blind = Trial.from_table(
        "made", trial.table.drop(columns=["heading_rad", "attitude_sampled"]), 10.0
    )
    found = validate([blind], maneuvers(), base()).metrics.summary["validate"]
    # trapezoids against RK4 of a rate that settles in a second or two: (dt/tau)^2/12 of it
    assert found["heading"].nrmse < 1e-3
    assert found["track"].nrmse < 1e-3


def changed(model: IdentifiedModel, **values) -> IdentifiedModel:
    rows = [
        c.model_copy(update={"value": values.get(c.symbol, c.value)}) for c in model.coefficients
    ]
    return model.model_copy(update={"coefficients": tuple(rows)})


@pytest.mark.parametrize("effectiveness", [0.9, 1.1])
def test_initial_turning_times_are_to_one_angle(effectiveness: float) -> None:
    """A rudder that turns harder is there sooner; by its own reversals it had as far to go."""
    own = base().values()
    other = changed(base(), **{s: effectiveness * own[s] for s in ("N_uud", "Y_uud")})
    found = validate([sailed(base())], maneuvers(), other).metrics
    (zigzag,) = [m.zigzag for m in found.maneuvers if m.kind == "zigzag"]
    ratio = zigzag["simulated"]["switch_deg"] / zigzag["measured"]["switch_deg"]
    assert ratio == pytest.approx(effectiveness, rel=0.05)
    times = [zigzag[side]["initial_turning_time_s"] for side in ("simulated", "measured")]
    assert (times[0] < times[1]) is (effectiveness > 1.0)
    assert abs(times[0] / times[1] - 1.0) > 0.02


def test_a_prediction_that_runs_away_is_a_finding_and_the_rest_stays_finite() -> None:
    unstable = changed(base(), X_uu=+200.0)
    result = validate([sailed(base())], maneuvers(), unstable)
    found = [f for f in result.metrics.findings if f.code == "prediction-ran-away"]
    assert {f.where for f in found} == {"made-zigzag-1", "made-turn-1"}
    assert all("s after the start" in f.message for f in found)
    assert result.metrics.maneuvers == ()
    assert result.metrics.summary == {}
    text = result.metrics.model_dump_json(by_alias=True)
    json.loads(text, parse_constant=lambda name: pytest.fail(name))  # NaN and Infinity
    assert Metrics.model_validate_json(text) == result.metrics
    assert len(result.simulation) == 620 + 1010  # all rows, NaN where it ran away
    assert result.simulation["u_mps_simulated"].isna().any()


def test_one_that_runs_away_does_not_spoil_the_other() -> None:
    """A vehicle that keeps straight as long as nobody touches the rudder."""
    spinning = changed(base(), **{"N_r|r|": +40.0})
    turn = maneuvers().maneuvers[1]
    straight = turn.model_copy(
        update={"id": "made-straight-1", "kind": "straight", "t_start_s": 10.0, "t_end_s": 60.0}
    )
    both = Maneuvers(maneuvers=(straight, turn))
    metrics = validate([sailed(base())], both, spinning).metrics
    lost = [f.where for f in metrics.findings if f.code == "prediction-ran-away"]
    assert lost == ["made-turn-1"]
    assert [m.id for m in metrics.maneuvers] == ["made-straight-1"]
    assert metrics.summary["validate"]["u"].rmse < 1e-6
    assert metrics.summary["validate"]["u"].samples == 500


def test_a_prior_that_runs_away_is_no_fault_of_the_model() -> None:
    rows = [
        c.model_copy(update={"prior": 200.0}) if c.symbol == "X_uu" else c
        for c in base().coefficients
    ]
    model = base().model_copy(update={"coefficients": tuple(rows)})
    metrics = validate([sailed(base())], maneuvers(), model).metrics
    assert set(metrics.summary) == {"identify", "validate"}
    assert metrics.ase is None or metrics.ase.summary == {}
    json.loads(metrics.model_dump_json(), parse_constant=lambda name: pytest.fail(name))


# --- samples -------------------------------------------------------------------------------


@cache
def again(name: str, plane: str) -> pd.DataFrame:
    return validated(name, plane).simulation


@pytest.mark.parametrize("model", ["simulated", "ase"])
@pytest.mark.parametrize("role", ["identify", "validate"])
@pytest.mark.parametrize(
    ("trial", "channels"),
    [
        (("harbour_trial", "horizontal"), {"u": "u_mps", "v": "v_mps", "r": "r_radps"}),
        (("dive_trial", "vertical"), {"u": "u_mps", "w": "w_mps", "q": "q_radps"}),
    ],
    ids=["harbour", "dive"],
)
def test_the_summary_is_over_all_samples_together(trial, channels, role, model) -> None:
    metrics = validated(*trial).metrics
    summary = (metrics if model == "simulated" else metrics.ase).summary[role]
    table = again(*trial)[again(*trial)["role"] == role]
    assert table["maneuver"].nunique() > 1
    for name, column in channels.items():
        pair = table[[f"{column}_measured", f"{column}_{model}"]].dropna().to_numpy()
        error = pair[:, 0] - pair[:, 1]
        assert summary[name].samples == len(pair)
        assert summary[name].rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
        assert summary[name].nrmse == pytest.approx(
            np.sqrt(np.mean(error**2)) / pair[:, 0].std(), rel=1e-9
        )


def test_every_maneuver_has_metrics_and_the_estimate_has_the_same() -> None:
    c, metrics = sample("harbour_trial"), validated("harbour_trial").metrics
    expected = [(m.id, m.role) for m in c.maneuvers.maneuvers]
    assert [(m.id, m.role) for m in metrics.maneuvers] == expected
    assert [(m.id, m.role) for m in metrics.ase.maneuvers] == expected
    for after, before in zip(metrics.maneuvers, metrics.ase.maneuvers, strict=True):
        assert set(after.channels) == set(before.channels) == {"u", "v", "r", "heading", "track"}
        for name in after.channels:
            assert after.channels[name].samples == before.channels[name].samples
    assert metrics.ase.ase is None


def test_the_vertical_plane_has_its_own_channels() -> None:
    metrics = validated("dive_trial", "vertical").metrics
    assert set(metrics.summary["validate"]) == {"u", "w", "q", "pitch"}
    assert all(m.id.startswith("dive_trial-") for m in metrics.maneuvers)


def test_metrics_of_the_samples_are_finite_json() -> None:
    for trial in (("harbour_trial", "horizontal"), ("dive_trial", "vertical")):
        text = validated(*trial).metrics.model_dump_json(by_alias=True)
        json.loads(text, parse_constant=lambda name: pytest.fail(name))
        assert Metrics.model_validate_json(text) == validated(*trial).metrics


def test_a_prediction_sees_only_the_start_and_the_inputs() -> None:
    """Readings after the start change the errors, not the prediction."""
    trial = sailed(base())
    table = trial.table.copy()
    later = table["time_s"] > 199.0
    for column in STATE_COLUMNS["horizontal"]:
        table.loc[later, column] += 0.3
    wrong = validate([Trial.from_table("made", table, 10.0)], maneuvers(), base())
    right = validate([trial], maneuvers(), base())
    turn = right.simulation["maneuver"] == "made-turn-1"
    for column in STATE_COLUMNS["horizontal"]:
        name = f"{column}_simulated"
        np.testing.assert_array_equal(wrong.simulation[name][turn], right.simulation[name][turn])
    assert wrong.metrics.summary["validate"]["u"].rmse == pytest.approx(0.3, rel=0.02)
