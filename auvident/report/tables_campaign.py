"""Tables of trials pooled, of what changed, and of a campaign; for the terminal and the page."""

from collections.abc import Sequence

from auvident.report.tables import Column, Fixed, Number, Rows, Table, Unit, WithStd, columns
from auvident.schema.campaign import CampaignResult, CampaignTrial, CampaignVehicleResult
from auvident.schema.changes import Changes, LeftOutTrialError, VehicleChange
from auvident.schema.planes import TRACK
from auvident.schema.pooled import DISAGREE, PooledModel, PooledParameter, PooledTrial
from auvident.schema.quoting import first_words
from auvident.schema.spin import share

NO_CHANGE = "No change of the vehicle stands out from chance"
SAYS_NOTHING = 0.5  # degrees of freedom: one trial agrees with itself
REPEATS = "Trials to look at, or to repeat"
LONGEST = 120  # characters of a reason in a table; ``campaign.json`` and the page have more


def pooled_parameters(model: PooledModel) -> Table:
    """What the trials say together: value, shares of the data before and after, scatter."""
    heads = (
        *columns(("coefficient", "unit")),
        *columns(numbers=("value ± std", "prior ± std", "from data, one trial", "best", "all")),
        *columns(numbers=("between trials", "p that they agree")),
    )
    rows: Rows = [
        [
            p.symbol,
            Unit(p.unit),
            WithStd(p.value, p.std),
            WithStd(p.prior, p.prior_std) if "." not in p.symbol else "",
            Fixed(100.0 * p.share_alone, ".0f", " %"),
            Fixed(100.0 * p.share_best, ".0f", " %"),
            Fixed(100.0 * p.share, ".0f", " %"),
            Number(p.between_std, 2) if p.between_std > 0.0 else "",
            Number(p.p, 2) if p.freedom > SAYS_NOTHING else "",
        ]
        for p in model.pooling.parameters
    ]
    return Table(heads, rows, title_of(model))


def title_of(model: PooledModel) -> str:
    """What was pooled, and whether it agrees."""
    used = sum(t.used for t in model.pooling.trials)
    word = "trial" if used == 1 else "trials"
    agree = "disagree" if disagree(model) else "agree"
    text = f"{model.vehicle}, {model.plane} plane: {used} {word} pooled"
    return text if used == 1 else f"{text}, which {agree} (p = {model.pooling.p:.2g})"


def disagree(model: PooledModel) -> bool:
    """Whether the trials differ by more than their errors."""
    return model.pooling.p < DISAGREE


def summary(model: PooledModel) -> str:
    """What one trial and all see, and in what they contradict each other."""
    if not disagree(model):
        return seen(model)
    most = min(model.pooling.parameters, key=lambda p: p.p).symbol
    return f"{seen(model)} The trials disagree (p = {model.pooling.p:.2g}), most in {most}."


def told_of(vehicle: CampaignVehicleResult) -> str:
    """How many trials of a vehicle were pooled, and what they say or why there are not more."""
    trials = "trial" if vehicle.trials == 1 else "trials"
    count = f"{vehicle.pooled} of {vehicle.trials} {trials} pooled"
    if vehicle.problem:
        return f"{count}: {vehicle.problem}."
    return f"{count}. {vehicle.summary}".rstrip()


def seen(model: PooledModel) -> str:
    """What one trial leaves to the prior, and all together."""
    own = [p for p in model.pooling.parameters if "." not in p.symbol]
    if sum(t.used for t in model.pooling.trials) == 1:
        return f"{_mostly(own, 'share')} of {len(own)} coefficients come mostly from its data."
    return (
        f"{_mostly(own, 'share_alone')} of {len(own)} coefficients come mostly from the data of a "
        f"single trial in the mean, {_mostly(own, 'share')} from those of all together."
    )


def _mostly(rows: Sequence[PooledParameter], key: str) -> int:
    return sum(getattr(p, key) > 0.5 for p in rows)


def pooled_trials(trials: Sequence[PooledTrial]) -> Table:
    """Every trial with its distance from the others."""
    heads = (
        *columns(("trial", "began")),
        *columns(numbers=("maneuvers", "distance", "p")),
        Column("went in"),
    )
    rows: Rows = [
        [
            t.trial,
            t.date.replace("T", " ")[:16],
            str(t.maneuvers) if t.maneuvers else "",
            Number((t.square / t.directions) ** 0.5 if t.directions else None, 2),
            Number(t.p, 2) if t.directions else "",
            "yes" if t.used else f"no: {t.reason}",
        ]
        for t in trials
    ]
    return Table(heads, rows, "Trials, with their distance from the others (1 by chance)")


