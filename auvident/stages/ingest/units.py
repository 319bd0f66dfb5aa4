"""Units that cannot be: a channel that is mostly beyond what a vehicle can do."""

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import Channel
from auvident.schema.logs import RawSensor
from auvident.schema.quoting import quoted

WRONG_SHARE = 0.05  # of the samples that differ from zero; outliers are rarer, a unit is not
NEAR_ZERO = 1e-3  # of the plausible limit: samples below it tell nothing about the unit
OTHER = "another unit or another quantity"
IN_DEGREES = ("_deg", "_degps")  # a column that is not in radians without a word
IN_RADIANS = ("_rad", "_radps")
BY_MAP: dict[str, str] = {  # of a column whose unit is the map's word
    "rad": "degrees read as radians, or another quantity (counts, pulses, percent)",
    "rad/s": "degrees per second read as radians per second, or another quantity",
}
EXAMPLE = {"rad": "deg", "rad/s": "degps", "m/s": "mps", "1/min": "rpm", "m": "m"}
LIKELY: dict[str, str] = {
    "rad": "degrees in a _rad column",
    "rad/s": "degrees per second in a _radps column",
    "m/s": "another unit (cm/s, mm/s) or another quantity",
    "1/min": OTHER,
    "m": OTHER,
}


def refuse_wrong_unit(raw: RawSensor, channel: Channel, values: np.ndarray) -> None:
    """Refuse a channel when a good share of its samples is beyond `Channel.plausible`.

    Raises
    ------
    InputError
        With file, column, share and what it looks like.
    """
    size = np.abs(values)
    moving = size > NEAR_ZERO * channel.plausible
    beyond = size > channel.plausible
    if not beyond.any() or beyond.sum() <= max(3, WRONG_SHARE * moving.sum()):
        return
    column, unit = raw.columns[channel.column], EXAMPLE[channel.unit]
    first = values[beyond][0]
    in_degrees = f" ({np.degrees(first):.4g} degrees)" if channel.unit == "rad" else ""
    raise InputError(
        f"{100 * beyond.sum() / values.size:.0f} % of {column} is beyond "
        f"{channel.plausible:g} {channel.unit}, e.g. {first:.4g} {channel.unit}{in_degrees}; "
        f"looks like {_likely(column, channel)}",
        f"{raw.file}, row {raw.rows[0]} on, column {column}",
        "Give the column the suffix of its unit, or state the unit in a map (--map):"
        f"\n    [{channel.sensor}]"
        f'\n    {channel.quantity} = {{ column = "{quoted(column)}", unit = "{unit}" }}'
        "\n  Where it counts something else, add scale and offset to that line: a value in "
        f"{unit} is scale times the number, plus offset.",
    )


def _likely(column: str, channel: Channel) -> str:
    """What a column with impossible values looks like."""
    if column.endswith(IN_DEGREES):
        return OTHER
    by_name = not column.endswith(IN_RADIANS) and BY_MAP.get(channel.unit)
    return by_name or LIKELY[channel.unit]
