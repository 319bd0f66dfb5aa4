"""Inputs that no file holds: the map states one value for the whole trial."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_COLUMN, Channel
from auvident.schema.logs import ColumnMap, RawSensor, RawTrial

IN_THE_MAP = "the map"  # what stands for the file of such an input
REMEDY = "Log the input, or identify from trials in which it was logged."


def with_constants(raw: RawTrial, column_map: ColumnMap) -> RawTrial:
    """The trial with the inputs that the map states, each with a finding that says so.

    They hold from the first sample of any sensor on.
    """
    stated = column_map.constants()
    starts = [float(s.time_s.min()) for s in raw.sensors.values() if s.time_s.size]
    if not stated or not starts:
        return raw
    added = {BY_COLUMN[c].sensor: _constant(c, value, min(starts)) for c, value in stated.items()}
    findings = (*raw.findings, *_findings(raw.name, stated))
    return replace(raw, sensors=raw.sensors | added, findings=findings)


def _constant(column: str, value: float, start_s: float) -> RawSensor:
    """One command at the start that is never changed."""
    return RawSensor(
        sensor=BY_COLUMN[column].sensor,
        file=IN_THE_MAP,
        time_s=np.array([start_s]),
        values={column: np.array([value])},
        rows=np.zeros(1, dtype=np.int64),
        columns={column: f"constant {value:g}"},
        rows_read=0,
        on_change=True,
        not_logged={column: "constant"},
    )


def _findings(trial: str, stated: dict[str, float]) -> Iterator[Finding]:
    for column, value in stated.items():
        channel = BY_COLUMN[column]
        yield Finding(
            code="constant_input",
            message=f"{column} was not logged: the map states {value:g} {channel.unit} for the "
            f"whole trial{_consequence(channel)}",
            where=f"trial {trial}",
            value=value,
            remedy=REMEDY,
        )


def _consequence(channel: Channel) -> str:
    if channel.quantity == "rpm":
        return "; thrust and drag cannot be separated: such a log shows only their sum"
    return f"; nothing in the log shows what the {channel.quantity} does"
