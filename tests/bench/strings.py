"""Every text of the program that a person may read: ``python -m tests.bench.strings [FOLDER]``.

String constants and f-strings with a space in them, docstrings aside, with file and line; what is
filled in at run time stands in braces.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "auvident"


def texts(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every string with a space in a module, docstrings aside."""
    tree = ast.parse(source)
    aside = set(_aside(tree))
    for node in ast.walk(tree):
        if id(node) in aside:
            continue
        text = _text(node)
        if " " in text.strip():
            yield node.lineno, text  # type: ignore[attr-defined]


def _aside(tree: ast.AST) -> Iterator[int]:
    """Docstrings, and the pieces of f-strings, which are told with the whole."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield id(node.value)
        if isinstance(node, ast.JoinedStr):
            yield from (id(part) for value in node.values for part in ast.walk(value))


def _text(node: ast.AST) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_piece(value) for value in node.values)
    return ""


def _piece(value: ast.expr) -> str:
    if isinstance(value, ast.FormattedValue):
        return "{" + ast.unparse(value.value) + "}"
    return _text(value)


def main(folder: Path = PACKAGE) -> None:
    """Print the texts, module by module."""
    for file in sorted(folder.rglob("*.py")):
        found = sorted(set(texts(file.read_text(encoding="utf-8"))))
        if found:
            print(f"\n{file.relative_to(PACKAGE.parent)}")
        for line, text in found:
            print(f"{line:5d}  {text!r}")


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
