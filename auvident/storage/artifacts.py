"""Serialisation of artifacts: JSON and Parquet as bytes, atomic files, hashes.

A file is written beside its place under a temporary name, flushed to the disk and renamed, so
that a reader, or a process killed at any moment, sees the old file or the new one.
"""

import errno
import hashlib
import io
import json
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ValidationError

from auvident.errors import NumericsError, StageError
from auvident.schema.channels import BY_COLUMN, FLAG_SUFFIX
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.quoting import clipped
from auvident.schema.trial import Columns
from auvident.storage.columns import arrow_of, read_columns
from auvident.storage.regular import MEGABYTE, irregular, read_small

if TYPE_CHECKING:
    import pandas as pd

Model = TypeVar("Model", bound=BaseModel)

TEMPORARY_SUFFIX = ".auvident-partial"  # of a file that is being written
STREAM = re.compile(r"/dev/(stdout|stderr)|/(?:dev|proc/self)/fd/(\d{1,9})")
STREAMS = {"stdout": 1, "stderr": 2}
MOST_LINKS = 40  # to follow, as Linux does
HASH_CHUNK = 1 << 20  # bytes read at a time
DAMAGED = "is damaged"  # how the problem of a file begins that is no JSON
MOST_JSON_BYTES = 256 * MEGABYTE  # the largest, a model of many trials, has 10
# Unit of a column by the end of its name, the longest first.
UNIT_SUFFIXES = {
    "_radps": "rad/s",
    "_degps": "deg/s",
    "_mps": "m/s",
    "_rad": "rad",
    "_deg": "deg",
    "_rpm": "1/min",
    "_m": "m",
    "_s": "s",
}
# Added to a name: in the same unit.
SAME_UNIT_SUFFIXES = ("_std", "_low", "_high", "_lo", "_hi", "_measured", "_simulated", "_ase")


