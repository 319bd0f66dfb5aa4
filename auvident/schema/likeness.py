"""Effects that look like each other, and what tells them apart."""

from collections.abc import Iterable, Sequence

from auvident.schema.effects import BY_ID, BY_MANEUVERS, EFFECTS, parts_of
from auvident.schema.planes import Plane

TELLS_MOST = (
    "straight runs on opposite headings, turning circles to both sides and zigzags of two sizes"
)
TELLS_MOST_VERTICAL = "level runs and depth steps at two speeds, and vertical zigzags of two sizes"


def alike(effect: str) -> tuple[str, ...]:
    """Effects that look like one in some plane, itself among them, in the order of the table."""
    group, planes = BY_ID[effect].alike, set(BY_ID[effect].planes)
    return tuple(e.id for e in EFFECTS if group and e.alike == group and planes & set(e.planes))


def partners(effect: str) -> tuple[str, ...]:
    """Effects that look like one."""
    return tuple(other for other in alike(effect) if other != effect)


def nested(group: Sequence[str]) -> bool:
    """Whether the effect named is a special case of all others of its group."""
    named, *others = group
    return all(any(named in parts for parts in parts_of(other)) for other in others)


def separated_by(ids: Iterable[str], plane: Plane = "horizontal") -> str:
    """The maneuvers of a plane that would tell effects apart."""
    groups = [BY_ID[e].alike for e in ids]
    for group, maneuvers in BY_MANEUVERS[plane].items():
        if groups.count(group) >= 2:
            return maneuvers
    return TELLS_MOST if plane == "horizontal" else TELLS_MOST_VERTICAL
