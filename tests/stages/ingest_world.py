"""Raw trials in memory: a linear vehicle that steers zigzags and circles, any sensor rates."""

from dataclasses import replace

import numpy as np

from auvident.schema.logs import RawSensor, RawTrial
from auvident.schema.vehicle import Vehicle

LENGTH_M = 2.0
COLUMNS = {
    "u_mps": "dvl",
    "v_mps": "dvl",
    "r_radps": "gyro",
    "q_radps": "gyro",
    "rudder_rad": "rudder",
    "elevator_rad": "elevator",
    "rpm": "rpm",
    "heading_rad": "attitude",
    "depth_m": "depth",
    "north_m": "position",
    "east_m": "position",
}


def vehicle(**tables) -> Vehicle:
    data = {
        "vehicle": {"mass_kg": 50.0, "izz_kgm2": 10.0, "origin_from_nose_m": 1.0},
        "hull": {
            "length_m": LENGTH_M,
            "diameter_m": 0.2,
            "nose_length_m": 0.2,
            "tail_length_m": 0.5,
        },
        "propeller": {"diameter_m": 0.15, "kt0": 0.3, "kt1": -0.3},
    }
    return Vehicle.model_validate(data | tables)


def sensor(name: str, time_s, **values) -> RawSensor:
    time_s = np.asarray(time_s, dtype=float)
    return RawSensor(
        sensor=name,
        file=f"{name}.csv",
        time_s=time_s,
        values={c: np.asarray(x, dtype=float) for c, x in values.items()},
        rows=np.arange(2, time_s.size + 2),
        columns={c: c for c in values},
        rows_read=time_s.size,
    )


def trial(*sensors: RawSensor, name: str = "run") -> RawTrial:
    return RawTrial(name, {s.sensor: s for s in sensors})


def calm(rate_hz: float = 10.0, duration_s: float = 20.0, **changes: RawSensor) -> RawTrial:
    """Straight and level at constant values, all sensors on the same ticks."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    wave = 1e-3 * np.sin(t)  # a channel that never changes would be remarked upon
    sensors = {
        "dvl": sensor("dvl", t, u_mps=1.5 + wave, v_mps=wave),
        "gyro": sensor("gyro", t, r_radps=wave),
        "rudder": sensor("rudder", t, rudder_rad=0.05 * np.sign(np.sin(t))),
        "rpm": sensor("rpm", t, rpm=np.full(t.size, 1200.0)),
    }
    return trial(*(sensors | changes).values())


def with_sensor(raw: RawTrial, changed: RawSensor) -> RawTrial:
    return replace(raw, sensors=raw.sensors | {changed.sensor: changed})


def changed(raw: RawTrial, name: str, **fields) -> RawTrial:
    """The trial with fields of one sensor replaced."""
    return with_sensor(raw, replace(raw.sensors[name], **fields))


def maneuvers(
    seed: int = 1, duration_s: float = 400.0, noise: float = 1.0, gyro_hz: float = 50.0
) -> RawTrial:
    """Zigzags of a linear hull with sway, yaw and a servo, sensors at 5 to 50 Hz with noise."""
    rng = np.random.default_rng(seed)
    h = 0.01
    t = np.arange(0.0, duration_s, h)
    command = 0.25 * np.sign(np.sin(2 * np.pi * t / 16.0) + 0.4 * np.sin(2 * np.pi * t / 57.0))
    u = np.full(t.size, 1.5)
    v, r, psi, d = (np.zeros(t.size) for _ in range(4))
    for k in range(t.size - 1):
        d[k + 1] = d[k] + h / 0.1 * (command[k] - d[k])
        vdot = -0.9 * v[k] - 0.6 * r[k] + 0.4 * d[k]
        rdot = -0.5 * v[k] - 1.2 * r[k] - 1.0 * d[k]
        v[k + 1], r[k + 1] = v[k] + h * vdot, r[k] + h * rdot
        psi[k + 1] = psi[k] + h * r[k]
    at = {
        name: np.sort(np.arange(rng.uniform(0, 0.1), duration_s - 0.2, 1 / hz))
        for name, hz in (
            ("dvl", 5.0),
            ("gyro", gyro_hz),
            ("rudder", 20.0),
            ("rpm", 5.0),
            ("attitude", 10.0),
        )
    }

    def seen(name: str, x: np.ndarray, std: float) -> np.ndarray:
        return np.interp(at[name], t, x) + noise * std * rng.standard_normal(at[name].size)

    held = command[np.minimum((at["rudder"] / h).astype(int), t.size - 1)]
    return trial(
        sensor("dvl", at["dvl"], u_mps=seen("dvl", u, 0.005), v_mps=seen("dvl", v, 0.005)),
        sensor("gyro", at["gyro"], r_radps=seen("gyro", r, 0.002)),
        sensor("rudder", at["rudder"], rudder_rad=held),
        sensor("rpm", at["rpm"], rpm=np.full(at["rpm"].size, 900.0)),
        sensor(
            "attitude", at["attitude"], heading_rad=np.mod(seen("attitude", psi, 0.002), 2 * np.pi)
        ),
    )
