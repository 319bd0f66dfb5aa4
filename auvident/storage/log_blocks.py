"""A long text log in blocks of whole lines, so that it need not fit into memory at once."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from auvident.storage.log_text import GZIP_MAGIC

BLOCK_BYTES = 1 << 24  # two minutes of a wide log at 1 kHz, some of a gyro at 100 Hz


class OddBytes(Exception):
    """The file has to be read as a whole: what it holds shows only then. Never leaves `storage`."""


def blocks(path: Path, first_line: int) -> Iterator[tuple[int, bytes]]:
    """Blocks of plain text from a line on, each with the number of its first line.

    Parameters
    ----------
    path : Path
        A text file, plain or compressed with gzip.
    first_line : int
        Lines before it, counted from 0, are left out.

    Yields
    ------
    line : int
        Number of the first line of the block.
    block : bytes
        ASCII with ``\\n`` line ends; only the last one may end within a line.

    Raises
    ------
    OddBytes
        Other characters, zero bytes, line ends of old or a damaged compression: `read_text` of
        `auvident.storage.log_text` knows what to do with these.
    """
    line, skip, rest = first_line, first_line, b""
    try:
        with _opened(path) as stream:
            while raw := stream.read(BLOCK_BYTES):
                whole, mark, rest = (rest + raw).rpartition(b"\n")
                block = _without_lines(_unix(whole + mark), skip)
                skip = 0
                yield line, _plain(block)
                line += block.count(b"\n")
    except (OSError, EOFError, zlib.error) as error:
        raise OddBytes(str(error)) from error
    yield line, _plain(_unix(rest))


def _opened(path: Path) -> IO[bytes] | gzip.GzipFile:
    with path.open("rb") as stream:
        packed = stream.read(2) == GZIP_MAGIC
    return gzip.open(path) if packed else path.open("rb")


def _unix(block: bytes) -> bytes:
    return block.replace(b"\r\n", b"\n") if b"\r" in block else block


def _without_lines(block: bytes, count: int) -> bytes:
    start = 0
    for _ in range(count):
        start = block.find(b"\n", start) + 1
        if not start:
            raise OddBytes("the header is longer than a block")
    return block[start:]


def _plain(block: bytes) -> bytes:
    if not block.isascii() or b"\0" in block or b"\r" in block:
        raise OddBytes("other than ASCII")
    return block
