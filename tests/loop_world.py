"""A made-up but plausible diagnosis and comparison of a run, and stages that return them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest

from auvident.pipeline.given import Given
from auvident.pipeline.table import BY_NAME
from auvident.schema.artifacts import IdentifiedModel, Maneuver, Maneuvers
from auvident.schema.diagnosis import (
    Candidate,
    ChannelError,
    CoefficientComparison,
    Comparison,
    Detectable,
    Diagnosis,
    Difference,
    EffectFound,
    HeldOut,
    Lookalikes,
    ManeuverComparison,
    ParameterValue,
    ResidualRow,
)
from auvident.schema.effects import BY_ID, parameter_of
from auvident.schema.trial import Trial

CHANNELS = (("u", "u_mps", "m/s"), ("v", "v_mps", "m/s"), ("r", "r_radps", "rad/s"))
BEFORE = {"u": 0.046, "v": 0.041, "r": 0.0062}
TRACK_M = 20.0  # off by so much for each m/s
AFTER = {"u": 0.0061, "v": 0.0055, "r": 0.0060}
NORTH = ParameterValue(
    symbol="north_mps", value=-0.121, std=0.004, unit="m/s", low=-0.129, high=-0.113
)
EAST = ParameterValue(symbol="east_mps", value=0.083, std=0.005, unit="m/s")
CURRENT = EffectFound(
    id="current",
    family="environment",
    parameters=(NORTH, EAST),
    plain="a current of 0.15 m/s that sets to 145 degrees",
)
EVENT = EffectFound(
    id="one_off_event",
    family="environment",
    parameters=(),
    plain="a disturbance",
    maneuver="harbour_trial-turn-2",
    time_s=431.5,
    duration_s=6.0,
)
STATEMENT = "The model lacks a current: 0.15 m/s that sets to 145 degrees."
NONE = "Nothing is missing that these maneuvers could show."
LAG = ParameterValue(symbol="lag_s", value=0.04, std=0.03, unit="s")
CANDIDATES = (
    Candidate(
        id="current",
        family="environment",
        gain=812.4,
        p=0.005,
        parameters=(NORTH, EAST),
        held_back_gain=640.2,
        improved=1.0,
        rms_fall={"u": 0.86, "v": 0.84},
        refitted=True,
    ),
    Candidate(
        id="dvl_misalignment",
        family="sensing",
        gain=220.0,
        p=0.005,
        held_back_gain=31.0,
        rejected="gains less than current and nothing beside it",
    ),
    Candidate(
        id="rudder_lag",
        family="actuation",
        gain=3.1,
        p=0.62,
        parameters=(LAG,),
        held_back_gain=-0.4,
        improved=0.5,
        rejected="as likely by chance (p = 0.62)",
    ),
    *(
        Candidate(id=name, family=family, gain=1.0 / (i + 1), p=0.9, rejected="gains too little")
        for i, (name, family) in enumerate(
            [
                ("gyro_bias", "sensing"),
                ("thrust_sag", "actuation"),
                ("linear_drag", "hydrodynamics"),
                ("cubic_damping", "hydrodynamics"),
                ("rudder_stall", "actuation"),
                ("rudder_offset", "actuation"),
                ("hull_asymmetry", "hydrodynamics"),
            ]
        )
    ),
)


def sees() -> tuple[Detectable, ...]:
    rows = (
        ("current", "environment", "north_mps", 0.011, "m/s", True, 0.9, ""),
        ("current", "environment", "east_mps", 0.014, "m/s", True, 0.9, ""),
        ("rudder_lag", "actuation", "lag_s", 0.07, "s", True, 0.6, ""),
        ("rudder_rate_limit", "actuation", "rate_degps", 31.0, "deg/s", True, 0.7, ""),
        ("gyro_bias", "sensing", "bias_degps", 0.03, "deg/s", True, 0.5, ""),
        ("dvl_lever_arm", "sensing", "dx_m", 0.05, "m", True, 0.5, ""),
        ("dvl_lever_arm", "sensing", "dy_m", 0.9, "m", False, 0.05, "the coefficients take it up"),
        ("dvl_scale", "sensing", "fraction", 0.4, "-", False, 0.0, "no position was logged"),
        ("roll_coupling", "hydrodynamics", "Y_uuphi", 5.0, "kg/m", False, 0.0, "no roll logged"),
        ("roll_coupling", "hydrodynamics", "N_uuphi", 5.0, "kg", False, 0.0, "no roll logged"),
        ("hull_asymmetry", "hydrodynamics", "Y_0", 0.2, "kg/m", True, 0.4, ""),
    )
    names = ("id", "family", "symbol", "size", "unit", "visible", "kept", "why")
    return tuple(Detectable(**dict(zip(names, row, strict=True))) for row in rows)  # type: ignore


def residual_rows(maneuvers: Sequence[str], after: dict[str, float]) -> tuple[ResidualRow, ...]:
    noise = {"u": 0.005, "v": 0.005, "r": 0.0009}
    return tuple(
        ResidualRow(
            maneuver=name,
            channel=channel,
            unit=unit,
            rms=BEFORE[channel],
            rms_after=after[channel],
            noise_std=noise[channel],
            correlation_time_s=4.2,
        )
        for name in maneuvers
        for channel, _, unit in CHANNELS
    )


def diagnosis(maneuvers: Sequence[str] = ("turn-1",), **update: Any) -> Diagnosis:
    """What a current of the sea leaves behind."""
    found = Diagnosis(
        plane="horizontal",
        verdict="effect_found",
        statement=STATEMENT,
        effects=(CURRENT,),
        candidates=CANDIDATES,
        sees=sees(),
        lookalikes=(
            Lookalikes(
                ids=("rudder_offset", "hull_asymmetry"),
                cosine=0.998,
                separate_by="vary the speed while the rudder is amidships",
            ),
        ),
        nuisance=(EffectFound(id="rudder_lag", family="actuation", parameters=(LAG,)),),
        steps=("current added: gain 812 nats", "no further effect passes the tests"),
        residuals=residual_rows(maneuvers, AFTER),
        missing=("roll_coupling: the log has no roll",),
        false_alarm_p=0.005,
        identify_maneuvers=tuple(maneuvers),
    )
    return found.model_copy(update=update)


def nothing(maneuvers: Sequence[str] = ("turn-1",)) -> Diagnosis:
    """The diagnosis of a model that lacks nothing."""
    rejected = tuple(
        c.model_copy(update={"rejected": c.rejected or "too small", "gain": min(c.gain, 4.0)})
        for c in CANDIDATES
    )
    return diagnosis(
        maneuvers,
        verdict="none_found",
        statement=NONE,
        effects=(),
        candidates=rejected,
        residuals=residual_rows(maneuvers, BEFORE),
        false_alarm_p=0.71,
    )


def errors(values: dict[str, float]) -> dict[str, ChannelError]:
    """Errors of the channels, and of the track, which drifts as the speed is off."""
    track = ("track", "m", TRACK_M * values["u"])
    rows = [*((name, unit, values[name]) for name, _, unit in CHANNELS), track]
    return {n: ChannelError(rmse=x, nrmse=4.0 * x, unit=unit) for n, unit, x in rows}


def differences() -> dict[str, Difference]:
    return {
        c: Difference(value=AFTER[c] - BEFORE[c], low=AFTER[c] - BEFORE[c] - 0.004, high=-0.0001)
        for c in BEFORE
    }


def held_out(maneuvers: Sequence[str], after: dict[str, float]) -> HeldOut:
    return HeldOut(
        maneuvers=tuple(maneuvers),
        before=errors(BEFORE),
        after=errors(after),
        difference=differences(),
    )


def comparison(
    found: Diagnosis, model: IdentifiedModel | None = None, maneuvers: Sequence[Maneuver] = ()
) -> Comparison:
    """What adding the effects of a diagnosis changed; N_ur moved by four standard deviations."""
    after = AFTER if found.effects else BEFORE
    ids = {role: [m.id for m in maneuvers if m.role == role] for role in ("validate", "identify")}
    coefficients = tuple(
        CoefficientComparison(
            symbol=c.symbol,
            unit=c.unit,
            prior=c.prior,
            prior_std=c.prior_std,
            before=c.value,
            before_std=c.std,
            after_std=c.std,
            after=c.value + (4.0 * c.std if found.effects and c.symbol == "N_ur" else 0.0),
        )
        for c in (model.coefficients if model else ())
    )
    return Comparison(
        verdict=found.verdict,
        statement=found.statement,
        effects=found.effects,
        ambiguous=found.ambiguous,
        held_out=held_out(ids["validate"] or ["zigzag-9"], after),
        identify=held_out(ids["identify"], after),
        maneuvers=tuple(
            ManeuverComparison(
                id=m.id,
                kind=m.kind,
                role=m.role,
                before=errors(BEFORE),
                after=errors(after),
                difference=differences(),
            )
            for m in maneuvers
        ),
        coefficients=coefficients,
        false_alarm_p=found.false_alarm_p,
        candidates=found.candidates,
        unexplained=found.unexplained,
    )


def residual_table(trials: Sequence[Trial], maneuvers: Sequence[Maneuver]) -> pd.DataFrame:
    """Rows of ``diagnose/residuals.parquet``: a current in u and v, noise in r."""
    rng = np.random.default_rng(3)
    tables = {trial.name: trial.table for trial in trials}
    pieces = []
    for m in maneuvers:
        table = tables[m.trial]
        rows = table[(table["time_s"] >= m.t_start_s) & (table["time_s"] <= m.t_end_s)]
        heading = rows["heading_rad"].to_numpy()
        piece = {
            "maneuver": m.id,
            "trial": m.trial,
            "kind": m.kind,
            "role": m.role,
            "time_s": rows["time_s"].to_numpy(),
            "heading_rad": heading,
        }
        wrong = {"u_mps": 0.06 * np.cos(heading), "v_mps": -0.06 * np.sin(heading), "r_radps": 0.0}
        for column, size in wrong.items():
            measured = rows[column].to_numpy()
            after = measured + 0.005 * rng.standard_normal(len(rows))
            before = after + size
            piece |= {
                f"{column}_measured": measured,
                f"{column}_before": before,
                f"{column}_after": after,
                f"{column}_residual_before": measured - before,
                f"{column}_residual_after": measured - after,
            }
        for name, scale in (("X_n", 0.8), ("Y_n", 1.5), ("N_nm", 0.2)):
            force = scale * np.cos(heading) + 0.2 * scale * rng.standard_normal(len(rows))
            piece[f"force_{name}"] = force
        pieces.append(pd.DataFrame(piece))
    return pd.concat(pieces, ignore_index=True)


def in_plane(maneuvers: Maneuvers, model: IdentifiedModel) -> list[Maneuver]:
    return [m for m in maneuvers.maneuvers if m.shows(model.plane)]


def of_coefficients(covariance: Mapping[str, Any]) -> dict[str, Any]:
    """A covariance without the effects that the model carried."""
    kept = [k for k, symbol in enumerate(covariance["symbols"]) if "." not in symbol]

    def among(rows: Any) -> Any:
        of_pairs = isinstance(rows[0], list | tuple)
        return [[rows[i][j] for j in kept] if of_pairs else rows[i] for i in kept]

    return {name: among(rows) for name, rows in covariance.items()}


def model_effects(effects: Mapping[str, Mapping[str, float]]) -> tuple[dict[str, Any], ...]:
    """Effects as a model has them, from their sizes as an engineer reads them."""
    return tuple(
        {
            "id": name,
            "family": BY_ID[name].family,
            "parameters": [{"symbol": s, "value": v} for s, v in sizes.items()],
            "internal": {
                f"{name}.{s}": parameter_of(f"{name}.{s}").internal(v) for s, v in sizes.items()
            },
        }
        for name, sizes in effects.items()
    )


class HandMade:
    """Stages that return the same diagnosis whatever the data, and note what they were given."""

    def __init__(self, found: Any = diagnosis) -> None:
        self.found, self.calls = found, {}  # type: ignore[var-annotated]

    def diagnose(self, given: Given) -> dict[str, Any]:
        self.calls["diagnose"] = given
        chosen = in_plane(given.maneuvers, given.model)
        names = [m.id for m in chosen if m.role == "identify"]
        return {
            "diagnose/diagnosis.json": self.found(names),
            "diagnose/residuals.parquet": residual_table(given.trials, chosen),
        }

    def refine(self, given: Given) -> dict[str, Any]:
        self.calls["refine"] = given
        model, found = given.model, given.diagnosis
        compared = comparison(found, model, in_plane(given.maneuvers, model))
        after = {c.symbol: c.after for c in compared.coefficients}
        sizes = {e.id: {p.symbol: p.value for p in e.parameters} for e in found.effects}
        refined = model.model_copy(
            update={
                "effects": model_effects(sizes),
                "covariance": of_coefficients(model.covariance),
                "coefficients": tuple(
                    c.model_copy(update={"value": after[c.symbol]}) for c in model.coefficients
                ),
            }
        )
        simulation = given.table("validate/simulation.parquet")
        return {
            "refine/model.json": refined,
            "refine/comparison.json": compared,
            "refine/history.parquet": given.table("identify/history.parquet"),
            "refine/simulation.parquet": simulation,
        }


def put_in_place(monkeypatch: pytest.MonkeyPatch, found: Any = diagnosis) -> HandMade:
    """Let the pipeline call hand-made stages."""
    made = HandMade(found)
    for name in ("diagnose", "refine"):
        replace_stage(monkeypatch, name, getattr(made, name))
    return made


def replace_stage(
    monkeypatch: pytest.MonkeyPatch, name: str, function: Callable[[Given], dict[str, Any]]
) -> None:
    """Let a row of the table of stages call another function."""
    monkeypatch.setitem(BY_NAME[name].__dict__, "function", function)
