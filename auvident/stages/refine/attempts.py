"""What to identify with, and which of the models to take: the one before is one of them."""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import pandas as pd

from auvident.engines.carried import Carried, Window, allowed
from auvident.errors import NumericsError
from auvident.schema.artifacts import Finding, IdentifiedModel, LeftOutSummary
from auvident.schema.diagnosis import Attempt, Diagnosis
from auvident.schema.effects import BY_ID, EFFECTS
from auvident.schema.loop_statements import changes
from auvident.stages.refine.errors import channels_of, cruise_of, rms_of
from auvident.stages.refine.left_out import (
    CHANNELS,
    MUCH,
    RISE,
    LeftOutChange,
    as_told,
    left_out_change,
)

GUARDED = CHANNELS  # whose error is not to rise by more than `RISE`
# Where no maneuver can be left out an error never rises by more than this, whatever the other
# channels gain: a tenth is more than any right effect costs a channel (none of 51 trials from seed
# 1000 on rose at all).
MOST_RISE = 0.10
FLAT = 1.0e-9  # least error, or ratio of errors, that counts
# A filter lets its state follow late readings and sees only a part of the delay (0.23 and 0.30 s
# of 0.34 and 0.48 s); the fit of the free-running prediction has no such way out.
HELD = tuple(name for e in EFFECTS if e.late for name in e.names())


def carried_of(diagnosis: Diagnosis) -> Carried | None:
    """The effects that an identification has to carry; None when nothing was found.

    With an event and no effect these are the windows to leave out, and the nuisance parameters.
    """
    modelled = [e.id for e in diagnosis.to_try if BY_ID[e.id].enters != "disturbance"]
    windows = windows_of(diagnosis)
    if not modelled and not windows:
        return None
    return replace(nuisances_of(diagnosis), effects=tuple(modelled), windows=windows)


def windows_of(diagnosis: Diagnosis) -> tuple[Window, ...]:
    """Maneuver, start and end [s] of the events whose readings are left out."""
    return tuple(
        (e.maneuver, e.time_s, e.time_s + (e.duration_s or 0.0))
        for e in diagnosis.effects
        if e.id == "one_off_event" and e.maneuver is not None and e.time_s is not None
    )


def nuisances_of(diagnosis: Diagnosis) -> Carried:
    """Everything that a diagnosis hands on, without a claim."""
    told = diagnosis.carried
    stds = {n: 0.0 if n in HELD else std for n, std in told.get("prior_std", {}).items()}
    return Carried(
        start=told.get("start", {}),
        prior=told.get("prior", {}),
        prior_std=stds,
        expected=told.get("expected", {}),
    )


def unclaimed(
    diagnosis: Diagnosis, model: IdentifiedModel, speed_mps: float, claimed: Collection[str] = ()
) -> Carried:
    """The small effects that every vehicle may have, from where the diagnosis ended; no claim.

    Parameters
    ----------
    diagnosis : Diagnosis
    model : IdentifiedModel
    speed_mps : float
        Of the vehicle in the maneuvers.
    claimed : collection of str
        Effects that stand; others that were found are left as small as every model is allowed.
    """
    out = {e.id for e in diagnosis.to_try} - {*claimed}
    usual = allowed(sorted(out), model.plane, model.length_m, speed_mps)
    return replace(without(nuisances_of(diagnosis), out, usual), windows=windows_of(diagnosis))


def attempts(carried: Carried, before: IdentifiedModel) -> tuple[Carried, ...]:
    """What to identify with, in order: all nuisances first, then those of the model before.

    With many of them the filter may improve one channel at the cost of another: at the trial of
    seed 1622 the error of r rose by 41 % in the maneuvers that identify, by 19 % in the others.
    At last by the starts of the fit: the race of the tanker's propeller, found with 13,000 nats,
    was fitted at half its size with an error of u ten times that of the diagnosis.
    """
    lean = carried.only({*carried.effects, *(str(e["id"]) for e in before.effects)})
    own = replace(carried, own_starts=True)
    return (carried, own) if lean == carried else (carried, lean, own)


def fewer(carried: Carried, before: IdentifiedModel, speed_mps: float) -> Iterator[Carried]:
    """What was found without the effects that were accepted last: one less each time, down to one.

    An effect that is not there spoils what a right one beside it gains (population, even seed
    5504: a side force of the propeller at its size, refused for a step of thrust with which the
    error of u doubled). Of what is taken out as much is left as every model is allowed.
    """
    for n in range(len(carried.effects) - 1, 0, -1):
        out = set(carried.effects[n:])
        has = [str(e["id"]) for e in before.effects if e["id"] in out]
        usual = allowed(has, before.plane, before.length_m, speed_mps)
        yield replace(without(carried, out, usual), effects=carried.effects[:n])


