"""What changed of the vehicle: steps and drifts of coefficients and of groups of them, in words."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.constants import NORMAL_95
from auvident.estimation.change import ChangeSearch, FoundChange, course, search, series_along
from auvident.physics.terms import LINEAR_DRAG
from auvident.schema.artifacts import Finding
from auvident.schema.changes import Changes, SeriesPoint, VehicleChange
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.effects import parameter_of
from auvident.schema.planes import BY_PLANE
from auvident.stages.pool.carry import map_of
from auvident.stages.pool.collect import Collected
from auvident.stages.pool.stage import FITS_NO_OTHER, PoolResult

Array = npt.NDArray[Any]

FALSE_ALARMS = 0.01
LEAST_TRIALS = 5  # of fewer, a step may be as well what they scatter by
CERTAIN = 2.0  # standard deviations of a value from zero, from which on its changes are shares
DAY_S = 86_400.0
# Of a force, by judgment: of drag or thrust it is 1.5 % of the speed. A season of 66 trials tells a
# rudder that gives 0.7 % less, which nobody acts upon.
LEAST_SHARE = 0.03
SHOWN = 5  # trials in a message


@dataclass(frozen=True)
class ShareOf:
    """What may change at once by one share: words for people, with {fin} for that of the plane.

    ``says`` is what is told of a share: "{more}" becomes "more" or "less", "{larger}" "larger" or
    "smaller".
    """

    id: str
    symbols: tuple[str, ...]
    says: str


def quantities(data: Collected) -> tuple[ShareOf, ...]:
    """Groups of coefficients that a damage or a replacement changes by one share."""
    plane = data.trials[0].model.plane
    by_group: dict[str, list[str]] = {}
    for name in data.names:
        if name in ESTIMATED:
            by_group.setdefault(ESTIMATED[name].group, []).append(name)
    drag = [*by_group.get("drag", ()), *(n for n in data.names if n == LINEAR_DRAG)]
    rows = (
        ("fin", by_group.get("control", []), f"the {BY_PLANE[plane].fin} gives {{share}} {{more}}"),
        ("drag", drag, "the drag is {share} {larger}"),
        ("thrust", by_group.get("thrust", []), "the propeller gives {share} {more} thrust"),
        ("lift", by_group.get("lift", []), "the lift of the hull is {share} {larger}"),
        ("cross-flow", by_group.get("cross_flow", []), "the cross-flow drag is {share} {larger}"),
    )
    return tuple(ShareOf(id_, tuple(names), says) for id_, names, says in rows if names)


def changes_of(
    result: PoolResult,
    rng: np.random.Generator,
    false_alarms: float = FALSE_ALARMS,
) -> Changes:
    """Steps and drifts over the trials that fit each other.

    Parameters
    ----------
    result : PoolResult
    rng : Generator
        For the series that are drawn where nothing changes.
    false_alarms : float
        Probability of one change or more where there is none.
    """
    data, model = result.data, result.model
    names, dates = [t.name for t in data.trials], [t.date for t in data.trials]
    dated = all(dates)
    strange = tuple(f for f in model.findings if f.code == FITS_NO_OTHER)
    nothing = Changes(
        vehicle=model.vehicle,
        plane=model.plane,
        trials=tuple(names),
        dates=tuple(dates),
        dated=dated,
        false_alarms=false_alarms,
        left_out_last=_left_out_last(result),
        findings=strange,
    )
    if len(names) < LEAST_TRIALS:
        few = Finding(
            code="few-trials",
            value=float(len(names)),
            threshold=float(LEAST_TRIALS),
            message=f"nothing is said of changes with fewer than {LEAST_TRIALS} trials that agree",
        )
        return nothing.model_copy(update={"findings": (*strange, few)})
    groups = quantities(data)
    theta = result.values
    directions = np.vstack([np.eye(len(data.names)), *(_along(g, data, theta) for g in groups)])
    times = _times(dates, dated)
    found, trials = search(data.told, directions, times, rng, false_alarms)
    before = data.origin + data.unit * found.theta + _drag_anew(result)
    teller = _Teller(data, groups, theta, before, dated, _levels(result))
    told = {f: teller.change(f) for f in found.found}
    worth = [f for f in told if abs(told[f].size if told[f].share else f.size) >= teller.least(f)]
    small = [told[f] for f in told if f not in worth]
    return nothing.model_copy(
        update={
            "findings": (*strange, *_as_given(result), *_too_small(small)),
            "threshold": found.threshold,
            "tests": found.tests,
            "changes": tuple(told[f] for f in worth),
            "series": teller.series(trials, directions, found, times),
        }
    )


def _left_out_last(result: PoolResult) -> str:
    """Why the last trial fits no other, if that is so: the vehicle may have changed before it."""
    strange = {f.where: f.message for f in result.model.findings if f.code == FITS_NO_OTHER}
    last = result.model.pooling.trials[-1].trial
    return f"{last}: {strange[last]}" if last in strange else ""


def _too_small(changes: Sequence[VehicleChange]) -> Iterator[Finding]:
    """What changed by more than chance makes of it, and by less than matters."""
    if changes:
        yield Finding(
            code="small-changes",
            value=float(len(changes)),
            where=", ".join(c.what for c in changes),
            message="more than chance makes of it, and too small to matter: "
            + "; ".join(c.sentence for c in changes),
        )


def _as_given(result: PoolResult) -> Iterator[Finding]:
    """That the order is that in which trials were given, where some of them could say otherwise."""
    trials = result.model.pooling.trials
    undated = [t.trial for t in trials if not t.date]
    if 0 < len(undated) < len(trials):
        yield Finding(
            code="order-as-given",
            where=", ".join(undated[:SHOWN]) + (", ..." if len(undated) > SHOWN else ""),
            message="the log has no dates, so that changes are looked for in the order in which "
            "the trials were given, and not in that of the dates of the others",
            remedy="Give the trials in the order in which they were at sea.",
        )


def _along(group: ShareOf, data: Collected, theta: Array) -> Array:
    """Direction of a group: all its coefficients by one share of their values."""
    direction = np.zeros((1, len(data.names)))
    for name in group.symbols:
        i = data.names.index(name)
        direction[0, i] = theta[i] / data.unit[i]
    return direction


def _times(dates: Sequence[str], dated: bool) -> Array:
    """Days since the first trial, or its number."""
    if not dated:
        return np.arange(len(dates), dtype=float)
    stamps = [datetime.fromisoformat(d).timestamp() / DAY_S for d in dates]
    days = np.array(stamps) - stamps[0]
    return days if days[-1] > days[0] else np.arange(len(dates), dtype=float)


class _Measure(NamedTuple):
    """From sizes along a direction to what is told: ``share`` if they become shares of a value.

    The unit does not say it: that of a share is "-", and so is that of a scale error.
    """

    factor: float
    unit: str
    share: bool


def _drag_anew(result: PoolResult) -> Array:
    """By how much (n,) the drag is another one where the maneuvers are predicted again.

    How much a drag changes at a given thrust every trial tells. What it is a share of, no trial
    tells apart from how the thrust falls with the speed, and the parabolas of their models err in
    it alike. Of a share of the thrust itself that goes into the change as well, and cancels.
    """
    names = result.data.names
    drag = [n == LINEAR_DRAG or (n in ESTIMATED and ESTIMATED[n].group == "drag") for n in names]
    return np.asarray(np.where(drag, result.again - result.values, 0.0))


def _levels(result: PoolResult) -> tuple[Array, Array]:
    """Accelerations by coefficients (q, n), and the covariance (q, q) of their errors.

    They are known as one trial knows them: what its equations lack, they lack in all trials. The
    drag of a season of 66 trials was 15 % off, by 2 % as they knew it together.
    """
    data = result.data
    theta = (result.values - data.origin) / data.unit
    slopes = map_of(data).slopes(theta)
    told = np.mean([t.information for t in data.told], axis=0)
    covariance = np.linalg.inv(np.eye(len(told)) + told)
    return slopes, slopes @ covariance @ slopes.T


@dataclass(frozen=True)
class _Teller:
    """Numbers of a change to words; ``levels`` as from `_levels`."""

    data: Collected
    groups: tuple[ShareOf, ...]
    theta: Array
    before: Array
    dated: bool
    levels: tuple[Array, Array]

    def change(self, found: FoundChange) -> VehicleChange:
        """A change as it stands in the artifact."""
        measure = self._measure(found.direction)
        size, std = found.size * measure.factor, found.std * abs(measure.factor)
        if measure.share:
            size, std = self._of_before(found, size, std)
        low, high = sorted((size - NORMAL_95 * std, size + NORMAL_95 * std))
        trials = self.data.trials
        return VehicleChange(
            kind=found.kind,
            what=self.name(found.direction),
            symbols=self._symbols(found.direction),
            sentence=self._sentence(found, size, (low, high), measure),
            trial=trials[found.first].name,
            date=trials[found.first].date,
            earliest=trials[found.between[0]].name,
            latest=trials[found.between[1]].name,
            size=size,
            std=std,
            low=low,
            high=high,
            unit=measure.unit,
            share=measure.share,
            score=found.z,
            p=found.p,
            rivals=tuple(self.name(r) for r in found.rivals),
        )

    def least(self, found: FoundChange) -> float:
        """Size from which on a change is worth a word: a share, or one of the search.

        Of an effect it is the practical size; of a coefficient that is hardly known, none, nor in
        models that do not say how fast they were flown.
        """
        name = self.name(found.direction)
        if self._measure(found.direction).share:
            return LEAST_SHARE
        if "." not in name or found.direction >= len(self.data.names):
            return 0.0
        declared, model = parameter_of(name), self.data.trials[0].model
        if not declared.nuisance_std:  # as an effect its unit is its prior
            return declared.practical / declared.prior if declared.prior else 0.0
        speed = float(np.sqrt(model.flown.get("u", 0.0) * model.flown.get("u_low", 0.0)))
        if not speed > 0.0:
            return 0.0
        unit = declared.size_unit(model.density_kgpm3, model.length_m, speed, 1.0)
        return declared.practical * unit / float(self.data.unit[found.direction])

    def _of_before(self, found: FoundChange, size: float, std: float) -> tuple[float, float]:
        """A share of the pooled value as one of the value before the change.

        Where a change is fitted along, the coefficients are those before a step, and those in the
        middle of a drift.
        """
        at = [self.data.names.index(s) for s in self._symbols(found.direction)]
        own, before = (values[at] / self.data.unit[at] for values in (self.theta, self.before))
        ratio = float(before @ own) / float(own @ own)
        start = 1.0 if found.kind == "step" else 1.0 - 0.5 * size / ratio
        share, std = size / ratio / start, std / abs(ratio) / start**2
        return share, float(np.hypot(std, share * self._level_std(at, own)))

    def _level_std(self, at: Sequence[int], own: Array) -> float:
        """Relative error of what a share is one of, in accelerations.

        These are what trials see: of a coefficient its scale, which none of them sees, would count.
        """
        slopes, covariance = self.levels
        level = slopes[:, at] @ own
        return float(np.sqrt(max(level @ covariance @ level, 0.0)) / (level @ level))

    def name(self, direction: int) -> str:
        """Of a coefficient or a group."""
        n = len(self.data.names)
        return self.data.names[direction] if direction < n else self.groups[direction - n].id

    def _symbols(self, direction: int) -> tuple[str, ...]:
        n = len(self.data.names)
        one = direction < n
        return (self.data.names[direction],) if one else self.groups[direction - n].symbols

    def _measure(self, direction: int) -> _Measure:
        """How sizes along a direction are told."""
        n = len(self.data.names)
        if direction >= n:
            return _Measure(1.0, "-", share=True)
        name, unit = self.data.names[direction], float(self.data.unit[direction])
        value = float(self.theta[direction])
        if "." in name:
            declared = parameter_of(name)
            if declared.form == "plain":
                return _Measure(unit * declared.factor, declared.unit, share=False)
            if declared.is_nothing(value):
                return _Measure(unit, "internal", share=False)
            # a limit is stored as its inverse, which falls as it rises
            return _Measure(-declared.shown(value, unit)[1], declared.unit, share=False)
        std = float(np.sqrt(np.linalg.inv(self._information())[direction, direction])) * unit
        if abs(value) > CERTAIN * std:
            return _Measure(unit / value, "-", share=True)
        return _Measure(unit, ESTIMATED[name].unit, share=False)

    def _information(self) -> Array:
        total: Array = np.eye(len(self.data.names)) + sum(t.information for t in self.data.told)
        return total

    def _sentence(
        self, found: FoundChange, size: float, interval: tuple[float, float], measure: _Measure
    ) -> str:
        """As one would say it."""
        trials, n = self.data.trials, len(self.data.names)
        if measure.share:
            share = f"{abs(100.0 * size):.0f} %"
            of = f"({of_shares(*interval)})"
        else:
            unit = "" if measure.unit == "-" else f" {measure.unit}"
            share = f"{abs(size):.2g}{unit}"
            of = f"({interval[0]:+.2g} to {interval[1]:+.2g}{unit})"
        if found.direction >= n:
            says = self.groups[found.direction - n].says
        else:
            says = f"{self.data.names[found.direction]} is {{share}} {{larger}}"
        more, larger = ("more", "larger") if size > 0.0 else ("less", "smaller")
        if found.kind == "drift":
            first, last = self._when(0), self._when(len(trials) - 1)
            text = says.format(share=share, more=more, larger=larger)
            return f"from {first} to {last} it changed steadily: at the end {text} {of}"
        text = says.format(share=share, more=more, larger=larger)
        return f"since {self._when(found.first)} {text} {of}"

    def _when(self, k: int) -> str:
        """The day of a trial, with its time where there are others on that day; else its name."""
        trial = self.data.trials[k]
        if not self.dated:
            return trial.name
        days = [datetime.fromisoformat(t.date) for t in self.data.trials]
        alone = sum(day.date() == days[k].date() for day in days) == 1
        text = f"{days[k].day} {days[k]:%B %Y}"
        return text if alone else f"{text} {days[k]:%H:%M}"

    def series(
        self, trials: Sequence[Any], directions: Array, found: ChangeSearch, times: Array
    ) -> dict[str, tuple[SeriesPoint, ...]]:
        """Every quantity over the trials, as a difference from its common value.

        The others are at theirs, with what changed of them.
        """
        rows = {}
        for d in range(len(directions)):
            factor = self._measure(d).factor
            others = [f for f in found.found if f.direction != d]
            points = []
            for k, (t, own) in enumerate(zip(self.data.trials, trials, strict=True)):
                moved = sum(
                    (f.size * course(f, k, times) * directions[f.direction] for f in others),
                    found.theta,
                )
                ((size, std),) = series_along([own], directions[d], moved)
                seen = abs(std * factor) if np.isfinite(std) else None
                points.append(SeriesPoint(trial=t.name, date=t.date, value=size * factor, std=seen))
            rows[self.name(d)] = tuple(points)
        return rows


def of_shares(low: float, high: float) -> str:
    """An interval of shares in per cent: their sizes, unless it reaches to both sides of zero."""
    if low < 0.0 < high:
        return f"{100.0 * low:+.0f} to {100.0 * high:+.0f} %"
    least, most = sorted(abs(100.0 * x) for x in (low, high))
    return f"{least:.0f} to {most:.0f} %"
