"""What the errors of a model, beside those of its prior, say against it."""

import math
from collections.abc import Iterator, Mapping

from auvident.constants import NOT_BETTER
from auvident.schema.artifacts import (
    PRIOR_WORDS,
    RAN_AWAY,
    ChannelMetrics,
    Finding,
    IdentifiedModel,
    Metrics,
)
from auvident.schema.prior_errors import pooled_by_prior

AS_ITS_VARIATION = 1.0  # NRMSE from which on the mean of a channel would predict it as well
# [of what a channel varies by in the held-out maneuvers] by how much (root of the difference of the
# squares) the error in one of them has to be larger than with the prior before it is told. Of 22
# clean trials of even seeds 15 had a maneuver that is predicted worse by anything, most of them a
# straight run at the noise of the sensor; 4 have one by this much.
WORSE = 0.1
MANY_ON_PRIOR = 0.5  # data share below which a coefficient is more prior than data

Channels = Mapping[str, ChannelMetrics]


def findings_of(metrics: Metrics, model: IdentifiedModel, estimated: bool = True) -> list[Finding]:
    """Findings on a model, the gravest first.

    Parameters
    ----------
    metrics : Metrics
        Of the model, with those of its prior as ``ase``.
    model : IdentifiedModel
    estimated : bool
        Whether the prior is the estimate from geometry; else it is given coefficients.

    Returns
    -------
    list of Finding
    """
    prior = PRIOR_WORDS["ASE" if estimated else "prior"]
    after = metrics.summary.get("validate", {})
    return [
        *_not_predicted(after),
        *_no_better(after, pooled_by_prior(metrics), prior),
        *_prior_ran_away(metrics, prior),
        *_worse_than_prior(metrics, prior),
        *_resting_on_prior(model),
    ]


def _not_predicted(after: Channels) -> Iterator[Finding]:
    for name, m in after.items():
        if m.nrmse >= AS_ITS_VARIATION:
            yield Finding(
                code="not-predicted",
                where=name,
                value=m.nrmse,
                threshold=AS_ITS_VARIATION,
                message="not predicted: the error is no smaller than the variation of the channel",
                remedy=f"Do not use the model for {name}.",
            )


def _no_better(after: Channels, before: Channels, prior: str) -> Iterator[Finding]:
    for name, m in after.items():
        ratio = _gain(before.get(name), m)
        if ratio is not None and ratio <= NOT_BETTER:
            yield Finding(
                code="no-better",
                where=name,
                value=ratio,
                threshold=NOT_BETTER,
                message=f"predicted no better in the held-out maneuvers than with {prior}",
                remedy=(
                    f"What was identified about {name} does not carry over to the held-out "
                    "maneuvers."
                ),
            )


def _prior_ran_away(metrics: Metrics, prior: str) -> Iterator[Finding]:
    for f in metrics.ase.findings if metrics.ase else ():
        if f.code == RAN_AWAY:
            yield Finding(
                code="prior-ran-away",
                where=f.where,
                message=f"predictions with {prior} diverge, so their pooled errors are not "
                "compared",
                remedy="What the identification has gained cannot be stated.",
            )


def _worse_than_prior(metrics: Metrics, prior: str) -> Iterator[Finding]:
    """Held-out maneuvers one by one: pooled, a good one can hide a bad one."""
    before = {m.id: m.channels for m in metrics.ase.maneuvers} if metrics.ase else {}
    spreads = {k: _spread(c) for k, c in metrics.summary.get("validate", {}).items()}
    for m in (m for m in metrics.maneuvers if m.role == "validate"):
        own = before.get(m.id, {})
        shares = {k: _excess(own[k], c) / spreads[k] for k, c in m.channels.items() if k in own}
        worse = {k: share for k, share in shares.items() if share > WORSE}
        if worse:
            yield Finding(
                code="worse-than-prior",
                where=f"{m.id} ({', '.join(worse)})",
                value=max(worse.values()),
                threshold=WORSE,
                message=f"predicted worse than with {prior}",
                remedy="Compare measured and predicted values in the report.",
            )


def _resting_on_prior(model: IdentifiedModel) -> Iterator[Finding]:
    shares = {c.symbol: c.data_share for c in model.estimates}
    on_prior = {symbol: share for symbol, share in shares.items() if share < MANY_ON_PRIOR}
    if on_prior:
        yield Finding(
            code="rests-on-prior",
            where=", ".join(on_prior),
            value=min(on_prior.values()),
            threshold=MANY_ON_PRIOR,
            message=f"{len(on_prior)} of {len(shares)} coefficients are determined more by "
            "the prior than by these data. Predictions hold within the range of the "
            "maneuvers; single coefficients may be wrong",
            remedy="`auvident plan-trial RUN` ranks the maneuvers that would show more.",
        )


def _spread(pooled: ChannelMetrics) -> float:
    """What a channel varies by."""
    return pooled.rmse / pooled.nrmse if pooled.nrmse > 0.0 else math.inf


def _excess(before: ChannelMetrics, after: ChannelMetrics) -> float:
    """Error beyond that before, as squares add up; zero where it is no larger."""
    return math.sqrt(max(after.rmse**2 - before.rmse**2, 0.0))


def _gain(before: ChannelMetrics | None, after: ChannelMetrics) -> float | None:
    """Squared error before over that after; None when unknown."""
    if before is None or after.rmse <= 0.0:
        return None
    return (before.rmse / after.rmse) ** 2
