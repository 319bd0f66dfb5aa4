"""The first minutes of a generated trial in the files of other loggers, and maps that read them."""

import struct
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from tests.command_line import SAMPLES

TRIAL = SAMPLES / "harbour_trial"
MINUTES = 2.0
START_S = 1_700_000_000  # of the clock that stamps messages
DEG = np.pi / 180.0


@cache
def tables() -> dict[str, pd.DataFrame]:
    """The sensors of the trial, in order of time; a quaternion of two angles there is not."""
    found = {}
    for path in sorted(TRIAL.glob("*.csv")):
        table = pd.read_csv(path).sort_values("time_s", kind="stable").drop_duplicates("time_s")
        found[path.stem] = table[table["time_s"] < table["time_s"].min() + 60.0 * MINUTES]
    found["attitude"] = found["attitude"].ffill()
    return found


def write_csv(folder: Path) -> Path:
    """The same as CSV files."""
    folder.mkdir()
    for sensor, table in tables().items():
        table.to_csv(folder / f"{sensor}.csv", index=False)
    return folder


def stamps_ns(table: pd.DataFrame) -> np.ndarray:
    """Time of each row since 1970, whole nanoseconds."""
    return START_S * 10**9 + np.rint(table["time_s"].to_numpy() * 1e3).astype(np.int64) * 10**6


def quaternion_enu(attitude: pd.DataFrame) -> np.ndarray:
    """Attitude (roll, pitch, heading in NED) of a body forward, port, up in east, north, up: wxyz.

    By the half angles of the rotations about z, y and x, multiplied in this order.
    """
    half = {
        "z": 0.5 * (np.pi / 2 - attitude["heading_deg"].to_numpy() * DEG),
        "y": -0.5 * attitude["pitch_deg"].to_numpy() * DEG,
        "x": 0.5 * attitude["roll_deg"].to_numpy() * DEG,
    }
    whole = np.array([[1.0, 0.0, 0.0, 0.0]])
    for axis, angle in half.items():
        turn = np.zeros((angle.size, 4))
        turn[:, 0], turn[:, "xyz".index(axis) + 1] = np.cos(angle), np.sin(angle)
        a, b = np.broadcast_to(whole, turn.shape), turn
        scalar = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
        vector = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
        whole = np.hstack((scalar, vector))
    return whole


# --- ROS -----------------------------------------------------------------------------------

DVL_DEFINITION = """std_msgs/Header header
geometry_msgs/Vector3 velocity
bool locked
float32[4] ranges
string[] warnings
"""
HEADER_1 = "uint32 seq\ntime stamp\nstring frame_id\n"
HEADER_2 = "builtin_interfaces/Time stamp\nstring frame_id\n"
ROS_MAP = """
[dvl]
topic = "/dvl"
time = "header.stamp_ns"
valid = "locked"
u = { column = "velocity.x", unit = "m/s" }
v = { column = "velocity.y", unit = "m/s", sign = -1 }
w = { column = "velocity.z", unit = "m/s", sign = -1 }

[gyro]
topic = "/imu/data"
time = "header.stamp_ns"
p = { column = "angular_velocity.x", unit = "rad/s" }
q = { column = "angular_velocity.y", unit = "rad/s", sign = -1 }
r = { column = "angular_velocity.z", unit = "rad/s", sign = -1 }

[rudder]
topic = "/fins/rudder"
rudder = { column = "data", unit = "deg" }

[elevator]
topic = "/fins/elevator"
elevator = { column = "data", unit = "deg" }

[rpm]
topic = "/thruster"
rpm = { column = "data[1]", unit = "rpm" }

[attitude]
topic = "/ahrs"
time = "header.stamp_ns"
frame = "enu"
roll = { column = "quaternion.roll", unit = "rad" }
pitch = { column = "quaternion.pitch", unit = "rad" }
heading = { column = "quaternion.heading", unit = "rad" }

[depth]
topic = "/depth"
depth = { column = "data", unit = "m" }

[position]
topic = "/position"
north = { column = "point.y", unit = "m" }
east = { column = "point.x", unit = "m" }
"""


