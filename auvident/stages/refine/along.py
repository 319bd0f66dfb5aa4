"""Small effects that every trial has, estimated along: the model that a trial is pooled by.

Trials of a vehicle are pooled by what their data say of its coefficients. A model without a current
of 2 cm/s or a servo lag, which nobody would claim, has these in its coefficients: of 200 trials of
a season without any change 39 were left out as fitting no other, up to 50 times as far off
(squared, in each direction that they saw) as their errors allow.
"""

from collections.abc import Collection

from auvident.engines.carried import Carried
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.diagnosis import Diagnosis
from auvident.schema.effects import BY_ID, parameter_of
from auvident.stages.refine.attempts import unclaimed

CURRENT = "current"  # in every sea, and the trial's own


def along(
    diagnosis: Diagnosis,
    claimed: Collection[str],
    model: IdentifiedModel,
    speed_mps: float,
    *,
    heading: bool,
) -> Carried | None:
    """What is carried with nothing left out: effects, all nuisance parameters, and a current.

    Parameters
    ----------
    diagnosis : Diagnosis
    claimed : collection of str
        Effects that stand in the end; others that were found are left as small as is usual.
    model : IdentifiedModel
        The one that the run ends with.
    speed_mps : float
        Of the vehicle in the maneuvers.
    heading : bool
        Whether headings can be held against each other; without them no current can be told.

    Returns
    -------
    Carried or None
        None where the model carries all of it.
    """
    carried = unclaimed(diagnosis, model, speed_mps, claimed)
    if heading and CURRENT not in carried.ids(model.plane):
        carried = carried.adding(_stds_of_current(model, speed_mps))
    same = {*carried.ids(model.plane)} == {str(e["id"]) for e in model.effects}
    return None if same else carried


def _stds_of_current(model: IdentifiedModel, speed_mps: float) -> dict[str, float]:
    told = model.density_kgpm3, model.length_m, speed_mps, 1.0
    names = BY_ID[CURRENT].names(model.plane)
    return {n: parameter_of(n).prior * parameter_of(n).size_unit(*told) for n in names}
