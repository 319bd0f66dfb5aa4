"""The table of effects: complete, without doubles, and every row has its equation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvident.physics.actuation import COMMAND, COMMANDS
from auvident.physics.sensing import READING
from auvident.physics.terms import (
    EFFECT_FORCES,
    EQUATIONS,
    POWERS,
    VARIABLES,
    force_name,
    structure_of,
)
from auvident.schema.channels import BY_COLUMN
from auvident.schema.coefficients import PLANES
from auvident.schema.effect_words import nuisance_parameters, with_std
from auvident.schema.effects import (
    BY_ID,
    EFFECTS,
    UNEXPLAINED,
    Effect,
    EffectParameter,
    in_plane,
    own_in,
    parameter_of,
    parts_of,
)

# as users, pipelines and acceptance checks know them
IDS = {
    "environment": "current current_drift wave one_off_event vertical_current weight_change "
    "buoyancy_gradient",
    "actuation": "rudder_offset rudder_lag rudder_rate_limit rudder_delay rudder_backlash "
    "rudder_deadband rudder_asymmetry rudder_stall elevator_offset elevator_lag "
    "elevator_rate_limit elevator_delay elevator_backlash elevator_deadband elevator_asymmetry "
    "elevator_stall propeller_lag propeller_race thrust_sag thrust_step thrust_line_moment",
    "sensing": "dvl_delay gyro_delay dvl_misalignment dvl_scale dvl_lever_arm gyro_bias gyro_scale "
    "pitch_bias pitch_scale q_bias q_scale depth_lag depth_scale dvl_pitch",
    "hydrodynamics": "propeller_side_force hull_asymmetry sway_cross_flow yaw_cross_flow "
    "heave_cross_flow pitch_cross_flow cubic_damping turning_drag linear_drag linear_damping "
    "roll_coupling",
}
# those that stand in the vertical plane, beside its own
SHARED = (
    "current propeller_lag propeller_race thrust_sag thrust_step dvl_delay gyro_delay dvl_scale "
    "dvl_lever_arm hull_asymmetry cubic_damping turning_drag linear_drag linear_damping"
)
OWN = (
    "vertical_current elevator_offset elevator_lag elevator_rate_limit elevator_delay "
    "elevator_backlash elevator_deadband elevator_asymmetry elevator_stall dvl_pitch q_bias "
    "q_scale pitch_bias pitch_scale depth_lag depth_scale thrust_line_moment heave_cross_flow "
    "pitch_cross_flow weight_change buoyancy_gradient"
)
# a change of weight is a force, of which actuation says what part has been made
TIMES = {"weight_change.time_s", "weight_change.over_s"}
# an arm of a force that stands in the equations has no scale of its own
ARMS = {"thrust_line_moment"}
FURTHER = {"dvl_height", "weight_excess"}  # nuisance parameters that are never named
NAMES = [name for effect in (*EFFECTS, UNEXPLAINED) for name in effect.names()]
MODELLED = [e for e in (*EFFECTS, UNEXPLAINED) if e.enters != "disturbance"]


def test_ids_are_those_that_users_know() -> None:
    by_family = {family: set(ids.split()) for family, ids in IDS.items()}
    found: dict[str, set[str]] = {family: set() for family in IDS}
    for effect in EFFECTS:
        if effect.id not in FURTHER:
            found[effect.family].add(effect.id)
    assert found == by_family
    assert set(BY_ID) == set().union(*by_family.values()) | FURTHER | {UNEXPLAINED.id}


def test_the_vertical_plane_has_its_own_effects_and_those_of_surge_and_sensors() -> None:
    vertical = {e.id for e in in_plane("vertical")}
    assert vertical == {*SHARED.split(), *OWN.split()}
    assert not set(OWN.split()) & {e.id for e in in_plane("horizontal")}


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e.twin], ids=lambda e: e.id)
def test_twins_are_the_same_in_two_planes(effect: Effect) -> None:
    """Family, sizes and bounds, whatever the axes; a bias of pitch is no bias of a mounting."""
    twin = BY_ID[effect.twin]
    assert twin.twin == effect.id and not set(twin.planes) & set(effect.planes)
    for ours, theirs in zip(effect.parameters, twin.parameters, strict=True):
        assert replace(ours, symbol=theirs.symbol, planes=theirs.planes) == theirs
    same = ("family", "enters", "steady", "curved", "higher_order", "late", "source")
    assert all(getattr(effect, name) == getattr(twin, name) for name in same)
    for plane in PLANES:
        assert own_in(plane, effect.id) == own_in(plane, twin.id)
        assert plane in BY_ID[own_in(plane, effect.id)].planes


def test_every_fin_has_the_same_effects() -> None:
    kinds = [
        {e.id.removeprefix(f"{fin}_") for e in EFFECTS if e.id.startswith(f"{fin}_")}
        for fin in ("rudder", "elevator")
    ]
    assert kinds[0] == kinds[1] and len(kinds[0]) == 8


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_parameters_of_a_plane_have_its_axes(effect: Effect) -> None:
    """Whatever a force is called in one plane it is called after the axes of the other there."""
    both = {p.symbol for p in effect.parameters if set(p.planes) == set(PLANES)}
    own = {plane: [*effect.names(plane)] for plane in effect.planes}
    assert {name for names in own.values() for name in names} == set(effect.names())
    if effect.enters == "force" and effect.planes == PLANES:
        assert both <= {"X_u"}
        assert len(own["horizontal"]) == len(own["vertical"])
        turned = str.maketrans("YNvr", "ZMwq")
        assert [n.partition(".")[2].translate(turned) for n in own["horizontal"]] == [
            n.partition(".")[2] for n in own["vertical"]
        ]


def test_what_does_the_same_together_is_of_the_same_plane() -> None:
    assert parts_of("propeller_side_force") == (("rudder_offset", "dvl_misalignment"),)
    assert parts_of("hull_asymmetry") == (
        ("rudder_offset", "dvl_misalignment"),
        ("elevator_offset", "dvl_pitch"),
    )
    assert parts_of("thrust_line_moment") == (("elevator_offset", "dvl_pitch"),)
    assert parts_of("gyro_bias") == ()


def test_a_force_without_a_name_is_no_candidate() -> None:
    assert UNEXPLAINED not in EFFECTS and UNEXPLAINED.nuisance
    assert all(UNEXPLAINED not in in_plane(plane) for plane in PLANES)


def test_ids_and_names_are_unique() -> None:
    assert len(BY_ID) == len(EFFECTS) + 1
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_bounds_contain_off_and_the_sizes_that_matter(name) -> None:
    p = parameter_of(name)
    assert p.low <= 0.0 <= p.high
    assert p.low < p.high
    assert 0.0 <= p.practical < p.high
    assert 0.0 <= p.nuisance_std < p.high
    assert p.prior >= 0.0
    assert p.step > 0.0
    # a slope is taken within the bounds, and what every model is allowed is no news
    assert p.step * p.prior < p.high
    assert p.nuisance_std <= max(2.0 * p.practical, p.prior)
    assert p.unit and p.symbol


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_rows_are_complete(effect: Effect) -> None:
    assert effect.equation and effect.signature
    assert effect.parameters and effect.planes
    assert set(effect.planes) <= set(PLANES)
    assert all(column in {*BY_COLUMN, "north_m"} for column in effect.needs)
    # only forces, and the race by its thrust, know the density and the rate of the propeller
    forced = any(p.powers[0] or p.powers[3] for p in effect.parameters)
    expected = effect.enters == "force" or effect.id == "propeller_race"
    assert forced == (expected and effect.id not in ARMS)


def test_every_row_has_its_equation_and_every_equation_its_row() -> None:
    by_place = {
        place: [n for e in MODELLED if e.enters == place for n in e.names()]
        for place in ("input", "reading", "force")
    }
    commands = {n for names in COMMANDS.values() for n in names if "." in n}
    forces = {force_name(plane, name) for plane in PLANES for name, *_ in EFFECT_FORCES}
    assert {*by_place["input"], *TIMES} == commands
    assert set(by_place["reading"]) == set(READING)
    assert set(by_place["force"]) <= forces | TIMES
    assert len(set(COMMAND)) == len(COMMAND)
    assert len(set(READING)) == len(READING)


@pytest.mark.parametrize("plane", PLANES)
def test_every_force_of_a_plane_acts_in_its_equations(plane) -> None:
    effects = tuple(e for e in in_plane(plane) if e.enters == "force")
    structure = structure_of(plane, tuple(e.id for e in effects))
    acting = {structure.parameters[i] for i in structure.terms[:, 1]}
    names = {n for e in effects for n in e.names(plane)}
    assert {n for n in acting if "." in n} == names - TIMES


@pytest.mark.parametrize("row", EFFECT_FORCES, ids=lambda row: row[0])
def test_forces_stand_on_a_known_equation_of_known_factors(row) -> None:
    _, equation, weight, *factors = row
    assert equation in EQUATIONS
    assert abs(weight) == 1
    for variable, power in factors:
        assert variable in VARIABLES
        assert power in POWERS


@pytest.mark.parametrize("plane", PLANES)
def test_the_parameter_vector_has_them_in_the_order_of_the_table(plane) -> None:
    effects = in_plane(plane)
    assert all(plane in e.planes and e.enters != "disturbance" for e in effects)
    structure = structure_of(plane, tuple(e.id for e in effects))
    names = tuple(name for e in effects for name in e.names(plane))
    assert structure.parameters[-len(names) :] == names


@pytest.mark.parametrize("effect", [e for e in MODELLED if e.enters == "force"], ids=lambda e: e.id)
def test_the_unit_of_a_force_is_that_of_its_scaling(effect: Effect) -> None:
    """Sizes scale with density/2, length, speed and rate to powers that make up the unit."""
    base = {"N": (1, 1, -2), "kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "-": (0, 0, 0)}
    for p in effect.parameters:
        if p.grid is not None or p.width_of:
            continue  # times of the trial, not of the vehicle
        above, _, below = p.unit.partition("/")
        total = [0, 0, 0]
        for sign, text in ((1, above), (-1, below)):
            for word in text.split():
                unit, _, power = word.partition("^")
                for i in range(3):
                    total[i] += sign * int(power or 1) * base[unit][i]
        density, length, speed, rate = p.powers
        assert total == [density, -3 * density + length + speed, -speed - rate], p.symbol


@pytest.mark.parametrize("name", [n for e in MODELLED if e.enters != "force" for n in e.names()])
def test_the_unit_of_a_time_a_length_or_a_speed_is_that_of_its_scaling(name: str) -> None:
    """What depends on the size of the vehicle scales with it; shares and angles do not."""
    by_unit = {
        "s": (1, -1),  # L/U
        "deg/s": (-1, 1),  # U/L
        "m": (1, 0),
        "m/s": (0, 1),
        "m/s in 1000 s": (0, 1),
        "deg": (0, 0),
        "-": (0, 0),
        "m^2/s^2/N": (-2, 0),  # speed^2 over a force
    }
    p = parameter_of(name)
    if p.grid is not None or p.width_of:
        return  # times of the trial, not of the vehicle
    length, speed = by_unit[p.unit]
    sign = -1 if p.form == "inverse" else 1
    assert p.powers[1:3] == (sign * length, sign * speed)


@pytest.mark.parametrize(
    ("name", "usual", "large", "small"),
    [  # 1.7 m at 1.5 m/s; 8 m at 2 m/s: L/U of 4 s; 0.8 m at 1 m/s: 0.8 s
        ("rudder_lag.lag_s", 0.4, 1.4, 0.28),
        ("dvl_delay.delay_s", 0.25, 0.88, 0.18),
        ("rudder_rate_limit.rate_degps", 3.0, 10.4, 2.1),
        ("dvl_lever_arm.dx_m", 0.2, 0.96, 0.096),
        ("current.north_mps", 0.3, 0.4, 0.2),
        ("gyro_bias.bias_degps", 0.005, 0.0014, 0.0071),
        ("rudder_offset.offset_deg", 0.035, 0.035, 0.035),
    ],
)
def test_usual_sizes_are_those_of_the_vehicle(name, usual, large, small) -> None:
    """Lengths in L, times in L/U, speeds in U; rounded to two digits."""
    p = parameter_of(name)
    for expected, length, speed in ((usual, 1.7, 1.5), (large, 8.0, 2.0), (small, 0.8, 1.0)):
        assert p.prior * p.size_unit(1025.0, length, speed, 15.0) == pytest.approx(
            expected, rel=0.04
        )


def test_bounds_are_wider_than_any_plausible_vehicle() -> None:
    """L/U from 0.4 s (quick and short) to 5 s (long and slow)."""
    for length, speed in ((0.8, 2.0), (8.0, 1.6)):
        for name in ("rudder_delay.delay_s", "dvl_delay.delay_s", "gyro_delay.delay_s"):
            p = parameter_of(name)
            assert p.high * p.size_unit(1025.0, length, speed, 15.0) >= 2.0
        assert parameter_of("rudder_lag.lag_s").high >= 3.0  # L/U


@pytest.mark.parametrize("name", NAMES)
def test_shown_and_internal_values_are_inverse(name) -> None:
    p = parameter_of(name)
    for shown in np.geomspace(1e-3, 1e3, 301).tolist():
        internal = p.internal(shown)
        if p.form == "plain" or internal > 0.01 * p.practical:
            assert p.shown(internal)[0] == pytest.approx(shown, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_shown_deviation_is_the_slope_of_the_shown_value(name) -> None:
    p, std = parameter_of(name), 1e-6
    at = 0.5 * p.prior or 0.5
    (value, shown_std), (up, _), (down, _) = (p.shown(x, std) for x in (at, at + std, at - std))
    assert shown_std == pytest.approx(0.5 * abs(up - down), rel=1e-6)
    assert math.isfinite(value)


def test_a_limit_that_is_never_reached_is_shown_finite() -> None:
    for name in ("rudder_rate_limit.rate_degps", "rudder_stall.angle_deg"):
        value, std = parameter_of(name).shown(0.0, 0.1)
        assert math.isfinite(value) and math.isfinite(std)
        assert value > parameter_of(name).shown(parameter_of(name).practical)[0]


def test_units_are_those_of_an_engineer() -> None:
    assert parameter_of("rudder_offset.offset_deg").internal(180.0) == pytest.approx(math.pi)
    # 20 deg/s: a limit is stored as the seconds that one radian takes
    slow = parameter_of("rudder_rate_limit.rate_degps").internal(20.0)
    assert slow == pytest.approx(1.0 / math.radians(20.0))
    stall = parameter_of("rudder_stall.angle_deg").internal(15.0)
    assert stall == pytest.approx(math.radians(15.0) ** -2)
    force = EffectParameter("Y", "N", 1.0, 0.1, -1.0, 1.0, powers=(1, 2, 2, -1))
    assert force.size_unit(1000.0, 2.0, 1.5, 10.0) == pytest.approx(500.0 * 4.0 * 2.25 / 10.0)


@pytest.mark.parametrize(
    ("slowness", "words"),
    [
        (0.5, "Adjusted along with the coefficients: servo speed limit 115 ± 10 deg/s."),
        (0.0, "Servo speed limit: not needed."),
    ],
)
def test_a_nuisance_parameter_without_effect_is_told_as_not_needed(
    slowness: float, words: str
) -> None:
    name = "rudder_rate_limit"
    value, _ = parameter_of(f"{name}.rate_degps").shown(slowness)
    parameter = {"symbol": "rate_degps", "value": value, "std": 10.0, "unit": "deg/s"}
    row = {"id": name, "parameters": [parameter], "internal": {f"{name}.rate_degps": slowness}}
    assert nuisance_parameters([{**row, "nuisance": True}]) == words
    assert nuisance_parameters([{**row, "nuisance": False}]) == ""
    parameter["std"] = 2.0 * value
    unknown = nuisance_parameters([{**row, "nuisance": True}])
    assert ("not determined by these data" in unknown) == (slowness > 0.0)


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (138.2, 101.3, "138 ± 101"),
        (0.04225, 0.03183, "0.042 ± 0.032"),
        (-1.5, 0.4, "-1.50 ± 0.40"),
        (0.0289013, 0.00067562, "0.02890 ± 0.00068"),
        (2.5, float("inf"), "2.5"),
        (2.5, 0.0, "2.5"),
    ],
)
def test_a_standard_deviation_is_shown_with_two_digits(value, std, text) -> None:
    assert with_std(value, std) == text
