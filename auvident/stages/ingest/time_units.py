"""Times in another unit than they are read in, and times of day of which midnight is in between."""

from collections.abc import Iterator, Mapping

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.logs import RawSensor

DAY_S = 86400.0
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


def a_day_apart(sensors: Mapping[str, RawSensor]) -> list[Finding]:
    """What is said of sensors that start a day before the others: past midnight, without a date.

    Parameters
    ----------
    sensors : mapping of str to RawSensor
        As read.
    """
    starts = {name: float(np.nanmin(s.time_s)) for name, s in sensors.items() if s.time_s.size}
    last = max(starts.values(), default=0.0)
    longest = max((_span(sensors[name].time_s) for name in starts), default=0.0)
    early = {name: last - start for name, start in starts.items() if last - start > 0.5 * DAY_S}
    return [
        Finding(
            code="clock_day",
            message=f"{name} starts {apart:.0f} s before the last sensor: its first row is past "
            "midnight, and times of day have no date",
            where=sensors[name].file,
            value=apart,
            threshold=0.5 * DAY_S,
            remedy=f"Put it a day later in a map (--map): [{name}] time_offset_s = {DAY_S:.0f}.",
        )
        for name, apart in early.items()
        if starts[name] >= 0.0 and abs(apart - DAY_S) < min(longest, 0.5 * DAY_S)
    ]


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
