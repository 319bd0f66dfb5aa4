"""Effects that look like each other, and what tells them apart."""

from collections.abc import Iterable

from auvident.schema.effects import BY_ID, EFFECTS

# Effects that are special cases of each other or look alike in most maneuvers: the name of the
# group, and the maneuvers that tell its members apart.
LIKENESSES: dict[str, str] = {
    "turns amidships": "coast-downs and thrust steps with the rudder amidships",
    "late": "zigzags of two sizes (10/10 and 20/20), logged at 10 Hz or faster",
    "small helms": "zigzags of 5 degrees or less, and turning circles entered from both sides",
    "large helms": "turning circles of 25 degrees or more, and turning circles with a thrust step",
    "falling thrust": "straight runs at the same rpm throughout the trial",
    "drag": "straight runs at low and at full speed",
}
TELLS_MOST = (
    "straight runs on opposite headings, turning circles to both sides and zigzags of two sizes"
)


def alike(effect: str) -> tuple[str, ...]:
    """Effects that look like one, itself among them, in the order of the table."""
    group = BY_ID[effect].alike
    return tuple(e.id for e in EFFECTS if group and e.alike == group)


def partners(effect: str) -> tuple[str, ...]:
    """Effects that look like one."""
    return tuple(other for other in alike(effect) if other != effect)


def separated_by(ids: Iterable[str]) -> str:
    """The maneuvers that would tell effects apart."""
    groups = [BY_ID[e].alike for e in ids]
    for group, maneuvers in LIKENESSES.items():
        if groups.count(group) >= 2:
            return maneuvers
    return TELLS_MOST
