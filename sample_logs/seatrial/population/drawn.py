"""From a seed to a vehicle, its equipment, its day and its vehicle file; and to a log folder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from seatrial import helm
from seatrial.actuators import Servo
from seatrial.helm import Gains
from seatrial.logs import write_logs
from seatrial.plant import propeller, workspace
from seatrial.planting import fin_servo, motor_drive, plant_effects
from seatrial.population.checks import check
from seatrial.population.checks_vertical import check_vertical, out_of_trim
from seatrial.population.equipment import Equipment, draw_equipment, jittered
from seatrial.population.form import SWAY_SHARE, YAW_SHARE, Refused, Size, draw_form
from seatrial.population.schedule import draw_day, gains_for
from seatrial.population.schedule_vertical import draw_vertical_day
from seatrial.population.sizes import OUTSIDE_OF, SINGLES_OF, Scales, draw_sizes
from seatrial.population.stated import draw_stated, mistaken_ballast, write_stated
from seatrial.sensors import drifted, measure_all
from seatrial.simulate import STEP_S, Drive, Sea, run, start_state
from seatrial.trial import make_sea, maneuver_list, stream, truth_effects
from seatrial.vehicles import Vehicle

ATTEMPTS = 60
NEEDED_UPRIGHT = {"attitude", "depth"}  # sensors of every log of the vertical plane
KINDS = {"none": 0.4, "single": 0.42, "pair": 0.12, "outside": 0.06}
KINDS_OF = {
    "horizontal": KINDS,
    "vertical": {"none": 40 / 140, "single": 70 / 140, "pair": 20 / 140, "outside": 10 / 140},
}
CLASSES = (
    "small slow",
    "slender",
    "bluff",
    "with sail",
    "linear damping",
    "cross-flow",
    "unstable",
    "lively in roll",
    "stiff in pitch",
    "out of trim",
    "plain",
)
SLOW_M, SLOW_MPS, SLENDER, BLUFF = 1.6, 1.1, 8.0, 5.5
LINEAR_SHARE, CROSS_FLOW, LIVELY_DEG = 0.4, 0.9, 8.0
LEAST_SUBMERGED = 0.4  # of the working depth, the usual depth of a trial
STIFF, TRIM_DEG = 1.0, 2.5  # pitch per elevator angle; elevator that keeps the depth
DAMPED = {"horizontal": (0, 3), "vertical": (1, 2)}  # rows of the damping of a plane


@dataclass(frozen=True)
class Sailed:
    """A record, what drove it, and when its legs began [s]."""

    record: np.ndarray
    starts: np.ndarray
    noise: np.ndarray
    sea: Sea


@dataclass(frozen=True)
class Drawn:
    """A trial before it is sailed.

    stated : tables of the vehicle file
    facts : of the check before the trial (`seatrial.population.checks.check`)
    refused : reasons why earlier draws of this seed were no vehicles
    """

    seed: int
    vehicle: Vehicle
    size: Size
    gains: Gains
    equipment: Equipment
    legs: np.ndarray
    notes: list
    stated: dict
    facts: dict
    refused: tuple[str, ...]
    kind: str
    planted: dict
    plane: str = "horizontal"

    @property
    def plant(self):
        """Hydrodynamic truth."""
        return self.vehicle.plant

    def stream(self, name: str) -> np.random.Generator:
        """Random stream of one purpose."""
        return stream(self.seed, f"population {name}")

    def rudder(self, planted: dict) -> Servo:
        """The rudder servo with its faults, drawn and planted."""
        return with_faults(self.equipment.rudder, fin_servo("rudder", planted))

    def elevator(self, planted: dict) -> Servo:
        """The elevator servo with its faults, drawn and planted."""
        return with_faults(self.equipment.elevator, fin_servo("elevator", planted))

    def drive(self, planted: dict) -> Drive:
        """The motor with its faults, drawn and planted."""
        return with_faults(self.equipment.drive, motor_drive(planted))

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The classes by which results are reported; a vehicle may be in several."""
        size, fineness = self.size, self.size.length / self.size.diameter
        member = {
            "small slow": size.length < SLOW_M and size.speed < SLOW_MPS,
            "slender": fineness > SLENDER,
            "bluff": fineness < BLUFF,
            "with sail": self.plant.sail_slope > 0.0,
            "linear damping": max(self.damping_shares(0)) > LINEAR_SHARE,
            "cross-flow": self.plant.cross_flow > CROSS_FLOW,
            "unstable": self.facts.get("vertical_index", self.facts["index"]) > 0.0,
            "lively in roll": self.facts["heel_deg"] > LIVELY_DEG,
            "stiff in pitch": self.facts.get("pitch_per_elevator", STIFF) < STIFF,
            "out of trim": abs(self.facts.get("trim_deg", 0.0)) > TRIM_DEG,
        }
        return tuple(name for name, is_one in member.items() if is_one) or ("plain",)

    def damping_shares(self, order: int) -> tuple[float, float]:
        """Share of the linear (0), quadratic (1) or cubic (2) part of the damping of the plane.

        Of sway and yaw, or of heave and pitch.
        """
        at = SWAY_SHARE * self.size.speed, YAW_SHARE / self.size.time
        rows = [self.plant.damping[k] for k in DAMPED[self.plane]]
        parts = [[q * x**k for k, q in enumerate(row, 1)] for row, x in zip(rows, at, strict=True)]
        sway, yaw = (p[order] / sum(p) if sum(p) else 0.0 for p in parts)
        return float(sway), float(yaw)

    def sail(self) -> Sailed:
        """Run the trial."""
        rng = self.stream("sea")
        radius, heading = self.vehicle.body.radius, rng.uniform(-np.pi, np.pi)
        sea = self._sea(rng)
        noise = rng.normal(size=(int(longest_s(self.legs) / STEP_S), 9))
        record, starts = run(
            self.legs,
            start_state(0.97 * radius, heading),
            self.vehicle.body,
            plant_effects(self.planted),
            self.rudder(self.planted),
            self.elevator(self.planted),
            self.drive(self.planted),
            sea,
            self.gains,
            noise,
            workspace(),
        )
        if not np.isfinite(record).all() or np.abs(record[:, 9]).max() > 1.5:
            raise FloatingPointError(f"seed {self.seed}: the vehicle went out of bounds or over")
        if np.median(record[:, 8]) < LEAST_SUBMERGED * np.nanmedian(self.legs[:, helm.DEPTH]):
            raise FloatingPointError(f"seed {self.seed}: the vehicle did not come down")
        return Sailed(drifted(record, self.planted), starts, noise[: record.shape[0]], sea)

    def _sea(self, rng: np.random.Generator) -> Sea:
        """Sea of the trial; surface waves by weight, that no lively vehicle is turned over."""
        weight, z_g = self.vehicle.body.weight, self.vehicle.body.z_g
        size = np.array([0.007, 0.013, 0.02, 0.0, 0.0, 0.002 * self.size.length]) * weight
        size[3:5] = np.array([0.04, 0.1]) * weight * z_g
        force = size * rng.uniform(0.3, 1.0, (3, 6))
        sea = make_sea(
            self.vehicle, self.planted, self.legs, self.notes, rng, self.plane == "vertical"
        )
        return sea._replace(surface_force=force)

    def measure(self, sailed: Sailed) -> dict:
        """All sensors that the vehicle has."""
        measured = measure_all(
            sailed.record, self.vehicle, self.planted, self.stream, self.equipment.noise
        )
        return jittered(measured, self.equipment, self.stream)

    def write(self, sailed: Sailed, log: Path, vehicle_file: Path) -> None:
        """Write the log folder and the vehicle file."""
        measured, signs = self.measure(sailed), self.stated["signs"]
        tail = str(self.stream("tail").choice(["attitude", "depth", "position", "none"]))
        write_logs(measured, signs, self.origin, log, self.stream, tail)
        write_stated(self.stated, vehicle_file)

    @cached_property
    def origin(self) -> float:
        """Time of the log clock at the start of the record [s]."""
        return float(np.round(self.stream("origin").uniform(0, 900), 1))

    def truth(self, sailed: Sailed) -> dict:
        """What happened: facts of the vehicle, maneuvers on the log clock, effects."""
        maneuvers = maneuver_list(self.legs, sailed.starts, self.notes, self.origin)
        return {
            "seed": self.seed,
            "plane": self.plane,
            "kind": self.kind,
            "classes": list(self.classes),
            "duration_s": round(sailed.record.shape[0] * STEP_S, 2),
            "size": {
                "length_m": self.size.length,
                "fineness": round(self.size.length / self.size.diameter, 2),
                "speed_mps": self.size.speed,
                "time_s": round(self.size.time, 3),
            },
            "facts": self.facts,
            "refused": list(self.refused),
            "effects": truth_effects(self.planted, maneuvers, self.origin),
            "maneuvers": maneuvers,
        }


