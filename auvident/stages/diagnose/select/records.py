"""What the rules of the search look at: one plain record for each decision."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from auvident.stages.diagnose.score.left_out import Helped


@dataclass(frozen=True)
class Screened:
    """A candidate to first order: its gain [nats] and how many of its list are before it."""

    id: str
    gain: float
    place: int


@dataclass(frozen=True)
class Apart:
    """What a candidate gains, and the most that it would as a by-product of another [nats]."""

    gain: float
    by_others: float


@dataclass(frozen=True)
class Start:
    """Where the fit of a candidate may begin.

    Attributes
    ----------
    promise : float
        What its first step lets one hope for [nats].
    gained : float
        By the best of those that lead and are large enough to matter [nats].
    unseen : bool
        To first order too little is known of it: a limit that is reached, what has left its mark
        in the coefficients, what looks like an effect that is too small to be named, or what no
        other may explain.
    """

    promise: float
    gained: float
    unseen: bool


@dataclass(frozen=True)
class Begun:
    """A candidate after the first steps of its fit.

    Attributes
    ----------
    id : str
    place : int
        How many promise more.
    promise, best_promise : float
        The most that the first steps let one hope for, and that of the best [nats].
    by_others : float
        The most of its promise that it may have as a by-product of another [nats].
    gain, best_gain : float
        Rise of the log-likelihood, and that of the best that is finished [nats].
    beside_steady : bool
        It shows in a straight run as one of the leading ones does.
    """

    id: str
    place: int
    promise: float
    best_promise: float
    by_others: float
    gain: float
    best_gain: float
    beside_steady: bool


@dataclass(frozen=True)
class Afresh:
    """Gain of a candidate fitted from the estimate, and what it had come to elsewhere [nats].

    `near` is that of its fit from the model, zero where there is none.
    """

    gain: float
    near: float


@dataclass(frozen=True)
class Rival:
    """A candidate behind the best one, both against the model fitted again from where that lies.

    Attributes
    ----------
    gain, best_gain : float
        [nats]
    moved : float
        What the model itself gained by being fitted again [nats].
    """

    gain: float
    best_gain: float
    moved: float


@dataclass(frozen=True)
class Account:
    """What is known of a candidate once it has been fitted.

    Attributes
    ----------
    id : str
    gain : float
        Rise of the log-likelihood [nats].
    by_others : float
        The most that it would gain as a by-product of another candidate of the round [nats].
    parameters : int
        How many it has.
    size : float
        In practical sizes, beyond what every model is expected to have.
    falls : mapping
        Relative fall of the rms of the residual by channel.
    rms : tuple of float
        Of the residual with it, by channel.
    impossible : bool
        A parameter lies at the bound to a side where no size is possible.
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
    by_others: float
    parameters: int
    size: float
    falls: Mapping[str, float]
    rms: tuple[float, ...]
    impossible: bool
    settled: bool
    promise: float
    maneuvers: int
    helped: Helped | None = None

    @property
    def share(self) -> float:
        """Of the maneuvers left out, what it helps [percent]."""
        return 100.0 * self.helped.share if self.helped else 0.0


@dataclass(frozen=True)
class Beside:
    """A candidate beside the one that is accepted."""

    accepted: Account
    other: Account

    @property
    def gain_share(self) -> float:
        """Its gain over that of the accepted one."""
        return self.other.gain / self.accepted.gain

    @property
    def gain_lost(self) -> float:
        """By how much it gains less than the accepted one [nats]."""
        return self.accepted.gain - self.other.gain

    @property
    def rms_ratio(self) -> float:
        """Largest ratio of its residual to that of the accepted one, over the channels."""
        return ratio_of(self.other.rms, self.accepted.rms)


@dataclass(frozen=True)
class Containing:
    """An effect that may be more general than the accepted one.

    Attributes
    ----------
    further : int
        Parameters that it has more.
    cosine : float
        Likeness of the two.
    """

    further: int
    cosine: float


@dataclass(frozen=True)
class Nuisance:
    """The best candidate of a round in which none was accepted.

    Attributes
    ----------
    refused_as : str
        Code of its refusal; empty without one.
    t : float
        Its gain in maneuvers left out, in standard errors; zero where that was not tried.
    hidden_gain : float
        The best one of the others [nats].
    rms_ratio : float
        Largest ratio of the residual with it to that without, over the channels.
    unclaimed : int
        Effects that are taken along already.
    """

    refused_as: str
    t: float
    hidden_gain: float
    rms_ratio: float
    unclaimed: int


@dataclass(frozen=True)
class Reconciled:
    """An effect, by what sensors held against each other say without any model.

    Attributes
    ----------
    gain : float
        Rise of the likelihood of what they say with it [nats].
    share : float
        Of their disagreement without it that it takes away.
    """

    gain: float
    share: float


@dataclass(frozen=True)
class Hiding:
    """A candidate of a round in which none was accepted, that another effect may hide.

    Attributes
    ----------
    tried : bool
        Whether maneuvers were left out of its fit, which is what it was refused for.
    large : float
        Its size [practical sizes].
    t : float
        Its gain in maneuvers left out, in standard errors.
    explained : float
        Share of the power of a residual that it explains where it was fitted, of the channel where
        that is most.
    """

    tried: bool
    large: float
    t: float
    explained: float


@dataclass(frozen=True)
class Accepted:
    """An effect that was accepted: its gain [nats] and how many effects were there before it."""

    higher_order: bool
    gain: float
    before: int


@dataclass(frozen=True)
class Replacing:
    """Effects that may explain what others explain.

    Attributes
    ----------
    promise : float
        What they let one hope for beside a model without those others [nats].
    worth : float
        What those gain [nats].
    unseen : bool
        To first order nothing is known of them: a limit that may be reached.
    """

    promise: float
    worth: float
    unseen: bool = False


@dataclass(frozen=True)
class Exchanged:
    """A model with effects exchanged.

    Attributes
    ----------
    size : float
        The least of those put in [practical sizes].
    impossible : bool
        One of them has a size that cannot be.
    gain : float
        Rise of the logarithm of likelihood and prior [nats].
    fewer : bool
        It has fewer parameters.
    share : float
        The gain, as a share of what the effects taken out are worth; infinite where no parameter
        is added for it.
    """

    size: float
    impossible: bool
    gain: float
    fewer: bool
    share: float = math.inf


def ratio_of(rms: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Largest ratio of two residuals over the channels."""
    return max(own / best for own, best in zip(rms, other, strict=True))
