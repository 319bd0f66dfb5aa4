"""The segment stage on closed-form trials: what is found, where, and why not."""

from dataclasses import replace

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship, overlap, random_trial

from auvident.errors import InputError
from auvident.schema.artifacts import Maneuvers
from auvident.schema.trial import Trial
from auvident.stages.segment import segment
from tests.processor_time import least_of_three

AUV = Ship()
LEAST_OVERLAP = 0.9  # what the program promises
SHIPS = {
    "auv": AUV,
    "logged at 5 Hz": Ship(rate_hz=5),
    "logged at 20 Hz": Ship(rate_hz=20),
    "no compass": Ship(with_heading=False),
    "measured rudder": Ship(slew_degps=20, rudder_noise_deg=0.2),
    "slow noisy rudder": Ship(slew_degps=8, rudder_noise_deg=0.4, gain=-0.35),
    "noisy sensors": Ship(u_noise=0.08, r_noise_degps=1.0, heading_noise_deg=0.5),
    "quick, 30 deg/s": Ship(gain=-1.6, lag_s=0.25, cruise_mps=2.2),
    "7 m model, 1 deg/s": Ship(
        cruise_mps=1.0,
        cruise_rpm=600,
        gain=-0.06,
        lag_s=6,
        surge_lag_s=15,
        r_noise_degps=0.03,
        slew_degps=15,
    ),
}
KINDS = ("straight", "turn", "zigzag")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ship", SHIPS.values(), ids=SHIPS.keys())
def test_random_programmes_are_found(ship, seed):
    trial, truth = random_trial(ship, seed)
    found = segment([trial]).maneuvers
    for kind in KINDS:
        assert overlap(truth, found, kind) >= LEAST_OVERLAP, kind
        assert sum(m.kind == kind for m in found) == sum(k == kind for k, _, _ in truth)


def test_nothing_is_invented_outside_the_maneuvers():
    trial, truth = random_trial(AUV, 7)
    for m in segment([trial]).maneuvers:
        assert any(k == m.kind and a < m.t_end_s and m.t_start_s < b for k, a, b in truth)


def sail(ship: Ship = AUV, seed: int = 0) -> Sail:
    """A trial that is under way at cruise speed."""
    s = Sail(ship, np.random.default_rng(seed))
    s.u = ship.cruise_mps
    s.steer(40, ship.cruise_rpm, 0.0, 0.9, 12 * DEG)
    return s


def of_kind(result: Maneuvers, kind: str):
    return [m for m in result.maneuvers if m.kind == kind]


@pytest.mark.parametrize("fin", [12, -12])
def test_turn_from_execute_to_release(fin):
    s = sail()
    s.turn(fin * DEG, 900, 380)
    s.steer(30, 900, s.psi, 0.9, 8 * DEG)
    turn = of_kind(segment([s.trial()]), "turn")[0]
    _, start, end = s.truth[0]
    # the running median may move an edge by one sample
    assert turn.t_start_s == pytest.approx(start, abs=0.11)
    assert turn.t_end_s == pytest.approx(end, abs=0.11)
    assert turn.features["side"] == ("port" if fin > 0 else "starboard")
    assert turn.features["rudder_deg"] == pytest.approx(fin, abs=0.01)
    speed = s.ship.cruise_mps * (1 - 0.8 * 12 * DEG)
    rate = s.ship.gain * fin * speed / s.ship.cruise_mps
    assert turn.features["steady_r_degps"] == pytest.approx(rate, rel=0.02)  # gyro noise
    assert turn.features["steady_diameter_m"] == pytest.approx(
        2 * speed / abs(rate * DEG), rel=0.03
    )


