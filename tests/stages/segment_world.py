"""A closed-form world for the segment stage: Nomoto yaw, first-order surge, and a schedule.

T r' + r = K (speed / cruise) d, tau u' + u = gain n; nothing of the package is used but `Trial`.
Rudder: internal sign (positive to port).
"""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from auvident.schema.trial import Trial

DEG = np.pi / 180


@dataclass(frozen=True)
class Ship:
    """A vehicle and its logger."""

    rate_hz: float = 10.0
    cruise_mps: float = 1.6
    cruise_rpm: float = 900.0
    gain: float = -0.6  # K of Nomoto at cruise [1/s]
    lag_s: float = 0.6  # T of Nomoto
    surge_lag_s: float = 4.0
    slew_degps: float = np.inf  # of a measured rudder; inf: the log holds the command
    rudder_noise_deg: float = 0.0
    u_noise: float = 0.02
    r_noise_degps: float = 0.3
    heading_noise_deg: float = 0.1
    with_heading: bool = True


@dataclass
class Sail:
    """A trial under way: call the legs in order, then `trial()`."""

    ship: Ship
    rng: np.random.Generator
    rows: list = field(default_factory=list)
    truth: list = field(default_factory=list)
    u: float = 0.0
    r: float = 0.0
    psi: float = 0.0
    fin: float = 0.0
    time: float = 100.0

    def step(self, command: float, rpm: float) -> None:
        s, dt = self.ship, 1 / self.ship.rate_hz
        move = np.clip(command - self.fin, -s.slew_degps * DEG * dt, s.slew_degps * DEG * dt)
        self.fin += float(move)
        self.rows.append((self.time, self.u, 0.0, self.r, self.fin, rpm, self.psi))
        speed = self.u / s.cruise_mps
        wanted = s.gain * speed * self.fin
        before = self.r
        self.r = wanted + (self.r - wanted) * np.exp(-dt / s.lag_s)
        self.psi += 0.5 * (before + self.r) * dt
        goal = s.cruise_mps * rpm / s.cruise_rpm * (1 - 0.8 * min(abs(self.fin), 0.5))
        self.u = goal + (self.u - goal) * np.exp(-dt / s.surge_lag_s)
        self.time += dt

    def fixed(self, seconds: float, rpm: float, fin: float = 0.0) -> None:
        for _ in range(round(seconds * self.ship.rate_hz)):
            self.step(fin, rpm)

    def wiggle(self, seconds: float, rpm: float, fin: float, period: float) -> None:
        for i in range(round(seconds * self.ship.rate_hz)):
            side = 1 if (i / self.ship.rate_hz) % period < period / 2 else -1
            self.step(side * fin, rpm)

    def steer(self, seconds: float, rpm: float, course: float, gain: float, limit: float) -> None:
        """Autopilot on noisy heading and rate, in proportion to what the rudder does."""
        s = self.ship
        for _ in range(round(seconds * s.rate_hz)):
            seen = self.psi - course + self.rng.normal(0, s.heading_noise_deg * DEG)
            rate = self.r + self.rng.normal(0, s.r_noise_degps * DEG)
            damping = 0.4 / abs(s.gain) + s.lag_s
            self.step(float(np.clip(gain * (seen + damping * rate), -limit, limit)), rpm)

    def transit(self, rpm: float, settle: float = 1.0) -> None:
        """A change of course of less than 150 degrees at the ship's own pace."""
        turn = self.rng.uniform(20, 140) * DEG * self.rng.choice([-1, 1])
        limit = 12 * DEG
        pace = abs(self.ship.gain) * limit
        seconds = abs(turn) / pace + settle * (8 + 8 * self.ship.lag_s)
        self.steer(seconds, rpm, self.psi + turn, 0.9, limit)

    def note(self, kind: str, start: float) -> None:
        self.truth.append((kind, start, self.time))

    def turn(self, fin: float, rpm: float, degrees: float = 400, thrust_step: bool = False) -> None:
        start, psi = self.time, self.psi
        while abs(self.psi - psi) < degrees * DEG:
            faster = thrust_step and abs(self.psi - psi) > 0.5 * degrees * DEG
            self.step(fin, rpm * (1.15 if faster else 1.0))
        self.note("turn", start)

    def zigzag(self, fin: float, switch: float, executes: int, rpm: float) -> None:
        start, psi, side = self.time, self.psi, 1.0
        for _ in range(executes):
            while -side * np.sign(fin) * (self.psi - psi) < switch:
                self.step(side * fin, rpm)
            side = -side
        self.note("zigzag", start)

    def straight(self, levels: list[float], seconds: list[float], kept: bool) -> None:
        start, psi = self.time, self.psi
        for rpm, span in zip(levels, seconds, strict=True):
            if kept:
                self.steer(span, rpm, psi, 0.3, 4 * DEG)
            else:
                self.fixed(span, rpm)
        self.note("straight", start)

    def trial(self, name: str = "trial") -> Trial:
        s, rng = self.ship, self.rng
        t, u, v, r, fin, rpm, psi = np.array(self.rows).T
        n = t.size
        table = {
            "time_s": t,
            "u_mps": u + rng.normal(0, s.u_noise, n),
            "v_mps": v + rng.normal(0, s.u_noise, n),
            "r_radps": r + rng.normal(0, s.r_noise_degps * DEG, n),
            "rudder_rad": fin + rng.normal(0, s.rudder_noise_deg * DEG, n),
            "rpm": rpm,
            "record": np.zeros(n, dtype=int),
        }
        if s.with_heading:
            table["heading_rad"] = psi + rng.normal(0, s.heading_noise_deg * DEG, n)
        return Trial.from_table(name, pd.DataFrame(table), s.rate_hz)


