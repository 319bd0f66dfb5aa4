"""A model for use elsewhere: found, written in its form, with what the form leaves out."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import UsageError
from auvident.pipeline.predict import find_model

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.combined import CombinedModel

BINARY = ("fmu",)


@dataclass(frozen=True)
class Exported:
    """What an export writes.

    Attributes
    ----------
    source : Path
        File of the model.
    model : IdentifiedModel or CombinedModel
    content : bytes
    notes : tuple of str
        What the form leaves out, a line each.
    header : bytes
        Of the C form.
    """

    source: Path
    model: "IdentifiedModel | CombinedModel"
    content: bytes
    notes: tuple[str, ...] = ()
    header: bytes = b""


def export_model(
    target: Path, form: str, plane: str | None = None, *, to_file: bool = True
) -> Exported:
    """Write a model in a form.

    Parameters
    ----------
    target : Path
        Run directory or file of a model.
    form : str
    plane : str, optional
        Of a run of both planes.
    to_file : bool
        Whether it goes to a file; standard output takes text only.

    Raises
    ------
    UsageError
        A binary form without a file; a form that the model does not fit.
    """
    if form in BINARY and not to_file:
        raise UsageError(
            f"{form} is a binary file, which no terminal shows", "--output", "Give --output FILE."
        )
    path, model = find_model(target, plane)
    if form == "fmu":
        return _fmu(path, model)
    from auvident.stages.export import export, header_of, remarks_on

    header = header_of(model).encode() if form == "c" else b""
    content = export(model, form).encode()
    return Exported(path, model, content, remarks_on(model, form), header)


def _fmu(path: Path, model: "IdentifiedModel") -> Exported:
    from auvident.stages.export.fmu import SOURCE, fmu_files, library_name, remarks_of
    from auvident.storage.fmu_file import packed, with_library

    source = f"sources/{SOURCE}"
    files, problem = with_library(fmu_files(model), source, library_name(model))
    notes = list(remarks_of(model))
    if problem:
        notes.append(
            f"The FMU has sources only, as {problem}. `fmpy compile FILE.fmu` adds the library."
        )
    return Exported(path, model, packed(files), tuple(notes))
