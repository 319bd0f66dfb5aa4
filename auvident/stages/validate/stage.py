"""Prediction of every maneuver by the model and by its prior, and the errors of both."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.carried import frame_of, predicted_course, structure_behind, vector_behind
from auvident.engines.falling import MEMBERS
from auvident.engines.flown import beyond_in_turn
from auvident.engines.predictive import Band, band_of, measured_channels, measured_track
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.physics.dynamics import ALL_STATES
from auvident.physics.maneuvers import (
    headings_from_start,
    track_of,
    turn_figures,
    zigzag_figures,
)
from auvident.physics.terms import Structure
from auvident.physics.virtual import run_virtual, zigzag_helm
from auvident.schema.artifacts import (
    RAN_AWAY,
    ChannelMetrics,
    Finding,
    IdentifiedModel,
    Maneuver,
    ManeuverMetrics,
    Maneuvers,
    Metrics,
    ResidualTests,
)
from auvident.schema.planes import BY_PLANE, STATE_COLUMNS, TRACK, Plane
from auvident.schema.trial import Trial
from auvident.stages.validate.band import FLAT, coverage_of, cross_validation_of
from auvident.stages.validate.findings import findings_of
from auvident.stages.validate.horizons import HORIZONS_S, over_the_same_spread, windows_of
from auvident.stages.validate.residuals import Compared, residuals_of

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Validation:
    """What `validate` returns: the metrics, and measured and simulated channels side by side."""

    metrics: Metrics
    simulation: pd.DataFrame


@dataclass(frozen=True)
class Prediction:
    """One maneuver measured and predicted.

    Readings (n, 4) at the sensors (u, a, b, angle) are what errors are taken of; states (n, 4)
    at the origin are what tracks and figures are made of.
    """

    maneuver: Maneuver
    record: Record
    measured: Array
    predicted: Array
    states: Array

    @property
    def ran_away(self) -> bool:
        """Whether the prediction left every bound."""
        return not bool(np.isfinite(self.predicted).all())


def validate(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    model: IdentifiedModel,
    *,
    estimated: bool = True,
) -> Validation:
    """Predict every maneuver of the model's plane and compare with what was measured.

    A prediction starts from the measured initial state and is given only the logged inputs
    (rudder, elevator, propeller rate) after that. The same is done with the prior coefficients
    of the model (the ASE), so that the gain from identification is seen.

    Parameters
    ----------
    trials : sequence of Trial
    maneuvers : Maneuvers
    model : IdentifiedModel
    estimated : bool
        Whether the prior is the estimate from geometry; else the findings call it given.

    Returns
    -------
    Validation
        ``summary`` pools all samples of all maneuvers of a role.
    """
    identified, structure = vector_behind(model), structure_behind(model)
    bare = model.model_copy(update={"effects": ()})
    estimate, plain = vector_behind(bare, model.priors()), structure_behind(bare)
    after = predict_all(trials, maneuvers, model, identified)
    before = predict_all(trials, maneuvers, bare, estimate)
    metrics = _metrics(after, structure, identified)
    prior = {"ase": _metrics(before, plain, estimate), "estimated": estimated}
    metrics = metrics.model_copy(update=prior)
    findings = (*metrics.findings, *findings_of(metrics, model, estimated))
    dts = {trial.name: 1.0 / trial.rate_hz for trial in trials}
    cut = _in_windows(trials, maneuvers, model)
    bands = [band_of(model, p.record, dts[p.maneuver.trial]) for p in after]
    metrics = metrics.model_copy(
        update={
            "coverage": coverage_of(
                (channel_pairs(p, model.plane), band.half_width)
                for p, band in zip(after, bands, strict=True)
                if p.maneuver.role == "validate"
            ),
            "cross_validation": cross_validation_of(model),
            "residuals": _residuals(after, model, min(dts.values())),
            "horizons": _at_horizons(cut, model.plane, metrics.summary.get("validate", {})),
            "findings": (*findings, *windows_lost(cut), *drawn_lost(after, bands)),
            "extrapolation": beyond_in_turn(
                [p.record for p in after if p.maneuver.role == "validate"],
                [p.record for p in after if p.maneuver.role == "identify"],
                model.plane,
            ),
        }
    )
    tables = [
        _table(a, b, model.plane, band.half_width)
        for a, b, band in zip(after, before, bands, strict=True)
    ]
    return Validation(metrics, pd.concat(tables, ignore_index=True))


def _residuals(
    predictions: Sequence[Prediction], model: IdentifiedModel, dt_s: float
) -> dict[str, dict[str, ResidualTests]]:
    """Residual analysis of the predictions that do not run away."""
    compared, plane = [], model.plane
    for p in (p for p in predictions if not p.ran_away):
        channels = {name: (m, s) for name, _, m, s in channel_pairs(p, plane) if name != TRACK}
        inputs = {BY_PLANE[plane].fin: p.record.inputs[:, 0], "rpm": p.record.inputs[:, 2]}
        compared.append(Compared(p.maneuver.role, channels, inputs))
    return residuals_of(compared, plane, dt_s, model.sensing.noise_std)


def predict_all(
    trials: Sequence[Trial], maneuvers: Maneuvers, model: IdentifiedModel, parameters: Array
) -> list[Prediction]:
    """Predictions of every maneuver of the model's plane with a parameter vector."""
    by_name = {trial.name: trial for trial in trials}
    return [
        _predict(m, by_name[m.trial], model, parameters)
        for m in maneuvers.maneuvers
        if m.shows(model.plane)
    ]


