"""The first minute of a generated trial in files of arrays and in text logs of other programs."""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from tests.command_line import SAMPLES

TRIAL = SAMPLES / "harbour_trial"
SECONDS = 60.0
START_S = 1_700_000_000  # of logs that count from 1970
UNITS = {"mps": "m/s", "degps": "deg/s", "deg": "deg", "m": "m", "rpm": "rpm", "s": "s"}


@cache
def tables() -> dict[str, pd.DataFrame]:
    """The sensors of the trial, in order of time."""
    found = {}
    for path in sorted(TRIAL.glob("*.csv")):
        table = pd.read_csv(path).sort_values("time_s", kind="stable").drop_duplicates("time_s")
        found[path.stem] = table[table["time_s"] < table["time_s"].min() + SECONDS]
    return found


def arrays() -> dict[str, dict[str, np.ndarray]]:
    """The same as arrays."""
    return {s: {c: t[c].to_numpy(dtype=float) for c in t} for s, t in tables().items()}


def bare(column: str) -> tuple[str, str]:
    """Name without the unit behind it, and the unit."""
    stem, _, suffix = column.rpartition("_")
    return (stem, UNITS[suffix]) if suffix in UNITS and stem else (column, UNITS.get(column, ""))


def write_csv(folder: Path) -> Path:
    """One file a sensor."""
    folder.mkdir()
    for sensor, table in tables().items():
        table.to_csv(folder / f"{sensor}.csv", index=False)
    return folder


def write_mat_5(path: Path) -> Path:
    """A struct for each sensor."""
    from scipy.io import savemat

    savemat(path, {"trial": arrays(), "note": "sea trial", "k": 3.0})
    return path


def write_mat_73(path: Path) -> Path:
    """The same as MATLAB writes it since 7.3: HDF5 behind 512 bytes, arrays turned over."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for sensor, table in arrays().items():
            group = file.create_group(f"trial/{sensor}")
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for name, values in table.items():
                group[name] = values[None, :]
                group[name].attrs["MATLAB_class"] = np.bytes_("double")
        note = file.create_dataset("note", data=np.array([[115], [101]], dtype=np.uint16))
        note.attrs["MATLAB_class"] = np.bytes_("char")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon May  6 12:00:00 2024 HDF5"
    with path.open("r+b") as stream:
        stream.write(head.ljust(124) + b"\x00\x02IM")
    return path


def write_hdf5(path: Path) -> Path:
    """A group for each sensor, units in attributes."""
    import h5py

    with h5py.File(path, "w") as file:
        for sensor, table in arrays().items():
            for name, values in table.items():
                stem, unit = ("time_s", "s") if name == "time_s" else bare(name)
                data = file.create_dataset(f"nav/{sensor}/{stem}", data=values, compression="gzip")
                data.attrs["units"] = np.bytes_(unit)
    return path


def write_netcdf_4(path: Path) -> Path:
    """A dimension for each sensor, time in seconds since an instant, the depth packed."""
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        for sensor, table in arrays().items():
            own = f"{sensor}_time"
            file.dimensions[own] = len(table["time_s"])
            for name, values in table.items():
                if name == "time_s":
                    ms = np.rint(values * 1e3).astype(np.int64)
                    time = file.create_variable(own, (own,), data=ms)
                    time.attrs["units"] = "milliseconds since 2023-11-14 22:13:20 UTC"
                    continue
                stem, unit = bare(name)
                stem = "flag" if name == "valid" else stem
                if sensor == "depth":
                    packed = np.where(np.isfinite(values), np.rint(values * 1e3), -9999)
                    one = file.create_variable(stem, (own,), data=packed.astype(np.int32))
                    one.attrs["scale_factor"], one.attrs["_FillValue"] = 1e-3, np.int32(-9999)
                else:
                    one = file.create_variable(stem, (own,), data=values)
                one.attrs["units"] = unit
    return path


def write_netcdf_3(path: Path) -> Path:
    """The classic form; days since an instant would round, seconds do not."""
    from scipy.io import netcdf_file

    with netcdf_file(path, "w") as file:
        for sensor, table in arrays().items():
            own = f"{sensor}_time"
            file.createDimension(own, len(table["time_s"]))
            for name, values in table.items():
                stem, unit = (own, "") if name == "time_s" else bare(name)
                one = file.createVariable("flag" if name == "valid" else stem, "d", (own,))
                one[:] = values
                one.units = "seconds since 2023-11-14T22:13:20Z" if name == "time_s" else unit
    return path


def write_alog(path: Path) -> Path:
    """Each quantity a variable, published by one application a sensor."""
    lines = []
    for sensor, table in arrays().items():
        for k, t in enumerate(table["time_s"]):
            for name, values in table.items():
                if name != "time_s" and np.isfinite(values[k]):
                    lines.append((t, f"{name.upper():24} i{sensor.title():14} {values[k]!r}"))
    lines.sort(key=lambda line: line[0])
    text = f"%% LOG FILE: trial.alog\n%% FILE OPENED ON Tue Nov 14\n%% LOGSTART {START_S}.0\n"
    text += "".join(f"{t:.3f} {rest}\n" for t, rest in lines)
    path.write_text(text.replace("np.float64(", "").replace(")", ""))
    return path


def write_lsf(path: Path) -> Path:
    """Messages of a DUNE vehicle."""
    path.write_bytes(lsf_bytes())
    return path


@cache
def lsf_bytes() -> bytes:
    """Messages in order of time."""
    import imcpy

    made = []
    for sensor, fields in LSTS.items():
        table = tables()[sensor]
        for k, t in enumerate(table["time_s"]):
            message = getattr(imcpy, fields[0])()
            for field, (column, factor) in fields[1].items():
                value = float(table[column].iloc[k]) * factor
                setattr(message, field, round(value) if fields[0] == "Rpm" else value)
            if fields[0] == "ServoPosition":
                message.id = 2 if sensor == "rudder" else 1
            message.timestamp = START_S + float(t)
            message.src_ent = 7
            made.append(message)
    made.sort(key=lambda message: message.timestamp)
    return b"".join(imcpy.Packet.serialize(message) for message in made)


DEG = np.pi / 180.0
LSTS = {
    "dvl": ("GroundVelocity", {"x": ("u_mps", 1.0), "y": ("v_mps", 1.0), "z": ("w_mps", 1.0)}),
    "gyro": (
        "AngularVelocity",
        {"x": ("p_degps", DEG), "y": ("q_degps", DEG), "z": ("r_degps", DEG)},
    ),
    "rudder": ("ServoPosition", {"value": ("rudder_deg", DEG)}),
    "elevator": ("ServoPosition", {"value": ("elevator_deg", DEG)}),
    "rpm": ("Rpm", {"value": ("rpm", 1.0)}),
    "depth": ("Depth", {"value": ("depth_m", 1.0)}),
}
