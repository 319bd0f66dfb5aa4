"""The sign of the rudder from simulated trials: right, reversed, and under what disturbs it."""

import itertools
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from ingest_world import LENGTH_M, sensor, trial, vehicle

from auvident.errors import InputError
from auvident.schema.channels import RECORD_COLUMN
from auvident.schema.logs import DEG, RawTrial
from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest
from auvident.stages.ingest.checks import rudder
from auvident.stages.ingest.held import Held, SettledHold, Votes, held_fin
from auvident.stages.ingest.response import Relation
from auvident.stages.ingest.signs import judge_rudder
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle
from tests.session import once

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
NONE = {"straights": 0, "turns": 0, "zigzags_10": 0, "zigzags_20": 0}
SCHEDULES = {
    "both": {},
    "circles": NONE | {"turns": 5},
    "zigzags": NONE | {"zigzags_10": 2, "zigzags_20": 2},
}
SPEED_MPS = 1.5
RATE_HZ = 10.0
PASSAGE_S = LENGTH_M / SPEED_MPS


def changed_rudder(raw: RawTrial, values=lambda d: d, later_s: float = 0.0) -> RawTrial:
    s = raw.sensors["rudder"]
    new = replace(
        s, time_s=s.time_s + later_s, values={"rudder_rad": values(s.values["rudder_rad"])}
    )
    return replace(raw, sensors=raw.sensors | {"rudder": new})


def changed_gyro(raw: RawTrial, change) -> RawTrial:
    s = raw.sensors["gyro"]
    values = s.values | {"r_radps": change(s.time_s, s.values["r_radps"])}
    return replace(raw, sensors=raw.sensors | {"gyro": replace(s, values=values)})


def white(std: float, size: int) -> np.ndarray:
    return std * np.random.default_rng(5).standard_normal(size)


def judged(raw: RawTrial, boat) -> str:
    """What ingest makes of the sign: right, refused or undecided; or that the clock is wrong."""
    try:
        _, quality = ingest(raw, boat)
    except InputError as error:
        if getattr(error, "check", "") == "clock_rudder":
            return "another clock"
        assert "rudder sign contradicts [signs]" in error.problem
        assert "turns the bow to " in error.problem
        return "refused"
    codes = [finding.code for finding in quality.findings]
    return "undecided" if "rudder_sign_unverified" in codes else "right"


def both_ways(raw: RawTrial, boat) -> tuple[str, str]:
    """The sign as it is, and reversed."""
    return judged(raw, boat), judged(changed_rudder(raw, np.negative), boat)


DISTURBED = {
    "nothing": lambda raw: raw,
    "an offset to port": lambda raw: changed_rudder(raw, lambda d: d + 3 * DEG),
    "an offset to starboard": lambda raw: changed_rudder(raw, lambda d: d - 3 * DEG),
    "a command 1.5 s ahead": lambda raw: changed_rudder(raw, later_s=-1.5),
    "a rudder stamped 1 s late": lambda raw: changed_rudder(raw, later_s=1.0),
    "a rudder that is measured": lambda raw: changed_rudder(
        raw, lambda d: d + white(0.3 * DEG, d.size)
    ),
    "a gyro of much noise": lambda raw: changed_gyro(raw, lambda t, r: r + white(0.3, r.size)),
    "a gyro with a bias": lambda raw: changed_gyro(raw, lambda t, r: r + 2 * DEG),
    "waves": lambda raw: changed_gyro(
        raw, lambda t, r: r + 0.1 * np.sin(2 * np.pi * t / 5.0 + np.sin(t / 37.0))
    ),
}


