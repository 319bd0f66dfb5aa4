"""Models of the interface in the forms of ``auvident export``."""

from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import UsageError

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.combined import CombinedModel


def exported(
    model: "IdentifiedModel | CombinedModel",
    source: Path | None,
    form: str,
    path: "str | Path | None",
) -> str | Path:
    """Text of a model in a form, or the file that it was written to; see `Model.export`."""
    from auvident.pipeline.exporting import BINARY, NOWHERE, export_of, write_export

    if form in BINARY and path is None:
        raise UsageError(f"{form} is a binary file", "path", "Give the file that it goes to.")
    made = export_of(source or NOWHERE, model, form)
    if path is None:
        return made.content.decode()
    write_export(made, form, Path(path))
    return Path(path)
