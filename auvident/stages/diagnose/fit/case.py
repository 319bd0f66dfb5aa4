"""What a diagnosis works on: the identifying maneuvers, and a prediction with every effect.

Only maneuvers that identify are here; readings in the held-out ones are blanked before anything
is looked at, so that they cannot choose.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from auvident.engines.records import HEADING, NORTH, Record, in_one_frame
from auvident.engines.setup import Setup
from auvident.physics.terms import FREE_FORCE, LINEAR_DRAG, parameter_vector, structure_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.coefficients import expand
from auvident.schema.effects import BY_ID, Effect, EffectParameter, in_plane, parameter_of
from auvident.schema.planes import BY_PLANE, STATE_COLUMNS, PlaneRow
from auvident.stages.diagnose.checks.kinematics import SensorCheck

Array = npt.NDArray[Any]

# The angle is taken as logged: the heading turns no force, and the pitch turns weight and buoyancy
# by what they are, not by what a model that lacks something makes of it.
ACTIVE = np.array([True, True, True, False])
NUISANCE_REACH = 2.0  # a nuisance parameter reaches this many of its standard deviations
FREE_GROUPS = ("drag", "thrust", "turning_drag", "lift", "cross_flow", "control", "restoring")
# The friction line falls with the Reynolds number, C_F ~ Re^-0.17 about 1e6 (ITTC 1957), so that
# friction grows a little slower than u^2: the same as this share of it in proportion to u.
FRICTION_SLOPE = 0.17
FRICTION_UNSURE = 0.5  # of it: how much of a drag is friction is known no better
# A change of an input is known to the step of the grid in which it falls, not where in it: a delay
# or lag below this share of a step is none. At 1 Hz `harbour_trial` showed one of -0.14 s.
STEP_UNSURE = 0.5
LEAST_SPEED_MPS, LEAST_RATE_RPS = 0.1, 0.1  # by which sizes are told of a vehicle at rest
FREE_SIZE = (0.005, 0.005, 0.002)  # prior of a free force on X, A, B [density/2 L^2 U^2, N: L^3]


@dataclass(frozen=True)
class Case:
    """Data, prediction and priors of a diagnosis.

    Attributes
    ----------
    setup : Setup
        Of the identification, with every effect of the plane in its structure; `prior_std`
        holds the prior of every effect.
    records : tuple of Record
    kinds : dict of str to str
        Kind of each record by its id.
    identified : (n_parameters,) array
        The identified model, effects off.
    checks : tuple of SensorCheck
        What sensors say about each other without dynamics.
    nuisance_std : (n_parameters,) array
        Standard deviation of the nuisance parameters; zero for the others.
    low, high : (n_parameters,) array
        Physical bounds.
    """

    setup: Setup
    records: tuple[Record, ...]
    kinds: Mapping[str, str]
    identified: Array
    checks: tuple[SensorCheck, ...]
    nuisance_std: Array
    low: Array
    high: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.setup.structure.parameters

    @property
    def plane(self) -> PlaneRow:
        """The plane of motion."""
        return BY_PLANE[self.setup.structure.plane]

    @property
    def channels(self) -> tuple[str, ...]:
        """Symbols of what is predicted and compared."""
        return self.plane.velocities

    def position(self, name: str) -> int:
        """Position of a parameter."""
        return self.setup.structure.index(name)

    def positions(self, *effects: str) -> list[int]:
        """Positions of the parameters of effects that are estimated."""
        return [i for effect in effects for i in self._own(effect)]

    def practical(self, positions: Sequence[int]) -> Array:
        """Sizes (k,) from which on parameters matter, in standard deviations of their priors."""
        declared = [parameter_of(self.names[i]) for i in positions]
        sizes = np.array([d.practical / d.prior for d in declared])
        steps = STEP_UNSURE * self.setup.dt_s / self.setup.prior_std[list(positions)]
        times = np.array([d.unit == "s" for d in declared])
        return np.where(times & (sizes > 0.0), np.maximum(sizes, steps), sizes)

    def _own(self, effect: str) -> list[int]:
        if effect.startswith(FREE_FORCE):
            return [i for i, name in enumerate(self.names) if name.startswith(FREE_FORCE)]
        found = [self.position(name) for name in BY_ID[effect].names(self.setup.structure.plane)]
        return [i for i in found if self.setup.prior_std[i] > 0.0]

    def with_baseline(self, effects: Sequence[str]) -> npt.NDArray[np.int64]:
        """Positions of all that a fit with effects frees, in order."""
        return in_order(self.baseline(), self.positions(*effects))

    def baseline(self) -> list[int]:
        """Positions that every fit frees: coefficients and nuisance parameters.

        Inertias stay: scaling an equation, or mixing the two lateral ones, changes no
        prediction, so that the other coefficients reach every model without them.
        """
        symbols = expand(FREE_GROUPS, self.setup.structure.plane)
        free = [self.position(s) for s in symbols]
        free = [i for i in free if self.setup.prior_std[i] > 0.0]
        return free + [int(i) for i in np.flatnonzero(self.nuisance_std > 0.0)]

    def at_rest(self, p: Array) -> Array:
        """Parameters with every nuisance parameter of one sign at a typical size."""
        q, nuisance = p.copy(), self.nuisance_std > 0.0
        one_sided = nuisance & (self.low == 0.0)
        q[one_sided] = self.nuisance_std[one_sided]
        expected = nuisance & (self.setup.prior != 0.0)
        q[expected] = self.setup.prior[expected]
        return q

    def masked(self, windows: Sequence[tuple[str, float, float]]) -> "Case":
        """The case without the readings in windows (maneuver, start, end) [s]."""
        records = []
        for record in self.records:
            measured = record.measured.copy()
            for name, start, end in windows:
                if name == record.id:
                    measured[(record.time_s >= start) & (record.time_s <= end)] = np.nan
            records.append(replace(record, measured=measured))
        return replace(self, records=tuple(records))

    def with_free_force(self, series: Mapping[str, Array]) -> "Case":
        """The case with a force series (n, 3) in each record, by its id."""
        records = tuple(
            replace(r, source=replace(r.source, free_force=series[r.id]))  # type: ignore[type-var]
            for r in self.records
        )
        return replace(self, records=records)


def in_order(*positions: Sequence[int] | Array) -> npt.NDArray[np.int64]:
    """Positions of all of these, each once."""
    return np.array(sorted({int(i) for some in positions for i in some}), dtype=np.int64)


def testable(setup: Setup, records: Sequence[Record]) -> tuple[list[Effect], list[str]]:
    """Effects that the logs allow to test, and the columns whose absence hides others."""
    there, missing, plane = [], [], setup.structure.plane
    for effect in in_plane(plane):
        logged = partial(_is_logged, records=records, states=STATE_COLUMNS[plane])
        lacking = [c for c in effect.needs if not logged(c)]
        if lacking == [HEADING] and effect.by_rate and in_one_frame(_frames(records)):
            lacking = []
        missing += lacking
        if not lacking:
            there.append(effect)
    return there, list(dict.fromkeys(missing))


def _frames(records: Sequence[Record]) -> set[str]:
    """What the headings of records count from."""
    return {r.source.frame for r in records if r.source is not None}


def counted_from(records: Sequence[Record]) -> Literal["north", "bow"]:
    """What the directions of a case count from."""
    return "north" if _frames(records) <= {NORTH} else "bow"


RATES = ("p_radps", "q_radps")  # columns of `Source.rates`


def _is_logged(column: str, records: Sequence[Record], states: Sequence[str]) -> bool:
    source = [r.source for r in records if r.source is not None]
    if column in states:
        return any(np.isfinite(r.measured[:, states.index(column)]).any() for r in records)
    series = {
        "roll_rad": "roll",
        "pitch_rad": "pitch",
        "depth_m": "depth",
        "heading_rad": "heading",
    }
    if column in series:
        return any(np.any(getattr(s, series[column])) for s in source)
    if column in RATES:
        return any(np.any(s.rates[:, RATES.index(column)]) for s in source)
    return True  # position logs are looked for by the checks that use them


def case_of(
    setup: Setup,
    model: IdentifiedModel,
    checks: Sequence[SensorCheck],
    stated: Collection[str] = (),
) -> Case:
    """The case of an identification and its model.

    Parameters
    ----------
    setup : Setup
        As `stages.identify.prepare` makes it.
    model : IdentifiedModel
    checks : sequence of SensorCheck
    stated : collection of str
        Parameters that deviate from what the vehicle file states.
    """
    plane = setup.structure.plane
    structure = structure_of(plane, (*(e.id for e in in_plane(plane)), FREE_FORCE))
    records = tuple(record for _, record in setup.records.values())
    n, unit = len(structure.parameters), sizes_of(records)
    prior = parameter_vector(plane, _prior_values(setup), model.rigid_body, structure=structure)
    stds, nuisance = np.zeros(n), np.zeros(n)
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    for i, name in enumerate(structure.parameters):
        if name.startswith(FREE_FORCE):
            stds[i] = free_force_size(name, model, unit)
        elif "." in name:
            declared = parameter_of(name)
            scale = size_unit(declared, model, unit)
            stds[i], nuisance[i] = declared.prior * scale, declared.nuisance_std * scale
            if name in stated and declared.stated_std is not None:
                nuisance[i] = declared.stated_std * scale
            low[i], high[i] = declared.low * scale, declared.high * scale
        elif name in setup.structure.parameters:
            stds[i] = setup.prior_std[setup.structure.index(name)]
    friction, at = FRICTION_SLOPE * setup.friction, structure.index(LINEAR_DRAG)
    prior[at] = friction * prior[structure.index("X_uu")] * unit[0]
    nuisance[at] = max(nuisance[at], FRICTION_UNSURE * abs(prior[at]))
    whole = replace(setup, structure=structure, prior=prior, prior_std=stds)
    told = (check.of(structure.parameters) for check in checks)
    identified = parameter_vector(plane, model.values(), model.rigid_body, structure=structure)
    kinds = {name: kind for name, (kind, _) in setup.records.items()}
    return Case(whole, records, kinds, identified, tuple(c for c in told if c), nuisance, low, high)


def _prior_values(setup: Setup) -> dict[str, float]:
    return dict(zip(setup.structure.parameters, setup.prior, strict=True))


def sizes_of(records: Sequence[Record]) -> tuple[float, float]:
    """Median speed [m/s] and propeller rate [rev/s] of the maneuvers."""
    speed = float(np.median(np.concatenate([r.given[:, 0] for r in records])))
    rate = float(np.median(np.abs(np.concatenate([r.inputs[:, 2] for r in records]))))
    return max(speed, LEAST_SPEED_MPS), max(rate, LEAST_RATE_RPS)


def size_unit(
    declared: EffectParameter, model: IdentifiedModel, unit: tuple[float, float]
) -> float:
    """What the sizes of a parameter are multiplied by for a vehicle."""
    return declared.size_unit(model.density_kgpm3, model.length_m, *unit)


def free_force_size(name: str, model: IdentifiedModel, unit: tuple[float, float]) -> float:
    """Prior of a free force or moment per unit of its series [N, N m]."""
    equation = "XAB".index(name[-1])
    area = model.length_m ** (3 if equation == 2 else 2)
    return FREE_SIZE[equation] * 0.5 * model.density_kgpm3 * area * unit[0] ** 2
