"""What an exact model would leave of the held-out maneuvers of a sample.

A prediction knows rudder and rpm, and not the turbulence. The plant of the generator itself, from
the true state at the start of a maneuver on, with the commands of the record and in water that
rests, is off from the record by what the turbulence has done; the noise of the sensors is added.
An identified model leaves less by chance alone.
"""

import json
import sys
import tomllib
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.artifacts import Maneuver
from tests.command_line import ROOT
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

TRUTH = ROOT / "tests/truth"
SENSOR = {"u": "dvl", "v": "dvl", "w": "dvl", "r": "gyro", "q": "gyro", "pitch": "attitude"}
COLUMN = {"u": "u_mps", "v": "v_mps", "w": "w_mps"}  # where it has another name than the channel

Array = npt.NDArray[Any]


def floor(trial: str, maneuvers: Iterable[Maneuver]) -> dict[str, float]:
    """Root mean square error of an exact model, pooled over maneuvers, by channel [SI].

    Parameters
    ----------
    trial : str
        A sample in which nothing is planted.
    maneuvers : iterable of Maneuver
        With times of the log clock.
    """
    from seatrial.sensors import Noise
    from seatrial.simulate import STEP_S
    from seatrial.trial import sail
    from seatrial.vehicles import load_vehicle

    recipe = tomllib.loads((TRUTH / f"{trial}.toml").read_text(encoding="utf-8"))
    if recipe.get("effect"):
        raise ValueError(f"{trial}: an exact model of a planted effect is not known here")
    vehicle = load_vehicle(recipe["vehicle"])
    record, *_ = sail(recipe, vehicle, {})
    truth = json.loads((TRUTH / f"{trial}.json").read_text(encoding="utf-8"))
    origin = truth["time_origin_s"]
    squares: dict[str, list[Array]] = {}
    for m in maneuvers:
        first, last = (round((t - origin) / STEP_S) for t in (m.t_start_s, m.t_end_s))
        piece = record[first:last]
        sailed, calm = (_measured(r, vehicle) for r in (piece, _in_calm_water(piece, vehicle)))
        for channel, values in sailed.items():
            squares.setdefault(channel, []).append((values - calm[channel]) ** 2)
    noise = Noise()
    own = {"dvl": noise.dvl_mps, "gyro": noise.gyro_radps, "attitude": noise.tilt_rad}
    return {
        channel: float(np.sqrt(np.nanmean(np.concatenate(parts)) + own[SENSOR[channel]] ** 2))
        for channel, parts in squares.items()
    }


def _in_calm_water(piece: Array, vehicle: Any) -> Array:
    """The record of a maneuver again, from its first state on, without turbulence or waves."""
    from seatrial.plant import workspace
    from seatrial.planting import fin_servo, motor_drive, plant_effects
    from seatrial.population.visible import follow
    from seatrial.trial import make_sea

    no_legs = np.empty((0, 0))  # nothing is planted in one
    sea = make_sea(vehicle, {}, no_legs, [], np.random.default_rng(0))
    calm = sea._replace(turbulence=np.zeros(6), surface_force=np.zeros((3, 6)))
    parts = (vehicle.body, plant_effects({}), fin_servo("rudder", {}), fin_servo("elevator", {}))
    rest = (motor_drive({}), calm, np.zeros((len(piece), 9)), workspace())
    found: Array = follow(piece, len(piece), *parts, *rest)
    return found


def _measured(record: Array, vehicle: Any) -> dict[str, Array]:
    """Readings by channel, with a noise that two records of one length have in common."""
    from seatrial import sensors

    noise = sensors.Noise()
    logs = {
        "dvl": sensors.dvl(record, vehicle, {}, np.random.default_rng(1), noise),
        "gyro": sensors.gyro(record, {}, np.random.default_rng(2), noise),
        "attitude": sensors.attitude(record, {}, np.random.default_rng(3), noise),
    }
    return {c: logs[log][COLUMN.get(c, c)] for c, log in SENSOR.items()}
