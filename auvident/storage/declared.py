"""Readers of the TOML files that users write: vehicle, column map, plan."""

import codecs
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from auvident.errors import InputError
from auvident.schema.quoting import clipped
from auvident.storage.regular import MEGABYTE, read_small

MOST_BYTES = 4 * MEGABYTE  # 100,000 stations of a hull have 2 MB
MOST_LEVELS = 100  # of a dotted key; each level costs the parser the whole key again
MOST_FOLDERS = 100  # of a pattern; each goes one call deeper in the search of Python 3.11
DOTTED_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){""" + f"{MOST_LEVELS}}}"
)
MOST_FAULTS = 10  # of one file in a message
LIST_ASKED_FOR, TOO_SHORT = ("tuple_type", "list_type"), ("too_short",)  # faults of pydantic

Model = TypeVar("Model", bound=BaseModel)

_OUTSIDE = ContextVar("paths in declared files may leave their folder", default=False)
OUTSIDE_REMEDY = "Copy it there, or give --allow-outside."
TABLE_ON_ONE_LINE = re.compile(r"^[ \t]*(?P<table>\[[\w.-]+\])[ \t]+[\w.-]+[ \t]*=", re.MULTILINE)
SYNTAX_REMEDY = (
    "Correct it there: key = value on a line of its own, tables as [name] (as [[name]] where "
    "there may be several), text in quotes, and numbers with a decimal point."
)


@contextmanager
def outside_allowed(allowed: bool) -> Iterator[None]:
    """Whether files that are named in a declared file may stand outside of its folder.

    Not unless the user says so: vehicle and map files are passed on, and what they name is read
    and quoted in messages.
    """
    token = _OUTSIDE.set(allowed)
    try:
        yield
    finally:
        _OUTSIDE.reset(token)


def file_named_in(path: Path, name: str, key: str) -> Path:
    """The file that a declared file names, relative to its own folder.

    Parameters
    ----------
    path : Path
        The declared file.
    name : str
        As it stands there.
    key : str
        Where it stands, for messages.

    Raises
    ------
    InputError
        It is no name of a file, or lies outside of the folder.
    """
    if not name.strip() or "\0" in name:
        raise InputError(f"{clipped(name)!r} is not a file name", f"{path}: {key}")
    found, folder = path.parent / name, path.parent.resolve()
    if not _OUTSIDE.get() and not found.resolve().is_relative_to(folder):
        raise _is_outside(f"{clipped(name)!r} is outside the folder of this file", path, key)
    return found


def refuse_outside(patterns: Mapping[str, str], path: Path) -> None:
    """Refuse patterns of files, by the key they stand under, that lead out of the log folder.

    Raises
    ------
    InputError
    """
    for key, pattern in patterns.items():
        parts = re.split(r"[\\/]", pattern)
        if not _OUTSIDE.get() and (".." in parts or not parts[0] or re.match("[A-Za-z]:", pattern)):
            problem = f"the pattern {clipped(pattern)!r} leads out of the log folder"
            raise _is_outside(problem, path, key)


def fitting(pattern: str, folder: Path, where: str, example: str) -> list[Path]:
    """Files and folders below a folder that a pattern means, in order.

    Parameters
    ----------
    where : str
        File and key, for the message.
    example : str
        A pattern as it should be.

    Raises
    ------
    InputError
        It is no pattern.
    """
    try:
        _check_parts(pattern.split("/"))
        return sorted(folder.glob(pattern))
    except (ValueError, NotImplementedError) as error:
        raise InputError(
            f"{clipped(pattern)!r} is not a valid pattern: {error}",
            where,
            f"Give a name relative to the folder, e.g. {example}.",
        ) from None


def _check_parts(parts: Sequence[str]) -> None:
    """Refuse what some versions of Python take for a pattern and others do not."""
    if len(parts) > MOST_FOLDERS:
        raise ValueError(f"more than {MOST_FOLDERS} folders")
    if any("**" in part and part != "**" for part in parts):
        raise ValueError("'**' stands for whole folders only")


FOLDER = "Name a TOML file; the folder of a log is an argument, and no option."


def _is_outside(problem: str, path: Path, key: str) -> InputError:
    return InputError(problem, f"{path}: {key}", OUTSIDE_REMEDY)


def read_toml(path: Path) -> dict:
    """Read a TOML file, with file and line in the error."""
    try:
        content = read_small(path, MOST_BYTES).removeprefix(codecs.BOM_UTF8)
        text = content.decode()
        if DOTTED_KEY.search(text):
            raise InputError(f"has a key of more than {MOST_LEVELS} levels", str(path))
        return tomllib.loads(text.replace("\r\n", "\n").replace("\r", "\n"))
    except FileNotFoundError:
        raise InputError("no such file", str(path), "Check the path.") from None
    except IsADirectoryError:
        raise InputError("is a folder, not a TOML file", str(path), FOLDER) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error
    except UnicodeDecodeError as error:
        raise _no_utf8(content, error, path) from None
    except tomllib.TOMLDecodeError as error:
        problem = f"is not valid TOML: {clipped(str(error))}"
        raise InputError(problem, str(path), _syntax_remedy(text)) from error
    except RecursionError:
        raise InputError("is nested too deeply", str(path), "Check the brackets.") from None
    except ValueError as error:  # of a number with thousands of digits
        raise InputError(
            f"has a number that cannot be read: {clipped(str(error))}",
            str(path),
            "Correct it: no number here needs more than twenty digits.",
        ) from None


def _syntax_remedy(text: str) -> str:
    """What to do about a fault of syntax, such as a table on one line, as messages show it."""
    found = TABLE_ON_ONE_LINE.search(text)
    if found is None:
        return SYNTAX_REMEDY
    line = text.count("\n", 0, found.start("table")) + 1
    return (
        f"In line {line} write {found['table']} on a line of its own, and below it each "
        "key = value on one, without the commas between them."
    )


def _no_utf8(content: bytes, error: UnicodeDecodeError, path: Path) -> InputError:
    """With the line of the first wrong byte."""
    row = content.count(b"\n", 0, error.start) + 1
    return InputError(
        f"is not UTF-8 text: byte 0x{content[error.start]:02x}",
        f"{path}, row {row}",
        "Save it as UTF-8.",
    )


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """One line per fault of a declared file: ``[table] key: what is wrong``."""
    lines = []
    faults = _without_echoes(error.errors())
    for fault in faults[:MOST_FAULTS]:
        place = fault["loc"]
        table, rest = _table(place)
        key = ".".join(clipped(str(part)) for part in rest)
        message = fault["msg"].removeprefix("Value error, ").removeprefix("Input ")
        if fault["type"] == "extra_forbidden":
            meant = _meant(str(place[-1]), _keys_beside(model, place))
            message = f"unknown key, did you mean {meant}?" if meant else "unknown key"
        elif fault["type"] == "missing":
            message = "is missing"
        elif fault["type"] in LIST_ASKED_FOR and len(place) == 1 and _is_table(fault):
            message = f"is one of a list of tables: write [[{clipped(str(place[0]))}]]"
        elif fault["type"] in LIST_ASKED_FOR:
            message = f"is a list: write [...], not {clipped(repr(fault.get('input')))}"
        elif fault["type"] in TOO_SHORT and not fault.get("input"):
            message = "is an empty list"
        elif fault["type"] not in ("value_error", "missing"):
            wanted = message.split(", unable to parse")[0]
            message = f"{wanted}, not {clipped(repr(fault.get('input')))}"
        lines.append(f"{table}{key}: {message}" if key else f"{table}{message}")
    if len(faults) > MOST_FAULTS:
        lines.append(f"and {len(faults) - MOST_FAULTS} more")
    return "; ".join(lines)


def _without_echoes(faults: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Faults but for lists that seem too short as pydantic left out the rows with faults."""
    return [
        f
        for f in faults
        if not (f["type"] in TOO_SHORT and any(_is_below(other, f) for other in faults))
    ]


def _is_below(fault: Mapping[str, Any], list_of: Mapping[str, Any]) -> bool:
    """Whether a fault is one of a row of a list."""
    place = list_of["loc"]
    return len(fault["loc"]) > len(place) and fault["loc"][: len(place)] == place


def _table(place: tuple[int | str, ...]) -> tuple[str, tuple[int | str, ...]]:
    """The table of a fault as the file has it, of several the first one with a 1; the rest."""
    if not place:
        return "", ()
    name = clipped(str(place[0]))
    if len(place) > 1 and isinstance(place[1], int):
        return f"[[{name}]] {place[1] + 1} ", place[2:]
    return f"[{name}] ", place[1:]


def _keys_beside(model: type[BaseModel], place: Sequence[int | str]) -> list[str]:
    """Keys of the table that a fault lies in; none where that may be one of several."""
    for part in place[:-1]:
        if isinstance(part, str):
            inside = {f.alias or name: f.annotation for name, f in model.model_fields.items()}
            below = set(_models(inside.get(part)))
            if len(below) != 1:
                return []
            (model,) = below
    return [field.alias or name for name, field in model.model_fields.items()]


def _meant(key: str, known: Sequence[str]) -> str:
    """The key that one without its unit, or with a letter wrong, is meant for; "" where none is."""
    alike = get_close_matches(key, known, n=1) or [k for k in known if k.startswith(f"{key}_")]
    return alike[0] if alike else ""


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Tables that a key may hold, alone or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def _is_table(fault: Mapping[str, Any]) -> bool:
    """Whether a table stands where a fault was found."""
    return isinstance(fault.get("input"), dict)


def parse(model: type[Model], data: dict, path: Path, remedy: str = "") -> Model:
    """Validate `data` as `model`; a fault becomes an `InputError` naming file, table and key."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(explain(error, model), str(path), remedy) from None