def without(carried: Carried, out: set[str], usual: Carried) -> Carried:
    """What is carried without some effects, of which as much is left as is usual."""
    kept = {name.partition(".")[0] for name in carried.start} - out
    return carried.only(kept).with_values_of(usual)


@dataclass(frozen=True)
class TriedModel:
    """An identification with effects, and its errors beside those of the model before.

    Attributes
    ----------
    effects : tuple of str
    ratios : dict of str to float
        Error in the maneuvers that identify over that of the model before, by channel; infinite
        where it runs away and the model before does not.
    left_out : LeftOutChange or None
        The same with each of these maneuvers left out in turn, which decides; None where too few
        can be left out, so that the ratios do.
    keeps : tuple of str
        Channels for whose sake the others counted less.
    own_starts : bool
        Whether readings counted by what is left with the starts fitted.
    failed : str
        Why it came to no model; empty where it did.
    masks : bool
        Whether it leaves readings out.
    """

    effects: tuple[str, ...]
    ratios: dict[str, float]
    left_out: LeftOutChange | None = None
    keeps: tuple[str, ...] = ()
    own_starts: bool = False
    failed: str = ""
    masks: bool = False

    @property
    def rise(self) -> tuple[float, str]:
        """Largest relative rise of an error, and its channel."""
        return max(((ratio - 1.0, c) for c, ratio in self.ratios.items()), default=(0.0, ""))

    @property
    def rising(self) -> tuple[str, ...]:
        """Channels whose error rises, where maneuvers are left out beyond chance."""
        if self.left_out is not None:
            return self.left_out.rising()
        return tuple(c for c, ratio in self.ratios.items() if ratio - 1.0 > RISE)

    @property
    def costs_much(self) -> bool:
        """Whether an error left out rises by much, be it by chance: with less it may not.

        Every maneuver has one vote. Three models of 260 trials of two seasons had a false backlash
        beside a current: most maneuvers gained, and without the straight run that had told its
        size the error of r was up to seven times as large.
        """
        ratios = {} if self.left_out is None else self.left_out.ratios
        return max(ratios.values(), default=0.0) > 1.0 + MUCH

    @property
    def balance(self) -> float:
        """Mean logarithm of the ratios: what one channel gains has to outweigh what others pay."""
        if self.left_out is not None:
            return self.left_out.balance
        values = [math.log(max(ratio, FLAT)) for ratio in self.ratios.values()]
        return sum(values) / len(values) if values else 0.0

    @property
    def is_lost(self) -> bool:
        """Whether there is no model, or it leaves every bound where the one before does not."""
        rescues = any(ratio <= FLAT for ratio in self.ratios.values())  # the one before does
        lost = self.left_out is not None and self.left_out.ran_away and not rescues
        return bool(self.failed) or lost or any(math.isinf(x) for x in self.ratios.values())

    @property
    def is_good(self) -> bool:
        """Whether no error rises."""
        return self.is_better and not self.rising

    @property
    def is_better(self) -> bool:
        """Whether it predicts better than the model before, nothing much worse.

        Where maneuvers left out do not tell, by the errors of the fit.
        """
        if self.is_lost or (self.left_out is not None and self.left_out.is_larger):
            return False
        return self._fits_better or not (self.left_out is None or self.left_out.is_undecided)

    @property
    def _fits_better(self) -> bool:
        """Whether no error rises in the fit, or what rises a little is outweighed there."""
        logs = [math.log(max(ratio, FLAT)) for ratio in self.ratios.values()]
        return self.rise[0] <= RISE or (self.rise[0] <= MOST_RISE and sum(logs) < 0.0)


def tried_with(
    carried: Carried,
    before: pd.DataFrame,
    after: pd.DataFrame,
    left_out: tuple[LeftOutSummary | None, LeftOutSummary | None] = (None, None),
) -> TriedModel:
    """Errors of an attempt in the maneuvers that identify; what is masked counts for nothing.

    Parameters
    ----------
    carried : Carried
    before, after : pandas.DataFrame
        As `validate` writes them. Held-out maneuvers have no part in the result.
    left_out : tuple
        The same maneuvers left out in turn, before and after; one of which readings are masked
        does not count.
    """
    old, new = _identifying(carried, before, before), _identifying(carried, before, after)
    ratios = {
        name: _ratio(rms_of(old, column), rms_of(new, column))
        for column, name, _ in channels_of(before)
        if name in GUARDED
    }
    seen = {name: ratio for name, ratio in ratios.items() if not math.isnan(ratio)}
    change = left_out_change(*left_out, {name for name, _, _ in carried.windows})
    return replace(_of(carried, before), ratios=seen, left_out=change)


