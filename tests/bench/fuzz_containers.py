"""Logs of many tables for the fuzzer: a few seconds of a trial in every format, and their reading.

The damage of a text hardly ever makes an extreme number of a binary file: `overwritten` does.
"""

import math
import random
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

SECONDS = 6.0  # of the trial: a small file is damaged and read more often
MOST_READ = 40  # tables of a file that are read
# Format, file, its library, how many ways to write it.
WRITTEN: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("alog", "trial.alog", "numpy", ("write_alog",)),
    ("dated", "trial.log", "numpy", ("iver", "date_first")),
    ("dataflash", "trial.bin", "numpy", ("write_dataflash",)),
    ("ulog", "trial.ulg", "pyulog", ("write_ulog",)),
    ("bag", "trial.bag", "rosbags", ("write_ros", "write_ros BZ2")),
    ("db3", "trial.db3", "rosbags", ("write_ros sqlite3",)),
    ("mcap", "trial.mcap", "rosbags", ("write_ros mcap", "write_ros mcap STORAGE")),
    ("mat 5", "trial.mat", "scipy", ("write_mat_5",)),
    ("mat 7.3", "trial.mat", "h5py", ("write_mat_73",)),
    ("hdf5", "trial.h5", "h5py", ("write_hdf5",)),
    ("netcdf 4", "trial.nc", "h5netcdf", ("write_netcdf_4",)),
    ("netcdf 3", "trial.nc", "scipy", ("write_netcdf_3",)),
    ("lsf", "trial.lsf", "imcpy", ("write_lsf", "odd_lsf")),
)
NAMES = tuple(name for name, *_ in WRITTEN)
EXTREMES = (
    *(struct.pack("<d", x) for x in (1e300, -1e300, math.inf, math.nan, 1e19, 4.2e9, -1.0, 5e-324)),
    *(struct.pack(">d", x) for x in (1e300, math.inf, math.nan)),
    *(struct.pack("<q", x) for x in (-1, 2**63 - 1, -(2**63), 2**62, 2**32, 0)),
    *(struct.pack("<i", x) for x in (-1, 2**31 - 1, -(2**31), 1 << 20)),
    *(struct.pack(">i", x) for x in (2**31 - 1, 1 << 20)),
    *(struct.pack("<H", x) for x in (0xFFFF, 0x7FFF, 0)),
)


def overwritten(content: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """An extreme number in the place of some bytes."""
    new = rng.choice(EXTREMES)
    at = rng.randint(0, max(len(content) - len(new), 0))
    return content[:at] + new + content[at + len(new) :]


def containers(
    work: Path, only: Sequence[str]
) -> Iterator[tuple[str, str, tuple[bytes, ...], Callable[[Path], object]]]:
    """Name, file, sound contents and reader of each format whose library is there."""
    for name, file, library, ways in WRITTEN:
        if (only and name not in only) or find_spec(library) is None:
            continue
        sound = []
        for k, way in enumerate(ways):
            folder = work / f"{name} {k}"
            folder.mkdir()
            with _short_trial():
                sound.append(_written(way, folder / file).read_bytes())
        yield name, file, tuple(sound), read_container


@contextmanager
def _short_trial() -> Iterator[None]:
    """A few seconds of the trial in place of minutes."""
    from tests.storage.readers import array_world, container_world

    kept = (
        (array_world.tables, array_world.lsf_bytes),
        (container_world.tables, container_world.ros_raw),
    )
    before = array_world.SECONDS, container_world.MINUTES
    _clear(kept)
    array_world.SECONDS, container_world.MINUTES = SECONDS, SECONDS / 60.0
    try:
        yield
    finally:
        array_world.SECONDS, container_world.MINUTES = before
        _clear(kept)


def _clear(kept: Sequence[Sequence[Any]]) -> None:
    for functions in kept:
        for one in functions:
            one.cache_clear()


def _written(way: str, path: Path) -> Path:
    from tests.storage.readers import array_world, container_world

    own: dict[str, Callable[[Path], Path]] = {
        "iver": _iver,
        "date_first": _date_first,
        "odd_lsf": _odd_lsf,
    }
    writer, *options = way.split()
    if writer in own:
        return own[writer](path)
    if writer != "write_ros":
        world = array_world if hasattr(array_world, writer) else container_world
        return getattr(world, writer)(path)
    storage = options[0] if options and options[0] in ("sqlite3", "mcap") else ""
    packed = options[-1] if options and options[-1] != storage else ""
    return container_world.write_ros(path.parent / "bag" if storage else path, storage, packed)


def _iver(path: Path) -> Path:
    rows = (
        f"{41.5 + 1e-5 * k:.7f};{-71.3 - 2e-5 * k:.7f};23:59:{k % 60:05.2f};5/21/2024;"
        f"{270 + k / 10:.1f};{2 + k / 100:.2f};2.5;140;{k % 20}"
        for k in range(60)
    )
    head = "Latitude;Longitude;Time;Date;C True Heading;DFS Depth (m);Vehicle Speed (kn);"
    head += "Motor Speed CMD;Fin Yaw T"
    path.write_text("\r\n".join((head, *rows, "")), newline="")
    return path


def _date_first(path: Path) -> Path:
    rows = (f"2024-05-01,12:00:{k:02d}.5,{k},{k / 7:.3f},nan" for k in range(60))
    path.write_text("\n".join(("date,time,rpm,u (m/s),r (deg/s)", *rows)))
    return path


def _odd_lsf(path: Path) -> Path:
    """Sound messages with stamps that no clock shows: damage would not pass the checksum."""
    import imcpy

    packed = []
    for time in (1e300, -1e300, math.inf, math.nan, 0.0, 1.7e9, 1e19):
        message = imcpy.AngularVelocity()
        message.z, message.timestamp = time, time
        packed.append(imcpy.Packet.serialize(message))
    path.write_bytes(b"".join(packed))
    return path


def read_container(path: Path) -> None:
    """Inspect a log, read its tables, and read it as a trial with the map that is proposed."""
    from auvident.errors import AuvidentError
    from auvident.storage.log_file import open_logs, read_log
    from auvident.storage.log_inspect import inspect_log
    from auvident.storage.logs import read_column_map, read_trials

    report = inspect_log(path)
    report.model_dump_json()
    try:
        for log in open_logs(path)[:MOST_READ]:
            for name in log.names:
                _refused_or(lambda log=log, name=name: read_log(log, {name: None}))  # type: ignore[misc]
    except AuvidentError:
        pass
    column_map = None
    if report.proposed_map:
        written = path.parent / "MAP.toml"
        written.write_text(report.proposed_map, errors="surrogateescape")
        try:
            column_map = read_column_map(written)
        except AuvidentError as error:
            raise AssertionError(f"the proposed map is refused: {error}") from error
    read_trials([path], column_map, needed=())


def _refused_or(read: Callable[[], object]) -> None:
    from auvident.errors import AuvidentError

    try:
        read()
    except AuvidentError as error:
        assert error.problem
