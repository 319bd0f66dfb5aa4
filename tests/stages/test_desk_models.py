"""Models on the desk against other sources: a published hull, and the generator of trials."""

import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auvident.errors import InputError, NumericsError, UsageError
from auvident.physics.maneuvers import turn_figures, zigzag_figures
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.desk import desk_order
from auvident.stages.ase import estimate
from auvident.stages.desk import (
    Approach,
    Desk,
    DeskModel,
    estimated_models,
    fly_maneuver,
    identified_models,
)
from auvident.stages.identify.setup import rigid_body
from auvident.storage.vehicle_file import load_vehicle
from tests import loop_world
from tests.command_line import ROOT, SAMPLES
from tests.physics.desk_models import changed, enlarged, remus
from tests.stages.test_export import with_effects

SUBOFF = ROOT / "tests" / "data" / "vehicles" / "suboff.toml"
# Roddy 1990, table 4, fully appended: prime values by symbol (theory 8.1)
RODDY = {
    "Y_uv": (-0.027834, 2),
    "N_uv": (-0.013648, 3),
    "Y_ur": (0.005251, 3),
    "N_ur": (-0.004444, 4),
    "Z_uw": (-0.013910, 2),
    "M_uw": (0.010324, 3),
    "Z_uq": (-0.007545, 3),
    "M_uq": (-0.003702, 4),
    "Z_wdot": (-0.014529, 3),
    "M_qdot": (-0.000860, 5),
    "Z_uud": (-0.005603, 2),
    "M_uud": (-0.002409, 3),
}
G_HORIZONTAL, G_VERTICAL = -0.443297, -1.162874  # as Roddy states them
LPP_M = 4.26086
MASS = 0.0183  # prime; the mass that these G are of (theory 8.1)


def told(desk: Desk) -> dict[str, Any]:
    return {f.name: f for f in desk.result.figures}


def published(tmp_path: Path, plane: Any) -> DeskModel:
    """SUBOFF with the measured derivatives of both planes under [coefficients]."""
    lines = ["\n[coefficients]"]
    for symbol, (prime, power) in RODDY.items():
        value = prime * 0.5 * 1000.0 * LPP_M**power
        lines.append(f'"{symbol}" = {{ value = {value}, std = {0.05 * abs(value)} }}')
    file = tmp_path / "suboff.toml"
    mass = f"mass_kg = {MASS * 0.5 * 1000.0 * LPP_M**3}"
    text = SUBOFF.read_text().replace("mass_kg = 699.2", mass)
    file.write_text(text + "\n".join(lines) + "\n")
    vehicle = load_vehicle(file)
    rng = np.random.default_rng(0)
    rigid = rigid_body(vehicle, plane)
    return estimated_models(estimate(vehicle), rigid, plane, "suboff.toml", 60, rng)


def test_published_coefficients_are_flown(tmp_path: Path) -> None:
    """G to the digits of the table."""
    models = published(tmp_path, "horizontal")
    desk = fly_maneuver(models, desk_order("spiral:15"), Approach(speed_mps=3.34))
    assert told(desk)["stability_index"].value == pytest.approx(G_HORIZONTAL, abs=0.01)
    assert told(desk)["loop_width"].value > 0.0
    assert told(desk)["loop_height"].low > 0.0
    assert desk.result.source == "given"
    assert desk.result.speed_is_held  # it has no propeller
    assert desk.result.rpm is None
    assert {"Y_uv", "N_ur"} <= set(desk.result.given)
    models = published(tmp_path, "vertical")
    desk = fly_maneuver(models, desk_order("depth-step:2"), Approach(speed_mps=1.0))
    assert told(desk)["stability_index"].value == pytest.approx(G_VERTICAL, abs=0.01)


def test_a_figure_of_given_coefficients_has_their_interval(tmp_path: Path) -> None:
    """G is a quotient of four values known to 5 %, and the mass: its interval by their spread."""
    desk = fly_maneuver(
        published(tmp_path, "horizontal"), desk_order("pull-out:15"), Approach(speed_mps=3.34)
    )
    g = told(desk)["stability_index"]
    parts = [(0.05, 1.0), (0.05, 0.41), (0.05, 1.0), (0.05, 1.0)]  # Y_r is 0.41 of Y_r - m
    spread = (1.0 - G_HORIZONTAL) * math.hypot(*(std * share for std, share in parts))
    assert (g.high - g.low) / (2.0 * 1.645) == pytest.approx(spread, rel=0.35)  # 60 draws


