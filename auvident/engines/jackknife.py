"""How much each maneuver moves the result: leave-one-maneuver-out without running it again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import NORMAL_90
from auvident.engines.constraints import in_units
from auvident.engines.estimator import Task, task_about
from auvident.engines.falling import PushesAlong, fallen_models, hardly_keeps_course, pushes_of
from auvident.engines.free_run import likelihood
from auvident.engines.map_fit import Prior
from auvident.engines.predictive import LeftOutCourse, left_out_course, noise_of, widened
from auvident.engines.setup import Outcome, Setup
from auvident.estimation.inequalities import kept
from auvident.estimation.innovations import mean_square_quantile
from auvident.estimation.output_error import bounded_step, fit
from auvident.estimation.pooling import for_few, seen_axes
from auvident.physics.dynamics import N_STATES
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

LEAST_MANEUVERS = 3  # fewer say nothing about the scatter between maneuvers
# [nats] A Newton step that promises more for the other maneuvers goes beyond where their likelihood
# is quadratic. Of the final models of three trials of even seeds those of up to 7 kept 0.9 to 1.1
# of it; one of 485 (the only run with steps of thrust was left out) lost 8,250, where a fit
# found 69.
LONG_STEP = 7.0
MOST_STEPS = 10  # of a fit to the others; on these trials those that converge take seven at most
ENOUGH = 1.0e-5  # relative fall of the cost below which it has converged: some tenths of a nat
ROUNDING = 1.0e-13  # of the largest eigenvalue; smaller ones are zero
LEAST_FREEDOM = 1.0  # expected squares below which they say nothing


@dataclass(frozen=True)
class Scatter:
    """Scatter between maneuvers of the coefficients of an outcome.

    Attributes
    ----------
    std : (n,) array
        Jackknife standard deviations, in units of the prior's.
    beyond_chance : (n,) bool array
        Where maneuvers of one vehicle would scatter as much in less than one trial of twenty.
    """

    std: Array
    beyond_chance: npt.NDArray[np.bool_]


def scatter_of(
    gradients: Mapping[str, Array], curvatures: Mapping[str, Array], prior: Array
) -> Scatter | None:
    """Scatter between maneuvers; None with fewer than `LEAST_MANEUVERS`.

    That they disagree with the prior is another matter, and no scatter.
    """
    own = centred(gradients, curvatures)
    covariance = jackknife_covariance(moves_without(own, curvatures, prior))
    if covariance is None:
        return None
    expected, freedom = expected_variance(list(curvatures.values()), prior)
    variance = np.diag(covariance)
    return Scatter(np.sqrt(variance), variance > expected * largest_by_chance(freedom))


def information_by_maneuver(
    setup: Setup, outcome: Outcome, stage: PlanStage
) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Gradient and curvature of each maneuver at the outcome, and the prior's information."""
    task, p = task_about(setup, outcome, stage), outcome.parameters
    records = task.output.records
    alone = [replace(task.output, records=(record,)) for record in records]
    parts = [likelihood(output, p, task.free) for output in alone]
    gradients = {r.id: part[1] for r, part in zip(records, parts, strict=True)}
    curvatures = {r.id: part[2] for r, part in zip(records, parts, strict=True)}
    return gradients, curvatures, task.information


def centred(gradients: Mapping[str, Array], curvatures: Mapping[str, Array]) -> dict[str, Array]:
    """Gradients as they are at what the data alone would estimate; their sum is zero.

    At the optimum the gradients add up to the pull of the prior, and the maneuver that alone
    informs a coefficient has all of it. g_f - H_f (sum H)^-1 sum g takes from each its share by
    information; what the data do not see has no part in either.
    """
    away = seen_inverse(list(curvatures.values())) @ sum(gradients.values())
    return {name: g - curvatures[name] @ away for name, g in gradients.items()}


def seen_inverse(curvatures: Sequence[Array]) -> Array:
    """Inverse (n, n) of a sum of information, within the directions that it sees."""
    total = np.sum(curvatures, axis=0)
    return np.asarray(np.linalg.pinv(total, rcond=ROUNDING, hermitian=True))


@dataclass(frozen=True)
class Claimed:
    """Whether the maneuvers scatter as the noise of the fit lets them.

    Attributes
    ----------
    ratio : float
        Squared scatter of the gradients over that expected; 1 where the standard deviations of a
        fit are right, 4 where they are half of what they should be.
    freedom : float
        Expected sum of squares.
    """

    ratio: float
    freedom: float