def left_out(found: Sequence[LeftOutTrialError]) -> Table:
    """What the pooled model makes of trials that did not go into it."""
    heads = (
        *columns(("trial", "channel", "unit")),
        *columns(numbers=("pooled", "own model", "p that it is not worse")),
    )
    rows: Rows = [
        [e.trial, e.channel, Unit(e.unit), Number(e.pooled, 3), Number(e.own, 3), Number(e.p, 2)]
        for e in found
    ]
    return Table(heads, rows, "RMSE on held-out maneuvers of trials that were left out")


def changes(found: Changes) -> Table:
    """Steps and drifts."""
    heads = (
        Column("change"),
        *columns(numbers=("size", "95 %", "p")),
        Column("first trial"),
        Column("or"),
    )
    rows: Rows = [
        [
            c.sentence,
            _size(c.size, c),
            f"{_size(c.low, c)} to {_size(c.high, c)}",
            Number(c.p, 2),
            c.trial if c.earliest == c.latest else f"{c.trial} ({c.earliest} to {c.latest})",
            ", ".join(c.rivals[:4]),
        ]
        for c in found.changes
    ]
    return Table(heads, rows, "Changes of the vehicle")


def _size(value: float, change: VehicleChange) -> str:
    if change.share:
        return f"{100.0 * value:+.0f} %"
    return f"{value:+.2g}" if change.unit == "-" else f"{value:+.2g} {change.unit}"


def no_change(found: Changes) -> str:
    """That nothing changed, and how sure that is; nothing where too few trials were looked at."""
    if found.changes or not found.tests:
        return ""
    return (
        f"{NO_CHANGE} ({found.tests} tests over {len(found.trials)} trials; a false alarm in "
        f"{100.0 * found.false_alarms:g} % of such campaigns)."
    )


def campaign_trials(result: CampaignResult) -> Table:
    """Every trial: what came of it, its errors, whether it fits the others."""
    channels = channels_of(result.trials)
    dated = any(t.date for t in result.trials)
    heads = (
        *columns(("vehicle", "trial", "state", *("began",) * dated)),
        Column("result"),
        *columns(numbers=tuple(f"NRMSE {c}" for c in channels)),
        *columns(numbers=("from data", "distance (1 by chance)")),
        Column("pooled"),
    )
    rows: Rows = [
        [
            t.vehicle,
            t.trial,
            t.state,
            *(t.date.replace("T", " ")[:16],) * dated,
            outcome(t),
            *(Number(error, 2) for error in errors_in(t, channels)),
            f"{t.from_data} of {t.coefficients}" if t.coefficients else "",
            Number(t.fits, 2),
            pooled_word(t),
        ]
        for t in result.trials
    ]
    return Table(heads, rows, "Trials of the campaign")


def channels_of(trials: Sequence[CampaignTrial]) -> list[str]:
    """Channels whose NRMSE are shown: velocities and angle of the planes of each trial."""
    return list(dict.fromkeys(c for t in trials for c in _shares(t) if c != TRACK))


def errors_in(t: CampaignTrial, channels: Sequence[str]) -> list[float | None]:
    """The NRMSE of a trial in some channels, None where it has none to show."""
    own = _shares(t)
    return [own.get(c) for c in channels]


def pooled_word(t: CampaignTrial) -> str:
    """Whether a trial went into the pooled model; empty where it came to none."""
    if t.state in ("failed", "planned"):
        return ""
    return "yes" if t.pooled else "no"


def _shares(t: CampaignTrial) -> dict[str, float]:
    """The NRMSE of a trial by channel; not that of a heading that turned round and round."""
    found = {c: share(c, t.rmse.get(c), value) for c, value in t.nrmse.items()}
    return {c: value for c, value in found.items() if value is not None}


def outcome(t: CampaignTrial) -> str:
    """Verdict of a trial with its effects, or why there is none."""
    if t.problem and t.state == "failed":
        return first_words(t.problem, LONGEST)
    words = t.verdict.replace("_", " ")
    return f"{words}: {', '.join(t.effects)}" if t.effects else words


def repeats(result: CampaignResult, longest: int = LONGEST) -> Table:
    """Which trials to look at or to repeat, and why: not each of them has to go to sea again."""
    heads = (*columns(("vehicle", "trial")), Column("why"))
    rows: Rows = [
        [v.title, str(row["trial"]), first_words(str(row["why"]), longest)]
        for v in result.vehicles
        for row in v.repeat
    ]
    return Table(heads, rows, REPEATS)
