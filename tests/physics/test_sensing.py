"""What the sensors read: against plane geometry in complex numbers, and the way back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auvident.physics.readings import late, offsets, readings, states_behind
from auvident.physics.sensing import (
    READING,
    reading_values,
    sensor_matrix,
    unknown_rows,
    water_by_pitch,
)
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import Sensing
from auvident.schema.effects import BY_ID, parameter_of

DT, N = 0.1, 200
SENSING = Sensing(dvl_x_m=0.4, dvl_y_m=-0.1, dvl_z_m=0.2, dvl_mounting_yaw_rad=0.05, noise_std={})
PLAIN = Sensing(dvl_x_m=0.0, dvl_y_m=0.0, dvl_z_m=0.0, dvl_mounting_yaw_rad=0.0, noise_std={})
ALL = {
    "current.north_mps": 0.15,
    "current.east_mps": -0.3,
    "dvl_misalignment.yaw_deg": 2.0,
    "dvl_scale.fraction": 0.02,
    "dvl_lever_arm.dx_m": 0.2,
    "dvl_lever_arm.dy_m": -0.07,
    "dvl_height.dz_m": 0.12,
    "gyro_bias.bias_degps": 0.3,
    "gyro_scale.fraction": -0.03,
    "dvl_delay.delay_s": 0.3,
    "gyro_delay.delay_s": 0.2,
    "current_drift.north_early_mps_per_1000_s": 20.0,
    "current_drift.east_early_mps_per_1000_s": -10.0,
    "current_drift.north_late_mps_per_1000_s": -15.0,
    "current_drift.east_late_mps_per_1000_s": 5.0,
}
VERTICAL = {
    "current.north_mps": 0.15,
    "current.east_mps": -0.3,
    "vertical_current.down_mps": -0.04,
    "dvl_pitch.pitch_deg": 2.0,
    "dvl_scale.fraction": 0.02,
    "dvl_lever_arm.dx_m": 0.2,
    "dvl_lever_arm.dz_m": -0.07,
    "q_bias.bias_degps": 0.3,
    "q_scale.fraction": -0.03,
    "pitch_bias.bias_deg": 1.5,
    "pitch_scale.fraction": 0.04,
    "dvl_delay.delay_s": 0.3,
    "gyro_delay.delay_s": 0.2,
}
DEPTH = ("depth_lag.lag_s", "depth_scale.fraction")  # of a log that is no reading of a state
PLANES = {"horizontal": ALL, "vertical": VERTICAL}
MIDDLE = DT * (np.arange(N) - 80.0)  # time from the middle of the trial
LATE = ("dvl_delay.delay_s", "gyro_delay.delay_s")
seeds = st.integers(0, 2**32 - 1)


def effects(shown: dict[str, float]) -> np.ndarray:
    """Effects in the order of `READING`, sizes as shown."""
    e = np.zeros(len(READING))
    for name, value in shown.items():
        e[READING.index(name)] = parameter_of(name).internal(value)
    return e


def course(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Smooth states (N, 4) with a heading that goes round, and roll and pitch rates (N, 2)."""
    rng = np.random.default_rng(seed)
    time, phase = DT * np.arange(N)[:, None], rng.uniform(0, 6, 6)
    waves = np.sin(0.5 * time + phase)
    states = np.column_stack([1.4 + 0.2 * waves[:, 0], 0.1 * waves[:, 1], 0.2 * waves[:, 2]])
    heading = phase[3] + 0.5 * time[:, 0] + 0.3 * waves[:, 3]
    return np.column_stack([states, heading]), 0.1 * waves[:, 4:]


def test_every_effect_is_tried() -> None:
    assert {*ALL, *VERTICAL, *DEPTH} == set(READING)
    for plane, tried in PLANES.items():
        assert all(plane in BY_ID[n.split(".")[0]].planes for n in tried)


# --- at once -------------------------------------------------------------------------------


def by_geometry(states: np.ndarray, rates: np.ndarray, e: dict[str, float]) -> np.ndarray:
    """Readings of the horizontal plane without delays; ahead + i starboard, north + i east."""
    u, v, r, heading = states.T
    place = complex(SENSING.dvl_x_m + e["dvl_lever_arm.dx_m"])
    place += 1j * (SENSING.dvl_y_m + e["dvl_lever_arm.dy_m"])
    earth = (u + 1j * v + 1j * r * place) * np.exp(1j * heading)
    earth += e["current.north_mps"] + 1j * e["current.east_mps"]
    drift = {k.split(".")[1].removesuffix("_mps_per_1000_s"): x for k, x in e.items()}
    early = drift["north_early"] + 1j * drift["east_early"]
    later = drift["north_late"] + 1j * drift["east_late"]
    earth += np.where(MIDDLE < 0.0, early, later) * MIDDLE / 1000.0
    here = earth * np.exp(-1j * heading)
    here += (rates[:, 1] - 1j * rates[:, 0]) * e["dvl_height.dz_m"]  # q dz ahead, -p dz aside
    here *= np.exp(-1j * (0.05 + np.radians(e["dvl_misalignment.yaw_deg"])))
    here *= 1.0 + e["dvl_scale.fraction"]
    gyro = (1.0 + e["gyro_scale.fraction"]) * r + np.radians(e["gyro_bias.bias_degps"])
    return np.column_stack([here.real, here.imag, gyro, heading])