@once
def generated() -> dict[tuple[str, str], RawTrial]:
    """Trials of the independent generator, by vehicle and schedule."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    found = {}
    with TemporaryDirectory() as folder:
        for seed, boat in enumerate(("remus100", "tern180"), start=11):
            for kind, schedule in SCHEDULES.items():
                place = Path(folder) / f"{boat}_{kind}"
                recipe = {"name": place.name, "vehicle": boat, "seed": seed, "schedule": schedule}
                generate(recipe, place)
                (found[boat, kind],) = read_trials([place])
    return found


@pytest.fixture(scope="module")
def sea_trials() -> dict[tuple[str, str], RawTrial]:
    return generated()


# each disturbance of each schedule, of one vehicle and the other in turn
AT_SEA = [
    (("remus100", "tern180")[k % 2], kind, disturbed)
    for k, (kind, disturbed) in enumerate(itertools.product(SCHEDULES, DISTURBED))
]


@pytest.mark.parametrize(("boat", "kind", "disturbed"), AT_SEA)
def test_a_trial_at_sea_shows_the_sign(sea_trials, boat, kind, disturbed):
    raw = DISTURBED[disturbed](sea_trials[boat, kind])
    assert both_ways(raw, load_vehicle(SAMPLES / f"{boat}.toml")) == ("right", "refused")


@pytest.mark.parametrize("late_s", [2.0, 3.0, -3.0])
@pytest.mark.parametrize("boat", ["remus100", "tern180"])
def test_zigzags_alone_with_clocks_seconds_apart_are_not_judged_wrongly(sea_trials, boat, late_s):
    raw = changed_rudder(sea_trials[boat, "zigzags"], later_s=late_s)
    right, reversed_ = both_ways(raw, load_vehicle(SAMPLES / f"{boat}.toml"))
    assert right != "refused"
    assert reversed_ != "right"
    if late_s == 3.0:  # no servo: a rudder that is logged after the turn, of either sign
        assert (right, reversed_) == ("another clock", "another clock")


def test_the_refusal_states_share_and_rows(sea_trials):
    raw = changed_rudder(sea_trials["remus100", "circles"], np.negative)
    with pytest.raises(InputError) as caught:
        ingest(raw, load_vehicle(SAMPLES / "remus100.toml"))
    assert caught.value.exit_code == 3
    for word in ("100 % of", "rows in which the rudder is held", "times", "sign = -1"):
        assert word in str(caught.value)


def test_the_evidence_stands_in_the_checks(sea_trials):
    _, quality = ingest(sea_trials["remus100", "both"], load_vehicle(SAMPLES / "remus100.toml"))
    for name in ("rudder_held_turns", "rudder_held_steps"):
        assert quality.checks[name]["contrary_share"] < 0.02
        assert quality.checks[name]["rows"] > 1000
        assert quality.checks[name]["holds"] > 5


# --- a first-order vehicle, as slow and as noisy as one likes -------------------------------


def nomoto(helm, passages: float, *, gain=1.5, noise=0.002, duration_s=600.0, disturb=None, seed=3):
    """T r' + r = -K (U/L) d with T in passages of the length; `helm` steers on (t, psi, r, d)."""
    rng = np.random.default_rng(seed)
    h = 0.05
    t = np.arange(0.0, duration_s, h)
    r, psi, d = np.zeros(t.size), np.zeros(t.size), np.zeros(t.size)
    push = np.zeros(t.size) if disturb is None else disturb(t)
    constant = passages * PASSAGE_S
    for k in range(t.size - 1):
        d[k] = helm(t[k], psi[k], r[k], d[k - 1])
        wanted = -gain / PASSAGE_S * d[k]
        r[k + 1] = r[k] + h / constant * (wanted - r[k]) + h * push[k]
        psi[k + 1] = psi[k] + h * r[k]
    d[-1] = d[-2]
    every = slice(None, None, 2)
    n = t[every].size
    return trial(
        sensor(
            "dvl",
            t[every],
            u_mps=SPEED_MPS + 0.005 * rng.standard_normal(n),
            v_mps=-0.3 * r[every] + 0.005 * rng.standard_normal(n),
        ),
        sensor("gyro", t, r_radps=r + noise * rng.standard_normal(t.size)),
        sensor("rudder", t[every], rudder_rad=d[every]),
        sensor("rpm", t[every], rpm=np.full(n, 900.0)),
    )


def zigzag(angle: float):
    side = [1.0]

    def helm(t, psi, r, d):
        if psi * -side[0] > angle:  # a positive rudder turns to port: the heading falls
            side[0] = -side[0]
        return side[0] * angle

    return helm


