"""Elements of MAT files of version 5, looked through before scipy reads them.

scipy takes the number of a type from the file as an index and ends the process where there is
no such type. Format: MathWorks, MAT-File Format, chapter 1.
"""

import struct
import zlib

HEADER = 128
BIG_ENDIAN = b"MI"  # the last two bytes of the header
INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13))
TEXT = NUMBERS | {16, 17, 18}
KNOWN = TEXT | {MATRIX}
CHAR, OPAQUE = 4, 17  # classes of arrays
NUMERIC = frozenset((5, *range(6, 16)))  # sparse, double, single and whole numbers
DEEPEST = 60  # structs in structs
MOST_UNPACKED = 1 << 31  # bytes of one compressed variable


def check(content: bytes) -> None:
    """Refuse what no program that writes MAT files writes.

    Raises
    ------
    ValueError
        With what is wrong, and where.
    """
    order = ">" if content[HEADER - 2 : HEADER] == BIG_ENDIAN else "<"
    data, at = memoryview(content), HEADER
    while at + 8 <= len(data):
        kind, start, end, at = _element(data, at, len(data), order)
        if kind == COMPRESSED:
            own = memoryview(_unpacked(data[start:end], start))
            if len(own) < 8:
                raise ValueError(f"the compressed variable at byte {start} is empty")
            kind, start, end, _ = _element(own, 0, len(own), order)
            _array(own, start, end, kind, order, 0)
        else:
            _array(data, start, end, kind, order, 0)


def _element(data: memoryview, at: int, end: int, order: str) -> tuple[int, int, int, int]:
    """Type of an element, where its data begin and end, and where the next one begins."""
    if at + 8 > end:
        raise ValueError(f"an element is cut off at byte {at}")
    kind, size = struct.unpack_from(f"{order}II", data, at)
    if kind >> 16:  # a small one, its data within the tag
        if kind >> 16 > 4:
            raise ValueError(f"an element at byte {at} has no type")
        return kind & 0xFFFF, at + 4, at + 4 + (kind >> 16), at + 8
    start = at + 8
    if size > end - start:
        raise ValueError(f"an element at byte {at} is longer than what is left")
    pad = 0 if kind in (MATRIX, COMPRESSED) else -size % 8
    return kind, start, start + size, start + size + pad


def _unpacked(packed: memoryview, at: int) -> bytes:
    unpack = zlib.decompressobj()
    try:
        found = unpack.decompress(packed, MOST_UNPACKED)
    except zlib.error as error:
        raise ValueError(f"the compressed variable at byte {at} is damaged: {error}") from error
    if unpack.unconsumed_tail:
        raise ValueError(f"a variable unpacks to more than {MOST_UNPACKED >> 20} MB")
    return found


def _array(data: memoryview, at: int, end: int, kind: int, order: str, depth: int) -> None:
    """An array: its flags, dimensions and name, then its data or the arrays in it."""
    if kind != MATRIX:
        raise ValueError(f"an element of type {kind} before byte {at} is no array")
    if depth > DEEPEST:
        raise ValueError(f"more than {DEEPEST} structs are nested")
    if at == end:
        return
    flags, start, stop, at = _element(data, at, end, order)
    if flags != UINT32 or stop - start != 8:
        raise ValueError(f"an array without flags before byte {start}")
    kind_of = struct.unpack_from(f"{order}I", data, start)[0] & 0xFF
    first = 0
    while at < end:
        kind, start, stop, at = _element(data, at, end, order)
        allowed = TEXT if kind_of == CHAR else NUMBERS if kind_of in NUMERIC else KNOWN
        if first == 0 and kind_of != OPAQUE:
            allowed = frozenset((INT32, UINT32))  # the second is written by other programs
        elif first == 1 or kind_of == OPAQUE:
            allowed = allowed | {INT8, UTF8}
        if kind not in allowed:
            raise ValueError(f"an element of type {kind} before byte {start}")
        if kind == MATRIX:
            _array(data, start, stop, kind, order, depth + 1)
        first += 1
