"""Elevator and heave of a vertical trial: right ones agree, damaged ones contradict."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from auvident.report.check_words import left_open
from auvident.schema.logs import DEG, CheckMade, TrialQuality
from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest
from auvident.stages.ingest.checks import Seen, heave, run_checks
from auvident.stages.ingest.checks.elevator import elevator_cut
from auvident.stages.ingest.moments import PITCH, HeldFin
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

Change = Callable[[np.ndarray, np.ndarray], np.ndarray]
SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
BOAT = load_vehicle(SAMPLES / "remus100.toml")
NAMES = ("elevator_unit", "elevator_scale", "elevator_cut", "elevator_stuck", "speed_by_depth",
         "heave_scale")  # fmt: skip
NO_POSITION: dict[str, Change] = dict.fromkeys(("north_m", "east_m"), lambda _, x: x * np.nan)


@cache
def ingested(name: str) -> tuple[Trial, TrialQuality]:
    (raw,) = read_trials([SAMPLES / name])
    return ingest(raw, BOAT)


def checks(changes: dict[str, Change]) -> dict[str, CheckMade]:
    """Checks of the dive with channels changed, given their time."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    trial = ingested("dive_trial")[0]
    time = trial.table["time_s"].to_numpy()
    made = {c: f(time, trial.table[c].to_numpy().copy()) for c, f in changes.items()}
    table = trial.table.assign(**made)
    return {c.name: c for c in run_checks(Seen(raw, trial.with_table(table), BOAT))[0]}


def times(factor: float) -> Change:
    return lambda _, x: factor * x


