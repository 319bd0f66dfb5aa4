"""Names and signatures that programs of others rest on, and what is said of each."""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

import auvident
from tests.bench import interface

FILE = Path(__file__).with_name("public_names.txt")
OWN = (*interface.FUNCTIONS, *interface.CLASSES)
CALLABLES = [
    (f"{name}.{member}", found)
    for name in interface.CLASSES
    for member, found in vars(getattr(auvident, name)).items()
    if inspect.isfunction(found) and not member.startswith("_")
] + [(name, getattr(auvident, name)) for name in interface.FUNCTIONS]


def public() -> Iterator[str]:
    """Every public name; functions and methods with their parameters and defaults."""
    for name in sorted(auvident.__all__):
        found = getattr(auvident, name)
        if inspect.isfunction(found):
            yield f"{name}{interface.bare(found)}"
            continue
        yield name
        if name not in interface.CLASSES:
            continue
        told = [f"`{member}`" for member, _ in interface.attributes(found)]
        listed = [text for text, _ in interface.members(found)]
        for text in sorted({*told, *listed}):
            yield f"{name}.{text.strip('`')}"


def test_names_and_signatures_are_those_that_were_promised() -> None:
    """A name that is new goes into the file; one that is gone or changed breaks programs."""
    assert list(public()) == FILE.read_text(encoding="utf-8").splitlines()


def test_what_is_offered_is_listed_once() -> None:
    assert sorted(auvident.__all__) == sorted({*auvident._MODULE_OF, "__version__"})
    assert set(auvident.__all__) <= set(dir(auvident))
    errors = {n for n in auvident.__all__ if n.endswith("Error")}
    assert errors == set(interface.ERRORS)
    assert {*OWN, *errors, "Observer", "Vehicle", "__version__"} == set(auvident.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = auvident.nothing


def test_the_errors_are_the_whole_family() -> None:
    from auvident import errors

    family = {n for n, e in vars(errors).items() if inspect.isclass(e) and issubclass(e, Exception)}
    assert family == set(interface.ERRORS)


@pytest.mark.parametrize(("name", "function"), CALLABLES, ids=[name for name, _ in CALLABLES])
def test_parameters_are_documented(name: str, function: Any) -> None:
    """All of them or, where the sense is plain or stands elsewhere, none; and typed."""
    text = inspect.cleandoc(function.__doc__ or "")
    assert text
    taken = [p for p in inspect.signature(function).parameters if p != "self"]
    assert {*taken, "return"} <= {*function.__annotations__}
    section = text.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    names = re.findall(r"^(\S[^:\n]*?)(?: :.*)?$", section, re.M)
    told = [n.strip() for line in names for n in line.split(",")]
    assert told == taken or not section


@pytest.mark.parametrize("name", interface.CLASSES)
def test_members_are_documented(name: str) -> None:
    for member, found in vars(getattr(auvident, name)).items():
        if not member.startswith("_") and isinstance(found, property | cached_property):
            assert found.__doc__, member


def test_the_page_says_what_the_docstrings_say() -> None:
    assert interface.PAGE.read_text(encoding="utf-8") == interface.page(), "run `make docs`"
