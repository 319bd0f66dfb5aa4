"""Exported equations against the program's own prediction."""

from types import ModuleType

import numpy as np
import pytest

from auvident.engines.carried import frame_of, vector_behind
from auvident.engines.prediction import at_effects, simulated
from auvident.errors import UsageError
from auvident.stages.export import EQUATION_FORMS, export
from tests.engines.chain import identified, setup_of

TRIALS = (("harbour_trial", "horizontal"), ("dive_trial", "vertical"))
CURRENT = {"id": "current", "internal": {"current.north_mps": 0.1, "current.east_mps": 0.0}}


def program(text: str) -> ModuleType:
    module = ModuleType("exported")
    exec(text, module.__dict__)
    return module


@pytest.mark.parametrize(("trial", "plane"), TRIALS)
def test_the_python_form_predicts_as_the_program_does(trial: str, plane: str) -> None:
    """In both planes, the servo included; the log before the maneuver leads its servo in."""
    model, setup = identified(trial, plane).model, setup_of(trial, plane)
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    raw, p, frame = record.source.raw, vector_behind(model), frame_of(model, setup.dt_s)
    acting = at_effects(frame, p, record)
    expected = simulated(frame, p, acting, np.ones(4, dtype=bool))
    module = program(export(model, "python"))
    fin = raw[0, 0]
    for ordered in raw[: len(raw) - len(record.time_s), 0]:
        _, fin = module.servo(fin, ordered, setup.dt_s)
    states = module.simulate(acting.start.tolist(), record.inputs[:, :3].tolist(), setup.dt_s, fin)
    np.testing.assert_allclose(states, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("form", EQUATION_FORMS)
def test_effects_without_such_a_form_are_refused_by_name(form: str) -> None:
    model = identified("harbour_trial").model
    model = model.model_copy(update={"effects": (*model.effects, CURRENT)})
    with pytest.raises(UsageError, match="current") as caught:
        export(model, form)
    assert "rudder_rate_limit" not in caught.value.problem
