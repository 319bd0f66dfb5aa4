"""Plan files: found by name or path, read, and joined to the built-in plan that they continue."""

from pathlib import Path

from auvident.errors import InputError
from auvident.schema.plan import Plan
from auvident.schema.quoting import clipped
from auvident.storage.declared import parse, read_toml
from auvident.storage.run_directory import PACKAGE_ROOT

PLANS = PACKAGE_ROOT / "plans"
REMEDY = "See `auvident schema plan`."


def plan_path(name: str | Path) -> Path:
    """File of a plan, which is named by its path or, if it comes with the program, by name."""
    built_in = PLANS / f"{name}.toml"
    if built_in.is_file() and not Path(name).is_file():
        return built_in
    if not Path(name).is_file() and Path(name).suffix != ".toml":
        raise InputError(
            "there is no such plan",
            str(name),
            f"Give a TOML file or one of the built-in plans: {_known()}.",
        )
    return Path(name)


def read_plan(name: str | Path) -> Plan:
    """A plan by its name or file; what it continues goes before.

    Raises
    ------
    InputError
        No such plan, a file that cannot be read, an unknown key or a wrong value.
    """
    path = plan_path(name)
    data = read_toml(path)
    before = _continued(data, path)
    if before is not None:
        first, own = read_toml(before), data.get("stage", [])
        if isinstance(own, list):  # what is no list of tables is refused below
            own = [*first["stage"], *own]
        data = {**first, **data, "stage": own}
    return parse(Plan, data, path, REMEDY)


def plan_files(name: str | Path) -> list[Path]:
    """The file of a plan and that of the plan it continues."""
    path = plan_path(name)
    before = _continued(read_toml(path), path)
    return [path] if before is None else [path, before]


def _continued(data: dict, path: Path) -> Path | None:
    """File of the built-in plan that a file continues."""
    name = data.get("continues")
    if name is None:
        return None
    before = next((p for p in PLANS.glob("*.toml") if p.stem == name), None)
    if before is None or "continues" in read_toml(before):
        raise InputError(
            f"continues {clipped(repr(name))}",
            str(path),
            f"A plan may continue one of {_known(True)}.",
        )
    return before


def _known(whole: bool = False) -> str:
    """Names of the built-in plans; of those that stand for themselves alone."""
    files = sorted(PLANS.glob("*.toml"))
    return ", ".join(p.stem for p in files if not whole or "continues" not in read_toml(p))