def json_bytes(artifact: Any, name: str) -> bytes:
    """JSON text of a pydantic model or of plain containers.

    Raises
    ------
    NumericsError
        When a number is not finite; says which.
    """
    tree = plain(artifact)
    for place, value in _not_finite(tree, ""):
        raise NumericsError(f"{place} is {value}", name, "Please report this; see --verbose.")
    text = json.dumps(tree, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode(errors="backslashreplace")  # bytes of a name that are no UTF-8: \udcXX


def plain(tree: Any) -> Any:
    """Containers, strings and numbers of a model, also of models and arrays inside."""
    if isinstance(tree, BaseModel):
        return plain(tree.model_dump(by_alias=True))
    if isinstance(tree, Mapping):
        return {str(key): plain(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple | set | frozenset):
        return [plain(value) for value in tree]
    if hasattr(tree, "tolist"):  # numpy arrays and scalars
        return plain(tree.tolist())
    return tree if isinstance(tree, str | int | float | bool | None) else str(tree)


def _not_finite(tree: Any, place: str) -> Iterator[tuple[str, float]]:
    if isinstance(tree, float) and not math.isfinite(tree):
        yield place, tree
    elif isinstance(tree, dict):
        for key, value in tree.items():
            yield from _not_finite(value, f"{place}.{key}" if place else key)
    elif isinstance(tree, list):
        for number, value in enumerate(tree):
            yield from _not_finite(value, f"{place}[{number}]")


def read_json(path: Path, remedy: str = "") -> Any:
    """Plain content of a JSON artifact; `StageError` when it is missing or damaged."""
    try:
        content = read_small(path, MOST_JSON_BYTES, StageError)
        return json.loads(content.decode(), parse_constant=_refuse_constant)
    except FileNotFoundError:
        raise StageError("is missing", str(path), remedy) from None
    except OSError as error:
        raise StageError(f"cannot be read: {error.strerror}", str(path), remedy) from None
    except ValueError as error:
        raise StageError(f"{DAMAGED}: {clipped(str(error))}", str(path), remedy) from None
    except RecursionError:
        raise StageError(f"{DAMAGED}: it is nested too deeply", str(path), remedy) from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


def read_model(path: Path, model: type[Model], remedy: str = "") -> Model:
    """A JSON artifact as its class; `StageError` when it does not fit."""
    return as_model(read_json(path, remedy), model, path, remedy)


def as_model(tree: Any, model: type[Model], path: Path, remedy: str = "") -> Model:
    """Plain content as its class; `StageError` if it does not fit, or a later version wrote it."""
    _refuse_later(tree, model, path)
    try:
        return model.model_validate(tree)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(clipped(str(part)) for part in first["loc"])
        problem = f"{place}: {first['msg']}" if place else first["msg"]
        raise StageError(problem, str(path), remedy) from None


def _refuse_later(tree: Any, model: type[BaseModel], path: Path) -> None:
    """Refuse an artifact whose schema this version does not know yet."""
    field, found = model.model_fields.get("schema_"), None
    known = str(field.default) if field is not None else ""
    if isinstance(tree, dict):
        found = tree.get("schema")
    stem, _, number = known.rpartition("/")
    if not stem or not isinstance(found, str) or not found.startswith(f"{stem}/"):
        return
    later = found.removeprefix(f"{stem}/")
    if later.isdecimal() and later.isascii() and int(later[:9]) > int(number):
        raise StageError(
            f"schema is {clipped(found)!r}, which a later version of auvident wrote; this one "
            f"reads {known!r}",
            str(path),
            "Update auvident.",
        )


def unit_of(column: str) -> str:
    """Unit of a column of any table; ``bool`` for flags, ``1`` for numbers without unit."""
    if column in BY_COLUMN:
        return BY_COLUMN[column].unit
    for suffix in SAME_UNIT_SUFFIXES:
        if column.endswith(suffix):
            return unit_of(column.removesuffix(suffix))
    if column in ESTIMATED:
        return ESTIMATED[column].unit
    if column.endswith(FLAG_SUFFIX):
        return "bool"
    return next((u for suffix, u in UNIT_SUFFIXES.items() if column.endswith(suffix)), "1")


def parquet_bytes(table: "pd.DataFrame | Columns", metadata: Mapping[str, str]) -> bytes:
    """Parquet of a data frame or of arrays by name, with the unit of each column in its metadata.

    The unit stands under ``unit`` of the column, and under ``units`` (JSON) of the file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if isinstance(table, Mapping):
        plain = arrow_of(table)
    else:
        plain = pa.Table.from_pandas(table, preserve_index=False)
    units = {field.name: unit_of(field.name) for field in plain.schema}
    schema = pa.schema([f.with_metadata({"unit": units[f.name]}) for f in plain.schema])
    about = {**metadata, "units": json.dumps(units, ensure_ascii=False)}
    kept = {**(plain.schema.metadata or {}), **{k: v.encode() for k, v in about.items()}}
    # readings hardly repeat: a dictionary takes as long as the rest, and a sixth of the file
    repeating = [field.name for field in schema if not pa.types.is_floating(field.type)]
    stream = io.BytesIO()
    whole = pa.Table.from_arrays(plain.columns, schema=schema.with_metadata(kept))
    pq.write_table(whole, stream, use_dictionary=repeating)
    return stream.getvalue()


def read_table(path: Path, remedy: str = "") -> "pd.DataFrame":
    """A Parquet artifact; `StageError` when it is missing or damaged."""
    import pandas as pd

    with _readable(path, remedy):
        return pd.read_parquet(path)


def read_arrays(path: Path, remedy: str = "") -> Columns:
    """Numbers and flags of a Parquet artifact; `StageError` when it is missing or damaged."""
    with _readable(path, remedy):
        return read_columns(path)


@contextmanager
def _readable(path: Path, remedy: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise StageError("is missing", str(path), remedy) from None
    except (OSError, ValueError) as error:
        raise StageError(f"cannot be read: {error}", str(path), remedy) from None


def sha256_of(path: Path) -> str | None:
    """Hash of a file's content; None when there is no such file."""
    digest = hashlib.sha256()
    if irregular(path):
        return None
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(HASH_CHUNK):
                digest.update(chunk)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None
    except ValueError:  # no file has such a name
        return None
    return digest.hexdigest()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all, and stays after a power cut.

    A device or a pipe is written to as it is, and never replaced by a file, nor is what stands
    behind an open stream (``/dev/stdout``); a link stays, and leads to what was written.
    """
    stream = stream_of(path)
    if stream is not None:
        _write_into(path, content, stream)
        return
    if path.is_symlink():
        path = path.resolve()
    mode = _mode(path)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if mode and not stat.S_ISREG(mode):
        _write_into(path, content)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, content)


def stream_of(path: Path) -> int | None:
    """Number of the open stream that a path, or a link, names; None for any other file.

    What is behind it is no file to be replaced: a pipe has no name, and a file of ``>`` or ``>>``
    may hold what others have written.
    """
    for _ in range(MOST_LINKS):
        named = STREAM.fullmatch(os.path.abspath(path))
        if named:
            return STREAMS[named[1]] if named[1] else int(named[2])
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None


def _mode(path: Path) -> int:
    """Kind of what stands at a path; 0 for nothing."""
    try:
        return path.stat().st_mode
    except OSError:
        return 0


def _write_into(path: Path, content: bytes, number: int | None = None) -> None:
    """Write into a device, or into the open stream of a number, which stays open."""
    try:
        with open(path if number is None else os.dup(number), "wb") as stream:
            stream.write(content)
    except BrokenPipeError as error:
        if number not in STREAMS.values():  # a reader of the output may leave
            raise _named(error, path) from None
    except OSError as error:
        raise _named(error, path) from None


def _named(error: OSError, path: Path) -> OSError:
    """An error with the name of the file; those of a full disk come without."""
    return OSError(error.errno, error.strerror, str(path))


def _replace(path: Path, content: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY_SUFFIX}")
    try:
        temporary.unlink(missing_ok=True)
        with temporary.open("xb") as stream:  # never through a link of that name
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _named(error, path) from None
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make the renaming durable where the system can."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError:  # file systems that do not sync folders
        pass
    finally:
        os.close(descriptor)
