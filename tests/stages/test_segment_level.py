"""Inclined paths and the surface are no place for horizontal maneuvers; trim is no zigzag's end."""

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship

from auvident.schema.artifacts import Maneuvers
from auvident.schema.trial import Trial
from auvident.stages.segment import segment, segment_both, segment_vertical

AUV = Ship()
RPM = AUV.cruise_rpm
DEPTH_M, DEEP_M = 6.0, 60.0


def sailed(seed: int = 4) -> Sail:
    """Turns, zigzags and a run with thrust steps."""
    s = Sail(AUV, np.random.default_rng(seed))
    s.u = AUV.cruise_mps
    for fin in (12 * DEG, -20 * DEG):
        s.steer(40, RPM, s.psi, 0.9, 0.14)
        s.turn(fin, RPM)
    for fin in (15 * DEG, -20 * DEG):
        s.steer(40, RPM, s.psi, 0.9, 0.14)
        s.zigzag(fin, fin if fin > 0 else -fin, 5, RPM)
    s.steer(40, RPM, s.psi, 0.9, 0.14)
    s.straight([0.8 * RPM, RPM, 0.9 * RPM], [30, 30, 30], kept=False)
    s.fixed(20, RPM)
    return s


def with_depth(trial: Trial, descents: list[tuple[float, float, float]]) -> Trial:
    """The trial at a depth of its own, with spans in which it sinks at so many degrees."""
    table = trial.table.copy()
    angle = np.zeros(len(table))
    for start, stop, degrees in descents:
        angle[table["time_s"].between(start, stop)] = degrees * DEG
    sink = table["u_mps"] * np.sin(angle) / AUV.rate_hz
    noise = np.random.default_rng(0).normal(0.0, 0.01, len(table))
    return trial.with_table(table.assign(depth_m=DEEP_M + sink.cumsum() + noise))


def spans(found: Maneuvers, kind: str) -> list[float]:
    return [m.t_start_s for m in found.maneuvers if m.kind == kind]


@pytest.mark.parametrize(("kind", "number"), [("turn", 0), ("zigzag", 1)])
@pytest.mark.parametrize(("degrees", "left"), [(4.0, 2), (-7.0, 2), (14.0, 1), (-20.0, 1)])
def test_a_maneuver_on_an_inclined_path_is_refused_with_the_reason(
    kind: str, number: int, degrees: float, left: int
) -> None:
    s = sailed()
    trial, truth = s.trial(), [row for row in s.truth if row[0] == kind]
    level = segment([with_depth(trial, [])])
    assert len(spans(level, kind)) == 2
    _, start, stop = truth[number]
    found = segment([with_depth(trial, [(start, stop, degrees)])])
    assert len(spans(found, kind)) == left
    refused = [r for r in found.rejected if "inclined" in r.reason]
    assert len(refused) == 2 - left
    for r in refused:
        assert r.reason.startswith(kind)
        # the rate of sinking is averaged over four seconds, also across the ends
        assert r.value == pytest.approx(1.0 / np.cos(degrees * DEG) - 1.0, rel=0.15)
        assert r.value > r.threshold


def test_without_depth_and_pitch_nothing_tells() -> None:
    trial = sailed().trial()
    assert segment([trial]).maneuvers == segment([with_depth(trial, [])]).maneuvers


def test_a_pitch_tells_it_where_the_depth_has_a_gap() -> None:
    s = sailed()
    trial = with_depth(s.trial(), [])
    _, start, stop = next(row for row in s.truth if row[0] == "turn")
    table = trial.table.copy()
    inside = table["time_s"].between(start - 10, stop + 10)
    table.loc[inside, "depth_m"] = np.nan
    table["pitch_rad"] = np.where(inside, -15 * DEG, 0.0)
    table["w_mps"] = 0.0
    found = segment([trial.with_table(table)])
    assert len(spans(found, "turn")) == 1
    assert [r.reason.split(":")[0] for r in found.rejected if "inclined" in r.reason] == ["turn"]


def begun_at_the_surface(depth_m: float) -> tuple[Trial, float]:
    """Propeller on and off at the surface with full depth readings, then a trial submerged."""
    s = Sail(AUV, np.random.default_rng(8))
    s.fixed(10, 0)
    for _ in range(3):
        s.fixed(25, RPM)
        s.fixed(10, 0.55 * RPM)
    end = s.time
    s.rows, s.truth = [*s.rows], []
    s.steer(40, RPM, s.psi, 0.9, 0.14)
    s.straight([0.8 * RPM, RPM, 0.9 * RPM], [30, 30, 30], kept=False)
    s.steer(40, RPM, s.psi, 0.9, 0.14)
    s.turn(15 * DEG, RPM)
    s.fixed(20, RPM)
    trial = s.trial()
    noise = s.rng.normal(0.0, 0.02, len(trial.table))
    depth = np.where(trial.table["time_s"] < end, 0.15, depth_m) + noise
    return trial.with_table(trial.table.assign(depth_m=depth)), end


def test_the_propeller_on_and_off_at_the_surface_is_no_straight_run() -> None:
    trial, end = begun_at_the_surface(DEPTH_M)
    assert [start > end for start in spans(segment([trial]), "straight")] == [True]
    bare = trial.with_table(trial.table.drop(columns="depth_m"))
    assert min(spans(segment([bare]), "straight")) < end  # without depth nothing tells


def test_a_vehicle_that_always_runs_there_has_its_maneuvers() -> None:
    trial, end = begun_at_the_surface(0.15)
    assert min(spans(segment([trial]), "straight")) < end
    assert len(spans(segment([trial]), "turn")) == 1


def pitched(trim_deg: float) -> Trial:
    """Zigzags about a level path by an elevator that holds the trim at so many degrees."""
    s = Sail(AUV, np.random.default_rng(5))
    s.u = AUV.cruise_mps
    for fin in (8 * DEG, -6 * DEG, 10 * DEG):
        s.steer(40, RPM, 0.0, 0.9, 0.14)
        s.zigzag(fin, 5 * DEG, 6, RPM)
    s.steer(40, RPM, 0.0, 0.9, 0.14)
    trial = s.trial()
    names = {"r_radps": "q_radps", "heading_rad": "pitch_rad", "rudder_rad": "elevator_rad"}
    table = trial.table.rename(columns=names | {"v_mps": "w_mps"})
    table["elevator_rad"] += trim_deg * DEG
    table = table.assign(v_mps=0.0, r_radps=0.0, rudder_rad=0.0)
    return trial.with_table(table)


@pytest.mark.parametrize("trim_deg", [0.0, 3.0, -4.0])
def test_zigzags_about_a_trimmed_elevator_are_found(trim_deg: float) -> None:
    for search in (segment_vertical, segment_both):
        found = search([pitched(trim_deg)])
        zigzags = [m for m in found.maneuvers if m.kind == "zigzag" and m.plane == "vertical"]
        assert len(zigzags) == 3
