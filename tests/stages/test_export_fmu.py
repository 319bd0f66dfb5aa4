"""The FMU: run by FMPy against the program's own prediction."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from auvident.engines.records import record_of, sensor_matrix
from auvident.engines.stretches import as_maneuver
from auvident.pipeline.exporting import export_model
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.effects import BY_ID
from auvident.schema.planes import BY_PLANE, PLANES, Plane
from auvident.schema.quoting import comment
from auvident.stages.export.contents import contents_of
from auvident.stages.export.fmu import SOURCE, fmu_files, library_name
from auvident.stages.simulate import simulate
from auvident.storage import fmu_file
from auvident.storage.artifacts import json_bytes
from auvident.storage.fmu_file import packed, with_library
from tests.engines.chain import identified, sample
from tests.engines.effects_world import DT, blank
from tests.stages.test_export import (
    EQUAL,
    GCC,
    NASTY,
    SINGLE,
    TRIALS,
    Case,
    case_of,
    in_python,
    named,
    with_effects,
)

fmpy = pytest.importorskip("fmpy", reason="fmpy is an extra: auvident[export]")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
FMU2Slave = pytest.importorskip("fmpy.fmi2").FMU2Slave
needs_compiler = pytest.mark.skipif(GCC is None, reason="no C compiler on this machine")
IN_FMU = {"speed_mps": "log_speed_mps", "depth_m": "log_depth_m"}
PLACES = {"horizontal": ["north_m", "east_m"], "vertical": ["ahead_m", "depth_m"]}


def written(model: IdentifiedModel, file: Path) -> Path:
    """The FMU of a model, with its library."""
    files, problem = with_library(fmu_files(model), f"sources/{SOURCE}", library_name(model))
    assert not problem
    file.write_bytes(packed(files))
    return file


class Flown:
    """An FMU step by step, as a master of co-simulation runs it."""

    def __init__(self, file: Path, folder: Path, start: dict[str, Any]) -> None:
        description = fmpy.read_model_description(str(file))
        self.numbers = {v.name: v.valueReference for v in description.modelVariables}
        fmpy.extract(str(file), str(folder))
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="test",
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        for name, value in start.items():
            self.set(name, value)
        self.slave.exitInitializationMode()

    def set(self, name: str, value: float | bool) -> None:
        put = self.slave.setBoolean if isinstance(value, bool) else self.slave.setReal
        put([self.numbers[name]], [value])

    def get(self, names: list[str]) -> list[float]:
        return list(self.slave.getReal([self.numbers[n] for n in names]))

    def over(self, inputs: dict[str, Any], outputs: list[str], dt_s: float) -> np.ndarray:
        """Outputs (n, k) at the start of every step of the inputs."""
        rows = []
        for k in range(len(next(iter(inputs.values())))):
            rows.append(self.get(outputs))
            for name, values in inputs.items():
                self.set(name, float(values[k]))
            self.slave.doStep(currentCommunicationPoint=k * dt_s, communicationStepSize=dt_s)
        return np.array(rows)

    def end(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


def in_fmu(model: IdentifiedModel, case: Case, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """States and place of a simulation without a log before it, in the identified current."""
    row, file = BY_PLANE[model.plane], written(model, folder / "model.fmu")
    known = {v.name for v in fmpy.read_model_description(str(file)).modelVariables}
    start = dict(zip((f"initial_{c}" for c in row.columns), case.start, strict=True))
    start |= {"elapsed_s": case.series["elapsed_s"], "log_given": True}
    if model.plane == "horizontal":
        water = contents_of(model).water.get("WATER", (0.0, 0.0))
        start |= dict(zip(("water_north_mps", "water_east_mps"), water, strict=True))
    columns = (*row.control_columns, "rate_rps")
    inputs = dict(zip(columns, np.transpose(case.inputs), strict=True))
    series = {IN_FMU.get(n, n): v for n, v in case.series.items() if n != "elapsed_s"}
    inputs |= {n: v for n, v in series.items() if n in known and n not in row.columns}
    flown = Flown(file, folder / "unpacked", {n: v for n, v in start.items() if n in known})
    found = flown.over(inputs, [*row.columns, *PLACES[model.plane]], case.dt_s)
    flown.end()
    return found[:, :4], found[:, 4:]


@needs_compiler
@pytest.mark.parametrize(("trial", "plane"), TRIALS)
def test_fmpy_flies_what_simulate_predicts(trial: str, plane: Plane, tmp_path: Path) -> None:
    """The first 90 s of the log: states, and in the horizontal plane the track over ground."""
    model, log = identified(trial, plane).model, sample(trial).trials[0]
    window = (-np.inf, float(log.table["time_s"].iloc[0]) + 90.0)
    table = simulate(model, log, window_s=window, samples=0, rng=np.random.default_rng(0))
    span = (float(table["time_s"].iloc[0]), float(table["time_s"].iloc[-1]))
    record = record_of(
        as_maneuver(log, plane, *span), log, plane, sensor_matrix(plane, model.sensing)
    )
    case = case_of(model, record, 1.0 / log.rate_hz)
    assert not case.before
    states, places = in_fmu(model, case, tmp_path)
    columns = list(BY_PLANE[plane].columns)
    table = table.iloc[: len(states)]
    np.testing.assert_allclose(states, table[columns].to_numpy(), rtol=0, atol=EQUAL)
    if plane == "horizontal":
        track = table[["north_m", "east_m"]].to_numpy()
        np.testing.assert_allclose(places, track, rtol=0, atol=EQUAL)


@needs_compiler
@pytest.mark.parametrize("plane", PLANES)
def test_what_becomes_of_a_command_acts_step_by_step(plane: Plane, tmp_path: Path) -> None:
    """Delay, play, servo, race, lagging propeller, falling thrust: as in the Python form."""
    every = [e for p, e in SINGLE if p == plane and BY_ID[e].enters == "input"]
    model = with_effects(plane, *every)
    case = replace(case_of(model, blank(300), DT), before=[])
    states, _ = in_fmu(model, case, tmp_path)
    np.testing.assert_allclose(states, in_python(model, case), rtol=0, atol=EQUAL)


@needs_compiler
def test_a_master_may_step_differently(tmp_path: Path) -> None:
    """A long step is divided, a state taken back, and inputs of a whole run given at once."""
    model = with_effects("horizontal", "rudder_delay", "rudder_rate_limit")
    file = written(model, tmp_path / "model.fmu")
    flown = Flown(file, tmp_path / "unpacked", {"initial_u_mps": 1.4})
    flown.set("rudder_rad", 0.2)
    flown.set("rate_rps", 16.0)
    kept = flown.slave.getFMUState()
    flown.slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=2.0)
    whole = flown.get(["u_mps", "r_radps", "north_m"])
    flown.slave.setFMUState(kept)
    flown.slave.freeFMUState(kept)
    for k in range(20):
        flown.slave.doStep(currentCommunicationPoint=0.1 * k, communicationStepSize=0.1)
    np.testing.assert_allclose(flown.get(["u_mps", "r_radps", "north_m"]), whole, atol=EQUAL)
    flown.end()
    signals = np.array([(0.0, 0.2, 16.0)], [(n, float) for n in ("time", "rudder_rad", "rate_rps")])
    result = fmpy.simulate_fmu(
        str(file), stop_time=2.0, input=signals, start_values={"initial_u_mps": 1.4}
    )
    np.testing.assert_allclose(result["u_mps"][-1], whole[0], atol=EQUAL)
    assert whole[1] < -0.01  # to port


def test_the_same_model_makes_the_same_bytes(tmp_path: Path) -> None:
    """And another model another GUID."""
    model = with_effects("horizontal", "rudder_lag")
    file = tmp_path / "model.json"
    file.write_bytes(json_bytes(model, "model"))
    first, again = (export_model(file, "fmu") for _ in range(2))
    assert first.content == again.content
    assert first.notes == ()
    other = with_effects("horizontal", "rudder_delay")
    assert guid_of(fmu_files(model)) != guid_of(fmu_files(other))


def guid_of(files: dict[str, bytes]) -> str:
    guid = ET.fromstring(files["modelDescription.xml"]).get("guid")
    assert guid and guid.encode() in files[f"sources/{SOURCE}"]
    return guid


def test_without_a_compiler_there_are_the_sources(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(fmu_file.shutil, "which", lambda name: None)
    file = tmp_path / "model.json"
    file.write_bytes(json_bytes(with_effects("vertical"), "model"))
    made = export_model(file, "fmu")
    (said,) = made.notes
    assert "no C compiler" in said and "fmpy compile" in said
    with zipfile.ZipFile(io.BytesIO(made.content)) as archive:
        assert archive.namelist() == ["modelDescription.xml", f"sources/{SOURCE}"]


def test_every_variable_has_a_unit_and_words() -> None:
    """FMPy finds no fault; the identified current is told and off."""
    model = with_effects("vertical", "current", "vertical_current", "weight_change")
    content = packed(fmu_files(model))
    description = fmpy.read_model_description(io.BytesIO(content))
    assert validate_fmu(io.BytesIO(content)) == []
    assert all(v.description for v in description.modelVariables)
    units = {v.name: v.unit for v in description.modelVariables if v.type == "Real"}
    assert units["elevator_rad"] == "rad" and units["rate_rps"] == "rev/s"
    assert units["q_radps"] == "rad/s" and units["elapsed_s"] == "s"
    water = next(v for v in description.modelVariables if v.name == "water_down_mps")
    assert "as identified" in water.description and float(water.start) == 0.0


@pytest.mark.parametrize("name", [*NASTY, "<a>&amp;]]>", "\x00\udcff\ufffe", "-->"])
def test_no_name_becomes_xml_or_c(name: str) -> None:
    """Only the name and what follows from it differ from the FMU of a plain name."""
    odd, plain = fmu_files(named(name)), fmu_files(named("REMUS 100"))
    root, usual = (ET.fromstring(f["modelDescription.xml"]) for f in (odd, plain))
    assert root.get("modelName") == f"{comment(name)}, horizontal plane"
    shapes = [[(e.tag, e.get("name")) for e in tree.iter()] for tree in (root, usual)]
    assert shapes[0] == shapes[1]
    assert library_name(named(name)).isidentifier() and library_name(named(name)).isascii()
    lines, others = (f[f"sources/{SOURCE}"].decode().splitlines() for f in (odd, plain))
    differing = [a for a, b in zip(lines, others, strict=True) if a != b]
    assert all(line.startswith(("// ", "#define GUID")) for line in differing)
