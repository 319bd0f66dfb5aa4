"""A made-up vehicle with effects: records, parameter vectors and exact readings of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from auvident.engines.carried import predicted_course
from auvident.engines.prediction import Frame, Free
from auvident.engines.records import Record, Source
from auvident.engines.setup import Setup
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import Sensing
from auvident.schema.effects import BY_ID, parameter_of
from auvident.schema.plan import Plan
from auvident.schema.planes import Plane
from tests.physics.plane_equations import stable_values

DT = 0.1
FROM_MIDDLE_S = (0.0, -600.0, 600.0, 0.0)  # of records by their seeds
LEAD = 50  # rows of inputs before the maneuver
SENSING = Sensing(dvl_x_m=0.4, dvl_y_m=0.05, dvl_z_m=0.1, dvl_mounting_yaw_rad=0.02, noise_std={})
COURSE = np.array([True, True, True, False])  # the heading is taken as logged
FREELY = np.ones(4, dtype=bool)
COEFFICIENTS = ("X_uu", "X_vr", "T_nn", "Y_uv", "Y_uud", "N_ur", "N_uud", "N_r|r|", "Y_vdot")
HEADING = 0.8  # of the vertical plane, about which it yaws


@dataclass(frozen=True)
class World:
    """A frame with a parameter vector; `shown` has the effects as an engineer reads them."""

    frame: Frame
    p: np.ndarray

    @classmethod
    def of(
        cls, shown: dict[str, float], sensing: Sensing = SENSING, plane: Plane = "horizontal"
    ) -> "World":
        effects = tuple(e for e in BY_ID if any(name.startswith(f"{e}.") for name in shown))
        structure = structure_of(plane, effects)
        values = stable_values(plane)
        values |= {name: parameter_of(name).internal(v) for name, v in shown.items()}
        p = np.array([values.get(name, 0.0) for name in structure.parameters])
        return cls(Frame(structure, sensing, DT), p)

    @property
    def plane(self) -> Plane:
        return self.frame.structure.plane

    def index(self, name: str) -> int:
        return self.frame.structure.index(name)

    def without(self) -> "World":
        """The same vehicle with every effect at zero."""
        p = self.p.copy()
        p[[i for i, n in enumerate(self.frame.structure.parameters) if "." in n]] = 0.0
        return replace(self, p=p)

    def free(self, names) -> Free:
        """These parameters, with priors of a tenth of a coefficient or those of the table."""
        positions = np.array([self.index(n) for n in names], dtype=np.int64)
        column = np.full(len(self.p), -1, dtype=np.int64)
        column[positions] = np.arange(len(positions))
        scale = [
            parameter_of(n).prior * size_unit(n) if "." in n else 0.1 * abs(self.p[self.index(n)])
            for n in names
        ]
        return Free(positions, column, np.array(scale))

    def every_effect(self) -> list[str]:
        """Names of the parameters of the effects that have a prior."""
        names = self.frame.structure.parameters
        return [n for n in names if "." in n and parameter_of(n).prior > 0.0]


def size_unit(name: str) -> float:
    """Unit of a force effect for a vehicle of 1.6 m at 1.4 m/s and 16 rev/s."""
    return parameter_of(name).size_unit(1025.0, 1.6, 1.4, 16.0)


def commands(n: int, seed: int = 0) -> np.ndarray:
    """Helms of both signs and sizes, each held for some seconds, and two thrust steps."""
    rng = np.random.default_rng(seed)
    held = rng.uniform(0.05, 0.3, n // 25 + 1) * (-1.0) ** np.arange(n // 25 + 1)
    own = np.repeat(held, 25)[:n]
    rate = np.where((np.arange(n) // (n // 3)) % 2 == 0, 17.0, 13.0)
    return np.column_stack([own, np.full(n, 0.02), rate])


def blank(n: int = 300, seed: int = 0, start=(1.4, 0.02, 0.01, 0.5)) -> Record:
    """A record with inputs and a start, as read at the sensors, but nothing measured yet."""
    raw = commands(LEAD + n, seed)
    time = DT * np.arange(LEAD + n)
    waves = [np.sin(w * time + w) for w in (0.7, 0.9, 1.1, 1.3)]
    source = Source(
        raw=raw,
        elapsed_s=200.0 + time,
        speed=1.4 + 0.05 * waves[0],
        roll=0.1 * waves[1],
        pitch=0.05 * waves[2],
        rates=0.05 * np.column_stack([waves[1], waves[3]])[LEAD:],
        bridged=np.tile(start, (n, 1)),
        start=np.array(start),
        from_middle_s=DT * (np.arange(n) - 0.4 * n) + FROM_MIDDLE_S[seed % len(FROM_MIDDLE_S)],
        depth=5.0 + 2.0 * seed + 0.1 * time + waves[3],
        heading=HEADING + 1.6 * seed + 0.1 * waves[1][LEAD:],
    )
    given = np.tile(np.array(start), (n, 1))
    return Record(
        f"record-{seed}", time[LEAD:], raw[LEAD:].copy(), given, given.copy(), given[0], source
    )


def recorded(world: World, n: int = 300, seed: int = 0, noise=(0.0, 0.0, 0.0, 0.0)) -> Record:
    """A record as the sensors of a world give it, heading integrated."""
    start = (1.4, 0.02, 0.01, 0.5 if world.plane == "horizontal" else 0.05)
    bare = blank(n, seed, start)
    read = predicted_course(world.frame, world.p, bare, FREELY).readings
    read = read + np.random.default_rng(100 + seed).normal(size=read.shape) * noise
    inverse = np.linalg.inv(sensor_of(world))
    assert bare.source is not None
    source = replace(bare.source, bridged=read.copy(), start=read[0].copy())
    return replace(
        bare, measured=read, given=read @ inverse.T, start=inverse @ read[0], source=source
    )


def sensor_of(world: World) -> np.ndarray:
    """Reading = matrix @ state, without effects."""
    from auvident.physics.sensing import sensor_matrix

    return sensor_matrix(world.plane, world.frame.sensing)


NOISE = np.array([0.005, 0.005, 0.001, 0.001])  # of the sensors


def setup_for(world: World, records, names, kind: str = "ekf", engine: str = "compiled") -> Setup:
    """An identification of some parameters that begins with every effect off.

    Coefficients have a prior of a tenth about their true values, off by half of it to both sides.
    """
    free, p = world.free(names), world.p.copy()
    for k, name in enumerate(names):
        at = world.index(name)
        p[at] = 0.0 if "." in name else p[at] + 0.5 * (-1.0) ** k * free.scale[k]
    std = np.zeros(len(p))
    std[free.positions] = free.scale
    stage = {"name": "all", "system": "coupled", "free": ["all"], "maneuvers": ["zigzag"]}
    return Setup(
        structure=world.frame.structure,
        plan=Plan.model_validate({"name": "t", "stage": [stage]}),
        records={r.id: ("zigzag", r) for r in records},
        dt_s=DT,
        sensing=world.frame.sensing,
        sensor_std=NOISE,
        prior=p,
        prior_std=std,
        followers=np.zeros((0, 2), dtype=np.int64),
        filter=kind,
        engine=engine,
        start=p,
    )


def integrated(
    rates: Callable[[np.ndarray, np.ndarray], np.ndarray], x0: np.ndarray, inputs: np.ndarray
) -> np.ndarray:
    """States under step inputs: scipy's DOP853, restarted where the inputs step."""
    states = [x0]
    for held in inputs[:-1]:
        step = solve_ivp(
            lambda t, x, held=held: rates(x, held),
            (0, DT),
            states[-1],
            method="DOP853",
            rtol=1e-11,
            atol=1e-12,
        )
        states.append(step.y[:, -1])
    return np.array(states)
