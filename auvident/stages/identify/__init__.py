"""Identification: the stages of a plan, from the ASE to the identified model."""

from auvident.engines.carried import Window
from auvident.engines.replay import Replay
from auvident.stages.identify.held_out import without_held_out
from auvident.stages.identify.replayed import replay_in
from auvident.stages.identify.setup import headings_compare, prepare
from auvident.stages.identify.shared import Shared, shared_of
from auvident.stages.identify.stage import Identification, identify

__all__ = [
    "Identification",
    "Replay",
    "Shared",
    "Window",
    "headings_compare",
    "identify",
    "prepare",
    "replay_in",
    "shared_of",
    "without_held_out",
]
