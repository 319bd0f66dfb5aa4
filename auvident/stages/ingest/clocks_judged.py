"""Whose clock is off: the sensors of a trial against its gyro, one after another."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from auvident.constants import NORMAL_95
from auvident.schema.logs import RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clocks_estimate import (
    APART_STDS,
    Bench,
    ClockLag,
    Lags,
    combined,
    passage_s,
    put_right,
)
from auvident.stages.ingest.clocks_relations import RELATIONS, ClockRelation

SERVO_LENGTHS = 0.2  # a longer lag of the rudder is taken out before sway is compared
PARTNERS = ("depth", "position")  # sensors that kinematics relates to the DVL
# Of what is left unexplained with the partner's clock moved, and with the DVL's: the DVL has to
# leave clearly less to be the one that is off.
CLEARER = 0.9
WORSE = 1.05  # a DVL put right leaves no more of depth and position unexplained than before
JUDGES_OF_GYRO = ("attitude", "rudder", "dvl", "elevator", "position", "depth")
SAME_S = 0.2  # on one clock filters and buses delay sensors by so much more than others
MOST_WEIGHT = 2.0 / 3.0  # of all judges, of those that agree on the gyro
IsOff = Callable[[str, "ClockLag", float], bool]


def estimate_clocks(raw: RawTrial, trial: Trial, vehicle: Vehicle, is_off: IsOff) -> Lags:
    """Lags of all sensors behind the gyro.

    Kinematics comes before the equations of motion. A sensor that is off is put right before
    others are held against it. Where two or more are off by the same, and those that contradict
    it weigh little, it is the gyro.

    Parameters
    ----------
    raw, trial, vehicle
    is_off : callable
        (sensor, estimate, L/U in s) -> whether its clock is at fault.
    """
    passage = passage_s(trial, vehicle)
    lags = _Hearing(raw, trial, vehicle, is_off).lags()
    judges = {s: lags.of[s] for s in JUDGES_OF_GYRO if s in lags.of}
    off = {s for s, e in judges.items() if is_off(s, e, passage)}
    agreed = _agreed(judges, off)
    if not agreed:
        return _with_doubt(lags, judges, off)
    gyro = replace(combined([judges[s] for s in agreed]).opposite(), against=agreed)
    rest = _Hearing(raw, put_right(trial, "gyro", gyro), vehicle, is_off).lags()
    return Lags({"gyro": gyro, **rest.of}, rest.missing)


def _agreed(judges: dict[str, ClockLag], off: set[str]) -> tuple[str, ...]:
    """Sensors that are off by the same as the best known one; none where others weigh as much.

    A sensor weighs by how well its lag is known. The attitude knows the gyro best, by kinematics:
    where it is known and has another lag, the gyro is not off.
    """
    if not off:
        return ()
    best = judges[min(off, key=lambda s: judges[s].sure_std_s)]
    same = tuple(s for s, e in judges.items() if _is_same(e, best, SAME_S))
    if len(off & set(same)) < 2 or ("attitude" in judges and "attitude" not in same):
        return ()
    weights = {s: e.sure_std_s**-2.0 for s, e in judges.items()}
    return same if sum(weights[s] for s in same) > MOST_WEIGHT * sum(weights.values()) else ()


def _with_doubt(lags: Lags, judges: dict[str, ClockLag], off: set[str]) -> Lags:
    """The same; an attitude that is off may be a gyro that is, unless another sensor tells.

    That is one that is on the clock of the gyro, and would not be on that of the attitude. Depth
    and position know the DVL's, not the gyro's.
    """
    if "attitude" not in off:
        return lags
    own = judges["attitude"]
    others = [e for s, e in judges.items() if s not in {"attitude", *PARTNERS, *off}]
    if not any(_excludes(e, own) for e in others):
        lags.of["attitude"] = replace(own, instead="gyro")
    return lags


def _excludes(one: ClockLag, other: ClockLag) -> bool:
    """Whether a lag is not that of the other, whatever the hull."""
    apart = abs(one.lag_s - other.lag_s) > NORMAL_95 * one.sure_std_s + SAME_S
    return apart or abs(one.gain_s - other.gain_s) > NORMAL_95 * one.sure_gain_std_s + SAME_S


def _is_same(one: ClockLag, other: ClockLag, delay_s: float = 0.0) -> bool:
    std = delay_s + APART_STDS * float(np.hypot(one.std_s, other.std_s))
    gain_std = APART_STDS * float(np.hypot(one.gain_std_s, other.gain_std_s))
    return abs(one.lag_s - other.lag_s) <= std and abs(one.gain_s - other.gain_s) <= gain_std


class _Hearing:
    """The sensors of a trial against its gyro, one after another."""

    def __init__(self, raw: RawTrial, trial: Trial, vehicle: Vehicle, is_off: IsOff) -> None:
        self.raw, self.vehicle, self.is_off = raw, vehicle, is_off
        self.passage = passage_s(trial, vehicle)
        self.bench = Bench(raw, trial, vehicle, self.passage)
        self.found = Lags()
        self.certain = True  # whether what was put right of the DVL is known from kinematics

    def lags(self) -> Lags:
        """All of them."""
        self._hear("attitude")
        placed = self._placed()
        if placed:
            self._settle("dvl", combined(placed))
        self._hear("rudder")
        self._hear("elevator")
        if "dvl" in self.raw.sensors:
            self._dynamics()
        self._hear("depth")
        self._hear("position")
        if "rpm" in self.raw.sensors:
            self._propeller()
        return self.found

    def _hear(self, sensor: str) -> None:
        rows = _rows(sensor)
        found = [e for e in (self.bench.estimate(row) for row in rows) if e is not None]
        if not found and sensor in self.raw.sensors:
            self.found.missing[sensor] = self.bench.why(rows)
        if found:
            own = combined(found)
            certain = self.certain or sensor not in PARTNERS
            self._settle(sensor, replace(own, kinematic=own.kinematic and certain))

    def _settle(self, sensor: str, own: ClockLag) -> None:
        """Keep a lag, and put the sensor right if it is off."""
        self.found.of[sensor] = own
        servo = sensor == "rudder" and abs(own.lag_s) > SERVO_LENGTHS * self.passage
        if self.is_off(sensor, own, self.passage) or servo:
            self.bench = self.bench.with_trial(put_right(self.bench.trial, sensor, own))

    def _placed(self) -> list[ClockLag]:
        """Clock of the DVL from depth and position, where it is not theirs that is off."""
        found = []
        for row in (r for r in _rows("dvl") if r.kinematic):
            own = self.bench.estimate(row)
            if own is None:
                continue
            (partner,) = (r for r in RELATIONS if r.sensor in PARTNERS and r.slow == row.slow)
            other = self.bench.estimate(partner)
            ours = other is None or 1.0 - own.explained < CLEARER * (1.0 - other.explained)
            if ours or not self.is_off("dvl", own, self.passage):
                found.append(own)
        return found

    def _dynamics(self) -> None:
        """Clock of the DVL, if kinematics does not place it."""
        if "dvl" in self.found.of:
            return
        rows = [row for row in _rows("dvl") if not row.kinematic]
        found = [e for e in (self.bench.estimate(row) for row in rows) if e is not None]
        of_rpm = [e for e in found if any("propeller" in a for a in e.against)]
        if found:
            self._settle_by_dynamics(of_rpm, [e for e in found if e not in of_rpm])
        else:
            self.found.missing["dvl"] = self.bench.why(_rows("dvl"))

    def _propeller(self) -> None:
        """Clock of the propeller, from that of the DVL as it was put right or not."""
        dvl = self.found.of.get("dvl")
        own = None if dvl is None else self.bench.estimate(*_rows("rpm"))
        if dvl is None or own is None:
            self.found.missing["rpm"] = "needs thrust steps, and a DVL whose clock is known"
            return
        if self.is_off("dvl", dvl, self.passage):
            dvl = replace(dvl, lag_s=0.0, gain_s=0.0)
        self.found.of["rpm"] = _behind(own, dvl)

    def _settle_by_dynamics(self, of_rpm: list[ClockLag], others: list[ClockLag]) -> None:
        own = combined([*others, *of_rpm])
        if of_rpm and others:
            surge, rest = of_rpm[0], combined(others)
            if not _is_same(surge, rest):
                own = _doubted(rest, surge)
        if self.is_off("dvl", own, self.passage):
            if self._contradicted(own):
                own = replace(own, sure_std_s=float("inf"), sure_gain_std_s=float("inf"))
            else:
                self.certain = False
        self._settle("dvl", own)

    def _contradicted(self, own: ClockLag) -> bool:
        """Whether a DVL put right would be further from depth or position than it is."""
        right = self.bench.with_trial(put_right(self.bench.trial, "dvl", own))
        for row in (r for r in RELATIONS if r.sensor in PARTNERS):
            before, after = (b.unexplained(row) for b in (self.bench, right))
            if before is not None and after is not None and after > WORSE * before:
                return True
        return False


def _rows(sensor: str) -> list[ClockRelation]:
    return [row for row in RELATIONS if row.sensor == sensor]


def _behind(rpm: ClockLag, dvl: ClockLag) -> ClockLag:
    """Clock of the propeller: the surge equation knows it against that of the DVL."""
    return replace(
        rpm,
        lag_s=dvl.lag_s + rpm.lag_s,
        std_s=float(np.hypot(rpm.std_s, dvl.std_s)),
        sure_std_s=float(np.hypot(rpm.sure_std_s, dvl.sure_std_s)),
        gain_s=dvl.gain_s + rpm.gain_s,
        gain_std_s=float(np.hypot(rpm.gain_std_s, dvl.gain_std_s)),
        sure_gain_std_s=float(np.hypot(rpm.sure_gain_std_s, dvl.sure_gain_std_s)),
    )


def _doubted(sway: ClockLag, surge: ClockLag) -> ClockLag:
    """A clock of the DVL by sway that surge contradicts.

    It may be the propeller's clock or motor, or a hull that answers otherwise than the equation:
    the difference counts as not known. Where both say late, or early, the shorter lag stands.
    """
    if sway.lag_s * surge.lag_s > 0.0:
        return min(sway, surge, key=lambda e: abs(e.lag_s))
    sure = float(np.hypot(sway.sure_std_s, sway.lag_s - surge.lag_s))
    gain = float(np.hypot(sway.sure_gain_std_s, sway.gain_s - surge.gain_s))
    return replace(sway, sure_std_s=sure, sure_gain_std_s=gain)
