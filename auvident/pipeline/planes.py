"""Maneuvers of both planes in one list; the identification takes those of its plane."""

from collections.abc import Sequence

from auvident.errors import InputError
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.trial import Trial

VERTICAL = "vertical"


def segment_both(trials: Sequence[Trial], hold_out: Sequence[str]) -> Maneuvers:
    """Maneuvers of the horizontal plane, and of the vertical one where there are any.

    Parameters
    ----------
    trials : sequence of Trial
    hold_out : sequence of str
        As for `auvident.stages.segment.segment`; for both planes together.

    Raises
    ------
    InputError
        Neither plane has a maneuver; says what came closest in the horizontal one.
    """
    from auvident.stages.segment import segment, segment_vertical

    failure, found = None, []
    try:
        found.append(segment(trials))
    except InputError as error:
        failure = error
    try:
        vertical = segment_vertical(trials)
        if any(_plane(m) == VERTICAL for m in vertical.maneuvers):
            found.append(vertical)
    except InputError:
        pass  # most trials have none; identifying in that plane says so when it is asked for
    if failure is not None and not found:
        raise failure
    return _with_roles(_merged(trials, found), trials, hold_out)


def _plane(maneuver: Maneuver) -> str:
    return str(maneuver.features.get("plane", "horizontal"))


def _merged(trials: Sequence[Trial], found: Sequence[Maneuvers]) -> Maneuvers:
    """Each maneuver, candidate and finding once; in time order within each trial."""
    order = {trial.name: number for number, trial in enumerate(trials)}
    by_id: dict[str, Maneuver] = {}
    for one in found:
        for maneuver in one.maneuvers:
            by_id.setdefault(maneuver.id, maneuver)
    maneuvers = sorted(by_id.values(), key=lambda m: (order[m.trial], m.t_start_s, m.id))
    # models with dictionaries inside have no hash: compare by equality
    rejected = [r for one in found for r in one.rejected]
    findings = [f for one in found for f in one.findings]
    return found[0].model_copy(
        update={
            "maneuvers": tuple(maneuvers),
            "rejected": tuple(r for i, r in enumerate(rejected) if r not in rejected[:i]),
            "findings": tuple(f for i, f in enumerate(findings) if f not in findings[:i]),
        }
    )


def _with_roles(merged: Maneuvers, trials: Sequence[Trial], hold_out: Sequence[str]) -> Maneuvers:
    """The roles that the user asks for, in place of the automatic ones."""
    from auvident.stages.segment import roles

    if not hold_out:
        return merged
    held = roles.requested(merged.maneuvers, [trial.name for trial in trials], hold_out)
    maneuvers = roles.with_roles(merged.maneuvers, held)
    automatic = {f.code for f in roles.role_findings(merged.maneuvers)}
    findings = [f for f in merged.findings if f.code not in automatic]
    findings += roles.role_findings(maneuvers)
    return merged.model_copy(update={"maneuvers": maneuvers, "findings": tuple(findings)})
