"""A folder of trials: a bad one is set aside and said, the others are used."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from auvident.cli import stages
from tests.command_line import Called

SAMPLES = Path(__file__).parents[1] / "sample_logs"
VEHICLE = ("--vehicle", SAMPLES / "tern180.toml")


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """Two good trials in the folders of their days."""
    folder = tmp_path / "campaign"
    for name in ("bay", "sound"):
        shutil.copytree(SAMPLES / f"{name}_trial", folder / f"{name}_trial")
    return folder


def quality(run: Path) -> dict:
    return json.loads((run / "ingest" / "quality.json").read_text())


def empty(trial: Path) -> None:
    (trial / "gyro.csv").write_text("")


def without_dvl(trial: Path) -> None:
    (trial / "dvl.csv").unlink()


def two_gyros(trial: Path) -> None:
    shutil.copy(trial / "gyro.csv", trial / "gyro.tsv")


@pytest.mark.parametrize(
    ("damage", "said"),
    [(empty, "is empty"), (without_dvl, "u_mps"), (two_gyros, "two files of one sensor")],
)
def test_a_bad_trial_of_a_folder_is_set_aside(
    campaign: Path,
    auvident: Callable[..., Called],
    damage: Callable[[Path], None],
    said: str,
) -> None:
    damage(campaign / "bay_trial")
    run = campaign.parent / "run"
    called = auvident("ingest", campaign, *VEHICLE, "--run", run)
    assert called.code == 3
    assert "Set aside: 1 of 2 trials" in called.err
    found = quality(run)
    (aside,) = found["set_aside"]
    assert aside["trial"] == "bay_trial"
    assert said in aside["reason"]
    assert [trial["trial"] for trial in found["trials"]] == ["sound_trial"]
    assert found["findings"][0]["code"] == "log_refused"


def test_a_run_that_need_not_read_the_logs_again_still_says_what_is_set_aside(
    campaign: Path, auvident: Callable[..., Called]
) -> None:
    """A retry of a job ends as the job did."""
    empty(campaign / "bay_trial")
    run = campaign.parent / "run"
    auvident("ingest", campaign, *VEHICLE, "--run", run)
    later = SimpleNamespace(mains={"ingest": quality(run)}, beside={}, outputs={})
    assert stages.exit_code(stages.quality_of(run, later)) == 3
    assert "Set aside: 1 of 2 trials" in [str(p) for p in stages.contradicted(run, later)]


def test_logs_named_one_by_one_are_refused_together(
    campaign: Path, auvident: Callable[..., Called]
) -> None:
    empty(campaign / "bay_trial")
    trials = sorted(campaign.iterdir())
    called = auvident("ingest", *trials, *VEHICLE, "--run", campaign.parent / "run")
    assert called.code == 3
    assert "is empty" in called.err
    assert not (campaign.parent / "run").exists()


def test_a_folder_without_a_good_trial_is_refused_with_each_reason(
    campaign: Path, auvident: Callable[..., Called]
) -> None:
    empty(campaign / "bay_trial")
    two_gyros(campaign / "sound_trial")
    called = auvident("ingest", campaign, *VEHICLE, "--run", campaign.parent / "run")
    assert called.code == 3
    last = called.err[called.err.index("none of 2 trials") :]
    assert "is empty" in last
    assert "two files of one sensor" in last
    assert not (campaign.parent / "run").exists()


def test_trials_of_one_name_in_the_folders_of_two_days(
    campaign: Path, auvident: Callable[..., Called]
) -> None:
    for day, name in (("monday", "bay"), ("tuesday", "sound")):
        (campaign / day).mkdir()
        (campaign / f"{name}_trial").rename(campaign / day / "trial")
    run = campaign.parent / "run"
    called = auvident("ingest", campaign, *VEHICLE, "--run", run)
    assert called.code == 0, called.err
    assert [t["trial"] for t in quality(run)["trials"]] == ["monday_trial", "tuesday_trial"]
    assert quality(run)["set_aside"] == []


def test_of_a_recording_and_its_beginning_the_whole_is_used(
    campaign: Path, auvident: Callable[..., Called]
) -> None:
    shutil.rmtree(campaign / "sound_trial")
    part = campaign / "a_part"
    shutil.copytree(campaign / "bay_trial", part)
    for path in part.glob("*.csv"):
        rows = path.read_text().splitlines(keepends=True)
        path.write_text("".join(rows[: len(rows) * 2 // 5]))
    run = campaign.parent / "run"
    called = auvident("ingest", campaign, *VEHICLE, "--run", run)
    assert called.code == 3
    (aside,) = quality(run)["set_aside"]
    assert aside["trial"] == "a_part"
    assert "part of trial bay_trial" in aside["reason"]
    assert [t["trial"] for t in quality(run)["trials"]] == ["bay_trial"]
    assert [p.stem for p in (run / "ingest").glob("*.parquet")] == ["bay_trial"]
