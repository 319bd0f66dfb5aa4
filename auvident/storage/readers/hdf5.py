"""HDF5: groups of arrays, units in the attribute ``units``; by the library h5py.

Links out of the file are not followed, nor is data that lies in other files.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers import hdf5_heap
from auvident.storage.readers.fields import (
    Field,
    Tree,
    instants,
    is_time_unit,
    tree_of,
)
from auvident.storage.readers.interface import DAMAGED_REMEDY
from auvident.storage.readers.registry import need

MAGIC = b"\x89HDF\r\n\x1a\n"
EXTRA = "hdf5"
UNITS = ("units", "unit", "Units", "Unit")
DEEPEST = 20  # groups within groups


@dataclass(frozen=True)
class Hdf5Reader:
    """Files of arrays in groups (``.h5``, ``.hdf5``)."""

    name: str = "HDF5"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first bytes."""
        return head.startswith(MAGIC)

    def open(self, path: Path) -> Tree:
        """Find the arrays."""
        return open_hdf5(path, Hdf5Style(EXTRA))


@dataclass(frozen=True)
class Hdf5Style:
    """What formats that are HDF5 inside have of their own.

    Attributes
    ----------
    extra : str
        Of the package, that has the library.
    root, mark : str
        Table of what stands in no group; what is between the names of groups.
    hidden : tuple of str
        Groups that are left out.
    transposed : bool
        Whether arrays are stored columns first.
    refused : callable
        Reason to leave an array out by its attributes, or "".
    """

    extra: str
    root: str = "/"
    mark: str = "/"
    hidden: tuple[str, ...] = ()
    transposed: bool = False
    refused: Callable[[Any], str] = lambda attributes: ""


def open_hdf5(path: Path, style: Hdf5Style) -> Tree:
    """Tables of an HDF5 file."""
    h5py = need("h5py", style.extra, path)
    notes: list[str] = []
    try:
        hdf5_heap.check(path)
        with h5py.File(path, "r") as file:
            fields = list(_fields(file, (), Looked(h5py, path, style, notes), {hash(file.id)}))
    except InputError:
        raise
    except Exception as error:  # the library raises whatever a damaged file leads it into
        raise InputError(f"is damaged HDF5: {error}", str(path), DAMAGED_REMEDY) from error
    return tree_of(path, fields, style.root, style.mark, notes)


@dataclass(frozen=True)
class Looked:
    """What looking through a file takes along: library, file, style, and what could not be read."""

    h5py: Any
    path: Path
    style: Hdf5Style
    notes: list[str]


def _fields(group: Any, above: tuple[str, ...], looked: Looked, seen: set[int]) -> Iterator[Field]:
    h5py, notes = looked.h5py, looked.notes
    for name in group:
        own = (*above, name)
        place = looked.style.mark.join(own)
        if not above and name in looked.style.hidden:
            continue
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            notes.append(f"{place} is a link, which is not followed")
            continue
        item = group[name]
        key = hash(item.id)
        if isinstance(item, h5py.Group):
            if key in seen or len(own) > DEEPEST:
                notes.append(f"{place} leads back to a group above it")
                continue
            yield from _fields(item, own, looked, seen | {key})
        elif isinstance(item, h5py.Dataset):
            yield from _dataset(item, own, looked)


def _dataset(item: Any, own: tuple[str, ...], looked: Looked) -> Iterator[Field]:
    h5py, notes = looked.h5py, looked.notes
    place = looked.style.mark.join(own)
    if why := looked.style.refused(item.attrs):
        notes.append(f"{place} {why}")
        return
    if item.external or item.is_virtual:
        notes.append(f"{place} lies in another file, which is not read")
        return
    shape = item.shape[::-1] if looked.style.transposed and item.shape else item.shape
    if shape is None or not (long := _long(shape)):
        return
    names = item.dtype.names
    if names is None:
        if _is_usable(h5py, item.dtype):
            yield _field(item, own, long, "", looked)
        else:
            notes.append(f"{place} holds {item.dtype}, not numbers")
        return
    for name in names:  # a table in one array: its fields are columns
        if item.dtype[name].names is None and _is_usable(h5py, item.dtype[name]):
            yield _field(item, (*own, name), long, name, looked)


def _long(shape: tuple[int, ...]) -> tuple[int, ...]:
    """A shape without axes of length 1; empty for what is no series."""
    long = tuple(n for n in shape if n != 1)
    return () if 0 in long else long


def _is_usable(h5py: Any, dtype: np.dtype) -> bool:
    return dtype.kind in "biufS" or h5py.check_string_dtype(dtype) is not None


def _field(
    item: Any, own: tuple[str, ...], long: tuple[int, ...], part: str, looked: Looked
) -> Field:
    h5py, path, place = looked.h5py, looked.path, item.name
    unit = "" if part else _unit(item)
    transposed = looked.style.transposed

    def load() -> np.ndarray:
        with h5py.File(path, "r") as file:
            data = file[place]
            values = data[part] if part else data[()]
        values = np.asarray(values)
        values = (values.T if transposed else values).reshape(long)
        if values.dtype.kind in "SO":
            return _texts(values)
        return instants(values, unit, f"{path}, {place}") if is_time_unit(unit) else values

    dtype = item.dtype[part] if part else item.dtype
    stamp = "yes" if is_time_unit(unit) and own[-1].lower() != "epoch" else ""
    return Field(own, long, dtype, load, unit, stamp)


def _texts(values: np.ndarray) -> np.ndarray:
    texts = [v.decode(errors="replace") if isinstance(v, bytes) else str(v) for v in values.flat]
    return np.array(texts, dtype=object).reshape(values.shape)


def _unit(item: Any) -> str:
    for name in UNITS:
        if name in item.attrs:
            unit = item.attrs[name]
            unit = unit[0] if isinstance(unit, np.ndarray) and unit.size == 1 else unit
            return unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
    return ""


READER = Hdf5Reader()
