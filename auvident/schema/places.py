"""Where the artifacts of a plane stand.

The first plane of a run has the folder of each stage (``identify/model.json``), the other one a
folder of its name in it (``identify/vertical/model.json``).
"""

from collections.abc import Mapping
from typing import Any

from auvident.schema.planes import Plane

BY_PLANE_STAGES = ("identify", "validate", "diagnose", "refine")
BESIDE: Plane = "vertical"  # the plane that may stand beside the first


def beside(name: str) -> str:
    """Place of the artifact of the other plane, from that of the first."""
    stage, _, file = name.partition("/")
    return f"{stage}/{BESIDE}/{file}"


def also_beside(*names: str) -> tuple[str, ...]:
    """Patterns of artifacts with those of the other plane."""
    return tuple(n for name in names for n in _with_beside(name))


def _with_beside(name: str) -> tuple[str, ...]:
    stage, _, file = name.partition("/")
    both = stage in BY_PLANE_STAGES and "*" not in file  # a star stands for folders as well
    return (name, beside(name)) if both else (name,)


def by_plane(outputs: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Outputs of a stage by plane, under the names that the first one has; it has no name here."""
    first = {name: made for name, made in outputs.items() if plane_of(name) is None}
    found: list[tuple[str, dict[str, Any]]] = [("", first)]
    own = {_of_first(n): made for n, made in outputs.items() if plane_of(n)}
    return [*found, (BESIDE, own)] if own else found


def plane_of(name: str) -> Plane | None:
    """The plane in whose folder an artifact stands; None in that of the stage."""
    parts = name.split("/")
    return BESIDE if len(parts) == 3 and parts[1] == BESIDE else None


def _of_first(name: str) -> str:
    stage, _, file = name.split("/")
    return f"{stage}/{file}"