@pytest.mark.parametrize(("fin", "switch"), [(20, 20), (-10, 10), (20, 10), (10, 5), (5, 1)])
def test_zigzag_from_first_execute_to_last_release(fin, switch):
    s = sail()
    s.zigzag(fin * DEG, switch * DEG, 5, 900)
    s.steer(30, 900, 0.0, 0.9, 8 * DEG)
    zigzags = of_kind(segment([s.trial()]), "zigzag")
    assert len(zigzags) == 1
    _, start, end = s.truth[0]
    assert zigzags[0].t_start_s == pytest.approx(start, abs=0.31)
    assert zigzags[0].t_end_s == pytest.approx(end, abs=0.31)
    features = zigzags[0].features
    assert features["rudder_deg"] == pytest.approx(abs(fin), abs=0.01)
    assert features["executes"] == 5
    assert features["first_side"] == ("port" if fin > 0 else "starboard")
    # heading noise, and what the vehicle turns within a sample
    assert features["switch_deg"] == pytest.approx(switch, abs=0.3 + abs(fin) * 0.06)


def test_three_executes_are_a_zigzag_and_two_are_not():
    s = sail()
    s.zigzag(15 * DEG, 15 * DEG, 3, 900)
    s.steer(40, 900, 0.0, 0.9, 8 * DEG)
    s.zigzag(-15 * DEG, 15 * DEG, 2, 900)
    s.steer(40, 900, 0.0, 0.9, 8 * DEG)
    result = segment([s.trial()])
    assert [m.features["executes"] for m in of_kind(result, "zigzag")] == [3]
    refused = [r for r in result.rejected if "too few" in r.reason]
    assert [(r.value, r.threshold) for r in refused] == [(2.0, 3.0)]


def test_straight_from_first_to_last_level():
    s = sail()
    s.straight([700, 1000, 850], [30, 25, 35], kept=True)
    s.transit(900)
    s.transit(900)
    straight = of_kind(segment([s.trial()]), "straight")
    assert len(straight) == 1
    _, start, end = s.truth[0]
    assert straight[0].t_start_s == pytest.approx(start, abs=1.0)  # restlessness per second
    assert straight[0].t_end_s == pytest.approx(end, abs=1.0)
    assert straight[0].features["rpm_levels"] == [700, 1000, 850]
    assert straight[0].features["steps"] == 2


@pytest.mark.parametrize("kept", [True, False])
def test_first_level_at_the_speed_of_the_transit(kept):
    """No thrust step marks the start; who steers does."""
    s = sail()
    s.transit(900, settle=2.0)
    s.straight([900, 1100, 800], [30, 30, 30], kept=kept)
    s.transit(900)
    straight = of_kind(segment([s.trial()]), "straight")
    _, start, end = s.truth[0]
    assert straight[0].t_start_s == pytest.approx(start, abs=3.0)
    assert straight[0].t_end_s == pytest.approx(end, abs=3.0)


def test_two_runs_with_a_transit_on_the_same_course_between_them():
    s = sail()
    for levels in ([700, 1000, 850], [850, 1100, 800]):
        s.straight(levels, [30, 30, 30], kept=True)
        s.steer(25, 850, s.psi, 0.9, 12 * DEG)
    straight = of_kind(segment([s.trial()]), "straight")
    assert len(straight) == 2
    assert overlap(s.truth, tuple(straight), "straight") >= LEAST_OVERLAP


def test_a_curved_run_with_the_rudder_at_rest_is_straight():
    """An asymmetric hull turns slowly under zero rudder; the thrust steps excite all the same."""
    s = sail()
    s.zigzag(20 * DEG, 20 * DEG, 4, 900)
    s.steer(40, 900, s.psi, 0.9, 8 * DEG)
    s.straight([700, 1000, 850], [30, 30, 30], kept=False)
    s.transit(900)
    trial = s.trial()
    table = trial.table.copy()
    drift = abs(s.ship.gain) * 4.5 * DEG
    table["r_radps"] += drift * (table["u_mps"] / s.ship.cruise_mps)
    table = table.drop(columns="heading_rad")
    found = segment([trial.with_table(table)]).maneuvers
    assert overlap(s.truth, found, "straight") >= LEAST_OVERLAP


