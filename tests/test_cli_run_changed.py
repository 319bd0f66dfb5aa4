"""Runs in which artifacts were deleted or damaged by hand: what commands say, and advise."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import Called

NOT_REFINED = "the identified model is taken in place of the refined one"
AGAIN = "`auvident run --run runs/demo` makes it again"
HALF = 300  # bytes of an artifact that a copy left


def test_a_model_without_its_refinement_says_so(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """Whoever deletes `refine` has the identified model again, but not without a word."""
    commands = (
        ("export", demo, "--format", "toml"),
        ("simulate", demo, "--maneuver", "zigzag:10/10", "--samples", "2"),
        ("combine", demo),
        ("compare", demo, demo),
        ("pool", demo),
        ("plan-trial", demo),
    )
    assert all(NOT_REFINED not in auvident(*command).err for command in commands[:3])
    shutil.rmtree(demo / "refine")
    for command in commands:
        called = auvident(*command)
        assert called.code == 0, called.err
        told = " ".join(called.err.split())
        assert f"{NOT_REFINED}: refine/model.json is missing. {AGAIN}" in told
        assert NOT_REFINED not in called.out
    reported = auvident("report", demo)
    told = " ".join(reported.err.split())
    assert reported.code == 0
    assert f"report does without refine, which is stale: refine/model.json is missing. {AGAIN}" in (
        told
    )


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("identify/model.json", ("export", "--format", "toml")),
        ("refine/model.json", ("export", "--format", "toml")),
        ("identify/model.json", ("pool",)),
        ("ingest/vehicle.json", ("combine",)),
        ("ingest/quality.json", ("pool",)),
        ("segment/maneuvers.json", ("combine",)),
        ("ase/coefficients.json", ("simulate", "--maneuver", "zigzag:10/10", "--samples", "2")),
    ],
)
def test_a_damaged_artifact_is_told_with_what_makes_it_again(
    name: str, command: tuple[str, ...], demo: Path, auvident: Callable[..., Called]
) -> None:
    file = demo / name
    file.write_bytes(file.read_bytes()[:HALF])
    called = auvident(command[0], demo, *command[1:])
    told = " ".join(called.err.split())
    if name.startswith("refine"):
        assert called.code == 0 and f"{name} was changed after it was written" in told
    else:
        assert called.code == 4 and f"{name}: is damaged" in told
    assert AGAIN in told


def test_the_command_for_a_stale_stage_has_the_options_of_its_last_run(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """Without them the stage made another model than the one that was stale."""
    vehicle = ("--vehicle", "sample_logs/remus100.toml")
    fast = ("--rate", "5", "--max-gap", "4", "--run", demo)
    assert auvident("ingest", "sample_logs/harbour_trial", *vehicle, *fast).code == 0
    assert auvident("segment", demo, "--hold-out", "harbour_trial-turn-4").code == 0
    quality, maneuvers = demo / "ingest" / "quality.json", demo / "segment" / "maneuvers.json"
    kept = quality.read_bytes()
    quality.write_bytes(kept + b" ")
    said = "--vehicle sample_logs/remus100.toml --rate 5.0 --max-gap 4.0 --run runs/demo` first"
    assert said in " ".join(auvident("ase", demo).err.split())
    quality.write_bytes(kept)
    maneuvers.write_bytes(maneuvers.read_bytes() + b" ")
    assert auvident("ase", demo).code == 0
    said = "`auvident segment runs/demo --hold-out harbour_trial-turn-4` first"
    assert said in " ".join(auvident("identify", demo).err.split())


def test_a_damaged_model_outside_of_a_run_has_a_remedy(
    tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    file = tmp_path / "model.json"
    file.write_text('{"schema": ')
    called = auvident("export", file, "--format", "toml")
    assert called.code == 4 and "Give a model.json that auvident has written." in called.err


def test_a_model_of_a_vehicle_that_the_run_has_no_more_is_not_flown_with_other_signs(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """`ingest` of another vehicle's log leaves the model, and takes the signs that it had."""
    tern = ("--vehicle", "sample_logs/tern180.toml")
    assert auvident("ingest", "sample_logs/bay_trial", *tern, "--run", demo).code == 0
    inputs = ("--inputs", "sample_logs/harbour_trial", "--from", "1373", "--to", "1380")
    command = ("simulate", demo, *inputs, "--samples", "0", "--output", "flown.csv")
    called = auvident(*command)
    told = " ".join(called.err.split())
    assert called.code == 4 and "the run has read logs of Tern 180 since" in told
    assert auvident(*command, "--vehicle", "sample_logs/remus100.toml").code == 0
    said = " ".join(auvident("export", demo, "--format", "csv").err.split())
    assert said.count("bay_trial.parquet is new") == 1 and NOT_REFINED in said
