"""Trials simulated from known coefficients, by equations and an integrator of their own.

Nothing of the program's physics is used: the equations of motion in the horizontal plane are
written out (theory 1.3), scipy integrates them, and the sensors are white noise.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from auvident.schema.artifacts import AseResult, Maneuver, Maneuvers
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle

RATE_HZ, DVL_HZ = 10.0, 5.0  # rows per second; samples of the DVL
DVL_STD_MPS, GYRO_STD_RADPS = 0.005, 0.0009
CRUISE_MPS, APPROACH_S, SETTLE_S = 1.5, 5.0, 60.0
HARDEST_DEG, LEAST_MPS, MOST_RADPS = 20.0, 0.3, 1.2
DEGREE = np.pi / 180.0
SENSORS = ("dvl", "gyro", "rudder", "rpm")
# kind, rudder [deg], heading change that reverses it [deg], ratios of the cruise rate
PROGRAMME = (
    ("straight", 0, None, (1.0, 1.25, 0.8, 1.1)),
    ("straight", 0, None, (0.75, 1.0, 1.3, 0.9)),
    ("turn", 10, None, (1.1,)),
    ("turn", -18, None, (1.1,)),
    ("turn", 15, None, (0.85,)),
    ("turn", -8, None, (1.2,)),
    ("zigzag", 10, 10, (0.85,)),
    ("zigzag", -10, 10, (1.2,)),
    ("zigzag", 20, 20, (0.9,)),
    ("zigzag", -20, 20, (1.15,)),
)
LENGTHS_S = {"straight": 100.0, "turn": 70.0, "zigzag": 70.0}


@dataclass(frozen=True)
class World:
    """A trial with its maneuvers, and the coefficients it was made from."""

    trial: Trial
    maneuvers: Maneuvers
    truth: dict[str, float]


def draw_truth(ase: AseResult, vehicle: Vehicle, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients from the prior; stable vehicles only.

    As little as possible is refused, and nothing cut off: truths in a narrower range than the prior
    says would make what the data leave to the prior look too uncertain.
    """
    rows = [c for c in ase.coefficients if c.plane in ("horizontal", "both")]
    while True:
        draws = rng.normal(size=len(rows))
        c = {row.symbol: row.value + row.std * float(d) for row, d in zip(rows, draws, strict=True)}
        c["N_vdot"] = c["Y_rdot"]
        if _is_stable(c, vehicle) and _turns_calmly(c, vehicle):
            return c


def _is_stable(c: dict[str, float], vehicle: Vehicle) -> bool:
    """Positive masses, a speed at which drag and thrust balance, straight-line stability."""
    m, i, xg = vehicle.body.mass_kg, vehicle.body.izz_kgm2, vehicle.body.x_g_m
    mass = np.array(
        [[m - c["Y_vdot"], m * xg - c["Y_rdot"]], [m * xg - c["N_vdot"], i - c["N_rdot"]]]
    )
    damping = np.array([[c["Y_uv"], c["Y_ur"] - m], [c["N_uv"], c["N_ur"] - m * xg]])
    if min(m - c["X_udot"], -c["X_uu"], c["T_nn"], *np.linalg.eigvalsh(0.5 * (mass + mass.T))) <= 0:
        return False
    return bool(np.linalg.eigvals(np.linalg.solve(mass, damping)).real.max() < -0.2)


def _turns_calmly(c: dict[str, float], vehicle: Vehicle) -> bool:
    """Whether the hardest turn ends at a speed and a rate a vehicle can have."""
    rudder, cruise = HARDEST_DEG * DEGREE, cruise_rate(c)
    for side in (-1.0, 1.0):
        end = solve_ivp(
            equations(c, vehicle),
            (0, 30.0),
            [CRUISE_MPS, 0, 0, 0],
            args=(side * rudder, cruise),
            method="LSODA",
            events=_spins,
        )
        if end.status != 0 or end.y[0, -1] < LEAST_MPS:
            return False
    return True


def _spins(t, x, d, n):
    """Zero when the turn is faster than any vehicle's."""
    return MOST_RADPS - abs(x[2])


_spins.terminal = True  # type: ignore[attr-defined]


def equations(c: dict[str, float], vehicle: Vehicle):
    """Right-hand side (t, (u, v, r, psi), rudder, n) in the horizontal plane, written out."""
    m, i, xg = vehicle.body.mass_kg, vehicle.body.izz_kgm2, vehicle.body.x_g_m
    m_vr, m_rv = m * xg - c["Y_rdot"], m * xg - c["N_vdot"]
    m_v, i_r = m - c["Y_vdot"], i - c["N_rdot"]
    determinant = m_v * i_r - m_vr * m_rv

    def rate(t, x, d, n):
        u, v, r, _ = x
        f_x = (
            c["X_uu"] * u * abs(u)
            + c["X_vv"] * v * v
            + (c["X_vr"] + m) * v * r
            + (c["X_rr"] + m * xg) * r * r
            + c["X_uudd"] * u * u * d * d
            + c["T_nn"] * n * abs(n)
            + c["T_nu"] * abs(n) * u
        )
        f_y = (
            c["Y_uv"] * u * v
            + (c["Y_ur"] - m) * u * r
            + c["Y_v|v|"] * v * abs(v)
            + c["Y_r|r|"] * r * abs(r)
            + c["Y_uud"] * u * u * d
        )
        f_n = (
            c["N_uv"] * u * v
            + (c["N_ur"] - m * xg) * u * r
            + c["N_v|v|"] * v * abs(v)
            + c["N_r|r|"] * r * abs(r)
            + c["N_uud"] * u * u * d
        )
        return [
            f_x / (m - c["X_udot"]),
            (i_r * f_y - m_vr * f_n) / determinant,
            (m_v * f_n - m_rv * f_y) / determinant,
            r,
        ]

    return rate


