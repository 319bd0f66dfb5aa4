"""What two planes say of the coefficients that they share, and what follows for the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import LEADERS, claimed_covariance
from auvident.physics.six_dof_terms import whole_names
from auvident.schema.artifacts import Finding, IdentifiedModel
from auvident.schema.planes import Plane

Array = npt.NDArray[np.float64]

CONTRADICTED = 0.01  # probability of so large a difference between two planes by chance


@dataclass(frozen=True)
class Posterior:
    """What a model knows of its estimated parameters, under their names in six degrees of freedom.

    Attributes
    ----------
    plane : str
    names : tuple of str
    mean, prior, prior_std : (n,) array
        Prior of a parameter of an effect: not known here, infinite.
    covariance : (n, n) array
        Of the fit and of the scatter between maneuvers, no wider than the prior.
    """

    plane: Plane
    names: tuple[str, ...]
    mean: Array
    prior: Array
    prior_std: Array
    covariance: Array

    def at(self, names: Sequence[str]) -> npt.NDArray[np.int64]:
        """Places of names."""
        return np.array([self.names.index(name) for name in names], dtype=np.int64)

    def among(self, names: Sequence[str]) -> Array:
        """Covariance of some of the names."""
        at = self.at(names)
        return self.covariance[np.ix_(at, at)]


@dataclass(frozen=True)
class JointPosterior:
    """Mean and covariance of all that the models estimated; what they found of each other.

    ``of`` says for a shared name which planes it rests on.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    of: dict[str, tuple[Plane, ...]]
    findings: tuple[Finding, ...] = ()


def posterior_of(model: IdentifiedModel) -> Posterior:
    """Mean and covariance of what a model estimated."""
    told = tuple(model.covariance.get("symbols", ()))
    values = {**model.values(), **_effect_values(model)}
    rows = {row.symbol: row for row in model.estimates}
    prior_std = np.array([rows[s].prior_std if s in rows else np.inf for s in told])
    covariance = claimed_covariance(model) if told else np.zeros((0, 0))
    spread = np.sqrt(np.diag(covariance))
    kept = np.minimum(1.0, prior_std / np.where(spread > 0.0, spread, 1.0))
    whole = whole_names(model.plane, tuple(str(e["id"]) for e in model.effects))
    return Posterior(
        model.plane,
        tuple(whole.get(s, s) for s in told),
        np.array([values[s] for s in told]),
        np.array([rows[s].prior if s in rows else 0.0 for s in told]),
        prior_std,
        covariance * np.outer(kept, kept),
    )


def _effect_values(model: IdentifiedModel) -> dict[str, float]:
    return {n: float(v) for effect in model.effects for n, v in effect["internal"].items()}


def join(models: Sequence[IdentifiedModel]) -> JointPosterior:
    """Join the models of the planes by their information about what they share.

    What a plane estimates alone follows the shared values as its own covariance has it.
    """
    posteriors = [posterior_of(model) for model in models]
    if not posteriors:
        return JointPosterior((), np.zeros(0), np.zeros((0, 0)), {})
    if len(posteriors) == 1:
        (one,) = posteriors
        return JointPosterior(one.names, one.mean, one.covariance, {})
    first, second = posteriors
    shared = tuple(n for n in first.names if n in second.names)
    taken = next((m for m in models if _knows_both(m)), None)
    of: dict[str, tuple[Plane, ...]] = dict.fromkeys(shared, (first.plane, second.plane))
    if taken is not None:
        holder = posteriors[models.index(taken)]
        mean, covariance = holder.mean[holder.at(shared)], holder.among(shared)
        return _conditioned(posteriors, shared, mean, covariance, of, ())
    away, p = _apart(first, second, shared)
    if p >= CONTRADICTED:
        return _conditioned(posteriors, shared, *_pooled(first, second, shared), of, ())
    best = min(posteriors, key=lambda one: float(np.linalg.slogdet(one.among(shared))[1]))
    finding = _disagreement(shared, away, p, best.plane)
    mean, covariance = best.mean[best.at(shared)], best.among(shared)
    of = dict.fromkeys(shared, (best.plane,))
    return _conditioned(posteriors, shared, mean, covariance, of, (finding,))


def _knows_both(model: IdentifiedModel) -> bool:
    """Whether a model was started from what the other plane had left of the shared coefficients."""
    return any(c.shared_with for c in model.coefficients)


