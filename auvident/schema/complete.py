"""Whether the file of a model has all that a model is flown with."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.coefficients import symbols_of
from auvident.schema.combined import CombinedModel
from auvident.schema.effects import BY_ID
from auvident.schema.planes import PLANES, Plane
from auvident.schema.quoting import clipped

# of both planes, and of the body
OF_WHOLE = ("X_udot", "X_uu", "T_nn", "T_nu", "m", "I_xx", "I_yy", "I_zz", "W-B", "x_GW", "z_GW")


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


def unknown_effects(names: Iterable[str]) -> str:
    """That this version does not know some effects, in words; empty where it knows all."""
    unknown = [name for name in names if name not in BY_ID]
    listed = clipped(", ".join(unknown))
    return f"the effects {listed} are unknown to this version" if unknown else ""


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


def _of_plane(plane: Plane, there: Collection[str]) -> tuple[str, ...]:
    """Symbols that a plane needs; none where nothing of it is there (a ship)."""
    other = symbols_of(next(p for p in PLANES if p != plane))
    own = tuple(s for s in symbols_of(plane) if s not in other)
    return own if any(s in there for s in own) else ()


def lacking_of_whole(model: CombinedModel) -> str:
    """The same of a model of six degrees of freedom."""
    if not model.length_m > 0.0:
        return f"length_m is {model.length_m:g}"
    there = {e.symbol for e in model.entries} | model.parameters.keys()
    unknown = unknown_effects(e for p in PLANES for e in model.effect_ids(p))
    if unknown:
        return unknown
    wanted = [*OF_WHOLE, *(s for plane in PLANES for s in _of_plane(plane, there))]
    wanted += [s for block in model.covariance for s in block.symbols]
    missing = [s for s in dict.fromkeys(wanted) if s not in there]
    missing += [
        name
        for plane in PLANES
        for effect in model.effect_ids(plane)
        for name in BY_ID[effect].names(plane)  # one that acts on the surge alone is of both planes
        if not {name, f"{plane} {name}"} & there
    ]
    return f"lacks {', '.join(missing)}" if missing else ""
