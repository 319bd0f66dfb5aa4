"""The identified model outside of its run: simulation, and export to other programs."""

import json
import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from tests.command_line import Called

WINDOW = ("--from", "1373", "--to", "1448")  # the last zigzag
STATES = ["u_mps", "v_mps", "r_radps", "heading_rad"]


@pytest.fixture
def simulated(demo: Path, auvident: Callable[..., Called]) -> pd.DataFrame:
    called = auvident(
        "simulate", demo, "--inputs", "sample_logs/harbour_trial", *WINDOW, "--output", "s.csv"
    )
    assert called.code == 0, called.err
    return pd.read_csv("s.csv")


def exported(demo: Path, auvident: Callable[..., Called]) -> ModuleType:
    assert auvident("export", demo, "--output", "model.py").code == 0
    module = ModuleType("model")
    exec(Path("model.py").read_text(), module.__dict__)
    return module


def inputs_of(demo: Path, start: float = 1373.0) -> list[tuple[float, float, float]]:
    table = pd.read_parquet(demo / "ingest" / "harbour_trial.parquet")
    rows = table[(table.time_s > start - 0.05) & (table.time_s < 1447.95)]
    return list(zip(rows.rudder_rad, rows.elevator_rad, rows.rpm / 60.0, strict=True))


def test_exported_python_reproduces_the_simulation(
    demo: Path, auvident: Callable[..., Called], simulated: pd.DataFrame
) -> None:
    """To 1e-9: the same equations and steps in another order of floating-point operations."""
    model, inputs = exported(demo, auvident), inputs_of(demo)
    before = inputs_of(demo, 1353.0)[: -len(inputs)]  # the servo is under way at the start
    states = model.simulate(simulated[STATES].iloc[0].tolist(), inputs, 0.1, before=before)
    assert len(states) == len(simulated) == 750
    np.testing.assert_allclose(states, simulated[STATES].to_numpy(), rtol=0, atol=1e-9)


