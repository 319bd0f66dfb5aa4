"""Zigzags of the elevator about an angle of their own: measured from its middle, not from trim."""

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship, overlap
from test_segment_samples import SAMPLES

from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest
from auvident.stages.segment import segment_vertical
from auvident.stages.segment.elevators import find_elevator_zigzags
from auvident.stages.segment.pieces import pieces_of
from auvident.stages.segment.scales import scales_of
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

AUV = Ship(gain=-0.2, slew_degps=40.0)
TRIM = 1.0 * DEG
ZIGZAG = 10 * DEG, 5 * DEG, 6  # elevator, pitch, executes


class Dive(Sail):
    """Elevator for rudder and pitch for heading; `laid` is the elevator that does not pitch."""

    laid = TRIM

    def step(self, command: float, rpm: float) -> None:
        super().step(command, rpm)
        t, u, w, q, fin, rpm, pitch = self.rows.pop()
        self.rows.append((t, u, w, q, fin + self.laid, rpm, pitch))

    def trial(self, name: str = "dive") -> Trial:
        names = {
            "r_radps": "q_radps",
            "v_mps": "w_mps",
            "heading_rad": "pitch_rad",
            "rudder_rad": "elevator_rad",
        }
        made = super().trial(name)
        table = made.table.rename(columns=names)
        still = dict.fromkeys(("v_mps", "r_radps", "rudder_rad", "heading_rad"), 0.0)
        return Trial.from_table(name, table.assign(**still), made.rate_hz)


def dive(laid: float, sail=lambda d: d.zigzag(*ZIGZAG, AUV.cruise_rpm)) -> Dive:
    """Level, one maneuver about `laid`, level again."""
    d = Dive(AUV, np.random.default_rng(1))
    d.u = AUV.cruise_mps
    d.steer(60, AUV.cruise_rpm, 0.0, 0.9, 12 * DEG)
    d.laid = laid
    sail(d)
    d.laid = TRIM
    d.steer(90, AUV.cruise_rpm, 0.0, 0.9, 12 * DEG)
    return d


def searched(d: Dive) -> tuple:
    (piece,) = pieces_of(d.trial(), "vertical")
    return (piece, *find_elevator_zigzags(piece, scales_of([piece])))


@pytest.mark.parametrize("laid_deg", [1.0, 0.0, 5.0, -4.0, 12.0, -13.0])
def test_executes_are_measured_from_their_own_middle(laid_deg) -> None:
    d = dive(laid_deg * DEG)
    piece, (found,), rejected = searched(d)
    ((_, start, end),) = d.truth
    assert piece.time(found.start) == pytest.approx(start, abs=0.5)
    assert piece.time(found.stop) == pytest.approx(end, abs=0.5)
    assert abs(found.level_rad) == pytest.approx(ZIGZAG[0], abs=0.5 * DEG)
    assert not [r for r in rejected if r.t_start_s < end and r.t_end_s > start]


def test_angles_that_do_not_return_are_different_orders_of_the_elevator() -> None:
    def orders(d: Dive) -> None:
        for angle in (14, -4, 10, -2, 7, -5.5):
            d.fixed(3, AUV.cruise_rpm, angle * DEG)

    _, found, rejected = searched(dive(TRIM, orders))
    assert not found
    assert any("elevator goes to two sides by different orders" in r.reason for r in rejected)
    assert not any("rudder" in r.reason or "heading" in r.reason for r in rejected)


def test_two_holds_about_a_laid_elevator_are_no_zigzag() -> None:
    _, found, _ = searched(dive(5 * DEG, lambda d: d.zigzag(10 * DEG, 5 * DEG, 2, AUV.cruise_rpm)))
    assert not found


@cache
def drawn(seed: int) -> tuple[list, tuple]:
    """True maneuvers of a vertical trial of a drawn vehicle, and those that are found."""
    with pytest.MonkeyPatch.context() as patch, TemporaryDirectory() as name:
        patch.syspath_prepend(str(SAMPLES))
        from seatrial.population import draw

        vehicle, log = Path(name) / "vehicle.toml", Path(name) / "trial"
        day = draw(seed, plane="vertical")
        sailed = day.sail()
        day.write(sailed, log, vehicle)
        trial = ingest(read_trials([log])[0], load_vehicle(vehicle))[0]
        true = json.loads(json.dumps(day.truth(sailed)["maneuvers"]))
        return true, segment_vertical([trial]).maneuvers


@pytest.mark.parametrize("seed", [16, 12])  # about a laid elevator; amidships, trimmed by 3 degrees
def test_zigzags_of_drawn_vehicles_are_found(seed) -> None:
    true, found = drawn(seed)
    zigzags = [(m["kind"], m["t_start_s"], m["t_end_s"]) for m in true if m["kind"] == "zigzag"]
    assert overlap(zigzags, found, "zigzag") >= 0.9
    for m in true:  # and the depth steps behind them, which a missed zigzag had swallowed
        steps = [s for s in found if s.features.get("maneuver") == "depth_step"]
        if m["kind"] == "depth_step":
            assert any(m["t_start_s"] - 5 <= s.t_start_s < m["t_end_s"] for s in steps)
