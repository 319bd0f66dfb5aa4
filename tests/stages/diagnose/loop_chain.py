"""The sample trials from log to diagnosis, each once per session."""

from dataclasses import dataclass, replace

from auvident.engines.setup import Setup
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.diagnosis import Diagnosis
from auvident.stages.diagnose.fit.case import Case, case_of
from auvident.stages.diagnose.fit.fits import Fitted, first_colours, fit_with
from auvident.stages.diagnose.stage import Diagnosed, diagnose
from auvident.stages.identify import without_held_out
from tests.engines.chain import Chain, identified, sample
from tests.session import once

KINDS = ("straight", "turn", "zigzag")


@dataclass(frozen=True)
class Loop:
    """What stands before a diagnosis."""

    chain: Chain
    setup: Setup
    model: IdentifiedModel

    def diagnose(self) -> Diagnosed:
        c = self.chain
        seen = [without_held_out(t, c.maneuvers, "horizontal") for t in c.trials]
        return diagnose(seen, c.maneuvers, c.vehicle, self.setup, self.model)


@once
def loop(name: str) -> Loop:
    chain = sample(name)
    setup = chain.setup()
    return Loop(chain, setup, identified(name).model)


@once
def diagnosed(name: str) -> Diagnosed:
    return loop(name).diagnose()


def diagnosis(name: str) -> Diagnosis:
    return diagnosed(name).diagnosis


@once
def small_case() -> Case:
    """A straight run, two turns and two zigzags of the harbour, no sensor checks.

    The first and the last of a kind: a zigzag of 20 degrees and one of 10.
    """
    made = loop("harbour_trial")
    whole = case_of(made.setup, made.model, [])
    of_kind = {k: [r for r in whole.records if whole.kinds[r.id] == k] for k in KINDS}
    turns, zigzags = of_kind["turn"], of_kind["zigzag"]
    chosen = (of_kind["straight"][0], turns[0], turns[-1], zigzags[0], zigzags[-1])
    return replace(whole, records=chosen)


@once
def small_fit() -> Fitted:
    """`small_case` fitted without effects."""
    case = small_case()
    p = case.at_rest(case.identified)
    found = fit_with(case, (), p, first_colours(case, p))
    assert found is not None
    return found
