"""Figures of maneuvers flown on the desk: of one model by those of measured maneuvers, of all."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.physics.maneuvers.desk import (
    DEPTH_REACHED,
    DepthHelm,
    DeskFlight,
    StairHelm,
    ZigzagHelm,
)
from auvident.physics.maneuvers.track import first_crossing, integral_of
from auvident.physics.maneuvers.turn import turn_figures
from auvident.physics.maneuvers.zigzag import reversals, zigzag_figures

Array = npt.NDArray[Any]
Figures = dict[str, float]

FEWEST = 3  # rows of a flight that has figures; a model that is drawn may run away at once
RISEN = 0.9  # of the step: what counts as risen
LEAST_LOOP = 0.02  # of the greatest rate: what is smaller is a slow return, no loop


def of_all(flight: DeskFlight, figures: Callable[[DeskFlight, int], Figures]) -> dict[str, Array]:
    """Figures (S,) of every model by name; NaN where a model does not come to one."""
    models = range(flight.states.shape[2])
    found = [figures(flight, s) if rows_of(flight, s).stop >= FEWEST else {} for s in models]
    names = dict.fromkeys(name for row in found for name in row)
    return {name: np.array([row.get(name, np.nan) for row in found]) for name in names}


def rows_of(flight: DeskFlight, s: int) -> slice:
    """Rows of a model until it is through; until it ran away, or all, where it never was."""
    if flight.ends[s] >= 0:
        return slice(0, int(flight.ends[s]) + 1)
    lost = np.flatnonzero(~np.isfinite(flight.states[:, 0, s]))
    return slice(0, int(lost[0]) if lost.size else len(flight.time_s))


def circle_figures(flight: DeskFlight, s: int) -> Figures:
    """Figures of a turning circle, see `maneuvers.turn`; none of a model that never came round."""
    if flight.ends[s] < 0:
        return {}
    rows = rows_of(flight, s)
    u, v, r, heading = flight.states[rows, :, s].T
    return turn_figures(flight.time_s[rows], u, v, r, flight.order[rows, s], heading)


def swing_figures(flight: DeskFlight, s: int) -> Figures:
    """Figures of a zigzag in either plane, see `maneuvers.zigzag`."""
    assert isinstance(flight.helm, ZigzagHelm)
    rows = rows_of(flight, s)
    time, states = flight.time_s[rows], flight.states[rows, :, s]
    angle = states[:, 3] - states[0, 3]
    order = flight.order[rows, s]
    found = zigzag_figures(time, angle, order, 0.0, flight.helm.switch_rad)
    told = {k: v for k, v in found.items() if k not in ("rudder_deg", "executes", "switch_deg")}
    if "initial_turning_time_s" in told:
        gone = integral_of(time, np.hypot(states[:, 0], states[:, 1]))
        there = np.interp(told["initial_turning_time_s"], time, gone)
        told["initial_turning_distance_m"] = float(there)
    return told


def zigzag_with_steering(flight: DeskFlight, s: int) -> Figures:
    """Figures of a zigzag and the K and T of Nomoto's equation that come closest to it."""
    rows = rows_of(flight, s)
    if rows.stop < 10:
        return {}
    steering = nomoto_from(
        flight.time_s[rows],
        flight.states[rows, 2, s],
        flight.states[rows, 3, s],
        flight.side * flight.fin[rows, s],
    )
    return {**swing_figures(flight, s), **steering}


def nomoto_from(time_s: Array, r: Array, heading_rad: Array, order_rad: Array) -> Figures:
    """K and T of T dr/dt + r = K (delta + delta_0), integrated once, by least squares.

    Parameters
    ----------
    time_s, r, heading_rad : (n,) array
    order_rad : (n,) array
        Angle of the fin, positive to starboard [rad].
    """
    laid = integral_of(time_s, order_rad)
    matrix = np.column_stack([r[0] - r, laid, time_s - time_s[0]])
    (lag, gain, _), *_ = np.linalg.lstsq(matrix, heading_rad - heading_rad[0], rcond=None)
    return {"zigzag_gain_ps": float(gain), "zigzag_time_s": float(lag)}


def vertical_swing_figures(flight: DeskFlight, s: int) -> Figures:
    """Figures of a vertical zigzag, with how far the depth goes on after each reversal.

    A small vehicle reverses so fast that the depth may still go the other way for a moment.
    """
    found = swing_figures(flight, s)
    rows = rows_of(flight, s)
    turn = reversals(flight.order[rows, s])
    depth = flight.way[rows, 1, s]
    for k, begin in enumerate(turn.tolist()):
        side = np.sign(flight.states[begin, 3, s] - flight.states[0, 3, s])
        beyond = gone_on(side * (depth[begin] - depth[begin:]))  # bow up: the depth falls
        if beyond is not None:
            found[f"depth_overshoot_{k + 1}_m"] = beyond
    return found


