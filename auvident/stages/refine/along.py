"""Small effects that every trial has, estimated along where the final model carries none of them.

Trials of a vehicle are pooled by what their data say of its coefficients. A model without a current
of 2 cm/s or a servo's lag, which nobody would claim, puts these into its coefficients: of 48 trials
of a season without any change five ended with such a model, and were 17 to 39 times as far from the
others (squared, in each direction that they saw) as their errors allow. With them estimated along
they are 0.6 to 1.1 times as far.
"""

from auvident.engines.carried import Carried
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.diagnosis import Diagnosis
from auvident.schema.effects import BY_ID, parameter_of
from auvident.stages.refine.attempts import nuisances_of

CURRENT = "current"  # in every sea, and the trial's own


def along(
    diagnosis: Diagnosis, model: IdentifiedModel, speed_mps: float, *, heading: bool
) -> Carried:
    """What an identification carries that claims nothing: all nuisance parameters, and a current.

    Parameters
    ----------
    diagnosis : Diagnosis
    model : IdentifiedModel
        The one that was diagnosed.
    speed_mps : float
        Of the vehicle in the maneuvers.
    heading : bool
        Whether headings were logged; without them no current can be told.
    """
    carried = nuisances_of(diagnosis)
    if not heading or CURRENT in carried.ids(model.plane):
        return carried
    names = BY_ID[CURRENT].names(model.plane)
    stds = {
        name: declared.prior * declared.size_unit(model.density_kgpm3, model.length_m, speed_mps, 1)
        for name, declared in ((n, parameter_of(n)) for n in names)
    }
    return carried.adding(stds)
