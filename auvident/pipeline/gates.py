"""The gates of ``--fail-above``: the held-out error of a channel must stay below a limit."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from auvident.errors import GateError, UsageError
from auvident.schema.artifacts import RAN_AWAY, Finding, Metrics

if TYPE_CHECKING:
    from auvident.schema.diagnosis import Comparison


class Error(Protocol):
    """Error of a channel."""

    @property
    def rmse(self) -> float:
        """Root mean square."""

    @property
    def unit(self) -> str:
        """Its unit."""


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
    known = {channel for role in metrics.summary.values() for channel in role}
    _check(metrics.summary.get("validate", {}), limits, known, metrics.findings)


def check_refined(
    comparison: "Comparison", limits: Mapping[str, float], metrics: Metrics | None = None
) -> None:
    """Compare the held-out RMSE of the refined model with the limits.

    Parameters
    ----------
    comparison : Comparison
    limits : mapping
    metrics : Metrics, optional
        Of the model before, for channels that the comparison does not have.

    Raises
    ------
    GateError, UsageError
        As `check_gates`.
    """
    after: dict[str, Error] = {}
    after.update(metrics.summary.get("validate", {}) if metrics else {})
    after.update(comparison.held_out.after)
    known = {*after, *comparison.identify.after}
    _check(after, limits, known, comparison.findings)


def _check(
    found: Mapping[str, Error],
    limits: Mapping[str, float],
    known: Iterable[str],
    findings: Sequence[Finding],
) -> None:
    if not limits:
        return
    _refuse_unknown(limits, sorted(known))
    escaped = [f.where for f in findings if f.code == RAN_AWAY]
    if escaped:
        raise GateError("the prediction diverges", ", ".join(escaped), "The model is unstable.")
    missing = [channel for channel in limits if channel not in found]
    if missing:
        raise GateError(
            f"no held-out maneuver measures {missing[0]}, so the gate cannot be met",
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


def _refuse_unknown(limits: Mapping[str, float], known: Sequence[str]) -> None:
    for channel in limits:
        if known and channel not in known:
            raise UsageError(
                f"there is no channel {channel!r}", "--fail-above", f"One of {', '.join(known)}."
            )