def _in_windows(
    trials: Sequence[Trial], maneuvers: Maneuvers, model: IdentifiedModel
) -> dict[str, list[Prediction]]:
    """Predictions of the held-out maneuvers in windows, by their length in seconds."""
    p = vector_behind(model)
    return {f"{h:g}": predict_all(trials, windows_of(maneuvers, h), model, p) for h in HORIZONS_S}


def _at_horizons(
    cut: Mapping[str, Sequence[Prediction]], plane: Plane, free: Mapping[str, ChannelMetrics]
) -> dict[str, dict[str, ChannelMetrics]]:
    """Errors of the windows that do not run away, as shares of what varies in whole maneuvers."""
    errors = {s: _pooled([p for p in made if not p.ran_away], plane) for s, made in cut.items()}
    return {s: over_the_same_spread(found, free) for s, found in errors.items() if found}


def windows_lost(cut: Mapping[str, Sequence[Prediction]]) -> tuple[Finding, ...]:
    """Windows whose errors are not in those of their horizon."""
    lost = {horizon: sum(p.ran_away for p in made) for horizon, made in cut.items()}
    return tuple(
        Finding(
            code="window-ran-away",
            where=f"{horizon} s",
            value=float(count),
            message=f"the prediction diverges in {count} of {len(cut[horizon])} windows of this "
            "length, so their errors are not in those of this horizon",
            remedy="The model is unstable where these begin: trust no error of this horizon.",
        )
        for horizon, count in lost.items()
        if count
    )


def drawn_lost(predictions: Sequence[Prediction], bands: Sequence[Band]) -> tuple[Finding, ...]:
    """Maneuvers whose band leaves out models that were drawn for it, as these run away."""
    return tuple(
        Finding(
            code="drawn-models-run-away",
            where=p.maneuver.id,
            value=float(band.ran_away),
            message=f"{band.ran_away} of {MEMBERS} models drawn for the band diverge; the band is "
            "that of the others",
            remedy="The model is too uncertain for this maneuver: it may be off by more.",
        )
        for p, band in zip(predictions, bands, strict=True)
        if band.ran_away
    )


def _predict(maneuver: Maneuver, trial: Trial, model: IdentifiedModel, p: Array) -> Prediction:
    sensor = sensor_matrix(model.plane, model.sensing)
    record = record_of(maneuver, trial, model.plane, sensor)
    dt = 1.0 / trial.rate_hz
    course = predicted_course(frame_of(model, dt), p, record, ALL_STATES)
    measured = measured_channels(record, dt)
    return Prediction(maneuver, record, measured, course.readings, course.over_ground)


def _metrics(predictions: Sequence[Prediction], structure: Structure, parameters: Array) -> Metrics:
    plane = structure.plane
    good = [p for p in predictions if not p.ran_away]
    roles = sorted({p.maneuver.role for p in good})
    return Metrics(
        maneuvers=tuple(_one(p, structure, parameters) for p in good),
        summary={
            role: _pooled([p for p in good if p.maneuver.role == role], plane) for role in roles
        },
        findings=tuple(_escaped(p) for p in predictions if p.ran_away),
    )


