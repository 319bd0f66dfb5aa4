"""Both planes in one list: each stretch once, numbered in time order, of one role."""

from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from segment_world import Sail, Ship, random_trial
from test_segment_samples import SAMPLES, ingested

from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.coefficients import PLANES
from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest
from auvident.stages.segment import segment, segment_both, segment_vertical
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

SAME_S = 5.0  # runs that begin and end within this are one stretch
MOST = 0.5
# generated vertical trials in which the straight runs of the two searches differ
VEHICLES = {303: "remus100", 307: "remus100", 309: "remus100", 313: "remus100", 316: "tern180"}
SEEDS = list(VEHICLES)


@cache
def dived(seed: int) -> Trial:
    """A generated trial of the vertical plane."""
    recipe = {"name": f"v{seed}", "vehicle": VEHICLES[seed], "seed": seed, "spread": 0.2}
    few = {} if seed % 3 else {"straights": 3, "depth_steps": 5, "vertical_zigzags": 4}
    with pytest.MonkeyPatch.context() as patch, TemporaryDirectory() as folder:
        patch.syspath_prepend(str(SAMPLES))
        from seatrial.trial import generate

        log = Path(folder) / recipe["name"]
        generate({**recipe, "plane": "vertical", "schedule": few}, log)
        return ingested(log, VEHICLES[seed])


@cache
def found(seed: int) -> Maneuvers:
    return segment_both([dived(seed)], ())


def runs(found: Maneuvers) -> list[Maneuver]:
    """Straight runs with thrust steps."""
    own = [m for m in found.maneuvers if m.kind == "straight"]
    return [m for m in own if m.plane == "horizontal"]


def same(a: Maneuver, b: Maneuver) -> bool:
    ends = ((a.t_start_s, b.t_start_s), (a.t_end_s, b.t_end_s))
    return a.trial == b.trial and all(abs(x - y) <= SAME_S for x, y in ends)


def common(a: Maneuver, b: Maneuver) -> float:
    return max(0.0, min(a.t_end_s, b.t_end_s) - max(a.t_start_s, b.t_start_s))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stretch_that_both_searches_find_stands_once(seed) -> None:
    for a, b in combinations(runs(found(seed)), 2):
        assert not same(a, b), (a.id, b.id)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_stretch_that_a_search_finds_stands(seed) -> None:
    for search in (segment, segment_vertical):
        for m in search([dived(seed)]).maneuvers:
            twins = [x for x in found(seed).maneuvers if x.kind == m.kind and same(x, m)]
            assert [x.plane for x in twins] == [m.plane], m.id


@pytest.mark.parametrize("seed", SEEDS)
def test_ids_are_numbered_in_time_order_over_both_planes(seed) -> None:
    for kind in ("straight", "turn", "zigzag"):
        own = [m for m in found(seed).maneuvers if m.kind == kind]
        prefix = {"horizontal": "", "vertical": "vertical-"}
        assert [m.id for m in own] == [
            f"v{seed}-{prefix[m.plane]}{kind}-{i + 1}" for i, m in enumerate(own)
        ]
        assert [m.t_start_s for m in own] == sorted(m.t_start_s for m in own)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("plane", PLANES)
def test_no_plane_counts_a_reading_twice(seed, plane) -> None:
    own = [m for m in found(seed).maneuvers if m.shows(plane)]
    for a, b in combinations(own, 2):
        assert common(a, b) <= SAME_S, (a.id, b.id)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stretch_has_one_role(seed) -> None:
    """Also in two planes: what lies within a held-out maneuver is held out."""
    for a in found(seed).maneuvers:
        for b in found(seed).maneuvers:
            if b.role == "validate" and common(a, b) > MOST * (a.t_end_s - a.t_start_s):
                assert a.role == "validate", (a.id, b.id)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("plane", PLANES)
def test_both_planes_stay_identifiable(seed, plane) -> None:
    own = [m for m in found(seed).maneuvers if m.shows(plane)]
    kinds = {(m.kind, m.plane) for m in own}
    assert {(m.kind, m.plane) for m in own if m.role == "identify"} == kinds


def test_what_goes_along_is_said() -> None:
    said = {f.where: f for f in found(316).findings if f.code == "held_out_along"}
    assert set(said) == {"v316-vertical-straight-6", "v316-straight-7"}
    assert all("v316-straight-5" in f.message and f.value > MOST for f in said.values())
    held = {m.id for m in found(316).maneuvers if m.role == "validate"}
    assert {"v316-straight-5", *said} <= held


def test_what_the_user_holds_out_takes_along_what_lies_within_it() -> None:
    result = segment_both([dived(316)], ("v316-straight-5",))
    held = {m.id for m in result.maneuvers if m.role == "validate"}
    assert held == {"v316-straight-5", "v316-vertical-straight-6", "v316-straight-7"}


def test_the_ids_of_the_sample_trial_are_what_they_were() -> None:
    names = [f"vertical-zigzag-{i}" for i in range(1, 6)]
    names += ["straight-1", "straight-2", "vertical-straight-3", "vertical-straight-4"]
    names += ["vertical-zigzag-6", *(f"vertical-straight-{i}" for i in range(5, 7))]
    result = segment_both([ingested(SAMPLES / "dive_trial", "remus100")], ())
    assert [m.id for m in result.maneuvers] == [f"dive_trial-{name}" for name in names]
    runs = [m for m in result.maneuvers if m.kind == "straight" and m.plane == "horizontal"]
    assert all(m.planes == PLANES for m in runs)


