"""Standard maneuvers without units, and the criteria of ships at their edges."""

from pathlib import Path

import pytest

from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.report.tables_standard import CRITERIA, OPEN, imo, judged, particulars, standard
from auvident.schema.artifacts import Finding
from auvident.schema.desk import DeskFigure, DeskResult, StandardManeuvers
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES

OVERSHOOT_1, OVERSHOOT_2 = CRITERIA[3], CRITERIA[4]


def result(maneuver: str, parameters: dict[str, float], **figures: float) -> DeskResult:
    """A maneuver with some figures, whose intervals are a tenth to either side."""
    units = {"deg": "deg", "m": "m", "ps": "1/s", "s": "s", "degps": "deg/s", "index": "-"}
    told = []
    for name, value in figures.items():
        stem, _, end = name.rpartition("_")
        unit = units[end]
        told.append(
            DeskFigure(
                name=name if end == "index" else stem,
                value=value,
                low=0.9 * value,
                high=1.1 * value,
                unit=unit,
            )
        )
    return DeskResult(
        vehicle="Ship",
        plane="horizontal",
        maneuver=maneuver,
        parameters=parameters,
        model="model.json",
        source="identified",
        length_m=100.0,
        speed_mps=5.0,
        rpm=90.0,
        speed_is_held=False,
        servo="2.32 deg/s, usual",
        models_drawn=40,
        models_lost=0,
        figures=tuple(told),
    )


@pytest.fixture
def found() -> StandardManeuvers:
    """L/U is 20 s: half way between the limits of small and of large ships."""
    circle = result(
        "turning-circle",
        {"rudder_deg": 35.0},
        advance_m=300.0,
        tactical_diameter_m=480.0,
        steady_r_degps=1.5,
        nomoto_gain_ps=0.05,
        stability_index=0.2,
    )
    small = result(
        "zigzag",
        {"rudder_deg": 10.0, "heading_deg": 10.0},
        overshoot_1_deg=13.0,
        overshoot_2_deg=40.0,
        initial_turning_distance_m=180.0,
    )
    return StandardManeuvers(
        vehicle="Ship", plane="horizontal", greatest_laid_deg=30.0, maneuvers=(circle, small)
    )


def test_figures_are_told_in_lengths_and_times_of_the_hull(found: StandardManeuvers) -> None:
    table = written(standard(found), PAGE)
    rows = {row[1]: row for row in table.rows}
    assert rows["advance"][2:] == ("m", "300", "270 to 330", "3.00 L")
    assert rows["steady yaw rate"][5] == "0.524 U/L"  # 1.5 deg/s x 20 s in rad
    assert rows["Nomoto K, linear model"][5] == "1.00 U/L"
    assert rows["stability index G"][5] == ""
    assert "Beyond the 30 deg that it was identified with: turning circle 35." in table.caption


def test_what_is_doubtful_about_a_maneuver_stands_below(found: StandardManeuvers) -> None:
    lost = Finding(code="drawn-models-run-away", message="5 of 40 models diverge", where="x")
    circle, zigzag = found.maneuvers
    doubted = zigzag.model_copy(update={"findings": (lost,)})
    told = standard(found.model_copy(update={"maneuvers": (circle, doubted)}))
    assert "Zigzag 10/10: 5 of 40 models diverge." in told.caption
    assert "diverge" not in standard(found).caption


def test_an_unstable_ship_is_called_so(found: StandardManeuvers) -> None:
    circle = result("turning-circle", {"rudder_deg": 35.0}, advance_m=300.0, stability_index=-0.2)
    told = standard(found.model_copy(update={"maneuvers": (circle,)}))
    assert "does not keep a straight course" in told.caption
    assert "does not keep a straight course" not in standard(found).caption


