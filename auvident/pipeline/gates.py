"""The gates of ``--fail-above``: the held-out error of a channel must stay below a limit."""

from collections.abc import Mapping

from auvident.errors import GateError, UsageError
from auvident.schema.artifacts import Metrics

RAN_AWAY = "prediction-ran-away"


def check_gates(metrics: Metrics, limits: Mapping[str, float]) -> None:
    """Compare the pooled RMSE of what was held out with the limits.

    Parameters
    ----------
    metrics : Metrics
    limits : mapping
        Greatest RMSE by channel, in the unit of the metrics.

    Raises
    ------
    GateError
        A limit is exceeded, or there is nothing to judge by; names every channel.
    UsageError
        There is no such channel.
    """
    if not limits:
        return
    found = metrics.summary.get("validate", {})
    everywhere = {c: m for role in metrics.summary.values() for c, m in role.items()}
    for channel in limits:
        if everywhere and channel not in everywhere:
            raise UsageError(
                f"there is no channel {channel!r}",
                "--fail-above",
                f"One of {', '.join(everywhere)}.",
            )
    escaped = [f.where for f in metrics.findings if f.code == RAN_AWAY]
    if escaped:
        raise GateError("the prediction runs away", ", ".join(escaped), "The model is unstable.")
    missing = [channel for channel in limits if channel not in found]
    if missing:
        raise GateError(
            f"nothing was held out that measures {missing[0]}, so the gate cannot be met",
            "--fail-above",
            "Hold out a maneuver with `auvident segment RUN --hold-out ID`.",
        )
    failed = [
        f"{channel}: RMSE {found[channel].rmse:.4g} {found[channel].unit}, limit {limit:g}"
        for channel, limit in limits.items()
        if not found[channel].rmse <= limit
    ]
    if failed:
        raise GateError("the held-out error is above the limit: " + "; ".join(failed), "gate")
