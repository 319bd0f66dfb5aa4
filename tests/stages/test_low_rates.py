"""A grid so slow that a span of a second, or of half a one, holds no row."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ingest_world import maneuvers, vehicle
from segment_world import Sail, Ship

from auvident.errors import UsageError
from auvident.physics.maneuvers.plateaus import Plateau
from auvident.stages.ingest import ingest
from auvident.stages.ingest.checks.seen import Seen
from auvident.stages.segment import segment
from auvident.stages.segment.depth import sink_by_depth
from auvident.stages.segment.pieces import pieces_of
from auvident.stages.segment.scales import scales_of
from auvident.stages.segment.turns import eases_off
from auvident.stages.segment.zigzags import first_execute
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

SAMPLES = Path(__file__).parents[2] / "sample_logs"
VEHICLES = {"harbour_trial": "remus100", "dive_trial": "remus100", "shelf_trial": "tern180"}


@cache
def read(name):
    (raw,) = read_trials([SAMPLES / name])
    return raw, load_vehicle(SAMPLES / f"{VEHICLES[name]}.toml")


def checks_at(rate_hz, name, raw=None):
    _, quality = ingest(raw or read(name)[0], read(name)[1], rate_hz=rate_hz)
    return {c.name: c for c in quality.checks_made}


@pytest.mark.parametrize("rate_hz", [0.2, 0.5, 0.7, 1.0, 2.0])
@pytest.mark.parametrize("name", VEHICLES)
def test_a_slow_grid_accuses_no_sensor(name, rate_hz):
    """Sway was said to be -0.4 times that of the position, the pitch rate half of the pitch's."""
    found = checks_at(rate_hz, name)
    assert not [c.name for c in found.values() if c.outcome == "contradicts"]
    assert found["sway_by_position"].outcome == "agrees"
    assert found["sway_by_position"].value == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("rate_hz", "proposes"), [(0.7, False), (2.0, True)])
def test_a_pitch_rate_that_is_far_off_is_told_on_a_slow_grid(rate_hz, proposes):
    """What differences over long steps leave of it is no scale to correct it by."""
    raw, _ = read("dive_trial")
    gyro = raw.sensors["gyro"]
    little = replace(gyro, values={**gyro.values, "q_radps": 0.4 * gyro.values["q_radps"]})
    trial = replace(raw, sensors={**raw.sensors, "gyro": little})
    found = checks_at(rate_hz, "dive_trial", trial)["pitch_rate_scale"]
    assert found.outcome == "contradicts" and bool(found.fix) == proposes


@pytest.mark.parametrize("rate_hz", [1.0, 0.5, 0.2])
def test_a_slow_grid_is_ingested(rate_hz):
    trial, quality = ingest(maneuvers(), vehicle(), rate_hz=rate_hz)
    assert quality.samples == len(trial.table) == pytest.approx(400.0 * rate_hz, abs=2.0)


def test_a_rate_that_shows_no_maneuver_is_refused():
    with pytest.raises(UsageError, match=r"rate 0\.1 Hz") as caught:
        ingest(maneuvers(), vehicle(), rate_hz=0.1)
    assert "Give a rate of 0.2 to 1000 Hz" in caught.value.remedy


def test_the_unrest_of_a_window_is_a_number_at_any_rate():
    ship = Ship(rate_hz=0.2, u_noise=0.0, r_noise_degps=0.0)
    sail = Sail(ship, np.random.default_rng(1))
    sail.fixed(400.0, ship.cruise_rpm)
    windows = Seen(raw=None, trial=sail.trial(), vehicle=vehicle()).windows
    assert windows and all(np.isfinite(w.unrest) for w in windows)


@pytest.mark.parametrize("rate_hz", [1.0, 0.5])
def test_the_rudder_of_a_slow_log_is_followed(rate_hz):
    ship = Ship(rate_hz=rate_hz, gain=-0.06, lag_s=10.0, surge_lag_s=30.0, slew_degps=0.5)
    sail = Sail(ship, np.random.default_rng(2))
    sail.fixed(60.0, ship.cruise_rpm)
    sail.zigzag(0.2, 0.2, 5, ship.cruise_rpm)
    sail.turn(0.3, ship.cruise_rpm)
    sail.fixed(60.0, ship.cruise_rpm)
    trial = sail.trial()
    assert {m.kind for m in segment([trial]).maneuvers} == {"turn", "zigzag"}


@pytest.mark.parametrize("rate_hz", [1.0, 0.5, 0.2])
def test_a_rudder_that_comes_over_within_a_step_is_one_execute(rate_hz):
    piece = with_fin(rate_hz, [0.0] * 20 + [-0.2] + [0.2] * 20 + [-0.2] * 20)
    scales = scales_of([piece])
    start, unheld = first_execute(piece, scales, [Plateau(21, 41, 0.2), Plateau(41, 61, -0.2)])
    assert (start, unheld) == (21, 0)


@pytest.mark.parametrize("rate_hz", [1.0, 0.5, 0.2])
def test_a_rudder_that_leaves_within_a_step_is_not_eased_off(rate_hz):
    piece = with_fin(rate_hz, [0.0] * 20 + [0.2] * 20 + [0.0] * 20)
    assert not eases_off(piece, scales_of([piece]), Plateau(20, 40, 0.2), 20)


@pytest.mark.parametrize("rate_hz", [1.0, 0.5, 0.2])
def test_a_depth_of_one_row_tells_no_rate(rate_hz):
    piece = with_fin(rate_hz, [0.0] * 40)
    depth = np.full(40, np.nan)
    depth[5], depth[10:30] = 3.0, np.arange(20.0)
    rate = sink_by_depth(replace(piece, depth=depth))
    assert np.isnan(rate[5]) and rate[10:30] == pytest.approx(rate_hz)


def with_fin(rate_hz, fin):
    """A piece under way with a rudder as given, free of noise."""
    sail = Sail(Ship(rate_hz=rate_hz, u_noise=0.0, r_noise_degps=0.0), np.random.default_rng(0))
    for angle in fin:
        sail.step(angle, sail.ship.cruise_rpm)
    (piece,) = pieces_of(sail.trial())
    return replace(piece, fin=np.array(fin))
