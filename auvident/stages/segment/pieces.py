"""What the search works on: uninterrupted pieces of a trial, and the trial's own yardsticks.

Speeds are judged against the trial's cruise, angles against its noise, yaw rates against what
the rudder achieves, so a 7 m model at 1 deg/s and a small vehicle at 30 deg/s meet one rule.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from auvident.physics.figures_plateaus import (
    Array,
    Plateau,
    noise_std,
    odd_samples,
    plateaus,
    running_mean,
    running_median,
    slew_rate,
)
from auvident.physics.figures_track import heading_from_rate
from auvident.schema.artifacts import ManeuverKind, Rejected
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN
from auvident.schema.trial import Trial

NEEDED = ("u_mps", "v_mps", "r_radps", "rudder_rad", "rpm")
SHORTEST_PIECE_S = 5.0  # no maneuver fits into less
NOISE_WINDOW_S = 2.0  # second differences are pooled over this to read the noise of an input
MEDIAN_WINDOW_S = 0.5  # spikes of the fin log up to half of it disappear, edges stay
MEAN_WINDOW_S = 2.0  # waves and sensor noise average out, a swing of a zigzag does not
LEAST_TOLERANCE_RAD = np.radians(0.5)  # fin angles closer than this are one angle
NOISE_OF_MEDIAN = 1.2533  # std of a median over that of a mean, normal distribution
NOISE_BAND = 4.0  # standard deviations that hold the noise of a whole plateau
LEAST_FIN_RAD = np.radians(2.0)  # less is trim or an autopilot at work
PROPELLED_SHARE = 0.2  # of the highest rpm: below, the vehicle idles
FALLBACK_YAW_RATE_RADPS = np.radians(1.0)  # limit of straight where nothing was ever steered
SURE_SIGN = 0.3  # share of agreement (of -1..1) from which the data settle the sign of the fin


@dataclass(frozen=True)
class Scales:
    """Yardsticks of one trial.

    Attributes
    ----------
    speed_mps, rpm : float
        Cruise: medians while the propeller turns.
    fin_noise_rad, rpm_noise, rate_noise_radps : float
        Standard deviations of the noise on fin angle and rpm after the running median, and on
        the running mean of the angular rate.
    fin_slew_radps : float
        Fastest fin motion seen.
    gain_radpm : float
        Angular rate per fin angle and speed [rad/s per rad m/s]; 0 when nothing was steered.
    drive : int
        Sign of the rate that a positive fin angle drives: -1 by the program's convention.
    """

    speed_mps: float
    rpm: float
    fin_noise_rad: float
    rpm_noise: float
    rate_noise_radps: float
    fin_slew_radps: float
    gain_radpm: float = 0.0
    drive: int = -1

    @property
    def tolerance_rad(self) -> float:
        """Fin angles within this of each other are one level."""
        return max(LEAST_TOLERANCE_RAD, NOISE_BAND * self.fin_noise_rad)


@dataclass(frozen=True)
class Piece:
    """An uninterrupted piece of a trial in one plane.

    `fin`, `rate` and `angle` are rudder, yaw rate and heading, or elevator, pitch rate and
    pitch; `fin` and `rpm` are free of spikes, `fin_logged` and `rpm_logged` are as they
    came; `speed` and `rate_mean` are running means.
    """

    trial: str
    number: int
    is_first: bool
    is_last: bool
    rate_hz: float
    t: Array
    u: Array
    v: Array
    r: Array
    rpm: Array
    rpm_logged: Array
    fin: Array
    fin_logged: Array
    rate: Array
    angle: Array
    depth: Array | None
    speed: Array
    rate_mean: Array

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.t.size)

    def samples(self, seconds: float) -> int:
        """Number of samples in a time span."""
        return round(seconds * self.rate_hz)

    def time(self, index: int) -> float:
        """Time of a sample; the end of a half-open range may lie one beyond the last."""
        return float(self.t[min(max(index, 0), self.size - 1)])

    def seconds(self, start: int, stop: int) -> float:
        """Length of a half-open range."""
        return self.time(stop) - self.time(start)

    def rejected(
        self, start: int, stop: int, reason: str, value: float, threshold: float
    ) -> Rejected:
        """Why this range is no maneuver."""
        return Rejected(
            trial=self.trial,
            t_start_s=round(self.time(start), 3),
            t_end_s=round(self.time(stop), 3),
            reason=reason,
            value=round(float(value), 4),
            threshold=round(float(threshold), 4),
        )


@dataclass(frozen=True)
class Found:
    """A maneuver in samples of its piece, half-open."""

    kind: ManeuverKind
    piece: Piece
    start: int
    stop: int
    level_rad: float = 0.0
    plane: str = "horizontal"

    @property
    def seconds(self) -> float:
        """Its length."""
        return self.piece.seconds(self.start, self.stop)


def pieces_of(trial: Trial, plane: str = "horizontal") -> list[Piece]:
    """Uninterrupted pieces of a trial, in time order; those too short for anything are left out."""
    table = trial.table
    needed = [*NEEDED, *(("elevator_rad", "q_radps") if plane == "vertical" else ())]
    if any(column not in table for column in needed):
        return []
    columns = {c: table[c].to_numpy(dtype=float) for c in table.columns if c in _READ}
    record = table[RECORD_COLUMN].to_numpy() if RECORD_COLUMN in table else np.zeros(len(table))
    usable = np.all([np.isfinite(columns[c]) for c in needed], axis=0) & (record >= 0)
    label = np.where(usable, record, -1)
    cuts = np.flatnonzero(np.diff(label)) + 1
    ranges = [
        (a, b)
        for a, b in zip([0, *cuts.tolist()], [*cuts.tolist(), len(label)], strict=True)
        if b > a and label[a] >= 0 and (b - a) >= SHORTEST_PIECE_S * trial.rate_hz
    ]
    last = len(ranges) - 1
    return [
        _piece(trial, plane, columns, slice(a, b), number, last)
        for number, (a, b) in enumerate(ranges)
    ]


_READ = {*NEEDED, TIME_COLUMN, "heading_rad", "elevator_rad", "q_radps", "pitch_rad", "depth_m"}


def _piece(
    trial: Trial, plane: str, columns: dict[str, Array], rows: slice, number: int, last: int
) -> Piece:
    """One piece; an angle that is missing or broken is the integral of its rate."""
    horizontal = plane == "horizontal"
    t = columns[TIME_COLUMN][rows]
    fin = columns["rudder_rad" if horizontal else "elevator_rad"][rows]
    rate = columns["r_radps" if horizontal else "q_radps"][rows]
    angle = columns.get("heading_rad" if horizontal else "pitch_rad", np.array([]))[rows]
    if angle.size != t.size or not np.isfinite(angle).all():
        angle = heading_from_rate(t, rate)
    depth = columns.get("depth_m", np.array([]))[rows]
    narrow = odd_samples(MEDIAN_WINDOW_S, trial.rate_hz)
    wide = odd_samples(MEAN_WINDOW_S, trial.rate_hz)
    u = columns["u_mps"][rows]
    return Piece(
        trial=trial.name,
        number=number,
        is_first=number == 0,
        is_last=number == last,
        rate_hz=trial.rate_hz,
        t=t,
        u=u,
        v=columns["v_mps"][rows],
        r=columns["r_radps"][rows],
        rpm=running_median(columns["rpm"][rows], narrow),
        rpm_logged=columns["rpm"][rows],
        fin=running_median(fin, narrow),
        fin_logged=fin,
        rate=rate,
        angle=angle,
        depth=depth if depth.size == t.size and np.isfinite(depth).all() else None,
        speed=running_mean(u, wide),
        rate_mean=running_mean(rate, wide),
    )


def scales_of(pieces: Sequence[Piece]) -> Scales:
    """Yardsticks of a trial from all its pieces (at least one)."""
    rpm = np.abs(np.concatenate([p.rpm for p in pieces]))
    speed = np.concatenate([p.speed for p in pieces])
    propelled = rpm >= PROPELLED_SHARE * np.max(rpm)
    rate_hz = pieces[0].rate_hz
    window = max(3, round(NOISE_WINDOW_S * rate_hz))
    longest = max(pieces, key=lambda p: p.size)
    steered = np.abs(longest.fin) > LEAST_FIN_RAD
    left = NOISE_OF_MEDIAN / np.sqrt(odd_samples(MEDIAN_WINDOW_S, rate_hz))
    basic = Scales(
        speed_mps=max(float(np.median(speed[propelled])), 0.0),
        rpm=float(np.median(rpm[propelled])),
        fin_noise_rad=left * noise_std(longest.fin_logged, window, steered),
        rpm_noise=left * noise_std(longest.rpm_logged, window),
        rate_noise_radps=noise_std(longest.rate, window) / np.sqrt(window),
        fin_slew_radps=max(slew_rate(p.fin, rate_hz) for p in pieces),
    )
    return _with_response(basic, pieces)


def _with_response(scales: Scales, pieces: Sequence[Piece]) -> Scales:
    """Add how strongly, and which way, the vehicle answers its fin."""
    rate2 = input2 = agree = total = 0.0
    for piece in pieces:
        moved = (np.abs(piece.fin) > LEAST_FIN_RAD) & (piece.speed > 0.5 * scales.speed_mps)
        rate2 += float(np.sum(piece.rate_mean[moved] ** 2))
        input2 += float(np.sum((piece.fin * piece.speed)[moved] ** 2))
        for held in held_fins(piece, scales):
            if piece.speed[held.start] > 0.5 * scales.speed_mps:
                change = piece.rate_mean[held.stop - 1] - piece.rate_mean[held.start]
                agree += float(np.sign(held.level) * change)
                total += float(abs(change))
    drive = 1 if total > 0 and agree / total > SURE_SIGN else -1
    gain = float(np.sqrt(rate2 / input2)) if input2 > 0 else 0.0
    return Scales(**{**scales.__dict__, "gain_radpm": gain, "drive": drive})


SHORTEST_HOLD_S = 0.4  # a fin held for less was passing by
PASSING_SHARE = 0.25  # of its neighbours: a hold shorter than this is part of the ramp
REST_S = 1.0  # a hold may be interrupted for this long (a glitch) and stays one hold


def held_fins(piece: Piece, scales: Scales) -> list[Plateau]:
    """Stretches over which the fin is held at an angle beyond trim, glitches bridged."""
    tolerance = scales.tolerance_rad
    shortest = max(2, piece.samples(SHORTEST_HOLD_S))
    held: list[Plateau] = []
    for p in plateaus(piece.fin, tolerance):
        if p.samples < shortest or abs(p.level) < LEAST_FIN_RAD or _moves(piece, p, tolerance):
            continue
        if held and _same_hold(piece, held[-1], p, tolerance):
            start = held.pop().start
            p = Plateau(start, p.stop, float(np.median(piece.fin[start : p.stop])))
        held.append(p)
    return [p for i, p in enumerate(held) if not _passes_by(held[max(0, i - 1) : i + 2], p)]


def _moves(piece: Piece, p: Plateau, tolerance: float) -> bool:
    """Whether the fin goes on moving during a short hold: a slow ramp."""
    third = max(1, p.samples // 3)
    first, last = piece.fin[p.start : p.start + third], piece.fin[p.stop - third : p.stop]
    return bool(abs(np.mean(last) - np.mean(first)) > tolerance)


def _passes_by(near: list[Plateau], p: Plateau) -> bool:
    """Whether noise made a short hold out of a ramp between two long ones."""
    if len(near) < 3:
        return False
    before, _, after = near
    between = min(before.level, after.level) < p.level < max(before.level, after.level)
    return between and p.samples < PASSING_SHARE * min(before.samples, after.samples)


def _same_hold(piece: Piece, a: Plateau, b: Plateau, tolerance: float) -> bool:
    """Whether b continues a after a glitch shorter than both."""
    gap = b.start - a.stop
    short = gap <= piece.samples(REST_S) and gap <= min(a.samples, b.samples)
    return short and abs(a.level - b.level) <= tolerance