def test_a_long_run_without_a_thrust_step_is_rejected_with_the_reason():
    s = sail()
    s.steer(60, 900, 0.0, 0.9, 12 * DEG)
    s.zigzag(20 * DEG, 20 * DEG, 4, 900)
    result = segment([s.trial()])
    assert not of_kind(result, "straight")
    refused = next(r for r in result.rejected if "no thrust step" in r.reason)
    assert refused.value < refused.threshold


def test_thrust_down_to_zero_at_the_end_is_no_level():
    s = sail()
    s.straight([800, 1100, 900], [30, 30, 30], kept=False)
    for share in np.linspace(1, 0, 100):
        s.fixed(0.1, 900 * share)
    s.fixed(40, 0)
    straight = of_kind(segment([s.trial()]), "straight")
    assert straight[0].features["rpm_levels"] == [800, 1100, 900]
    assert straight[0].t_end_s == pytest.approx(s.truth[0][2], abs=1.5)


def test_rudder_checks_at_no_speed_are_no_zigzag():
    s = Sail(AUV, np.random.default_rng(0))
    s.wiggle(30, 0, 20 * DEG, 4.0)
    s.wiggle(20, 0.3 * 900, 20 * DEG, 5.0)
    s.steer(60, 900, s.psi, 0.9, 12 * DEG)
    s.zigzag(10 * DEG, 10 * DEG, 5, 900)
    s.fixed(20, 900)
    result = segment([s.trial()])
    assert len(of_kind(result, "zigzag")) == 1
    assert any(r.reason.startswith("zigzag: too slow") for r in result.rejected)


def test_an_autopilot_that_hunts_is_no_zigzag():
    """Too stiff for its damping, it saturates to both sides; but it brings the heading back."""
    s = sail()
    s.zigzag(15 * DEG, 15 * DEG, 4, 900)
    s.steer(20, 900, s.psi, 0.9, 8 * DEG)
    start, course = s.time, s.psi + 40 * DEG
    for _ in range(400):
        s.step(float(np.clip(25 * (s.psi - course), -8 * DEG, 8 * DEG)), 900)
    fins = np.array([row[4] for row in s.rows if row[0] >= start])
    assert np.count_nonzero(np.diff(np.sign(fins))) >= 4  # it does hunt
    zigzags = of_kind(segment([s.trial()]), "zigzag")
    assert [m.t_end_s < start for m in zigzags] == [True]


@pytest.mark.parametrize("degrees", [90, 120, 150])
def test_a_change_of_course_is_no_turn(degrees):
    s = sail()
    s.zigzag(15 * DEG, 15 * DEG, 4, 900)
    s.steer(60, 900, s.psi + degrees * DEG, 0.9, 20 * DEG)
    assert not of_kind(segment([s.trial()]), "turn")


def test_a_spin_against_the_rudder_is_no_turn():
    s = sail()
    s.zigzag(15 * DEG, 15 * DEG, 6, 900)
    s.steer(20, 900, s.psi, 0.9, 8 * DEG)
    s.turn(12 * DEG, 900, 400)
    trial = s.trial()
    table = trial.table.copy()
    spin = table["time_s"] >= s.truth[-1][1]
    table.loc[spin, "r_radps"] *= -1
    result = segment([trial.with_table(table.drop(columns="heading_rad"))])
    assert not of_kind(result, "turn")
    assert any("against its rudder" in r.reason for r in result.rejected)


def mirrored(trial: Trial) -> Trial:
    table = trial.table.copy()
    for column in ("v_mps", "r_radps", "rudder_rad", "heading_rad"):
        table[column] *= -1
    return trial.with_table(table)


def test_port_is_the_mirror_of_starboard():
    trial, _ = random_trial(AUV, 2)
    left, right = segment([trial]), segment([mirrored(trial)])
    other = {"port": "starboard", "starboard": "port"}
    assert len(left.maneuvers) == len(right.maneuvers)
    for a, b in zip(left.maneuvers, right.maneuvers, strict=True):
        assert (a.id, a.t_start_s, a.t_end_s, a.role) == (b.id, b.t_start_s, b.t_end_s, b.role)
        for key in ("side", "first_side"):
            assert b.features.get(key) == other.get(a.features.get(key))


