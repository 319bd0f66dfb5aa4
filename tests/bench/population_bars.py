"""The figures that the study on drawn vehicles is held to, as well as so many trials know them."""

import math
from collections.abc import Iterable, Sequence
from statistics import mean, stdev
from typing import Any

from scipy.stats import binomtest

from auvident.constants import NORMAL_95
from tests.bench.effects_bars import rises_surely
from tests.bench.population_score import Drawn, Scores, Table, channels_of, is_wrong_name

PARTLY = "partly_explained"
SAYS_SOMETHING = ("effect_found", "ambiguous", PARTLY)
DRIFT = "current_drift"
COVERS = (0.90, 0.98)  # a nominal 95 %, on plants of another structure


def bars(scores: Scores) -> Table:
    """Every figure with its bar.

    `visible` are planted effects that change the measured velocities by their noise and are above
    the size that the program itself says it would see; `shown` only the former.
    """
    told = [s for s in scores if s.clean != "failed"]
    none, single, pair, outside = ([s for s in told if s.kind == k] for k in KINDS)
    shown = [s for s in single if s.shows]
    seen = [s for s in shown if s.loop.visible]
    pairs = [s for s in pair if s.shows and s.loop.visible]
    drifts = [s for s in shown if s.loop.label == DRIFT and s.loop.asked]
    sizes = [z.inside for s in single + pair for z in s.loop.sizes if z.inside is not None]
    names = [bool(inside) for s in told for inside in s.zero_inside]
    return [
        _most("nothing planted: a name the vehicle has not", 0.03, [bool(s.false) for s in none]),
        _most("nothing planted: unexplained", 0.15, [s.clean == "unexplained" for s in none]),
        _least("visible: declared", 0.95, [_said(s) for s in seen]),
        _least("visible: named or in its group", 0.88, [_right(s) for s in seen]),
        _most("planted: a wrong name", 0.03, [is_wrong_name(s) for s in single + pair]),
        _least("visible pairs: both named", 0.80, [_right(s) for s in pairs]),
        _least(
            "drift of the current, heading logged: named or partly",
            0.90,
            [_right(s) or s.loop.verdict == PARTLY for s in drifts],
        ),
        _most("outside of the library: confident name", 0.10, [_confident(s) for s in outside]),
        _within("size within its 95 % interval", COVERS, sizes),
        _most("named, and zero in its interval", 0.0, names),
        *(_covered(c, [s.coverage[c] for s in told if c in s.coverage]) for c in channels_of(told)),
        _most("a velocity surely worse after", 0.01, [rises_surely(s.loop) for s in told]),
        _most("refined model worse on what was left out", 0.0, _told(s.ships_worse for s in told)),
        _most("... by more than a standard error", 0.0, _told(s.surely_worse for s in told)),
        _most("models that break what physics knows", 0.0, [b for s in told for b in s.broken]),
        _most("nothing planted: ... or has too small to see", None, [_faint(s) for s in none]),
        _least("shown: declared", None, [_said(s) for s in shown]),
        _least("shown: named or in its group", None, [_right(s) for s in shown]),
        _most("the chain did not end", None, [s.clean == "failed" for s in scores]),
    ]


KINDS = ("none", "single", "pair", "outside")


def _said(s: Drawn) -> bool:
    return s.loop.verdict in SAYS_SOMETHING or s.loop.by_finding


def _right(s: Drawn) -> bool:
    return s.loop.right_or_group or s.loop.by_finding


def _faint(s: Drawn) -> bool:
    return bool(s.false or s.faint)


def _confident(s: Drawn) -> bool:
    return s.loop.confident and bool(s.false)


def _told(flags: Iterable[bool | None]) -> list[bool]:
    return [flag for flag in flags if flag is not None]


def _least(what: str, bar: float | None, flags: Sequence[bool]) -> dict[str, Any]:
    return _row(what, flags, (bar, None))


def _most(what: str, bar: float | None, flags: Sequence[bool]) -> dict[str, Any]:
    return _row(what, flags, (None, bar))


def _within(what: str, bar: tuple[float, float], flags: Sequence[bool]) -> dict[str, Any]:
    return _row(what, flags, bar)


def _covered(channel: str, shares: Sequence[float]) -> dict[str, Any]:
    """Mean share of the held-out samples of a channel within its band, with its 95 % interval."""
    low, high = COVERS
    row = {"what": f"band of {channel}: held-out samples inside", "n": len(shares)}
    row |= {"found": "-", "95 %": "-", "bar": f">= {low:.0%} and <= {high:.0%}", "met": ""}
    if len(shares) < 2:
        return row
    share, error = mean(shares), stdev(shares) / math.sqrt(len(shares))
    ends = (max(share - NORMAL_95 * error, 0.0), min(share + NORMAL_95 * error, 1.0))
    row |= {"found": f"{share:.1%}", "95 %": f"{ends[0]:.1%} to {ends[1]:.1%}"}
    return row | {"met": "yes" if low <= share <= high else "NO"}


def _row(
    what: str, flags: Sequence[bool], bar: tuple[float | None, float | None]
) -> dict[str, Any]:
    """A share with the 95 % interval (Wilson) that so many trials allow."""
    row: dict[str, Any] = {"what": what, "n": len(flags), "found": "-", "95 %": "-"}
    low, high = bar
    if flags:
        test = binomtest(sum(flags), len(flags))
        between = test.proportion_ci(method="wilson")
        row |= {
            "found": f"{test.statistic:.1%}",
            "95 %": f"{between.low:.1%} to {between.high:.1%}",
        }
    least = [] if low is None else [f">= {low:.0%}"]
    most = [] if high is None else [f"<= {high:.0%}"]
    row["bar"] = " and ".join(least + most)
    if not flags or not row["bar"]:
        return row | {"met": ""}
    share = sum(flags) / len(flags)
    good = (low is None or share >= low) and (high is None or share <= high)
    return row | {"met": "yes" if good else "NO"}
