"""Readers of the TOML files that users write: vehicle, column map, plan."""

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from auvident.errors import InputError

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path) -> dict:
    """Read a TOML file, with file and line in the error."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such file", str(path), "Check the path.") from None
    except IsADirectoryError:
        raise InputError("is a folder, not a TOML file", str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", str(path)) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {error}", str(path)) from error


def explain(error: ValidationError) -> str:
    """One line per fault of a declared file: ``[table] key: what is wrong``."""
    lines = []
    for fault in error.errors():
        place = fault["loc"]
        table = f"[{place[0]}] " if place else ""
        key = ".".join(str(part) for part in place[1:])
        message = fault["msg"].removeprefix("Value error, ")
        if fault["type"] == "extra_forbidden":
            message = "unknown key"
        elif fault["type"] == "missing":
            message = "is missing"
        elif fault["type"] not in ("value_error", "missing"):
            message = f"{message}, not {fault.get('input')!r}"
        lines.append(f"{table}{key}: {message}" if key else f"{table}{message}")
    return "; ".join(lines)


def parse(model: type[Model], data: dict, path: Path, remedy: str = "") -> Model:
    """Validate `data` as `model`; a fault becomes an `InputError` naming file, table and key."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(explain(error), str(path), remedy) from None
