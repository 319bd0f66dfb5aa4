"""Which reader opens which file; a reader is imported when a file has its ending."""

from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

from auvident.errors import InputError
from auvident.storage.readers.interface import Container, LogReader
from auvident.storage.regular import refuse_irregular

GROUP = "auvident.readers"  # entry points: name is an ending (".svlog"), object is a LogReader
HEAD = 512  # bytes that a reader may look at to know its format
OPEN_FILES = 4  # containers that stay open, as a log is asked for its tables several times

# Ending -> module of this package whose `READER` opens such files. Where two formats share an
# ending the first that knows the beginning of the file takes it.
READERS: tuple[tuple[str, str], ...] = (
    (".bag", "ros"),
    (".db3", "ros"),
    (".mcap", "ros"),
    (".ulg", "ulog"),
    (".bin", "dataflash"),
    (".mat", "matlab"),
    (".h5", "hdf5"),
    (".hdf5", "hdf5"),
    (".nc", "netcdf"),
    (".alog", "moos"),
    (".lsf", "lsts"),
    (".lsf.gz", "lsts"),
    (".log", "dated"),
)


def container_suffixes() -> tuple[str, ...]:
    """Endings of all formats that have a reader, lower case."""
    own = (suffix for suffix, _ in READERS)
    return tuple(dict.fromkeys((*own, *(name.lower() for name in _entry_points()))))


def find_reader(path: Path) -> LogReader | None:
    """The reader of a file, by its ending and its first bytes; None when no reader knows it.

    Raises
    ------
    InputError
        When the file cannot be read, or a laboratory's own reader cannot be loaded.
    """
    modules = [module for suffix, module in READERS if path.name.lower().endswith(suffix)]
    points = [p for name, p in _entry_points().items() if path.name.lower().endswith(name.lower())]
    if not (modules or points):
        return None
    head = _head(path)
    own = (import_module(f"{__package__}.{module}").READER for module in modules)
    readers = [*(_load(point) for point in points), *own]
    return next((reader for reader in readers if reader.matches(path, head)), None)


def open_container(path: Path, reader: LogReader) -> Container:
    """An opened file; one that was opened before and has not changed is not opened again."""
    about = path.stat()
    return _open(path, reader, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=OPEN_FILES)
def _open(path: Path, reader: LogReader, changed_ns: int, size: int) -> Container:
    return reader.open(path)


@cache
def _entry_points() -> dict:
    from importlib.metadata import entry_points

    return {point.name: point for point in entry_points(group=GROUP)}


def _load(point) -> LogReader:  # type: ignore[no-untyped-def]
    try:
        return point.load()
    except Exception as error:  # someone else's code: whatever it raises, the file is not read
        raise InputError(
            f"the reader {point.value} cannot be loaded: {error!r}",
            f"entry point {point.name} of {GROUP}",
            "Correct or uninstall the package that brings it.",
        ) from error


def _head(path: Path) -> bytes:
    refuse_irregular(path)
    try:
        with path.open("rb") as stream:
            return stream.read(HEAD)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error


def need(module: str, extra: str, path: Path) -> ModuleType:
    """A library that a reader needs.

    Parameters
    ----------
    module : str
        What to import.
    extra : str
        Extra of the package that has it.
    path : Path
        File that asks for it, for the message.

    Raises
    ------
    InputError
        When it is not installed, with the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(
            f"needs {module.partition('.')[0]}: pip install 'auvident[{extra}]'", str(path)
        ) from error