def steady(t, psi, r, d):
    """Circles of two minutes, to either side, the helm put over slowly."""
    goal = (0.2, -0.15, 0.1, -0.25, 0.15)[int(t // 120) % 5]
    return d + np.clip(goal - d, -0.005, 0.005)


@pytest.mark.parametrize("passages", [0.5, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("helm", [lambda: zigzag(0.17), lambda: zigzag(0.35), lambda: steady])
@pytest.mark.parametrize("noise", [0.002, 0.1])
def test_slow_vehicles_show_the_sign(passages, helm, noise):
    raw = nomoto(helm(), passages, noise=noise)
    assert both_ways(raw, vehicle()) == ("right", "refused")


@pytest.mark.parametrize("gain", [0.2, 1.0, 4.0])
@pytest.mark.parametrize("period_s", [5.0, 12.0, 30.0])
def test_a_helm_that_follows_the_motion_is_not_refused(gain, period_s):
    """The sea turns the hull and the helm works against it: the two correlate the wrong way."""

    def swell(t):
        return 0.3 * np.sin(2 * np.pi * t / period_s + np.sin(t / 41.0))

    raw = nomoto(lambda t, psi, r, d: gain * r, 1.5, disturb=swell)
    assert judged(raw, vehicle()) != "refused"


def test_turns_checked_with_counter_rudder_are_judged_rightly():
    def helm(t, psi, r, d):
        phase = t % 60.0
        side = 1.0 if t % 120.0 < 60.0 else -1.0
        return side * (0.25 if phase < 20 else -0.25 if phase < 24 else 0.0)

    assert both_ways(nomoto(helm, 3.0), vehicle()) == ("right", "refused")


def test_one_turn_alone_is_no_proof():
    """A lone drift to one side with the helm held to the other may have many causes."""
    raw = nomoto(lambda t, psi, r, d: 0.12, 1.0, gain=-1.0, noise=0.05, duration_s=60.0)
    assert judged(raw, vehicle()) != "refused"


@pytest.mark.parametrize(
    ("turns", "steps", "stds", "sign"),
    [
        (Votes(), Votes(98, 98, 2, 9.8, 2), 3.3, 1),
        (Votes(45, 44, 1, 4.5, 1), Votes(146, 143, 1, 14.6, 1), 3.3, 1),
        (Votes(), Votes(98, 98, 1, 9.8), 3.3, 0),  # one hold may be a drift
        (Votes(), Votes(98, 98, 2, 9.8), 2.9, 0),
        (Votes(), Votes(98, 60, 2, 9.8), 3.3, 0),
        (Votes(), Votes(98, 0, 2, 9.8), -3.3, -1),
        # a hull that stays in a turn against 24 degrees of rudder, all else being right
        (Votes(1439, 1388, 9, 143.9, 8), Votes(857, 165, 31, 85.7, 6), -12.0, 0),
        (Votes(1439, 1388, 9, 143.9, 8), Votes(857, 692, 31, 85.7, 25), -12.0, 1),
        # ... for minutes, so that most rows contradict but few turns (population, seed 4059)
        (Votes(14725, 13460, 10, 1472.5, 4), Votes(991, 516, 9, 99.1, 5), -5.1, 0),
        (Votes(14725, 1265, 10, 1472.5, 6), Votes(991, 475, 9, 99.1, 4), 5.1, 0),  # reversed
    ],
)
def test_two_short_holds_and_an_acceleration_decide_together(turns, steps, stds, sign):
    """As in a trial of a minute or two, in which neither is sure enough alone; or they do not."""
    response = np.array([0.3])
    found = Relation(
        0.0, 0.1, np.sign(stds) * response, response / abs(stds), 0.94, response, False
    )
    assert judge_rudder(vehicle(), found, None, Held(turns, steps)).sign == sign


def turning(rate: np.ndarray, rudder: np.ndarray, record: np.ndarray) -> Trial:
    time = np.arange(len(rate)) / RATE_HZ
    table = {"time_s": time, "u_mps": SPEED_MPS, "r_radps": rate, "rudder_rad": rudder}
    return Trial.from_table("t", pd.DataFrame(table | {RECORD_COLUMN: record}), RATE_HZ)


@pytest.mark.parametrize(
    ("between_radps", "records", "turns", "sign"),
    [(0.1, 1, 1, 0), (-0.1, 1, 6, 1), (0.1, 6, 6, 1)],
)
def test_a_turn_that_no_rudder_ends_is_one_turn(between_radps, records, turns, sign):
    """However often the helm is moved in it, unless the log breaks off: then nobody knows."""
    held, eased = round(25.0 * RATE_HZ), round(5.0 * RATE_HZ)
    rudder = np.tile(np.repeat([12 * DEG, 0.0], [held, eased]), 6)
    rate = np.tile(np.repeat([0.2, between_radps], [held, eased]), 6)  # to starboard: against it
    record = np.arange(len(rudder)) * records // len(rudder)
    found = held_fin(turning(rate, rudder, record), LENGTH_M, 0.3)
    assert (found.turns.holds, found.turns.against, found.turns.sign) == (turns, turns, sign)


@pytest.mark.parametrize("passages", [2.0, 8.0])
def test_a_slow_vehicle_on_its_way_from_turn_to_turn_has_no_stuck_rudder(passages):
    """Eight lengths after the rudder is reversed a turn still changes, to the rudder's side."""
    _, quality = ingest(nomoto(lambda t, psi, r, d: steady(t, psi, r, d), passages), vehicle())
    (made,) = [c for c in quality.checks_made if c.name == "rudder_stuck"]
    assert made.outcome == "agrees", made.message


@pytest.mark.parametrize(
    ("rates", "reference", "outcome"),
    [
        ((0.053, 0.052, 0.054), "ground", "agrees"),  # a current: the turns are alike
        ((0.045, 0.052, 0.056), "ground", "contradicts"),  # the log has cut the angle off
        ((0.053, 0.052, 0.054), "water", "contradicts"),  # no current bends these
    ],
)
def test_a_current_bends_turns_at_one_rudder_apart_and_cuts_nothing(
    rates, reference, outcome, monkeypatch
):
    bends = (0.162, 0.19, 0.217)
    holds = [
        SettledHold(0.0, 60.0, -0.2, bend, 0.01, 0.0, rate)
        for bend, rate in zip(bends, rates, strict=True)
    ]
    monkeypatch.setattr(rudder, "settled_holds", lambda *_: holds)
    dvl = SimpleNamespace(reference=reference)
    seen = SimpleNamespace(trial=None, length_m=4.0, way_mps=1.0, vehicle=SimpleNamespace(dvl=dvl))
    assert rudder.rudder_cut(seen).outcome == outcome
