"""A broken file that is not needed costs itself; one that is needed, or may be, is the message."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, write_folder

from auvident.errors import InputError
from auvident.storage.logs import read_trials

NOISE = bytes(range(256)) * 20
BROKEN = {
    "depth.csv": (b"", "is empty"),
    "attitude.csv": (b"time_s,heading_deg\n", "no data"),
    "position.parquet": (b"PAR1 but not really", "damaged Parquet"),
    "notes.csv": (b"left the harbour at noon\nwind from the west\n", "no row of column names"),
    "photo.csv": (NOISE, "binary"),
    "elevator.csv": (b"time_s,elevator_deg\n0,1\n1,ERR\n2,1\n", "'ERR'"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_that_is_not_needed_is_set_aside(tmp_path, name):
    content, words = BROKEN[name]
    folder = write_folder(tmp_path / "run")
    (folder / name).write_bytes(content)
    (trial,) = read_trials([folder])
    assert list(trial.sensors) == ["dvl", "gyro", "rudder", "rpm"]
    (finding,) = trial.findings
    assert finding.code == "file_set_aside"
    assert finding.message.startswith(f"{name} was not used: ")
    assert words in finding.message
    assert str(folder / name) in finding.where
    assert finding.remedy


def test_all_of_them_at_once(tmp_path):
    folder = write_folder(tmp_path / "run")
    for name, (content, _) in BROKEN.items():
        (folder / name).write_bytes(content)
    (trial,) = read_trials([folder])
    assert [f.code for f in trial.findings] == ["file_set_aside"] * len(BROKEN)
    expected = sensor_tables()["gyro"]["r_degps"].to_numpy()
    np.testing.assert_allclose(np.rad2deg(trial.sensors["gyro"].values["r_radps"]), expected)


def test_a_torn_parquet_file(tmp_path):
    folder = write_folder(tmp_path / "run")
    path = folder / "position.parquet"
    t = np.arange(5000.0)
    pd.DataFrame({"time_s": t, "north_m": np.sin(t), "east_m": np.cos(t)}).to_parquet(path)
    content = bytearray(path.read_bytes())
    content[4:2000] = b"\xff" * 1996  # the footer is whole, the pages are not
    path.write_bytes(content)
    (trial,) = read_trials([folder])
    assert "position" not in trial.sensors
    assert trial.findings[0].code == "file_set_aside"


def test_needed_for_the_vertical_plane(tmp_path):
    folder = write_folder(tmp_path / "run")
    (folder / "elevator.csv").write_bytes(b"")
    with pytest.raises(InputError, match=r"elevator\.csv.*is empty"):
        read_trials([folder], needed=("u_mps", "r_radps", "elevator_rad"))


@pytest.mark.parametrize("content", [b"", b"time_s,r_degps\n"])
def test_leaving_out_a_needed_file_is_not_advised(tmp_path, content):
    folder = write_folder(tmp_path / "run")
    for name, out in (("gyro.csv", False), ("depth.csv", True)):
        (folder / name).write_bytes(content)
        if out:
            (finding,) = read_trials([folder])[0].findings
            remedy = finding.remedy
        else:
            with pytest.raises(InputError) as caught:
                read_trials([folder])
            remedy = caught.value.remedy
            write_folder(folder)
        assert remedy.startswith("Export it again") and ("leave it out" in remedy) == out


def test_a_file_that_may_have_had_what_is_missing_is_named(tmp_path):
    tables = sensor_tables()
    del tables["rudder"]
    folder = write_folder(tmp_path / "run", tables)
    (folder / "actuators.csv").write_bytes(NOISE)
    with pytest.raises(InputError) as caught:
        read_trials([folder])
    for word in ("actuators.csv", "binary"):
        assert word in str(caught.value)