def test_an_unstable_diver_keeps_no_pitch_and_has_no_course(found: StandardManeuvers) -> None:
    """The index of the vertical plane is of heave and pitch, without the righting moment."""
    zigzag = result(
        "vertical-zigzag",
        {"elevator_deg": 10.0, "pitch_deg": 5.0},
        overshoot_1_deg=3.0,
        stability_index=-0.2,
    )
    dives = {"plane": "vertical", "maneuvers": (zigzag,)}
    told = standard(found.model_copy(update=dives)).caption
    assert "does not keep its pitch" in told and "righting moment" in told
    assert "course" not in told and "K and T" not in told


@pytest.mark.parametrize(
    ("hull_time_s", "first", "second"),
    [(5.0, 10.0, 25.0), (10.0, 10.0, 25.0), (20.0, 15.0, 32.5), (30.0, 20.0, 40.0), (60, 20, 40)],
)
def test_limits_of_the_overshoots_rise_with_the_ship(
    hull_time_s: float, first: float, second: float
) -> None:
    """MSC.137(76), 5.3.3: 5 + L/V/2 and 17.5 + 0.75 L/V between 10 s and 30 s."""
    assert OVERSHOOT_1.limit(hull_time_s) == pytest.approx(first)
    assert OVERSHOOT_2.limit(hull_time_s) == pytest.approx(second)


def test_criteria_are_judged_with_their_intervals(found: StandardManeuvers) -> None:
    rows = {row[0]: row for row in written(imo(found), PAGE).rows}
    assert rows["advance"][1:] == ("L", "3.00", "2.70 to 3.30", "4.50", "met")
    assert rows["tactical diameter"][-1] == OPEN  # 4.32 to 5.28 lengths
    assert rows["1st overshoot, zigzag 10/10"][4:] == ("15.0", "met")
    assert rows["2nd overshoot, zigzag 10/10"][4:] == ("32.5", "not met")
    assert rows["way to 10° of heading with 10° of rudder"][5] == "met"
    assert "1st overshoot, zigzag 20/20" not in rows  # was not flown


def test_a_limit_itself_is_met() -> None:
    assert judged(4.5, None, None, 4.5) == "met"
    assert judged(4.5001, None, None, 4.5) == "not met"
    assert judged(4.4, 4.0, 4.5, 4.5) == "met"


def test_criteria_of_ships_apply_to_ships_alone() -> None:
    """A hull by beam and draught without an elevator; a body of revolution is none."""
    ship = load_vehicle(SAMPLES / "kvlcc2/vehicle.toml")
    assert ship.is_ship and not load_vehicle(SAMPLES / "remus100.toml").is_ship
    diver = ship.fin[0].model_copy(update={"kind": "elevator", "moved_by": ("elevator",)})
    assert not ship.model_copy(update={"fin": (*ship.fin, diver)}).is_ship


def test_particulars_have_what_the_vehicle_file_states(found: StandardManeuvers) -> None:
    path: Path = SAMPLES / "kvlcc2/vehicle.toml"
    rows = dict(written(particulars(load_vehicle(path), None, found), PAGE).rows)
    assert rows["L/B, B/T"] == "5.52, 2.79"  # 320/58 and 58/20.8 of the ship
    assert rows["L/U"] == "20.0\u00a0s"
    assert rows["radius of gyration k_zz"] == "0.249 L"
    assert rows["Froude number"] == "0.16"  # 5 m/s over the root of 9.81 x 100
    assert not {"radius of gyration k_yy", "buoyancy B"} & set(rows)


def test_particulars_of_a_vehicle_that_dives_have_its_ballast(found: StandardManeuvers) -> None:
    vehicle = load_vehicle(SAMPLES / "tern180.toml")
    rows = dict(written(particulars(vehicle, None, found), PAGE).rows)
    assert rows["centre of gravity from O, z_G"] == "0.0300\u00a0m"
    assert rows["buoyancy B"] == "602.0\u00a0N"
    assert rows["radius of gyration k_yy"] == "0.264 L"  # the root of 13.8/61.2 over 1.8 m
