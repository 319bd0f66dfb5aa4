"""The page of the Python interface, from its docstrings: ``python -m tests.bench.interface``."""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import auvident
from tests.bench.written import table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
FUNCTIONS = (
    "run",
    "load_run",
    "load_model",
    "load_whole_model",
    "combine",
    "pool",
    "load_vehicle",
    "estimate_from_geometry",
)
CLASSES = (
    "Run",
    "PlaneModels",
    "Model",
    "Simulation",
    "WholeModel",
    "FlownManeuver",
    "GeometryEstimate",
    "Plots",
    "Panels",
)
ERRORS = (
    "AuvidentError",
    "UsageError",
    "InputError",
    "ContradictionError",
    "StageError",
    "NumericsError",
    "GateError",
    "InUseError",
)
HEAD = """# Python interface

<!-- written by `make docs` from the docstrings; not to be edited -->

For notebooks and programs: the functions that the command line calls, with pandas data frames and
matplotlib axes. Whatever `auvident run` has made, `auvident.load_run` reads, and the other way
round. [The tutorial](tutorial.ipynb) is a notebook that uses most of it.

```python
import auvident

run = auvident.run(
    "sample_logs/harbour_trial", vehicle="sample_logs/remus100.toml", run="runs/demo"
)
run.coefficients[["value", "std", "unit", "data_share", "status"]]
run.heldout  # errors on what was held out: geometry, identified, refined
run.plot.held_out()
run.model.maneuver("zigzag:10/10").figures
run.model.simulate("sample_logs/harbour_trial", from_s=1373, to_s=1448)
```

Everything is in SI and radians, in SNAME axes; a positive rudder turns to port, a positive elevator
pitches the bow down, whatever the signs in a log are. Nothing is printed unless `progress=True` or
an `Observer` asks for it, and nothing of the process is changed: no folder, no filter of warnings,
no handler of signals. It works in a thread; stages of several runs in threads of one process take
turns, so that many trials are better run in processes. The first use compiles the numerical
kernels, once on a machine.

"""
REFERENCE = """
## Reference

On the documentation site each name stands here with its parameters, units and errors; in Python
`help(auvident.run)` says the same.

"""


def page() -> str:
    """The page as it should be."""
    parts = [HEAD, "## Functions\n\n", _table(_functions()), "\n"]
    for name in CLASSES:
        parts += [f"\n## {name}\n\n{_first(getattr(auvident, name))}\n\n"]
        parts += [_table(members(getattr(auvident, name))), "\n"]
    parts += [
        "\n## Errors\n\nOne family; each has `problem`, `where`, `remedy` and `exit_code`.\n\n"
    ]
    parts += [_table((f"`{n}`", _first(getattr(auvident, n))) for n in ERRORS), "\n"]
    blocks = "\n".join(f"::: auvident.{name}\n" for name in (*FUNCTIONS, *CLASSES))
    return "".join([*parts, REFERENCE, blocks])


def _functions() -> Iterator[tuple[str, str]]:
    for name in FUNCTIONS:
        found = getattr(auvident, name)
        yield f"`{name}{bare(found)}`", _first(found)


def members(of: type) -> Iterator[tuple[str, str]]:
    """Public attributes, methods and properties of a class, each with its first sentence."""
    for name, what in attributes(of):
        yield f"`{name}`", what
    for name, member in vars(of).items():
        if name.startswith("_"):
            continue
        if inspect.isfunction(member):
            yield f"`{name}{bare(member)}`", _first(member)
        elif isinstance(member, property | cached_property):
            yield f"`{name}`", _first(member)


def attributes(of: type) -> list[tuple[str, str]]:
    """Name and first sentence of what stands under Attributes in the docstring of a class."""
    text = inspect.cleandoc(of.__doc__ or "").partition("Attributes\n----------\n")[2]
    found = re.findall(r"^(\w+) : ([^\n]*)\n?((?:[ ]{4}[^\n]*\n?)*)", text, re.MULTILINE)
    told = [(name, " ".join(what.split()) or kind) for name, kind, what in found]
    return [(name, f"{what[0].upper()}{what[1:]}") for name, what in told]


def bare(function: Any) -> inspect.Signature:
    """The signature without annotations, which differ between versions of Python."""
    found = inspect.signature(function)
    parameters = [
        p.replace(annotation=inspect.Parameter.empty)
        for name, p in found.parameters.items()
        if name != "self"
    ]
    return inspect.Signature(parameters)


def _first(found: Any) -> str:
    """First paragraph of a docstring, in one line."""
    text = inspect.cleandoc(found.__doc__ or "").split("\n\n")[0]
    return " ".join(text.split())


def _table(rows: Any) -> str:
    return table([{"name": name, "what": what.replace("``", "`")} for name, what in rows])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
