"""An identified model as text for other programs: data, or equations that stand alone."""

from collections.abc import Callable

from auvident.errors import UsageError
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.export.c import as_c, header_of
from auvident.stages.export.contents import remarks
from auvident.stages.export.data import as_csv, as_json, as_toml
from auvident.stages.export.matlab import as_matlab
from auvident.stages.export.python import as_python

__all__ = ["EQUATION_FORMS", "FORMS", "export", "header_of", "remarks_on"]

FORMS: dict[str, Callable[[IdentifiedModel], str]] = {
    "json": as_json,
    "toml": as_toml,
    "csv": as_csv,
    "python": as_python,
    "matlab": as_matlab,
    "c": as_c,
}
EQUATION_FORMS = ("python", "matlab", "c")


def export(model: IdentifiedModel, form: str) -> str:
    """The model in another form.

    Parameters
    ----------
    model : IdentifiedModel
    form : str
        A key of `FORMS`.

    Raises
    ------
    UsageError
        Unknown form; a form with equations, and effects unknown to this version or no numbers.
    """
    if form not in FORMS:
        raise UsageError(f"there is no format {form!r}", "--format", f"One of {', '.join(FORMS)}.")
    return FORMS[form](model)


def remarks_on(model: IdentifiedModel, form: str) -> tuple[str, ...]:
    """What of the effects a form leaves out or has off, a line each."""
    return remarks(model) if form in EQUATION_FORMS else ()
