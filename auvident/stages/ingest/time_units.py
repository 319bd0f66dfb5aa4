"""Times that are in another unit than they are read in: milliseconds as seconds, or the reverse."""

from collections.abc import Iterator, Mapping

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.logs import RawSensor

WITHIN = 1.5  # factor: sensors of one trial start and stop together, more or less
FEWEST_OTHERS = 2
LEAST_SAMPLES = 20
# Span of a sensor over that of the others: what its time is in, and what it was read in.
UNITS = {1e3: ("ms", "s"), 1e6: ("us", "s"), 1e-3: ("s", "ms"), 1e-6: ("s", "us")}
# A DVL pings a few times a second, simulators write a thousand rows; whoever writes so many has
# more to show than a few lengths of way.
QUICK_HZ, SHORT_LENGTHS = 400.0, 10.0


def unit_by_span(sensors: Mapping[str, RawSensor]) -> list[Finding]:
    """What is said of sensors that last a thousand times as long as the others, or a thousandth.

    Parameters
    ----------
    sensors : mapping of str to RawSensor
        As read.
    """
    spans = {name: _span(s.time_s) for name, s in sensors.items() if s.time_s.size >= LEAST_SAMPLES}
    found = []
    for name, span in spans.items():
        others = [other for key, other in spans.items() if key != name]
        usual = float(np.median(others)) if len(others) >= FEWEST_OTHERS else 0.0
        unit = _unit(span, usual)
        if unit is not None:
            found.append(
                Finding(
                    code="time_unit",
                    message=f"{name} lasts {span:.4g} s, the others {usual:.4g} s: its time is "
                    f"likely in {unit[0]}, and was read in {unit[1]}",
                    where=sensors[name].file,
                    value=span / usual,
                    remedy=f'Say so in a map (--map): [{name}] time_unit = "{unit[0]}".',
                )
            )
    return found


def _span(time_s: np.ndarray) -> float:
    """Without the stamps at the ends, which may be glitches."""
    low, high = np.nanquantile(time_s, (0.01, 0.99))
    return float(high - low)


def _unit(span: float, usual: float) -> tuple[str, str] | None:
    if not (span > 0.0 and usual > 0.0):
        return None
    apart = {factor: abs(np.log(span / usual / factor)) for factor in UNITS}
    best = min(apart, key=lambda factor: apart[factor])
    return UNITS[best] if apart[best] < np.log(WITHIN) else None


def too_quick(rate_hz: float, duration_s: float, passage_s: float, where: str) -> Iterator[Finding]:
    """A trial that is over within a few lengths, of a DVL that samples like no DVL.

    Parameters
    ----------
    rate_hz : float
        Of the DVL.
    duration_s, passage_s : float
        Of the trial, and of a length of the vehicle at its speed.
    where : str
        Its file.
    """
    if rate_hz > QUICK_HZ and duration_s < SHORT_LENGTHS * passage_s:
        yield Finding(
            code="time_unit",
            message=f"the whole trial lasts {duration_s:.3g} s, with {rate_hz:,.0f} samples a "
            "second of the DVL: its times look like seconds read as milliseconds",
            where=where,
            value=rate_hz,
            threshold=QUICK_HZ,
            remedy='Check the unit of the time: time_unit = "s" in a map (--map), or time_s as the '
            "name of the column.",
        )
