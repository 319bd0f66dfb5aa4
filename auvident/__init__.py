"""auvident: maneuvering models of autonomous underwater vehicles from their sea-trial logs.

Conventions (the whole program keeps to them; conversion happens only at input and output).

Axes
    SNAME body axes at the origin O of the vehicle file: x forward, y starboard, z down.
    Velocities u, v, w; rates p, q, r; forces X, Y, Z; moments K, M, N.
    r is positive to starboard; heading psi from north, clockwise; pitch theta bow up.
Stations
    x of a part is its body-frame coordinate, forward positive; a stern fin has x < 0.
Control angles (right-hand rule about the body axes)
    rudder > 0: trailing edge to port, so Y_uud > 0 and N_uud < 0 for a stern rudder
    (the bow turns to port); elevator > 0: trailing edge down, so Z_uud < 0 and M_uud < 0.
Units
    SI and radians inside; propeller rate n in rev/s inside, rpm in files.
    A name that crosses a boundary carries its unit as a suffix (``u_mps``, ``rudder_rad``).
Time
    Seconds on one clock per trial. A sample of a measured channel at ``time_s`` is the value
    at that time; an input (rudder, elevator, rpm) at ``time_s`` is its mean over the step that
    *follows*, because a logged command is held until the next one.
Vocabulary
    The data
        trial       one log folder, recorded in one go by one vehicle
        record      a gap-free piece of a trial
        maneuver    a straight run with thrust steps, a turning circle or a zigzag within a trial
        role        ``identify`` or ``validate``; a maneuver that validates never chooses anything
        held out    kept for validation
    The model
        hydrodynamic derivative  coefficient of a product of velocities, or an added mass
        prime value              a coefficient without dimension, after SNAME
        effect                   something that the model may lack: a current, a servo lag, a bias
        measurement model        what the sensors read in a state, with their delays and errors
        ASE                      analytical and semi-empirical estimate, from geometry alone
    The estimation
        prior                    value and standard deviation of a parameter before the data
        posterior                the same after the data
        process noise            what the filter adds for what the equations do not hold
        innovation               measurement minus its one-step prediction, with covariance S
        NIS                      normalised innovation squared, 1 on average when S is right
        output error             fit of the free-running prediction to the measurements
        nuisance parameter       adjusted along with the others, of no interest in itself
        identifiable             determined by the data; else the value comes from the prior
        likelihood ratio         gain in log-likelihood by an effect, in nats
    The validation
        free-running prediction  from the initial state and the logged inputs alone
        NRMSE                    RMSE over the standard deviation of the measured channel
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from auvident.api.calls import (
        combine,
        estimate_from_geometry,
        load_model,
        load_run,
        load_vehicle,
        load_whole_model,
        pool,
        run,
    )
    from auvident.api.geometry import GeometryEstimate
    from auvident.api.maneuver import FlownManeuver
    from auvident.api.model import Model, Simulation
    from auvident.api.plots import Panels, Plots
    from auvident.api.results import PlaneModels, Run
    from auvident.api.whole import WholeModel
    from auvident.errors import (
        AuvidentError,
        ContradictionError,
        GateError,
        InputError,
        InUseError,
        NumericsError,
        StageError,
        UsageError,
    )
    from auvident.pipeline.observer import Observer
    from auvident.schema.vehicle import Vehicle

__version__ = "0.1.0"
# module -> what it offers of the Python interface; loaded when it is first asked for, so that
# `auvident --help` is there at once
_OFFERED = {
    "auvident.api.calls": (
        "run",
        "load_run",
        "load_model",
        "load_whole_model",
        "load_vehicle",
        "combine",
        "pool",
        "estimate_from_geometry",
    ),
    "auvident.api.results": ("Run", "PlaneModels"),
    "auvident.api.model": ("Model", "Simulation"),
    "auvident.api.whole": ("WholeModel",),
    "auvident.api.geometry": ("GeometryEstimate",),
    "auvident.api.maneuver": ("FlownManeuver",),
    "auvident.api.plots": ("Plots", "Panels"),
    "auvident.schema.vehicle": ("Vehicle",),
    "auvident.pipeline.observer": ("Observer",),
    "auvident.errors": (
        "AuvidentError",
        "GateError",
        "UsageError",
        "InputError",
        "ContradictionError",
        "StageError",
        "NumericsError",
        "InUseError",
    ),
}
_MODULE_OF = {name: module for module, names in _OFFERED.items() for name in names}
__all__ = [
    "AuvidentError",
    "ContradictionError",
    "FlownManeuver",
    "GateError",
    "GeometryEstimate",
    "InUseError",
    "InputError",
    "Model",
    "NumericsError",
    "Observer",
    "Panels",
    "PlaneModels",
    "Plots",
    "Run",
    "Simulation",
    "StageError",
    "UsageError",
    "Vehicle",
    "WholeModel",
    "__version__",
    "combine",
    "estimate_from_geometry",
    "load_model",
    "load_run",
    "load_vehicle",
    "load_whole_model",
    "pool",
    "run",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'auvident' has no attribute {name!r}")
    found = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF})
