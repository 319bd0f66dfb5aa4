"""Refinement: the traced effects join the model, and what that changes on held-out maneuvers."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.constants import INDEPENDENT_S, NORMAL_95
from auvident.estimation.chances import student_quantile
from auvident.physics.maneuvers import headings_from_start
from auvident.schema.artifacts import (
    ON_A_MODEL,
    RAN_AWAY,
    Finding,
    IdentifiedModel,
    Maneuvers,
)
from auvident.schema.diagnosis import (
    Attempt,
    ChannelError,
    CoefficientComparison,
    Comparison,
    CrossValidated,
    Diagnosis,
    Difference,
    HeldOut,
    ManeuverComparison,
    UnexplainedForce,
)
from auvident.schema.planes import TRACK
from auvident.stages.refine.attempts import findings_of
from auvident.stages.refine.claims import claims_of
from auvident.stages.refine.errors import channels_of, cruise_of, rms_of

Array = npt.NDArray[Any]
DRAWS = 1000
INTERVAL = (2.5, 97.5)  # percentiles of the draws
SMALLEST = float(np.finfo(float).tiny)
# Error of a channel in the identifying maneuvers over what the diagnosis leaves of it: of 893 of
# models of 260 drawn trials and of unusual ones that all currents are in the largest is 3.3.
GIVEN_AWAY = 4.0
LEAST_GIVEN_AWAY = 0.1  # of what the channel varies by; less is little to give away
HEADING = "heading_rad"  # counts from the start of each maneuver
AXES = ("north_m", "east_m")  # of the track


def escapes(table: pd.DataFrame) -> tuple[Finding, ...]:
    """Maneuvers in which a refined prediction leaves every bound; a gate is not met with one."""
    found = []
    for name, rows in table.groupby("maneuver", sort=False):
        if any(math.isinf(rms_of(rows, column)) for column, _, _ in channels_of(rows)):
            found.append(
                Finding(
                    code=RAN_AWAY,
                    where=str(name),
                    message="the prediction of the refined model diverges",
                    remedy=(
                        "The model is unstable in this maneuver; errors are counted up to "
                        "that point."
                    ),
                )
            )
    return tuple(found)


def worse_channels(held_out: HeldOut) -> tuple[Finding, ...]:
    """Channels of the held-out maneuvers that are predicted worse than before, not by chance."""
    return tuple(
        Finding(
            code="worse-refined",
            where=f"{name} ({_shown(before)} → {_shown(after)})",
            value=after.rmse / before.rmse,
            threshold=1.0,
            message="the refined model predicts some channels of the held-out maneuvers worse "
            "than the identified one",
            remedy="The identified model is kept in identify/model.json.",
        )
        for name, before in held_out.before.items()
        if name in held_out.difference and before.rmse > 0.0 and held_out.difference[name].low > 0.0
        for after in [held_out.after[name]]
    )


def given_away(diagnosis: Diagnosis, identify: HeldOut) -> tuple[Finding, ...]:
    """Channels of the identifying maneuvers that the diagnosis follows, and the model does not.

    A large and slow residual counts for little, so that it may grow and then counts for less; and
    of a hull that hardly keeps its course the errors of the starts grow.
    """
    left = diagnosis.checks.get("rms", {}).get("after", {})
    return tuple(
        Finding(
            code="given-away",
            where=name,
            value=error.rmse / left[name],
            threshold=GIVEN_AWAY,
            message=f"the model is off by {_shown(error)} in the maneuvers it was identified from, "
            f"which the fit of the diagnosis, with small effects and starts of its own, follows to "
            f"{_shown(_replaced(error, left[name]))}",
            remedy="Its coefficients may be far from those that these data ask for: identify with "
            "`--plan coloured`, which counts a slow residual otherwise, and compare the held-out "
            "errors; `auvident plan-trial RUN` ranks the maneuvers that would tell more.",
        )
        for name, error in identify.after.items()
        if left.get(name)
        and GIVEN_AWAY * left[name] < error.rmse < math.inf
        and error.nrmse > LEAST_GIVEN_AWAY
    )


def gives_away(diagnosis: Diagnosis, maneuvers: Maneuvers, predicted: pd.DataFrame) -> bool:
    """Whether a model is far off in what it was identified from; see `given_away`."""
    return bool(given_away(diagnosis, pooled(maneuvers, predicted, predicted, "identify")))


def _replaced(error: ChannelError, rmse: float) -> ChannelError:
    """Another error of the same channel."""
    return error.model_copy(update={"rmse": rmse})


def _shown(error: ChannelError) -> str:
    """An error with its unit, angles in degrees."""
    if error.unit.startswith("rad"):
        return f"{math.degrees(error.rmse):.2g} {error.unit.replace('rad', 'deg')}"
    return f"{error.rmse:.2g} {error.unit}"


def compare(
    diagnosis: Diagnosis,
    maneuvers: Maneuvers,
    before: IdentifiedModel,
    after: IdentifiedModel,
    predicted_before: pd.DataFrame,
    predicted_after: pd.DataFrame,
    *,
    attempts: Sequence[Attempt] = (),
    seed: int = 0,
    predicted: Sequence[Finding] = (),
    cross_validation: CrossValidated | None = None,
    force: UnexplainedForce | None = None,
    named: IdentifiedModel | None = None,
) -> Comparison:
    """Errors, coefficients and effects before and after.

    Parameters
    ----------
    diagnosis : Diagnosis
    maneuvers : Maneuvers
    before, after : IdentifiedModel
    predicted_before, predicted_after : pandas.DataFrame
        As `validate` writes them: measured and simulated channels, by maneuver.
    attempts : sequence of Attempt
        What was tried; where the model before is the one taken, nothing is claimed.
    seed : int
        Of the bootstrap.
    predicted : sequence of Finding
        Of `validate` on the model after; those on its errors are handed on.
    cross_validation : CrossValidated, optional
        Errors of both models in maneuvers left out in turn.
    force : UnexplainedForce, optional
        What came of a force without a name.
    named : IdentifiedModel, optional
        The model without that force, by which the effects are told; else the one after.
    """
    rng = np.random.default_rng(seed)
    pairs = _pairs(predicted_before, predicted_after)
    roles = {m.id: m.role for m in maneuvers.maneuvers}
    held = [name for name in pairs if roles[name] == "validate"]
    own = [name for name in pairs if roles[name] == "identify"]
    cruise = cruise_of(predicted_after)
    claims = claims_of(diagnosis, named or after, attempts, *cruise, cross_validation)
    held_out, identify = _pooled(held, pairs, rng), _pooled(own, pairs, rng)
    findings = [
        *diagnosis.findings,
        *findings_of(attempts),
        *escapes(predicted_after),
        *given_away(diagnosis, identify),
    ]
    if before.values() != after.values():
        findings += [*(f for f in predicted if f.code in ON_A_MODEL), *worse_channels(held_out)]
    return Comparison(
        **claims,
        attempts=tuple(attempts),
        held_out=held_out,
        identify=identify,
        maneuvers=tuple(_one(name, roles[name], pairs, rng) for name in pairs),
        coefficients=_coefficients(before, after),
        false_alarm_p=diagnosis.false_alarm_p,
        cross_validation=cross_validation or CrossValidated(),
        unexplained_force=force,
        findings=tuple(findings),
    )


def pooled(
    maneuvers: Maneuvers, before: pd.DataFrame, after: pd.DataFrame, role: str, seed: int = 0
) -> HeldOut:
    """Errors of two predictions over all maneuvers of a role together."""
    roles, pairs = {m.id: m.role for m in maneuvers.maneuvers}, _pairs(before, after)
    names = [name for name in pairs if roles[name] == role]
    return _pooled(names, pairs, np.random.default_rng(seed))


def _pairs(before: pd.DataFrame, after: pd.DataFrame) -> dict[str, Any]:
    """Rows of each maneuver before and after."""
    return {
        str(name): (rows, after.loc[rows.index])
        for name, rows in before.groupby("maneuver", sort=False)
    }


def _channels(rows: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Column, name and unit of the channels in a table, its track last."""
    has_track = all(f"{axis}_measured" in rows for axis in AXES)
    return channels_of(rows) + [(TRACK, TRACK, "m")] * has_track