def without(trial: Trial, *columns: str) -> Trial:
    return trial.with_table(trial.table.drop(columns=[*columns]))


@pytest.mark.parametrize("lacking", ["elevator_rad", "w_mps", "q_radps"])
def test_a_run_shows_no_plane_of_which_something_is_not_logged(lacking) -> None:
    """Also beside a trial that has the vertical plane: an unknown elevator is not zero."""
    dive = ingested(SAMPLES / "dive_trial", "remus100")
    other = replace(without(ingested(SAMPLES / "harbour_trial", "remus100"), lacking), name="h")
    for trials in ([other], [other, dive]):
        runs = [m for m in segment_both(trials).maneuvers if m.kind == "straight"]
        assert {m.planes for m in runs if m.trial == "h"} == {("horizontal",)}
    assert any(m.planes == PLANES for m in runs if m.trial == "dive_trial")


def test_a_run_over_which_the_elevator_is_lost_is_one_of_the_horizontal_plane() -> None:
    dive = ingested(SAMPLES / "dive_trial", "remus100")
    first, *others = runs(segment_both([dive]))
    table = dive.table.copy()
    lost = table["time_s"].between(first.t_start_s + 30.0, first.t_start_s + 36.0)
    table.loc[lost, "elevator_rad"] = np.nan
    found = segment_both([dive.with_table(table)])
    (torn,) = (m for m in runs(found) if same(m, first))
    assert torn.planes == ("horizontal",) and torn.features["planes"] == ["horizontal"]
    assert all(m.planes == PLANES for m in runs(found) if any(same(m, x) for x in others))


@pytest.mark.parametrize(
    ("lacking", "said"),
    [
        (["elevator_rad"], "elevator_rad"),
        (["w_mps"], "w_mps"),
        (["w_mps", "q_radps"], "w_mps, q_radps"),
        # nobody meant the vertical plane, but the depth tells of dives
        (["w_mps", "q_radps", "elevator_rad"], "but w_mps, q_radps, elevator_rad"),
        (["w_mps", "q_radps", "elevator_rad", "depth_m"], ""),
    ],
)
def test_vertical_maneuvers_that_could_not_be_looked_for_are_told(lacking, said) -> None:
    dive = ingested(SAMPLES / "dive_trial", "remus100")
    found = segment_both([without(dive, *lacking)])
    told = [f for f in found.findings if f.code == "plane_not_searched"]
    heads = [f.message.partition(" not in the log")[0] for f in told]
    assert len(heads) == bool(said) and all(head.endswith(said) for head in heads)
    assert all(("times" in head) is said.startswith("but") for head in heads)
    assert all(f.where == "dive_trial" and "--map" in f.remedy for f in told)


@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_a_vehicle_that_keeps_its_depth_is_not_said_to_dive(name) -> None:
    vehicle = "remus100" if name == "harbour_trial" else "tern180"
    level = without(ingested(SAMPLES / name, vehicle), "w_mps", "q_radps", "elevator_rad")
    assert not any(f.code == "plane_not_searched" for f in segment_both([level]).findings)


def turned(trial: Trial, m: Maneuver) -> float:
    """Change of the heading over a maneuver [deg]."""
    rows = trial.table["time_s"].between(m.t_start_s, m.t_end_s)
    return abs(float(np.degrees(np.sum(trial.table.loc[rows, "r_radps"]) / trial.rate_hz)))


@pytest.mark.parametrize("seed", SEEDS)
def test_no_depth_step_turns(seed) -> None:
    """A course that changes takes the depth along: 16 of these turned, by up to 203 degrees."""
    steps = [m for m in found(seed).maneuvers if m.features.get("maneuver") == "depth_step"]
    assert steps and all(turned(dived(seed), m) < 15.0 for m in steps)


def test_depth_lost_in_turns_and_zigzags_makes_no_depth_steps(tmp_path, monkeypatch) -> None:
    """The heel and trim of this vehicle took it up and down by 0.6 to 6 m in seven of them."""
    monkeypatch.syspath_prepend(str(SAMPLES))
    from seatrial.population import draw

    drawn = draw(30, True)
    drawn.write(drawn.sail(), tmp_path / "trial", tmp_path / "vehicle.toml")
    [raw] = read_trials([tmp_path / "trial"])
    trial, _ = ingest(raw, load_vehicle(tmp_path / "vehicle.toml"))
    assert {m.plane for m in segment_both([trial], ()).maneuvers} == {"horizontal"}


def test_a_trial_without_vertical_maneuvers_is_that_of_the_horizontal_search() -> None:
    trial, _ = random_trial(Ship(), 5)
    assert segment_both([trial], ()) == segment([trial])


def test_the_parts_of_a_torn_maneuver_have_one_role_whichever_is_named() -> None:
    s = Sail(Ship(), np.random.default_rng(0))
    s.u = s.ship.cruise_mps
    s.steer(30, 900, 0, 0.9, 0.14)
    s.turn(0.2, 900, 500)
    s.steer(30, 900, s.psi, 0.9, 0.14)
    s.turn(-0.2, 900, 500)
    trial = s.trial()
    torn = trial.table["time_s"].between(s.truth[0][1] + 20, s.truth[0][1] + 22)
    trial.table.loc[torn, "u_mps"] = np.nan
    trial.table.loc[torn, "record"] = -1
    trial.table.loc[trial.table.index > torn[torn].index[-1], "record"] = 1
    result = segment_both([trial], ("trial-turn-1a",))
    held = [m.id for m in result.maneuvers if m.role == "validate"]
    assert held == ["trial-turn-1a", "trial-turn-1b"]
