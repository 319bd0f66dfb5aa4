"""Exported equations against the program's own prediction; names that stay names."""

import ast
import csv
import ctypes
import inspect
import io
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from auvident.engines.carried import frame_of, over_ground, vector_behind
from auvident.engines.prediction import at_effects, simulated
from auvident.engines.records import Record, Source
from auvident.errors import UsageError
from auvident.physics.actuation import COMMAND
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.effects import BY_ID, EFFECTS, UNEXPLAINED
from auvident.schema.planes import BY_PLANE, PLANES, Plane
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from auvident.stages.export import EQUATION_FORMS, export, header_of, remarks_on
from auvident.stages.export.contents import ACTUATION
from tests.engines.chain import identified, sample, setup_of
from tests.engines.effects_world import DT, blank

TRIALS = (("harbour_trial", "horizontal"), ("dive_trial", "vertical"))
TRIAL_OF = {plane: trial for trial, plane in TRIALS}
# Rounding: the same operations, powers and products of coefficients in another order.
EQUAL = 1e-9
# Of what would make a vehicle run away when all of it pushed.
SHARES = {"cubic_damping": -0.1, "unexplained_force": -0.1}
INSTANTS = {"time_s": 208.0, "over_s": 3.7}  # within the records of `blank`, which begin at 200 s
SIZES = (1025.0, 1.6, 1.4, 16.0)  # density, length, speed and propeller rate of these vehicles


GCC = shutil.which("gcc") or shutil.which("cc")
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")


@dataclass
class Case:
    """A simulation: what it takes, and the states that the program predicts."""

    start: list[float]
    inputs: list[list[float]]
    before: list[list[float]]
    dt_s: float
    series: dict
    expected: np.ndarray


def program(text: str) -> ModuleType:
    module = ModuleType("exported")
    exec(text, module.__dict__)
    return module


def at_usual_size(effect: str, plane: Plane) -> dict:
    """The effect with what is expected of it before the data, as it stands in a model."""
    internal = {
        f"{effect}.{p.symbol}": INSTANTS.get(
            p.symbol, SHARES.get(effect, 1.0) * p.prior * p.size_unit(*SIZES)
        )
        for p in BY_ID[effect].parameters
        if plane in p.planes
    }
    return {"id": effect, "internal": internal}


def with_effects(plane: Plane, *effects: str) -> IdentifiedModel:
    """The model of a sample without its own effects, and with these."""
    model = identified(TRIAL_OF[plane], plane).model
    return model.model_copy(update={"effects": tuple(at_usual_size(e, plane) for e in effects)})


def series_of(source: Source, lead: int) -> dict:
    """What the log has beside the inputs, by the names in a program."""
    depth = np.zeros(len(source.raw)) if source.depth is None else source.depth
    whole = {
        "speed_mps": source.speed,
        "roll_rad": source.roll,
        "pitch_rad": source.pitch,
        "depth_m": depth,
    }
    own = {name: values[lead:].tolist() for name, values in whole.items()}
    return own | {"elapsed_s": float(source.elapsed_s[lead])}


def case_of(model: IdentifiedModel, record: Record, dt_s: float) -> Case:
    """What a simulation takes, and the states as the program predicts them."""
    p, frame, source = vector_behind(model), frame_of(model, dt_s), record.source
    acting = at_effects(frame, p, record)
    expected = simulated(frame, p, acting, np.ones(4, dtype=bool))
    assert np.isfinite(expected).all()
    lead, rows = len(source.raw) - len(record.time_s), source.raw.tolist()
    series = series_of(source, lead)
    turned_back = [[angle, *rows[0][1:]] for angle in ([] if source.past is None else source.past)]
    before = turned_back + rows[:lead]
    return Case(acting.start.tolist(), rows[lead:], before, dt_s, series, expected)


def in_python(model: IdentifiedModel, case: Case) -> np.ndarray:
    """States as the exported module predicts them."""
    module = program(export(model, "python"))
    known = inspect.signature(module.simulate).parameters
    series = {n: v for n, v in case.series.items() if n in known}
    return np.array(
        module.simulate(case.start, case.inputs, case.dt_s, before=case.before, **series)
    )


