"""From a trial's table to arrays: sensor geometry, which rows, gaps, the state at the start."""

import math

import numpy as np
import pandas as pd
import pytest

from auvident.engines.records import (
    CONTROL_COLUMNS,
    NORTH,
    STATE_COLUMNS,
    frame_of,
    in_one_frame,
    record_of,
    sensor_matrix,
)
from auvident.schema.artifacts import Maneuver, Sensing
from auvident.schema.coefficients import PLANES
from auvident.schema.trial import Trial

RATE = 10.0


def sensing(**changes) -> Sensing:
    place = {"dvl_x_m": 0.0, "dvl_y_m": 0.0, "dvl_z_m": 0.0, "dvl_mounting_yaw_rad": 0.0}
    return Sensing(**(place | changes), noise_std={})


def trial(plane: str = "horizontal", rows: int = 200, **columns) -> Trial:
    """Every channel its own straight line, so that what was taken is recognised."""
    time = 50.0 + np.arange(rows) / RATE
    table = pd.DataFrame({"time_s": time, "record": 0})
    names = (*STATE_COLUMNS[plane], *CONTROL_COLUMNS[plane])
    for i, name in enumerate(names):
        table[name] = 0.1 * (i + 1) + 0.01 * (i + 1) * (time - 50.0)
    table["rpm"] = 600.0 + time
    for sensor in ("dvl", "gyro", "attitude", "rudder", "elevator", "rpm"):
        table[f"{sensor}_sampled"] = True
    for name, values in columns.items():
        table[name] = values
    return Trial.from_table("t", table, RATE)


def maneuver(start: float, end: float) -> Maneuver:
    return Maneuver(
        id="t-turn-1",
        trial="t",
        kind="turn",
        t_start_s=start,
        t_end_s=end,
        role="identify",
        plane="horizontal",
        planes=("horizontal",),
    )


# --- sensor matrix -------------------------------------------------------------------------


@pytest.mark.parametrize("plane", PLANES)
def test_a_dvl_at_the_origin_reads_the_state(plane) -> None:
    np.testing.assert_array_equal(sensor_matrix(plane, sensing()), np.eye(4))


def test_horizontal_lever_arm_and_mounting_angle() -> None:
    """v_D = v_O + omega x r_D (theory 2.3.10-11), seen in axes turned to starboard."""
    u, v, r, heading = 1.5, -0.2, 0.3, 0.7
    x, y, turn = 0.8, -0.1, 0.05
    at_dvl = np.array([u - y * r, v + x * r])
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    matrix = sensor_matrix(
        "horizontal", sensing(dvl_x_m=x, dvl_y_m=y, dvl_z_m=5.0, dvl_mounting_yaw_rad=turn)
    )
    expected = [*(rotation @ at_dvl), r, heading]
    np.testing.assert_allclose(matrix @ [u, v, r, heading], expected, rtol=1e-15)


def test_a_dvl_turned_to_starboard_sees_the_way_ahead_from_port() -> None:
    matrix = sensor_matrix("horizontal", sensing(dvl_mounting_yaw_rad=0.1))
    assert (matrix @ [1.0, 0.0, 0.0, 0.0])[1] == pytest.approx(-math.sin(0.1))


def test_vertical_lever_arm() -> None:
    """u_D = u + z_D q, w_D = w - x_D q."""
    u, w, q, pitch = 1.5, -0.2, 0.3, 0.7
    matrix = sensor_matrix("vertical", sensing(dvl_x_m=0.8, dvl_y_m=5.0, dvl_z_m=-0.1))
    expected = [u - 0.1 * q, w - 0.8 * q, q, pitch]
    np.testing.assert_allclose(matrix @ [u, w, q, pitch], expected, rtol=1e-15)


# --- record --------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", PLANES)
def test_rows_and_columns_of_a_maneuver(plane) -> None:
    t = trial(plane)
    record = record_of(maneuver(55.0, 60.0), t, plane, np.eye(4))
    rows = slice(50, 100)  # the row at its end begins the next
    np.testing.assert_array_equal(record.time_s, t.table["time_s"][rows])
    np.testing.assert_array_equal(record.measured, t.table[list(STATE_COLUMNS[plane])][rows])
    np.testing.assert_array_equal(record.inputs[:, :2], t.table[list(CONTROL_COLUMNS[plane])][rows])
    np.testing.assert_allclose(record.inputs[:, 2], t.table["rpm"][rows] / 60.0, rtol=1e-15)
    np.testing.assert_array_equal(record.given, record.measured)


@pytest.mark.parametrize("plane", ["horizontal", "vertical"])
def test_turning_points_of_the_own_control_lead_in(plane) -> None:
    """Of all that was ordered before the rows that lead in; a gap in the log is no order."""
    ordered = np.zeros(900)
    ordered[100:200], ordered[200:300], ordered[300:320] = 0.2, -0.1, np.nan
    t = trial(plane, 900, **{CONTROL_COLUMNS[plane][0]: ordered})
    record = record_of(maneuver(130.0, 135.0), t, plane, np.eye(4))
    np.testing.assert_array_equal(record.source.past, [0.0, 0.2, -0.1, 0.0])
    assert record_of(maneuver(55.0, 59.0), t, plane, np.eye(4)).source.past.size == 0


