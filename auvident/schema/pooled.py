"""The model that trials of one vehicle make together: as identified, and what went into it."""

from pydantic import Field

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.base import Artifact

POOLED = "pooled"  # in place of the name of a plan


class PooledValue(Artifact):
    """Value and standard deviation of a parameter of one trial, in the unit of its table."""

    value: float
    std: float
    unit: str


class PooledTrial(Artifact):
    """A trial that was given, and whether it went in.

    ``square`` is its distance from the others together, a chi-square in ``directions`` that it
    sees, ``p`` the probability of a larger one. ``own`` has its own water, ballast and clocks;
    ``shrunk`` its coefficients as it and the others have them together. ``reason`` says why it was
    left out, ``logs`` are those behind its model, by the hash of the file with their gyro.
    """

    trial: str
    date: str = ""
    file: str = ""
    logs: dict[str, str] = {}
    maneuvers: int = 0
    used: bool = True
    reason: str = ""
    square: float = 0.0
    directions: int = 0
    p: float = 1.0
    clipped: float = 0.0
    own: dict[str, PooledValue] = {}
    alone: dict[str, PooledValue] = {}
    shrunk: dict[str, PooledValue] = {}


DISAGREE = 0.01  # probability of so much scatter between trials by chance


class PooledParameter(Artifact):
    """What trials say of a coefficient (or of an effect) together.

    ``share_alone`` and ``share_best`` are the shares of the data in a single trial, mean and best,
    ``share`` that of all together. ``between_std`` is its scatter between trials, ``q`` and ``p``
    Cochran's test that there is none; ``structural_std`` what the equations lack in every trial.
    """

    symbol: str
    unit: str
    value: float
    std: float
    prior: float
    prior_std: float
    share_alone: float
    share_best: float
    share: float
    between_std: float = 0.0
    structural_std: float = 0.0
    q: float = 0.0
    freedom: float = 0.0
    p: float = 1.0


class Pooling(Artifact):
    """How trials were pooled; ``q``, ``freedom``, ``p``: do they agree, all coefficients together.

    ``clipped`` is the largest share of a prior's information by which a posterior was wider than
    its prior, set to zero.
    """

    trials: tuple[PooledTrial, ...]
    parameters: tuple[PooledParameter, ...]
    q: float
    freedom: float
    p: float
    clipped: float


class PooledModel(IdentifiedModel):
    """What ``auvident pool`` writes: a model as of ``identify``, with ``pooling``."""

    pooling: Pooling = Field(description="the trials behind it")