def ros_store(version: int):
    """Message types of ROS, and one of a laboratory."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(DVL_DEFINITION, "lab_msgs/msg/Dvl"))
    return store


def ros_messages(store, version: int):
    """Topic, type, stamp in ns and message of everything in the trial, in order of time."""
    types, found = store.types, []

    def header(stamp, frame):
        time = types["builtin_interfaces/msg/Time"](int(stamp // 10**9), int(stamp % 10**9))
        own = types["std_msgs/msg/Header"]
        return own(0, time, frame) if version == 1 else own(time, frame)

    def dvl(row, stamp):
        velocity = types["geometry_msgs/msg/Vector3"](row.u_mps, -row.v_mps, -row.w_mps)
        warnings = ["late", "weak beam"] if row.Index % 7 == 0 else []
        frame = "dvl" if row.Index % 5 else "dvl_link"
        ranges = np.arange(4, dtype=np.float32)
        return types["lab_msgs/msg/Dvl"](
            header(stamp, frame), velocity, bool(row.valid), ranges, warnings
        )

    def gyro(row, stamp):
        rates = np.array([row.p_degps, -row.q_degps, -row.r_degps]) * DEG
        vector, none = types["geometry_msgs/msg/Vector3"], np.zeros(9)
        return types["sensor_msgs/msg/Imu"](
            header(stamp, "imu"),
            types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 0.0),
            none,
            vector(*rates),
            none,
            vector(0.0, 0.0, 9.81),
            none,
        )

    turned = dict(
        zip(tables()["attitude"].index, quaternion_enu(tables()["attitude"]), strict=True)
    )

    def ahrs(row, stamp):
        w, x, y, z = turned[row.Index]
        quaternion = types["geometry_msgs/msg/Quaternion"](x, y, z, w)
        return types["geometry_msgs/msg/QuaternionStamped"](header(stamp, "ahrs"), quaternion)

    def rpm(row, stamp):
        layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
        return types["std_msgs/msg/Float64MultiArray"](layout, np.array([0.0, row.rpm]))

    def position(row, stamp):
        point = types["geometry_msgs/msg/Point"](row.east_m, row.north_m, 0.0)
        return types["geometry_msgs/msg/PointStamped"](header(stamp, "map"), point)

    def number(column):
        return lambda row, stamp: types["std_msgs/msg/Float64"](float(getattr(row, column)))

    topics = {
        "dvl": ("/dvl", "lab_msgs/msg/Dvl", dvl),
        "gyro": ("/imu/data", "sensor_msgs/msg/Imu", gyro),
        "rudder": ("/fins/rudder", "std_msgs/msg/Float64", number("rudder_deg")),
        "elevator": ("/fins/elevator", "std_msgs/msg/Float64", number("elevator_deg")),
        "rpm": ("/thruster", "std_msgs/msg/Float64MultiArray", rpm),
        "attitude": ("/ahrs", "geometry_msgs/msg/QuaternionStamped", ahrs),
        "depth": ("/depth", "std_msgs/msg/Float64", number("depth_m")),
        "position": ("/position", "geometry_msgs/msg/PointStamped", position),
    }
    for sensor, (topic, kind, make) in topics.items():
        table = tables()[sensor]
        for row, stamp in zip(table.itertuples(), stamps_ns(table), strict=True):
            found.append((topic, kind, int(stamp), make(row, stamp)))
    return sorted(found, key=lambda message: message[2])


@cache
def ros_raw(version: int):
    """The types, and topic, type, stamp and bytes of every message."""
    store = ros_store(version)
    serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
    return store, [(t, k, s, bytes(serialize(m, k))) for t, k, s, m in ros_messages(store, version)]


def write_ros(path: Path, storage: str = "", compression: str = "") -> Path:
    """A bag of ROS 1 (``.bag``), or of ROS 2 (a folder): the file of it that holds the messages."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    version = 2 if storage else 1
    store, messages = ros_raw(version)
    if version == 1:
        writer = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression])
    else:
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    with writer:
        connections: dict = {}
        for topic, kind, stamp, data in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], stamp, data)
    return path if version == 1 else next(p for p in path.iterdir() if p.suffix != ".yaml")


# --- PX4 -----------------------------------------------------------------------------------

