"""Bytes of a text log: decompressed, in UTF-8, with one kind of line end."""

import codecs
import zlib
from pathlib import Path

from auvident.errors import InputError
from auvident.storage.regular import MEGABYTE, refuse_irregular

HEAD_BYTES = 1 << 18  # enough for any header block; the rest is read only when it is wanted
LONG_HEAD_BYTES = 64 * HEAD_BYTES  # where a line is longer: some 100,000 columns
# Logs pack 5 to 20 times: what is noise does not pack, and only a bomb is beyond both of these.
MOST_TIMES = 100
MOST_UNPACKED = 256 * MEGABYTE
GZIP_MAGIC = b"\x1f\x8b"
GZIP_WINDOW = 31  # zlib's code for "gzip wrapper, largest window"
OTHER_FORMATS: dict[bytes, str] = {
    b"PK\x03\x04": "a ZIP archive (or a spreadsheet)",
    b"\x89HDF": "an HDF5 file",
    b"ULog": "a PX4 ULog",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet",
    b"MATLAB 5.0": "a MATLAB file",
    b"#ROSBAG": "a ROS bag",
}
MAX_CONTROL_SHARE = 0.02  # of the first bytes; text logs have none but line ends and tabs
TEXT_CONTROLS = b"\t\n\r\f\x1a"
CONTROLS = bytes(c for c in (*range(32), 0x7F) if c not in TEXT_CONTROLS)
OR_WITHOUT = "Export it again, or leave it out."
REMEDY = "Give CSV (plain or gzip) or Parquet files with one row of column names."


def read_text(path: Path, limit: int | None = None) -> tuple[bytes, bool]:
    """Contents of a text file as UTF-8 with ``\\n`` line ends.

    Parameters
    ----------
    path : Path
        A text file, plain or compressed with gzip.
    limit : int, optional
        Read about this many bytes only.

    Returns
    -------
    content : bytes
        The text.
    cut : bool
        The compressed stream ends too early, or the file ends in zero bytes (power cut).

    Raises
    ------
    InputError
        When the file cannot be read, is empty or is no text.
    """
    raw, cut = _read_bytes(path, limit)
    if not raw.strip(b"\x00 \t\r\n\xef\xbb\xbf"):
        raise InputError("is empty", str(path), OR_WITHOUT)
    _refuse_other_formats(raw, path)
    text = _to_utf8(raw)
    stripped = text.rstrip(b"\x00")
    _refuse_binary(stripped, path)
    if b"\r" in stripped:
        stripped = stripped.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return stripped, cut or len(stripped) < len(text.rstrip(b"\r"))


def _read_bytes(path: Path, limit: int | None) -> tuple[bytes, bool]:
    refuse_irregular(path)
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == GZIP_MAGIC
            stream.seek(0)
            raw = stream.read(limit if limit is not None else -1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error
    return _gunzip(raw, path, limit) if packed else (raw, False)


def _gunzip(raw: bytes, path: Path, limit: int | None) -> tuple[bytes, bool]:
    """Decompress what is there; a stream that ends too early keeps its readable part."""
    parts: list[bytes] = []
    finished = True
    most = limit if limit is not None else max(MOST_UNPACKED, MOST_TIMES * len(raw))
    while raw.startswith(GZIP_MAGIC) and most > 0:  # appended logs are several members
        member = zlib.decompressobj(GZIP_WINDOW)
        try:
            part = member.decompress(raw, most)
        except zlib.error as error:
            raise InputError(f"is damaged gzip: {error}", str(path), REMEDY) from error
        parts.append(part)
        finished, raw, most = member.eof, member.unused_data, most - len(part)
        if limit is None and most == 0 and (raw or not finished):
            raise _is_bomb(path)
    return b"".join(parts), limit is None and not finished


def _is_bomb(path: Path) -> InputError:
    return InputError(
        f"unpacks to more than {MOST_UNPACKED // MEGABYTE} MB and {MOST_TIMES} times its size, "
        "which no log does",
        str(path),
        "Unpack it, check its content, and give the unpacked file.",
    )


def _refuse_other_formats(raw: bytes, path: Path) -> None:
    for magic, what in OTHER_FORMATS.items():
        if raw.startswith(magic):
            raise InputError(f"is {what}, not a text log", str(path), REMEDY)


def _to_utf8(raw: bytes) -> bytes:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="replace").encode()
    raw = raw.removeprefix(codecs.BOM_UTF8)
    try:
        raw[:HEAD_BYTES].decode("utf-8")
    except UnicodeDecodeError as error:
        cut_inside_a_character = error.start >= min(len(raw), HEAD_BYTES) - 3
        if not cut_inside_a_character:
            return raw.decode("latin-1").encode()
    return raw


def _refuse_binary(text: bytes, path: Path) -> None:
    head = text[:HEAD_BYTES]
    controls = len(head) - len(head.translate(None, CONTROLS))
    if controls > MAX_CONTROL_SHARE * len(head):
        raise InputError("is not text: it contains binary data", str(path), REMEDY)