def frozen(time: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The elevator as it is in the middle of its largest minute, for a minute."""
    starts = np.arange(time[0], time[-1] - 60.0, 5.0)
    stretches = [(time >= t) & (time < t + 60.0) for t in starts]
    worst = max(stretches, key=lambda rows: np.nanstd(x[rows]))
    x[worst] = x[worst][0]
    return x


def test_a_right_dive_contradicts_nothing():
    made = {c.name: c for c in ingested("dive_trial")[1].checks_made}
    assert {name for name in NAMES if made[name].outcome != "agrees"} == {"elevator_cut"}
    assert made["elevator_cut"].message == "too few moves to the largest elevator"


DAMAGED: dict[str, tuple[dict[str, Change], str]] = {
    "elevator / 57": ({"elevator_rad": times(DEG)}, "elevator_unit"),
    "elevator that stays": ({"elevator_rad": times(0.0)}, "elevator_unit"),
    "elevator x 6": ({"elevator_rad": times(6.0)}, "elevator_unit"),
    "elevator / 6": ({"elevator_rad": times(1 / 6)}, "elevator_scale"),
    "elevator that stands still": ({"elevator_rad": frozen}, "elevator_stuck"),
    "w x 1.4": ({"w_mps": times(1.4)}, "heave_scale"),
    "w x 0.5": ({"w_mps": times(0.5)}, "heave_scale"),
}


def at_the_end(time: np.ndarray) -> np.ndarray:
    return time > time[-1] - 60.0


def waves(time: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.where(at_the_end(time), 0.08 * np.sin(0.8 * time), q)


@pytest.mark.parametrize(("depth_m", "outcome"), [(0.2, "agrees"), (20.0, "contradicts")])
def test_what_waves_do_at_the_surface_is_no_stuck_elevator(depth_m, outcome):
    """A vehicle that waits at the surface after its last dive pitches with its elevator still."""
    changes: dict[str, Change] = {
        "q_radps": waves,
        "elevator_rad": lambda time, x: np.where(at_the_end(time), 0.0, x),
        "u_mps": lambda time, x: np.where(at_the_end(time), 1.4, x),
        "depth_m": lambda time, x: np.where(at_the_end(time), depth_m, x),
    }
    assert checks(changes)["elevator_stuck"].outcome == outcome


def test_a_trim_by_weight_stands_in_the_balance_at_every_speed():
    rng = np.random.default_rng(0)
    signals = {name: rng.uniform(0.5, 2.0, 50) for name in ("u", "side", "rate", "angle")}
    terms = PITCH.rest(signals, 0.3)  # a constant moment is among them, whatever the speed
    assert np.linalg.lstsq(terms, np.full(50, 0.2), rcond=None)[1] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_dive_contradicts(damage):
    changes, name = DAMAGED[damage]
    made = checks(changes)[name]
    assert made.outcome == "contradicts", made.message
    assert made.remedy


def test_a_hull_that_pitches_little_is_not_accused():
    """A twice as large elevator looks like damping: it is told that nothing tests it."""
    made = checks({"elevator_rad": times(2.0)})["elevator_scale"]
    assert made.outcome == "untested" and "its damping" in made.message


@pytest.mark.parametrize("most, outcome", [(1.0, "agrees"), (2.0, "contradicts")])
def test_moments_at_the_largest_elevator_are_alike(most, outcome):
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    seen = Seen(raw, ingested("dive_trial")[0], BOAT)
    angles = 5 * DEG * np.linspace(1.0, most, 9) * np.tile([1, -1], 5)[:9]
    held = [HeldFin(0.0, 9.0, 5 * DEG * np.sign(a), np.array([a]), np.zeros(1)) for a in angles]
    assert seen.pitching is not None
    vars(seen)["pitching"] = replace(seen.pitching, holds=tuple(held))
    assert elevator_cut(seen).outcome == outcome


def test_where_the_depth_hardly_shows_the_heave_w_has_neither_sign_nor_scale(monkeypatch):
    monkeypatch.setattr(heave, "LEAST_ALONE", 1.0)
    made = checks({"w_mps": times(0.5)})
    assert {made[name].message for name in ("heave_sign", "heave_scale")} == {heave.LITTLE_HEAVE}
    assert {made[name].outcome for name in ("heave_sign", "heave_scale")} == {"untested"}


@pytest.mark.parametrize("still", [(), ("w_mps",)])
def test_a_height_in_the_column_of_the_depth(still):
    gone = dict.fromkeys(still, times(0.0))
    made = checks({"depth_m": times(-1.0)} | gone)
    assert made["pitch_sign"].fix == "depth_m = -1 depth_m"
    assert made["heave_sign"].message == made["pitch_rate_scale"].message == "see pitch_sign"


def test_a_pitch_of_the_wrong_sign():
    made = checks({"pitch_rad": times(-1.0)})
    assert made["pitch_sign"].fix == "pitch_rad = -1 pitch_rad"


def test_a_scale_of_w_has_its_fix():
    assert checks({"w_mps": times(0.5)})["heave_scale"].fix.startswith("w_mps = 2.")


def late(by_s: float, filtered: bool = False) -> Change:
    """The depth of some time ago, or behind a filter of first order."""

    def change(time: np.ndarray, x: np.ndarray) -> np.ndarray:
        if not filtered:
            return np.interp(time - by_s, time, x)
        out, share = x.copy(), (time[1] - time[0]) / by_s
        for k in range(1, out.size):
            out[k] = out[k - 1] + share * (x[k] - out[k - 1])
        return out

    return change


@pytest.mark.parametrize(
    "change",
    [late(-1.5), late(-0.7), late(0.7), late(1.5), late(0.45, filtered=True),
     late(1.0, filtered=True), late(2.0, filtered=True)],
)  # fmt: skip
def test_a_late_depth_is_no_fault_of_w(change):
    """Beside speed and pitch of now, w follows their slope: the depth seems to go by 3 times it."""
    made = checks({"depth_m": change})
    for name in ("heave_sign", "heave_scale", "speed_by_depth"):
        assert made[name].outcome != "contradicts", made[name].message
        assert not made[name].fix


@pytest.mark.parametrize("factor", [-2.0, 0.5])
def test_a_w_at_fault_is_no_fault_of_the_clock_of_the_depth(factor):
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    dvl = raw.sensors["dvl"]
    values = {**dvl.values, "w_mps": factor * dvl.values["w_mps"]}
    wrong = {**raw.sensors, "dvl": replace(dvl, values=values)}
    quality = ingest(replace(raw, sensors=wrong), BOAT)[1]
    made = {c.name: c for c in quality.checks_made}
    contradicted = "heave_sign" if factor < 0.0 else "heave_scale"
    assert made[contradicted].outcome == "contradicts"
    assert made["clock_depth"].outcome != "contradicts" and not made["clock_depth"].fix
    if factor < 0.0:
        assert made["clock_depth"].message == "see heave_sign"
    assert "depth_lags_gyro" not in {f.code for f in quality.findings}


@pytest.mark.parametrize("factor", [0.8, 1.1, 1.94])
def test_a_dive_tells_the_scale_of_the_speed_without_a_position(factor):
    made = checks(dict.fromkeys(("u_mps", "v_mps", "w_mps"), times(factor)) | NO_POSITION)
    assert made["speed_by_position"].outcome == "untested"
    found = made["speed_by_depth"]
    assert found.outcome == "contradicts" and 1.0 / found.value == pytest.approx(factor, rel=0.02)
    assert found.fix.startswith(f"u_mps = {found.value:.6g} u_mps")
    assert made["heave_scale"].outcome == "untested"


def test_a_wrong_w_is_not_told_as_a_wrong_speed():
    made = checks({"w_mps": times(1.4)})
    assert made["speed_by_depth"].outcome != "contradicts"


def test_a_trial_at_one_depth_tells_no_scale_of_the_speed():
    still = np.random.default_rng(1).normal(10.0, 0.02, len(ingested("dive_trial")[0].table))
    made = checks({"depth_m": lambda _, x: np.where(np.isfinite(x), still, x)} | NO_POSITION)
    assert made["speed_by_depth"].outcome == "untested"


def test_an_elevator_that_only_keeps_the_depth_is_left_open():
    left = left_open([ingested("harbour_trial")[1]])
    assert "scale of the elevator" in left
    assert "unit of the elevator" in left