def in_octave(cases: list[tuple[IdentifiedModel, Case]], folder: Path) -> list[np.ndarray]:
    """States as the exported functions predict them, all in one process."""
    script = []
    for k, (model, case) in enumerate(cases):
        home = folder / str(k)
        home.mkdir()
        (home / "auvident_model.m").write_text(export(model, "matlab"))
        for name, value in (vars(case) | case.series).items():
            if name != "series":
                np.savetxt(home / f"{name}.txt", np.atleast_1d(value), fmt="%.17g")
        script += [f"cd {home}", "clear all", "options = struct();"]
        script += [f"options.{n} = load('{n}.txt');" for n in ("before", *case.series)]
        arguments = "load('start.txt'), load('inputs.txt'), load('dt_s.txt'), options"
        script += [f"states = auvident_model({arguments});"]
        script += [
            "f = fopen('states.txt', 'w'); fprintf(f, '%.17g %.17g %.17g %.17g\\n', states');"
        ]
        script += ["fclose(f);"]
    (folder / "run.m").write_text("\n".join(script) + "\n")
    command = [OCTAVE, "--no-gui", "--norc", "--quiet", str(folder / "run.m")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [np.loadtxt(folder / str(k) / "states.txt") for k in range(len(cases))]


class Options(ctypes.Structure):
    """``auvident_options`` of the header."""

    _fields_ = (
        ("fin_given", ctypes.c_int),
        ("fin", ctypes.c_double),
        ("before", ctypes.c_size_t),
        ("elapsed_s", ctypes.c_double),
        *((n, ctypes.c_void_p) for n in ("speed_mps", "roll_rad", "pitch_rad", "depth_m")),
    )


def in_c(model: IdentifiedModel, case: Case, file: Path) -> np.ndarray:
    """States as the exported functions predict them."""
    file.write_text(export(model, "c"))
    library, strict = file.with_suffix(".so"), ("-std=c99", "-pedantic", "-Wall", "-Wextra")
    command = [GCC, *strict, "-Werror", "-shared", "-fPIC", "-o", library, file, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    kept = {n: np.array(v) for n, v in case.series.items() if n != "elapsed_s"}
    series = {n: v.ctypes.data for n, v in kept.items()}
    elapsed = case.series["elapsed_s"]
    options = Options(before=len(case.before), elapsed_s=elapsed, **series)
    inputs, states = np.array([*case.before, *case.inputs]), np.zeros((len(case.inputs), 4))
    start, pointer = np.array(case.start), ctypes.c_void_p
    ctypes.CDLL(str(library)).auvident_simulate(
        pointer(start.ctypes.data),
        pointer(inputs.ctypes.data),
        ctypes.c_size_t(len(states)),
        ctypes.c_double(case.dt_s),
        ctypes.byref(options),
        pointer(states.ctypes.data),
    )
    return states


def both_ways(model: IdentifiedModel, record: Record, dt_s: float) -> tuple[np.ndarray, ...]:
    """States as the exported module predicts them, and as the program does."""
    case = case_of(model, record, dt_s)
    return in_python(model, case), case.expected


@pytest.mark.parametrize(("trial", "plane"), TRIALS)
def test_the_python_form_predicts_as_the_program_does(trial: str, plane: Plane) -> None:
    """In both planes; the log before the maneuver leads servo, delay and play in."""
    model, setup = identified(trial, plane).model, setup_of(trial, plane)
    assert model.effects
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    np.testing.assert_allclose(*both_ways(model, record, setup.dt_s), rtol=0, atol=EQUAL)


@pytest.mark.skipif(OCTAVE is None, reason="no Octave on this machine (Debian: octave-cli)")
def test_the_matlab_form_predicts_as_the_program_does(tmp_path: Path) -> None:
    """Each effect alone, all of the actuation together, and the samples as identified."""
    cases = []
    for trial, plane in TRIALS:
        model, setup = identified(trial, plane).model, setup_of(trial, plane)
        record = next(r for kind, r in setup.records.values() if kind == "zigzag")
        cases.append((model, case_of(model, record, setup.dt_s)))
        effects = [e.id for e in EFFECTS if plane in e.planes and e.enters == "input"]
        for names in (*((e,) for p, e in SINGLE if p == plane), effects):
            model = with_effects(plane, *names)
            cases.append((model, case_of(model, blank(60), DT)))
    for states, (_, case) in zip(in_octave(cases, tmp_path), cases, strict=True):
        np.testing.assert_allclose(states, case.expected, rtol=0, atol=EQUAL)


@pytest.mark.skipif(GCC is None, reason="no C compiler on this machine")
@pytest.mark.parametrize("plane", PLANES)
def test_the_c_form_predicts_as_the_program_does(plane: Plane, tmp_path: Path) -> None:
    """Without effects, with a servo of each kind, with everything, and as identified."""
    fin = "rudder" if plane == "horizontal" else "elevator"
    every = [e for p, e in SINGLE if p == plane]
    actuation = [e for e in every if BY_ID[e].enters == "input"]
    kinds = ((), (f"{fin}_lag",), (f"{fin}_rate_limit", f"{fin}_delay"), actuation, every)
    cases = [(m, case_of(m, blank(400), DT)) for m in (with_effects(plane, *k) for k in kinds)]
    setup, model = setup_of(TRIAL_OF[plane], plane), identified(TRIAL_OF[plane], plane).model
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    cases.append((model, case_of(model, record, setup.dt_s)))
    for k, (model, case) in enumerate(cases):
        states = in_c(model, case, tmp_path / f"model{k}.c")
        np.testing.assert_allclose(states, case.expected, rtol=0, atol=EQUAL)


def test_the_header_stands_in_the_c_file() -> None:
    model = with_effects("vertical", "current", "vertical_current")
    assert export(model, "c").startswith(header_of(model))
    assert "auvident_over_ground" in header_of(model)


SINGLE = [(plane, e.id) for plane in PLANES for e in (*EFFECTS, UNEXPLAINED) if plane in e.planes]
IN_MOTION = ("input", "force")


@pytest.mark.parametrize(("plane", "effect"), SINGLE)
def test_each_effect_acts_as_in_the_program(plane: Plane, effect: str) -> None:
    """What moves the vehicle changes its states; what does not is left out, and said."""
    model, record = with_effects(plane, effect), blank(400)
    states, expected = both_ways(model, record, DT)
    np.testing.assert_allclose(states, expected, rtol=0, atol=EQUAL)
    without, _ = both_ways(model.model_copy(update={"effects": ()}), record, DT)
    moved = np.abs(states[1:] - states[0] - without[1:] + without[0]).max()
    if BY_ID[effect].enters in IN_MOTION:
        assert moved > 1e-5
        assert remarks_on(model, "python") == ()
    else:
        (line,) = remarks_on(model, "python")
        assert effect in line
        assert line in " ".join(export(model, "python").split())


@pytest.mark.parametrize("plane", PLANES)
def test_all_effects_together_act_as_in_the_program(plane: Plane) -> None:
    """For three minutes; pulled at by all forces at once, not every vehicle would be stable."""
    effects = [e.id for e in EFFECTS if plane in e.planes and e.enters == "input"]
    model = with_effects(plane, *effects)
    np.testing.assert_allclose(*both_ways(model, blank(1800), DT), rtol=0, atol=EQUAL)


@pytest.mark.parametrize("plane", PLANES)
def test_a_play_remembers_where_the_fin_was_turned_back_before_the_log_leads_in(plane) -> None:
    model, record = with_effects(plane, f"{BY_PLANE[plane].fins[0]}_backlash"), blank(400)
    assert record.source is not None
    amidships = record.source.raw * np.array([0.0, 1.0, 1.0])
    record = replace(record, source=replace(record.source, raw=amidships))
    past = replace(record, source=replace(record.source, past=np.array([0.0, 0.3, 0.0])))
    states, expected = both_ways(model, past, DT)
    np.testing.assert_allclose(states, expected, rtol=0, atol=EQUAL)
    assert np.abs(states - both_ways(model, record, DT)[0]).max() > 1e-3


def test_everything_that_becomes_of_a_command_has_a_constant() -> None:
    places = {place for _, _, place, _ in ACTUATION}
    assert {name for k, name in enumerate(COMMAND) if k not in places} == {"T_nn", "T_nu"}


def test_only_what_a_model_needs_is_written() -> None:
    plain = program(export(with_effects("horizontal"), "python"))
    names = {"delayed", "propeller", "fallen", "over_ground", "water"}
    assert not names & set(vars(plain))
    assert plain.servo(0.1, 0.2, 0.1) == (0.2, 0.2)
    full = program(
        export(with_effects("horizontal", *(e for p, e in SINGLE if p == "horizontal")), "python")
    )
    assert names <= set(vars(full))


@pytest.mark.parametrize("plane", PLANES)
def test_water_is_off_until_asked_for(plane: Plane) -> None:
    currents = [e for p, e in SINGLE if p == plane and "current" in e]
    model, record = with_effects(plane, *currents), blank(50)
    p, frame, module = vector_behind(model), frame_of(model, DT), program(export(model, "python"))
    states = np.tile(record.start, (50, 1)) + np.linspace(0.0, 0.1, 50)[:, None]
    expected = over_ground(frame, p, record, states)
    assert module.over_ground(states[0].tolist()) == states[0].tolist()
    middle, heading = record.source.from_middle_s, record.source.heading
    for k, state in enumerate(states):
        args = module.water(middle[k]) if plane == "horizontal" else (heading[k], *module.WATER)
        np.testing.assert_allclose(module.over_ground(state, *args), expected[k], atol=1e-12)


def test_the_start_of_the_servo_and_the_speed_can_be_given() -> None:
    """Without a log of the speed that of the start counts, as the program has it."""
    model, record = with_effects("horizontal", "rudder_lag", "propeller_race"), blank(100)
    module = program(export(model, "python"))
    state, rows = [1.4, 0.0, 0.0, 0.0], record.source.raw.tolist()
    by_default = module.simulate(state, rows, DT)
    assert by_default == module.simulate(state, rows, DT, rows[0][0], (), [1.4] * len(rows))
    assert by_default != module.simulate(state, rows, DT, 0.3)
    assert by_default != module.simulate(state, rows, DT, speed_mps=[1.0] * len(rows))


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
def test_effects_of_another_version_are_refused_by_name(form: str) -> None:
    model = with_effects("horizontal", "rudder_lag")
    odd = {"id": "bow_thruster", "internal": {}}
    with pytest.raises(UsageError, match="bow_thruster") as caught:
        export(model.model_copy(update={"effects": (*model.effects, odd)}), form)
    assert "rudder_lag" not in caught.value.problem
    for lost in (float("nan"), "1", None, 10**400):
        effect = {"id": "rudder_lag", "internal": {"rudder_lag.lag_s": lost}}
        with pytest.raises(UsageError, match=r"rudder_lag\.lag_s is not a finite number"):
            export(model.model_copy(update={"effects": (effect,)}), form)
    with pytest.raises(UsageError, match="rudder_lag is not a finite number"):
        export(model.model_copy(update={"effects": ({"id": "rudder_lag"},)}), form)


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
    """Only one line of comment differs from the function of a vehicle with a plain name."""
    lines, plain = (export(named(n), "matlab").splitlines() for n in (name, "REMUS 100"))
    assert lines[0] == "function out = auvident_model(x, inputs, dt_s, options)"
    assert lines[1].startswith("% ")
    assert lines[:1] + lines[2:] == plain[:1] + plain[2:]


@with_each(NASTY)
@given(NAMES)
def test_no_name_becomes_c(name: str) -> None:
    """Only the first line differs, a comment that does not go on in the next one."""
    lines, plain = (export(named(n), "c").splitlines() for n in (name, "REMUS 100"))
    assert lines[0].startswith("// ")
    assert not lines[0].endswith(("\\", "??/"))
    assert lines[1:] == plain[1:]


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