def _of(carried: Carried, before: pd.DataFrame) -> TriedModel:
    """What an attempt carries, without any errors."""
    return TriedModel(
        carried.effects,
        {},
        keeps=_kept(carried, before),
        own_starts=carried.own_starts,
        masks=bool(carried.windows),
    )


def _kept(carried: Carried, before: pd.DataFrame) -> tuple[str, ...]:
    """Channels for whose sake the others count less."""
    if not carried.least_noise:
        return ()
    own = ((column, name) for column, name, _ in channels_of(before) if name in GUARDED)
    return tuple(name for column, name in own if column not in carried.least_noise)


def _identifying(carried: Carried, before: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Rows of a prediction in the maneuvers that identify, without those that are masked."""
    rows = (before["role"] == "identify").to_numpy()
    for maneuver, start, end in carried.windows:
        inside = before["time_s"].between(start, end) & (before["maneuver"] == maneuver)
        rows = rows & ~inside.to_numpy()
    return table.loc[before.index[rows]]


def _ratio(before: float, after: float) -> float:
    """Error after over error before; where both run away they are alike."""
    if math.isinf(before):
        return 1.0 if math.isinf(after) else FLAT
    return after / max(before, FLAT)


class Predicted(Protocol):
    """A prediction of every maneuver, as `validate` returns it."""

    @property
    def simulation(self) -> pd.DataFrame:
        """Measured and simulated channels."""


class Identified(Protocol):
    """What an identification returns."""

    @property
    def model(self) -> IdentifiedModel:
        """The model."""


Model = TypeVar("Model", bound=Identified)
Prediction = TypeVar("Prediction", bound=Predicted)


@dataclass(frozen=True)
class Made(Generic[Model, Prediction]):
    """An attempt: what was carried, what came of it (None: it failed), and how it compares."""

    carried: Carried
    found: tuple[Model, Prediction] | None
    tried: TriedModel


def make(
    carried: Carried,
    model: IdentifiedModel,
    before: pd.DataFrame,
    again: Callable[[Carried], tuple[Model, Prediction]],
) -> Made[Model, Prediction]:
    """Identify with effects, predict, and compare with the model before and its prediction.

    Numbers that fail are an attempt that failed: others, and the model before, remain.
    """
    try:
        found = again(carried)
    except NumericsError as error:
        failed = f"{error.problem} ({error.where})" if error.where else error.problem
        return Made(carried, None, replace(_of(carried, before), failed=failed))
    summaries = model.left_out, found[0].model.left_out
    return Made(carried, found, tried_with(carried, before, found[1].simulation, summaries))


def choose(
    carried: Carried | None,
    model: IdentifiedModel,
    before: Predicted,
    again: Callable[[Carried], tuple[Model, Prediction]],
    small: Carried | None = None,
) -> tuple[Made[Model, Prediction] | None, tuple[Attempt, ...]]:
    """Identify with what was found; None where the model before predicts better.

    Parameters
    ----------
    carried : Carried or None
        What was found.
    model : IdentifiedModel
        The one before.
    before : Predicted
        Its prediction.
    again : callable
        Identifies and predicts; called for one attempt after the other until one is good.
    small : Carried or None
        What is tried without a claim where nothing that was found is taken.

    Returns
    -------
    Made or None
    tuple of Attempt
        What was tried, the model before first, and which of them was taken; empty where there was
        nothing to try.
    """
    made = [] if carried is None else _with_effects(carried, model, before, again)
    best = best_of([one.tried for one in made])
    if best is None and small is not None:
        for own_starts in (False, True):
            attempt = replace(small, own_starts=own_starts)
            made.append(make(attempt, model, before.simulation, again))
            if made[-1].tried.is_good:
                break
        best = best_of([one.tried for one in made])
    rows = [Attempt(effects=(), taken=best is None)] if made else []
    rows += [_attempt(one.tried, k == best) for k, one in enumerate(made)]
    return (None if best is None else made[best]), tuple(rows)


def _with_effects(
    carried: Carried,
    model: IdentifiedModel,
    before: Predicted,
    again: Callable[[Carried], tuple[Model, Prediction]],
) -> list[Made[Model, Prediction]]:
    """Attempts with everything that was found, and with less of it where that is not better."""
    made = _with_all(carried, model, before, again)
    best = best_of([one.tried for one in made])
    if best is not None and not made[best].tried.costs_much:
        return made
    for less in fewer(carried, model, cruise_of(before.simulation)[0]):
        made.append(make(less, model, before.simulation, again))
        if made[-1].tried.is_better and not made[-1].tried.costs_much:
            break
    return made


def _with_all(
    carried: Carried,
    model: IdentifiedModel,
    before: Predicted,
    again: Callable[[Carried], tuple[Model, Prediction]],
) -> list[Made[Model, Prediction]]:
    """Attempts with everything that was found, until one is good."""
    made: list[Made[Model, Prediction]] = []
    for attempt in attempts(carried, model):
        made.append(make(attempt, model, before.simulation, again))
        if made[-1].tried.is_good:
            return made
    last = keeping([(one.carried, one.tried) for one in made], before.simulation)
    if last is not None:
        made.append(make(last, model, before.simulation, again))
    return made


def keeping(made: Sequence[tuple[Carried, TriedModel]], before: pd.DataFrame) -> Carried | None:
    """The best of some attempts, for the sake of channels that rise with it; None: none does.

    An effect that explains nearly all of some channels lets a fit trust these so much that it
    gives away another one (a current of 26 times the noise of the DVL: r rose by 23 %). The
    channels that do not rise then count as if they were still as far off as before.
    """
    able = [(c, t) for c, t in made if not t.is_lost and t.effects]
    carried, tried = min(able, key=lambda one: one[1].balance, default=(None, None))
    if carried is None or tried is None or not tried.rising:
        return None
    rows = _identifying(carried, before, before)
    names = {name: column for column, name, _ in channels_of(before) if name in GUARDED}
    noise = {column: rms_of(rows, column) for c, column in names.items() if c not in tried.rising}
    noise = {column: rms for column, rms in noise.items() if math.isfinite(rms)}
    return replace(carried, least_noise=noise) if noise else None


def best_of(tried: Sequence[TriedModel]) -> int | None:
    """The first with which no error rises, else the best; None where that is the model before.

    A model that only leaves a one-off event out claims nothing and is always taken.
    """
    able = [
        k
        for k, one in enumerate(tried)
        if one.is_better or (one.masks and not one.effects and not one.failed)
    ]
    return min(able, key=lambda k: (not tried[k].is_good, tried[k].balance), default=None)


def _attempt(tried: TriedModel, taken: bool) -> Attempt:
    finite = {c: ratio for c, ratio in tried.ratios.items() if math.isfinite(ratio)}
    return Attempt(
        effects=tried.effects,
        ratios=finite,
        ran_away=tried.is_lost and not tried.failed,
        taken=taken,
        keeps=tried.keeps,
        own_starts=tried.own_starts,
        failed=tried.failed,
        unclaimed=not (tried.effects or tried.masks),
        **as_told(tried.left_out),
    )


def findings_of(attempts: Sequence[Attempt]) -> tuple[Finding, ...]:
    """What is to be said of an error that rose although an effect was added, and of failures."""
    failed = tuple(_failed(a) for a in attempts if a.failed)
    failed += tuple(_identified_again(a) for a in attempts if a.taken and a.unclaimed)
    taken = next((a for a in attempts if a.taken and a.effects), None)
    rises = [(ratio - 1.0, c) for c, ratio in _decisive(taken).items()] if taken else []
    share, channel = max(rises, default=(0.0, ""))
    best = min(rises, default=(0.0, ""))[1]
    if taken is None or share <= RISE or math.log1p(share) <= taken.left_out_se.get(channel, 0.0):
        return failed
    which = ", each left out in turn," if taken.left_out else ""
    return (
        *failed,
        Finding(
            code="error-rises",
            where=channel,
            value=share,
            threshold=RISE,
            message=f"adding the effects increases the error of {channel} in the maneuvers "
            f"used for identification{which} by {100 * share:.0f} %",
            remedy=f"Improving {best} made {channel} worse: compare the errors before and after.",
        ),
    )


def _decisive(attempt: Attempt) -> dict[str, float]:
    """The ratios by which an attempt was judged."""
    return attempt.left_out or attempt.ratios


def _identified_again(attempt: Attempt) -> Finding:
    told = f"errors in the maneuvers used for identification {changes(attempt.ratios)}"
    if attempt.left_out:
        told += f"; each left out in turn {changes(attempt.left_out)}"
    return Finding(
        code="identified-again",
        where="model",
        message="the identified model missed what small effects that every vehicle may have "
        "(delays, lags, offsets) let it follow, and was identified again with them, without a "
        f"claim: {told}",
        remedy="Which of them it is these maneuvers do not tell: `auvident plan-trial RUN` ranks "
        "those that would.",
    )


def _failed(attempt: Attempt) -> Finding:
    return Finding(
        code="attempt-failed",
        where=" + ".join(attempt.effects) or "small effects alone",
        message=f"a model with these effects could not be identified: {attempt.failed}",
        remedy="The other models that were tried are compared without it.",
    )
