"""Global heaps of HDF5 files, looked through before the library reads them.

They hold texts and references of any length. At an entry of no length the library turns in circles,
where no signal reaches it. Format: HDF5 File Format Specification, III.E.
"""

import mmap
import struct
from pathlib import Path

MARK = b"GCOL\x01\0\0\0"  # signature, version, reserved
HEAD = 16  # bytes of mark and size
ENTRY = struct.Struct("<HHIQ")  # number, references, reserved, size; number 0 is what is free
ALIGNED = 8


def check(path: Path) -> None:
    """Refuse a heap with an entry at which the library never comes to the next one.

    Raises
    ------
    ValueError
        With the place of the heap.
    """
    with path.open("rb") as stream:
        if not path.stat().st_size:
            return
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            at = data.find(MARK)
            while at >= 0:
                if _is_endless(data, at):
                    raise ValueError(f"the heap at byte {at} has an entry of no length")
                at = data.find(MARK, at + 1)


def _is_endless(data: mmap.mmap, start: int) -> bool:
    """Whether an entry of a heap is followed by itself."""
    if start + HEAD > len(data):
        return False
    (size,) = struct.unpack_from("<Q", data, start + len(MARK))
    at, end = start + HEAD, min(start + size, len(data))
    while at + ENTRY.size <= end:
        number, _, _, length = ENTRY.unpack_from(data, at)
        step = length if number == 0 else ENTRY.size + length + -length % ALIGNED
        if step % 2**64 == 0:
            return True
        at += step
    return False