def test_a_hull_without_vertical_coefficients_says_which_lack() -> None:
    vehicle = load_vehicle(SAMPLES / "kvlcc2" / "vehicle.toml")
    rigid, rng = rigid_body(vehicle, "vertical"), np.random.default_rng(0)
    with pytest.raises(InputError, match="vertical plane: X_ww"):
        estimated_models(estimate(vehicle), rigid, "vertical", "kvlcc2.toml", 0, rng)


@pytest.mark.parametrize(
    ("approach", "word"),
    [
        (Approach(speed_mps=-1.0), "--speed"),
        (Approach(rpm=0.0), "--rpm"),
        (Approach(rudder_rate_degps=math.inf), "--rudder-rate"),
    ],
)
def test_an_approach_that_is_none_is_refused(approach: Approach, word: str) -> None:
    with pytest.raises(UsageError, match=word):
        fly_maneuver(remus("horizontal"), desk_order("zigzag"), approach)


def test_what_cannot_be_flown_says_so() -> None:
    models, order = remus("horizontal"), desk_order("turning-circle:15")
    with pytest.raises(InputError, match="no rudder: N_uud is 0"):
        fly_maneuver(changed(models, N_uud=0.0), order, Approach())
    vertical = changed(remus("vertical"), M_uud=0.0, Z_uud=0.0)
    with pytest.raises(InputError, match="no elevator: M_uud is 0"):
        fly_maneuver(vertical, desk_order("depth-step"), Approach(speed_mps=1.5))
    weak = changed(models, N_uud=1e-4, Y_uud=1e-4)
    with pytest.raises(NumericsError, match="none of its figures"):
        fly_maneuver(weak, order, Approach(speed_mps=1.5))
    with pytest.raises(NumericsError, match="holds the depth"):
        fly_maneuver(remus("vertical"), desk_order("depth-step"), Approach(speed_mps=0.1))
    with pytest.raises(NumericsError, match="not positive definite"):
        fly_maneuver(changed(models, Y_vdot=-9.0), order, Approach())
    loose = changed(models, Y_uv=-1.0, N_uv=-1.0)
    with pytest.raises(NumericsError, match="diverges"):
        fly_maneuver(changed(loose, Y_v__v__=-1.0), order, Approach(speed_mps=1.5))


def test_speed_and_propeller_rate() -> None:
    """A speed finds its rate, a rate its speed; each drawn model has its own of the other."""
    models, order = remus("horizontal", 30), desk_order("turning-circle:10")
    by_speed = fly_maneuver(models, order, Approach(speed_mps=1.2)).result
    by_rate = fly_maneuver(models, order, Approach(rpm=by_speed.rpm)).result
    assert by_rate.speed_mps == pytest.approx(1.2, rel=1e-6)
    both = fly_maneuver(models, order, Approach(speed_mps=1.0, rpm=by_speed.rpm))
    assert both.table["u_mps"][0] == pytest.approx(1.0, rel=1e-6)
    assert both.table["u_mps"][5] > 1.0  # the propeller turns faster than the balance
    assert told(fly_maneuver(models, order, Approach(speed_mps=1.2)))["advance"].share == 1.0


def test_a_slower_fin_goes_further_before_it_turns() -> None:
    order = desk_order("turning-circle:15")
    slow = fly_maneuver(remus("horizontal"), order, Approach(rudder_rate_degps=2.0))
    fast = fly_maneuver(remus("horizontal"), order, Approach(rudder_rate_degps=200.0))
    assert told(slow)["advance"].value > told(fast)["advance"].value
    assert "2 deg/s (as given)" in slow.result.servo
    assert "typical" in fly_maneuver(remus("horizontal"), order, Approach()).result.servo


