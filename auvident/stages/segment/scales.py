"""The yardsticks of a trial, and the stretches over which its fin is held.

Speeds are judged against the trial's cruise, angles against its noise, angular rates against
what the fin achieves, so a 7 m model at 1 deg/s and a small vehicle at 30 deg/s meet one rule.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from auvident.physics.maneuvers.plateaus import (
    Plateau,
    median,
    noise_std,
    odd_samples,
    plateaus,
    slew_rate,
)
from auvident.stages.segment.pieces import MEDIAN_WINDOW_S, Piece, true_ranges

NOISE_WINDOW_S = 2.0  # second differences are pooled over this to read the noise of an input
LEAST_TOLERANCE_RAD = np.radians(0.5)  # fin angles closer than this are one angle
NOISE_OF_MEDIAN = 1.2533  # std of a median over that of a mean, normal distribution
NOISE_BAND = 4.0  # standard deviations that hold the noise of a whole plateau
LEAST_FIN_RAD = np.radians(2.0)  # less is trim or an autopilot at work
PROPELLED_SHARE = 0.2  # of the highest rpm: below, the vehicle idles
SURE_SIGN = 0.3  # share of agreement (of -1..1) from which the data settle the sign of the fin
SHORTEST_HOLD_S = 0.4  # a fin held for less was passing by
PASSING_SHARE = 0.25  # of its neighbours: a hold shorter than this is part of the ramp
SWEPT_SHARE = 0.6  # of the angle on its side: a fin that creeps within a hold stays beyond
HELD_SHARE = 0.65  # of its time on a side spent beyond that; a sine has 0.59
STEP_S, STEP_SHARE = 0.5, 0.15  # a fin that moves by this share within this time was ordered to
REST_S = 1.0  # a hold may be interrupted for this long (a glitch) and stays one hold


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
        for held in (*held_fins(piece, scales), *swept_fins(piece)):
            if piece.speed[held.start] > 0.5 * scales.speed_mps:
                change = piece.rate_mean[held.stop - 1] - piece.rate_mean[held.start]
                agree += float(np.sign(held.level) * change)
                total += float(abs(change))
    drive = 1 if total > 0 and agree / total > SURE_SIGN else -1
    gain = float(np.sqrt(rate2 / input2)) if input2 > 0 else 0.0
    return replace(scales, gain_radpm=gain, drive=drive)


def held_fins(piece: Piece, scales: Scales, least_rad: float = LEAST_FIN_RAD) -> list[Plateau]:
    """Stretches over which the fin is held at an angle beyond `least_rad`, glitches bridged."""
    tolerance = scales.tolerance_rad
    shortest = max(2, piece.samples(SHORTEST_HOLD_S))
    held: list[Plateau] = []
    for p in plateaus(piece.fin, tolerance):
        if p.samples < shortest or abs(p.level) < least_rad or _moves(piece, p, tolerance):
            continue
        if held and _same_hold(piece, held[-1], p, tolerance):
            start = held.pop().start
            p = Plateau(start, p.stop, median(piece.fin[start : p.stop]))
        held.append(p)
    return [p for i, p in enumerate(held) if not _passes_by(held[max(0, i - 1) : i + 2], p)]


def swept_fins(piece: Piece) -> list[Plateau]:
    """Stretches over which the fin is held on one side, to a share of its angle.

    A measured fin creeps under load, and a person does not hold one angle to half a degree.
    """
    shortest = max(2, piece.samples(SHORTEST_HOLD_S))
    held = [
        p
        for sign in (1, -1)
        for start, stop in true_ranges(sign * piece.fin > 0)
        if stop - start >= shortest and np.abs(piece.fin[start:stop]).max() >= LEAST_FIN_RAD
        for part in _between_steps(piece, start, stop)
        for p in _swept(piece, *part)
    ]
    return sorted(
        (p for p in held if p.samples >= shortest and abs(p.level) >= LEAST_FIN_RAD),
        key=lambda p: p.start,
    )


def _swept(piece: Piece, start: int, stop: int) -> list[Plateau]:
    """The hold in a range on one side, if it is most of it."""
    side = np.abs(piece.fin[start:stop])
    beyond = np.flatnonzero(side >= SWEPT_SHARE * float(np.quantile(side, 0.9)))
    if beyond.size < HELD_SHARE * side.size:
        return []
    first, last = start + int(beyond[0]), start + int(beyond[-1]) + 1
    return [Plateau(first, last, median(piece.fin[first:last]))]


def _between_steps(piece: Piece, start: int, stop: int) -> list[tuple[int, int]]:
    """Parts of a range between steps of the fin: there another order was given."""
    fin, span = np.abs(piece.fin[start:stop]), max(1, piece.samples(STEP_S))
    if fin.size <= span:
        return [(start, stop)]
    step = STEP_SHARE * float(np.quantile(fin, 0.9))
    calm = true_ranges(np.abs(fin[span:] - fin[:-span]) <= step)
    return [(start + a, start + b + span) for a, b in calm]


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