def _escaped(prediction: Prediction) -> Finding:
    row = int(np.flatnonzero(~np.isfinite(prediction.predicted).all(axis=1))[0])
    seconds = prediction.record.time_s[row] - prediction.record.time_s[0]
    return Finding(
        code=RAN_AWAY,
        message=f"the prediction diverges {seconds:.1f} s after the start",
        where=prediction.maneuver.id,
        remedy="The model is unstable in this maneuver; the summary leaves its errors out.",
    )


def compare(measured: Array, simulated: Array, unit: str) -> ChannelMetrics | None:
    """Metrics of one channel; rows that were not measured do not count.

    RMSE; NRMSE = RMSE / standard deviation of the measured channel; R2 = 1 - NRMSE^2; Theil's
    inequality coefficient = RMSE / (rms measured + rms simulated), 0 perfect, 1 useless.

    Parameters
    ----------
    measured, simulated : (n,) or (n, m) array
        With m columns the errors are vectors (a track).

    Returns
    -------
    ChannelMetrics or None
        None when nothing was measured.
    """
    measured, simulated = measured.reshape(len(measured), -1), simulated.reshape(len(simulated), -1)
    seen = np.isfinite(measured).all(axis=1)
    if not seen.any():
        return None
    m, s = measured[seen], simulated[seen]
    rmse = float(np.sqrt(np.mean(np.sum((m - s) ** 2, axis=1))))
    spread = float(np.sqrt(np.sum(np.var(m, axis=0))))
    size = sum(float(np.sqrt(np.mean(np.sum(x**2, axis=1)))) for x in (m, s))
    nrmse = rmse / max(spread, FLAT)
    return ChannelMetrics(
        rmse=rmse,
        nrmse=nrmse,
        r2=1.0 - nrmse**2,
        theil=rmse / size if size > FLAT else 0.0,
        unit=unit,
        samples=int(seen.sum()),
    )


def channel_pairs(p: Prediction, plane: Plane) -> Iterable[tuple[str, str, Array, Array]]:
    """Name, unit, measured and simulated of each channel; angles from the maneuver's start."""
    for c, state in enumerate(BY_PLANE[plane].states):
        measured, simulated = p.measured[:, c], p.predicted[:, c]
        if state.wraps:
            measured, simulated = headings_from_start(measured, simulated)
        yield state.symbol, state.unit, measured, simulated
    if plane == "horizontal":
        yield TRACK, "m", *tracks(p)


def tracks(p: Prediction) -> tuple[Array, Array]:
    """Dead-reckoned track (n, 2), north and east from the start: measured and predicted."""
    return measured_track(p.record, p.measured), track_of(p.record.time_s, p.states)


def virtual_zigzag(p: Prediction, structure: Structure, parameters: Array) -> dict[str, float]:
    """Figures of the same zigzag with the model's own heading deciding when to reverse.

    Amplitude, switching angle, first side, propeller rate and slew of the fin are the measured
    ones. Empty when the measured zigzag has no figures to repeat.
    """
    control, time = p.record.inputs[:, 0], p.record.time_s
    measured = zigzag_figures(time, _filled(p.measured[:, 3]), control)
    if "switch_deg" not in measured or "rudder_deg" not in measured:
        return {}
    first = control[np.argmax(np.abs(control) >= 0.5 * math.radians(measured["rudder_deg"]))]
    helm = zigzag_helm(
        math.copysign(math.radians(measured["rudder_deg"]), first),
        math.radians(measured["switch_deg"]),
    )
    dt = float(time[1] - time[0])
    run = run_virtual(
        structure,
        parameters,
        p.record.start,
        float(np.median(p.record.inputs[:, 2])),
        float(time[-1] - time[0]),
        helm,
        dt_s=dt,
        rate_limit_radps=float(np.abs(np.diff(control)).max()) / dt,
    )
    return zigzag_figures(
        run.time_s,
        run.states[:, 3],
        run.inputs[:, 0],
        switch_rad=math.radians(measured["switch_deg"]),
    )


