"""The gates of ``--fail-above``: the held-out error of a channel must stay below a limit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from auvident.errors import GateError, UsageError
from auvident.pipeline.remedies import typed
from auvident.schema.artifacts import RAN_AWAY, Finding, Metrics
from auvident.schema.outcome import GateResult
from auvident.schema.planes import JUDGED, PLANE_ROWS, Plane

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

    @property
    def plane(self) -> Plane:
        """The plane, by its channels."""
        return "vertical" if "w" in self.known else "horizontal"

    @property
    def ran_away(self) -> list[str]:
        """Maneuvers in which the prediction diverges."""
        return [f.where for f in self.findings if f.code == RAN_AWAY]


def predicted(metrics: Metrics) -> Judged:
    """Errors of an identified model."""
    known = frozenset(channel for role in metrics.summary.values() for channel in role)
    return Judged(metrics.summary.get("validate", {}), known, metrics.findings)


def refined(comparison: "Comparison") -> Judged:
    """Errors of the model that a refinement ends with."""
    after = comparison.held_out.after
    return Judged(after, frozenset({*after, *comparison.identify.after}), comparison.findings)


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
    refuse_unknown(limits, sorted({channel for p in planes for channel in p.known}))
    unmet = []
    for plane in planes:
        own = {c: limit for c, limit in limits.items() if _concerns(c, planes, plane)}
        try:
            _check(plane, own)
        except GateError as gate:
            unmet.append((plane.plane, gate))
    if unmet and len(planes) == 1:
        raise unmet[0][1]
    if unmet:
        told = "; ".join(f"{plane} plane: {gate.problem}" for plane, gate in unmet)
        raise GateError(told, *_where_and_remedy(unmet))


def _where_and_remedy(unmet: Sequence[tuple[Plane, GateError]]) -> tuple[str, str]:
    """Places and remedies of several gates, each once."""
    wheres, remedies = (
        dict.fromkeys(x for x in told if x)
        for told in zip(*((gate.where, gate.remedy) for _, gate in unmet), strict=True)
    )
    return ", ".join(wheres), " ".join(remedies)


def limit_gates(planes: Sequence[Judged], limits: Mapping[str, float]) -> list[GateResult]:
    """Every gate of ``--fail-above`` by itself, met or not, as `check_planes` judges them."""
    found = []
    for plane in planes:
        for channel, limit in limits.items():
            if _concerns(channel, planes, plane):
                of = f"{plane.plane} plane" if len(planes) > 1 else ""
                found.append(_gate(plane, channel, limit, of))
    return found


def _gate(plane: Judged, channel: str, limit: float, of: str) -> GateResult:
    error = plane.found.get(channel)
    value, unit = (error.rmse, error.unit) if error else (None, "")
    try:
        _check(plane, {channel: limit})
    except GateError as gate:
        return GateResult(channel, limit, value, unit, of, gate.problem)
    return GateResult(channel, limit, value, unit, of)


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
        A run is worse, or cannot be held against the baseline; names them all.
    """
    failed = [f"{g.of}: {g.unmet}" for g in baseline_gates(comparison, share) if g.unmet]
    if failed:
        raise GateError(
            f"a held-out error is above that of the baseline by more than {100.0 * share:.3g} % of "
            "it, or cannot be compared: " + "; ".join(failed),
            "--fail-if-worse",
        )


def baseline_gates(comparison: Mapping[str, Any], share: float) -> list[GateResult]:
    """Every gate of ``--fail-if-worse`` by itself, in each plane that the baseline has."""
    baseline = comparison["runs"][-1]["run"]
    names = [run["run"] for run in comparison["runs"][:-1]]
    beside = comparison.get("planes", {})
    found = [gate for k, _ in enumerate(names) for gate in _against(comparison, k, share)]
    for plane, table in beside.items():
        own = [run["run"] for run in table["runs"]]
        if baseline not in own:  # what it does not predict is no gate
            continue
        for name in names:
            if name in own:
                beside_it = _against(table, own.index(name), share)
                found += [replace(gate, of=f"{gate.of}, {plane} plane") for gate in beside_it]
            else:
                found.append(_unmet(name, f"it has no {plane} plane, which the baseline has"))
    return found


def _unmet(of: str, why: str, channel: str = "") -> GateResult:
    return GateResult(channel, None, of=of, unmet=why)


def _against(table: Mapping[str, Any], k: int, share: float) -> list[GateResult]:
    """The gates of one run against the last of a table."""
    own, last = table["runs"][k], table["runs"][-1]
    why = _incomparable(table, own, last)
    if why:
        return [_unmet(own["run"], why)]
    rows = [row for row in table["held_out"] if row["rmse"][-1] is not None]
    gates = [_no_worse(row, own["run"], row["rmse"][k], share) for row in rows]
    return [gate for gate in gates if gate is not None]


def _incomparable(table: Mapping[str, Any], own: Mapping[str, Any], last: Mapping[str, Any]) -> str:
    """Why the errors of a run cannot be held against those of the baseline; empty if they can."""
    if own["vehicle"] != last["vehicle"]:
        return f"its vehicle is {own['vehicle']!r}, that of the baseline {last['vehicle']!r}"
    if own["plane"] != last["plane"]:
        return f"it is of the {own['plane']} plane, the baseline of the {last['plane']} plane"
    if own.get("ran_away"):  # the pooled errors are without these maneuvers
        return f"the prediction diverges in {', '.join(own['ran_away'])}"
    for run in (last, own):
        if not run["held_out"] and run["run"] == run.get("model"):
            return f"{run['run']} is a model by itself, which has no held-out error"
        if not run["held_out"]:
            named = typed(run["run"])
            return (
                f"{run['run']} has no held-out error; run `auvident validate {named}`, where "
                f"nothing is held out after `auvident segment {named} --hold-out ID`"
            )
    return ""


def _no_worse(
    row: Mapping[str, Any], of: str, own: float | None, share: float
) -> GateResult | None:
    """The gate of one channel; None where only some stages tell its error."""
    channel, unit, limit = row["channel"], row["unit"], row["rmse"][-1]
    unmet = ""
    if own is None:
        if channel not in VELOCITIES:
            return None
        unmet = f"no held-out maneuver measures {channel}"
    elif not own <= (1.0 + share) * limit:
        unmet = f"{channel} RMSE {own:.4g} {unit}, baseline {limit:.4g}"
    return GateResult(channel, (1.0 + share) * limit, own, unit, of, unmet)


def _concerns(channel: str, planes: Sequence[Judged], plane: Judged) -> bool:
    """Whether a plane has a channel; one that none has concerns the first."""
    return channel in plane.known or (
        plane is planes[0] and not any(channel in p.known for p in planes)
    )


def _check(plane: Judged, limits: Mapping[str, float]) -> None:
    if not limits:
        return
    if plane.ran_away:
        where = ", ".join(plane.ran_away)
        raise GateError("the prediction diverges", where, "The model is unstable.")
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


def refuse_unknown(limits: Mapping[str, float], known: Sequence[str] = JUDGED) -> None:
    """Refuse limits of channels that there are not; before a run, of those that no run has.

    Raises
    ------
    UsageError
        With those that there are.
    """
    for channel in limits:
        if known and channel not in known:
            raise UsageError(
                f"there is no channel {channel!r}", "--fail-above", f"One of {', '.join(known)}."
            )
