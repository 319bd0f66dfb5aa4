"""Versions of what the program runs on: for reproducing numbers, and for reports of faults."""

import platform
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from auvident import __version__

# Libraries whose versions may change the last digits of a result, or the bytes of a file.
NUMERICAL = ("numpy", "scipy", "numba", "filterpy", "pandas", "pyarrow")
BESIDE = ("pydantic", "matplotlib", "jinja2", "rich", "click")


@cache
def libraries() -> Mapping[str, str]:
    """Versions of Python and of the libraries that numbers and files depend on."""
    return {"python": platform.python_version(), **_versions(NUMERICAL)}


def _versions(names: tuple[str, ...]) -> dict[str, str]:
    """Those of the distributions that are there."""
    found = {}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # a copy without its metadata
            continue
    return found


def changed(recorded: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """Libraries whose version was another one, with that and the present one."""
    now = libraries()
    names = [name for name, old in recorded.items() if now.get(name, "none") != old]
    return {name: (recorded[name], now.get(name, "none")) for name in names}


def about() -> Iterator[str]:
    """Program, Python, platform and libraries, one a line."""
    yield f"auvident {__version__}"
    yield f"Python {platform.python_version()}, {platform.platform()}"
    yield from (f"{name} {number}" for name, number in _versions((*NUMERICAL, *BESIDE)).items())
