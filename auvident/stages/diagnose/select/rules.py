"""By what rules a search goes: each alone, in tables, on the plain numbers of `records`.

Likelihood alone accepts nothing: any model is wrong in small ways that a long record shows. A
candidate is refused by the first rule that it fails; what refused it stands in the artifact with
its evidence and its threshold.
"""

import math

from auvident.stages.diagnose.select.records import (
    Accepted,
    Account,
    Afresh,
    Apart,
    Begun,
    Beside,
    Containing,
    Exchanged,
    Hiding,
    Nuisance,
    Reconciled,
    Replacing,
    Rival,
    Screened,
    Start,
)
from auvident.stages.diagnose.select.rule import Refusal, Rule, passes

# --- which candidates are refitted, how far and from where --------------------------------------

WORTH = 8.0  # [nats] to first order, to be refitted
SCREENED, SCREENED_FAST = 7, 4  # so many of each list
ACCOMPANIED = 2  # what looks like so many of the best is refitted with them
REFITTED = 4  # to the end
HOPELESS = 0.3  # a candidate with less than this share of the best one's promise is not finished
# A candidate must gain this share of what it would as the by-product of another: its square of the
# cosine. What acts on surge alone is none of what is wrong with the rudder.
OF_BEST = 0.5
# What is promised to first order is no upper bound: so many times as much may come of it. Of 226
# candidates of 44 development trials that promised less than a third of `LEAST_GAIN` four came to
# more than that, 23 to 56 nats, each with a sixth of a practical size or less.
MARGIN = 3.0
# Squared error, over that of the model without the effect, from which on a start leads
# nowhere: a limit that was there (seed 8) gained 740 nats from where its first step promised 1.5;
# of 70 starts that promised 6 to 32 none came back.
LOST = 1.0 + MARGIN
WORTH_A_START = 30.0  # [nats] to be fitted from a second start as well
SECOND_STARTS = 2  # so many of the best are fitted from the analytical estimate as well
# [nats] by which a model has to be the better one, for others to be fitted again: where it was not
# stuck it came out better by 0 to 10 (seed 1601), where it was by 615
STUCK = 20.0

# [nats] of less nothing more is worked out: what a nat is worth hangs on the length of the record
# and on what the colour of the residual takes up
LEAST_GAIN = 20.0
LEAST_SIZE = 1.0  # [practical sizes] what is smaller does not matter
# ... but for water that moves, which is the trial's own and never quite still: what makes good half
# of the error of a velocity changes what is predicted. Currents of 2 to 4 % of the speed were left
# out of one model in six of a season (200 trials), whose held-out errors of v they made 1.5 to 7
# times as large. Of 78 clean trials of even seeds (6400 to 6558) no current that is not there makes
# good more than 6 % of an error.
WATER, LEAST_FALL = "current", 0.5


def _share(part: float, whole: float, of_nothing: float) -> float:
    return part / whole if whole > 0.0 else of_nothing


