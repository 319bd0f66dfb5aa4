"""The errors that a model is held against: those of its prior, where both predict the same."""

from collections.abc import Mapping

from auvident.schema.artifacts import ChannelMetrics, Metrics


def pooled_by_prior(metrics: Metrics, role: str = "validate") -> Mapping[str, ChannelMetrics]:
    """Pooled errors of the prior by channel.

    Empty where it did not predict the same maneuvers of this role: without those that diverge
    with it, its errors would be of other maneuvers.
    """
    if metrics.ase is None:
        return {}
    after, before = ({m.id for m in x.maneuvers if m.role == role} for x in (metrics, metrics.ase))
    return metrics.ase.summary.get(role, {}) if after == before else {}
