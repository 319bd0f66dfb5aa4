"""Pictures of what an effect does to the readings: ``python -m tests.bench.pages`` writes them.

A made-up vehicle of 1.6 m flies three maneuvers by the program's own equations, with an effect and
without it; drawn is the difference of what its sensors read. It is what `diagnose` finds before the
coefficients have taken up their part of it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from html import escape

import numpy as np

from auvident.engines.carried import predicted_course
from auvident.engines.records import Record, Source
from auvident.schema.effects import parameter_of
from auvident.schema.planes import Plane
from tests.engines.effects_world import DT, FREELY, HEADING, LEAD, World

Sizes = dict[str, float]


@dataclass(frozen=True)
class Group:
    """Effects in one picture, and how large each is in it, as an engineer reads it."""

    title: str
    plane: Plane
    effects: dict[str, Sizes]


LATE_FIN = {"lag": {"lag_s": 0.4}, "rate_limit": {"rate_degps": 25.0}, "delay": {"delay_s": 0.3}}
SMALL_FIN = {"backlash": {"half_width_deg": 1.0}, "deadband": {"deadband_deg": 1.0}}
LARGE_FIN = {"asymmetry": {"gain": 0.1}, "stall": {"angle_deg": 25.0}}
EVENT = {"time_s": 212.0, "over_s": 0.5}  # of records that begin at 205 s


def _of(fin: str, kinds: dict[str, Sizes]) -> dict[str, Sizes]:
    return {f"{fin}_{kind}": sizes for kind, sizes in kinds.items()}


# fmt: off
GROUPS: dict[str, Group] = {
    "current": Group("Moving water", "horizontal", {
        "current": {"north_mps": 0.1, "east_mps": -0.1},
        "current_drift": {"north_late_mps_per_1000_s": 0.2, "east_late_mps_per_1000_s": 0.1}}),
    "rudder-late": Group("A slow rudder", "horizontal", _of("rudder", LATE_FIN)),
    "rudder-play": Group("Small rudder angles", "horizontal", _of("rudder", SMALL_FIN)),
    "rudder-large": Group("Large rudder angles", "horizontal", _of("rudder", LARGE_FIN)),
    "amidships": Group("Turning with the rudder amidships", "horizontal", {
        "rudder_offset": {"offset_deg": 1.0},
        "propeller_side_force": {"Y_nn": 0.004, "N_nn": -0.001},
        "dvl_misalignment": {"yaw_deg": 1.0}}),
    "asymmetry": Group("An asymmetric hull", "horizontal", {
        "hull_asymmetry": {"Y_0": 0.4, "N_0": 0.1}}),
    "propeller": Group("The propeller", "horizontal", {
        "propeller_lag": {"lag_s": 1.0}, "propeller_race": {"c_m2ps2pn": 0.01}}),
    "thrust": Group("Thrust that falls", "horizontal", {
        "thrust_sag": {"fraction_per_1000_s": 0.2},
        "thrust_step": {"fraction": 0.1, **EVENT}}),
    "sensors-late": Group("Late sensors", "horizontal", {
        "dvl_delay": {"delay_s": 0.3}, "gyro_delay": {"delay_s": 0.3}}),
    "dvl": Group("The DVL", "horizontal", {
        "dvl_scale": {"fraction": 0.02}, "dvl_lever_arm": {"dx_m": 0.2, "dy_m": 0.1},
        "dvl_height": {"dz_m": 0.2}}),
    "gyro": Group("The gyro", "horizontal", {
        "gyro_bias": {"bias_degps": 0.2}, "gyro_scale": {"fraction": 0.02}}),
    "cross-flow": Group("Cross-flow", "horizontal", {
        "sway_cross_flow": {"Y_v|r|": -15.0, "Y_r|v|": 10.0},
        "yaw_cross_flow": {"N_v|r|": -4.0, "N_r|v|": -6.0}}),
    "damping": Group("Damping", "horizontal", {
        "linear_damping": {"Y_v": -15.0, "N_r": -5.0},
        "cubic_damping": {"N_vvr": -20.0, "N_rrr": -3.0}}),
    "drag": Group("Drag", "horizontal", {
        "linear_drag": {"X_u": -0.8}, "turning_drag": {"X_vvu": -10.0, "X_rru": -2.0}}),
    "roll": Group("Roll and pitch", "horizontal", {
        "roll_coupling": {"Y_uuphi": 8.0, "N_uuphi": 2.0}, "weight_excess": {"W-B_n": 3.0}}),
    "incidence": Group("Sinking water, a pitched DVL", "vertical", {
        "vertical_current": {"down_mps": 0.03}, "dvl_pitch": {"pitch_deg": 1.0}}),
    "elevator-late": Group("A slow elevator", "vertical", _of("elevator", LATE_FIN)),
    "elevator-play": Group("Small elevator angles", "vertical", _of("elevator", SMALL_FIN)),
    "elevator-large": Group("Large elevator angles", "vertical", _of("elevator", LARGE_FIN)),
    "trim": Group("Pitching with the elevator amidships", "vertical", {
        "elevator_offset": {"offset_deg": 1.0}, "thrust_line_moment": {"z_m": 0.02}}),
    "weight": Group("Weight that changes", "vertical", {
        "weight_change": {"weight_n": 1.0, "moment_nm": -0.1, **EVENT},
        "buoyancy_gradient": {"gradient_npm": 0.2}}),
    "cross-flow-vertical": Group("Cross-flow, vertical", "vertical", {
        "heave_cross_flow": {"Z_w|q|": -15.0, "Z_q|w|": 10.0},
        "pitch_cross_flow": {"M_w|q|": -4.0, "M_q|w|": -6.0}}),
    "pitch-rate": Group("The pitch gyro", "vertical", {
        "q_bias": {"bias_degps": 0.2}, "q_scale": {"fraction": 0.02}}),
    "pitch": Group("The pitch sensor", "vertical", {
        "pitch_bias": {"bias_deg": 1.0}, "pitch_scale": {"fraction": 0.04}}),
}
# fmt: on
NO_PICTURE = {  # they change no predicted reading of the maneuver
    "wave": "is looked for as a spectral line",
    "one_off_event": "is masked, whatever it does",
    "depth_lag": "shows in the logged depth alone",
    "depth_scale": "shows in the logged depth alone",
}

# --- maneuvers ----------------------------------------------------------------------------

N = 300  # rows of a maneuver
FAST, SLOW = 17.0, 13.0  # of the propeller, rev/s
DEG = np.pi / 180.0
MANEUVERS: dict[Plane, tuple[str, ...]] = {
    "horizontal": ("straight run, thrust step", "turning circle", "zigzag"),
    "vertical": ("level run, thrust step", "depth step", "vertical zigzag"),
}
CHANNELS: dict[Plane, tuple[tuple[str, str, float], ...]] = {
    "horizontal": (("u", "mm/s", 1e3), ("v", "mm/s", 1e3), ("r", "deg/s", 1 / DEG)),
    "vertical": (
        ("u", "mm/s", 1e3),
        ("w", "mm/s", 1e3),
        ("q", "deg/s", 1 / DEG),
        ("pitch", "deg", 1 / DEG),
    ),
}


def _commands(plane: Plane, number: int) -> np.ndarray:
    """Fin and propeller of a maneuver, with the straight run before it."""
    rows, time = LEAD + N, DT * (np.arange(LEAD + N) - LEAD)
    fin, rate = np.zeros(rows), np.full(rows, FAST)
    period, angle = (10.0, 10.0) if plane == "horizontal" else (6.0, 5.0)
    swing = np.where(time % period < period / 2, angle, -angle)
    if number == 0:
        rate[time >= 8.0] = SLOW
    elif number == 1 and plane == "horizontal":
        fin[time >= 2.0] = 12.0
    elif number == 1:
        fin[(time >= 2.0) & (time < 5.0)], fin[(time >= 9.0) & (time < 12.0)] = 4.0, -4.0
    else:
        fin[time >= 2.0] = swing[time >= 2.0]
    return np.column_stack([fin * DEG, np.zeros(rows), rate])


def _record(raw: np.ndarray, start: np.ndarray) -> Record:
    """What a vehicle has of these inputs, its roll and depth made up."""
    time = DT * np.arange(LEAD + N)
    heel = np.convolve(raw[:, 0], np.full(15, 1.0 / 15), "full")[: len(raw)]  # outward, a little
    rates = np.column_stack([np.gradient(heel, DT), np.zeros(len(raw))])
    source = Source(
        raw=raw,
        elapsed_s=200.0 + time,
        speed=np.full(len(raw), start[0]),
        roll=heel,
        pitch=0.05 * (1.0 - np.exp(-time / 5.0)),
        rates=rates[LEAD:],
        bridged=np.tile(start, (N, 1)),
        start=start,
        from_middle_s=300.0 + DT * np.arange(N),
        depth=5.0 + 0.2 * time,
        heading=np.full(N, HEADING),
    )
    given = np.tile(start, (N, 1))
    return Record("m", time[LEAD:], raw[LEAD:].copy(), given, given.copy(), start, source)


@cache
def flown(group: str, effect: str, number: int) -> np.ndarray:
    """Readings with the effect less those without it."""
    plane, world = GROUPS[group].plane, _world(group, effect)
    record = _record(_commands(plane, number), _start(group, effect))
    with_it, without = (
        predicted_course(w.frame, w.p, record, FREELY).readings for w in (world, world.without())
    )
    return with_it - without


def _world(group: str, effect: str) -> World:
    row = GROUPS[group]
    return World.of({f"{effect}.{k}": v for k, v in row.effects[effect].items()}, plane=row.plane)


@cache
def _start(group: str, effect: str) -> np.ndarray:
    """Readings of a run with the fin amidships that has come to rest, the effect there as well."""
    plane, world = GROUPS[group].plane, _world(group, effect)
    if EVENT.keys() <= GROUPS[group].effects[effect].keys():
        world = world.without()  # it is still to come
    state = np.array([1.4, 0.0, 0.0, HEADING if plane == "horizontal" else 0.0])
    steady = np.column_stack([np.zeros((LEAD + N, 2)), np.full(LEAD + N, FAST)])
    for _ in range(4):  # records of 30 s after each other
        held = _record(steady, state)
        state = predicted_course(world.frame, world.p, held, FREELY).readings[-1].copy()
        state[3] = HEADING if plane == "horizontal" else state[3]
    return state


# --- picture ------------------------------------------------------------------------------

COLOURS = ("#0072b2", "#d55e00", "#009e73")
PANEL, GAP, LEFT, TOP = (200, 52), (14, 12), 92, 46  # px
POINTS = 50  # of a line
FINE = 4  # units of the picture to a px, so that points are whole numbers
LEAST = {"mm/s": 1.0, "deg/s": 0.05, "deg": 0.05}  # half a panel is no less


def picture(group: str) -> str:
    """One picture as SVG: channels below each other, maneuvers side by side."""
    row = GROUPS[group]
    channels, maneuvers = CHANNELS[row.plane], MANEUVERS[row.plane]
    width = LEFT + len(maneuvers) * (PANEL[0] + GAP[0])
    height = TOP + len(channels) * (PANEL[1] + GAP[1])
    body = [*_legend(row), *_heads(maneuvers)]
    for i, (name, unit, factor) in enumerate(channels):
        lines = {
            (e, j): factor * flown(group, e, j)[:: N // POINTS, i]
            for e in row.effects
            for j in range(len(maneuvers))
        }
        most = max(LEAST[unit], *(float(np.abs(line).max()) for line in lines.values()))
        body += _row(i, f"{name}, {unit}", most, len(maneuvers))
        for k, effect in enumerate(row.effects):
            body += [_line(lines[effect, j] / most, i, j, k) for j in range(len(maneuvers))]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'font-family="sans-serif" font-size="11" fill="#222">\n'
        f"<title>{escape(alt(group))}</title>\n"
        f'<rect width="{width}" height="{height}" fill="#fff"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def alt(group: str) -> str:
    """What the picture shows, in words."""
    row = GROUPS[group]
    names = " and ".join(", ".join(row.effects).rsplit(", ", 1))
    channels = ", ".join(name for name, _, _ in CHANNELS[row.plane])
    return f"{row.title}: residuals of {channels} by {names} in {', '.join(MANEUVERS[row.plane])}"


def _legend(row: Group) -> Iterator[str]:
    x = LEFT
    for k, (effect, sizes) in enumerate(row.effects.items()):
        words = f"{effect}: {_told(effect, sizes)}"
        yield f'<text x="{x}" y="14" fill="{COLOURS[k]}">{escape(words)}</text>'
        x += 6 * len(words) + 18


def _told(effect: str, sizes: Sizes) -> str:
    """Sizes with their units; a unit that several share stands once."""
    own = [
        (f"{v:g}", parameter_of(f"{effect}.{k}").unit) for k, v in sizes.items() if k not in EVENT
    ]
    if len({unit for _, unit in own}) == 1:
        own = [(", ".join(value for value, _ in own), own[0][1])]
    return ", ".join(f"{value} {unit}".removesuffix(" -") for value, unit in own)


def _heads(maneuvers: tuple[str, ...]) -> Iterator[str]:
    for j, name in enumerate(maneuvers):
        yield f'<text x="{LEFT + j * (PANEL[0] + GAP[0])}" y="{TOP - 8}">{name}</text>'


def _row(i: int, label: str, most: float, columns: int) -> Iterator[str]:
    y = TOP + i * (PANEL[1] + GAP[1])
    yield f'<text x="4" y="{y + PANEL[1] / 2 + 4:.0f}">{label}</text>'
    for at, sign in ((y + 9, "+"), (y + PANEL[1], "−")):
        yield f'<text x="{LEFT - 6}" y="{at}" text-anchor="end">{sign}{_short(most)}</text>'
    for j in range(columns):
        x = LEFT + j * (PANEL[0] + GAP[0])
        yield (
            f'<path d="M{x} {y}h{PANEL[0]}v{PANEL[1]}h-{PANEL[0]}z'
            f'm0 {PANEL[1] / 2:g}h{PANEL[0]}" fill="none" stroke="#bbb"/>'
        )


def _short(number: float) -> str:
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _line(share: np.ndarray, i: int, j: int, k: int) -> str:
    """A line of a panel in steps of whole numbers; nothing where it is zero throughout."""
    if np.abs(share).max() < 0.01:
        return ""
    x0, y0 = LEFT + j * (PANEL[0] + GAP[0]), TOP + i * (PANEL[1] + GAP[1]) + PANEL[1] / 2
    x = np.rint(FINE * np.linspace(0, PANEL[0], len(share))).astype(int)
    y = np.rint(-FINE * 0.48 * PANEL[1] * share).astype(int)
    steps = " ".join(f"{dx} {dy}" for dx, dy in zip(np.diff(x), np.diff(y), strict=True))
    return (
        f'<path transform="translate({x0} {y0:g}) scale({1 / FINE:g})" d="M0 {y[0]}l{steps}" '
        f'fill="none" stroke="{COLOURS[k]}" stroke-width="{1.4 * FINE:g}"/>'
    )
