"""The gates of ``--fail-above``: the held-out error of a channel must stay below a limit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from auvident.errors import GateError, UsageError
from auvident.schema.artifacts import RAN_AWAY, Finding, Metrics
from auvident.schema.planes import PLANE_ROWS

if TYPE_CHECKING:
    from auvident.schema.diagnosis import Comparison


VELOCITIES = frozenset(state.symbol for row in PLANE_ROWS for state in row.states[:3])


class Error(Protocol):
    """Error of a channel."""

    @property
    def rmse(self) -> float:
        """Root mean square."""

    @property
    def unit(self) -> str:
        """Its unit."""


@dataclass(frozen=True)
class Judged:
    """What the gates look at in one plane: held-out errors, known channels, findings."""

    found: Mapping[str, Error]
    known: frozenset[str]
    findings: Sequence[Finding]


def predicted(metrics: Metrics) -> Judged:
    """Errors of an identified model."""
    known = frozenset(channel for role in metrics.summary.values() for channel in role)
    return Judged(metrics.summary.get("validate", {}), known, metrics.findings)


def refined(comparison: "Comparison", metrics: Metrics | None = None) -> Judged:
    """Errors of a refined model; those of `metrics` for channels that the comparison lacks."""
    after: dict[str, Error] = {}
    after.update(metrics.summary.get("validate", {}) if metrics else {})
    after.update(comparison.held_out.after)
    known = frozenset({*after, *comparison.identify.after})
    return Judged(after, known, comparison.findings)


def check_gates(metrics: Metrics, limits: Mapping[str, float]) -> None:
    """The gates of one plane; see `check_planes`."""
    check_planes([predicted(metrics)], limits)


def check_refined(
    comparison: "Comparison", limits: Mapping[str, float], metrics: Metrics | None = None
) -> None:
    """The gates of one plane with its refined model; see `check_planes`."""
    check_planes([refined(comparison, metrics)], limits)


def check_planes(planes: Sequence[Judged], limits: Mapping[str, float]) -> None:
    """Compare the pooled RMSE of what was held out with the limits.

    Parameters
    ----------
    planes : sequence of Judged
        Those of the run; a limit holds in each that has its channel.
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
    _refuse_unknown(limits, sorted({channel for p in planes for channel in p.known}))
    for plane in planes:
        own = {c: limit for c, limit in limits.items() if _concerns(c, planes, plane)}
        _check(plane, own)


def check_not_worse(comparison: Mapping[str, Any], share: float) -> None:
    """Hold the held-out errors of several runs against those of the last one, the baseline.

    Parameters
    ----------
    comparison : mapping
        From `compare.compare_runs`.
    share : float
        A channel may be larger than that of the baseline by so much of it.

    Raises
    ------
    GateError
        A run is worse, or a channel that the baseline predicts is none of its; names them all.
    """
    tables = {"": comparison, **comparison.get("planes", {})}
    failed = [text for table in tables.values() for text in _worse(table, share)]
    if failed:
        raise GateError(
            f"the held-out error is above that of the baseline by more than {share:.3g} of it: "
            + "; ".join(failed),
            "--fail-if-worse",
        )


def _worse(table: Mapping[str, Any], share: float) -> list[str]:
    """Channels of runs that are worse than the last run of a table."""
    names = [run["run"] for run in table["runs"]]
    if not any(row["rmse"][-1] is not None for row in table["held_out"]):
        return [f"{names[-1]}: no held-out error to compare with; run `auvident validate`"]
    found = []
    for row in table["held_out"]:
        *others, limit = row["rmse"]
        if limit is None:
            continue
        for name, own in zip(names, others, strict=False):
            if own is None:
                if row["channel"] in VELOCITIES:  # of others only some stages tell the error
                    found.append(f"{name}: no held-out maneuver measures {row['channel']}")
            elif not own <= (1.0 + share) * limit:
                rise = f"RMSE {own:.4g} {row['unit']}, baseline {limit:.4g}"
                found.append(f"{name}: {row['channel']} {rise}")
    return found


def _concerns(channel: str, planes: Sequence[Judged], plane: Judged) -> bool:
    """Whether a plane has a channel; one that none has concerns the first."""
    return channel in plane.known or (
        plane is planes[0] and not any(channel in p.known for p in planes)
    )


def _check(plane: Judged, limits: Mapping[str, float]) -> None:
    if not limits:
        return
    escaped = [f.where for f in plane.findings if f.code == RAN_AWAY]
    if escaped:
        raise GateError("the prediction diverges", ", ".join(escaped), "The model is unstable.")
    missing = [channel for channel in limits if channel not in plane.found]
    if missing:
        raise GateError(
            f"no held-out maneuver measures {missing[0]}, so the gate cannot be met",
            "--fail-above",
            "Hold out a maneuver with `auvident segment RUN --hold-out ID`.",
        )
    errors = [(channel, plane.found[channel], limit) for channel, limit in limits.items()]
    failed = [
        f"{channel}: RMSE {error.rmse:.4g} {error.unit}, limit {limit:g}"
        for channel, error, limit in errors
        if not error.rmse <= limit
    ]
    if failed:
        raise GateError("the held-out error is above the limit: " + "; ".join(failed), "gate")


def _refuse_unknown(limits: Mapping[str, float], known: Sequence[str]) -> None:
    for channel in limits:
        if known and channel not in known:
            raise UsageError(
                f"there is no channel {channel!r}", "--fail-above", f"One of {', '.join(known)}."
            )