_WORTH_A_REFIT = Rule[Screened]("worth", "it promises likelihood", lambda s: s.gain, WORTH)
SCREEN: tuple[Rule[Screened], ...] = (
    _WORTH_A_REFIT,
    Rule("place", "it is among the best", lambda s: s.place, most=SCREENED - 1),
)
# ... of the list by residuals that an observer has left only what is fast
SCREEN_FAST: tuple[Rule[Screened], ...] = (
    _WORTH_A_REFIT,
    Rule("place", "it is among the best", lambda s: s.place, most=SCREENED_FAST - 1),
)
# ... or one that no other may explain
SCREEN_APART: tuple[Rule[Apart], ...] = (
    Rule("gain", "it gains enough", lambda a: a.gain, LEAST_GAIN),
    Rule("apart", "it is no by-product", lambda a: _share(a.gain, a.by_others, 1.0), OF_BEST),
)
ACCOMPANY: tuple[Rule[Screened], ...] = (
    Rule("place", "it leads the short list", lambda s: s.place, most=ACCOMPANIED - 1),
)
LEAD: tuple[Rule[int], ...] = (
    Rule("place", "it is one of those that lead", lambda place: place, most=REFITTED - 1),
)
# from which starts the first steps are taken
BEGIN: tuple[Rule[Start], ...] = (
    Rule(
        "gain",
        "it may gain enough",
        lambda s: math.inf if s.unseen else MARGIN * s.promise,
        LEAST_GAIN,
    ),
    Rule(
        "of-best",
        "it may gain enough beside the best",
        lambda s: math.inf if s.unseen else MARGIN * _share(s.promise, s.gained, 1.0),
        HOPELESS,
    ),
)
FINISH: tuple[Rule[Begun], ...] = (
    Rule("place", "it is one of those that lead", lambda b: b.place, most=REFITTED - 1),
    Rule(
        "hopeless",
        "it promises enough beside the best",
        lambda b: _share(b.promise, b.best_promise, 1.0),
        HOPELESS,
    ),
)
# ... or one of these
FINISH_ANYWAY: tuple[Rule[Begun], ...] = (
    Rule("steady", "it shows as a leading one does", lambda b: b.beside_steady, 1.0),
    Rule("rival", "it gains already", lambda b: _share(b.gain, b.best_gain, 0.0), OF_BEST),
    Rule(
        "apart",
        "no other may explain what it promises",
        lambda b: passes(Apart(b.promise, b.by_others), SCREEN_APART),
        1.0,
    ),
)
AFRESH: tuple[Rule[Begun], ...] = (
    Rule("worth-a-start", "the best promises much", lambda b: b.best_promise, WORTH_A_START),
    Rule(
        "place",
        "it is among the first, or shows as a leading one does",
        lambda b: -1 if b.beside_steady else b.place,
        most=SECOND_STARTS - 1,
    ),
)
# where a model leaves much that nothing explains: which fits from the estimate are looked into
LEFT_BEHIND: tuple[Rule[Afresh], ...] = (
    Rule("stuck", "it leaves the model and its other fit behind", lambda a: a.gain - a.near, STUCK),
)
# one of these, to be fitted again from where the best one lies
AGAIN: tuple[Rule[Rival], ...] = (
    Rule("stuck", "the model was stuck", lambda r: r.moved, STUCK),
    Rule("rival", "it is a rival", lambda r: _share(r.gain, r.best_gain, 0.0), OF_BEST),
)

# --- which of them is accepted ------------------------------------------------------------------

# Standard errors by which the maneuvers left out have to improve, and share of the power of their
# residual above the noise of the sensor that has to be explained in some channel. What other
# thresholds and other kinds of evidence do: docs/benchmarks.md, evidence.
LEAST_T, LEAST_EXPLAINED = 2.5, 0.3
# ... of one of two effects that were looked for together, beside the other: right ones had 1.9 and
# 5.4 (population, seeds 182 and 378), and in 26 clean trials of even seeds none was false with it
LEAST_T_BESIDE = 1.5
# ... from which share on one bad place does not count against it: a step of thrust that explains
# 82 % of u, and is off in the last run, has but 0.7 standard errors (population, seed 38)
SURE_EXPLAINED = 0.8
# ... and from half of it on so many standard errors do: an effect that acts for seconds after each
# execute shows in so few blocks of time that more cannot be had (even seed 5324: a servo lag at its
# size, 65 % of r, 2.2). In 72 clean trials of even seeds no false effect lies between.
MUCH_EXPLAINED, LEAST_T_MUCH = 0.5, 2.0
SUFFICES = ((SURE_EXPLAINED, -math.inf), (MUCH_EXPLAINED, LEAST_T_MUCH))  # share, standard errors
CHECK_GAIN = 12.0  # [nats] a sensor check that is reconciled counts as a channel
LEAST_MANEUVERS = 2  # without which none can be left out
LEAST_SHARE = 0.6  # of the maneuvers left out that an effect has to help


def suffices(explained: float, t: float) -> bool:
    """Whether so few standard errors do, so much being explained."""
    return any(explained >= share and t >= least for share, least in SUFFICES)


def _standard_errors(account: Account) -> float:
    """By which what was left out improves; infinite where fewer do, so much being explained."""
    found = account.helped
    return math.inf if found is None or suffices(found.explained, found.t) else found.t


def _size_that_matters(account: Account) -> float:
    """Practical sizes; any of water that makes good much of an error is one at least."""
    fall = max(account.falls.values(), default=0.0)
    of_water = account.id == WATER and fall >= LEAST_FALL
    return max(account.size, LEAST_SIZE) if of_water else account.size


def _share_helped(account: Account) -> float:
    found = account.helped
    return math.inf if found is None else max(found.share, found.deciding)