def test_exported_matlab_has_the_same_equations(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """Its expressions are valid Python, too: evaluate both right-hand sides."""
    auvident("export", demo, "--output", "auvident_model.m")
    state, inputs = (1.4, 0.1, -0.2, 0.3), (0.2, 0.05, 14.0)
    scope: dict = {"cos": math.cos, "sin": math.sin, "x": (None, *state), "inputs": (None, *inputs)}
    text = Path("auvident_model.m").read_text().replace("...\n", "")
    _, _, equations = text.partition("function dx = derivative")
    for line in equations.partition("\nend")[0].splitlines():
        name, equals, value = line.rstrip(";").partition(" = ")
        if not equals or line.startswith("dx"):
            continue
        if value.startswith("["):
            rows = value.strip("[]").split(";")
            scope[name] = [[eval(e, scope) for e in row.split(",")] for row in rows]
        else:  # x(1) is x[1] with the numbering of MATLAB
            scope[name] = eval(re.sub(r"\b(x|inputs)\((\d)\)", r"\1[\2]", value), scope)
    rates = np.linalg.solve(scope["mass_matrix"], np.ravel(scope["force"]))
    expected = exported(demo, auvident).derivative(state, inputs)
    np.testing.assert_allclose([*rates, scope["r"]], expected, rtol=1e-12)


def test_what_an_export_leaves_out_is_said(demo: Path, auvident: Callable[..., Called]) -> None:
    """In the file and on standard error; the refined model keeps everything that acts."""
    model = json.loads((demo / "refine" / "model.json").read_text())
    for effect, name in (("gyro_bias", "bias_degps"), ("rudder_offset", "offset_deg")):
        internal = {f"{effect}.{name}": 0.01}
        model["effects"].append({"id": effect, "internal": internal})
    Path("with.json").write_text(json.dumps(model))
    for file in ("model.py", "auvident_model.m", "model.c"):
        called = auvident("export", "with.json", "--output", file)
        assert called.code == 0, called.err
        line = "Left out, as sensors do not move the vehicle: gyro_bias."
        assert line in called.err
        assert line in Path(file).read_text()
        assert "FIN_OFFSET_RAD = 0.01" in Path(file).read_text()
    assert Path("model.c").read_text().startswith(Path("model.h").read_text())
    assert "gyro_bias" not in auvident("export", "with.json", "--output", "model.toml").err


def test_exported_toml_is_a_table_of_a_vehicle_file(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    table = tomllib.loads(auvident("export", demo, "--format", "toml").out)["coefficients"]
    model = json.loads((demo / "refine" / "model.json").read_text())
    assert table == {
        c["symbol"]: {"value": c["value"], "std": c["std"]} for c in model["coefficients"]
    }
    text = Path("sample_logs/remus100.toml").read_text()
    Path("v.toml").write_text(text + auvident("export", demo, "--format", "toml").out)
    ase = json.loads(auvident("ase", "--vehicle", "v.toml", "--json").out)
    given = {c["symbol"]: c["value"] for c in ase["coefficients"] if c["origin"] == "given"}
    assert given == {symbol: row["value"] for symbol, row in table.items()}


def test_exported_json_is_the_model(demo: Path, auvident: Callable[..., Called]) -> None:
    model = json.loads((demo / "refine" / "model.json").read_text())
    assert json.loads(auvident("export", demo, "--format", "json").out) == model
    assert json.loads(auvident("export", demo / "refine" / "model.json", "--json").out) == model


def test_export_does_not_print_twice(demo: Path, auvident: Callable[..., Called]) -> None:
    called = auvident("export", demo, "--format", "csv")
    assert called.out.count("X_udot") == 1


def test_simulation_starts_at_the_measured_state_and_follows_the_log(
    demo: Path, simulated: pd.DataFrame
) -> None:
    measured = pd.read_parquet(demo / "ingest" / "harbour_trial.parquet").set_index("time_s")
    first = measured.loc[1373.0]
    assert simulated.u_mps[0] == pytest.approx(first.u_mps, abs=0.05)
    assert simulated.heading_rad[0] == pytest.approx(first.heading_rad, abs=0.02)
    r = measured.loc[1373.0:1447.95].r_radps.to_numpy()
    assert np.corrcoef(r, simulated.r_radps)[0, 1] > 0.9


def test_the_band_is_around_the_prediction_and_repeats_with_its_seed(
    demo: Path, auvident: Callable[..., Called], simulated: pd.DataFrame
) -> None:
    for state in STATES[:3]:
        assert (simulated[f"{state}_low"] <= simulated[f"{state}_high"]).all()
        inside = simulated[state].between(simulated[f"{state}_low"], simulated[f"{state}_high"])
        assert inside.mean() > 0.9  # the prediction is close to the median of the models
    arguments = ("simulate", demo, "--inputs", "sample_logs/harbour_trial", *WINDOW, "--json")
    again = json.loads(auvident(*arguments, "--seed", "0").out)["columns"]
    np.testing.assert_allclose(again["r_radps_high"], simulated["r_radps_high"], rtol=1e-12)
    other = json.loads(auvident(*arguments, "--seed", "1").out)["columns"]
    assert other["r_radps"] == again["r_radps"]
    assert other["r_radps_high"] != again["r_radps_high"]


def test_inputs_alone_start_on_a_straight_run(
    demo: Path, auvident: Callable[..., Called], tmp_path: Path
) -> None:
    log = tmp_path / "plan"
    log.mkdir()
    for sensor in ("rudder", "rpm"):
        text = Path(f"sample_logs/harbour_trial/{sensor}.csv").read_text()
        (log / f"{sensor}.csv").write_text(text)
    arguments = ("simulate", demo / "refine" / "model.json", "--inputs", log, *WINDOW)
    table = pd.read_csv(_stream(auvident(*arguments).out))
    model = exported(demo, auvident)
    steady = [table.u_mps[0], 0.0, 0.0, 0.0]
    assert table.u_mps[0] > 1.0
    assert model.derivative(steady, (0.0, 0.0, table.rpm[0] / 60))[0] == pytest.approx(0, abs=1e-9)
    table = pd.read_csv(_stream(auvident(*arguments, "--speed", "0.5").out))
    assert table.u_mps[0] == 0.5


def test_a_motion_beyond_what_was_flown_says_by_what(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    base = ("simulate", demo, "--inputs", "sample_logs/harbour_trial", *WINDOW, "--json")
    within = auvident(*base)
    assert json.loads(within.out)["extrapolation"] == {}
    assert "goes beyond" not in within.err
    flown = json.loads((demo / "refine" / "model.json").read_text())["flown"]
    slow = auvident(*base, "--speed", "0.2")
    found = json.loads(slow.out)["extrapolation"]
    assert found["u_low"]["identified"] == pytest.approx(flown["u_low"])
    assert 0.19 < found["u_low"]["reaches"] < 0.9 * flown["u_low"]
    assert "goes beyond the maneuvers used for identification: " in slow.err


def _stream(text: str) -> object:
    import io

    return io.StringIO(text)


def test_a_model_away_from_its_run_says_what_it_assumes(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    Path("model.json").write_bytes((demo / "refine" / "model.json").read_bytes())
    arguments = ("simulate", "model.json", "--inputs", "sample_logs/harbour_trial", *WINDOW)
    called = auvident(*arguments)
    assert called.code == 0
    assert "--vehicle" in called.err
    assert "--vehicle" not in auvident(*arguments, "--vehicle", "sample_logs/remus100.toml").err


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("simulate", "runs/none", "--inputs", "sample_logs/harbour_trial"), 4, "auvident ingest"),
        (("simulate", "runs/demo", "--inputs", "sample_logs/none"), 3, "no such file"),
        (("simulate", "none.json", "--inputs", "sample_logs/harbour_trial"), 3, "none.json"),
        (
            ("simulate", "runs/demo", "--inputs", "sample_logs/harbour_trial", "--from", "1e9"),
            2,
            "window",
        ),
        (("simulate", "runs/demo", "--inputs", "sample_logs"), 3, "several trials"),
        (("export", "runs/demo/run.json"), 4, "run.json"),
    ],
)
def test_wrong_input(
    demo: Path, auvident: Callable[..., Called], arguments: tuple[str, ...], code: int, word: str
) -> None:
    called = auvident(*arguments)
    assert called.code == code, called.err
    assert word in called.err
    assert called.out == ""
