"""Whether the file of a model has all that a model is flown with."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.coefficients import symbols_of
from auvident.schema.effects import BY_ID
from auvident.schema.quoting import clipped


def lacking(model: IdentifiedModel) -> str:
    """What a model lacks, in words; empty where nothing is missing.

    Without a coefficient the equations would go on as if it were zero. Effects that this version
    does not know are no matter here: the model can be shown, if not flown.
    """
    if not model.length_m > 0.0:
        return f"length_m is {model.length_m:g}"
    there = {c.symbol for c in model.coefficients}
    missing = [s for s in symbols_of(model.plane) if s not in there]
    if missing:
        return f"lacks {', '.join(missing)}"
    return next(_without_value(model), "")


def _without_value(model: IdentifiedModel) -> Iterator[str]:
    for effect in model.effects:
        name = str(effect.get("id", ""))
        if not name:
            yield "has an effect without id"
        for parameter in BY_ID[name].names(model.plane) if name in BY_ID else ():
            if not _is_number(effect.get("internal"), parameter):
                yield f"the effect {clipped(name)} has no internal value of {parameter}"


def _is_number(internal: Any, name: str) -> bool:
    value = internal.get(name) if isinstance(internal, Mapping) else None
    return isinstance(value, int | float) and math.isfinite(value)
