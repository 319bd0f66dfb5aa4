"""Ingest with the corrections that the user asks for, each proposed by a check of the trial."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from auvident.errors import ContradictionError, UsageError
from auvident.schema.artifacts import Finding
from auvident.schema.logs import RawTrial, TrialQuality
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest import clocks
from auvident.stages.ingest.checks import corrected
from auvident.stages.ingest.stage import ingest


@dataclass(frozen=True)
class CorrectedTrial:
    """An ingested trial, and the names of ``--fix`` that a check of it proposed."""

    trial: Trial
    quality: TrialQuality
    proposed: frozenset[str]


def ingest_fixed(
    raw: RawTrial, vehicle: Vehicle, fixes: Collection[str] = (), **options: Any
) -> CorrectedTrial:
    """Bring a trial to one clock, corrected as asked.

    Corrections are made one by one to what was logged, and the trial is ingested again after
    each: what was right all along is proposed no more.

    Parameters
    ----------
    raw, vehicle, **options
        Of `ingest`.
    fixes : collection of str
        Names of checks.

    Raises
    ------
    InputError
        As `ingest`; a contradiction that is to be fixed is not refused.
    """
    done: dict[str, str] = {}
    proposed: set[str] = set()
    while True:
        wanted = set(fixes) - set(done)
        try:
            trial, quality = ingest(raw, vehicle, **options)
            made = [c for c in quality.checks_made if c.name in wanted]
            found = {c.name: fix for c in made if (fix := c.fix or c.fix_if_asked)}
        except ContradictionError as error:
            if error.check not in wanted or not error.fix:
                raise _misspelt(error, wanted) from None
            found = {error.check: error.fix}
        proposed |= set(found)
        if not found:
            return CorrectedTrial(trial, _told(quality, done), frozenset(proposed))
        name = next(iter(found))
        raw, done = _corrected(raw, name, found[name]), {**done, name: found[name]}


def _misspelt(error: ContradictionError, wanted: Collection[str]) -> ContradictionError:
    """The same contradiction, where ``--fix`` nearly has the name of its correction, with that."""
    meant = get_close_matches(error.check, wanted, n=1) if error.fix else []
    if not meant:
        return error
    told = f"{error.remedy} --fix {meant[0]} names no correction; this one is {error.check}."
    return ContradictionError(error.problem, error.where, told, error.check, error.fix)


def _corrected(raw: RawTrial, name: str, fix: str) -> RawTrial:
    """The trial with the correction that a check of a channel, or of a clock, proposes."""
    return clocks.corrected(raw, name, fix) if name in clocks.FIXES else corrected(raw, fix)


def _told(quality: TrialQuality, done: dict[str, str]) -> TrialQuality:
    """The quality with what was corrected."""
    findings = [
        Finding(
            code="fixed",
            message=f"corrected before anything else (--fix {name}): {fix}",
            where=f"trial {quality.trial}",
        )
        for name, fix in done.items()
    ]
    return quality.model_copy(update={"fixed": done, "findings": (*findings, *quality.findings)})


def refuse_unproposed(
    fixes: Collection[str], proposed: Collection[str], qualities: Iterable[TrialQuality] = ()
) -> None:
    """Refuse a correction that no check of any trial proposes, and name those that one does."""
    left = [name for name in fixes if name not in proposed]
    if left:
        made = (check for quality in qualities for check in quality.checks_made)
        others = dict.fromkeys(check.name for check in made if check.fix or check.fix_if_asked)
        raise UsageError(
            f"no check proposes a correction named {', '.join(left)}",
            "--fix",
            f"Of these logs they propose {', '.join(others)}."
            if others
            else "Leave it out: these logs have nothing to correct that a check is sure of.",
        )
