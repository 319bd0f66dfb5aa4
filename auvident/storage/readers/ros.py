"""ROS 1 and ROS 2 bags and MCAP recordings of ROS 2, by the library rosbags.

The library finds topics and messages; what a message holds is read off its definition by
`auvident.storage.readers.ros_messages`, so that no definition in a file becomes code.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers.interface import STAMP, ColumnHead, TableHead
from auvident.storage.readers.quaternions import ANGLES, angles, quaternions_in
from auvident.storage.readers.registry import need
from auvident.storage.readers.ros_messages import (
    Definitions,
    MalformedError,
    columns_of,
    layout_of,
)

EXTRA = "ros"
BAG, MCAP, SQLITE = b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\x00"
METADATA = "metadata.yaml"  # of a ROS 2 bag: a folder
BATCH = 1 << 26  # bytes of messages that are in memory at a time
MOST_CHUNK = 1 << 28  # bytes that a compressed chunk of ROS 1 may unpack to; 768 kB is usual
AXES = "flu"  # convention of ROS (REP 103); not every driver keeps to it
STAMPED = ".stamp_ns"
NAMELESS = "(no name)"  # a topic of a damaged recording
REMEDY = (
    "A recording that was not closed is repaired by `rosbag reindex` (ROS 1), "
    "`ros2 bag reindex` or `mcap recover` (ROS 2)."
)


@dataclass(frozen=True)
class RosReader:
    """ROS 1 bags (``.bag``), ROS 2 bags (``.db3``, ``.mcap`` with or without their folder)."""

    name: str = "ROS bag"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first bytes; of a bag in several files, the first stands for all."""
        if not head.startswith((BAG, MCAP, SQLITE)):
            return False
        listed = _listed(path)
        return path.name not in listed or path.name == listed[0]

    def open(self, path: Path) -> "RosBag":
        """Find the topics."""
        need("rosbags", EXTRA, path)
        return RosBag(path, path.suffix.lower() == ".bag")


@dataclass(frozen=True)
class Topic:
    """A topic: its connections in the library, its type, and what it holds."""

    connections: tuple[Any, ...]
    kind: str
    head: TableHead


