"""Which trials the study of the residual loop sails: effects alone, in pairs, and none at all.

The list has no end and is cut where it is asked to be. It goes in blocks; a block has every effect
of the generator once, a few outside of the program's table, pairs, and trials with nothing planted,
shuffled, so that any beginning of it is a fair sample. A trial keeps its seed whatever is left out.
"""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, count, islice, takewhile
from typing import Any

import numpy as np

from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

from seatrial.effects import EFFECTS, LATER

VEHICLES = ("remus100", "tern180")
SPREAD = 0.1  # of the plant's parameters, so that no two plants are alike
DEVELOPMENT, REPORTED = 1000, 7000  # seed bases
SEEDS = REPORTED - DEVELOPMENT  # a list is no longer, so that the two never meet
LATER_SEEDS = 5000  # from here on those of effects that came later, so that no older one moved
BLOCKS = 4  # of the default list
NONE_A_BLOCK, PAIRS_A_BLOCK, OUTSIDE_A_BLOCK = 10, 7, 4
KINDS = ("single", "none", "pair", "outside")

OUTSIDE = tuple(e.id for e in EFFECTS.values() if e.family == "outside")
SINGLES = tuple(
    e.id
    for e in EFFECTS.values()
    if e.family != "outside" and not e.id.startswith("elevator_") and e.id not in LATER
)
PAIRS = (
    ("current", "rudder_lag"),
    ("rudder_offset", "dvl_misalignment"),
    ("rudder_backlash", "current"),
    ("rudder_lag", "dvl_delay"),
    ("gyro_bias", "rudder_rate_limit"),
    ("hull_asymmetry", "propeller_lag"),
    ("current", "thrust_sag"),
    ("linear_drag", "rudder_asymmetry"),
    ("dvl_misalignment", "current"),
    ("roll_coupling", "gyro_scale"),
    ("rudder_delay", "dvl_lever_arm"),
    ("current", "hull_asymmetry"),
    ("rudder_stall", "linear_drag"),
    ("thrust_step", "dvl_misalignment"),
)


@dataclass(frozen=True)
class Case:
    """One trial to sail."""

    seed: int
    vehicle: str
    kind: str
    planted: tuple[str, ...]

    @property
    def label(self) -> str:
        """Planted ids joined by a plus, or ``none``."""
        return "+".join(self.planted) or "none"

    @property
    def key(self) -> str:
        """Name of the trial; the same in every run."""
        return f"{self.seed}-{self.vehicle}-{self.label}"

    def recipe(self) -> dict[str, Any]:
        """What the generator is asked for; sizes are drawn from the seed."""
        return {
            "name": f"trial_{self.seed}",
            "vehicle": self.vehicle,
            "seed": self.seed,
            "spread": SPREAD,
            "effect": [{"id": name} for name in self.planted],
        }


def cases(
    seed_base: int = DEVELOPMENT,
    trials: int | None = None,
    only: Iterable[str] = (),
    vehicles: Iterable[str] = VEHICLES,
) -> list[Case]:
    """The first `trials` of the list that are wanted; without a number, those of four blocks.

    `only` holds labels (``current``, ``current+rudder_lag``, ``none``) or kinds (`KINDS`).
    """
    wanted, allowed = frozenset(only), frozenset(vehicles)
    first = chain(*([*_block(b, seed_base), *_later(b, seed_base)] for b in range(BLOCKS)))
    whole = endless(seed_base) if trials else first
    chosen = (
        c for c in whole if c.vehicle in allowed and (not wanted or {c.label, c.kind} & wanted)
    )
    return list(islice(chosen, trials) if trials else chosen)


def endless(seed_base: int) -> Iterator[Case]:
    """The whole list, as long as there are seeds of its own."""
    blocks = (_block(number, seed_base) for number in count())
    whole = takewhile(lambda block: block[-1].seed < seed_base + LATER_SEEDS, blocks)
    return chain.from_iterable([*block, *_later(b, seed_base)] for b, block in enumerate(whole))


def _block(number: int, seed_base: int) -> list[Case]:
    """One block in its order, with seeds."""
    members = _members(number)
    order = np.random.default_rng(number).permutation(len(members))
    first = seed_base + number * len(members)
    return [Case(first + i, *members[k]) for i, k in enumerate(order)]


def _later(number: int, seed_base: int) -> list[Case]:
    """Trials of a block with the effects that came later, which move no older seed."""
    first = seed_base + LATER_SEEDS + number * len(LATER)
    return [
        Case(first + i, VEHICLES[(i + number) % len(VEHICLES)], "single", (name,))
        for i, name in enumerate(LATER)
    ]


def _members(number: int) -> list[tuple[str, str, tuple[str, ...]]]:
    """Vehicle, kind and planted ids of a block's trials; vehicles take turns."""
    found: list[tuple[int, str, tuple[str, ...]]] = []
    found += [(i + number, "single", (name,)) for i, name in enumerate(SINGLES)]
    found += [(i, "none", ()) for i in range(NONE_A_BLOCK)]
    for k in _turn(number, PAIRS_A_BLOCK):
        found.append((k + k // len(PAIRS), "pair", PAIRS[k % len(PAIRS)]))
    for k in _turn(number, OUTSIDE_A_BLOCK):
        found.append((k // len(OUTSIDE), "outside", (OUTSIDE[k % len(OUTSIDE)],)))
    return [(VEHICLES[turn % len(VEHICLES)], kind, planted) for turn, kind, planted in found]


def _turn(number: int, size: int) -> range:
    return range(number * size, (number + 1) * size)
