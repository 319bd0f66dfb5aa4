"""Effects that look like each other, and what tells them apart."""

from collections.abc import Iterable

from auvident.schema.effects import BY_ID, EFFECTS, LIKENESSES

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
