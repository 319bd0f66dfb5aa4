"""What the folder of a campaign is told to be given as."""

from pathlib import Path

import pytest

from auvident.errors import InputError
from auvident.schema.campaign import RunOptions
from auvident.storage.campaign_file import trials_in_folders


def remedy(folder: Path) -> str:
    with pytest.raises(InputError, match=r"there is no vehicle\.toml") as caught:
        trials_in_folders([folder], None, RunOptions())  # type: ignore[call-arg]
    return caught.value.remedy


def with_vehicle(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / "vehicle.toml").write_text("")
    return folder


def test_a_season_without_vehicle_file_is_given_by_its_campaign_file(tmp_path: Path) -> None:
    """With a vehicle file in it, trials of two vehicles on one day had one name."""
    season = tmp_path / "season"
    season.mkdir()
    assert remedy(season) == "Put it there, or give --vehicle V.toml."
    boats = [with_vehicle(season / name) for name in ("ann", "bob b")]
    named = f"the folders that have one: {boats[0]}, '{boats[1]}'."
    assert remedy(season) == f"Give {named}"
    (season / "campaign.toml").write_text("")
    assert remedy(season) == f"Give the campaign file {season / 'campaign.toml'}, or {named}"


def test_of_many_folders_some_are_named(tmp_path: Path) -> None:
    for k in range(7):
        with_vehicle(tmp_path / f"boat_{k}")
    told = remedy(tmp_path)
    assert told.endswith("boat_4, ...") and "boat_5" not in told