def noise_claim(gradients: Mapping[str, Array], curvatures: Mapping[str, Array]) -> Claimed | None:
    """Scatter of the maneuvers along what each of them sees; None with too few of them.

    The centred gradient c_f has the covariance K_f = H_f - H_f (sum H)^-1 H_f if the noise is as
    large as the fit takes it for. The noise is that of the residual, which the coefficients do not
    see; this is the part of it that they do.
    """
    if len(gradients) < LEAST_MANEUVERS:
        return None
    own, known = centred(gradients, curvatures), seen_inverse(list(curvatures.values()))
    found = expected = 0.0
    for name, h in curvatures.items():
        axes = seen_axes(h)
        found += float(np.sum((axes.T @ own[name]) ** 2))
        expected += float(np.trace(axes.T @ (h - h @ known @ h) @ axes))
    return Claimed(found / expected, expected) if expected > LEAST_FREEDOM else None


def moves_without(
    gradients: Mapping[str, Array], curvatures: Mapping[str, Array], prior: Array
) -> dict[str, Array]:
    """Move of the free coefficients when one maneuver is left out, by one Newton step.

    With H the curvature of all maneuvers and the prior, g_f and H_f those of maneuver f:
    move = (H - H_f)^-1 g_f, in units of the prior standard deviations.
    """
    whole = prior + sum(curvatures.values())
    return {n: np.linalg.solve(whole - curvatures[n], g) for n, g in gradients.items()}


def left_out_courses(
    setup: Setup,
    outcome: Outcome,
    stage: PlanStage,
    gradients: Mapping[str, Array],
    curvatures: Mapping[str, Array],
    prior: Array,
    length_m: float,
) -> tuple[dict[str, LeftOutCourse | None], PushesAlong | None]:
    """Each maneuver predicted without it, None where that runs away; pushes, see `falling`.

    There are pushes where the hull hardly keeps its course, and the courses have the variance that
    comes of them.

    The parameters are those of one Newton step within bounds and constraints, or of a fit to the
    others where that step is a long one. Beside an identification without the maneuver the errors
    of the sample trial `harbour_trial` (seven maneuvers) were off by 2 % in the mean and 13 % at
    the most, those of the tanker (nine) by 8 and 36 %.
    """
    task, p = task_about(setup, outcome, stage), outcome.parameters
    room = task.prior_about(p)
    room = replace(room, low=np.minimum(room.low, 0.0), high=np.maximum(room.high, 0.0))
    whole, every = prior + sum(curvatures.values()), np.sum(list(gradients.values()), axis=0)
    models, found = {}, {}
    for name, gradient in gradients.items():
        others = whole - curvatures[name]
        step = _newton_step(task, p, room, gradient, others)
        if gradient @ step - 0.5 * step @ others @ step > LONG_STEP:
            step = _fitted_without(name, task, p, room, step, every)
        without, covariance = task.free.moved(p, step), np.linalg.inv(others)
        models[name] = without, setup.records[name][1], task.free, covariance
        found[name] = left_out_course(setup.frame, *models[name])
    if not hardly_keeps_course(setup.structure, p, length_m):
        return found, None
    pushes = _pushes(setup, found, length_m)
    return {
        name: course and widened(course, fallen_models(setup.frame, *models[name], pushes).variance)
        for name, course in found.items()
    }, pushes


def _pushes(
    setup: Setup, courses: Mapping[str, LeftOutCourse | None], length_m: float
) -> PushesAlong:
    """Pushes that add up to the errors of the maneuvers left out."""
    plane, dt_s = setup.structure.plane, setup.frame.dt_s
    noise, along = noise_of(setup.sensing, plane), PushesAlong(np.zeros(N_STATES), length_m)
    left = [
        (course.beyond(noise), len(along.rows(setup.records[name][1], dt_s)))
        for name, course in courses.items()
        if course is not None
    ]
    return pushes_of(left, plane, length_m)


def _newton_step(task: Task, p: Array, room: Prior, gradient: Array, others: Array) -> Array:
    """Step (n,) without a maneuver of some gradient, to where the others are most probable."""
    inside, here = in_units(room.constraints, task.free, p), np.zeros(len(gradient))
    step = bounded_step(others, -gradient, room.low, room.high)
    return kept(inside, here, step, others, -gradient, room.low, room.high)


