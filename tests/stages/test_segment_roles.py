"""Which maneuvers identify and which validate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import rankdata
from segment_world import DEG, Sail, Ship

from auvident.errors import InputError, UsageError
from auvident.schema.artifacts import Maneuver
from auvident.schema.planes import PLANES
from auvident.stages.segment import segment
from auvident.stages.segment.roles import choose, part_id

AUV = Ship()


def maneuver(id_: str, kind: str, angle: float = 0.0, side: str = "port", speed: float = 1.5):
    features = {"rudder_deg": angle, "side": side, "approach_speed_mps": speed}
    if kind == "straight":
        features = {"rpm_steps": [angle]}
    return Maneuver(
        id=id_,
        trial="t",
        kind=kind,
        t_start_s=0,
        t_end_s=1,
        role="identify",
        plane="horizontal",
        planes=PLANES if kind == "straight" else ("horizontal",),
        features=features,
    )


def zigzags(angles, **others):
    return [maneuver(f"z{i}", "zigzag", a, **others) for i, a in enumerate(angles)]


def test_one_of_two_is_held_out_and_one_alone_is_not():
    assert len(choose(zigzags([10, 20]))) == 1
    assert choose(zigzags([10])) == set()


def test_of_two_the_stronger_identifies():
    assert choose(zigzags([20, 10])) == {"z1"}


def test_about_a_quarter_is_held_out():
    for n, expected in ((4, 1), (6, 2), (8, 2), (13, 3)):
        assert len(choose(zigzags(range(5, 5 + 3 * n, 3)))) == expected


def test_the_extremes_stay_in_the_identification():
    held = choose(zigzags([35, 5, 10, 15, 20, 25, 30, 12]))
    assert not held & {"z0", "z1"}


def test_both_sides_stay_in_the_identification():
    turns = [
        maneuver("a", "turn", 10, "port"),
        maneuver("b", "turn", 15, "starboard"),
        maneuver("c", "turn", 20, "port"),
        maneuver("d", "turn", 15, "port"),
    ]
    assert choose(turns) == {"a"}


@pytest.mark.parametrize("seed", range(8))
def test_what_is_held_out_lies_as_far_from_the_middle_as_all_of_its_kind(seed):
    rng = np.random.default_rng(seed)
    some = [
        maneuver(f"z{i:02d}", "zigzag", angle, speed=speed)
        for i, (angle, speed) in enumerate(
            zip(rng.uniform(5, 35, 16), rng.uniform(1, 2, 16), strict=True)
        )
    ]
    ranks = np.column_stack(
        [rankdata([m.features[k] for m in some]) for k in ("rudder_deg", "approach_speed_mps")]
    )
    off = np.sum(((ranks - ranks.mean(axis=0)) / ranks.std(axis=0)) ** 2, axis=1) / 2
    held = choose(some)
    chosen = [x for x, m in zip(off, some, strict=True) if m.id in held]
    assert len(chosen) == 4
    assert np.mean(chosen) == pytest.approx(1.0, abs=0.15)  # the four central ones: below 0.3


def test_each_maneuver_that_is_held_out_says_why():
    result = segment([trial("day", 0, "zztt")])
    said = {m.id: m.reason for m in result.maneuvers if m.reason}
    assert set(said) == {m.id for m in result.maneuvers if m.role == "validate"}
    assert all("typical of its kind (rank among 2," in reason for reason in said.values())
    asked = segment([trial("day", 0, "zztt")], hold_out=["day-turn-2"])
    assert [m.reason for m in asked.maneuvers if m.reason] == ["asked for with --hold-out"]


def test_one_of_several_straight_runs_is_held_out_the_richest_stays():
    runs = [maneuver(f"s{i}", "straight", step) for i, step in enumerate((100, 200, 300))]
    assert choose(runs) == {"s0"}
    assert choose(runs[:2]) == {"s0"}
    assert choose(runs[:1]) == set()


def test_the_choice_does_not_depend_on_the_order():
    some = zigzags([10, 20, 10, 20, 15, 5])
    assert choose(some) == choose(some[::-1])


def test_a_torn_maneuver_is_not_the_one_to_hold_out():
    some = zigzags([5, 10, 10, 20])
    (chosen,) = choose(some)
    torn = [
        m.model_copy(update={"features": {**m.features, "parts": 3}}) if m.id == chosen else m
        for m in some
    ]
    assert len(choose(torn)) == 1
    assert chosen not in choose(torn)


def trial(name: str, seed: int, kinds: str = "zt"):
    s = Sail(AUV, np.random.default_rng(seed))
    s.u = AUV.cruise_mps
    s.steer(30, 900, 0, 0.9, 8 * DEG)
    for kind in kinds:
        if kind == "z":
            s.zigzag((10 + seed) * DEG, 10 * DEG, 4, 900)
        if kind == "t":
            s.turn((10 + seed) * DEG, 900, 380)
        s.steer(30, 900, s.psi, 0.9, 8 * DEG)
    return s.trial(name)


def roles(result):
    return {m.id: m.role for m in result.maneuvers}


def test_hold_out_by_id_replaces_the_automatic_choice():
    result = segment([trial("day", 0, "zztt")], hold_out=["day-turn-2"])
    held = [id_ for id_, role in roles(result).items() if role == "validate"]
    assert held == ["day-turn-2"]


def test_hold_out_by_trial():
    result = segment([trial("one", 0), trial("two", 1)], hold_out=["two"])
    assert roles(result) == {
        "one-zigzag-1": "identify",
        "one-turn-1": "identify",
        "two-zigzag-1": "validate",
        "two-turn-1": "validate",
    }


def test_one_zigzag_per_file():
    # two degrees apart: within one they would count as one amplitude, and none as the largest
    trials = [replace(trial("x", 2 * i, "z"), name=f"file{i:02d}") for i in range(13)]
    held = [id_ for id_, role in roles(segment(trials)).items() if role == "validate"]
    assert len(held) == 3
    assert not {"file00-zigzag-1", "file12-zigzag-1"} & set(held)


def test_an_unknown_id_is_refused_with_the_known_ones():
    with pytest.raises(UsageError) as caught:
        segment([trial("day", 0)], hold_out=["day-zigzag-9"])
    assert "day-zigzag-9" in str(caught.value)
    assert "day-zigzag-1" in str(caught.value)


def test_holding_out_everything_is_refused():
    with pytest.raises(UsageError, match="all maneuvers"):
        segment([trial("day", 0)], hold_out=["day"])


def test_holding_out_a_trial_without_maneuvers_is_refused():
    with pytest.raises(InputError, match="no maneuver was found"):
        segment([trial("day", 0), trial("calm", 1, "")], hold_out=["calm"])


def test_a_single_maneuver_identifies_and_it_is_said():
    result = segment([trial("day", 0, "z")])
    assert roles(result) == {"day-zigzag-1": "identify"}
    assert "nothing_held_out" in [f.code for f in result.findings]


def test_part_ids():
    assert [part_id("x-turn-1", i) for i in (0, 1, 25, 26)] == [
        "x-turn-1a",
        "x-turn-1b",
        "x-turn-1z",
        "x-turn-1aa",
    ]
