"""Models to fly on the desk: of REMUS 100 from its vehicle file, and with coefficients changed."""

from dataclasses import replace
from functools import cache

import numpy as np

from auvident.schema.coefficients import BY_SYMBOL, symbols_of
from auvident.schema.planes import Plane
from auvident.stages.ase import estimate
from auvident.stages.desk import DeskModel, estimated_models
from auvident.stages.identify.setup import rigid_body
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES

LENGTH_M = 1.3327
QUADRATIC = ("Y_v|v|", "Y_r|r|", "N_v|v|", "N_r|r|")


@cache
def remus(plane: Plane, samples: int = 0) -> DeskModel:
    """The estimate from geometry, alone or with models drawn beside it."""
    vehicle = load_vehicle(SAMPLES / "remus100.toml")
    rigid, rng = rigid_body(vehicle, plane), np.random.default_rng(0)
    return estimated_models(estimate(vehicle), rigid, plane, "remus100.toml", samples, rng)


def changed(models: DeskModel, **factors: float) -> DeskModel:
    """The same with some coefficients times a factor; ``|`` is written as ``_`` twice."""
    vectors = models.vectors.copy()
    for name, factor in factors.items():
        vectors[:, models.structure.index(name.replace("__", "|"))] *= factor
    return replace(models, vectors=vectors)


def stated(models: DeskModel, **values: float) -> DeskModel:
    """The same with other values of some coefficients."""
    vectors = models.vectors.copy()
    for name, value in values.items():
        vectors[:, models.structure.index(name)] = value
    return replace(models, vectors=vectors)


def linear(models: DeskModel) -> DeskModel:
    """The same without cross-flow in sway and yaw."""
    return changed(models, **{s.replace("|", "__"): 0.0 for s in QUADRATIC})


def enlarged(models: DeskModel, by: float) -> DeskModel:
    """A vehicle of the same shape and so many times as long, in the same water (horizontal)."""
    rigid = {"m": 3, "m x_G": 4, "I": 5, "x_fin": 1}
    vectors = models.vectors.copy()
    for name in symbols_of(models.plane):
        power = BY_SYMBOL[name].length_power
        vectors[:, models.structure.index(name)] *= by**power
    for name, power in rigid.items():
        vectors[:, models.structure.index(name)] *= by**power
    return replace(models, vectors=vectors, length_m=by * models.length_m)