def _fitted_without(
    name: str, task: Task, p: Array, room: Prior, step: Array, every: Array
) -> Array:
    """The move (n,) of a fit to the other maneuvers, from the better of a step and none.

    Not all outcomes are where a posterior is largest (a filter's, and a mean, are near to it), but
    leaving nothing out is to move nothing: the slope of all maneuvers together is taken off.
    """
    records = tuple(r for r in task.output.records if r.id != name)
    others = replace(task.output, records=records)
    slope = every - room.information @ room.mean

    def of_others(move: Array) -> tuple[float, Array, Array]:
        half, gradient, curvature = likelihood(others, task.free.moved(p, move), task.free)
        return half - float(slope @ move), gradient - slope, curvature

    def cost(move: Array) -> float:
        away = move - room.mean
        return of_others(move)[0] + 0.5 * float(away @ room.information @ away)

    starts = step, np.zeros(len(step))
    costs = [cost(start) for start in starts]
    if not np.isfinite(min(costs)):  # a filter may end where the prediction runs away
        return step
    return fit(
        of_others,
        starts[int(np.argmin(costs))],
        room.mean,
        room.information,
        (room.low, room.high),
        MOST_STEPS,
        ENOUGH,
        in_units(room.constraints, task.free, p),
    ).theta


def jackknife_covariance(moves: dict[str, Array]) -> Array | None:
    """Covariance of the coefficients from the scatter between maneuvers.

    (F - 1)/F times the sum over the F maneuvers of the outer products of the centred moves.

    Returns
    -------
    (n, n) array or None
        None with fewer than `LEAST_MANEUVERS`.
    """
    if len(moves) < LEAST_MANEUVERS:
        return None
    table = np.array(list(moves.values()))
    table = table - table.mean(axis=0)
    return (len(table) - 1) / len(table) * table.T @ table


def structural_covariance(
    gradients: Mapping[str, Array],
    curvatures: Mapping[str, Array],
    prior: Array,
    kinds: Mapping[str, str],
) -> Array | None:
    """Covariance of the coefficients by what the equations lack; None with too few maneuvers.

    That pulls maneuvers of one kind the same way: only those of another kind, a zigzag beside a
    turn, tell how far. To the scatter between maneuvers comes that between kinds, each left out
    as a whole,

        (K - 1)/K times the sum over the K kinds of the outer products of the moves,

    about the estimate: of two or three kinds there is no mean worth centring at. With one kind
    there is the scatter between maneuvers alone, widened as by `pooling.for_few`.

    Parameters
    ----------
    gradients, curvatures : mapping
        Of each maneuver, see `information_by_maneuver`.
    prior : (n, n) array
        Its information.
    kinds : mapping
        Kind of each maneuver.

    Returns
    -------
    (n, n) array or None
        In units of the prior standard deviations.
    """
    moves = moves_without(gradients, curvatures, prior)
    covariance, count = jackknife_covariance(moves), len(set(kinds.values()))
    if covariance is None:
        return None
    if count < 2:
        return for_few(covariance, len(moves))
    whole = moves_without(by_kind(gradients, kinds), by_kind(curvatures, kinds), prior)
    table = np.array(list(whole.values()))
    found: Array = covariance + (count - 1) / count * table.T @ table
    return found


def by_kind(parts: Mapping[str, Array], kinds: Mapping[str, str]) -> dict[str, Array]:
    """Sums of what maneuvers add over those of each kind."""
    found: dict[str, Array] = {}
    for name, part in parts.items():
        found[kinds[name]] = found.get(kinds[name], np.zeros_like(part)) + part
    return found


def expected_variance(curvatures: Sequence[Array], prior: Array) -> tuple[Array, Array]:
    """Mean of the jackknife variances (n,) with nothing but noise, and their degrees of freedom.

    The centred gradient of maneuver f has the covariance K_f = H_f - H_f (sum H)^-1 H_f, hence the
    move without it A K_f A with A = (H - H_f)^-1; all gradients together are zero, so that
    centring the moves takes little. A sum of squares of unequal variances v has
    (sum v)^2 / sum v^2 degrees of freedom (Satterthwaite 1946).
    """
    whole, count, known = prior + sum(curvatures), len(curvatures), seen_inverse(curvatures)
    moves = [(np.linalg.inv(whole - h), h - h @ known @ h) for h in curvatures]
    variances = np.maximum([np.diag(a @ k @ a) for a, k in moves], 0.0)
    total = variances.sum(axis=0)
    freedom = total**2 / np.maximum((variances**2).sum(axis=0), np.finfo(float).tiny)
    return (count - 1) / count * total, np.maximum(freedom, 1.0)


def largest_by_chance(freedom: Array) -> Array:
    """A chi-square over its degrees of freedom exceeds this in one of twenty cases."""
    return mean_square_quantile(freedom, NORMAL_90)