@pytest.mark.parametrize("name", [*(n for n in ALL if n not in LATE), "all"])
def test_readings_are_plane_geometry(name) -> None:
    at_once = {n: v for n, v in ALL.items() if n not in LATE and name in (n, "all")}
    states, rates = course()
    args = (states, states[:, 3], rates, DT, MIDDLE)
    found = readings("horizontal", SENSING, effects(at_once), *args)
    shown = dict.fromkeys(ALL, 0.0) | at_once
    np.testing.assert_allclose(found, by_geometry(states, rates, shown), atol=1e-14)
    without = by_geometry(states, rates, dict.fromkeys(ALL, 0.0))
    assert np.abs(found - without).max() > 1e-3


def test_a_drifting_vehicle_is_seen_to_move_with_the_current() -> None:
    """At rest in the water, bow to the east: a set to the north comes from starboard."""
    states = np.array([[0.0, 0.0, 0.0, np.pi / 2]])
    e = effects({"current.north_mps": 0.4})
    found = readings("horizontal", PLAIN, e, states, states[:, 3], np.zeros((1, 2)), DT)
    np.testing.assert_allclose(found[0, :2], [0.0, -0.4], atol=1e-15)


def test_in_the_vertical_plane_the_dvl_is_on_a_lever_and_scaled() -> None:
    states, rates = course()
    e = effects({"dvl_scale.fraction": 0.02, "q_bias.bias_degps": 0.3})
    found = readings("vertical", SENSING, e, states, states[:, 3], rates, DT)
    u, w, q, pitch = states.T
    expected = [1.02 * (u + 0.2 * q), 1.02 * (w - 0.4 * q), q + np.radians(0.3), pitch]
    np.testing.assert_allclose(found, np.column_stack(expected), atol=1e-14)


def by_vertical_geometry(states: np.ndarray, heading: np.ndarray, e: dict[str, float]):
    """Readings of the vertical plane without delays; ahead - i down, so that bow up turns by +."""
    u, w, q, pitch = states.T
    place = complex(SENSING.dvl_x_m + e["dvl_lever_arm.dx_m"])
    place -= 1j * (SENSING.dvl_z_m + e["dvl_lever_arm.dz_m"])
    level = (u - 1j * w + 1j * q * place) * np.exp(1j * pitch)
    level += e["current.north_mps"] * np.cos(heading) + e["current.east_mps"] * np.sin(heading)
    level -= 1j * e["vertical_current.down_mps"]
    here = level * np.exp(-1j * (pitch + np.radians(e["dvl_pitch.pitch_deg"])))
    here *= 1.0 + e["dvl_scale.fraction"]
    gyro = (1.0 + e["q_scale.fraction"]) * q + np.radians(e["q_bias.bias_degps"])
    shown = (1.0 + e["pitch_scale.fraction"]) * pitch + np.radians(e["pitch_bias.bias_deg"])
    return np.column_stack([here.real, -here.imag, gyro, shown])


@pytest.mark.parametrize("name", [*(n for n in VERTICAL if n not in LATE), "all"])
def test_readings_of_the_vertical_plane_are_its_geometry(name) -> None:
    at_once = {n: v for n, v in VERTICAL.items() if n not in LATE and name in (n, "all")}
    states, rates = course()
    heading = 0.7 + 0.1 * states[:, 3]
    args = (states, states[:, 3], rates, DT, MIDDLE, heading)
    found = readings("vertical", SENSING, effects(at_once), *args)
    shown = dict.fromkeys(VERTICAL, 0.0) | at_once
    np.testing.assert_allclose(found, by_vertical_geometry(states, heading, shown), atol=1e-14)
    without = by_vertical_geometry(states, heading, dict.fromkeys(VERTICAL, 0.0))
    assert np.abs(found - without).max() > 1e-3


def test_a_dvl_that_points_up_reads_a_level_run_as_sinking() -> None:
    """2 m/s ahead, its axis 3 degrees bow up: 2 cos 3 = 1.99726 and 2 sin 3 = 0.10467 m/s."""
    states = np.array([[2.0, 0.0, 0.0, 0.0]])
    e = effects({"dvl_pitch.pitch_deg": 3.0})
    found = readings("vertical", PLAIN, e, states, states[:, 3], np.zeros((1, 2)), DT)
    np.testing.assert_allclose(found[0], [1.99726, 0.10467, 0.0, 0.0], atol=1e-5)