ULOG_MAP = """
[dvl]
topic = "sensor_dvl"
valid = "lock"
u = { column = "vel[0]", unit = "mps" }
v = { column = "vel[1]", unit = "mps" }
w = { column = "vel[2]", unit = "mps" }

[gyro]
topic = "vehicle_angular_velocity[1]"
p = { column = "xyz[0]", unit = "radps" }
q = { column = "xyz[1]", unit = "radps" }
r = { column = "xyz[2]", unit = "radps" }

[rudder]
topic = "fins"
rudder = { column = "rudder.angle", unit = "deg" }

[elevator]
topic = "stern_planes"
elevator = { column = "angle", unit = "deg" }

[rpm]
topic = "esc_status"
rpm = { column = "esc[0].esc_rpm", unit = "rpm" }

[attitude]
topic = "vehicle_attitude"
roll = { column = "q.roll", unit = "rad" }
pitch = { column = "q.pitch", unit = "rad" }
heading = { column = "q.heading", unit = "rad" }

[depth]
topic = "depth"
depth = { column = "depth", unit = "m" }

[position]
topic = "position"
north = { column = "x", unit = "m" }
east = { column = "y", unit = "m" }
"""


def quaternion_ned(attitude: pd.DataFrame) -> np.ndarray:
    """Attitude of a body forward, starboard, down in north, east, down: w, x, y, z."""
    roll, pitch, yaw = (
        0.5 * attitude[f"{n}_deg"].to_numpy() * DEG for n in ("roll", "pitch", "heading")
    )
    c, s = np.cos, np.sin
    return np.column_stack(
        (
            c(roll) * c(pitch) * c(yaw) + s(roll) * s(pitch) * s(yaw),
            s(roll) * c(pitch) * c(yaw) - c(roll) * s(pitch) * s(yaw),
            c(roll) * s(pitch) * c(yaw) + s(roll) * c(pitch) * s(yaw),
            c(roll) * c(pitch) * s(yaw) - s(roll) * s(pitch) * c(yaw),
        )
    )


def time_us(table: pd.DataFrame) -> np.ndarray:
    """Microseconds since switch-on."""
    return np.rint(table["time_s"].to_numpy() * 1e3).astype(np.int64) * 1000


def write_ulog(path: Path) -> Path:
    """A ULog of the trial, after https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    data = {s: t.to_numpy() for s, t in tables().items()}
    rates = data["gyro"][:, 1:] * DEG
    # name, number, instance, fields, struct of the rest, sensor, its rows
    topics = (
        ("sensor_dvl", 0, "double[3] vel;uint8_t lock;", "<3dB", "dvl", data["dvl"][:, 1:]),
        ("vehicle_angular_velocity", 0, "double[3] xyz;", "<3d", "gyro", 0.0 * rates),
        ("vehicle_angular_velocity", 1, "double[3] xyz;", "<3d", "gyro", rates),
        ("fins", 0, "fin_s rudder;uint8_t[3] _padding0;", "<d", "rudder", data["rudder"][:, 1:]),
        ("stern_planes", 0, "double angle;", "<d", "elevator", data["elevator"][:, 1:]),
        ("esc_status", 0, "esc_s[1] esc;", "<d", "rpm", data["rpm"][:, 1:]),
        (
            "vehicle_attitude",
            0,
            "double[4] q;",
            "<4d",
            "attitude",
            quaternion_ned(tables()["attitude"]),
        ),
        ("depth", 0, "double depth;", "<d", "depth", data["depth"][:, 1:]),
        ("position", 0, "double x;double y;", "<2d", "position", data["position"][:, 1:]),
    )
    head = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    formats = {name: fields for name, _, fields, *_ in topics}
    for name, fields in formats.items():
        head.append(message("F", f"{name}:uint64_t timestamp;{fields}".encode()))
    head += [message("F", b"fin_s:double angle;"), message("F", b"esc_s:double esc_rpm;")]
    rows = []
    for number, (name, instance, _, rest, sensor, values) in enumerate(topics):
        head.append(message("A", struct.pack("<BH", instance, number) + name.encode()))
        whole = rest[-1] == "B"
        for time, row in zip(time_us(tables()[sensor]), values.tolist(), strict=True):
            fields = [*row[:-1], int(row[-1])] if whole else row
            body = struct.pack("<HQ", number, time) + struct.pack(rest, *fields)
            rows.append((time, message("D", body)))
    rows.sort(key=lambda row: row[0])
    path.write_bytes(b"".join(head + [row for _, row in rows]))
    return path


# --- ArduPilot -----------------------------------------------------------------------------

DATAFLASH_MAP = """
[dvl]
topic = "DVL"
valid = "Lock"
u = "VX"
v = "VY"
w = "VZ"

[gyro]
topic = "IMU[1]"
p = { column = "GyrX", unit = "radps" }
q = "GyrY"
r = "GyrZ"

[rudder]
topic = "FINS"
rudder = { column = "Rud", unit = "deg" }

