"""All effects at once, to first order about a fitted model: the screen before any refit.

One simulation with the slopes of everything gives, for each maneuver, how the likelihood changes
when any effect is added and the coefficients adjust (the score test, or Lagrange multiplier),
which effects these maneuvers can show at all, and which look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import INDEPENDENT_S
from auvident.engines.free_run import (
    Innovations,
    Normal,
    OutputError,
    best_start,
    finite_innovations,
    lost_readings,
    pull_of_start,
    summed,
)
from auvident.engines.prediction import At
from auvident.engines.records import Record
from auvident.estimation.output_error import bounded_step
from auvident.parallel import each
from auvident.physics.dynamics import N_STATES
from auvident.schema.effects import BY_ID, own_in, parameter_of
from auvident.stages.diagnose.fit.case import Case, in_order
from auvident.stages.diagnose.fit.fits import N_CHANNELS, Fitted, output_error, prior_of

Array = npt.NDArray[Any]

SMALLEST = 1.0e-12  # information that counts as some
NO_PRODUCTS = np.zeros((N_CHANNELS, 0, 0))  # of slopes, where nobody looks at them
MOST_BLOCKS = 8  # of a maneuver, so that long ones need no more memory


@dataclass(frozen=True)
class Blocks:
    """Slopes of the likelihood by blocks of time of at least `INDEPENDENT_S`.

    Attributes
    ----------
    record : (b,) int array
        Place of the maneuver that each lies in.
    gradient : (b, n) array
    curvature : (b, n, n) array
    """

    record: npt.NDArray[np.int64]
    gradient: Array
    curvature: Array


NO_BLOCKS = Blocks(np.zeros(0, np.int64), np.zeros((0, 0)), np.zeros((0, 0, 0)))


@dataclass(frozen=True)
class Joint:
    """Slopes of the likelihood about a fitted model.

    Attributes
    ----------
    case : Case
    fitted : Fitted
    free : (n,) int array
        Coefficients, nuisance parameters and the parameters of all effects.
    half : float
        Half the sum of squared whitened errors, starts eliminated.
    gradient : (n,) array
    curvature : (n, n) array
        Summed over the maneuvers, starts eliminated.
    raw : (3, n, n) array
        Mean products of the unwhitened slopes of each channel.
    blocks : Blocks
        What each block of time adds; none where nobody looks at them.
    """

    case: Case
    fitted: Fitted
    free: npt.NDArray[np.int64]
    half: float
    gradient: Array
    curvature: Array
    raw: Array
    blocks: Blocks

    def columns(self, positions: Sequence[int] | Array) -> Array:
        """Columns of parameters."""
        return np.searchsorted(self.free, np.array(positions, dtype=np.int64))

    def lacks(self, effect: str) -> bool:
        """Whether it has the slopes of an effect that the model does not have."""
        own = self.case.positions(effect)
        return effect not in self.fitted.effects and bool(np.isin(own, self.free).all())


@dataclass(frozen=True)
class Score:
    """What adding an effect would bring to first order.

    Attributes
    ----------
    gain : float
        Rise of the log posterior [nats].
    parameters : (n_parameters,) array
        Where the first step leads.
    cost : float
        Negative log posterior before the step, up to a constant.
    """

    gain: float
    parameters: Array
    cost: float = 0.0


def joint_about(
    case: Case, fitted: Fitted, effects: Sequence[str], gain: Array | None = None
) -> Joint | None:
    """Slopes of everything about a fitted model; None where the simulation runs away.

    Parameters
    ----------
    effects : sequence of str
        Effects to look at.
    gain : (4,) array, optional
        Observer gain, which brings out what is fast.
    """
    free = case.setup.free(in_order(fitted.free, case.positions(*effects)))
    output = output_error(case, fitted.colours, gain)
    at = output.at(fitted.parameters, free)
    parts = each(lambda r: _slopes_of(output, at, r), case.records, len)
    if any(part is None for part in parts):
        return None
    normal, raw, count, own = zip(*parts, strict=True)  # type: ignore[arg-type]
    half, gradient, curvature = summed(normal, len(free.positions))
    mean = sum(raw) / np.maximum(sum(count), 1.0)[:, None, None]
    slopes = half, gradient, curvature
    return Joint(case, fitted, free.positions, *slopes, mean, _joined(own))


def _joined(parts: Sequence[tuple[Array, Array]]) -> Blocks:
    """Blocks of all records."""
    gradient, curvature = (np.concatenate(found) for found in zip(*parts, strict=True))
    return Blocks(np.repeat(np.arange(len(parts)), [len(g) for g, _ in parts]), gradient, curvature)


def _slopes_of(
    output: OutputError, at: At, record: Record
) -> tuple[Normal, Array, Array, tuple[Array, Array]] | None:
    """Share of a record in what `Joint` holds, with the count of its readings (3,)."""
    found = finite_innovations(output, at, record)
    if found is None:
        return None
    slopes, seen = found.predicted.slopes, found.seen
    own = [slopes[seen[:, c], c, N_STATES:] for c in range(N_CHANNELS)]
    error, left, pulled = _without_start(output, record, found)
    return (
        _normal_of(output, record, found, error, left, pulled),
        np.array([part.T @ part for part in own]),
        np.array([float(len(part)) for part in own]),
        _by_time(error, left, len(record), output.frame.dt_s),
    )


def _by_time(error: Array, left: Array, rows: int, dt_s: float) -> tuple[Array, Array]:
    """Gradient (b, n) and curvature (b, n, n) of the blocks of a record.

    Of what the start cannot take up, so that each block holds its own share of it.
    """
    count = int(np.clip(rows * dt_s // INDEPENDENT_S, 1, MOST_BLOCKS))
    ends = np.arange(count + 1) * rows // count
    by_channel = np.column_stack([error, left]).reshape(-1, rows, 1 + left.shape[1])
    gram = []
    for first, last in pairwise(ends):
        part = by_channel[:, first:last].reshape(-1, 1 + left.shape[1])
        gram.append(part.T @ part)
    found = np.array(gram)
    return found[:, 0, 1:], found[:, 1:, 1:]


def _normal_of(
    output: OutputError,
    record: Record,
    found: Innovations,
    error: Array,
    left: Array,
    pulled: float,
) -> Normal:
    """What a record adds, given its errors and slopes without what the start takes up."""
    lost = lost_readings(record, found.seen, output.channels)
    by_free = found.white[:, 1 + len(output.channels) :].T
    half = 0.5 * (float(found.white[:, 0] @ error) + pulled + lost)
    return half, by_free @ error, by_free @ left


@dataclass(frozen=True)
class Form:
    """What an absent effect would look like: parameters (n_parameters,) and records.

    They are the model's own but for what gives the effect its form.
    """

    parameters: Array
    records: Sequence[Record]


def scores_of_forms(
    case: Case, fitted: Fitted, effect: str, forms: Sequence[Form]
) -> list[Score] | None:
    """Scores of adding an effect, see `score`, for several of its forms.

    While the effect is absent its form changes neither the motion nor any slope but its own, so
    that the others are found once for all forms.

    Parameters
    ----------
    effect : str
        Not among those of the model; zero in its parameters.
    forms : sequence of Form

    Returns
    -------
    list of Score, or None
        None where the simulation runs away.
    """
    own, output = case.positions(effect), output_error(case, fitted.colours)
    every, alone = case.setup.free(in_order(fitted.free, own)), case.setup.free(np.array(own))
    here = output.at(fitted.parameters, every)
    there = [(output.at(form.parameters, alone), form.records) for form in forms]

    def part(k: int) -> tuple[Normal, list[Normal]] | None:
        seen = [(at, records[k]) for at, records in there]
        return _forms_of(output, here, case.records[k], seen)

    parts = each(part, range(len(case.records)), lambda k: len(case.records[k]))
    if any(p is None for p in parts):
        return None
    normal, shares = zip(*parts, strict=True)  # type: ignore[arg-type]
    half, gradient, curvature = summed(normal, len(every.positions))
    slopes = half, gradient, curvature
    about = Joint(case, fitted, every.positions, *slopes, NO_PRODUCTS, NO_BLOCKS)
    return [score(_with_form(about, own, share), (effect,)) for share in zip(*shares, strict=True)]


def _with_form(about: Joint, own: Sequence[int], shares: Sequence[Normal]) -> Joint:
    """Slopes of the likelihood with another form of an effect."""
    at, gradient, curvature = about.columns(own), about.gradient.copy(), about.curvature.copy()
    gradient[at] = np.sum([share[1] for share in shares], axis=0)
    by_all, k = np.sum([share[2] for share in shares], axis=0), len(at)
    curvature[at], curvature[:, at] = by_all[:, k:], by_all[:, k:].T
    curvature[np.ix_(at, at)] = by_all[:, :k]
    return replace(about, gradient=gradient, curvature=curvature)


def _forms_of(
    output: OutputError,
    here: At,
    record: Record,
    forms: Sequence[tuple[At, Record]],
) -> tuple[Normal, list[Normal]] | None:
    """What a record adds without the effect, and its slopes by each form of it.

    Of a form: zero; its gradient (k,); its curvature (k, k + n) with itself and with all.
    """
    whole = finite_innovations(output, here, record)
    if whole is None:
        return None
    error, base, pulled = _without_start(output, record, whole)
    found = []
    for at, seen in forms:
        form = finite_innovations(output, at, seen)
        assert form is not None  # the same motion
        slopes = form.white[:, 1 + len(output.channels) :].T
        left = _without_start(output, seen, form)[1]
        found.append((0.0, slopes @ error, np.hstack([slopes @ left, slopes @ base])))
    return _normal_of(output, record, whole, error, base, pulled), found


def _without_start(
    output: OutputError, record: Record, found: Innovations
) -> tuple[Array, Array, float]:
    """Errors and slopes with what the start can take up removed, and what moving it costs.

    Row by row: forms of an effect need what is left of the others, and the step of a score, which
    is no part of a fit that would converge, is better conditioned.
    """
    n = 1 + len(output.channels)
    start = found.white[:, 1:n]
    products, pull = start.T @ found.white, pull_of_start(output, record)
    products[:, 0] += pull
    up = best_start(output, start.T @ start, products)
    left = found.white - start @ up
    return left[:, 0], left[:, n:], float(pull @ (record.moved[output.active] - up[:, 0]))


def score(joint: Joint, effects: Sequence[str]) -> Score:
    """Gain of adding effects to the fitted model, the other parameters adjusting."""
    case, start = joint.case, joint.fitted.parameters
    free = case.setup.free(in_order(joint.fitted.free, case.positions(*effects)))
    opened = case.positions(*joint.fitted.effects, *effects)
    prior, at = prior_of(case, free.positions, opened), joint.columns(free.positions)
    theta = start[free.positions] / free.scale
    away = theta - prior.mean
    gradient = joint.gradient[at] + prior.information @ away
    curvature = joint.curvature[np.ix_(at, at)] + prior.information
    step = bounded_step(curvature, gradient, prior.low - theta, prior.high - theta)
    gain = -(gradient @ step + 0.5 * step @ curvature @ step)
    cost = joint.half + 0.5 * float(away @ prior.information @ away)
    return Score(float(gain), free.at(start, free.scale * (theta + step)), cost)


def score_from(joint: Joint, effect: str, there: Array) -> Score | None:
    """As `score`, with the step taken from an effect at another size `there`.

    For effects whose signature changes with their size: what a small one would do says little.
    None where the simulation runs away.
    """
    moved = replace(joint.fitted, parameters=there)
    other = joint_about(joint.case, moved, (effect,))
    if other is None:
        return None
    found = score(other, (effect,))
    gain = score(joint, (effect,)).cost - found.cost + found.gain
    return Score(gain, found.parameters, found.cost)


@dataclass(frozen=True)
class Unabsorbed:
    """What of the signature of parameters the fitted model cannot take up.

    Attributes
    ----------
    information : (k, k) array
        Of the parameters, in units of their prior, the others adjusting.
    kept : (k,) array
        Share of each one's signature (0: the coefficients absorb it, 1: nothing hides it).
    rms : (k, 3) array
        Root mean square in each channel, per unit of prior.
    along : (n, k) array
        How all parameters move with a unit of each, the others adjusting.
    """

    information: Array
    kept: Array
    rms: Array
    along: Array


def unabsorbed(joint: Joint, positions: Sequence[int]) -> Unabsorbed:
    """What of the signature of parameters the fitted model cannot take up."""
    own = joint.columns(positions)
    # nuisance parameters are bounded, and an effect worth a word exceeds them
    base = joint.columns(
        [
            i
            for i in joint.fitted.free
            if i not in set(positions) and joint.case.nuisance_std[i] == 0.0
        ]
    )
    opened = joint.case.positions(*joint.fitted.effects)
    prior, h = prior_of(joint.case, joint.free[base], opened), joint.curvature
    share = np.linalg.solve(h[np.ix_(base, base)] + prior.information, h[np.ix_(base, own)])
    left = h[np.ix_(own, own)] - h[np.ix_(own, base)] @ share
    kept = np.diag(left) / np.maximum(np.diag(h)[own], SMALLEST)
    along = np.zeros((len(h), len(own)))
    along[own, np.arange(len(own))] = 1.0
    along[base] = -share
    power = np.einsum("ik,cij,jk->kc", along, joint.raw, along)
    return Unabsorbed(left, kept, np.sqrt(np.maximum(power, 0.0)), along)


def information_by_block(joint: Joint, left: Unabsorbed) -> Array:
    """Information (k, b) of each parameter from each block of time, in units of its prior."""
    along, own = left.along, joint.blocks.curvature
    return np.asarray(np.einsum("ik,bij,jk->kb", along, own, along, optimize=True))


def information_by_record(joint: Joint, left: Unabsorbed) -> Array:
    """Information (k, m) of each parameter from each maneuver, in units of its prior."""
    own, record = information_by_block(joint, left), joint.blocks.record
    return np.array([np.bincount(record, weights=row) for row in own])


def excess_variance(joint: Joint, left: Unabsorbed) -> Array:
    """Variance (k,) of the score of each parameter over its information.

    One where the model is right but for the parameter; more where its residual drifts with the
    signature in some blocks of time and against it in others. The estimate of the parameter is
    then so much less certain than its information says (the sandwich of robust regression).
    """
    own = information_by_block(joint, left)
    slopes = (joint.blocks.gradient @ left.along).T
    whole = np.maximum(own.sum(axis=1, keepdims=True), SMALLEST)
    free = 1.0 - np.sum((own / whole) ** 2, axis=1)  # of the scatter, what the estimate leaves
    scatter = slopes - own * slopes.sum(axis=1, keepdims=True) / whole
    return np.sum(scatter**2, axis=1) / np.maximum(whole[:, 0] * free, SMALLEST)


def in_parts(case: Case, fitted: Fitted, effect: str) -> Array | None:
    """What stands for each parameter of an effect among those that together do what it does.

    A side force and moment turn a hull that stands as stiff as its lift and damping make it; what
    they amount to is the offset of the rudder, and of the drift angle, that show as they do.

    Returns
    -------
    (k, n) array, or None
        Practical sizes of the k parameters of its parts for a unit of the prior of each of its
        own n. None where it has no parts (`Effect.parts`), or the simulation runs away.
    """
    parts = [own_in(case.plane.name, part) for part in BY_ID[effect].parts]
    if not parts:
        return None
    of_parts, own = case.positions(*parts), case.positions(effect)
    free = case.setup.free(np.array(sorted([*of_parts, *own])))
    output = output_error(case, fitted.colours)
    here = output.at(fitted.parameters, free)
    found = each(lambda r: finite_innovations(output, here, r), case.records)
    if any(one is None for one in found):
        return None
    left = [
        _without_start(output, record, one)[1]
        for record, one in zip(case.records, found, strict=True)
        if one is not None
    ]
    at, of = (np.searchsorted(free.positions, np.array(who)) for who in (of_parts, own))
    sought = np.concatenate([white[:, at] for white in left])
    given = np.concatenate([white[:, of] for white in left])
    practical = [parameter_of(case.names[i]) for i in of_parts]
    units = np.array([declared.practical / declared.prior for declared in practical])
    return np.linalg.lstsq(sought, given)[0] / units[:, None]


def cosine(joint: Joint, a: Sequence[int], b: Sequence[int]) -> float:
    """Likeness of two effects: largest canonical correlation of what is not absorbed of them."""
    both = [*a, *b]
    left = unabsorbed(joint, both).information
    k = len(a)
    aa, bb, ab = left[:k, :k], left[k:, k:], left[:k, k:]
    return _canonical(aa, bb, ab)


def cosines(joint: Joint, effects: Sequence[str]) -> dict[frozenset[str], float]:
    """Likeness of each pair of effects that the model lacks, see `cosine`, all at once."""
    own = [joint.case.positions(effect) for effect in effects]
    left = unabsorbed(joint, [i for positions in own for i in positions]).information
    ends = np.cumsum([0, *(len(positions) for positions in own)])
    at = [slice(first, last) for first, last in pairwise(ends)]
    return {
        frozenset((effects[j], effects[k])): _canonical(
            left[at[j], at[j]], left[at[k], at[k]], left[at[j], at[k]]
        )
        for j, k in combinations(range(len(effects)), 2)
    }


def _canonical(aa: Array, bb: Array, ab: Array) -> float:
    def root(m: Array) -> Array:
        values, vectors = np.linalg.eigh(0.5 * (m + m.T))
        values = np.where(values > 1e-9 * max(float(values[-1]), SMALLEST), values, np.inf)
        return np.asarray(vectors / np.sqrt(values) @ vectors.T)

    return float(np.clip(np.linalg.svd(root(aa) @ ab @ root(bb), compute_uv=False)[0], 0.0, 1.0))
