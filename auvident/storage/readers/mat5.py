"""Elements of MAT files of version 5, looked through before scipy reads them.

scipy takes the number of a type from the file as an index and ends the process where there is
no such type. Format: MathWorks, MAT-File Format, chapter 1.
"""

import math
import struct
import zlib

HEADER = 128
BIG_ENDIAN = b"MI"  # the last two bytes of the header
INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13))
TEXT = NUMBERS | {16, 17, 18}
KNOWN = TEXT | {MATRIX}
CELL, STRUCT, OBJECT, CHAR, OPAQUE = 1, 2, 3, 4, 17  # classes of arrays
NUMERIC = frozenset((5, *range(6, 16)))  # sparse, double, single and whole numbers
SPARSE, SPARSE_PARTS = 5, 5  # dimensions, name, rows, columns, values
PLAIN_PARTS = 3  # dimensions, name, values
COMPLEX = 0x800  # a flag: an imaginary part follows
DEEPEST = 60  # structs in structs
MOST_UNPACKED = 1 << 31  # bytes of one compressed variable

Part = tuple[int, int, int]  # type of an element, where its data begin and end


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
    stated = struct.unpack_from(f"{order}I", data, start)[0]
    parts: list[Part] = []
    while at < end:
        kind, start, stop, at = _element(data, at, end, order)
        if kind not in _allowed(stated & 0xFF, len(parts)):
            raise ValueError(f"an element of type {kind} before byte {start}")
        if kind == MATRIX:
            _array(data, start, stop, kind, order, depth + 1)
        parts.append((kind, start, stop))
    if stated & 0xFF != OPAQUE:
        _refuse_missing(data, parts, stated, order, end)


def _allowed(class_: int, place: int) -> frozenset[int]:
    """Types of the element at a place behind the flags."""
    if class_ == OPAQUE:
        return KNOWN | {INT8, UTF8}
    if place == 0:
        return frozenset((INT32, UINT32))  # the second is written by other programs
    allowed = TEXT if class_ == CHAR else NUMBERS if class_ in NUMERIC else KNOWN
    return allowed | {INT8, UTF8} if place == 1 else allowed


def _refuse_missing(data: memoryview, parts: list[Part], flags: int, order: str, end: int) -> None:
    """Refuse an array of which something is missing: scipy takes what follows for it."""
    cut_short = f"an array that ends before byte {end} has not all of its parts"
    if not parts or (parts[0][2] - parts[0][1]) % 4 or parts[0][2] - parts[0][1] < 8:
        raise ValueError(f"an array that ends before byte {end} has no dimensions")
    size = math.prod(_whole(data, parts[0], order))
    class_ = flags & 0xFF
    if class_ in (CHAR, *NUMERIC):
        least = SPARSE_PARTS if class_ == SPARSE else PLAIN_PARTS
        if len(parts) < least + (class_ != CHAR and bool(flags & COMPLEX)):
            raise ValueError(cut_short)
    if class_ in (STRUCT, OBJECT):
        size *= _fields(data, parts[3 if class_ == OBJECT else 2 :], order, end)
    if class_ in (CELL, STRUCT, OBJECT) and sum(kind == MATRIX for kind, *_ in parts) < size:
        raise ValueError(cut_short)


def _fields(data: memoryview, parts: list[Part], order: str, end: int) -> int:
    """Number of fields of a struct, by the length of a name and that of all."""
    if len(parts) < 2 or parts[0][0] != INT32 or parts[0][2] - parts[0][1] != 4:
        raise ValueError(f"a struct that ends before byte {end} has no fields")
    (length,) = _whole(data, parts[0], order)
    if length <= 0:
        raise ValueError(f"a struct that ends before byte {end} has names of {length} letters")
    return (parts[1][2] - parts[1][1]) // length


def _whole(data: memoryview, part: Part, order: str) -> tuple[int, ...]:
    _, start, stop = part
    return struct.unpack_from(f"{order}{(stop - start) // 4}i", data, start)
