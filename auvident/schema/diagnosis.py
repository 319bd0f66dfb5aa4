"""Artifacts of the residual loop: what the model lacks, and what adding it changed."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

from pydantic import Field, computed_field

from auvident.schema.artifacts import Coverage, CrossValidation, Finding, Verdict
from auvident.schema.base import Artifact
from auvident.schema.planes import Plane

Bound = Literal["at least", "at most"]


class ParameterValue(Artifact):
    """A parameter of an effect in the unit an engineer reads; interval of 95 %.

    ``std`` is None where it was not worked out, as of a candidate in its row. It is that of the
    fit; where what goes with a size is open by itself (`EffectParameter.known_to`) the interval is
    wider than that.
    ``bound`` is set where the search ended at a bound of the parameter: it is as large as
    ``value``, or larger (``at least``), or as small or smaller (``at most``), and its interval is
    open to that side.
    ``matters_from`` is the practical size for this vehicle: from there on (of a limit: down from
    there) it is worth a word; None where none is declared for it alone.
    """

    symbol: str
    value: float
    std: float | None
    unit: str
    low: float | None = None
    high: float | None = None
    bound: Bound | None = None
    matters_from: float | None = None

    @computed_field  # type: ignore[prop-decorator]
    @property
    def interval(self) -> tuple[float | None, float | None] | None:
        """``(low, high)``, None for an open end; None where it was not worked out."""
        told = (self.low is not None) + (self.high is not None)
        return (self.low, self.high) if told == (1 if self.bound else 2) else None

    @property
    def half(self) -> float:
        """From the value to the end of the interval that is further away; zero without one."""
        ends = [end for end in self.interval or () if end is not None]
        return max((abs(end - self.value) for end in ends), default=0.0)

    def half_of_fit(self, known_to: float) -> float:
        """The same of the interval before `ends` moved its ends by the factor ``known_to``."""
        low = None if self.low is None else _moved(self.low, -1.0, 1.0 / known_to)
        high = None if self.high is None else _moved(self.high, 1.0, 1.0 / known_to)
        return self.model_copy(update={"low": low, "high": high}).half


def ends(
    value: float, half: float, bound: Bound | None, known_to: float = 1.0
) -> dict[str, float | None]:
    """Ends ``low`` and ``high`` of an interval so far to both sides, open beyond a bound.

    Each is moved away by the factor to which the value is known at best, and none past zero.
    """
    low, high = _moved(value - half, -1.0, known_to), _moved(value + half, 1.0, known_to)
    return {
        "low": None if bound == "at most" else low,
        "high": None if bound == "at least" else high,
    }


def _moved(end: float, side: float, factor: float) -> float:
    """A lower (-1) or upper (1) end moved outwards by a factor, its sign kept."""
    return end * factor if side * end > 0.0 else end / factor


class EffectFound(Artifact):
    """An effect that was accepted.

    ``plain`` says it in words (a current in m/s and degrees, a side force in N at cruise).
    ``maneuver``, ``time_s`` and ``duration_s`` belong to a `one_off_event` or a `thrust_step`;
    ``at_bound`` are the symbols of the parameters that are known to one side only. ``frame`` is
    what directions count from: north, or the bow at the start of the log where there is no heading.
    ``by_sensors``: logs held against each other show it, whatever the model.
    """

    id: str
    family: str
    parameters: tuple[ParameterValue, ...]
    plain: str = ""
    maneuver: str | None = None
    time_s: float | None = None
    duration_s: float | None = None
    frame: Literal["north", "bow"] = "north"
    by_sensors: bool = False

    @computed_field  # type: ignore[prop-decorator]
    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters that ended at a bound of theirs."""
        return tuple(p.symbol for p in self.parameters if p.bound)


class Refused(Artifact):
    """The rule by which a candidate was refused, its evidence and what it asks for."""

    code: str
    evidence: float | None = None
    threshold: float | None = None


class Candidate(Artifact):
    """One effect that was tried.

    ``gain`` is the rise of the log-likelihood by adding it, in nats, corrected for the colour of
    the residual; never below zero, as the fit with it holds the one without. ``held_back_gain``
    is that of identifying maneuvers left out in turn, ``strength`` the same in its standard errors
    (fewer where it helps too few of them or explains too little; where it helps none, or did not
    come so far, -1 / (1 + ``gain``)), ``p`` how often the strongest candidate of a healthy vehicle
    has as much, ``improved`` the share of the maneuvers left out that it helps, ``rms_fall`` the
    relative fall of the residual by channel. ``held_back_gain`` and ``improved`` are those of
    candidates that came so far. ``refitted`` is false where ``gain`` is only what the first steps
    promise. ``rejected`` says in words which test it failed, empty for an accepted one, and
    ``refusal`` by which rule. ``beside`` are the effects that the model had already: gains beside
    others are no gains of the same model.
    """

    id: str
    family: str
    gain: float
    beside: tuple[str, ...] = ()
    p: float | None = None
    parameters: tuple[ParameterValue, ...] = ()
    held_back_gain: float | None = None
    strength: float | None = None
    improved: float | None = None
    rms_fall: dict[str, float] = {}
    refitted: bool = False
    rejected: str = ""
    refusal: Refused | None = None