def test_maneuvers_that_touch_share_no_row() -> None:
    first, second = (
        record_of(maneuver(*span), trial(), "horizontal", np.eye(4))
        for span in ((52.0, 55.0), (55.0, 60.0))
    )
    assert not set(first.time_s) & set(second.time_s)
    assert second.time_s[0] - first.time_s[-1] == pytest.approx(1 / RATE)


def test_interpolated_rows_are_given_but_not_measured() -> None:
    slow = np.arange(200) % 2 == 0
    record = record_of(maneuver(55.0, 60.0), trial(dvl_sampled=slow), "horizontal", np.eye(4))
    assert np.isnan(record.measured[1::2, :2]).all()
    assert np.isfinite(record.measured[::2]).all()
    assert np.isfinite(record.measured[:, 2:]).all()  # other sensors have their own flags
    assert np.isfinite(record.given).all()


def test_given_states_are_at_the_origin() -> None:
    """What the sensors read, taken back through lever arm and mounting angle."""
    place = sensing(dvl_x_m=0.8, dvl_y_m=-0.1, dvl_mounting_yaw_rad=0.05)
    matrix = sensor_matrix("horizontal", place)
    states = np.column_stack(
        [np.full(200, 1.5), np.full(200, -0.2), np.full(200, 0.3), np.linspace(0, 1, 200)]
    )
    read = states @ matrix.T
    t = trial(**dict(zip(STATE_COLUMNS["horizontal"], read.T, strict=True)))
    record = record_of(maneuver(55.0, 60.0), t, "horizontal", matrix)
    np.testing.assert_allclose(record.given, states[50:100], atol=1e-14)
    np.testing.assert_allclose(record.start, states[50], atol=1e-12)
    np.testing.assert_allclose(record.measured, read[50:100], atol=1e-15)


@pytest.mark.parametrize(
    ("plane", "missing"), [("horizontal", "elevator_rad"), ("vertical", "pitch_rad")]
)
def test_a_channel_the_log_lacks_is_zero_and_not_measured(plane, missing) -> None:
    bare = Trial.from_table("t", trial(plane).table.drop(columns=missing), RATE)
    record = record_of(maneuver(55.0, 60.0), bare, plane, np.eye(4))
    if missing == "pitch_rad":
        assert np.isnan(record.measured[:, 3]).all()
        assert (record.given[:, 3] == 0.0).all()
    else:
        assert (record.inputs[:, 1] == 0.0).all()


# --- state at the start --------------------------------------------------------------------


def test_start_is_a_line_through_noisy_readings() -> None:
    rng = np.random.default_rng(0)
    t = trial(rudder_rad=0.1, elevator_rad=0.0, rpm=600.0)
    exact = t.table["r_radps"].to_numpy()[50]
    errors = []
    for _ in range(200):
        noisy = t.table.assign(r_radps=t.table["r_radps"] + 0.01 * rng.normal(size=200))
        record = record_of(
            maneuver(55.0, 60.0), Trial.from_table("t", noisy, RATE), "horizontal", np.eye(4)
        )
        errors.append(record.start[2] - exact)
    # 16 rows from -1.0 to +0.5 s: variance 1/16 + (mean away)^2 / (16 var) = 0.0809 sigma^2
    lever = np.arange(-10, 6)
    closed = 0.01 * math.sqrt(1 / 16 + lever.mean() ** 2 / (16 * lever.var()))
    assert abs(np.mean(errors)) < 4 * closed / math.sqrt(200)
    # chi-square with 200 degrees of freedom: within 25 % at five standard deviations
    assert np.std(errors) == pytest.approx(closed, rel=0.25)


@pytest.mark.parametrize(
    ("column", "steady", "other"), [("rudder_rad", 0.0, 0.3), ("rpm", 600.0, 660.0)]
)
def test_a_helm_or_a_thrust_step_at_the_start_bends_no_line(column, steady, other) -> None:
    """The rate of turn is still 0.02 at the row from which on the input acts, then it runs away."""
    rows = np.arange(200)
    inputs = {"rudder_rad": 0.0, "elevator_rad": 0.0, "rpm": 600.0}
    inputs[column] = np.where(rows < 50, steady, other)
    t = trial(**inputs, r_radps=0.02 + 0.1 * np.maximum(rows - 50, 0))
    record = record_of(maneuver(55.0, 60.0), t, "horizontal", np.eye(4))
    assert record.start[2] == pytest.approx(0.02, abs=1e-12)


def test_a_helm_shortly_before_the_start_bends_no_line_either() -> None:
    rows = np.arange(200)
    rate = 0.02 + 0.1 * np.maximum(rows - 46, 0)  # the helm of row 46 acts on row 47
    t = trial(rudder_rad=np.where(rows < 46, 0.0, 0.3), elevator_rad=0.0, rpm=600.0, r_radps=rate)
    record = record_of(maneuver(55.0, 60.0), t, "horizontal", np.eye(4))
    assert record.start[2] == pytest.approx(0.42, abs=1e-12)