def with_faults(base, made):
    """`base` with the fields of `made` that are not those of a healthy part."""
    healthy = type(base)()._asdict()
    return base._replace(**{k: v for k, v in made._asdict().items() if v != healthy[k]})


def longest_s(legs: np.ndarray) -> float:
    """The time after which a trial is over whatever happens [s]."""
    longest = np.maximum(legs[:, helm.DURATION], legs[:, helm.LONGEST])
    return float(longest.sum() + 5.0)


def half_of(seed: int) -> str:
    """``tune`` for even seeds, ``report`` for odd ones."""
    return "report" if seed % 2 else "tune"


def draw(
    seed: int,
    short: bool = True,
    planted: tuple[str, ...] | None = None,
    plane: str = "horizontal",
    times: float = 1.0,
) -> Drawn:
    """A new vehicle and its trial.

    Parameters
    ----------
    seed : everything hangs on it
    short : about ten minutes, longer where L/U is large; else 10 to 60
    planted : ids of effects instead of those that the seed draws
    plane : in which it maneuvers, "horizontal" or "vertical"
    times : sizes of what is planted, in those that the seed draws
    """
    upright = plane == "vertical"
    refused: list[str] = []
    for attempt in range(ATTEMPTS):
        rng = stream(seed, f"population vehicle {attempt}")
        try:
            vehicle, size, keys = draw_form(rng)
            gains = gains_for(size, rng)
            facts = check(vehicle, size, gains)
            if upright:
                vehicle = out_of_trim(vehicle, size, stream(seed, f"population trim {attempt}"))
                more, gains = check_vertical(vehicle, size, gains)
                facts |= more
            break
        except Refused as reason:
            refused.append(str(reason))
    else:
        raise Refused(f"seed {seed}: no vehicle in {ATTEMPTS} draws")
    equipment = draw_equipment(size, stream(seed, "population equipment"))
    rpm, day = vehicle.plant.cruise_rpm, stream(seed, "population schedule")
    if upright:
        legs, notes = draw_vertical_day(size, rpm, facts, short, day)
        equipment = replace(equipment, missing=tuple({*equipment.missing} - NEEDED_UPRIGHT))
    else:
        legs, notes = draw_day(size, rpm, facts["rate_per_rudder"], short, day)
    stated = draw_stated(vehicle, size, keys, equipment, stream(seed, "population stated"))
    if upright:
        rngs = (stream(seed, f"population {name}") for name in ("ballast", "ballast known"))
        stated |= mistaken_ballast(vehicle, stated, *rngs)
    rng = stream(seed, "population effects")
    kind, names = draw_names(rng, plane)
    if planted is not None:
        kind, names = _kind(planted, plane), planted
    seconds = float(legs[:, helm.DURATION].sum())
    depth = float(np.nanmedian(legs[:, helm.DEPTH]))
    scales = Scales(size, rpm / 60.0, thrust_at_speed(vehicle, size), seconds, depth)
    effects = draw_sizes(names, scales, rng, plane, times)
    drawn = (vehicle, size, gains, equipment, legs, notes, stated, facts, tuple(refused))
    return Drawn(seed, *drawn, kind, effects, plane)


