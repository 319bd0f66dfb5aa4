"""Who may import whom; what may not happen outside of the command line."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "auvident"
# Layer -> layers it may import besides itself; modules at the top (errors, ...) are free to all.
ALLOWED = {
    "schema": set(),
    "estimation": {"schema"},
    "physics": {"schema"},
    "engines": {"schema", "physics", "estimation"},
    "stages": {"schema", "physics", "estimation", "engines"},
    "storage": {"schema"},
    "report": {"schema"},
    "pipeline": {"schema", "physics", "stages", "storage", "report"},
    "cli": {"schema", "physics", "stages", "storage", "report", "pipeline"},
}
# Rooms of the diagnosis, from the one that knows least of the others.
ROOMS = ("checks", "fit", "score", "select", "verdict")
FREE = {"errors", "first_use", "jit", "parallel", "__main__", "__init__"}
MODULES = sorted(p for p in PACKAGE.rglob("*.py") if "__pycache__" not in p.parts)


def imported(path: Path) -> set[tuple[str, ...]]:
    """Modules of the package that a module imports, at the top or inside a function."""
    found: set[tuple[str, ...]] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("auvident."):
            found |= {(*node.module.split(".")[1:], alias.name) for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {tuple(a.name.split(".")[1:]) for a in node.names if "auvident." in a.name}
    return found


def where(path: Path) -> tuple[str, ...]:
    return path.relative_to(PACKAGE).with_suffix("").parts


@pytest.mark.parametrize("path", MODULES, ids=lambda p: ".".join(where(p)))
def test_imports_point_downwards(path: Path) -> None:
    layer = where(path)[0]
    for target in imported(path):
        assert layer != "stages" or target[0] != "stages" or target[1] == where(path)[1], target
        assert target[0] in FREE | {layer} | ALLOWED.get(layer, {"cli"}), target


def test_the_rooms_of_the_diagnosis_know_only_those_before_them() -> None:
    for path in MODULES:
        if where(path)[:2] == ("stages", "diagnose") and where(path)[2] in ROOMS:
            before = ROOMS[: ROOMS.index(where(path)[2]) + 1]
            inside = {t[2] for t in imported(path) if t[:2] == ("stages", "diagnose")}
            assert inside <= set(before), path


@pytest.mark.parametrize("path", MODULES, ids=lambda p: ".".join(where(p)))
def test_only_the_command_line_prints_and_exits(path: Path) -> None:
    if where(path)[0] in ("cli", "__main__"):
        return
    calls = [n.func for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    names = {c.id for c in calls if isinstance(c, ast.Name)}
    assert not names & {"print", "exit", "quit"}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: ".".join(where(p)))
def test_stages_open_no_file(path: Path) -> None:
    if where(path)[0] not in ("stages", "physics", "estimation", "engines", "schema"):
        return
    tree = ast.parse(path.read_text())
    calls = [n.func for n in ast.walk(tree) if isinstance(n, ast.Call)]
    opened = {c.id for c in calls if isinstance(c, ast.Name)} & {"open"}
    opened |= {c.attr for c in calls if isinstance(c, ast.Attribute)} & {
        "open",
        "read_text",
        "write_text",
        "read_bytes",
        "write_bytes",
        "read_csv",
        "to_csv",
        "read_parquet",
        "to_parquet",
        "savez",
        "loadtxt",
        "savetxt",
    }
    assert not opened


@pytest.mark.parametrize("path", MODULES, ids=lambda p: ".".join(where(p)))
def test_modules_stay_readable(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 600
