"""A campaign: its file (which vehicles, which trials, with which options), and what came of it."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from auvident.schema.artifacts import Finding
from auvident.schema.base import Artifact, Declared
from auvident.schema.changes import Changes

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)]
State = Literal["done", "up to date", "failed", "planned"]


class RunOptions(Declared):
    """``[run]``: options of ``auvident run`` for all trials, unless a vehicle has its own."""

    rate_hz: float | None = Field(None, gt=0.0, description="sampling rate after ingest [Hz]")
    max_gap_s: float | None = Field(None, gt=0.0, description="longest gap that is bridged [s]")
    filter: Literal["ekf", "ukf"] | None = Field(None, description="filter of the identification")
    plane: Literal["horizontal", "vertical", "both", "found"] | None = Field(
        None, description="plane of motion"
    )
    plan: str | None = Field(None, description="plan of the identification, by name or file")
    fix: tuple[str, ...] = Field((), description="corrections that checks propose")
    hold_out: tuple[str, ...] = Field((), description="kinds or ids of maneuvers to hold out")


class CampaignVehicle(Declared):
    """``[[vehicle]]``: a vehicle with its trials."""

    name: Name = Field(description="its folder in the output")
    file: str = Field(description="vehicle file (TOML)")
    trials: tuple[str, ...] = Field(
        min_length=1,
        description="log folders or files, with * and ?; of a folder of trials, folder/*",
    )
    map: str | None = Field(None, description="column map (TOML)")
    run: RunOptions | None = Field(None, description="options in place of those of all")


class CampaignSettings(Declared):
    """``[campaign]``: how it runs and what it tests."""

    jobs: int | None = Field(
        None, ge=1, le=1024, description="trials at a time; all cores if absent"
    )
    false_alarms: float = Field(
        0.01, gt=0.0, le=0.5, description="probability of a change of a vehicle where there is none"
    )


class Campaign(Declared):
    """``CAMPAIGN.toml``."""

    campaign: CampaignSettings = CampaignSettings()  # type: ignore[call-arg]
    run: RunOptions = RunOptions()  # type: ignore[call-arg]
    vehicle: tuple[CampaignVehicle, ...] = Field(min_length=1)

    @field_validator("vehicle")
    @classmethod
    def _no_name_twice(cls, found: tuple[CampaignVehicle, ...]) -> tuple[CampaignVehicle, ...]:
        names = [v.name for v in found]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"two vehicles are named {', '.join(sorted(twice))}")
        return found


class CampaignTrial(Artifact):
    """A trial of a campaign: where it is, what came of it.

    ``problem`` says why it failed; ``nrmse`` are the held-out errors over their spread, of the
    refined model where there is one. ``fits`` is its distance from the other trials of its vehicle
    (1 by chance), ``pooled`` whether it went into their model.
    """

    vehicle: str
    trial: str
    log: str
    run: str
    state: State
    date: str = ""
    seconds: float = 0.0
    exit_code: int = 0
    problem: str = ""
    verdict: str = ""
    effects: tuple[str, ...] = ()
    maneuvers: int = 0
    rmse: dict[str, float] = {}
    nrmse: dict[str, float] = {}
    from_data: int = 0
    coefficients: int = 0
    fits: float | None = None
    pooled: bool = False
    reason: str = ""


class CampaignVehicleResult(Artifact):
    """A vehicle of a campaign in a plane: its pooled model, where it stands, and what changed.

    Where its trials have models of both planes it stands twice, with fewer trials as ``second``.
    """

    name: str
    plane: str
    second: bool = False
    model: str = ""
    trials: int = 0
    pooled: int = 0
    problem: str = ""
    summary: str = ""
    changes: Changes | None = None
    findings: tuple[Finding, ...] = ()
    repeat: tuple[dict[str, Any], ...] = ()

    @property
    def title(self) -> str:
        """Its name, and the plane where that is the second one."""
        return f"{self.name}, {self.plane} plane" if self.second else self.name


class CampaignResult(Artifact):
    """``campaign.json`` in the output of ``auvident campaign``."""

    schema_: str = Field(default="auvident/campaign/1", alias="schema")
    program_version: str
    trials: tuple[CampaignTrial, ...]
    vehicles: tuple[CampaignVehicleResult, ...] = ()