def _errors(name: str, pairs: dict[str, Any], column: str) -> tuple[Array, Array, Array]:
    """Errors before and after, and readings, of one channel of one maneuver.

    Those of the track are distances, and its readings have two columns.
    """
    if column == TRACK:
        (north, *far), (east, *off) = (_errors(name, pairs, axis) for axis in AXES)
        return np.hypot(north, east), np.hypot(far[0], off[0]), np.column_stack([far[1], off[1]])
    before, after = pairs[name]
    measured, first = (before[f"{column}_{k}"].to_numpy() for k in ("measured", "simulated"))
    errors = first - measured, after[f"{column}_simulated"].to_numpy() - measured
    if column == HEADING:
        measured, _ = headings_from_start(measured, first)
    return (*errors, measured)


def _pooled(names: Sequence[str], pairs: dict[str, Any], rng: np.random.Generator) -> HeldOut:
    """Errors over several maneuvers together, to where a prediction leaves every bound.

    A prediction of which nothing is left has no error: its channels are missing.
    """
    before: dict[str, ChannelError] = {}
    after: dict[str, ChannelError] = {}
    difference: dict[str, Difference] = {}
    for column, channel, unit in _channels(next(iter(pairs.values()))[0]):
        parts = [_errors(name, pairs, column) for name in names]
        parts = [p for p in parts if np.isfinite(p[2]).any()]
        if not parts:
            continue
        spread = _spread(np.concatenate([p[2] for p in parts]))
        for k, errors in enumerate((before, after)):
            found = _error(np.concatenate([p[k] for p in parts]), spread, unit)
            errors |= {channel: found} if found else {}
        step = float(np.median(np.diff(pairs[names[0]][0]["time_s"].to_numpy())))
        # with draws of its own the track leaves those of the other channels as they are
        changed = _difference(parts, step, rng.spawn(1)[0] if column == TRACK else rng)
        difference |= {channel: changed} if changed else {}
    return HeldOut(maneuvers=tuple(names), before=before, after=after, difference=difference)


