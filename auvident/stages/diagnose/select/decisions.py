"""What the rules make of the candidates of one round; no fit is looked at."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from auvident.schema.likeness import partners
from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.records import Account, Beside, Hiding, Nuisance, ratio_of
from auvident.stages.diagnose.select.rule import Refusal, passes, refusal_of

Judged = tuple[Account, Refusal | None]


def judge(accounts: Sequence[Account], leave_out: Callable[[Account], Helped]) -> list[Judged]:
    """Test candidates in their order; the first that passes is the one without a refusal.

    Parameters
    ----------
    accounts : sequence of Account
        Largest gain first.
    leave_out : callable
        Tries a candidate on maneuvers left out; called only until one is accepted.
    """
    judged: list[Judged] = []
    accepted = False
    for account in accounts:
        refusal = refusal_of(account, rules.RULES)
        if refusal is None and accepted:
            refusal = rules.ANOTHER
        elif refusal is None or _may_hide_others(refusal, judged):
            account = replace(account, helped=leave_out(account))
            refusal = refusal or refusal_of(account, rules.RULES_LEFT_OUT)
            accepted = refusal is None
        judged.append((account, refusal))
    return simplest(judged)


def _may_hide_others(refusal: Refusal, judged: Sequence[Judged]) -> bool:
    """Whether it is the best candidate, and what refuses it is no lack of evidence."""
    return not judged and refusal.code == "small"


def simplest(judged: Sequence[Judged]) -> list[Judged]:
    """The same with a candidate of fewer parameters accepted, if it gains nearly as much."""
    accepted = next((a for a, refusal in judged if refusal is None), None)
    if accepted is None:
        return list(judged)
    for account in (a for a, _ in judged if a.id != accepted.id):
        if passes(Beside(accepted, account), rules.SIMPLER):
            text = f"{account.id} explains as much with fewer parameters"
            instead: dict[str, Refusal | None] = {
                accepted.id: Refusal("simpler", text),
                account.id: None,
            }
            return [(a, instead.get(a.id, refusal)) for a, refusal in judged]
    return list(judged)


def told_apart_from(accepted: Account, accounts: Sequence[Account]) -> tuple[str, ...]:
    """Candidates that explain the data as well as the accepted one."""
    found, kin = [], partners(accepted.id)
    for account in (a for a in accounts if a.id != accepted.id):
        beside = Beside(accepted, account)
        alike = account.id in kin and passes(beside, rules.ALIKE_OF_KIND)
        if alike or passes(beside, rules.ALIKE):
            found.append(account.id)
    return tuple(found)


def left_to_the_motion(accepted: Account, rivals: Sequence[Account]) -> tuple[str, ...]:
    """Candidates that sensors take for the accepted one, and the motion hardly tells from it."""
    return tuple(a.id for a in rivals if passes(Beside(accepted, a), rules.ALIKE_TO_SENSORS))


def nuisance_of(
    judged: Sequence[Judged], rms_before: Sequence[float], unclaimed: int
) -> str | None:
    """A small effect that stands before others, to be taken along without a claim.

    Parameters
    ----------
    judged : sequence of (Account, Refusal)
        Of a round in which none was accepted, largest gain first.
    rms_before : sequence of float
        Of the residual without any of them, by channel.
    unclaimed : int
        Effects that are taken along already.
    """
    if not judged:
        return None
    (first, refusal), *others = judged
    nuisance = Nuisance(
        refusal.code if refusal else "",
        first.helped.t if first.helped else 0.0,
        max((a.gain for a, _ in others), default=0.0),
        ratio_of(first.rms, tuple(rms_before)),
        unclaimed,
    )
    return first.id if passes(nuisance, rules.TAKE_ALONG) else None


def hidden_among(judged: Sequence[Judged]) -> tuple[str, ...]:
    """Candidates of a round in which none was accepted that another effect may hide, best first."""
    found = [account.id for account, _ in judged if passes(_hiding(account), rules.HIDDEN)]
    return tuple(found[: rules.MOST_HIDDEN])


def _hiding(account: Account) -> Hiding:
    fall = max(account.falls.values(), default=0.0)
    t = account.helped.t if account.helped else 0.0
    return Hiding(account.helped is not None, account.size, t, 1.0 - (1.0 - fall) ** 2)


def shown_together(first: Account, both: Helped, beside: Callable[[], Account]) -> bool:
    """Whether two effects are accepted together, the second of which was accepted beside the first.

    Parameters
    ----------
    first : Account
        The effect that was refused alone.
    both : Helped
        What the two do together.
    beside : callable
        What is known of the first one beside the second, worked out if need be.
    """
    if not passes(replace(first, helped=both), rules.RULES_LEFT_OUT):
        return False
    return passes(beside(), (*rules.RULES, *rules.RULES_BESIDE))
