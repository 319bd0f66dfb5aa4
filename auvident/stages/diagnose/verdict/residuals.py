"""What the predictions leave of the readings: by maneuver and channel, and over time."""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.free_run import RecordResidual
from auvident.engines.records import Record
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.diagnosis import ResidualRow
from auvident.schema.planes import PlaneRow
from auvident.schema.trial import Columns, stacked
from auvident.stages.diagnose.score.unknown_forces import unknown_forces
from auvident.stages.diagnose.select.candidates import Traced

Array = npt.NDArray[Any]

FORCE_UNITS = ("n", "n", "nm")


def force_columns(plane: PlaneRow) -> tuple[str, ...]:
    """Columns of the unknown forces and the moment of a plane."""
    pairs = zip(plane.axes, FORCE_UNITS, strict=True)
    return tuple(f"force_{axis}_{unit}" for axis, unit in pairs)


def residual_rows(traced: Traced) -> list[ResidualRow]:
    """Residual of each channel in each maneuver, before and after."""
    pairs = zip(traced.baseline.residuals, traced.final.residuals, strict=True)
    return [
        _row(traced, c, before, after)
        for before, after in pairs
        for c in range(len(traced.case.channels))
        if np.isfinite(before.error[:, c]).any()
    ]


def _row(traced: Traced, c: int, before: RecordResidual, after: RecordResidual) -> ResidualRow:
    return ResidualRow(
        maneuver=before.id,
        channel=traced.case.channels[c],
        unit=traced.case.plane.states[c].unit,
        rms=float(np.sqrt(np.nanmean(before.error[:, c] ** 2))),
        rms_after=float(np.sqrt(np.nanmean(after.error[:, c] ** 2))),
        noise_std=float(traced.case.setup.sensor_std[c]),
        correlation_time_s=traced.final.colours[c].time_s,
    )


def residual_table(traced: Traced, maneuvers: Maneuvers) -> Columns:
    """Channels of the identifying maneuvers, measured and predicted before and after.

    With the unknown forces that the model before would need to follow its readings.
    """
    case = traced.case
    by_id = {m.id: m for m in maneuvers.maneuvers}
    forces = unknown_forces(case, traced.baseline)
    residuals = zip(traced.baseline.residuals, traced.final.residuals, strict=True)
    tables = [
        _table(by_id[record.id], record, case.plane, pair, forces[record.id])
        for record, pair in zip(case.records, residuals, strict=True)
    ]
    return stacked(tables)


def _table(
    m: Maneuver,
    record: Record,
    plane: PlaneRow,
    residuals: tuple[RecordResidual, RecordResidual],
    forces: Array,
) -> Columns:
    before, after = residuals
    about = {"maneuver": m.id, "trial": m.trial, "kind": m.kind, "role": m.role}
    table: dict[str, Array] = {
        **{name: np.full(len(record), text) for name, text in about.items()},
        "time_s": record.time_s,
        plane.columns[3]: record.given[:, 3],
    }
    for c, column in enumerate(plane.columns[:3]):
        table[f"{column}_measured"] = record.measured[:, c]
        table[f"{column}_before"] = record.measured[:, c] - before.error[:, c]
        table[f"{column}_after"] = record.measured[:, c] - after.error[:, c]
    table["control_rad"] = record.inputs[:, 0]
    table.update(zip(force_columns(plane), forces.T, strict=True))
    return table
