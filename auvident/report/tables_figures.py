"""Tables of maneuvering figures: turning circles and zigzags, measured and simulated."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from auvident.report.numbers import Style
from auvident.report.tables import Cell, Rows, Table, columns
from auvident.schema.artifacts import ManeuverMetrics
from auvident.schema.planes import BY_PLANE, Plane

MOST_COLUMNS = 5  # maneuvers side by side in one table of figures
OVERSHOOTS_SHOWN = 2  # the others of a long zigzag as their mean
WORTH_SAYING = 0.02  # relative difference of a figure below which it is not marked

# Figure of a maneuver -> words, unit.
TURN_FIGURES = {
    "rudder_deg": ("rudder angle", "deg"),
    "approach_speed_mps": ("approach speed", "m/s"),
    "advance_m": ("advance", "m"),
    "transfer_m": ("transfer", "m"),
    "time_to_90_s": ("time to 90° change of heading", "s"),
    "tactical_diameter_m": ("tactical diameter", "m"),
    "time_to_180_s": ("time to 180° change of heading", "s"),
    "steady_diameter_m": ("steady diameter", "m"),
    "steady_r_degps": ("steady yaw rate", "deg/s"),
    "steady_speed_mps": ("steady speed", "m/s"),
    "steady_drift_deg": ("steady drift angle", "deg"),
    "speed_loss": ("speed loss, of the approach speed", ""),
    "heading_change_deg": ("change of heading", "deg"),
}
ZIGZAG_FIGURES = {
    "rudder_deg": ("{fin} angle", "deg"),
    "switch_deg": ("switching angle", "deg"),
    "initial_turning_time_s": ("initial turning time", "s"),
    "time_to_check_yaw_s": ("time to check {turn}", "s"),
    "overshoot_1_deg": ("1st overshoot", "deg"),
    "overshoot_2_deg": ("2nd overshoot", "deg"),
    "later_overshoots_deg": ("later overshoots, mean", "deg"),
    "reach_s": ("reach", "s"),
    "period_s": ("period", "s"),
}


def figure_tables(
    metrics: Sequence[ManeuverMetrics], kind: str, plane: Plane = "horizontal"
) -> Iterator[Table]:
    """Figures of turns or zigzags, measured and simulated, maneuvers side by side."""
    words = TURN_FIGURES if kind == "turn" else ZIGZAG_FIGURES
    own = {"fin": BY_PLANE[plane].fin, "turn": "yaw" if plane == "horizontal" else "pitch"}
    found = [(m.id, getattr(m, kind)) for m in metrics if m.kind == kind and getattr(m, kind)]
    for start in range(0, len(found), MOST_COLUMNS):
        piece = [(i, _condensed(f)) for i, f in found[start : start + MOST_COLUMNS]]
        rows: Rows = [
            [label.format(**own), unit, *(Change.of(figures, name) for _, figures in piece)]
            for name, (label, unit) in words.items()
            if any(name in side for _, figures in piece for side in figures.values())
        ]
        yield Table(columns(("measured → model", ""), [i for i, _ in piece]), rows)


def _condensed(figures: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Overshoots beyond the second as their mean."""
    found = {}
    for side, values in figures.items():
        later = [
            v
            for k, v in values.items()
            if k.startswith("overshoot_") and int(k.split("_")[1]) > OVERSHOOTS_SHOWN
        ]
        found[side] = dict(values)
        if later:
            found[side]["later_overshoots_deg"] = sum(later) / len(later)
    return found


@dataclass(frozen=True)
class Change:
    """``measured → simulated``, with the difference in percent where it is worth saying."""

    measured: float | None
    simulated: float | None

    @staticmethod
    def of(figures: Mapping[str, Mapping[str, float]], name: str) -> Cell:
        """The cell of one figure; empty where neither side has it."""
        m, s = (figures.get(side, {}).get(name) for side in ("measured", "simulated"))
        return "" if m is None and s is None else Change(m, s)

    def text(self, style: Style) -> str:
        """Both numbers in a style."""
        m, s = self.measured, self.simulated
        text = f"{style.number(m)} → {style.number(s)}"
        if m and s is not None and abs(s / m - 1.0) >= WORTH_SAYING:
            text += f" ({100.0 * (s / m - 1.0):+.0f} %)".replace("-", style.minus)
        return text
