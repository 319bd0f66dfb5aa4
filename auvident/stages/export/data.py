"""An identified model as data: JSON, a table of a vehicle file, CSV."""

import json
import re

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.quoting import comment, csv_cell, encodable, quoted
from auvident.stages.export.contents import title

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")  # of TOML; others stand in quotes
CSV_COLUMNS = (
    "symbol",
    "value",
    "std",
    "unit",
    "prime",
    "prior",
    "prior_std",
    "origin",
    "data_share",
    "plane",
)


def as_json(model: IdentifiedModel) -> str:
    """The model as its artifact has it."""
    return (
        encodable(json.dumps(model.model_dump(by_alias=True), indent=2, ensure_ascii=False)) + "\n"
    )


def as_toml(model: IdentifiedModel) -> str:
    """A table that can stand in a vehicle file: the next identification starts from it."""
    lines = [f"# {title(model, quoted)}", "# Dimensional SI values; valid in a vehicle file.", ""]
    if model.effects:
        names = comment(", ".join(str(effect.get("id", "")) for effect in model.effects))
        lines += [
            f"# Identified together with the effects {names}, which this format cannot hold.",
            "",
        ]
    lines.append("[coefficients]")
    for c in model.estimates:
        key = c.symbol if BARE_KEY.fullmatch(c.symbol) else f'"{quoted(c.symbol)}"'
        lines.append(f"{key} = {{ value = {c.value!r}, std = {c.std!r} }}  # {comment(c.unit)}")
    return "\n".join(lines) + "\n"


def as_csv(model: IdentifiedModel) -> str:
    """One row for each coefficient and constant."""
    lines = [",".join(CSV_COLUMNS)]
    for c in model.estimates:
        row = {name: getattr(c, name, "") for name in CSV_COLUMNS} | {"plane": model.plane}
        lines.append(",".join(map(csv_cell, row.values())))
    return "\n".join(lines) + "\n"