def test_a_servo_has_its_rate_and_its_lag() -> None:
    """Told as what they are, each after the other."""
    servo = with_effects("horizontal", "rudder_lag", "rudder_rate_limit")
    models = identified_models(servo, "model.json", 0, np.random.default_rng(0))
    found = fly_maneuver(models, desk_order("zigzag"), Approach(speed_mps=1.5)).result.servo
    assert re.fullmatch(r"[\d.]+ deg/s, lag [\d.]+ s \(from the model\)", found)


# --- against the generator ----------------------------------------------------------------


SAID = re.compile(
    r"zigzag 20/20 the vehicle has overshoots of ([\d.]+) and ([\d.]+) deg and a period of "
    r"([\d.]+) s, the model ([\d.]+) \(([\d.]+) to ([\d.]+)\), "
    r"([\d.]+) \(([\d.]+) to ([\d.]+)\) and ([\d.]+) s \(([\d.]+) to ([\d.]+)\)"
)


def sailed(legs: list[list[float]]) -> dict[str, np.ndarray]:
    """The last leg in still water, from the generator: time, states, orders."""
    if str(SAMPLES) not in sys.path:
        sys.path.insert(0, str(SAMPLES))
    from seatrial import helm, simulate
    from seatrial.plant import workspace
    from seatrial.planting import fin_servo, motor_drive, plant_effects
    from seatrial.vehicles import load_vehicle as load_plant

    still = simulate.Sea(np.zeros(6), np.zeros(0), np.zeros(0), np.zeros((0, 6)))
    record, starts = simulate.run(
        np.array(legs),
        simulate.start_state(8.0, 0.0),
        load_plant("remus100").body,
        plant_effects({}),
        fin_servo("rudder", {}),
        fin_servo("elevator", {}),
        motor_drive({}),
        still,
        helm.Gains(),
        np.zeros((round(400.0 / simulate.STEP_S), 9)),
        workspace(),
    )
    rows = record[round(starts[-2] / simulate.STEP_S) :]
    names = {"u": 0, "v": 1, "r": 5, "pitch": 10, "heading": 11, "rudder": 12, "elevator": 13}
    found = {name: rows[:, column] for name, column in names.items()}
    return {"time": simulate.STEP_S * np.arange(len(rows)), **found}


RPM = 940.0


def legs_of(kind: int, **others: float) -> list[list[float]]:
    """A settling transit, then the leg."""
    from seatrial import helm

    transit = helm.leg_row(helm.TRANSIT, 90.0, RPM, 8.0, heading=0.0)
    return [transit, helm.leg_row(kind, 10.0, RPM, 8.0, **others)]


@pytest.fixture(scope="module")
def harbour(completed: Path) -> DeskModel:
    """The model that the program identified from the sample log of the harbour."""
    text = (completed / "runs" / "demo" / "refine" / "model.json").read_text()
    model = IdentifiedModel.model_validate_json(text)
    return identified_models(model, "model.json", 100, np.random.default_rng(0))


def test_the_linear_damping_counts_in_the_stability_index(completed: Path) -> None:
    """Y_v / U acts at a speed as Y_uv does, which the Nomoto figures beside it have too."""
    text = (completed / "runs" / "demo" / "refine" / "model.json").read_text()
    model = IdentifiedModel.model_validate_json(text)
    damped = loop_world.model_effects({"linear_damping": {"Y_v": -20.0, "N_r": -4.0}})
    speed, rng = 1.4, np.random.default_rng(0)
    c, rigid = model.values(), model.rigid_body
    found = {}
    for name, effects in (("without", ()), ("with", damped)):
        own = model.model_copy(update={"effects": (*model.effects, *effects)})
        desk = identified_models(own, "model.json", 0, rng)
        flown = fly_maneuver(desk, desk_order("zigzag:10/10"), Approach(speed_mps=speed))
        found[name] = told(flown)["stability_index"].value
    cross = c["N_uv"] * (c["Y_ur"] - rigid.mass_kg)
    straight = c["N_ur"] - 4.0 / speed - rigid.mass_kg * rigid.x_g_m
    expected = 1.0 - cross / ((c["Y_uv"] - 20.0 / speed) * straight)
    assert found["with"] == pytest.approx(expected, abs=1e-6) != found["without"]