def test_slopes_of_the_water_by_the_pitch_are_differences() -> None:
    pitch, heading = np.linspace(-0.6, 0.6, 20), np.linspace(0.0, 3.0, 20)
    e, h, rates = effects(VERTICAL), 1e-6, np.zeros((20, 2))
    up, down = (
        offsets("vertical", SENSING, e, pitch + d, rates, None, heading)[:, :2] for d in (h, -h)
    )
    # of a central difference: rounding over h
    found = water_by_pitch(SENSING, e, pitch, heading)
    np.testing.assert_allclose(found, (up - down) / (2.0 * h), atol=1e-9)


@pytest.mark.parametrize("plane", ["horizontal", "vertical"])
def test_without_effects_the_readings_are_the_matrix(plane) -> None:
    states, rates = course()
    zero = effects({})
    matrix = sensor_matrix(plane, SENSING)
    np.testing.assert_array_equal(matrix, sensor_matrix(plane, SENSING, zero))
    found = readings(plane, SENSING, zero, states, states[:, 3], rates, DT)
    # the same products, added in another order
    np.testing.assert_allclose(found, states @ matrix.T, rtol=0.0, atol=1e-15)


def test_values_come_by_name_and_absent_ones_are_zero() -> None:
    structure = structure_of("horizontal", ("gyro_bias", "current"))
    p = np.arange(1.0, len(structure.parameters) + 1.0)
    found = dict(zip(READING, reading_values(structure.parameters, p), strict=True))
    names = ("gyro_bias.bias_degps", "current.north_mps", "current.east_mps")
    there = {name: p[structure.index(name)] for name in names}
    assert found == dict.fromkeys(READING, 0.0) | there


# --- late ----------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(-0.9, 1.5), st.floats(-0.9, 1.5))
def test_late_sensors_show_the_past_by_interpolation(seed, dvl, gyro) -> None:
    values = np.random.default_rng(seed).normal(size=(N, 4))
    found = late(values, effects({"dvl_delay.delay_s": dvl, "gyro_delay.delay_s": gyro}), DT)
    time = DT * np.arange(N)
    delays = (dvl, dvl, gyro, 0.0)
    expected = [np.interp(time - d, time, x) for d, x in zip(delays, values.T, strict=True)]
    # rounding of the delay over the step, times differences of a few
    np.testing.assert_allclose(found, np.column_stack(expected), atol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.55, -0.04, -0.3])
def test_rows_before_the_record_are_unknown(delay) -> None:
    found = unknown_rows(effects({"dvl_delay.delay_s": delay}), 20, DT)
    time = DT * np.arange(20) - delay
    expected = (time < -1e-9) | (time > 1.9 + 1e-9)
    np.testing.assert_array_equal(found[:, 0], expected)
    np.testing.assert_array_equal(found[:, 1], expected)
    assert not found[:, 2:].any()
    gyro = unknown_rows(effects({"gyro_delay.delay_s": delay}), 20, DT)
    np.testing.assert_array_equal(gyro, found[:, [2, 3, 0, 2]])


# --- and back ------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(seeds, st.sampled_from(["horizontal", "vertical"]))
def test_states_behind_the_readings_of_all_effects(seed, plane) -> None:
    """Delays of whole steps: apart from the ends, which the held first row replaces, exact."""
    states, rates = course(seed)
    e, heading = effects(PLANES[plane]), np.full(N, 0.7) if plane == "vertical" else None
    found = readings(plane, SENSING, e, states, states[:, 3], rates, DT, MIDDLE, heading)
    behind = states_behind(plane, SENSING, e, found, rates, DT, MIDDLE, heading)
    np.testing.assert_allclose(behind[:-3], states[:-3], atol=1e-12)


def test_delays_by_fractions_come_back_but_for_the_curvature() -> None:
    states, rates = course()
    e = effects(ALL | {"dvl_delay.delay_s": 0.14, "gyro_delay.delay_s": 0.05})
    found = readings("horizontal", SENSING, e, states, states[:, 3], rates, DT)
    behind = states_behind("horizontal", SENSING, e, found, rates, DT)
    # interpolated forth and back: share (1 - share) of the second difference, at most a quarter
    bend = np.abs(np.diff(found, 2, axis=0)).max(axis=0)
    away = np.abs(behind - states)[2:-3].max(axis=0)
    assert (away <= 0.3 * bend + 1e-12).all()
    assert (away[:3] > 1e-6).all()  # or it would not be a fraction


def test_offsets_are_what_a_vehicle_at_rest_would_show() -> None:
    states, rates = course()
    e = effects({n: v for n, v in ALL.items() if n not in LATE})
    still = states * [0.0, 0.0, 0.0, 1.0]
    shown = readings("horizontal", SENSING, e, still, states[:, 3], rates, DT)
    shown[:, 3] = 0.0
    found = offsets("horizontal", SENSING, e, states[:, 3], rates)
    np.testing.assert_allclose(found, shown, atol=1e-15)
