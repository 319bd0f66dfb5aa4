"""What the last stage left: channels that it did not fit, innovations, scatter of the maneuvers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.estimator import task_about
from auvident.engines.free_run import RecordResidual, residuals_of
from auvident.engines.jackknife import noise_claim
from auvident.engines.noise import LONGEST_CORRELATION_S
from auvident.engines.records import STATE_COLUMNS
from auvident.engines.setup import Outcome, Setup
from auvident.estimation.coloured import NEGLIGIBLE, colours_without_each, whitened
from auvident.estimation.innovations import Consistency, chi_square_band, consistency
from auvident.schema.artifacts import Finding, NisTest, NoiseClaim, StageRecord
from auvident.schema.plan import PlanStage
from auvident.schema.planes import Plane

Array = npt.NDArray[Any]

# Thresholds of what clean trials of vehicles unlike the equations show as well. Of 39 (even seeds
# 600 to 780 of the population) 1 exceeds one of them: they are 6-DOF vehicles in current and waves.
NIS_FACTOR = 2.0  # squared innovations within this factor of the claim
LARGEST_KS = 1.0 / 3.0  # distance from the normal distribution
KS_P = 0.01
CLAIM_FACTOR = 4.0  # squared scatter of the maneuvers: standard deviations half of what they are
AS_ITS_SPREAD = 1.0  # residual over the spread of a channel: its mean would fit as well
SENSOR_FACTOR = 10.0  # noise of a fit over that of the sensor; below, the channel is but noise
SURGE_REMEDY = "Check mass, drag and thrust in the vehicle file, and rpm in the log."
LATERAL_REMEDIES: dict[Plane, str] = {
    "horizontal": "Check x_g_m, izz_kgm2 and fins in the vehicle file, and the signs and units of "
    "rudder, DVL and gyro in the log.",
    "vertical": "Check mass_kg, buoyancy_n, x_g_m and z_g_m in the vehicle file, and the sign of "
    "the elevator.",
}


def left_of(setup: Setup, outcome: Outcome, stage: PlanStage) -> Sequence[RecordResidual]:
    """Residuals of the free-running prediction of a stage; none where one runs away."""
    output = task_about(setup, outcome, stage).output
    return residuals_of(output, outcome.parameters) or ()


def innovations_tested(
    setup: Setup, outcome: Outcome, stage: PlanStage, active: Array
) -> dict[str, NisTest]:
    """Tests of the innovations of a stage by column.

    A filter pass has its own. A fit leaves a coloured residual: that of each maneuver is whitened
    with the noise of the others, as its own noise would fit by construction.
    """
    longest = round(LONGEST_CORRELATION_S / setup.dt_s)
    columns = STATE_COLUMNS[setup.structure.plane]
    if outcome.passed is not None:
        white = outcome.passed.whitened
        found = {c: consistency(white[:, :, i], longest) for i, c in enumerate(columns)}
    else:
        errors = [r.error for r in left_of(setup, outcome, stage)]
        found = {
            columns[i]: _left_by_fit(
                [e[:, i] for e in errors], setup.dt_s, longest, NEGLIGIBLE * setup.sensor_std[i]
            )
            for i in np.flatnonzero(active)
            if errors
        }
    return {c: NisTest(**test.as_told()) for c, test in found.items() if test is not None}


def _left_by_fit(
    pieces: Sequence[Array], dt_s: float, longest: int, least: float
) -> Consistency | None:
    colours = colours_without_each(pieces, dt_s, least)
    white = [whitened(p, c, dt_s) for p, c in zip(pieces, colours, strict=True)]
    return consistency(white, longest, inflated=False)


def nis_findings(record: StageRecord) -> list[Finding]:
    """Channels whose innovations are not as large, or not spread, as the noise says."""
    found = []
    for column, test in record.nis.items():
        within = test.low <= test.corrected <= test.high
        if not within and not 1.0 / NIS_FACTOR <= test.corrected <= NIS_FACTOR:
            found.append(
                Finding(
                    code="nis-outside",
                    where=column,
                    value=test.corrected,
                    threshold=test.high if test.corrected > 1.0 else test.low,
                    message="the innovations are not consistent with their covariance S",
                    remedy="Do not rely on standard deviations that this channel determines.",
                )
            )
        if test.ks is not None and test.ks > LARGEST_KS and (test.ks_p or 0.0) < KS_P:
            found.append(
                Finding(
                    code="innovations-not-normal",
                    where=column,
                    value=test.ks,
                    threshold=LARGEST_KS,
                    message="the innovations are not normally distributed (Kolmogorov-Smirnov "
                    "distance)",
                    remedy="A few maneuvers may be far worse than the others: compare their "
                    "residuals in the report.",
                )
            )
    return found


def scatter_claimed(
    gradients: Mapping[str, Array], curvatures: Mapping[str, Array]
) -> tuple[NoiseClaim | None, list[Finding]]:
    """Whether the maneuvers scatter as the noise of the fit lets them, with a finding."""
    claim = noise_claim(gradients, curvatures)
    if claim is None:
        return None, []
    low, high = chi_square_band(claim.freedom)
    told = NoiseClaim(ratio=claim.ratio, freedom=claim.freedom, low=low, high=high)
    if not claim.ratio > max(CLAIM_FACTOR, high):
        return told, []
    return told, [
        Finding(
            code="noise-underclaimed",
            value=claim.ratio,
            threshold=CLAIM_FACTOR,
            message="the maneuvers scatter more than the noise of the fit allows (squared "
            "ratio): the standard deviations of the coefficients are too small",
            remedy=f"Multiply them by {claim.ratio**0.5:.1f}; an effect that the model "
            "lacks may act differently in the maneuvers.",
        )
    ]


def ignored_channels(setup: Setup, outcome: Outcome, stage: PlanStage) -> list[Finding]:
    """Channels that the fit takes for noise: it leaves as much of them as their mean would."""
    errors = [r.error for r in left_of(setup, outcome, stage)]
    plane, found = setup.structure.plane, []
    for i in task_about(setup, outcome, stage).output.channels if errors else ():
        read = np.concatenate([r.measured[:, i] for _, r in setup.records.values()])
        left = np.concatenate([e[:, i] for e in errors])
        if not np.isfinite(left).any():
            continue
        ratio = float(np.sqrt(np.nanmean(left**2)) / max(np.nanstd(read), np.finfo(float).tiny))
        noise, sensor = float(outcome.noise[i]), float(setup.sensor_std[i])
        if ratio > AS_ITS_SPREAD and noise > SENSOR_FACTOR * sensor:
            found.append(_ignored(plane, int(i), ratio, noise, sensor))
    return found


def _ignored(plane: Plane, channel: int, ratio: float, noise: float, sensor: float) -> Finding:
    return Finding(
        code="channel-ignored",
        where=STATE_COLUMNS[plane][channel],
        value=ratio,
        threshold=AS_ITS_SPREAD,
        message=f"the fit hardly uses this channel: its residual is as large as its variation "
        f"(ratio), so its noise is taken as {noise:.2g}, not as the sensor's {sensor:.2g}",
        remedy=LATERAL_REMEDIES[plane] if channel else SURGE_REMEDY,
    )