RULES: tuple[Rule[Account], ...] = (
    Rule(
        "unsettled",
        "its fit has converged",
        lambda a: a.settled,
        1.0,
        words="promises too little beside the best candidate; its fit was stopped early",
    ),
    Rule(
        "gain",
        "its gain in likelihood is large enough",
        lambda a: a.gain,
        LEAST_GAIN,
        words="evidence too weak ({evidence:.0f} nats)",
    ),
    Rule(
        "of-best",
        "it is not a by-product of another",
        lambda a: _share(a.gain, a.by_others, 1.0),
        OF_BEST,
        words="explains less than half of what another does that looks like it",
    ),
    Rule(
        "small",
        "it is large enough to matter",
        _size_that_matters,
        LEAST_SIZE,
        words="too small to matter in practice",
    ),
    Rule(
        "impossible",
        "its size is possible",
        lambda a: not a.impossible,
        1.0,
        words="would need an impossible size",
    ),
    Rule(
        "maneuvers",
        "there is another maneuver to try it on",
        lambda a: a.maneuvers,
        LEAST_MANEUVERS,
        words="no second maneuver to test it on",
    ),
)


def _left_out(least_t: float) -> tuple[Rule[Account], ...]:
    """What an effect has to do for the maneuvers left out, by so many standard errors."""
    return (
        Rule(
            "share-helped",
            "it helps most of the maneuvers left out",
            _share_helped,
            LEAST_SHARE,
            words="helps only {share:.0f} % of the maneuvers left out",
        ),
        Rule(
            "evidence",
            "it helps them more than chance would",
            _standard_errors,
            least_t,
            words="evidence too weak: helps the maneuvers left out by {evidence:.1f} standard "
            "errors, {least:.1f} needed",
        ),
        Rule(
            "explained",
            "it explains much of some residual",
            lambda a: a.helped.explained if a.helped else math.inf,
            LEAST_EXPLAINED,
            words="hardly improves any channel: removes {evidence:.0%} of the error beyond the "
            "noise, {least:.0%} needed",
        ),
    )


# ... and once it was tried on maneuvers left out of its fit
RULES_LEFT_OUT = _left_out(LEAST_T)
# ... beside another effect, where the two together have met the ones above
RULES_BESIDE = _left_out(LEAST_T_BESIDE)
ANOTHER = Refusal("another", "another candidate gains more")
SENSORS: tuple[Rule[float], ...] = (
    Rule("reconciled", "sensors agree better with it [nats]", lambda gain: gain, CHECK_GAIN),
)
# ... so that it needs no model to be known. Of even seeds sensors disagree in 34 clean trials by 13
# nats at most, in 155 with something planted that is no fault of theirs by 29; of 55 faults that
# were named in 39 by 62 and more, in two by 31 and 34, and in those that the motion told by 7.
SHOWN_GAIN = 40.0  # [nats]
BY_SENSORS: tuple[Rule[Reconciled], ...] = (
    Rule("reconciled", "sensors agree much better with it [nats]", lambda r: r.gain, SHOWN_GAIN),
    Rule("share", "they hardly disagree any more", lambda r: r.share, SURE_EXPLAINED),
)

# --- what is accepted in its place, cannot be told from it, or is taken along -------------------

SIMPLE = 0.04  # an effect with fewer parameters may gain this share less
ALIKE_SHARE = 0.12  # effects that gain all but this share of the best are not told apart
RMS_ALIKE = 1.15  # ... and leave no residual larger by more
# Of those that look alike by what they are (`likeness`) one that gains a third is not told apart
# where it leaves no residual larger at all: what the other gains more rests on the colour of the
# residual, not on its size. A backlash was called a dead band (192 nats beside 102; retired odd
# seed 12995, which chose this, and 1041 of development: 259 beside 120).
ALIKE_SHARE_OF_KIND = 1.0 / 3.0
SWAP = 15.0  # [nats] by which one explanation is better than another
CONTAINS = 0.98  # cosine from which on an effect is a special case of another with more parameters
MOST_HIDDEN = 2  # candidates with which another effect is looked for, where none is accepted
MOST_UNCLAIMED = 2  # effects taken along without a claim
CLAIMED_FROM = 300.0  # [nats] from which on a term of higher order that comes first is claimed