[elevator]
topic = "STRN"
elevator = { column = "Elev", unit = "deg" }

[rpm]
topic = "RPM"
rpm = "rpm1"

[attitude]
topic = "ATT"
roll = { column = "Roll", unit = "deg" }
pitch = { column = "Pitch", unit = "deg" }
heading = "Yaw"

[depth]
topic = "DPTH"
depth = { column = "Depth", unit = "m" }

[position]
topic = "POS"
north = { column = "N", unit = "m" }
east = { column = "E", unit = "m" }
"""
UNIT_LABELS = {"n": "m/s", "E": "rad/s", "d": "deg", "h": "degheading", "q": "rpm", "#": "instance",
               "s": "s", "m": "m", "-": ""}  # fmt: skip
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "B": 0.01, "F": 1e-6}


def dataflash_formats() -> bytes:
    """Units and multipliers, as ArduPilot writes them."""
    found = [fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 86)]
    found.append(fmt(129, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds", 41))
    found.append(fmt(130, "UNIT", "QbZ", "TimeUS,Id,Label", 73))
    found.append(fmt(131, "MULT", "Qbd", "TimeUS,Id,Mult", 17))
    for letter, label in UNIT_LABELS.items():
        found.append(b"\xa3\x95\x82" + struct.pack("<Qb64s", 0, ord(letter), label.encode()))
    for letter, by in MULTIPLIERS.items():
        found.append(b"\xa3\x95\x83" + struct.pack("<Qbd", 0, ord(letter), by))
    return b"".join(found)


def fmt(number: int, name: str, letters: str, columns: str, size: int) -> bytes:
    """A message that describes messages."""
    body = struct.pack(
        "<BB4s16s64s", number, size + 3, name.encode(), letters.encode(), columns.encode()
    )
    return b"\xa3\x95\x80" + body


def write_dataflash(path: Path) -> Path:
    """A DataFlash log of the trial."""
    data = {s: t.to_numpy() for s, t in tables().items()}
    gyro = data["gyro"][:, 1:] * DEG
    first, second = (np.column_stack((np.full(len(gyro), i), gyro * i)) for i in (0, 1))
    hundredths = np.rint(100.0 * data["attitude"][:, 1:])
    # name, letters, columns, units, multipliers, struct, sensor, rows
    kinds = (
        ("DVL", "QdddB", "VX,VY,VZ,Lock", "snnn-", "F000-", "<dddB", "dvl", data["dvl"][:, 1:]),
        ("IMU", "QBddd", "I,GyrX,GyrY,GyrZ", "s#EEE", "F-000", "<Bddd", "gyro", first),
        ("IMU", "QBddd", "I,GyrX,GyrY,GyrZ", "s#EEE", "F-000", "<Bddd", "gyro", second),
        ("FINS", "Qd", "Rud", "s-", "F-", "<d", "rudder", data["rudder"][:, 1:]),
        ("STRN", "Qd", "Elev", "s-", "F-", "<d", "elevator", data["elevator"][:, 1:]),
        ("RPM", "Qd", "rpm1", "sq", "F0", "<d", "rpm", data["rpm"][:, 1:]),
        ("ATT", "QccC", "Roll,Pitch,Yaw", "sddh", "FBBB", "<hhH", "attitude", hundredths),
        ("DPTH", "Qd", "Depth", "s-", "F-", "<d", "depth", data["depth"][:, 1:]),
        ("POS", "Qdd", "N,E", "smm", "F00", "<dd", "position", data["position"][:, 1:]),
    )  # fmt: skip
    numbers = {name: 140 + i for i, name in enumerate(dict.fromkeys(kind[0] for kind in kinds))}
    head, rows = dataflash_formats(), []
    for name, letters, columns, units, by, packing, sensor, values in kinds:
        number = numbers[name]
        head += fmt(number, name, letters, f"TimeUS,{columns}", 8 + struct.calcsize(packing))
        head += b"\xa3\x95\x81" + struct.pack("<QB16s16s", 0, number, units.encode(), by.encode())
        for time, row in zip(time_us(tables()[sensor]), values.tolist(), strict=True):
            whole = [int(x) if c in "BhH" else x for c, x in zip(packing[1:], row, strict=True)]
            body = struct.pack("<Q", time) + struct.pack(packing, *whole)
            rows.append((time, b"\xa3\x95" + bytes([number]) + body))
    rows.sort(key=lambda row: row[0])
    path.write_bytes(head + b"".join(row for _, row in rows))
    return path