def _apart(first: Posterior, second: Posterior, shared: Sequence[str]) -> tuple[Array, float]:
    """Difference of each shared value in standard deviations, and the probability of all."""
    from scipy.stats import chi2

    if not shared:
        return np.zeros(0), 1.0
    difference = second.mean[second.at(shared)] - first.mean[first.at(shared)]
    covariance = first.among(shared) + second.among(shared)
    square = float(difference @ np.linalg.solve(covariance, difference))
    return difference / np.sqrt(np.diag(covariance)), float(chi2.sf(square, len(shared)))


def _pooled(first: Posterior, second: Posterior, shared: Sequence[str]) -> tuple[Array, Array]:
    """Mean and covariance of the shared values: both planes' data, the prior once.

    In units of the prior, information of the data is that of the posterior less that of its own
    prior (an estimate goes with the speed of the run, by the Reynolds number); where scatter
    between maneuvers makes a posterior wider than the prior in some direction, the data count as
    none there.
    """
    at = first.at(shared)
    scale = np.where(np.isfinite(first.prior_std[at]), first.prior_std[at], 0.0)
    scale = np.where(scale > 0.0, scale, np.sqrt(np.diag(first.among(shared))))
    prior = np.isfinite(first.prior_std[at]).astype(float)  # information of the prior itself
    information, moved = np.diag(prior), np.zeros(len(shared))
    centre = first.prior[at]
    for one in (first, second):
        own, there = np.outer(scale, scale) * np.linalg.inv(one.among(shared)), one.at(shared)
        known = (scale / one.prior_std[there]) ** 2 * prior
        values, vectors = np.linalg.eigh(own - np.diag(known))
        seen = vectors[:, values > 0.0]
        data = seen @ np.diag(values[values > 0.0]) @ seen.T
        away, begun = ((x[there] - centre) / scale for x in (one.mean, one.prior))
        moved += seen @ (seen.T @ (own @ away - known * begun))
        information += data
    covariance = np.linalg.inv(information)
    return centre + scale * (covariance @ moved), covariance * np.outer(scale, scale)


def _conditioned(
    posteriors: Sequence[Posterior],
    shared: tuple[str, ...],
    mean: Array,
    covariance: Array,
    of: dict[str, tuple[Plane, ...]],
    findings: tuple[Finding, ...],
) -> JointPosterior:
    """Joint mean and covariance, each plane's own parameters given the shared ones."""
    size = len(shared)
    names, means, gains = list(shared), [mean], [np.eye(size)]
    rests: list[Array] = [np.zeros((size, size))]
    for one in posteriors:
        own = [n for n in one.names if n not in shared]
        at, common = one.at(own), one.at(shared)
        across = one.covariance[np.ix_(at, common)]
        gain = np.asarray(np.linalg.solve(one.among(shared), across.T).T, dtype=np.float64)
        gains.append(gain)
        rests.append(one.covariance[np.ix_(at, at)] - gain @ across.T)
        means.append(one.mean[at] + gain @ (mean - one.mean[common]))
        names += own
    stacked = np.vstack(gains)
    joint = stacked @ covariance @ stacked.T + _block_diagonal(rests)
    return JointPosterior(
        tuple(names), np.concatenate(means), 0.5 * (joint + joint.T), of, findings
    )


def _block_diagonal(blocks: Sequence[Array]) -> Array:
    size = sum(len(block) for block in blocks)
    out, start = np.zeros((size, size)), 0
    for block in blocks:
        end = start + len(block)
        out[start:end, start:end] = block
        start = end
    return out


def _disagreement(shared: Sequence[str], away: Array, p: float, plane: Plane) -> Finding:
    worst = int(np.argmax(np.abs(away)))
    return Finding(
        code="planes-disagree",
        message=f"the planes contradict each other about {shared[worst]} by "
        f"{abs(away[worst]):.1f} standard deviations; the shared coefficients are those of the "
        f"{plane} plane, which are better determined",
        where=", ".join(shared),
        value=p,
        threshold=CONTRADICTED,
        remedy="One of the models lacks an effect on the speed, or the vehicle was changed "
        "between the trials.",
    )


def followed(joined: JointPosterior, models: Sequence[IdentifiedModel]) -> JointPosterior:
    """The joint posterior with the followers among its names, so that draws keep them equal."""
    for model in models:
        for c in model.coefficients:
            if c.origin == "kinematic" and LEADERS[c.symbol] in joined.names:
                k = joined.names.index(LEADERS[c.symbol])
                joined = replace(
                    joined,
                    names=(*joined.names, c.symbol),
                    mean=np.append(joined.mean, joined.mean[k]),
                    covariance=_repeated(joined.covariance, k),
                )
    return joined


def _repeated(covariance: Array, k: int) -> Array:
    """Covariance with the quantity k once more at the end."""
    take = [*range(len(covariance)), k]
    return covariance[np.ix_(take, take)]