SIMPLER: tuple[Rule[Beside], ...] = (
    Rule(
        "fewer",
        "it has fewer parameters",
        lambda b: b.accepted.parameters - b.other.parameters,
        1.0,
    ),
    Rule("gain", "it gains nearly as much", lambda b: b.gain_share, 1.0 - SIMPLE),
    Rule("sound", "it meets all rules by itself", lambda b: passes(b.other, RULES), 1.0),
)
ALIKE: tuple[Rule[Beside], ...] = (
    Rule("gain", "it gains about as much", lambda b: b.gain_share, 1.0 - ALIKE_SHARE),
    Rule("small", "it is large enough to matter", lambda b: b.other.size, LEAST_SIZE),
    Rule("rms", "it leaves no residual larger", lambda b: b.rms_ratio, most=RMS_ALIKE),
)
ALIKE_OF_KIND: tuple[Rule[Beside], ...] = (
    Rule("gain", "it gains a fair share", lambda b: b.gain_share, ALIKE_SHARE_OF_KIND),
    Rule("small", "it is large enough to matter", lambda b: b.other.size, LEAST_SIZE),
    Rule("rms", "it leaves no residual larger at all", lambda b: b.rms_ratio, most=1.0),
)
# ... of those that sensors held against each other cannot tell apart (a depth that reads too
# little, a DVL that reads too much), whatever both gain there: 30.9 and 27.1 nats (even seed 6182)
ALIKE_TO_SENSORS: tuple[Rule[Beside], ...] = (
    Rule("swap", "the motion hardly tells it [nats]", lambda b: b.gain_lost, most=SWAP),
    *ALIKE[1:],
)
CONTAIN: tuple[Rule[Containing], ...] = (
    Rule("further", "it has more parameters", lambda c: c.further, 1.0),
    Rule("cosine", "the other is a special case of it", lambda c: c.cosine, CONTAINS),
)
TAKE_ALONG: tuple[Rule[Nuisance], ...] = (
    Rule("unclaimed", "few are taken along yet", lambda n: n.unclaimed, most=MOST_UNCLAIMED - 1),
    Rule("small", "it is small", lambda n: n.refused_as in ("small", "explained"), 1.0),
    Rule("hides", "another stands behind it", lambda n: n.hidden_gain, LEAST_GAIN),
    Rule("rms", "no channel pays for it", lambda n: n.rms_ratio, most=RMS_ALIKE),
    Rule("evidence", "it helps maneuvers left out", lambda n: n.t, LEAST_T),
)
# a candidate that may help beside another effect only: what it explains where it was fitted is
# what it would have to explain of what was left out
HIDDEN: tuple[Rule[Hiding], ...] = (
    Rule("tried", "it was tried on maneuvers left out", lambda h: h.tried, 1.0),
    Rule("small", "it is large enough to matter", lambda h: h.large, LEAST_SIZE),
    Rule("helps", "it helps them rather than not", lambda h: h.t, 0.0),
    Rule("explained", "it explains much of some residual", lambda h: h.explained, LEAST_EXPLAINED),
)
CLAIM: tuple[Rule[Accepted], ...] = (
    Rule(
        "first",
        "a term of higher order comes first",
        lambda a: a.before if a.higher_order else 0,
        most=0.0,
    ),
    Rule(
        "gain",
        "a term of higher order gains much",
        lambda a: a.gain if a.higher_order else math.inf,
        CLAIMED_FROM,
    ),
)

# --- when the search goes on, and what is taken back --------------------------------------------

MOST_EFFECTS = 4
MOST_EXCHANGES = 2
REMOVAL = 40.0  # [nats] an accepted effect that is worth less is taken out again
FEWER = 4.0  # ... and may lose so much when they have fewer parameters

GO_ON: tuple[Rule[int], ...] = (
    Rule("named", "few effects are named yet", lambda named: named, most=MOST_EFFECTS - 1),
)
EXCHANGE_ON: tuple[Rule[int], ...] = (
    Rule("done", "few exchanges are made yet", lambda done: done, most=MOST_EXCHANGES - 1),
)
REPLACE: tuple[Rule[Replacing], ...] = (
    Rule(
        "worth",
        "it may explain what is taken out",
        lambda r: math.inf if r.unseen else MARGIN * _share(r.promise, r.worth, 1.0),
        1.0,
    ),
)
EXCHANGE: tuple[Rule[Exchanged], ...] = (
    Rule("small", "every new one is large enough to matter", lambda e: e.size, LEAST_SIZE),
    Rule("impossible", "their sizes are possible", lambda e: not e.impossible, 1.0),
    Rule(
        "swap",
        "others in its place gain",
        lambda e: math.inf if e.fewer else e.gain,
        SWAP,
    ),
    Rule(
        "fewer",
        "fewer parameters lose little",
        lambda e: e.gain if e.fewer else math.inf,
        -FEWER,
    ),
    Rule(
        "more",
        "what has more parameters is told apart from what it replaces",
        lambda e: e.share,
        ALIKE_SHARE,
    ),
)
RECONSIDER: tuple[Rule[int], ...] = (
    Rule("others", "there are others beside it", lambda effects: effects, 2),
)
STAY: tuple[Rule[float], ...] = (
    Rule("removal", "it is worth its place [nats]", lambda worth: worth, REMOVAL),
)