def cruise_rate(c: dict[str, float]) -> float:
    """Propeller rate [1/s] at which drag and thrust balance at the cruising speed."""
    u = CRUISE_MPS
    roots = np.roots([c["T_nn"], c["T_nu"] * u, c["X_uu"] * u * u])
    return float(roots.real.max())


@np.errstate(over="ignore", invalid="ignore")  # a vehicle that runs away is refused afterwards
def sail(
    c: dict[str, float],
    vehicle: Vehicle,
    kind: str,
    rudder_deg,
    switch_deg,
    ratios,
    rate_hz: float = RATE_HZ,
):
    """States (n, 4), rudder and propeller rate (n,) of one maneuver with its approach."""
    rate = equations(c, vehicle)
    step = 1.0 / rate_hz
    rudder, cruise = rudder_deg * DEGREE, cruise_rate(c)
    n = cruise * ratios[0]
    settled = solve_ivp(rate, (0, SETTLE_S), [1.0, 0, 0, 0], args=(0.0, n), rtol=1e-8).y[:, -1]
    length = round(LENGTHS_S[kind] * rate_hz)
    levels = [round(k * length / len(ratios)) for k in range(len(ratios) + 1)]
    states, inputs = [settled], []

    def advance(rows: int, d: float, revs: float, event=None) -> int:
        """Integrate with the inputs held, to the row after the event or the end."""
        found = solve_ivp(
            rate,
            (0, rows * step),
            states[-1],
            t_eval=np.arange(1, rows + 1) * step,
            args=(d, revs),
            rtol=1e-8,
            atol=1e-10,
            events=event,
            method="LSODA",
        )
        at = [t[0] for t in found.t_events or [] if len(t)]
        end = min(rows, int(np.ceil(at[0] / step + 1e-9))) if at else rows
        states.extend(found.y.T[:end])
        inputs.extend([(d, revs)] * end)
        return end

    advance(round(APPROACH_S * rate_hz), 0.0, n)
    done, side = 0, 1.0
    while done < length:
        level = next(k for k in range(len(ratios)) if done < levels[k + 1])
        revs, event = cruise * ratios[level], None
        if switch_deg is not None:  # the heading falls with a rudder to port
            goal = -np.sign(rudder * side) * switch_deg * DEGREE

            def event(t, x, d, revs, goal=goal):
                return x[3] - goal

            event.direction = np.sign(goal)
        done += advance(levels[level + 1] - done, rudder * side, revs, event)
        side = -side if switch_deg is not None else side
    return np.array(states[:-1]), np.array(inputs)


def make_world(
    ase: AseResult,
    vehicle: Vehicle,
    seed: int,
    programme=PROGRAMME,
    truth: dict[str, float] | None = None,
    rate_hz: float = RATE_HZ,
) -> World:
    """A trial of the programme by a vehicle drawn from the prior, or by a given one.

    The rate is that of the rows, by which the equations of the program are integrated, and of the
    gyro.
    """
    rng = np.random.default_rng(seed)
    truth = draw_truth(ase, vehicle, rng) if truth is None else truth
    tables, maneuvers, start = [], [], 0.0
    for number, (kind, rudder, switch, ratios) in enumerate(programme):
        states, inputs = sail(truth, vehicle, kind, rudder, switch, ratios, rate_hz)
        time = start + np.arange(len(states)) / rate_hz
        tables.append(_measured(time, states, inputs, vehicle, rng, rate_hz).assign(record=number))
        maneuvers.append(
            Maneuver(
                id=f"{kind}-{number}",
                trial="world",
                kind=kind,
                role="identify",
                plane="horizontal",
                planes=("horizontal",) if kind != "straight" else ("horizontal", "vertical"),
                t_start_s=start + APPROACH_S,
                t_end_s=float(time[-1]) + 1.0 / rate_hz,
            )
        )
        start = float(time[-1]) + 10.0
    table = pd.concat(tables, ignore_index=True)
    return World(
        Trial.from_table("world", table, rate_hz), Maneuvers(maneuvers=tuple(maneuvers)), truth
    )


def _measured(time, states, inputs, vehicle: Vehicle, rng, rate_hz: float) -> pd.DataFrame:
    """What the sensors would log, on one clock; the DVL interpolated between its samples."""
    u, v, r, _ = states.T
    x, y = vehicle.dvl.x_m, vehicle.dvl.y_m
    noise = rng.normal(size=(3, len(time)))
    readings = {
        "u_mps": u - y * r + DVL_STD_MPS * noise[0],
        "v_mps": v + x * r + DVL_STD_MPS * noise[1],
    }
    sampled = np.arange(len(time)) % round(rate_hz / DVL_HZ) == 0
    for column, values in readings.items():
        readings[column] = np.interp(time, time[sampled], values[sampled])
    table = pd.DataFrame(
        {
            "time_s": time,
            **readings,
            "r_radps": r + GYRO_STD_RADPS * noise[2],
            "rudder_rad": inputs[:, 0],
            "rpm": 60.0 * inputs[:, 1],
        }
    )
    for sensor in SENSORS:
        table[f"{sensor}_sampled"] = sampled if sensor == "dvl" else True
    return table
