"""`export` to simulators from a finished run: files, what they cannot hold, what that costs."""

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from auvident.schema.planes import BY_PLANE
from tests.command_line import Called

NUMBERS = re.compile(r"([uvr]|heading) ([\d.e-]+) to ([\d.e-]+) (m/s|rad/s|deg)")


@pytest.mark.parametrize("form", ["gz", "uuv"])
def test_a_simulator_is_told_what_its_file_costs(
    form: str, completed: Path, tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    """The model's own errors are those of the last stage; the file says what the terminal says."""
    run, file = completed / "runs" / "demo", tmp_path / "model.sdf"
    called = auvident("export", run, "--format", form, "--output", file)
    assert called.code == 0, called.err
    said, text = " ".join(called.err.split()), " ".join(file.read_text().split())
    (line,) = re.findall(r"What that costs on .*? deg\.", said)
    assert line in text and "Left out: " in text
    comparison = json.loads((run / "refine" / "comparison.json").read_text())
    after, found = comparison["held_out"]["after"], NUMBERS.findall(line)
    assert [name for name, *_ in found] == [s.symbol for s in BY_PLANE["horizontal"].states]
    for name, own, theirs, _ in found[:3]:
        assert float(own) == pytest.approx(after[name]["rmse"], rel=0.05)
        assert float(own) * 0.9 < float(theirs) < 20.0 * float(own)


def test_a_class_and_an_fmu_come_from_a_run(
    completed: Path, tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    run = completed / "runs" / "demo"
    called = auvident("export", run, "--format", "pvs")
    assert called.code == 0 and "class AuvREMUS100:" in called.out
    assert auvident("export", run, "--output", tmp_path / "remus100.fmu").code == 0
    with zipfile.ZipFile(tmp_path / "remus100.fmu") as archive:
        assert "modelDescription.xml" in archive.namelist()


def test_what_cannot_be_written_is_said_with_the_reason(
    completed: Path, auvident: Callable[..., Called]
) -> None:
    run = completed / "runs" / "demo"
    called = auvident("export", run, "--format", "fmu")
    assert called.code == 2 and "--output" in called.err
    called = auvident("export", run, "--format", "stonefish")
    assert called.code == 2 and "no hydrodynamic derivatives" in " ".join(called.err.split())


def test_a_vehicle_file_is_exported_by_its_geometry(
    completed: Path, tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    """Of six degrees of freedom, and without a run there is nothing to hold it against."""
    vehicle, file = completed / "sample_logs" / "remus100.toml", tmp_path / "remus100.sdf"
    called = auvident("export", vehicle, "--output", file)
    assert called.code == 0, called.err
    assert "in a run directory" in " ".join(called.err.split())
    assert "rudder_joint" in file.read_text() and "elevator_joint" in file.read_text()


@pytest.mark.parametrize("form", ["pvs", "gz", "uuv"])
def test_a_file_says_whether_its_model_was_identified(
    form: str, completed: Path, whole: Path, tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    """Behind that of a vehicle file is no trial; what the file states is told apart."""
    vehicle, given = completed / "sample_logs" / "remus100.toml", tmp_path / "given.toml"
    stated = "\n[coefficients]\nN_uud = { value = -9.0, std = 0.1 }\n"
    given.write_text(vehicle.read_text() + stated)
    for target, words in (
        (vehicle, "estimated from geometry by auvident"),
        (given, "estimated from geometry and given coefficients by auvident"),
        (whole, "identified by auvident"),
        (completed / "runs" / "demo", "identified by auvident"),
    ):
        called = auvident("export", target, "--format", form)
        assert called.code == 0, called.err
        assert words in " ".join(called.out.split())
        assert ("identified" in called.out) is words.startswith("identified")


@pytest.fixture
def whole(completed: Path, tmp_path: Path, auvident: Callable[..., Called]) -> Path:
    """A combined model in a file."""
    file = tmp_path / "whole.json"
    assert auvident("combine", completed / "runs" / "demo", "--output", file).code == 0
    return file


def test_a_model_of_both_planes_is_in_no_form_of_one(
    whole: Path, completed: Path, auvident: Callable[..., Called]
) -> None:
    """Neither a combined model nor a vehicle file; the forms that there are, are named."""
    for target in (whole, completed / "sample_logs" / "remus100.toml"):
        for options, form in (
            (("--format", "python"), "python"),
            (("--format", "fmu"), "fmu"),
            (("--format", "toml", "--plane", "horizontal"), "toml"),
            ((), "json"),
        ):
            called = auvident("export", target, *options)
            assert called.code == 2, called.err
            assert f"{form} is no form of a model of six degrees of freedom" in called.err
            assert "One of pvs, gz, uuv" in called.err
        called = auvident("export", target, "--format", "gz", "--plane", "vertical")
        assert called.code == 2 and "is exported whole" in called.err and "--plane" in called.err


def test_a_combined_model_is_not_combined_again(
    whole: Path, auvident: Callable[..., Called]
) -> None:
    called = auvident("combine", whole)
    assert called.code == 3
    assert "is a combined model already" in called.err and "Give run directories" in called.err
