"""Who may import whom; what may not happen outside of the command line."""

import ast
from functools import cache
from pathlib import Path

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
    "api": {"schema", "stages", "storage", "report", "pipeline"},
    "__init__": {"api", "pipeline", "schema"},  # only the names that it offers, when asked for
}
# Rooms of the diagnosis, from the one that knows least of the others.
ROOMS = ("checks", "fit", "score", "select", "verdict")
FILES = {
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
MOST_LINES = 600  # a place to look, no rule: a longer module has to be looked at
FREE = {"constants", "errors", "first_use", "jit", "parallel", "versions", "__main__", "__init__"}
MODULES = sorted(p for p in PACKAGE.rglob("*.py") if "__pycache__" not in p.parts)


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def imported(path: Path) -> set[tuple[str, ...]]:
    """Modules of the package that a module imports, at the top or inside a function."""
    found: set[tuple[str, ...]] = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("auvident."):
            found |= {(*node.module.split(".")[1:], alias.name) for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {tuple(a.name.split(".")[1:]) for a in node.names if "auvident." in a.name}
    return found


def called(path: Path) -> tuple[set[str], set[str]]:
    """Names of what a module calls: as functions, and as methods."""
    calls = [n.func for n in ast.walk(tree(path)) if isinstance(n, ast.Call)]
    functions = {c.id for c in calls if isinstance(c, ast.Name)}
    return functions, {c.attr for c in calls if isinstance(c, ast.Attribute)}


def where(path: Path) -> tuple[str, ...]:
    return path.relative_to(PACKAGE).with_suffix("").parts


def named(path: Path) -> str:
    return ".".join(where(path))


def upwards(path: Path) -> list[str]:
    """What a module imports from a layer above its own, or from another stage."""
    layer, wrong = where(path)[0], []
    for target in sorted(imported(path)):
        other_stage = layer == target[0] == "stages" and target[1] != where(path)[1]
        if other_stage or target[0] not in FREE | {layer} | ALLOWED.get(layer, {"cli"}):
            wrong.append(f"{named(path)} imports {'.'.join(target)}")
    return wrong


def test_there_are_modules_of_every_layer() -> None:
    assert {where(path)[0] for path in MODULES} >= set(ALLOWED) | FREE


def test_imports_point_downwards() -> None:
    assert not [fault for path in MODULES for fault in upwards(path)]


def test_the_rooms_of_the_diagnosis_know_only_those_before_them() -> None:
    for path in MODULES:
        if where(path)[:2] == ("stages", "diagnose") and where(path)[2] in ROOMS:
            before = ROOMS[: ROOMS.index(where(path)[2]) + 1]
            inside = {t[2] for t in imported(path) if t[:2] == ("stages", "diagnose")}
            assert inside <= set(before), path


def test_only_the_command_line_prints_and_exits() -> None:
    others = [path for path in MODULES if where(path)[0] not in ("cli", "__main__")]
    assert not [named(p) for p in others if called(p)[0] & {"print", "exit", "quit"}]


def test_stages_open_no_file() -> None:
    layers = ("stages", "physics", "estimation", "engines", "schema")
    opening = {
        named(path): sorted((called(path)[0] & {"open"}) | (called(path)[1] & FILES))
        for path in MODULES
        if where(path)[0] in layers
    }
    assert not {module: calls for module, calls in opening.items() if calls}


def test_modules_stay_readable() -> None:
    lines = {named(path): len(path.read_text().splitlines()) for path in MODULES}
    assert not {module: n for module, n in lines.items() if n > MOST_LINES}


def test_no_two_classes_have_one_name() -> None:
    found: dict[str, list[str]] = {}
    for path in MODULES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(".".join(where(path)))
    assert not {name: paths for name, paths in found.items() if len(paths) > 1}
