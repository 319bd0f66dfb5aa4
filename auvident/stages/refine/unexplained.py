"""A force without a name: added where it predicts maneuvers that were left out, and only then."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import pandas as pd

from auvident.engines.carried import Carried, allowed
from auvident.schema.artifacts import CrossValidation, IdentifiedModel, Maneuvers, Metrics
from auvident.schema.diagnosis import (
    ChannelError,
    CrossValidated,
    ForceTried,
    HeldOut,
    UnexplainedForce,
)
from auvident.schema.effects import UNEXPLAINED, parameter_of
from auvident.schema.unexplained import products_of
from auvident.stages.refine.attempts import GUARDED, Identified, Made, make
from auvident.stages.refine.compare import pooled
from auvident.stages.refine.errors import cruise_of
from auvident.stages.refine.left_out import as_told

# Tried for the smallest left-out errors, in units of the prior of each product: from a force that
# hardly acts to one that the data alone hold.
SPREADS = (0.03, 0.1, 0.3, 1.0)


class Validated(Protocol):
    """What `validate` returns."""

    @property
    def simulation(self) -> pd.DataFrame:
        """Measured and simulated channels."""

    @property
    def metrics(self) -> Metrics:
        """Errors, with the cross-validation of the model."""


Model = TypeVar("Model", bound=Identified)
Prediction = TypeVar("Prediction", bound=Validated)


@dataclass(frozen=True)
class Base:
    """The model that a force is added to: what it carries, itself, and its prediction."""

    carried: Carried
    model: IdentifiedModel
    prediction: Validated

    @classmethod
    def of(
        cls,
        carried: Carried | None,
        nuisance: Sequence[str],
        model: IdentifiedModel,
        prediction: Validated,
    ) -> "Base":
        """A model with what it carries; without effects the nuisance parameters of its plan."""
        speed, _ = cruise_of(prediction.simulation)
        usual = allowed(nuisance, model.plane, model.length_m, speed)
        return cls(carried or usual, model, prediction)

    def with_force(self, spread: float, heading: bool) -> Carried:
        """What it carries and the force, its prior of a spread.

        Parameters
        ----------
        heading : bool
            Whether headings were logged; without them nothing follows the heading.
        """
        speed, rate = cruise_of(self.prediction.simulation)
        told = self.model.density_kgpm3, self.model.length_m, speed, rate
        stds = {}
        plane = self.model.plane
        for name, product in zip(UNEXPLAINED.names(plane), products_of(plane), strict=True):
            if heading or not product.follows_heading:
                declared = parameter_of(name)
                stds[name] = spread * declared.prior * declared.size_unit(*told)
        return self.carried.adding(stds)


def with_unexplained(
    base: Base,
    again: Callable[[Carried], tuple[Model, Prediction]],
    maneuvers: Maneuvers,
    *,
    heading: bool,
    seed: int = 0,
) -> tuple[Made[Model, Prediction] | None, UnexplainedForce]:
    """Add the force where left-out errors fall beyond chance; None where they do not.

    The spread of its prior is the one with the smallest left-out errors (cross-validated ridge
    regression). Held-out maneuvers have no part in that.
    """
    before = base.prediction.simulation
    made = [make(base.with_force(s, heading), base.model, before, again) for s in SPREADS]
    able = [k for k, one in enumerate(made) if _falls(one)]
    best = min(able, key=lambda k: made[k].tried.balance, default=None)
    tried = tuple(
        _tried(spread, one, k == best)
        for k, (spread, one) in enumerate(zip(SPREADS, made, strict=True))
    )
    if best is None:
        said = not_added([one.tried.left_out is not None for one in made])
        return None, UnexplainedForce(added=False, statement=said, tried=tried)
    chosen = made[best]
    assert chosen.found is not None
    after = chosen.found[1]
    errors = CrossValidated(
        before=base.prediction.metrics.cross_validation, after=after.metrics.cross_validation
    )
    held_out = pooled(maneuvers, before, after.simulation, "validate", seed)
    return chosen, UnexplainedForce(
        added=True,
        statement=predictable(errors, held_out),
        spread=SPREADS[best],
        tried=tried,
        left_out=errors,
        held_out=held_out,
    )


def _falls(made: Made[Model, Prediction]) -> bool:
    """Whether an attempt predicts maneuvers left out better, beyond chance."""
    change = made.tried.left_out
    return change is not None and not made.tried.is_lost and change.falls


def _tried(spread: float, made: Made[Model, Prediction], taken: bool) -> ForceTried:
    return ForceTried(
        spread=spread,
        ran_away=made.tried.is_lost and not made.tried.failed,
        failed=made.tried.failed,
        taken=taken,
        **as_told(made.tried.left_out),
    )


def predictable(left_out: CrossValidated, held_out: HeldOut) -> str:
    """What the force gains, in errors over the spread of what was measured."""
    pieces = [f"left-out {_changes(left_out.before, left_out.after)}"]
    if held_out.before and held_out.after:
        pieces.append(f"held-out {_changes(held_out.before, held_out.after)}")
    return f"An unnamed force improves the prediction: {'; '.join(pieces)} (NRMSE)."


def _changes(
    before: Mapping[str, CrossValidation] | Mapping[str, ChannelError],
    after: Mapping[str, CrossValidation] | Mapping[str, ChannelError],
) -> str:
    both = [c for c in GUARDED if c in before and c in after]
    return ", ".join(f"{c} {before[c].nrmse:.2g} to {after[c].nrmse:.2g}" for c in both)


def not_added(compared: Sequence[bool]) -> str:
    """Why no force was added."""
    why = (
        "it does not lower the errors of the maneuvers used for identification, each left out in "
        "turn, by more than chance"
        if any(compared)
        else "too few maneuvers can be left out in turn to tell whether the prediction improves"
    )
    return f"No unnamed force was added: {why}."
