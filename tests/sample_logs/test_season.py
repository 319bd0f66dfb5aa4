"""A season: what happens to a vehicle, and what its truth and its campaign file say."""

from pathlib import Path

import pytest
from seatrial import season as made
from seatrial.vehicles import PLANTS, Plant

from auvident.storage.campaign_file import read_campaign
from tests.bench.season import judged


@pytest.fixture
def sailed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Plant]]:
    """Trials are noted instead of sailed."""
    trials: list[tuple[str, Plant]] = []

    def note(
        table: str, plant: Plant, seed: int, folder: Path, when: object, schedule: dict
    ) -> None:
        assert schedule == made.SCHEDULE
        trials.append((folder.parent.name, plant))
        folder.mkdir(parents=True)
        (folder / "gyro.csv").write_text("timestamp,r_degps\n1.0,2.0\n")

    monkeypatch.setattr(made, "sail_one", note)
    return trials


def test_every_vehicle_has_its_trials_and_what_happens_to_it(sailed, tmp_path: Path) -> None:
    truth = made.season(tmp_path, 24, seed=3)
    _, trials = read_campaign(tmp_path / "campaign.toml")
    assert len(trials) == 24
    assert {t.vehicle for t in trials} == {"alba", "brio", "cora"}
    fins = [plant.fin_effect for name, plant in sailed[:-1] if name == "alba"]
    assert fins[-1] / fins[0] == pytest.approx(0.8)
    names = [row["trial"] for row in truth["alba"]["trials"]]
    assert fins[names.index(truth["alba"]["first"]) - 1] == fins[0]
    drags = [plant.drag_form for name, plant in sailed if name == "brio"]
    assert drags[-1] / drags[0] == pytest.approx(1.3) and drags == sorted(drags)
    thrusts = [plant.kt[0] for name, plant in sailed if name == "cora"]
    assert thrusts[-1] / thrusts[0] == pytest.approx(0.85)
    assert set(truth["faults"]) == {"wrong vehicle", "no gyro", "gyro scale"}
    mute, slow = (tmp_path.joinpath(*truth["faults"][k]) for k in ("no gyro", "gyro scale"))
    assert not (mute / "gyro.csv").exists()
    assert (slow / "gyro.csv").read_text().splitlines()[1] == "1.0,1.40000"


def test_in_a_steady_season_nothing_happens(sailed, tmp_path: Path) -> None:
    truth = made.season(tmp_path, 6, boats=made.STEADY, faults=False)
    for boat in made.STEADY:
        assert len({plant for name, plant in sailed if name == boat.name}) == 1
        assert truth[boat.name]["first"] == ""
    assert sailed[0][1] != PLANTS["remus100"]  # no vehicle is quite its table


def test_what_is_said_of_a_season_is_judged() -> None:
    from auvident.schema.campaign import CampaignResult, CampaignTrial, CampaignVehicleResult

    trial = CampaignTrial(vehicle="alba", trial="a", log="", run="", state="failed", problem="bad")
    result = CampaignResult(
        program_version="0",
        trials=(trial,),
        vehicles=(CampaignVehicleResult(name="alba", plane="horizontal"),),
    )
    alba = {"happening": "bent fin", "size": 0.2, "first": "a", "trials": [{"trial": "a"}]}
    found = judged(result, {"alba": alba, "faults": {"no gyro": ["alba", "a"]}})
    assert found["spoilt trials"] == [
        {"fault": "no gyro", "trial": "alba/a", "named": True, "why": "bad"}
    ]
    assert found["changes"][0]["found"] == "-" and found["others left out"] == []
