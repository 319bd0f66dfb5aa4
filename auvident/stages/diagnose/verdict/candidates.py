"""Every candidate of a search as the artifact has it, with what refused it."""

from collections.abc import Sequence
from dataclasses import asdict

from auvident.schema.diagnosis import Candidate, Refused
from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.select.candidates import Round, Tried
from auvident.stages.diagnose.select.healthy import share_of_healthy, standing
from auvident.stages.diagnose.verdict.uncertainty import effect_values


def candidate_rows(rounds: Sequence[Round], case: Case) -> list[Candidate]:
    """Every candidate, from the round in which it was refitted last, best first."""
    rows: dict[str, Candidate] = {}
    for done in rounds:
        for name, gain in done.screened.items():
            rows.setdefault(name, _unlisted(name, gain, done.before.effects))
        for tried in done.tried:
            known = rows.get(tried.id)
            if known is None or not known.refitted or tried.refusal is None:
                rows[tried.id] = _row(case, tried, done.before.effects)
    return sorted(rows.values(), key=lambda c: -c.gain)


def _unlisted(name: str, gain: float, beside: tuple[str, ...]) -> Candidate:
    told = standing(None, gain)
    return Candidate(
        id=name,
        family=BY_ID[name].family,
        gain=gain,
        beside=beside,
        p=share_of_healthy(told),
        strength=told,
        rejected="not fitted: expected gain too small",
    )


def _row(case: Case, tried: Tried, beside: tuple[str, ...]) -> Candidate:
    values = effect_values(case, tried.id, tried.fitted.parameters, None)
    helped, refusal = tried.account.helped, tried.refusal
    told = standing(helped, tried.gain)
    return Candidate(
        id=tried.id,
        family=BY_ID[tried.id].family,
        gain=tried.gain,
        beside=beside,
        p=share_of_healthy(told),
        parameters=values,
        held_back_gain=helped.gain if helped else None,
        strength=told,
        improved=helped.share if helped else None,
        rms_fall=dict(tried.account.falls),
        refitted=tried.account.settled,
        rejected=refusal.text if refusal else "",
        refusal=Refused(**asdict(refusal)) if refusal else None,
    )
