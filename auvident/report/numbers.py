"""How numbers are written, on the terminal and on the page; the one place where they are."""

import math
import re
from dataclasses import dataclass

from auvident.schema.effect_words import with_std

LEAST_PLAIN, MOST_PLAIN = 1.0e-5, 1.0e6  # powers of ten only outside of these
# SI unit -> unit that people read, factor to it.
SHOWN_UNITS: dict[str, tuple[str, float]] = {
    "rad": ("deg", 180.0 / math.pi),
    "rad/s": ("deg/s", 180.0 / math.pi),
}
ANGLE = "rad"  # in degrees wherever people read it
NO_UNIT = ("", "-", "1")


@dataclass(frozen=True)
class Style:
    """A way to write numbers.

    Attributes
    ----------
    padded : bool
        Whether all significant digits stand, zeros too.
    minus, missing, space : str
        Sign; what stands for no value; what stands before a unit.
    degrees : bool
        Whether rates are in degrees too, units as people write them; else SI as in the artifacts.
    """

    padded: bool
    minus: str
    missing: str
    space: str
    degrees: bool

    def number(self, value: float | None, digits: int = 3) -> str:
        """A number with significant digits; what stands for none where there is none."""
        if value is None or not math.isfinite(value):
            return self.missing
        if value == 0.0:
            return "0"
        value = float(f"{value:.{digits - 1}e}")  # 9.9996 has its digits as 10.0
        if not LEAST_PLAIN <= abs(value) < MOST_PLAIN:
            mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
            return f"{self._cut(mantissa)}e{exponent}".replace("-", self.minus)
        decimals = digits - 1 - math.floor(math.log10(abs(value)))
        return self._cut(f"{value:.{max(decimals, 0)}f}").replace("-", self.minus)

    def with_std(self, value: float, std: float | None) -> str:
        """A value and its standard deviation, both to the second digit of that."""
        if std is None or not 0.0 < std < math.inf:
            return self.number(value, 4)
        if not LEAST_PLAIN <= std < MOST_PLAIN:
            return f"{self.number(value, 4)} ± {self.number(std, 2)}"
        return with_std(value, std).replace("-", self.minus)

    def interval(self, low: float | None, high: float | None) -> str:
        """Both ends, to the second digit of half the width; none that is not zero as zero."""
        if low is None or high is None or not 0.0 < high - low < math.inf:
            return f"{self.number(low, 3)} to {self.number(high, 3)}"
        decimals = max(1 - math.floor(math.log10(0.5 * (high - low))), 0)
        return " to ".join(self._bound(end, decimals) for end in (low, high))

    def _bound(self, value: float, decimals: int) -> str:
        if not LEAST_PLAIN <= abs(value) < MOST_PLAIN or not round(value, decimals):
            return self.number(value, 2)
        return self._cut(f"{value:.{decimals}f}").replace("-", self.minus)

    def _cut(self, text: str) -> str:
        """Without zeros at the end of the decimals, unless they are kept."""
        return text if self.padded or "." not in text else text.rstrip("0").rstrip(".")

    def signs(self, text: str) -> str:
        """A text with the signs of the numbers in it; not those within names."""
        return re.sub(r"(?<!\w)-(?=\d)", self.minus, text)

    def shown(self, value: float | None, unit: str) -> float | None:
        """A value in the unit that is shown."""
        factor = SHOWN_UNITS.get(unit, ("", 1.0))[1] if self._converts(unit) else 1.0
        return None if value is None else value * factor

    def unit(self, unit: str) -> str:
        """The unit that values are shown in."""
        shown = SHOWN_UNITS.get(unit, (unit, 1.0))[0] if self._converts(unit) else unit
        return self.written_unit(shown)

    def _converts(self, unit: str) -> bool:
        return self.degrees or unit == ANGLE

    def written_unit(self, unit: str) -> str:
        """A unit as it is, with the signs of the style."""
        return unit_text(unit) if self.degrees else unit

    def quantity(self, value: float, unit: str, digits: int = 3) -> str:
        """A number with its unit, if it has one."""
        text = self.number(self.shown(value, unit), digits)
        return text if unit in NO_UNIT else f"{text}{self.space}{self.unit(unit)}"


def unit_text(unit: str) -> str:
    """A unit as people write it."""
    return unit.replace("^2", "²").replace("^3", "³").replace("1/min", "rpm")


TERMINAL = Style(padded=False, minus="-", missing="", space=" ", degrees=False)
PAGE = Style(padded=True, minus="−", missing="–", space="\u00a0", degrees=True)