def thrust_at_speed(vehicle: Vehicle, size: Size) -> float:
    """Thrust on the hull [N] at the design speed, which is the drag there."""
    thrust, _ = propeller(size.speed, vehicle.plant.cruise_rpm / 60.0, vehicle.body)
    return float(thrust)


def kind_of(seed: int, planted: tuple[str, ...] | None = None, plane: str = "horizontal") -> str:
    """Kind of a trial, without its vehicle: what is planted is drawn from a stream of its own."""
    if planted is not None:
        return _kind(planted, plane)
    return draw_names(stream(seed, "population effects"), plane)[0]


def draw_names(rng: np.random.Generator, plane: str = "horizontal") -> tuple[str, tuple[str, ...]]:
    """Kind of the trial and the effects planted in it."""
    kinds = KINDS_OF[plane]
    kind = str(rng.choice(list(kinds), p=list(kinds.values())))
    number = {"none": 0, "single": 1, "pair": 2, "outside": 1}[kind]
    among = (OUTSIDE_OF if kind == "outside" else SINGLES_OF)[plane]
    chosen = rng.choice(among, number, replace=False)
    return kind, tuple(str(name) for name in chosen)


def _kind(planted: tuple[str, ...], plane: str) -> str:
    if not planted:
        return "none"
    if len(planted) > 1:
        return "pair"
    return "outside" if planted[0] in OUTSIDE_OF[plane] else "single"
