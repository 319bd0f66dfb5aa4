"""The maneuvers that a model was identified from, to be predicted again."""

from collections.abc import Sequence

from auvident.engines.carried import Window
from auvident.engines.records import sensor_matrix
from auvident.engines.replay import Replay, replay_of
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.trial import Trial
from auvident.stages.identify.setup import records_of


def replay_in(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    model: IdentifiedModel,
    windows: Sequence[Window] = (),
) -> Replay | None:
    """The maneuvers behind a model; None where they are others now.

    Parameters
    ----------
    trials : sequence of Trial
    maneuvers : Maneuvers
    model : IdentifiedModel
    windows : sequence of (maneuver, start, end)
        Readings that it left out [s].
    """
    sensor = sensor_matrix(model.plane, model.sensing)
    found, rate_hz = records_of(trials, maneuvers, model.plane, sensor, windows)
    return replay_of(model, [record for _, record in found.values()], 1.0 / rate_hz)
