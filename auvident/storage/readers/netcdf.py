"""NetCDF with the CF conventions: version 4 by h5netcdf, the classic form by scipy.

A table is what has one dimension of records; its time is the coordinate of that dimension.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers import hdf5_heap
from auvident.storage.readers.fields import (
    MOST_VALUES,
    Field,
    Tree,
    instants,
    is_time_unit,
    tree_of,
)
from auvident.storage.readers.hdf5 import MAGIC
from auvident.storage.readers.interface import DAMAGED_REMEDY
from auvident.storage.readers.registry import need

CLASSIC = (b"CDF\x01", b"CDF\x02")
EXTRA = "netcdf"
ROOT = "records"


@dataclass(frozen=True)
class Variable:
    """A variable of either form: names of its axes, attributes, values when asked for."""

    path: tuple[str, ...]
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: Mapping[str, Any]
    load: Callable[[], np.ndarray]


@dataclass(frozen=True)
class NetcdfReader:
    """NetCDF files (``.nc``)."""

    name: str = "NetCDF"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first bytes."""
        return head.startswith((MAGIC, *CLASSIC))

    def open(self, path: Path) -> Tree:
        """Find the variables."""
        with path.open("rb") as stream:
            classic = stream.read(4) in CLASSIC
        notes: list[str] = []
        try:
            variables = _classic(path) if classic else _version_4(path)
        except InputError:
            raise
        except Exception as error:  # the libraries raise whatever a damaged file leads them into
            told = str(error) or type(error).__name__
            raise InputError(f"is damaged NetCDF: {told}", str(path), DAMAGED_REMEDY) from error
        fields = [_field(path, one) for one in variables if _is_series(one, notes)]
        return tree_of(path, fields, ROOT, "/", notes)


def _is_series(one: Variable, notes: list[str]) -> bool:
    if one.dtype.kind not in "biuf":
        if one.shape:
            notes.append(f"{'/'.join(one.path)} holds {one.dtype}, not numbers")
        return False
    return bool(one.shape) and 0 < np.prod(one.shape, dtype=float) <= MOST_VALUES


def _field(path: Path, one: Variable) -> Field:
    unit = _text(one.attributes.get("units", ""))
    is_time = is_time_unit(unit) or (len(one.shape) == 1 and one.path[-1] == one.dimensions[0])
    where = f"{path}, {'/'.join(one.path)}"

    def load() -> np.ndarray:
        values = unpacked(one.load(), one.attributes)
        return instants(values, unit, where) if is_time_unit(unit) else values

    axis = one.dimensions[0]
    return Field(one.path, one.shape, one.dtype, load, unit, "yes" if is_time else "no", axis)


def unpacked(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray:
    """Numbers of a packed variable (CF 8.1), NaN where it is filled or missing (CF 2.5.1)."""
    fills = [attributes[name] for name in ("_FillValue", "missing_value") if name in attributes]
    packed = {"scale_factor", "add_offset"} & set(attributes)
    if not fills and not packed:
        return values
    missing = np.isin(values, np.concatenate([np.ravel(fill) for fill in (*fills, ())]))
    if values.dtype.kind in "iu" and not packed and not missing.any():
        return values
    scale, offset = (
        float(np.ravel(attributes.get(name, default))[0])
        for name, default in (("scale_factor", 1.0), ("add_offset", 0.0))
    )
    return np.where(missing, np.nan, values.astype(float) * scale + offset)


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A file of version 4.

    h5py opens it first, and reads its attributes: where these are damaged, h5netcdf leaves an
    object that complains on standard error when it is collected.
    """
    h5netcdf, h5py = need("h5netcdf", EXTRA, path), need("h5py", EXTRA, path)
    with h5py.File(path, "r") as bare:
        bare.attrs.get("_nc3_strict")  # as h5netcdf does next
        with h5netcdf.File(bare, "r") as file:
            yield file


def _version_4(path: Path) -> list[Variable]:
    hdf5_heap.check(path)
    with _opened(path) as file:
        return list(_group(path, file, ()))


def _group(path: Path, group: Any, above: tuple[str, ...]) -> Iterator[Variable]:
    for name, found in group.variables.items():
        own = (*above, name)
        if len(found.shape) != len(found.dimensions):
            continue
        yield Variable(
            own,
            tuple(found.dimensions),
            tuple(int(n) for n in found.shape),
            np.dtype(found.dtype),
            {key: found.attrs[key] for key in found.attrs},
            _loader(path, "/".join(own)),
        )
    for name, below in group.groups.items():
        yield from _group(path, below, (*above, name))


def _loader(path: Path, place: str) -> Callable[[], np.ndarray]:
    def load() -> np.ndarray:
        with _opened(path) as file:
            return np.asarray(file[place][...])

    return load


def _classic(path: Path) -> list[Variable]:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        return [
            Variable(
                (name,),
                tuple(found.dimensions),
                tuple(int(n) for n in found.shape),
                found.data.dtype.newbyteorder("="),
                {
                    key: value
                    for key, value in vars(found).items()
                    if key in ("units", "_FillValue", "missing_value", "scale_factor", "add_offset")
                },
                _held(found.data),
            )
            for name, found in file.variables.items()
        ]


def _held(values: np.ndarray) -> Callable[[], np.ndarray]:
    plain = values.astype(values.dtype.newbyteorder("="))
    return lambda: plain


READER = NetcdfReader()
