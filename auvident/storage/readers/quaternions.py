"""Angles from logged quaternions, in the frame in which they are logged."""

from collections.abc import Iterable

import numpy as np

ANGLES = ("roll", "pitch", "heading")
# Names of w, x, y, z after the name of the quaternion: as fields, and as elements.
SPELLINGS = ((".w", ".x", ".y", ".z"), ("[0]", "[1]", "[2]", "[3]"))
UNIT_WITHIN = 0.01  # of one, the norm of a quaternion that is an attitude


def quaternions_in(
    names: Iterable[str], elements: Iterable[str] = ()
) -> dict[str, tuple[str, ...]]:
    """Quaternions among columns: names of w, x, y, z by the name of the whole.

    Parameters
    ----------
    names : iterable of str
        Columns.
    elements : iterable of str
        Last names of arrays of four that are quaternions, w first.
    """
    known, arrays = list(names), tuple(elements)
    found = {}
    for name in known:
        for spelling in SPELLINGS:
            base = name.removesuffix(spelling[0])
            parts = tuple(base + end for end in spelling)
            by_field = spelling[0] == ".w" or base.rpartition(".")[2] in arrays
            if base != name and by_field and set(parts) <= set(known):
                found[base] = parts
    return found


def angles(w: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> dict[str, np.ndarray]:
    """Roll, pitch and heading about x, y, z (turned in the order z, y, x), rad; NaN where none.

    The frame is that of the quaternion: of a body (forward, starboard, down) in (north, east,
    down) they are those of the program; ROS has (forward, port, up) in (east, north, up).
    """
    w, x, y, z = (np.asarray(a, float) for a in (w, x, y, z))
    norm = np.sqrt(w**2 + x**2 + y**2 + z**2)
    none = ~(np.abs(norm - 1.0) <= UNIT_WITHIN)
    w, x, y, z = (np.where(none, np.nan, a / np.where(none, 1.0, norm)) for a in (w, x, y, z))
    return {
        "roll": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2)),
        "pitch": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
        "heading": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)),
    }