def test_a_rudder_that_moves_all_the_time_leaves_the_reading_at_the_start() -> None:
    rows = np.arange(200)
    t = trial(rudder_rad=0.03 * rows, elevator_rad=0.0, rpm=600.0, r_radps=0.1 * rows)
    record = record_of(maneuver(55.0, 60.0), t, "horizontal", np.eye(4))
    assert record.start[2] == pytest.approx(5.0, abs=0.06)


def test_start_uses_only_the_same_uninterrupted_piece() -> None:
    t = trial()
    before = t.table["record"].to_numpy().copy()
    before[:50] = -1
    wild = t.table["u_mps"].to_numpy().copy()
    wild[:50] = 99.0
    torn = Trial.from_table("t", t.table.assign(record=before, u_mps=wild), RATE)
    found = record_of(maneuver(55.0, 60.0), torn, "horizontal", np.eye(4)).start
    assert found[0] == pytest.approx(t.table["u_mps"][50], abs=1e-12)


def test_start_at_the_beginning_of_the_log_has_rows_on_one_side() -> None:
    t = trial()
    found = record_of(maneuver(50.0, 60.0), t, "horizontal", np.eye(4)).start
    np.testing.assert_allclose(found, t.table[list(STATE_COLUMNS["horizontal"])].iloc[0], atol=1e-9)


# --- without a compass ---------------------------------------------------------------------


def without_compass(rate) -> Trial:
    table = trial(r_radps=rate).table.drop(columns="heading_rad")
    return Trial.from_table("t", table, RATE)


def test_where_no_heading_is_logged_the_yaw_rate_is_summed_up() -> None:
    seconds = np.arange(200) / RATE
    found = without_compass(np.cos(seconds))
    record = record_of(maneuver(55.0, 60.0), found, "horizontal", np.eye(4))
    np.testing.assert_allclose(record.given[:, 3], np.sin(seconds[50:100]), atol=1e-3)
    assert record.start[3] == pytest.approx(np.sin(5.0), abs=1e-3)
    assert np.isnan(record.measured[:, 3]).all()  # nothing to be compared with
    assert record.source is not None and record.source.frame == "bow of t"


def test_a_logged_heading_is_taken_as_it_is() -> None:
    logged = trial()
    record = record_of(maneuver(55.0, 60.0), logged, "horizontal", np.eye(4))
    np.testing.assert_array_equal(record.given[:, 3], logged.table["heading_rad"][50:100])
    assert record.source is not None and record.source.frame == NORTH


def test_a_trial_that_is_called_north_has_no_compass_for_that() -> None:
    called = Trial.from_table("north", without_compass(0.1).table, RATE)
    frame = frame_of(maneuver(55.0, 60.0), called, "horizontal")
    assert frame != NORTH and in_one_frame([frame])


def test_headings_that_are_not_logged_compare_where_all_count_from_one_bow() -> None:
    assert in_one_frame(["bow of t", "bow of t"])
    assert not in_one_frame(["bow of t", "bow of s"])
    assert not in_one_frame([NORTH, "bow of t"])
    assert not in_one_frame([NORTH]) and not in_one_frame([])  # logged, or no maneuver


@pytest.mark.parametrize(("lost", "known"), [(15, True), (25, False)])
def test_a_gap_is_bridged_by_a_line_where_it_is_short(lost, known) -> None:
    rate = np.linspace(0.0, 2.0, 200)
    rate[60 : 60 + lost] = np.nan
    found = without_compass(rate)
    assert (found.turned_rad is not None) == known
    record = record_of(maneuver(60.0, 65.0), found, "horizontal", np.eye(4))
    assert record.source is not None
    assert record.source.frame == ("bow of t" if known else "bow of t-turn-1")
    if known:
        assert found.turned_rad[-1] == pytest.approx(19.9, abs=1e-9)
    else:
        assert (record.given[:, 3] == 0.0).all()


def test_without_a_yaw_rate_nobody_knows_which_way_it_lay() -> None:
    assert without_compass(np.nan).turned_rad is None


def test_the_speed_that_the_thrust_follows_is_without_the_noise_of_the_dvl() -> None:
    """The race turns it into yaw: 2 % of noise cost a race of the size of the drag 3,000 nats
    (population, even seed 5710), which was then never found."""
    rng, n = np.random.default_rng(2), 400
    true = 1.3 - 0.5 * np.minimum(np.arange(n) / n, 0.5)
    noisy = true + 0.02 * rng.standard_normal(n)
    noisy[100:105] = np.nan
    own = trial(rows=n, u_mps=noisy)
    found = record_of(maneuver(50.0, 90.0), own, "horizontal", np.eye(4)).source
    assert found is not None
    assert (found.speed - true).std() < 0.5 * 0.02
    still = record_of(maneuver(50.0, 90.0), trial(rows=n, u_mps=np.nan), "horizontal", np.eye(4))
    assert still.source is not None and not still.source.speed.any()
