"""Files that are parts of one log: joined where they follow each other, told where they do not."""

import numpy as np
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.logs import read_trials

HALF_S = 115.0


def halves(sensor="dvl"):
    table = sensor_tables()[sensor]
    late = table["time_s"] > HALF_S
    return table[~late], table[late]


def folder_of(path, **files):
    """The small log with other files in the place of the DVL's."""
    tables = sensor_tables()
    del tables["dvl"]
    return write_folder(path, tables | files)


def codes(trial):
    return [finding.code for finding in trial.findings]


@pytest.mark.parametrize(
    "names",
    [
        ("dvl", "dvl (1)"),
        ("dvl_part1", "dvl_part2"),
        ("dvl", "dvl-2"),
        ("dvl 2", "dvl"),  # whichever comes first in time
        ("dvl", "DVL_Part 2"),
    ],
)
def test_parts_that_follow_each_other_are_one_log(tmp_path, names):
    folder = folder_of(tmp_path / "run", **dict(zip(names, halves(), strict=True)))
    (trial,) = read_trials([folder])
    (whole,) = read_trials([write_folder(tmp_path / "plain")])
    own, other = trial.sensors["dvl"], whole.sensors["dvl"]
    np.testing.assert_array_equal(own.time_s, other.time_s)
    np.testing.assert_array_equal(own.values["u_mps"], other.values["u_mps"])
    assert own.rows_read == other.rows_read
    assert codes(trial) == ["files_joined"]
    assert all(name in trial.findings[0].message for name in names)


def test_a_folder_of_parts_alone_is_one_trial(tmp_path):
    files = {}
    for sensor in sensor_tables():
        first, second = halves(sensor)
        files |= {f"{sensor}_1": first, f"{sensor}_2": second}
    (trial,) = read_trials([write_folder(tmp_path / "run", files)])
    (whole,) = read_trials([write_folder(tmp_path / "plain")])
    for sensor, own in whole.sensors.items():
        np.testing.assert_array_equal(trial.sensors[sensor].time_s, own.time_s)
    assert codes(trial) == ["files_joined"]


def test_a_second_download_is_told_and_changes_nothing(tmp_path):
    table = sensor_tables()["dvl"]
    (trial,) = read_trials([folder_of(tmp_path / "run", dvl=table, **{"dvl (1)": table})])
    assert trial.sensors["dvl"].time_s.size == len(table)
    (finding,) = trial.findings
    assert finding.message == "dvl (1).csv is a copy of dvl.csv, and is not read"


def test_copies_of_which_none_has_the_plain_name_are_one_log(tmp_path):
    table = sensor_tables()["dvl"]
    (trial,) = read_trials([folder_of(tmp_path / "run", dvl_1=table, dvl_2=table)])
    assert trial.sensors["dvl"].time_s.size == len(table)
    assert codes(trial) == ["file_not_used"]


def test_files_that_overlap_are_not_joined(tmp_path):
    table = sensor_tables()["dvl"]
    (trial,) = read_trials([folder_of(tmp_path / "run", dvl=table, dvl_2=table[20:])])
    assert trial.sensors["dvl"].time_s.size == len(table)
    (finding,) = trial.findings
    assert finding.code == "files_not_joined"
    assert "overlap in time" in finding.message and "dvl.csv alone was read" in finding.message


def test_of_files_that_overlap_and_have_no_plain_name_the_map_chooses(tmp_path):
    table = sensor_tables()["dvl"]
    folder = folder_of(tmp_path / "run", dvl_1=table, dvl_2=table[20:])
    with pytest.raises(InputError, match=r"dvl_1\.csv, dvl_2\.csv overlap in time") as caught:
        read_trials([folder])
    assert '[dvl] file = "dvl_1.csv"' in (caught.value.remedy or "")
    chosen = ColumnMap.model_validate({"dvl": {"file": "dvl_2.csv"}})
    (trial,) = read_trials([folder], chosen)
    assert trial.sensors["dvl"].time_s.size == len(table) - 20


def test_other_columns_and_another_day_are_no_parts(tmp_path):
    first, second = halves()
    other = second.rename(columns={"u_mps": "u_kn"})
    (trial,) = read_trials([folder_of(tmp_path / "units", dvl=first, dvl_2=other)])
    assert codes(trial) == ["files_not_joined"]
    assert "other columns" in trial.findings[0].message
    later = second.assign(time_s=second["time_s"] + 86400.0)
    (trial,) = read_trials([folder_of(tmp_path / "day", dvl=first, dvl_2=later)])
    assert "24.0 hours apart" in trial.findings[0].message


def test_wide_files_named_after_an_angle_or_a_rate_stay_trials(tmp_path):
    for name in ("rudder_10", "rudder_20", "rpm_600"):
        table = wide_table()
        table["u_mps"] += 0.001 * len(name)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    assert [trial.name for trial in read_trials([tmp_path])] == [
        "rpm_600",
        "rudder_10",
        "rudder_20",
    ]
