"""A model for use elsewhere: found, written in its form, with what the form leaves out."""

import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import UsageError
from auvident.pipeline.freshness import is_of_this_run
from auvident.pipeline.planes import planes_of
from auvident.pipeline.predict import find_model
from auvident.pipeline.remedies import again
from auvident.pipeline.table import BY_NAME
from auvident.pipeline.whole import find_whole, is_whole
from auvident.schema.planes import PLANES
from auvident.storage.artifacts import write_bytes
from auvident.storage.run_directory import MANIFEST, RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.combined import CombinedModel
    from auvident.stages.export.cost import Cost
    from auvident.stages.export.whole import Whole

    AnyModel = IdentifiedModel | CombinedModel

BINARY = ("fmu",)
NOWHERE = Path()  # a model that was never in a file
COMBINED = "combine/model.json"
COMMENT = {"toml": "# ", "python": "# ", "pvs": "# ", "matlab": "% ", "c": "// "}
WIDTH = 88
WHOLE_FORMS = "pvs, gz and uuv hold the whole vehicle."
NO_RUN = "What that costs on held-out maneuvers is told for a model in a run directory."


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
    model: "AnyModel"
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
        Run directory or file of a model; for a simulator of six degrees of freedom also a combined
        model, or a vehicle file for its estimate from geometry.
    form : str
    plane : str, optional
        Of a run of both planes.
    to_file : bool
        Whether it goes to a file; standard output takes text only.

    Raises
    ------
    UsageError
        A binary form without a file; a form that the model does not fit; a plane of a model of
        six degrees of freedom.
    """
    if is_whole(target):
        _refuse_of_plane(form, plane)
    if form in BINARY and not to_file:
        raise UsageError(
            f"{form} is a binary file, which no terminal shows", "--output", "Give --output FILE."
        )
    found = find_any_model(target, plane) if form in WRITERS else find_model(target, plane)
    made = export_of(*found, form)
    return made if plane else _with_note(made, form, _one_of_both(target, found[1], form))


def _one_of_both(target: Path, model: "AnyModel", form: str) -> str:
    """What is said of a plane that stands for a run of both; empty for anything else."""
    from auvident.schema.artifacts import IdentifiedModel

    planes = planes_of(RunDirectory(target)) if target.is_dir() else ()
    if len(planes) < len(PLANES) or not isinstance(model, IdentifiedModel):
        return ""
    whole = f"`{again(target)}` makes the whole vehicle's, which is missing or out of date."
    return (
        f"This is the {planes[0]} plane alone, of a run of both: --plane {planes[1]} exports the "
        f"other. {whole if form in WRITERS else WHOLE_FORMS}"
    )


def _with_note(made: Exported, form: str, note: str) -> Exported:
    """With a note, which stands in the first lines of the file where it can hold a comment."""
    if not note:
        return made
    mark = COMMENT.get(form, "")
    head = "".join(f"{mark}{line}\n" for line in textwrap.wrap(note, WIDTH)) if mark else ""
    text = head.encode()
    header = made.header and text + made.header
    return replace(made, content=text + made.content, notes=(*made.notes, note), header=header)


def export_of(path: Path, model: "AnyModel", form: str) -> Exported:
    """Write a model that was found.

    Parameters
    ----------
    path : Path
        Its file; `NOWHERE` where it has none, and what a simulator leaves out is not counted then.
    model : IdentifiedModel or CombinedModel
        Of six degrees of freedom for the forms of `WRITERS` alone.
    form : str

    Raises
    ------
    UsageError
        No such form, or one that the model does not fit.
    """
    if form in WRITERS:
        return WRITERS[form](path, model)
    from auvident.schema.combined import CombinedModel
    from auvident.stages.export import FORMS, export, header_of, remarks_on

    if form not in (*FORMS, *BINARY):
        known = ", ".join((*FORMS, *BINARY, *WRITERS))
        raise UsageError(f"there is no format {form!r}", "--format", f"One of {known}.")
    if isinstance(model, CombinedModel):
        raise _no_form_of_whole(form)
    if form == "fmu":
        return _fmu(path, model)
    header = header_of(model).encode() if form == "c" else b""
    return Exported(path, model, export(model, form).encode(), remarks_on(model, form), header)


def _refuse_of_plane(form: str, plane: str | None) -> None:
    """Refuse what is asked for of one plane, where the model is of six degrees of freedom."""
    if form not in WRITERS:
        raise _no_form_of_whole(form)
    if plane is not None:
        raise UsageError(
            "a model of six degrees of freedom is exported whole",
            "--plane",
            "Leave it out, or export the model of one plane.",
        )


def _no_form_of_whole(form: str) -> UsageError:
    return UsageError(
        f"{form} is no form of a model of six degrees of freedom",
        "--format",
        f"One of {', '.join(WRITERS)}, or export the model of one plane.",
    )


def write_export(made: Exported, form: str, file: Path) -> None:
    """Write the file, and of C its header beside it."""
    write_bytes(file, made.content)
    if made.header and file.suffix == ".c":
        write_bytes(file.with_suffix(".h"), made.header)


def find_any_model(target: Path, plane: str | None = None) -> "tuple[Path, AnyModel]":
    """A model of six degrees of freedom where there is one, else that of a plane."""
    if plane is None and is_whole(target):
        return target, find_whole(target)[0]
    if plane is None and target.is_dir() and (target / COMBINED).exists():
        run = RunDirectory(target)
        if is_of_this_run(BY_NAME["combine"], run, run.existing()):
            return target / COMBINED, find_whole(target / COMBINED)[0]
    return find_model(target, plane)


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


def _pvs(path: Path, model: "AnyModel") -> Exported:
    from auvident.stages.export.pvs import as_pvs, left_out_of_pvs
    from auvident.stages.export.whole import whole_of

    return Exported(path, model, as_pvs(model).encode(), left_out_of_pvs(whole_of(model)))


def _gz(path: Path, model: "AnyModel") -> Exported:
    from auvident.stages.export.gz import as_gz, left_out_of_gz
    from auvident.stages.export.simulators import read_gz

    return _simulator(path, model, "gz-sim", as_gz, read_gz, left_out_of_gz)


def _uuv(path: Path, model: "AnyModel") -> Exported:
    from auvident.stages.export.simulators import read_uuv
    from auvident.stages.export.uuv import as_uuv, left_out_of_uuv

    return _simulator(path, model, "uuv_simulator", as_uuv, read_uuv, left_out_of_uuv)


def _simulator(
    path: Path,
    model: "AnyModel",
    tool: str,
    write: "Callable[..., str]",
    read: Callable[[str], Any],
    left_out: "Callable[[Whole], tuple[str, ...]]",
) -> Exported:
    """The file of a simulator, with what it leaves out and what that costs."""
    from auvident.stages.export.cost import lines_of
    from auvident.stages.export.whole import whole_of

    whole = whole_of(model)
    costs = costs_in_run(path, model, read(write(whole)))
    told = lines_of(costs, tool) if costs else (NO_RUN,)
    return Exported(path, model, write(whole, told).encode(), (*left_out(whole), *told))


def costs_in_run(path: Path, model: "AnyModel", vehicle: Any) -> "tuple[Cost, ...]":
    """Errors on the held-out maneuvers of the run directory that a model stands in, if it does."""
    from auvident.pipeline.given import Given
    from auvident.stages.export.cost import costs_of
    from auvident.stages.export.whole import whole_of

    if path == NOWHERE:
        return ()
    folders = path.resolve().parents[1:3]  # one more above the model of a second plane
    run = next((folder for folder in folders if (folder / MANIFEST).exists()), None)
    if run is None:
        return ()
    given = Given(RunDirectory(run))
    return costs_of(model, whole_of(model), vehicle, given.trials, given.maneuvers)


# of six degrees of freedom where there is such a model
WRITERS: "dict[str, Callable[[Path, AnyModel], Exported]]" = {
    "pvs": _pvs,
    "gz": _gz,
    "uuv": _uuv,
}
