"""By what rules a search accepts an effect: each alone, in one table, on plain numbers.

Likelihood alone accepts nothing: any model is wrong in small ways that a long record shows. A
candidate is refused by the first rule that it fails; what refused it stands in the artifact with
its evidence and its threshold.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from auvident.stages.diagnose.score.left_out import Helped

LEAST_GAIN = 100.0  # [nats]
OF_BEST = 0.5  # a candidate must gain this share of the best one's
# Of the rms of some channel. Planted effects made it fall by 0.29 and more, what a model of a
# healthy vehicle lacks by 0.14 at most (50 generated trials, seeds 1000 to 1049).
LEAST_FALL = 0.2
LEAST_MANEUVERS = 2  # without which none can be left out
LEAST_SHARE = 0.6  # of the maneuvers left out that an effect has to help
SURE_SHARE = 0.7  # ... and from which on one bad place does not count against it
SIMPLER, SIMPLER_LEAST = 0.04, 4.0  # an effect with fewer parameters may gain so much less [nats]
ALIKE = 0.12  # effects that gain all but this share of the best are not told apart
ALIKE_LEAST = 12.0  # [nats] nor those within this
RMS_ALIKE = 1.15  # ... and leave no residual larger by more
MOST_QUIET = 2  # effects taken along without a claim
POSITIVE = 1.0e-9  # least bound of a gain that counts as above zero [nats]


@dataclass(frozen=True)
class Account:
    """What is known of a candidate once it has been fitted.

    Attributes
    ----------
    id : str
    gain : float
        Rise of the log-likelihood [nats].
    best_gain : float
        That of the best candidate of the round [nats].
    parameters : int
        How many it has.
    size : float
        In practical sizes, beyond what every model is expected to have.
    falls : mapping
        Relative fall of the rms of the residual by channel.
    rms : tuple of float
        Of the residual with it, by channel.
    at_bound : bool
        A parameter lies at a physical bound other than off.
    settled : bool
        The fit has converged; false where it was given up as hopeless.
    promise : float
        The most that the first steps of a fit let one hope for [nats].
    maneuvers : int
        That identify.
    helped : Helped or None
        What it does for maneuvers left out, once that was tried.
    """

    id: str
    gain: float
    best_gain: float
    parameters: int
    size: float
    falls: Mapping[str, float]
    rms: tuple[float, ...]
    at_bound: bool
    settled: bool
    promise: float
    maneuvers: int
    helped: Helped | None = None


@dataclass(frozen=True)
class Refusal:
    """Why a candidate is not accepted: the rule, what it looked at and what it asks for."""

    code: str
    text: str
    evidence: float | None = None
    threshold: float | None = None


@dataclass(frozen=True)
class Rule:
    """A rule of the search: evidence of a candidate that must reach a threshold.

    Attributes
    ----------
    code : str
    asks : str
        What it asks for, for people.
    evidence : callable
    least : float
    words : str
        Why a candidate that fails it is refused; fields ``evidence``, ``least``, ``promise``,
        ``share`` (of the maneuvers left out, in percent).
    """

    code: str
    asks: str
    evidence: Callable[[Account], float]
    least: float
    words: str


def _bound_of_gain(account: Account) -> float:
    """Lower bound of the gain in what was left out; infinite where most maneuvers are helped."""
    if account.helped is None or account.helped.share >= SURE_SHARE:
        return math.inf
    return account.helped.low


def _share_helped(account: Account) -> float:
    found = account.helped
    return math.inf if found is None else max(found.share, found.deciding)


RULES: tuple[Rule, ...] = (
    Rule(
        "unsettled",
        "its fit has converged",
        lambda a: float(a.settled),
        1.0,
        "expected to gain only {promise:.0f} nats, far less than the best candidate; not "
        "fitted to convergence",
    ),
    Rule(
        "gain",
        "its gain in likelihood is large enough",
        lambda a: a.gain,
        LEAST_GAIN,
        "evidence too weak ({evidence:.0f} nats, {least:.0f} needed)",
    ),
    Rule(
        "of-best",
        "it is not a by-product of another",
        lambda a: a.gain / a.best_gain,
        OF_BEST,
        "gains less than half as much as the best candidate",
    ),
    Rule(
        "small",
        "it is large enough to matter",
        lambda a: a.size,
        1.0,
        "too small to matter in practice",
    ),
    Rule(
        "no-fall",
        "some residual falls clearly",
        lambda a: max(a.falls.values()),
        LEAST_FALL,
        "hardly improves any channel",
    ),
    Rule(
        "bound",
        "its size is plausible",
        lambda a: float(not a.at_bound),
        1.0,
        "ends at the bound of what is plausible",
    ),
    Rule(
        "maneuvers",
        "there is another maneuver to try it on",
        lambda a: float(a.maneuvers),
        LEAST_MANEUVERS,
        "there is no other maneuver to test it on",
    ),
)
# ... and once it was tried on maneuvers left out of its fit
RULES_LEFT_OUT: tuple[Rule, ...] = (
    Rule(
        "share-helped",
        "it helps most of the maneuvers left out",
        _share_helped,
        LEAST_SHARE,
        "improves only {share:.0f} % of the maneuvers left out",
    ),
    Rule(
        "by-chance",
        "it helps them more than chance would",
        _bound_of_gain,
        POSITIVE,
        "improves the maneuvers left out no more than chance would",
    ),
)
ANOTHER = Refusal("another", "another candidate gains more")


def refusal_of(account: Account, rules: Sequence[Rule]) -> Refusal | None:
    """The first rule that a candidate fails; None where it passes all."""
    for rule in rules:
        value = rule.evidence(account)
        if not value >= rule.least:
            share = 100.0 * account.helped.share if account.helped else 0.0
            text = rule.words.format(
                evidence=value, least=rule.least, promise=account.promise, share=share
            )
            return Refusal(rule.code, text, float(value), rule.least)
    return None


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
        refusal = refusal_of(account, RULES)
        if refusal is None and accepted:
            refusal = ANOTHER
        elif refusal is None:
            account = replace(account, helped=leave_out(account))
            refusal = refusal_of(account, RULES_LEFT_OUT)
            accepted = refusal is None
        judged.append((account, refusal))
    return simplest(judged)


def simplest(judged: Sequence[Judged]) -> list[Judged]:
    """The same with a candidate of fewer parameters accepted, if it gains nearly as much."""
    accepted = next((a for a, refusal in judged if refusal is None), None)
    if accepted is None:
        return list(judged)
    least = accepted.gain - max(SIMPLER * accepted.gain, SIMPLER_LEAST)
    for account, _ in judged:
        fewer = account.parameters < accepted.parameters
        if fewer and account.gain >= least and refusal_of(account, RULES) is None:
            text = f"{account.id} does as well with fewer parameters"
            instead: dict[str, Refusal | None] = {
                accepted.id: Refusal("simpler", text),
                account.id: None,
            }
            return [(a, instead.get(a.id, refusal)) for a, refusal in judged]
    return list(judged)


def told_apart_from(accepted: Account, accounts: Sequence[Account]) -> tuple[str, ...]:
    """Candidates that explain the data as well as the accepted one."""
    least = accepted.gain - max(ALIKE * accepted.gain, ALIKE_LEAST)
    return tuple(
        a.id
        for a in accounts
        if a.id != accepted.id
        and a.gain >= least
        and a.size >= 1.0
        and all(own <= RMS_ALIKE * best for own, best in zip(a.rms, accepted.rms, strict=True))
    )


def nuisance_of(judged: Sequence[Judged], rms_before: Sequence[float], quiet: int) -> str | None:
    """A small effect that stands before others, to be taken along without a claim.

    Parameters
    ----------
    judged : sequence of (Account, Refusal)
        Of a round in which none was accepted, largest gain first.
    rms_before : sequence of float
        Of the residual without any of them, by channel.
    quiet : int
        Effects that are taken along already.
    """
    if not judged or quiet >= MOST_QUIET:
        return None
    (first, refusal), *others = judged
    hidden = any(a.gain > LEAST_GAIN for a, _ in others)
    worse = any(own > RMS_ALIKE * b for own, b in zip(first.rms, rms_before, strict=True))
    small = refusal is not None and refusal.code in ("small", "no-fall")
    return first.id if small and hidden and not worse and first.gain >= LEAST_GAIN else None
