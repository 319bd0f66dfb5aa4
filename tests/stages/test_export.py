"""Exported equations against the program's own prediction; names that stay names."""

import ast
import csv
import io
import re
import tomllib
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from auvident.engines.carried import frame_of, vector_behind
from auvident.engines.prediction import at_effects, simulated
from auvident.errors import UsageError
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from auvident.stages.export import EQUATION_FORMS, export
from tests.engines.chain import identified, sample, setup_of

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


def test_constants_stand_in_every_form() -> None:
    """In the table for a vehicle file they are what the next identification starts from."""
    model = identified("dive_trial", "vertical").model
    told = {c.symbol: c for c in model.constants}
    rows = {row["symbol"]: row for row in csv.DictReader(io.StringIO(export(model, "csv")))}
    known = tomllib.loads(export(model, "toml"))["coefficients"]
    for symbol, c in told.items():
        assert (float(rows[symbol]["value"]), rows[symbol]["prime"]) == (c.value, "")
        assert known[symbol] == {"value": c.value, "std": c.std}
    file = sample("dive_trial").vehicle.model_dump(by_alias=True)
    again = estimate(Vehicle.model_validate(file | {"coefficients": known}))
    assert {c.symbol: c.value for c in again.constants} == {s: c.value for s, c in told.items()}
    module = program(export(model, "python"))
    assert module.weight_less_buoyancy == told["W-B"].value
    assert module.z_g_weight == told["z_GW"].value and module.trim_moment == told["x_GW"].value


@pytest.mark.parametrize("form", EQUATION_FORMS)
def test_effects_without_such_a_form_are_refused_by_name(form: str) -> None:
    model = identified("harbour_trial").model
    model = model.model_copy(update={"effects": (*model.effects, CURRENT)})
    with pytest.raises(UsageError, match="current") as caught:
        export(model, form)
    assert "rudder_rate_limit" not in caught.value.problem


# What ends a string, a comment or a line somewhere, and what begins something.
NAMES = st.text() | st.text(alphabet="\"'\\#%*/{}$\n\r\t\x00\x0b\x85\u2028\u202e= ax", max_size=40)
NASTY = [
    'REMUS"""\nimport os\nos.abort()\n"""',
    "\\",
    "x\\",
    '"""',
    "\\N{DASH}",
    "a\rb = 1;",
    "%{\n%}",
    "x\n[coefficients]\nX_uu = 1",
    "\x85\u2028",
    "...",
]


def named(name: str, **changes: object) -> IdentifiedModel:
    """The model of a vehicle of any name."""
    return identified("harbour_trial").model.model_copy(update={"vehicle": name, **changes})


def with_each(names: list[str]) -> Callable:
    """The names as examples of a property."""

    def decorate(test: Callable) -> Callable:
        for name in names:
            test = example(name)(test)
        return settings(max_examples=60, deadline=None)(test)

    return decorate


@with_each(NASTY)
@given(NAMES)
def test_no_name_becomes_python(name: str) -> None:
    """Only the docstring differs from the program of a vehicle with a plain name."""
    tree, plain = (ast.parse(export(named(n), "python")) for n in (name, "REMUS 100"))
    title = tree.body[0]
    assert isinstance(title, ast.Expr)
    assert isinstance(title.value, ast.Constant)
    assert title.value.value.startswith(f"{name}: model of the horizontal plane")
    assert [ast.dump(n) for n in tree.body[1:]] == [ast.dump(n) for n in plain.body[1:]]
    kinds = (ast.ImportFrom, ast.Assign, ast.FunctionDef)
    assert all(isinstance(node, kinds) for node in tree.body[1:])


@with_each(NASTY)
@given(NAMES)
def test_no_name_becomes_matlab(name: str) -> None:
    text, plain = (export(named(n), "matlab") for n in (name, "REMUS 100"))
    lines = text.replace("...\n", "").splitlines()
    assignment = re.compile(r"[A-Za-z_]\w* = .*;")
    assert lines[0] == "function dx = auvident_model(x, inputs)"
    assert lines[-1] == "end"
    assert all(line.startswith("% ") or assignment.fullmatch(line) for line in lines[1:-1])
    assert lines[:1] + lines[2:] == [
        line for line in plain.replace("...\n", "").splitlines() if "REMUS" not in line
    ]


@with_each(NASTY)
@given(NAMES)
def test_no_name_becomes_toml(name: str) -> None:
    """The comment has it as TOML writes a string."""
    effect = {"id": name, "internal": {}}
    text = export(named(name, effects=(effect,)), "toml")
    assert tomllib.loads(text) == tomllib.loads(export(named("REMUS 100"), "toml"))
    written, told, _ = text.splitlines()[0].removeprefix("# ").rpartition(": model of the")
    assert told
    assert tomllib.loads(f'name = "{written}"') == {"name": name}


@with_each(NASTY)
@given(NAMES)
def test_no_symbol_or_unit_of_a_model_file_becomes_toml_or_csv(text: str) -> None:
    model = named("REMUS 100")
    odd = model.coefficients[0].model_copy(update={"symbol": f"X{text}", "unit": text})
    model = model.model_copy(update={"coefficients": (odd, *model.coefficients[1:])})
    table = tomllib.loads(export(model, "toml"))["coefficients"]
    assert table[f"X{text}"] == {"value": odd.value, "std": odd.std}
    assert len(table) == len(model.coefficients)
    rows = list(csv.DictReader(io.StringIO(export(model, "csv"), newline="")))
    assert (rows[0]["symbol"], rows[0]["unit"]) == (f"X{text}", text)
    assert [row["symbol"] for row in rows] == [c.symbol for c in model.coefficients]
    assert float(rows[0]["value"]) == odd.value