def random_trial(ship: Ship, seed: int) -> tuple[Trial, list]:
    """A day's programme within the bounds of the method; the trial and the true schedule."""
    rng = np.random.default_rng(seed)
    sail = Sail(ship, rng)
    cruise = ship.cruise_rpm
    sail.fixed(15, 0)
    sail.wiggle(12, 0, 15 * DEG, 4.0)
    sail.wiggle(10, 0.3 * cruise, 12 * DEG, 5.0)
    sail.steer(60, cruise, sail.psi, 0.9, 12 * DEG)
    pace = max(1.0, ship.surge_lag_s / 4.0)
    legs = ["straight"] * 2 + ["turn"] * 4 + ["zigzag"] * 4
    angles = {"turn": [8, -12, 20, -30], "zigzag": [(20, 20), (-10, 10), (20, 10), (-35, 5)]}
    for kind in rng.permutation(legs):
        sail.transit(cruise * rng.uniform(0.97, 1.03))
        rpm = cruise * rng.uniform(0.8, 1.2)
        if kind == "turn":
            fin = angles["turn"].pop()
            sail.turn(fin * DEG, rpm, rng.uniform(190, 420), thrust_step=bool(rng.random() < 0.3))
        elif kind == "zigzag":
            fin, switch = angles["zigzag"].pop()
            sail.zigzag(fin * DEG, switch * DEG, int(rng.integers(4, 8)), rpm)
        else:
            levels = list(cruise * np.array([0.8, 1.1, 0.9, 1.25])[: rng.integers(3, 5)])
            spans = list(pace * rng.uniform(25, 40, len(levels)))
            sail.straight(levels, spans, kept=bool(rng.random() < 0.5))
    sail.transit(cruise)
    for share in np.linspace(1, 0, 50):
        sail.fixed(0.2, share * cruise)
    sail.wiggle(10, 0.0, 15 * DEG, 4.0)
    sail.fixed(20, 0)
    return sail.trial(), sail.truth


def overlap(truth: list, maneuvers: tuple, kind: str) -> float:
    """Time-weighted intersection over union of one kind."""
    true = [(a, b) for k, a, b in truth if k == kind]
    found = [(m.t_start_s, m.t_end_s) for m in maneuvers if m.kind == kind]
    ends = [b for _, b in true + found]
    grid = np.arange(0, max(ends, default=1.0) + 1, 0.05)
    inside = [
        np.any([(grid >= a) & (grid < b) for a, b in spans] or [np.zeros(grid.size, bool)], axis=0)
        for spans in (true, found)
    ]
    union = np.count_nonzero(inside[0] | inside[1])
    return float(np.count_nonzero(inside[0] & inside[1]) / union) if union else 1.0