def _one(
    name: str, role: str, pairs: dict[str, Any], rng: np.random.Generator
) -> ManeuverComparison:
    pooled = _pooled([name], pairs, rng)
    kind = str(pairs[name][0]["kind"].iloc[0])
    return ManeuverComparison(
        id=name,
        kind=kind,
        role=role,
        before=pooled.before,
        after=pooled.after,
        difference=pooled.difference,
    )


def _spread(values: Array) -> float:
    return max(float(np.sqrt(np.sum(np.nanvar(values, axis=0)))), 1e-9)


def _error(errors: Array, spread: float, unit: str) -> ChannelError | None:
    good = errors[np.isfinite(errors)]
    if not good.size:
        return None
    rmse = float(np.sqrt(np.mean(good**2)))
    return ChannelError(rmse=rmse, nrmse=rmse / spread, unit=unit)


def _difference(
    parts: Sequence[tuple[Array, Array, Array]], step_s: float, rng: np.random.Generator
) -> Difference | None:
    """RMSE after minus before, with an interval from a bootstrap over maneuvers, then over blocks.

    A model that is off in one kind of maneuver is off in all of its blocks: these are no
    independent votes on the next trial (one straight run of three maneuvers made an error "surely"
    larger that the other two made smaller). The ratio is drawn, in which maneuvers agree that are
    not equally hard to predict. Of few, draws scatter by too little: see `_for_few`. None where
    there is but one block, which tells nothing of chance.
    """
    sums = [np.array(rows) for part in parts if (rows := _block_sums(part, step_s))]
    if not sums:
        return None
    votes = len(sums) if len(sums) > 1 else len(sums[0])
    if votes == 1:
        return None
    count, *squares = np.concatenate(sums).sum(axis=0)
    first, second = (math.sqrt(square / count) for square in squares)
    told = float(_ratio(np.array([squares]))[0])
    spread = np.percentile(_ratio(_drawn(sums, rng)[:, 1:]), INTERVAL) - told
    low, high = first * (told - 1.0 + _for_few(votes) * spread)
    return Difference(value=second - first, low=max(float(low), -first), high=float(high))


def _ratio(squares: Array) -> Array:
    """The RMSE after over the one before (n,), from sums (n, 2)."""
    before, after = squares.T
    return np.asarray(np.sqrt(after / np.maximum(before, SMALLEST)))


def _for_few(votes: int) -> float:
    """Factor by which an interval from the draws of few is widened (Cameron et al. 2008).

    Draws of m scatter by (m - 1) / m of the variance, and what is known from m alone has the
    quantiles of Student's t. With before and after exchanged at random in three held-out maneuvers
    each of 46 drawn trials, where nothing is better or worse, 24.1 % of the intervals without
    this factor leave zero out, and 4.3 % with it.
    """
    student = student_quantile(votes - 1, INTERVAL[1] / 100.0)
    return math.sqrt(votes / (votes - 1)) * student / NORMAL_95


def _drawn(sums: Sequence[Array], rng: np.random.Generator) -> Array:
    """Sums (draws, 3) of as many maneuvers, drawn with replacement, and blocks drawn in each.

    Parameters
    ----------
    sums : sequence of (b, 3) array
        Of the blocks of each maneuver: readings, squares before, squares after.
    """
    out = np.zeros((DRAWS, 3))
    for _ in sums:
        chosen = rng.integers(0, len(sums), size=DRAWS)
        for k, own in enumerate(sums):
            rows = np.flatnonzero(chosen == k)
            out[rows] += own[rng.integers(0, len(own), size=(len(rows), len(own)))].sum(axis=1)
    return out


def _block_sums(part: tuple[Array, Array, Array], step_s: float) -> list[tuple]:
    before, after, measured = part
    there = np.isfinite(measured.reshape(len(measured), -1)).all(axis=1)
    seen = np.isfinite(before) & np.isfinite(after) & there
    number = (np.arange(len(seen)) * step_s // INDEPENDENT_S).astype(int)
    return [
        (int(rows.sum()), float(np.sum(before[rows] ** 2)), float(np.sum(after[rows] ** 2)))
        for k in range(int(number[-1]) + 1)
        if (rows := seen & (number == k)).any()
    ]


def _coefficients(
    before: IdentifiedModel, after: IdentifiedModel
) -> tuple[CoefficientComparison, ...]:
    final = {c.symbol: c for c in after.estimates}
    return tuple(
        CoefficientComparison(
            symbol=c.symbol,
            unit=c.unit,
            prior=c.prior,
            prior_std=c.prior_std,
            before=c.value,
            before_std=c.std,
            after=final[c.symbol].value,
            after_std=final[c.symbol].std,
        )
        for c in before.estimates
        if c.symbol in final
    )
