"""Maneuvers on the desk: closed forms, mirror images, and what an unstable hull does."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.errors import NumericsError
from auvident.physics.ase.stability import linear_turning_gain, steady_turn, turning_table
from auvident.physics.maneuvers.desk import round_step
from auvident.physics.maneuvers.desk_figures import FIGURES, gone_on, nomoto_from
from auvident.report.figures_desk import helm_lines
from auvident.schema.desk import MANEUVERS, desk_order
from auvident.schema.planes import BY_PLANE
from auvident.stages.ase import estimate
from auvident.stages.desk import Approach, Desk, DeskModel, fly_maneuver
from auvident.stages.desk.stage import HELMS
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES
from tests.physics.desk_models import changed, linear, remus, stated

MASS_KG = 30.48


def flown(models: DeskModel, text: str, **approach: float) -> Desk:
    return fly_maneuver(models, desk_order(text), Approach(**approach))


def figures(desk: Desk) -> dict[str, float | None]:
    return {f.name: f.value for f in desk.result.figures}


def without_thrust(models: DeskModel) -> DeskModel:
    """The speed is held where no thrust balances a drag."""
    return changed(models, T_nn=0.0, T_nu=0.0)


def test_every_maneuver_has_a_helm_and_figures() -> None:
    names = [row.name for row in MANEUVERS]
    assert list(HELMS) == names
    assert list(FIGURES) == names


@pytest.mark.parametrize("row", MANEUVERS, ids=lambda row: row.name)
def test_every_figure_of_a_row_comes_out(row: object) -> None:
    desk = flown(remus(row.plane), row.usual, speed_mps=1.5)  # type: ignore[attr-defined]
    told = {f.name for f in desk.result.figures}
    for name in row.figures:  # type: ignore[attr-defined]
        stem = name.removesuffix("*")
        assert any(name_.startswith(stem.rpartition("_")[0] or stem) for name_ in told), name
    assert all(f.value is not None for f in desk.result.figures)
    assert desk.table["time_s"].is_monotonic_increasing
    assert np.isfinite(desk.table.to_numpy()).all()


@pytest.mark.parametrize("row", MANEUVERS, ids=lambda row: row.name)
def test_a_drawn_model_that_runs_away_at_once_has_no_figures(row: object) -> None:
    models = remus(row.plane)  # type: ignore[attr-defined]
    damping = ("N_r|r|", "N_ur") if row.plane == "horizontal" else ("M_q|q|", "M_uq")  # type: ignore[attr-defined]
    lost = models.vectors.copy()
    for name in (*damping, "X_uu"):
        lost[:, models.structure.index(name)] *= -1e12
    beside = replace(models, vectors=np.concatenate([models.vectors, lost]))
    with np.errstate(all="ignore"):
        desk = flown(beside, row.usual, speed_mps=1.5)  # type: ignore[attr-defined]
    assert desk.result.models_lost == 1
    assert any(f.value is not None for f in desk.result.figures)


def test_a_linear_hull_turns_by_the_gain_of_its_equations() -> None:
    models = without_thrust(linear(remus("horizontal")))
    desk = flown(models, "turning-circle:10", speed_mps=1.5)
    rate = 1.5 * linear_turning_gain(models.of_first(), MASS_KG, 0.0) * -np.radians(10.0)
    assert figures(desk)["steady_r"] == pytest.approx(np.degrees(rate), rel=1e-4)
    assert figures(desk)["speed_loss"] == pytest.approx(0.0, abs=0.02)  # of the drift alone
    assert desk.result.speed_is_held


def test_a_steady_turn_is_that_of_newtons_method() -> None:
    """Both sides; the turning table is of another solution of the same equations."""
    models = remus("horizontal")
    row = turning_table(models.of_first(), MASS_KG, 0.0)[2]
    assert row["rudder_deg"] == 15.0
    starboard = figures(flown(models, "turning-circle:15", speed_mps=1.5))
    port = figures(flown(models, "turning-circle:-15", speed_mps=1.5))
    assert starboard["steady_diameter"] == pytest.approx(row["diameter_m"], rel=1e-3)
    assert 1.0 - starboard["speed_loss"] == pytest.approx(row["speed_ratio"], rel=1e-3)
    assert 2.0 / abs(np.radians(row["rate_per_speed_degpm"])) == pytest.approx(row["diameter_m"])
    assert starboard["steady_r"] > 0.0
    for name in ("advance", "transfer", "tactical_diameter", "time_to_90"):
        assert port[name] == pytest.approx(starboard[name], rel=1e-9)
    assert port["steady_r"] == pytest.approx(-starboard["steady_r"], rel=1e-9)


def test_a_zigzag_to_port_is_the_mirror_image() -> None:
    starboard = figures(flown(remus("horizontal"), "zigzag:20/10", speed_mps=1.5))
    port = figures(flown(remus("horizontal"), "zigzag:-20/10", speed_mps=1.5))
    assert port == pytest.approx(starboard, rel=1e-9)
    assert starboard["overshoot_4"] > 0.0


def test_the_zigzag_reverses_at_the_angle() -> None:
    desk = flown(remus("horizontal"), "zigzag:10/20", speed_mps=1.5)
    order, heading = desk.table["rudder_order_rad"], np.degrees(desk.table["heading_rad"])
    reversed_at = np.flatnonzero(np.diff(order) != 0.0) + 1
    assert order[0] == pytest.approx(-np.radians(10.0))  # to starboard: trailing edge to starboard
    assert len(reversed_at) == 5  # four reversals, and the one that ends it
    np.testing.assert_allclose(np.abs(heading[reversed_at]), 20.0, atol=0.4)  # within a step


def test_k_and_t_of_a_first_order_response_are_found() -> None:
    time = np.linspace(0.0, 40.0, 4001)
    order = 0.2 * np.where(np.sin(0.5 * time) >= 0.0, 1.0, -1.0)
    r, gain, lag = np.zeros(4001), 0.8, 2.5
    for k in range(4000):
        keep = np.exp(-0.01 / lag)
        r[k + 1] = gain * order[k] + (r[k] - gain * order[k]) * keep
    heading = np.concatenate([[0.0], np.cumsum(0.005 * (r[1:] + r[:-1]))])
    found = nomoto_from(time, r, heading, order)
    assert found["zigzag_gain_ps"] == pytest.approx(gain, rel=1e-2)
    assert found["zigzag_time_s"] == pytest.approx(lag, rel=1e-2)


def unstable() -> DeskModel:
    return stated(remus("horizontal"), N_uv=-66.0)


def test_a_spiral_shows_the_loop_of_an_unstable_hull() -> None:
    """The rate that stays at amidships is the root of the steady turn without rudder."""
    models = unstable()
    desk = flown(models, "spiral:20", speed_mps=1.5)
    told = figures(desk)
    assert told["stability_index"] < 0.0
    turn = steady_turn(models.of_first(), MASS_KG, 0.0, 0.0, np.array([-0.3, 0.6]))
    (middle,) = [
        row
        for at, row in zip(desk.result.curves[0].at, desk.result.curves[0].figures, strict=True)
        if at == 0.0
    ]
    amidships = np.flatnonzero(desk.table["rudder_order_rad"] == 0.0)
    last = amidships[np.flatnonzero(np.diff(amidships) > 1)[0]]  # of the way from starboard
    assert turn is not None
    rate = np.degrees(abs(turn[1])) * desk.table["u_mps"][last]
    assert middle[0].value == pytest.approx(rate, rel=0.02)  # as far as it has settled
    assert middle[1].value == pytest.approx(-middle[0].value, rel=1e-2)
    assert told["loop_height"] == pytest.approx(2.0 * middle[0].value, rel=1e-2)
    assert told["loop_width"] > 0.0


def test_a_spiral_of_a_stable_hull_has_no_loop() -> None:
    told = figures(flown(remus("horizontal"), "spiral:20", speed_mps=1.5))
    assert told["stability_index"] > 0.0
    assert told["loop_height"] == told["loop_width"] == 0.0


def test_a_pull_out_leaves_a_rate_on_an_unstable_hull_alone() -> None:
    stable = figures(flown(remus("horizontal"), "pull-out:15", speed_mps=1.5))
    loose = figures(flown(unstable(), "pull-out:15", speed_mps=1.5))
    assert abs(stable["residual_difference"]) < 0.02 * stable["steady_starboard"]
    assert loose["residual_starboard"] > 1.0 > -1.0 > loose["residual_port"]


def test_a_depth_step_ends_at_the_depth() -> None:
    for depth in (5.0, -3.0):
        desk = flown(remus("vertical"), f"depth-step:{depth:g}", speed_mps=1.5)
        told = figures(desk)
        assert desk.table["depth_m"].iloc[-1] == pytest.approx(depth, abs=0.05 * abs(depth))
        assert told["settling_time"] > told["rise_time"] * 0.5 > 0.0
        assert np.sign(told["greatest_pitch"]) == -np.sign(depth)
        assert abs(told["greatest_elevator"]) <= 20.0 + 1e-9


def test_a_depth_step_that_loops_is_refused() -> None:
    """Damped in speed, unstable in pitch: it turned over and over within the limits of speed."""
    loose = changed(remus("vertical"), M_uw=300.0, M_uq=0.0)
    with pytest.raises(NumericsError, match="pitches beyond 90 deg") as caught:
        flown(loose, "depth-step:5", speed_mps=1.5)
    assert "depth-step:5" in caught.value.where and " s" in caught.value.where


def test_a_vertical_zigzag_puts_the_bow_up_first() -> None:
    desk = flown(remus("vertical"), "vertical-zigzag:10/5", speed_mps=1.5)
    assert desk.table["elevator_order_rad"][0] < 0.0  # trailing edge up
    assert desk.table["pitch_rad"][20] > desk.table["pitch_rad"][0]
    assert figures(desk)["depth_overshoot_1"] > 0.0


def test_a_figure_has_the_signs_of_the_command_line() -> None:
    """To starboard, or bow up: against the axes, whose signs the table has."""
    for plane, text in (("horizontal", "turning-circle:15"), ("vertical", "vertical-zigzag:10/5")):
        desk, row = flown(remus(plane), text, speed_mps=1.5), BY_PLANE[plane]
        order, angle = helm_lines(desk.table, row.control_columns[0])
        first = next(iter(desk.result.parameters.values()))
        assert order[1] == pytest.approx(first, abs=1.5) and 0.0 < angle.max() < first + 1.5


@pytest.mark.parametrize(
    ("way", "expected"),
    [
        ([0.0, 0.1, 0.3, 0.2], 0.3),
        ([0.0, -0.02, 0.1, 0.28, 0.2, 0.4], 0.28),  # it still went the other way at the reversal
        ([0.0, 0.1, 0.2], None),
        ([0.0, -0.1, -0.2], None),
    ],
)
def test_the_depth_goes_on_to_where_it_turns_back(way: list[float], expected: float | None) -> None:
    assert gone_on(np.array(way)) == expected


def test_the_estimate_and_the_desk_fly_one_zigzag() -> None:
    """With the servo of the desk the two ways to fly the estimate differ by steps alone."""
    told = estimate(load_vehicle(SAMPLES / "remus100.toml")).facts["spread"]["horizontal"]
    desk = figures(flown(remus("horizontal"), "zigzag:10/10", speed_mps=1.5))
    for k in (1, 2):
        value = told[f"overshoot_{k}_deg"]["value"]
        assert value == pytest.approx(desk[f"overshoot_{k}"], abs=0.5)


@pytest.mark.parametrize(
    ("longest", "step"), [(0.05, 0.05), (0.049, 0.02), (0.1, 0.1), (0.0178, 0.01)]
)
def test_steps_are_round_numbers(longest: float, step: float) -> None:
    assert round_step(longest) == pytest.approx(step, rel=1e-9)