class Detectable(Artifact):
    """Smallest size of an effect that these maneuvers would show.

    ``visible`` is false where that is beyond any plausible size, with the reason in ``why``;
    ``kept`` is the share of its signature that the coefficients cannot take up. A one-off event has
    a size in sway and one in yaw (heave and pitch), and shows where it exceeds both.
    """

    id: str
    family: str
    symbol: str
    size: float
    unit: str
    visible: bool
    kept: float
    why: str = ""


class Lookalikes(Artifact):
    """Effects that these maneuvers cannot, or can hardly, tell apart; what would separate them."""

    ids: tuple[str, ...]
    cosine: float
    separate_by: str = ""


class ResidualRow(Artifact):
    """Residual of one channel in one identifying maneuver against the noise of its sensor."""

    maneuver: str
    channel: str
    unit: str
    rms: float
    rms_after: float
    noise_std: float
    correlation_time_s: float


class Diagnosis(Artifact):
    """``diagnose/diagnosis.json``.

    ``sees`` stands before any verdict: what these maneuvers can show. ``nuisance`` are the
    effects estimated along in every model (servo lag and the like), with what they took up.
    ``steps`` tells in order what was added, tested and removed. ``carried`` has the internal values
    (``start``) of all effects that a refined model takes along, and ``prior`` and ``prior_std`` of
    those estimated again. ``not_confirmed`` are effects that fit better although the intervals of
    their sizes contain zero, or that were found beside such a one: a refinement tries them too.
    ``unexplained`` has ``correlates`` (axis, regressor, gain), ``nearest`` and ``channels`` where
    something is left; ``remaining`` has its ``channels`` and ``correlates`` where effects stand
    beside it, and its ``sizes`` against noise and variation, there and where it is too little to
    matter. ``without_effects`` is the verdict if no effect stands in the end: whether the model
    before leaves anything that matters.
    ``false_alarm_p`` is the ``p`` of the effect that was accepted first, None where none was.
    """

    schema_: str = Field(default="auvident/diagnosis/1", alias="schema")
    plane: Plane
    verdict: Verdict
    statement: str
    effects: tuple[EffectFound, ...] = ()
    not_confirmed: tuple[EffectFound, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    ambiguous: tuple[tuple[str, ...], ...] = ()
    unexplained: dict[str, Any] = {}
    remaining: dict[str, Any] = {}
    without_effects: Verdict = "unexplained"
    sees: tuple[Detectable, ...] = ()
    lookalikes: tuple[Lookalikes, ...] = ()
    separate_by: str = ""
    nuisance: tuple[EffectFound, ...] = ()
    carried: dict[str, dict[str, float]] = {}
    steps: tuple[str, ...] = ()
    residuals: tuple[ResidualRow, ...] = ()
    checks: dict[str, Any] = {}
    missing: tuple[str, ...] = ()
    false_alarm_p: float | None = None
    identify_maneuvers: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def to_try(self) -> tuple[EffectFound, ...]:
        """Effects that a refinement tries: those that are claimed, and then those that are not."""
        return (*self.effects, *self.not_confirmed)


class ChannelError(Artifact):
    """Root mean square error of a prediction."""

    rmse: float
    nrmse: float
    unit: str


class Difference(Artifact):
    """After minus before of an RMSE, with a 95 % interval.

    From a bootstrap over maneuvers, and over blocks of time in each, as wide as so few maneuvers
    ask for (Student's t).
    """

    value: float
    low: float
    high: float


class ManeuverComparison(Artifact):
    """Errors of one maneuver before and after."""

    id: str
    kind: str
    role: str
    before: dict[str, ChannelError]
    after: dict[str, ChannelError]
    difference: dict[str, Difference] = {}


class HeldOut(Artifact):
    """Errors over all held-out maneuvers together, before and after, by channel."""

    maneuvers: tuple[str, ...]
    before: dict[str, ChannelError]
    after: dict[str, ChannelError]
    difference: dict[str, Difference] = {}


class CoefficientComparison(Artifact):
    """A coefficient before and after, against the estimate from geometry."""

    symbol: str
    unit: str
    prior: float
    prior_std: float
    before: float
    before_std: float
    after: float
    after_std: float


class Attempt(Artifact):
    """A model that a refinement could have taken; the first one is the model before.

    ``effects`` are those it carries; ``ratios`` its errors in the maneuvers that identify over
    those of the model before, by channel, what is masked apart. ``ran_away`` says that it leaves
    every bound in one of them. ``left_out`` are the ratios for these maneuvers left out in turn,
    which decide; empty where too few are left out. ``left_out_se`` are the standard errors of
    their logarithms over maneuvers; ``balance`` is the mean logarithm of the ratio over maneuvers,
    in each the mean over its channels, with its standard error. ``keeps`` names channels for whose
    sake the others counted less, ``own_starts`` says that readings counted by what is left of them
    with the starts fitted, ``failed`` why an attempt came to no model. ``unclaimed`` is one with
    the small effects alone that every vehicle may have.
    """

    effects: tuple[str, ...]
    ratios: dict[str, float] = {}
    ran_away: bool = False
    taken: bool = False
    left_out: dict[str, float] = {}
    left_out_se: dict[str, float] = {}
    balance: float | None = None
    balance_se: float | None = None
    keeps: tuple[str, ...] = ()
    own_starts: bool = False
    failed: str = ""
    unclaimed: bool = False


class ForceTried(Artifact):
    """A force without a name with one spread of its prior; the other keys are those of `Attempt`.

    ``spread`` is in units of the prior of `auvident.schema.unexplained`.
    """

    spread: float
    left_out: dict[str, float] = {}
    left_out_se: dict[str, float] = {}
    balance: float | None = None
    balance_se: float | None = None
    ran_away: bool = False
    failed: str = ""
    taken: bool = False


class CrossValidated(Artifact):
    """Errors of the identifying maneuvers, each left out in turn, of two models by channel."""

    before: dict[str, CrossValidation] = {}
    after: dict[str, CrossValidation] = {}


class UnexplainedForce(Artifact):
    """A force without a name, which predicts: asked for by ``--with-unexplained``.

    ``left_out`` and ``held_out`` compare the model with it to that without it, effects in both.
    Where it was not ``added`` they are empty.
    """

    added: bool
    statement: str
    spread: float | None = None
    tried: tuple[ForceTried, ...] = ()
    left_out: CrossValidated | None = None
    held_out: HeldOut | None = None


def keeps(attempts: Sequence[Attempt]) -> bool:
    """Whether the first of some attempts, the model before, was taken."""
    return any(a.taken for a in attempts[:1])


def left_outside(effects: Iterable[str], attempts: Sequence[Attempt]) -> frozenset[str]:
    """Those of some effects that the model taken has not; none where nothing was tried."""
    taken = next((a for a in attempts if a.taken), None)
    return frozenset() if taken is None else frozenset(effects) - set(taken.effects)


class Comparison(Artifact):
    """``refine/comparison.json``.

    ``effects`` are those that the refined model confirms, with the sizes it ends at;
    ``not_confirmed`` those that it predicts with although their intervals hold zero, or that were
    found beside such a one.
    ``attempts`` are empty where there was nothing to add. ``unexplained_force`` is a force
    without a name, where it was asked for: verdict and effects are those without it. ``coverage``
    is that of the band of the refined model.
    """

    schema_: str = Field(default="auvident/comparison/1", alias="schema")
    verdict: Verdict
    statement: str
    effects: tuple[EffectFound, ...] = ()
    not_confirmed: tuple[EffectFound, ...] = ()
    ambiguous: tuple[tuple[str, ...], ...] = ()
    attempts: tuple[Attempt, ...] = ()
    held_out: HeldOut
    identify: HeldOut
    maneuvers: tuple[ManeuverComparison, ...] = ()
    coefficients: tuple[CoefficientComparison, ...] = ()
    coverage: dict[str, Coverage] = {}
    false_alarm_p: float | None = None
    candidates: tuple[Candidate, ...] = ()
    unexplained: dict[str, Any] = {}
    remaining: dict[str, Any] = {}
    cross_validation: CrossValidated = CrossValidated()
    unexplained_force: UnexplainedForce | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def is_kept(self) -> bool:
        """Whether no effect was added, as the model before predicts better."""
        return keeps(self.attempts)

    @property
    def outside(self) -> frozenset[str]:
        """Effects that logs alone show and that the model taken is without."""
        return left_outside((e.id for e in self.effects if e.by_sensors), self.attempts)

    @property
    def added(self) -> bool:
        """Whether anything is said to be in the model that was not in the one before."""
        force = self.unexplained_force is not None and self.unexplained_force.added
        small = any(a.taken and a.unclaimed for a in self.attempts)
        return (bool(self.effects or self.not_confirmed) and not self.is_kept) or small or force