def test_a_shift_of_the_clock_shifts_the_maneuvers():
    trial, _ = random_trial(AUV, 2)
    late = trial.with_table(trial.table.assign(time_s=trial.table["time_s"] + 5000))
    for a, b in zip(segment([trial]).maneuvers, segment([late]).maneuvers, strict=True):
        assert (a.id, a.role) == (b.id, b.role)
        # times are rounded to a millisecond
        assert b.t_start_s - a.t_start_s == pytest.approx(5000, abs=2e-3)
        assert b.t_end_s - a.t_end_s == pytest.approx(5000, abs=2e-3)


def test_the_order_of_the_trials_does_not_matter():
    trials = [replace(random_trial(AUV, seed)[0], name=f"day{seed}") for seed in (1, 2, 3)]
    forward, backward = segment(trials), segment(trials[::-1])
    assert {m.id: m for m in forward.maneuvers} == {m.id: m for m in backward.maneuvers}


def test_a_contrary_rudder_sign_is_noticed_and_does_no_harm():
    trial, truth = random_trial(AUV, 4)
    contrary = trial.with_table(trial.table.assign(rudder_rad=-trial.table["rudder_rad"]))
    result = segment([contrary])
    assert "rudder_sign" in [f.code for f in result.findings]
    for kind in KINDS:
        assert overlap(truth, result.maneuvers, kind) >= LEAST_OVERLAP
    assert "rudder_sign" not in [f.code for f in segment([trial]).findings]


def test_nothing_found_names_the_closest_candidates():
    s = sail()
    s.steer(60, 900, 100 * DEG, 0.9, 12 * DEG)
    with pytest.raises(InputError) as caught:
        segment([s.trial("quay")])
    assert "quay" in str(caught.value)
    assert "no thrust step" in str(caught.value)
    assert "needed" in str(caught.value)


def test_a_log_of_rest_says_that_nothing_was_a_candidate():
    s = Sail(AUV, np.random.default_rng(0))
    s.fixed(120, 0)
    with pytest.raises(InputError, match="No candidate"):
        segment([s.trial()])


def test_rpm_that_stays_at_zero_under_way_is_the_reason_that_is_named():
    trial, _ = random_trial(AUV, 4)
    dead = trial.with_table(trial.table.assign(rpm=0.0))
    with pytest.raises(InputError, match="No candidate") as caught:
        segment([dead])
    assert "The propeller never turns (rpm is 0 throughout, at a usual speed of" in str(
        caught.value
    )
    assert "looks stuck, or is not connected" in str(caught.value)
    assert "fins" not in str(caught.value)
    s = Sail(AUV, np.random.default_rng(0))
    s.fixed(20, 900)
    with pytest.raises(InputError, match="the fins are never held") as caught:
        segment([dead, s.trial("quay")])
    assert "The propeller never turns" in str(caught.value)


def test_excitation_ranks_as_the_method_expects():
    """Thrust steps excite surge, zigzags steering; a steady circle neither."""
    s = sail()
    s.straight([700, 1100, 800], [30, 30, 30], kept=False)
    s.transit(900)
    s.zigzag(20 * DEG, 20 * DEG, 6, 900)
    s.transit(900)
    s.turn(12 * DEG, 900, 700)
    s.fixed(10, 900)
    by_kind = {m.kind: m.features["excitation"] for m in segment([s.trial()]).maneuvers}
    assert by_kind["straight"]["surge"] > 2 * by_kind["turn"]["surge"]
    assert by_kind["straight"]["rpm_std"] > 100
    assert by_kind["zigzag"]["r_std_degps"] > by_kind["turn"]["r_std_degps"]


def test_a_day_of_work_takes_seconds_at_most():
    trial, _ = random_trial(AUV, 0)
    assert len(trial.table) > 8000
    # twice 25 minutes; takes 0.3 s
    assert least_of_three(lambda: segment([trial, trial])) < 3.0
