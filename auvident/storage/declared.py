"""Readers of the TOML files that users write: vehicle, column map, plan."""

import codecs
import re
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from auvident.errors import InputError
from auvident.schema.quoting import clipped
from auvident.storage.regular import MEGABYTE, read_small

MOST_BYTES = 4 * MEGABYTE  # 100,000 stations of a hull have 2 MB
MOST_LEVELS = 100  # of a dotted key; each level costs the parser the whole key again
DOTTED_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){""" + f"{MOST_LEVELS}}}"
)
MOST_FAULTS = 10  # of one file in a message

Model = TypeVar("Model", bound=BaseModel)


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
        raise InputError("is a folder, not a TOML file", str(path)) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error
    except UnicodeDecodeError as error:
        raise _no_utf8(content, error, path) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {clipped(str(error))}", str(path)) from error
    except RecursionError:
        raise InputError("is nested too deeply", str(path), "Check the brackets.") from None
    except ValueError as error:  # of a number with thousands of digits
        raise InputError(
            f"has a number that cannot be read: {clipped(str(error))}", str(path)
        ) from None


def _no_utf8(content: bytes, error: UnicodeDecodeError, path: Path) -> InputError:
    """With the line of the first wrong byte."""
    row = content.count(b"\n", 0, error.start) + 1
    return InputError(
        f"is not UTF-8 text: byte 0x{content[error.start]:02x}",
        f"{path}, row {row}",
        "Save it as UTF-8.",
    )


def explain(error: ValidationError) -> str:
    """One line per fault of a declared file: ``[table] key: what is wrong``."""
    lines = []
    faults = error.errors()
    for fault in faults[:MOST_FAULTS]:
        place = fault["loc"]
        table = f"[{clipped(str(place[0]))}] " if place else ""
        key = ".".join(clipped(str(part)) for part in place[1:])
        message = fault["msg"].removeprefix("Value error, ")
        if fault["type"] == "extra_forbidden":
            message = "unknown key"
        elif fault["type"] == "missing":
            message = "is missing"
        elif fault["type"] not in ("value_error", "missing"):
            message = f"{message}, not {clipped(repr(fault.get('input')))}"
        lines.append(f"{table}{key}: {message}" if key else f"{table}{message}")
    if len(faults) > MOST_FAULTS:
        lines.append(f"and {len(faults) - MOST_FAULTS} more")
    return "; ".join(lines)


def parse(model: type[Model], data: dict, path: Path, remedy: str = "") -> Model:
    """Validate `data` as `model`; a fault becomes an `InputError` naming file, table and key."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(explain(error), str(path), remedy) from None
