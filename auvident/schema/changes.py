"""What changed of a vehicle from trial to trial, as a finding with its rate of false alarms."""

from typing import Literal

from pydantic import Field

from auvident.schema.artifacts import Finding
from auvident.schema.base import Artifact
from auvident.schema.planes import Plane


class SeriesPoint(Artifact):
    """A quantity in one trial, the others at their common values; no ``std`` where it is unseen."""

    trial: str
    date: str = ""
    value: float
    std: float | None = None


class VehicleChange(Artifact):
    """A step or a drift.

    ``what`` is a coefficient, a parameter of an effect, or a group of coefficients that change by
    one share; ``size`` is a share of the value before where ``share`` says so, else a difference in
    ``unit`` ("-" where it has none, as a scale error). ``trial`` is the first one with it,
    ``earliest`` and ``latest`` those that the data allow as well. ``p`` is the probability of as
    large a score anywhere in the series if nothing changed. ``rivals`` explain the same data as
    well.
    """

    kind: Literal["step", "drift"]
    what: str
    symbols: tuple[str, ...]
    sentence: str
    trial: str
    date: str = ""
    earliest: str
    latest: str
    size: float
    std: float
    low: float
    high: float
    unit: str
    share: bool
    score: float
    p: float
    rivals: tuple[str, ...] = ()


class LeftOutTrialError(Artifact):
    """RMSE of a channel on the held-out maneuvers of a trial that was not pooled, and its own.

    ``p`` is the probability of the pooled one being so much worse by chance.
    """

    trial: str
    channel: str
    unit: str
    pooled: float
    own: float
    p: float = 0.5


class Changes(Artifact):
    """What ``auvident pool`` and ``campaign`` say of a vehicle over its trials.

    ``false_alarms`` is the probability of one change or more where there is none, all ``tests``
    together; ``threshold`` the standardised score that chance reaches with it. ``series`` has every
    quantity that was tested, over the trials. ``left_out_last`` is why the last trial fits no
    other, where it does not: nobody can say yet whether the vehicle changed before it.
    """

    schema_: str = Field(default="auvident/changes/1", alias="schema")
    vehicle: str
    plane: Plane
    trials: tuple[str, ...]
    dates: tuple[str, ...] = ()
    dated: bool = False
    false_alarms: float
    threshold: float | None = None
    tests: int = 0
    changes: tuple[VehicleChange, ...] = ()
    series: dict[str, tuple[SeriesPoint, ...]] = {}
    left_out_last: str = ""
    findings: tuple[Finding, ...] = ()
