"""A trial in files of arrays and text logs of others gives the channels of its CSV files."""

import numpy as np
import pytest

from auvident.schema.logs import ColumnMap
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials
from tests.storage.readers.array_world import (
    START_S,
    tables,
    write_alog,
    write_csv,
    write_hdf5,
    write_lsf,
    write_mat_5,
    write_mat_73,
    write_netcdf_3,
    write_netcdf_4,
)

MOOS_MAP = {
    sensor: {"topic": f"i{sensor.title()}"}
    | {
        quantity: {"column": column.upper(), "unit": unit}
        for quantity, column, unit in (
            ("u", "u_mps", "m/s"),
            ("v", "v_mps", "m/s"),
            ("w", "w_mps", "m/s"),
        )
        if sensor == "dvl"
    }
    for sensor in ("dvl",)
} | {
    "gyro": {"topic": "iGyro"}
    | {q: {"column": f"{q.upper()}_DEGPS", "unit": "deg/s"} for q in "pqr"},
    "rudder": {"topic": "RUDDER_DEG", "rudder": {"column": "value", "unit": "deg"}},
    "elevator": {"topic": "ELEVATOR_DEG", "elevator": {"column": "value", "unit": "deg"}},
    "rpm": {"topic": "RPM", "rpm": {"column": "value", "unit": "rpm"}},
}
LSTS_MAP = {
    "dvl": {"topic": "GroundVelocity", "u": "x", "v": "y", "w": "z"},
    "gyro": {"topic": "AngularVelocity", "p": "x", "q": "y", "r": "z"},
    "rudder": {"topic": "ServoPosition[id=2]", "rudder": "value"},
    "elevator": {"topic": "ServoPosition[id=1]", "elevator": "value"},
    "rpm": {"topic": "Rpm", "rpm": "value"},
    "depth": {"topic": "Depth", "depth": "value"},
}
NETCDF_MAP = {"dvl": {"valid": "flag"}}
FORMATS = {
    "mat 5": ("scipy", write_mat_5, "a.mat", {}),
    "mat 7.3": ("h5py", write_mat_73, "a.mat", {}),
    "hdf5": ("h5py", write_hdf5, "a.h5", {}),
    "netcdf 4": ("h5netcdf", write_netcdf_4, "a.nc", NETCDF_MAP),
    "netcdf 3": ("scipy", write_netcdf_3, "a.nc", NETCDF_MAP),
    "alog": ("numpy", write_alog, "a.alog", MOOS_MAP),
    "lsf": ("imcpy", write_lsf, "Data.lsf", LSTS_MAP),
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    (trial,) = read_trials([write_csv(tmp_path_factory.mktemp("csv") / "plain")])
    return trial


@pytest.mark.parametrize("name", FORMATS)
def test_channels_are_those_of_the_csv_files(name, plain, tmp_path):
    library, write, file, column_map = FORMATS[name]
    pytest.importorskip(library, reason=f"needs {library}")
    (trial,) = read_trials([write(tmp_path / file)], ColumnMap.model_validate(column_map))
    if name not in ("alog", "lsf"):  # of which the map reads some only
        assert trial.sensors.keys() == plain.sensors.keys()
    assert not [f for f in trial.findings if f.code != "file_not_used"] or name.startswith("mat")
    absolute = trial.origin != ""
    whole = round(plain.sensors["gyro"].time_s[0] - trial.sensors["gyro"].time_s[0])
    for sensor, other in trial.sensors.items():
        own = plain.sensors[sensor]
        for column, values in other.values.items():
            # a MOOS log has no rows without a value, and a source's rows have one of each
            kept, there = np.isfinite(own.values[column]), np.isfinite(values)
            if name != "alog":
                np.testing.assert_array_equal(there, kept)
            shift = whole if absolute else 0
            np.testing.assert_allclose(
                other.time_s[there] + shift, own.time_s[kept], rtol=0, atol=2e-7
            )
            np.testing.assert_allclose(
                values[there],
                own.values[column][kept],
                rtol=1e-6 if name == "lsf" else 1e-12,  # IMC has floats of 4 bytes
                atol=1e-12,
                err_msg=f"{sensor} {column}",
            )


def test_instants_count_from_1970(tmp_path):
    pytest.importorskip("h5netcdf")
    column_map = ColumnMap.model_validate(NETCDF_MAP)
    (trial,) = read_trials([write_netcdf_4(tmp_path / "a.nc")], column_map)
    first = min(table["time_s"].iloc[0] for table in tables().values())
    expected = np.datetime64(START_S + int(first), "s")
    assert np.datetime64(trial.origin.removesuffix("Z")) == expected


@pytest.mark.parametrize("name", ["mat 5", "hdf5", "alog"])
def test_inspect_lists_their_tables(name, tmp_path):
    library, write, file, _ = FORMATS[name]
    pytest.importorskip(library)
    report = inspect_log(write(tmp_path / file))
    assert report.files