@dataclass
class RosBag:
    """An opened bag."""

    path: Path
    is_ros1: bool
    notes: tuple[str, ...] = field(default=())

    @property
    def tables(self) -> dict[str, TableHead]:
        """Topics by name."""
        return {name: topic.head for name, topic in self._topics.items()}

    def read(self, table: str, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of a topic."""
        topic, count = self._topics[table], 0
        parts: dict[str, list[np.ndarray]] = {name: [] for name in columns}
        with self._faults(lambda: f"after {count} messages of {table}"):
            for stamps, messages in _batches(self._reader, topic.connections):
                found = columns_of(self._definitions, topic.kind, messages, not self.is_ros1)
                found |= {STAMP: np.array(stamps, np.int64), **_angles(found, columns)}
                none = np.full(len(messages), np.nan)
                for name in columns:
                    parts[name].append(found.get(name, none))
                count += len(messages)
        return {n: np.concatenate(p) if p else np.empty(0) for n, p in parts.items()}

    @cached_property
    def _reader(self) -> Any:
        reader: Any
        if self.is_ros1:
            from rosbags.rosbag1 import Reader as Reader1

            reader = Reader1(self.path)
        else:
            from rosbags.rosbag2 import Reader as Reader2

            listed = self.path.name in _listed(self.path)
            reader = Reader2(self.path.parent if listed else self.path)
        with self._faults():
            reader.open()
        if self.is_ros1:
            reader.chunks = {
                p: c._replace(decompressor=_bounded(c)) for p, c in reader.chunks.items()
            }
        return reader

    @cached_property
    def _topics(self) -> dict[str, Topic]:
        by_name: dict[str, list[Any]] = {}
        for connection in self._reader.connections:
            name = connection.topic if isinstance(connection.topic, str) else NAMELESS
            by_name.setdefault(name, []).append(connection)
        return {name: self._topic(name, found) for name, found in by_name.items()}

    @cached_property
    def _definitions(self) -> Definitions:
        from rosbags.interfaces import MessageDefinitionFormat as Format
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

        found: dict[str, Any] = {}
        known = [c for c in self._reader.connections if c.msgdef.format != Format.NONE]
        if len(known) < len(self._reader.connections):
            found |= get_typestore(Stores.LATEST).fielddefs
        for connection in known:
            text, kind = connection.msgdef.data, connection.msgtype
            parts = text.split("=" * 80 + "\n") if connection.msgdef.format == Format.IDL else []
            try:
                found |= {} if parts else get_types_from_msg(text, kind)
                for part in parts:
                    found |= get_types_from_idl(
                        part.split("\n", 1)[-1] if "IDL: " in part else part
                    )
            except Exception as error:  # of this type alone; the parser raises what it runs into
                self._faulty[kind] = str(error).split("\n")[0]
        return found

    @cached_property
    def _faulty(self) -> dict[str, str]:
        """What is wrong with definitions, by type."""
        return {}

    def _topic(self, name: str, connections: Sequence[Any]) -> Topic:
        kind = str(connections[0].msgtype)
        alike = tuple(c for c in connections if str(c.msgtype) == kind)
        notes = []
        if len(alike) < len(connections):
            notes.append("messages of other types under the same name are left out")
        columns: list[ColumnHead] = []
        try:
            columns = self._columns(kind, alike)
        except MalformedError as error:
            notes.append(f"cannot be read: {self._faulty.get(kind, error)}")
        rows = sum(c.msgcount for c in alike)
        head = TableHead(
            name, (ColumnHead(STAMP, "int64", "ns"), *columns), rows, STAMP, (*notes,), AXES
        )
        return Topic(alike, kind, head)

    def _columns(self, kind: str, connections: Sequence[Any]) -> list[ColumnHead]:
        """Columns of the first message; sequences may be longer later, which nothing uses."""
        with self._faults():
            first = next(iter(self._reader.messages(connections=list(connections))), None)
        if first is None:
            return []
        places = layout_of(self._definitions, kind, bytes(first[2]), not self.is_ros1).places
        heads = [
            ColumnHead(name, "int64" if dtype[1] == "t" else np.dtype(dtype).name, _unit(name))
            for name, (_, dtype) in places.items()
        ]
        virtual = [f"{q}.{angle}" for q in quaternions_in(places) for angle in ANGLES]
        return heads + [ColumnHead(name, "float64", "rad") for name in virtual]

    @contextmanager
    def _faults(self, read: Any = lambda: "") -> Iterator[None]:
        """Whatever the library raises at a damaged file is that the file is damaged."""
        try:
            yield
        except InputError:
            raise
        except Exception as error:
            what = f"is a damaged bag, {read()}" if read() else "is a damaged bag"
            told = str(error) or type(error).__name__
            raise InputError(f"{what}: {told}", str(self.path), REMEDY) from error


def _batches(reader: Any, connections: Sequence[Any]) -> Iterator[tuple[list[int], list[bytes]]]:
    """Stamps and messages, `BATCH` bytes at a time, as images may be among them."""
    stamps: list[int] = []
    messages: list[bytes] = []
    size = 0
    for _, stamp, data in reader.messages(connections=list(connections)):
        stamps.append(stamp)
        messages.append(bytes(data))
        size += len(data)
        if size > BATCH:
            yield stamps, messages
            stamps, messages, size = [], [], 0
    if messages:
        yield stamps, messages


def _bounded(chunk: Any) -> Callable[[bytes], bytes]:
    """The decompressor of a chunk, which stops at `MOST_CHUNK`: a few bytes may hold gigabytes."""
    from rosbags.rosbag1.reader import decompressors

    if chunk.decompressor is decompressors["none"]:
        return chunk.decompressor

    def unpack(data: bytes) -> bytes:
        import bz2

        from lz4.frame import LZ4FrameDecompressor

        packed = bz2.BZ2Decompressor if data.startswith(b"BZh") else LZ4FrameDecompressor
        found = packed().decompress(data, max_length=MOST_CHUNK + 1)
        if len(found) > MOST_CHUNK:
            raise MalformedError(f"a chunk unpacks to more than {MOST_CHUNK >> 20} MB")
        return found

    return unpack


def _unit(name: str) -> str:
    return "ns" if name.endswith(STAMPED) else ""


def _angles(found: dict[str, np.ndarray], columns: Sequence[str]) -> dict[str, np.ndarray]:
    asked: dict[str, np.ndarray] = {}
    for base, parts in quaternions_in(found).items():
        if any(f"{base}.{angle}" in columns for angle in ANGLES):
            turned = angles(*(found[part] for part in parts))
            asked |= {f"{base}.{a}": turned[a] for a in ANGLES if f"{base}.{a}" in columns}
    return asked


def _listed(path: Path) -> list[str]:
    """Names of the files of the ROS 2 bag in whose folder a file is, in order; [] in any other."""
    try:
        text = (path.parent / METADATA).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    items = [
        line.strip().lstrip("- ").removeprefix("path: ").strip("'\"") for line in text.splitlines()
    ]
    return list(dict.fromkeys(Path(item).name for item in items if item.endswith(path.suffix)))


READER = RosReader()