def within(figure: Any, truth: float, relative: float) -> bool:
    """Near the truth, or the truth in the interval."""
    return abs(figure.value - truth) <= relative * abs(truth) or figure.low <= truth <= figure.high


def test_a_turning_circle_is_that_of_the_vehicle(harbour: DeskModel) -> None:
    """The generator flies the same rudder; 2 %, where the interval is narrower than that."""
    sys.path.insert(0, str(SAMPLES))
    s = sailed(legs_of(3, fin=-math.radians(15.0), switch=math.radians(540.0), longest=200.0))
    truth = turn_figures(s["time"], s["u"], s["v"], s["r"], s["rudder"], s["heading"])
    desk = fly_maneuver(harbour, desk_order("turning-circle:15"), Approach(rpm=RPM))
    figures = told(desk)
    assert desk.result.speed_mps == pytest.approx(truth["approach_speed_mps"], rel=0.01)
    for name in ("advance", "transfer", "tactical_diameter", "steady_diameter"):
        assert within(figures[name], truth[f"{name}_m"], 0.02), name
    assert within(figures["steady_r"], truth["steady_r_degps"], 0.02)
    assert figures["speed_loss"].value == pytest.approx(truth["speed_loss"], abs=0.005)


@pytest.mark.parametrize("degrees", [10, 20])
def test_a_zigzag_is_that_of_the_vehicle(harbour: DeskModel, degrees: int) -> None:
    """Overshoots within 5 %, times within 3 %; the generator's helm looks 20 times a second."""
    sys.path.insert(0, str(SAMPLES))
    angle = math.radians(degrees)
    s = sailed(legs_of(4, fin=-angle, switch=angle, count=5))
    truth = zigzag_figures(s["time"], s["heading"], s["rudder"], 0.0, angle)
    desk = fly_maneuver(harbour, desk_order(f"zigzag:{degrees}/{degrees}"), Approach(rpm=RPM))
    for k in (1, 2, 3, 4):
        name = f"overshoot_{k}"
        assert within(told(desk)[name], truth[f"{name}_deg"], 0.05), name
    assert within(told(desk)["period"], truth["period_s"], 0.03)
    assert within(told(desk)["initial_turning_time"], truth["initial_turning_time_s"], 0.03)


def test_the_page_has_the_zigzag_of_vehicle_and_model(harbour: DeskModel) -> None:
    """To the digit that it gives; the ends of intervals move a little with the libraries."""
    page = " ".join((ROOT / "docs" / "desk-maneuvers.md").read_text(encoding="utf-8").split())
    sys.path.insert(0, str(SAMPLES))
    angle, found = math.radians(20.0), SAID.search(page)
    s = sailed(legs_of(4, fin=-angle, switch=angle, count=5))
    truth = zigzag_figures(s["time"], s["heading"], s["rudder"], 0.0, angle)
    figures = told(fly_maneuver(harbour, desk_order("zigzag:20/20"), Approach(rpm=RPM)))
    rows = [figures[name] for name in ("overshoot_1", "overshoot_2", "period")]
    expected = [truth[name] for name in ("overshoot_1_deg", "overshoot_2_deg", "period_s")]
    expected += [x for row in rows for x in (row.value, row.low, row.high)]
    assert found
    assert [float(text) for text in found.groups()] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("by", [0.6, 6.0, 240.0])
def test_overshoots_are_those_of_the_shape_however_large_the_vehicle(by: float) -> None:
    """Of a ship rows were kept so far apart that overshoots counted from after the reversal."""
    rate, speed = 25.0, 1.5

    def flown(models: DeskModel, rate_degps: float) -> dict[str, Any]:
        approach = Approach(speed_mps=speed, rudder_rate_degps=rate_degps)
        return told(fly_maneuver(models, desk_order("zigzag:10/10"), approach))

    own, other = (
        flown(remus("horizontal"), rate),
        flown(enlarged(remus("horizontal"), by), rate / by),
    )
    for k in range(1, 5):
        name = f"overshoot_{k}"
        # steps are 0.01 L/U of the small ones, and shorter beside the time of a large one
        assert other[name].value == pytest.approx(own[name].value, rel=0.005)
    assert other["period"].value == pytest.approx(by * own["period"].value, rel=0.01)