def _filled(angle: Array) -> Array:
    """Angle with its gaps bridged by a line."""
    seen = np.isfinite(angle)
    return np.interp(np.arange(len(angle)), np.flatnonzero(seen), angle[seen])


def _one(p: Prediction, structure: Structure, parameters: Array) -> ManeuverMetrics:
    plane = structure.plane
    channels = {
        name: metrics
        for name, unit, measured, simulated in channel_pairs(p, plane)
        if (metrics := compare(measured, simulated, unit)) is not None
    }
    m = p.maneuver
    figures = {m.kind: _figures(p)} if m.kind in ("turn", "zigzag") else {}
    if m.kind == "zigzag" and (virtual := virtual_zigzag(p, structure, parameters)):
        figures[m.kind]["virtual"] = virtual
    return ManeuverMetrics(
        id=m.id,
        trial=m.trial,
        kind=m.kind,
        role=m.role,
        duration_s=float(p.record.time_s[-1] - p.record.time_s[0]),
        channels=channels,
        **figures,
    )


def _figures(p: Prediction) -> dict[str, dict[str, float]]:
    """Figures of a turn or zigzag, measured and simulated."""
    t, control = p.record.time_s, p.record.inputs[:, 0]
    measured = np.column_stack([p.record.given[:, :3], _filled(p.measured[:, 3])])
    if p.maneuver.kind == "turn":
        return {
            name: turn_figures(t, x[:, 0], x[:, 1], x[:, 2], control, x[:, 3])
            for name, x in (("measured", measured), ("simulated", p.states))
        }
    found = zigzag_figures(t, measured[:, 3], control)
    # steered at the times of the log, the simulated motion reverses at another angle: the initial
    # turning time of both is to the measured one
    switch = math.radians(found["switch_deg"]) if "switch_deg" in found else None
    simulated = zigzag_figures(t, p.states[:, 3], control, switch_rad=switch)
    return {"measured": found, "simulated": simulated}


def _pooled(predictions: Sequence[Prediction], plane: Plane) -> dict[str, ChannelMetrics]:
    """Metrics over all samples of all maneuvers together."""
    pooled: dict[str, tuple[str, list[Array], list[Array]]] = {}
    for p in predictions:
        for name, unit, measured, simulated in channel_pairs(p, plane):
            _, m, s = pooled.setdefault(name, (unit, [], []))
            m.append(measured)
            s.append(simulated)
    found = {}
    for name, (unit, m, s) in pooled.items():
        metrics = compare(np.concatenate(m), np.concatenate(s), unit)
        if metrics is not None:
            found[name] = metrics
    return found


def _table(
    after: Prediction, before: Prediction, plane: Plane, band: Mapping[str, Array]
) -> pd.DataFrame:
    """Measured, simulated and ASE channels of one maneuver with its inputs, row by row.

    The band of the track is a circle: those of north and east are its extent.
    """
    m, record = after.maneuver, after.record
    columns: dict[str, Any] = {
        "maneuver": m.id,
        "trial": m.trial,
        "kind": m.kind,
        "role": m.role,
        "time_s": record.time_s,
    }
    for c, column in enumerate(STATE_COLUMNS[plane]):
        columns[f"{column}_measured"] = after.measured[:, c]
        columns[f"{column}_simulated"] = after.predicted[:, c]
        columns[f"{column}_ase"] = before.predicted[:, c]
    columns["control_rad"] = record.inputs[:, 0]
    columns["rpm"] = record.inputs[:, 2] * 60.0
    if plane == "horizontal":
        measured, simulated = tracks(after)
        named = {"measured": measured, "simulated": simulated, "ase": tracks(before)[1]}
        for name, track in named.items():
            columns[f"north_m_{name}"], columns[f"east_m_{name}"] = track[:, 0], track[:, 1]
    stems = [(state.column, state.symbol) for state in BY_PLANE[plane].states]
    for stem, channel in (*stems, ("north_m", TRACK), ("east_m", TRACK)):
        if channel in band:
            middle = columns[f"{stem}_simulated"]
            columns[f"{stem}_lo"] = middle - band[channel]
            columns[f"{stem}_hi"] = middle + band[channel]
    return pd.DataFrame(columns)
