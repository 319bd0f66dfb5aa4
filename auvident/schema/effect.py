"""What is declared of an effect: its parameters with their sizes and units, and where it enters."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from auvident.schema.planes import PLANES, Plane

EffectFamily = Literal["environment", "actuation", "sensing", "hydrodynamics"]
FAMILIES: tuple[EffectFamily, ...] = get_args(EffectFamily)
# where an effect enters: before the equations of motion, in them, after them, or in no model (a
# disturbance of one trial, which is named and masked)
Enters = Literal["input", "force", "reading", "disturbance"]
# how a value is stored: as it is, its inverse (a limit that is infinite without the effect), or
# the inverse of its square
Form = Literal["plain", "inverse", "inverse_square"]

NOTHING = 0.01  # of the practical size: a value below it is as good as no effect


@dataclass(frozen=True)
class TimeGrid:
    """Where a time is looked for that no slope finds, since what it changes is a step.

    Attributes
    ----------
    apart_s, most : float, int
        The first grid, over all maneuvers: so far apart, in a long trial further, so that there
        are no more than `most` and the time of a search grows with the length of the trial.
    reach : tuple of float
        Then about the best one, each time this share of the first distance to both sides.
    fine_s : float
        At last so far apart, between the maneuvers before and after.
    """

    apart_s: float
    most: int
    reach: tuple[float, ...]
    fine_s: float


@dataclass(frozen=True)
class EffectParameter:
    """Declaration of one parameter of an effect.

    Attributes
    ----------
    symbol : str
        Name in the artifacts, unit as suffix.
    unit : str
        Unit in the artifacts.
    prior : float
        Standard deviation of the internal value before the data, in internal units; where there
        are `powers`, in units of these. Zero where it is looked for on a grid: any value is as
        likely.
    practical : float
        Size from which on the effect is worth a word, stated like `prior`.
    low, high : float
        Bounds of the internal value, stated like `prior`.
    factor : float
        Unit conversion: one internal unit is this many of `unit`.
    form : str
    step : float
        Change, in units of the prior, over which a slope is taken; effects that do nothing
        when they are small (play, dead band) need a large one.
    powers : tuple of int
        Sizes and bounds scale with density/2, length, speed and propeller rate to these powers:
        what a delay of a sensor or a lag of a servo does to the motion depends on L/U. The bounds
        are wide: for L/U of 0.4 s a delay may be 2 s.
    nuisance_std : float
        Standard deviation as a nuisance parameter of every model: no real servo is without
        lag and no hull without asymmetry. Zero for most.
    stated_std : float, optional
        The same where the vehicle file states what the parameter deviates from.
    grid : TimeGrid, optional
        Of a time since the start of the trial.
    known_to : float
        Factor to which a size is known at best (95 %), where the equation itself leaves open what
        goes with it. It makes an interval wider to both sides, and never reaches zero.
    width_of : str
        Symbol of the parameter with a grid whose interval it is the width of.
    planes : tuple of str
        Those of its effect's planes in which it stands: a force has the axes of its plane.
    """

    symbol: str
    unit: str
    prior: float
    practical: float
    low: float
    high: float
    factor: float = 1.0
    form: Form = "plain"
    step: float = 0.02
    powers: tuple[int, int, int, int] = (0, 0, 0, 0)
    nuisance_std: float = 0.0
    stated_std: float | None = None
    grid: TimeGrid | None = None
    known_to: float = 1.0
    width_of: str = ""
    planes: tuple[Plane, ...] = PLANES

    def size_unit(
        self, density_kgpm3: float, length_m: float, speed_mps: float, rate_rps: float
    ) -> float:
        """What sizes and bounds are multiplied by for a vehicle (1 for shares and angles)."""
        quantities = (0.5 * density_kgpm3, length_m, speed_mps, rate_rps)
        return math.prod(q**power for q, power in zip(quantities, self.powers, strict=True))

    def is_nothing(self, internal: float) -> bool:
        """Whether a value is too small to be told from no effect at all."""
        return abs(internal) <= NOTHING * self.practical

    def holds_nothing(self, value: float, low: float, high: float) -> bool:
        """Whether an interval as shown cannot be told from no effect at all.

        No effect is an internal value of zero. Of a limit the interval is that of its inverse to
        first order; what has no practical size (a time, a direction) is no size to be told.
        """
        if self.practical <= 0.0:
            return False
        if self.form == "plain":
            return low <= 0.0 <= high
        power = 1.0 if self.form == "inverse" else 0.5
        return 0.5 * (high - low) >= power * value

    def internal(self, shown: float) -> float:
        """Internal value of a value as shown."""
        if self.form == "plain":
            return shown / self.factor
        power = 1.0 if self.form == "inverse" else 2.0
        return (self.factor / shown) ** power

    def shown(self, internal: float, std: float = 0.0) -> tuple[float, float]:
        """Value and standard deviation as shown, from the internal ones.

        A limit that is not reached (internal value zero) is shown as the largest finite number
        of its form: the one at `NOTHING` of the practical size.
        """
        if self.form == "plain":
            return internal * self.factor, std * self.factor
        power = 1.0 if self.form == "inverse" else 0.5
        least = max(internal, NOTHING * self.practical)
        value = self.factor * least**-power
        return value, power * value / least * std

    def reaches(self, value: float, half: float) -> tuple[float, float | None]:
        """Ends of an interval given to first order, as `shown` has it: ``value`` -+ ``half``.

        Of a limit they are those of its inverse; the upper one is None where that may be zero,
        so that there may be no limit at all.
        """
        if self.form == "plain":
            return value - half, value + half
        power = 1.0 if self.form == "inverse" else 0.5
        share = half / (power * value)  # of the inverse
        high = value * (1.0 - share) ** -power if share < 1.0 else None
        return value * (1.0 + share) ** -power, high


@dataclass(frozen=True)
class Effect:
    """Declaration of one effect.

    Attributes
    ----------
    id : str
        Name in every file and table.
    family : str
    enters : str
        Part of the prediction that carries it.
    planes : tuple of str
    parameters : tuple of EffectParameter
    equation : str
        For people.
    signature : str
        How it shows, for people.
    needs : tuple of str
        Columns of the trial without which it cannot be seen or told apart.
    source : str
    words : str
        What a model with it has, for people; fields are its parameters as shown. Where those
        differ, one for each plane.
    alike : str
        Its group of `auvident.schema.likeness`, if it has one.
    parts : tuple of str
        Effects that together do what it does alone; `effects.parts_of` has those of each plane.
    surge_alone : bool
        The surge equation alone can show it.
    curved : bool
        Its signature changes with its size: a fit needs a start of typical size.
    higher_order : bool
        A term of higher order, of which every hull has a little.
    steady : bool
        It shows in a straight run as a drift angle or a turn in proportion to the speed.
    nuisance : bool
        Only ever taken along: no engineer asks for it.
    late : bool
        A sensor shows what was a while ago.
    twin : str
        The same in the other plane, under its own name: of its fin, its gyro, its axes.
    of_trial : bool
        It belongs to a trial (its water, its ballast, its clocks, what a gyro has on a day), not
        to the vehicle: trials that are pooled have it each on its own.
    by_rate : bool
        In the horizontal plane a heading that is summed up from the yaw rate will do.
    shows : tuple of str
        How it shows in each plane, in the order of `PLANES`, where that differs; `signature` is
        of both.
    """

    id: str
    family: EffectFamily
    enters: Enters
    planes: tuple[Plane, ...]
    parameters: tuple[EffectParameter, ...]
    equation: str
    signature: str
    needs: tuple[str, ...] = ()
    source: str = ""
    words: str | tuple[str, ...] = ""
    alike: str = ""
    parts: tuple[str, ...] = ()
    surge_alone: bool = False
    curved: bool = False
    higher_order: bool = False
    steady: bool = False
    nuisance: bool = False
    late: bool = False
    twin: str = ""
    of_trial: bool = False
    by_rate: bool = False
    shows: tuple[str, ...] = ()

    def names(self, plane: Plane | None = None) -> tuple[str, ...]:
        """Names of its parameters in the parameter vector of a plane; without one, of all."""
        stand = (p for p in self.parameters if plane is None or plane in p.planes)
        return tuple(f"{self.id}.{p.symbol}" for p in stand)

    def of_plane(self, plane: Plane | None) -> tuple[tuple[EffectParameter, ...], str]:
        """Parameters that stand in a plane, and how it shows there; without one, of all."""
        if plane is None:
            return self.parameters, self.signature
        stand = tuple(p for p in self.parameters if plane in p.planes)
        return stand, self.shows[PLANES.index(plane)] if self.shows else self.signature

    @property
    def instant(self) -> EffectParameter | None:
        """Its time in the trial, if it has one that is looked for on a grid."""
        return next((p for p in self.parameters if p.grid is not None), None)
