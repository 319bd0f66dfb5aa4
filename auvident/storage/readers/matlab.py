"""MATLAB: arrays and structs of a MAT file; version 5 by scipy, 7.3 (which is HDF5) by h5py.

Objects (timetable, table, datetime) are stored in a form that MATLAB does not publish.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers.fields import MOST_VALUES, Field, Tree, tree_of
from auvident.storage.readers.hdf5 import Hdf5Style, open_hdf5
from auvident.storage.readers.interface import DAMAGED_REMEDY
from auvident.storage.readers.mat5 import check

VERSION_73 = b"MATLAB 7.3 MAT-file"
VERSION_5 = b"MATLAB 5.0 MAT-file"
EXTRA = "hdf5"
ROOT = "workspace"
OBJECTS = "#subsystem#", "#refs#"  # where version 7.3 keeps objects and cells
REMEDY = (
    "In MATLAB save structs of numbers: s = table2struct(timetable2table(T), 'ToScalar', true); "
    "s.time_s = seconds(T.Time - T.Time(1)); save('trial.mat', '-struct', 's')."
)
NOT_NUMBERS = {b"char": "is text", b"cell": "is a cell array, not a column"}


def _refused_73(attributes: Any) -> str:
    """Why an array of version 7.3 is no column, or ""."""
    if "MATLAB_object_decode" in attributes:
        return f"is a MATLAB object, such as a timetable. {REMEDY}"
    if "MATLAB_empty" in attributes:
        return "is empty"
    kind = attributes.get("MATLAB_class", b"")
    return NOT_NUMBERS.get(kind if isinstance(kind, bytes) else str(kind).encode(), "")


STYLE_73 = Hdf5Style(EXTRA, ROOT, ".", OBJECTS, transposed=True, refused=_refused_73)


@dataclass(frozen=True)
class MatlabReader:
    """MAT files (``.mat``)."""

    name: str = "MATLAB MAT"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the text at the beginning."""
        return head.startswith((VERSION_73, VERSION_5))

    def open(self, path: Path) -> Tree:
        """Find the variables."""
        with path.open("rb") as stream:
            is_hdf5 = stream.read(len(VERSION_73)) == VERSION_73
        tree = open_hdf5(path, STYLE_73) if is_hdf5 else _open_5(path)
        if not tree.tables:
            told = "; ".join(tree.notes)
            raise InputError(f"has no array of numbers{told and f': {told}'}", str(path), REMEDY)
        return tree


def _open_5(path: Path) -> Tree:
    from scipy.io import loadmat, whosmat

    notes: list[str] = []
    try:
        check(path.read_bytes())
        shapes = whosmat(path)
        kept = [name for name, shape, _ in shapes if np.prod(shape, dtype=float) <= MOST_VALUES]
        held = loadmat(path, variable_names=kept, squeeze_me=True) if kept else {}
    except Exception as error:  # at damaged files the library raises whatever it runs into
        told = str(error) or type(error).__name__
        raise InputError(f"is a damaged MAT file: {told}", str(path), DAMAGED_REMEDY) from error
    notes += [f"{name} is said to be {shape}" for name, shape, _ in shapes if name not in kept]
    fields: list[Field] = []
    for name, value in held.items():
        if not name.startswith("__"):
            fields += _fields(value, (name,), notes)
    return tree_of(path, fields, ROOT, ".", notes)


def _fields(value: Any, path: tuple[str, ...], notes: list[str]) -> Iterator[Field]:
    kind = type(value).__name__
    place = ".".join(path)
    if path[-1] in ("None", "__function_workspace__") or kind in ("MatlabOpaque", "MatlabFunction"):
        notes.append(f"{place} is a MATLAB object, such as a timetable. {REMEDY}")
        return
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names:
        yield from _struct(value, path, notes)
    elif value.dtype.kind in "biufU" and value.ndim and value.size:
        yield _field(value, path)
    elif value.dtype.kind == "O" and value.size:
        notes.append(f"{place} is a cell array, not a column")


def _struct(value: np.ndarray, path: tuple[str, ...], notes: list[str]) -> Iterator[Field]:
    """A struct of arrays, or an array of structs of single numbers."""
    for name in value.dtype.names or ():
        if value.ndim == 0:
            yield from _fields(value[name].item(), (*path, name), notes)
            continue
        each = value[name].ravel()
        numbers = [v for v in each if np.ndim(v) == 0 and isinstance(v, int | float | np.number)]
        if len(numbers) == each.size:
            yield _field(np.array(numbers, dtype=float), (*path, name))
        else:
            notes.append(f"{'.'.join((*path, name))} is an array of structs of arrays")


def _field(values: np.ndarray, path: tuple[str, ...]) -> Field:
    plain = values.astype(object) if values.dtype.kind == "U" else values
    return Field(path, plain.shape, plain.dtype, lambda: plain)


READER = MatlabReader()
