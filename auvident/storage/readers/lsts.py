"""LSTS IMC logs (``Data.lsf``) of DUNE vehicles such as LAUV; messages by the library imcpy.

The file is cut into messages here: the reader of the library loads an index from a pickle beside
the log, whoever wrote it, even where it is told to use none. A damaged stretch is passed over up to
the next message whose checksum is right.
"""

import gzip
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers.interface import STAMP, Tables, in_memory, ns_of_seconds
from auvident.storage.readers.registry import need

SYNC = struct.pack("<H", 0xFE54)
HEADER = struct.Struct("<HHHdHBHB")  # sync, id, size, time, source and its entity, the same of dst
FOOTER = 2  # bytes of the checksum
GZIP = b"\x1f\x8b"
EXTRA = "lsts"
MOST_BYTES = 8_000_000_000  # of a log that was compressed
COMMON = frozenset(("timestamp", "src", "src_ent", "dst", "dst_ent", "msg_id", "msg_name"))
UNITS = {  # of the fields that maneuvering needs, as the IMC definition has them
    "EstimatedState": {
        **dict.fromkeys(("u", "v", "w", "vx", "vy", "vz"), "m/s"),
        **dict.fromkeys(("p", "q", "r"), "rad/s"),
        **dict.fromkeys(("phi", "theta", "psi"), "rad"),
        **dict.fromkeys(("x", "y", "z", "depth", "alt"), "m"),
    },
    "GroundVelocity": dict.fromkeys(("x", "y", "z"), "m/s"),
    "WaterVelocity": dict.fromkeys(("x", "y", "z"), "m/s"),
    "AngularVelocity": dict.fromkeys(("x", "y", "z"), "rad/s"),
    "EulerAngles": dict.fromkeys(("phi", "theta", "psi"), "rad"),
    "ServoPosition": {"value": "rad"},
    "SetServoPosition": {"value": "rad"},
    "Rpm": {"value": "rpm"},
    "Depth": {"value": "m"},
    "GpsFix": dict.fromkeys(("lat", "lon"), "rad"),
}


@dataclass(frozen=True)
class LstsReader:
    """Logs of DUNE (``.lsf``, ``.lsf.gz``)."""

    name: str = "LSTS IMC"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first bytes."""
        return head.startswith((SYNC, GZIP))

    def open(self, path: Path) -> Tables:
        """Read the log."""
        rows, lost = _rows(need("imcpy", EXTRA, path), _content(path))
        notes = (f"{lost} bytes are damaged and were left out",) if lost else ()
        tables: dict[str, dict[str, np.ndarray]] = {}
        units: dict[tuple[str, str], str] = {}
        for kind, own in rows.items():
            for name, messages in _parts(kind, own).items():
                tables[name] = _table(messages)
                units |= {(name, field): unit for field, unit in UNITS.get(kind, {}).items()}
        return in_memory(tables, units=units, notes=notes)


Rows = list[tuple[float, int, dict[str, float]]]  # time, entity of the source, fields


def _rows(imcpy: Any, content: bytes) -> tuple[dict[str, Rows], int]:
    """Numbers of all messages by their kind, and how many bytes were passed over."""
    found: dict[str, Rows] = {}
    names: dict[type, tuple[str, ...]] = {}
    lost = 0
    for message, passed in _messages(imcpy, content):
        lost += passed
        kind = type(message)
        if kind not in names:
            names[kind] = () if message is None else _numbers(message)
        if message is not None and names[kind]:
            values = {name: float(getattr(message, name)) for name in names[kind]}
            row = (message.timestamp, message.src_ent, values)
            found.setdefault(kind.__name__, []).append(row)
    return found, lost


def _content(path: Path) -> bytes:
    with path.open("rb") as stream:
        if stream.read(len(GZIP)) != GZIP:
            return path.read_bytes()
    pieces, size = [], 0
    try:
        with gzip.open(path) as packed:
            while piece := packed.read(1 << 24):
                pieces.append(piece)
                size += len(piece)
                if size > MOST_BYTES:
                    raise InputError("is too large once unpacked", str(path), "Split the log.")
    except (EOFError, OSError, zlib.error) as error:
        if not pieces:
            raise InputError(f"is damaged gzip: {error}", str(path)) from error
    return b"".join(pieces)


def _messages(imcpy: Any, content: bytes) -> Iterator[tuple[Any | None, int]]:
    """Messages, and how many bytes were passed over before each; at last None with the rest."""
    at = passed = 0
    while at + HEADER.size + FOOTER <= len(content):
        sync, _, size, *_ = HEADER.unpack_from(content, at)
        end = at + HEADER.size + size + FOOTER
        message = _message(imcpy, content[at:end]) if sync == 0xFE54 else None
        if message is None:
            following = content.find(SYNC, at + 1)
            following = len(content) if following < 0 else following
            passed += following - at
            at = following
            continue
        yield message, passed
        at, passed = end, 0
    yield None, passed + max(len(content) - at, 0)


def _message(imcpy: Any, frame: bytes) -> Any | None:
    try:
        return imcpy.Packet.deserialize(frame)
    except Exception:  # cut off, wrong checksum, or a message that this version does not know
        return None


def _numbers(message: Any) -> tuple[str, ...]:
    """Fields of a message that are numbers."""
    names = [n for n in dir(message) if not n.startswith("_") and n not in COMMON]
    return tuple(n for n in names if isinstance(getattr(message, n), int | float))


def _parts(name: str, own: Rows) -> dict[str, Rows]:
    """Messages of one kind apart by servo or motor, or else by what sent them."""
    if "id" in own[0][2]:
        keys = [f"id={int(values['id'])}" for _, _, values in own]
    else:
        keys = [f"entity={entity}" for _, entity, _ in own]
    if len(set(keys)) == 1:
        return {name: own}
    found: dict[str, Rows] = {}
    for key, row in zip(keys, own, strict=True):
        found.setdefault(f"{name}[{key}]", []).append(row)
    return found


def _table(own: Rows) -> dict[str, np.ndarray]:
    ns = ns_of_seconds(np.array([row[0] for row in own], dtype=float))
    columns = {name: np.array([row[2][name] for row in own]) for name in own[0][2]}
    return {STAMP: ns, **columns}


READER = LstsReader()
