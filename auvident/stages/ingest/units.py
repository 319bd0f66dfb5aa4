"""Units that cannot be: a channel that is mostly beyond what a vehicle can do."""

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import Channel
from auvident.schema.logs import RawSensor

WRONG_SHARE = 0.05  # of the samples that differ from zero; outliers are rarer, a unit is not
NEAR_ZERO = 1e-3  # of the plausible limit: samples below it tell nothing about the unit
OTHER = "another unit or another quantity"
IN_DEGREES = ("_deg", "_degps")  # a column that is not in radians without a word
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
    column = raw.columns[channel.column]
    raise InputError(
        f"{100 * beyond.sum() / values.size:.0f} % of {column} is beyond "
        f"{channel.plausible:g} {channel.unit}, e.g. {values[beyond][0]:.4g} {channel.unit}; "
        f"looks like {OTHER if column.endswith(IN_DEGREES) else LIKELY[channel.unit]}",
        f"{raw.file}, row {raw.rows[0]} on, column {column}",
        "Give the column the suffix of its unit, or state the unit in a map (--map).",
    )
