"""What stands beside the errors of held-out maneuvers: why these, and what they go beyond."""

from collections.abc import Mapping, Sequence
from typing import Any

from auvident.report.numbers import PAGE
from auvident.schema.artifacts import Extrapolation, Maneuver

WORDS = {
    "rudder": "of rudder",
    "elevator": "of elevator",
    "u": "of speed",
    "v": "of sway velocity",
    "w": "of heave velocity",
    "r": "of yaw rate",
    "q": "of pitch rate",
}
DIGITS = 2
OTHER_PLANES = (
    "The runs are of different planes: they share drag and thrust, but X_uudd is the drag of the "
    "rudder in one and of the elevator in the other."
)
OTHERS_HELD_OUT = "The runs hold out different maneuvers: their errors compare only roughly."


def doubts_of(comparison: Mapping[str, Any]) -> list[str]:
    """What runs side by side differ in, so that their numbers compare only roughly or not."""
    hulls = (f"{run['vehicle']} ({run['length_m']:.4g} m)" for run in comparison["runs"])
    vehicles = list(dict.fromkeys(hulls))
    lines = [f"The runs are of different vehicles: {', '.join(vehicles)}."]
    sets = {tuple(run["held_out"]) for run in comparison["runs"] if run["held_out"]}
    planes = {run.get("plane") for run in comparison["runs"]}
    lines = lines * (len(vehicles) > 1) + [OTHER_PLANES] * (len(planes) > 1)
    lines += [OTHERS_HELD_OUT] * (len(sets) > 1)
    return lines + [run["outdated"] for run in comparison["runs"] if run.get("outdated")]


def why_held_out(maneuvers: Sequence[Maneuver]) -> list[str]:
    """One line for each held-out maneuver that says why it is held out."""
    return [f"{m.id} is held out: {m.reason}" for m in maneuvers if m.reason]


def beyond(found: Mapping[str, Mapping[str, Extrapolation]]) -> list[str]:
    """One line for each motion that leaves the range of the maneuvers that identify."""
    return [
        f"{name} goes beyond the maneuvers used for identification: "
        + ", ".join(_reached(q, e) for q, e in rows.items())
        for name, rows in found.items()
        if rows
    ]


def _reached(quantity: str, e: Extrapolation) -> str:
    """How far it goes by one quantity, and the identifying ones do."""
    told = (PAGE.quantity(x, e.unit, DIGITS) for x in (e.reaches, e.identified))
    value, known = (text.replace(PAGE.space, " ") for text in told)  # for the terminal too
    if quantity == "u_low":
        return f"slows to {value} ({known} there)"
    return f"{value} {WORDS[quantity]} ({known} there)"