def gone_on(way: Array) -> float | None:
    """How far a way (n,) from zero goes on before it turns back; None where it does not turn."""
    rises = np.diff(way) > 0.0
    back = np.flatnonzero(~rises & np.maximum.accumulate(rises))
    return max(float(way[back[0]]), 0.0) if back.size else None


def depth_figures(flight: DeskFlight, s: int) -> Figures:
    """Figures of a step of the depth; without a settling time where it is not held."""
    assert isinstance(flight.helm, DepthHelm)
    rows, wanted = rows_of(flight, s), flight.helm.depth_m
    if rows.stop < len(flight.time_s) and flight.ends[s] < 0:  # ran away
        return {}
    time, share = flight.time_s[rows], flight.way[rows, 1, s] / wanted
    pitch = flight.states[rows, 3, s] - flight.setting.pitch_rad[s]
    beyond = max(float(share.max()) - 1.0, 0.0)
    steepest = int(np.argmax(np.abs(pitch)))
    fin = flight.side * flight.fin[rows, s]
    found = {
        "depth_overshoot_share": beyond,
        "depth_overshoot_m": beyond * abs(wanted),
        "depth_error_m": float((share[-1] - 1.0) * wanted),
        "greatest_pitch_deg": float(np.degrees(pitch[steepest])),
        "greatest_elevator_deg": float(np.degrees(fin[int(np.argmax(np.abs(fin)))])),
    }
    risen = first_crossing(time, share, RISEN)
    if risen is not None:
        found["rise_time_s"] = risen
    if flight.ends[s] >= 0:
        outside = np.flatnonzero(np.abs(share - 1.0) > DEPTH_REACHED)
        found["settling_time_s"] = float(time[min(int(outside[-1]) + 1, len(time) - 1)])
    return found


def pull_out_figures(flight: DeskFlight, s: int) -> Figures:
    """Rates that remain with the rudder amidships after steady turns to either side."""
    assert isinstance(flight.helm, StairHelm)
    names = ("steady_starboard", "residual_starboard", "steady_port", "residual_port")
    rates = [float(np.degrees(level.states[2, s])) for level in flight.helm.levels]
    found = {f"{n}_degps": r for n, r in zip(names, rates, strict=False)}
    if len(rates) == len(names):
        found["residual_difference_degps"] = rates[1] - rates[3]
    return found


def spiral_figures(flight: DeskFlight, s: int) -> Figures:
    """Height and width of the loop of a spiral, and the rate at its greatest rudder.

    The width is the range of rudder in which the rate to starboard remains on the way to port;
    a loop lower than `LEAST_LOOP` of the greatest rate counts as none.
    """
    orders, down, up = spiral_branches(flight)
    if not len(orders):
        return {}
    a, b, order = down[:, s], up[:, s], np.degrees(orders)
    if not np.isfinite([a, b]).all():
        return {}
    height = float(np.interp(0.0, order, a) - np.interp(0.0, order, b))
    found = {"steady_r_degps": float(np.degrees(a[-1])), "loop_height_degps": 0.0}
    found["loop_width_deg"] = 0.0
    if height > LEAST_LOOP * float(np.abs(a).max()):
        found["loop_height_degps"] = float(np.degrees(height))
        found["loop_width_deg"] = _zero(order, b) - _zero(order, a)
    return found


def _zero(order: Array, rate: Array) -> float:
    """Order at which a rate that rises with it changes its sign."""
    first = int(np.argmax(rate > 0.0))
    if first == 0:
        return float(order[0])
    low, high = rate[first - 1], rate[first]
    return float(order[first - 1] - low / (high - low) * (order[first] - order[first - 1]))


def spiral_branches(flight: DeskFlight) -> tuple[Array, Array, Array]:
    """Orders (m,), rising [rad], and the rates (m, S) of the way down to port and back up."""
    assert isinstance(flight.helm, StairHelm)
    levels, half = flight.helm.levels, len(flight.helm.orders_rad) // 2
    if len(levels) <= 2 * half:
        return np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
    rates = np.array([level.states[2] for level in levels])
    orders = np.array([level.order_rad for level in levels])[: half + 1][::-1]
    return orders, rates[: half + 1][::-1], rates[half:]


FIGURES: Mapping[str, Callable[[DeskFlight, int], Figures]] = {
    "turning-circle": circle_figures,
    "zigzag": zigzag_with_steering,
    "spiral": spiral_figures,
    "pull-out": pull_out_figures,
    "depth-step": depth_figures,
    "vertical-zigzag": vertical_swing_figures,
}
