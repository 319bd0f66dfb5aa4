"""The sentences of the HTML report: errors by channel, how far to trust it, what is untested."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from auvident.constants import NOT_BETTER
from auvident.report import check_words
from auvident.report.html_data import (
    ReportData,
    gain,
    number,
    percent,
    quantity,
)
from auvident.report.verdict_rules import ERROR
from auvident.schema.artifacts import (
    ESTIMATE_CONTRADICTED,
    ON_A_MODEL,
    ChannelMetrics,
    Finding,
)
from auvident.schema.diagnosis import ChannelError
from auvident.schema.spin import share

SAME = 0.05  # nearer to one, the two digits of a ratio say 1.0
SERIOUS = {
    ESTIMATE_CONTRADICTED,
    "advance_ratio",
    "dvl_averaged",
    "dvl_axes",
    "dvl_yaw",
    "elevator_cut",
    "elevator_scale",
    "elevator_stuck",
    "elevator_unit",
    "gyro_axes",
    "heading_gyro_gain",
    "heading_unit",
    "heave_scale",
    "heave_sign",
    "pitch_rate_scale",
    "pitch_sign",
    "rpm_constant",
    "rpm_scale",
    "rpm_sign",
    "rudder_cut",
    "rudder_offset",
    "rudder_scale",
    "rudder_stuck",
    "rudder_unit",
    "sensor_shifted",
    "speed_by_depth",
    "speed_by_drift",
    "speed_position_ratio",
    "speed_scale",
    "surge_sign",
    "sway_by_position",
    "sway_sign",
    "yaw_rate_offset",
    "yaw_rate_unit",
    "channel-ignored",
    "prediction-ran-away",
    "nothing_held_out",
    "wrong-sign",
    "not-predicted",
    "no-better",
    "log_refused",
    "trials_overlap",
    "rudder_sign_unverified",
    "never_under_way",
    "no_record",
    "rudder_never_moves",
    "channel_unusable",
}
NOTES = {
    "channels_absent",
    "columns_not_read",
    "file_not_used",
    "assumed_section",
    "assumed_propulsion_factor",
    "input_logged_on_change",
    "input_sampled",
    "coarse_time",
    "jitter",
    "own_outputs_left_out",
}
RANKS = ("serious", "caution", "note")


@dataclass(frozen=True)
class Warning_:
    """A finding as the report shows it: how grave, from which stage."""

    rank: str
    stage: str
    finding: Finding


def cards(data: ReportData) -> list[dict[str, Any]]:
    """Pooled error of each channel with those of the identified model and of the prior."""
    if data.metrics is None:
        return []
    prior, identified = data.pooled_before(data.role), data.identified_errors()
    found = []
    for name, m in data.final_errors().items():
        b, ratio, by_effects = prior.get(name), gain(prior.get(name), m), None
        of_range = share(name, m.rmse, m.nrmse)
        if data.is_refined:
            by_effects = gain(identified[name], m)
        found.append(
            {
                "name": name,
                "rmse": quantity(m.rmse, m.unit),
                "nrmse": "" if of_range is None else percent(of_range),
                "r2": "" if of_range is None else number(1.0 - of_range**2),
                "grade": "none" if of_range is None else ERROR.of(of_range).grade,
                "identified": _error(name, identified[name]),
                "by_effects": factor(by_effects),
                "worse_by_effects": _surely_worse(data, name),
                "before": _error(name, b),
                "gain": factor(ratio),
                "worse": ratio is not None and ratio <= NOT_BETTER,
            }
        )
    return found


def coverage(data: ReportData) -> str:
    """How much of what was held out the band holds; empty where there is no band."""
    found = data.coverage
    if not found:
        return ""
    nominal = percent(next(iter(found.values())).nominal)
    shares = [
        f"{name} {percent(c.covered)} (mean width {quantity(c.width, c.unit)})"
        for name, c in found.items()
    ]
    return (
        f"The {nominal} band is made from the errors of the identifying maneuvers, each left out "
        f"in turn. It holds these shares of the held-out samples: {', '.join(shares)}."
    )


def untested(data: ReportData) -> str:
    """What nothing in the logs tests; empty where all was tested."""
    return check_words.untested(data.quality.trials) if data.quality else ""


def _surely_worse(data: ReportData, channel: str) -> bool:
    """Whether the effects made a held-out error larger by more than chance."""
    if data.comparison is None or not data.is_refined:
        return False
    change = data.comparison.held_out.difference.get(channel)
    return change is not None and change.low > 0.0


def _error(channel: str, e: ChannelMetrics | ChannelError | None) -> str:
    if e is None:
        return "–"
    of_range = share(channel, e.rmse, e.nrmse)
    return quantity(e.rmse, e.unit) + ("" if of_range is None else f", {percent(of_range)}")


def factor(ratio: float | None) -> str:
    """A ratio of errors in words."""
    if ratio is None or ratio <= 0.0:
        return "–"
    if abs(ratio - 1.0) < SAME:
        return "about the same"
    if ratio >= NOT_BETTER:
        return f"{number(ratio, 2)} times smaller"
    return f"{number(1.0 / ratio, 2)} times larger"


def warnings(data: ReportData) -> list[Warning_]:
    """Every finding of every stage, the gravest first."""
    found: list[tuple[str, Finding]] = []
    if data.metrics:
        # what `refine` says of the final model takes the place of this
        found += [
            ("validate", f)
            for f in data.metrics.findings
            if not (data.is_refined and f.code in ON_A_MODEL)
        ]
    if data.final_model:
        found += [("identify", f) for f in data.final_model.findings]
    for stage, artifact in (("diagnose", data.diagnosis), ("refine", data.comparison)):
        found += [(stage, f) for f in artifact.findings] if artifact else []
    if data.maneuvers:
        # the other plane may lack a held-out maneuver; the report is about one plane
        found += [
            ("segment", f)
            for f in data.maneuvers.findings
            if f.code != "nothing_held_out" or not data.held_out()
        ]
    if data.quality:
        found += [("ingest", f) for f in data.quality.findings]
        found += [
            ("ingest", f.model_copy(update={"where": _at(t.trial, f.where)}))
            for t in data.quality.trials
            for f in t.findings
        ]
    if data.ase:
        found += [("ase", f) for f in data.ase.findings]
    return ranked(found)


def ranked(found: Sequence[tuple[str, Finding]]) -> list[Warning_]:
    """Findings of stages, the gravest first."""
    told = [Warning_(_rank(f.code), stage, f) for stage, f in _merged(found)]
    return sorted(told, key=lambda w: RANKS.index(w.rank))


def _at(trial: str, where: str) -> str:
    return where if trial in where or not trial else f"{trial}, {where}" if where else trial


def _merged(found: Sequence[tuple[str, Finding]]) -> list[tuple[str, Finding]]:
    """The same message at several places, or handed on by another stage, said once."""
    groups: dict[tuple[str, str], list[tuple[str, Finding]]] = {}
    for stage, f in found:
        groups.setdefault((f.code, f.message), []).append((stage, f))
    return [(same[0][0], _as_one([f for _, f in same])) for same in groups.values()]


def _as_one(same: Sequence[Finding]) -> Finding:
    """One finding with all places; without a value where they differ in it."""
    where = "; ".join(dict.fromkeys(f.where for f in same if f.where))
    value = same[0].value if len({f.value for f in same}) == 1 else None
    return same[0].model_copy(update={"where": where, "value": value})


def _rank(code: str) -> str:
    return "serious" if code in SERIOUS else "note" if code in NOTES else "caution"
