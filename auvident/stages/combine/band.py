"""What the models of the planes know of the errors of a prediction, for the whole vehicle."""

import math
from collections.abc import Iterator, Sequence

from auvident.engines.predictive import noise_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.combined import ChannelBand
from auvident.schema.planes import BY_PLANE


def band_of_planes(models: Sequence[IdentifiedModel]) -> dict[str, ChannelBand]:
    """The band of each channel by its symbol; without those of which no model tells.

    Both planes tell of the surge velocity: the wider band of the two is taken, as the maneuvers of
    either plane are to lie within it.
    """
    found: dict[str, ChannelBand] = {}
    for model in models:
        for name, row in _rows(model):
            if name not in found or _reach(row) > _reach(found[name]):
                found[name] = row
    return found


def _rows(model: IdentifiedModel) -> Iterator[tuple[str, ChannelBand]]:
    """Channels of the states of a model; the track is compared as a radius, and left out."""
    errors = model.left_out.model_error if model.left_out else {}
    noise = noise_of(model.sensing, model.plane)
    for name in (state.symbol for state in BY_PLANE[model.plane].states):
        if name in errors:
            told = errors[name].model_dump()
            yield name, ChannelBand(plane=model.plane, noise_std=noise[name], **told)


def _reach(row: ChannelBand) -> float:
    """Half width at the start, where the coefficients add nothing yet."""
    return row.factor * math.hypot(row.std, row.noise_std)
