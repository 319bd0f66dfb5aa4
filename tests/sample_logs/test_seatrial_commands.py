"""What the program makes of the logged commands is what elevators and propeller did."""

import math
from functools import cache

import numpy as np
import pytest
from seatrial.actuators import felt_angle
from seatrial.planting import fin_servo, motor_drive
from seatrial.simulate import (
    CONTROL_STEPS,
    ELEVATOR,
    ELEVATOR_COMMAND,
    REVS,
    RPM_COMMAND,
    STEP_S,
)
from seatrial.trial import sail
from seatrial.vehicles import PLANTS, load_vehicle

from auvident.physics.actuation import COMMANDS, CONTROL, acting_inputs
from auvident.physics.actuation import REVS as RATE
from auvident.schema.effects import parameter_of

SHORT = {"straights": 1, "depth_steps": 1, "vertical_zigzags": 2}
DT = CONTROL_STEPS * STEP_S  # commands change between steps of the log, not within one
# of every servo of the generator
USUAL = {"elevator_lag": {"lag_s": 0.05}, "elevator_rate_limit": {"rate_degps": 120.0}}
# steps of 0.01 s here, substeps of 0.01 s there, which differ where a limit ends; the mean of the
# angle is stalled in place of each angle
TOLERANCE = math.radians(0.1)
FAULTS = {
    "usual": {},
    "lag": {"elevator_lag": {"lag_s": 0.5}},
    "rate limit": {"elevator_rate_limit": {"rate_degps": 12.0}},
    "delay": {"elevator_delay": {"delay_s": 0.25}},
    "backlash": {"elevator_backlash": {"half_width_deg": 1.2}},
    "deadband": {"elevator_deadband": {"deadband_deg": 1.1}},
    "asymmetry": {"elevator_asymmetry": {"gain": -0.2}},
    "offset": {"elevator_offset": {"offset_deg": 2.0}},
    "stall": {"elevator_stall": {"angle_deg": 14.0}},
    "together": {
        "elevator_lag": {"lag_s": 0.3},
        "elevator_delay": {"delay_s": 0.15},
        "elevator_backlash": {"half_width_deg": 0.8},
        "elevator_asymmetry": {"gain": 0.1},
        "elevator_offset": {"offset_deg": -1.5},
        "elevator_stall": {"angle_deg": 18.0},
    },
}


@cache
def sailed(name: str, fault: str) -> np.ndarray:
    """Record of a short trial in the vertical plane, whole steps of the log."""
    recipe = {"name": "short", "vehicle": name, "seed": 5, "schedule": SHORT, "plane": "vertical"}
    record = sail(recipe, load_vehicle(name), FAULTS[fault])[0]
    return record[: len(record) // CONTROL_STEPS * CONTROL_STEPS]


def means(values: np.ndarray) -> np.ndarray:
    """Mean over every step of the log."""
    return values.reshape(-1, CONTROL_STEPS).mean(axis=1)


def course(values: np.ndarray) -> np.ndarray:
    """What is recorded at the beginning of every step, in its middle."""
    return 0.5 * (values + np.append(values[1:], values[-1]))


def acting(record: np.ndarray, planted: dict) -> np.ndarray:
    """Inputs (n, 12) as the program has them, from the commands alone."""
    commands = COMMANDS["vertical"]
    e = np.zeros(len(commands))
    for effect, parameters in planted.items():
        for symbol, value in parameters.items():
            name = f"{effect}.{symbol}"
            e[commands.index(name)] = parameter_of(name).internal(value)
    elevator, rate = means(record[:, ELEVATOR_COMMAND]), means(record[:, RPM_COMMAND]) / 60.0
    zero = np.zeros(len(rate))
    raw = np.column_stack([elevator, zero, rate])
    return acting_inputs(raw, zero, zero, zero, zero, DT, e)


@pytest.mark.parametrize("name", sorted(PLANTS))
@pytest.mark.parametrize("fault", FAULTS)
def test_the_elevator_does_what_its_faults_make_of_the_command(name: str, fault: str) -> None:
    record, planted = sailed(name, fault), FAULTS[fault]
    servo = fin_servo("elevator", planted)
    felt = means(course(np.array([felt_angle(a, servo) for a in record[:, ELEVATOR]])))
    away = np.abs(acting(record, USUAL | planted)[:, CONTROL] - felt)[20:]
    assert away.max() < TOLERANCE
    if planted:  # a servo without its fault is not what acts
        assert np.abs(acting(record, USUAL)[:, CONTROL] - felt).max() > 3.0 * TOLERANCE


@pytest.mark.parametrize("name", sorted(PLANTS))
def test_the_propeller_follows_its_command(name: str) -> None:
    record, lag = sailed(name, "usual"), motor_drive({}).lag
    found = acting(record, {"propeller_lag": {"lag_s": lag}})[:, RATE]
    away = np.abs(found - means(course(record[:, REVS])))
    # the middle of a chord in place of the mean of an exponential, of a change by all there is
    chord = (STEP_S / lag) ** 2 / 12.0 * np.ptp(found)
    assert away.max() < 1.1 * chord
