"""What was planted, in the program's symbols and units."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

DEGREES = 180.0 / math.pi
SPEEDS = np.linspace(-0.25, 0.25, 21)  # m/s, sway in turns and zigzags of both vehicles
RATES = np.linspace(-0.35, 0.35, 21)  # rad/s

Parameters = Mapping[str, Any]


@dataclass(frozen=True)
class Planted:
    """A planted effect as the program would state it.

    ``exact`` is false where the program has no parameter of that very form, so that the values
    only tell how strong it is.
    """

    id: str
    family: str
    parameters: dict[str, float]
    exact: bool = True
    time_s: tuple[float, ...] = ()


# Effects whose parameters are not those of the program by the same name and in the same unit:
# symbol of the program -> from the generator's parameters.
TRANSLATED: dict[str, dict[str, Callable[[Parameters], float]]] = {
    "wave": {
        "omega_radps": lambda p: p["omega_radps"],
        "direction_deg": lambda p: p["direction_rad"] * DEGREES,
    },
    "one_off_event": {"duration_s": lambda p: p["duration_s"]},
    "thrust_step": {"fraction": lambda p: p["fraction"]},  # its time: log_time_s of the truth
    "sway_cross_flow": {
        "Y_v|r|": lambda p: p["factor"] * p["strips"]["Y_v|r|"],
        "Y_r|v|": lambda p: p["factor"] * p["strips"]["Y_r|v|"],
    },
    "yaw_cross_flow": {
        "N_v|r|": lambda p: p["factor"] * p["strips"]["N_v|r|"],
        "N_r|v|": lambda p: p["factor"] * p["strips"]["N_r|v|"],
    },
    "heave_cross_flow": {
        "Z_w|q|": lambda p: p["factor"] * p["strips"]["Z_w|q|"],
        "Z_q|w|": lambda p: p["factor"] * p["strips"]["Z_q|w|"],
    },
    "pitch_cross_flow": {
        "M_w|q|": lambda p: p["factor"] * p["strips"]["M_w|q|"],
        "M_q|w|": lambda p: p["factor"] * p["strips"]["M_q|w|"],
    },
    "weight_change": {
        "weight_n": lambda p: p["weight_n"],
        "moment_nm": lambda p: p["weight_n"] * p["x_m"],
    },
    "buoyancy_gradient": {"gradient_npm": lambda p: p["gradient_npm"]},
    # Extra X_vv and X_rr are coefficients of every model: nothing is left for X_vvu and X_rru.
    "turning_drag": {"X_vvu": lambda p: 0.0, "X_rru": lambda p: 0.0},
}
UPRIGHT_DRAG: dict[str, Callable[[Parameters], float]] = {
    "X_wwu": lambda p: 0.0,
    "X_qqu": lambda p: 0.0,
}
INEXACT = frozenset(
    {
        "one_off_event",
        "sway_cross_flow",
        "yaw_cross_flow",
        "heave_cross_flow",
        "pitch_cross_flow",
        "turning_drag",
    }
)
# Effects that a model with X_vv, Y_v|v|, N_r|r| ... takes up, named by a finding on these.
FINDING_OF = {
    "sway_cross_flow": "cross-flow",
    "yaw_cross_flow": "cross-flow",
    "heave_cross_flow": "cross-flow",
    "pitch_cross_flow": "cross-flow",
    "turning_drag": "turning-drag",
}


def planted_of(truth: Mapping[str, Any], vehicle: Any) -> list[Planted]:
    """Planted effects of a trial's truth; `vehicle` is the generator's, with its spread."""
    from seatrial.effects import PLANTED

    rows = PLANTED[truth.get("plane", "horizontal")]
    found = []
    for effect in truth["effects"]:
        name = effect["id"]
        given = {**effect["parameters"], "strips": cross_flow(vehicle.body)}
        found.append(
            Planted(
                name,
                rows[name].family,
                translate(name, given),
                name not in INEXACT,
                tuple(effect.get("log_time_s", ())),
            )
        )
    return found


def translate(name: str, given: Parameters) -> dict[str, float]:
    """Parameters of one effect by the program's symbols."""
    rules = UPRIGHT_DRAG if "X_ww" in given else TRANSLATED.get(name)
    if rules is None:
        return {k: float(v) for k, v in given.items() if k != "strips"}
    return {symbol: float(rule(given)) for symbol, rule in rules.items()}


def cross_flow(body: Any) -> dict[str, float]:
    """Cross coefficients of the hull's strips, per unit of the planted factor.

    The strip integral over a range of sway and yaw speeds, fitted by v|v|, r|r|, v|r| and r|v|.
    """
    v, r = (grid.ravel() for grid in np.meshgrid(SPEEDS, RATES))
    side = v[:, None] + r[:, None] * body.strip_x
    load = -0.5 * body.density * body.cross_flow * body.strip_area * np.abs(side) * side
    terms = np.column_stack([v * np.abs(v), r * np.abs(r), v * np.abs(r), r * np.abs(v)])
    force = np.column_stack([load.sum(1), (load * body.strip_x).sum(1)])
    fitted = np.linalg.lstsq(terms, force, rcond=None)[0]
    names = [("Y_v|r|", "Y_r|v|"), ("N_v|r|", "N_r|v|"), ("Z_w|q|", "Z_q|w|"), ("M_w|q|", "M_q|w|")]
    # heave and pitch: w - q x flows past the strips, and a force down ahead lowers the bow
    signs = [(1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)]
    return {
        symbol: float(sign * fitted[2 + term, axis % 2])
        for axis, pair in enumerate(zip(names, signs, strict=True))
        for term, (symbol, sign) in enumerate(zip(*pair, strict=True))
    }
