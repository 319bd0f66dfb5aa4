"""A model to look at, to simulate, to step and to hand on."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import pandas as pd

from auvident.api.frames import coefficient_frame, correlation_frame, effect_frame, range_frame
from auvident.api.maneuver import FlownManeuver
from auvident.errors import UsageError
from auvident.pipeline.observer import Observer
from auvident.schema.planes import CONTROL_COLUMNS, STATE_COLUMNS, Plane

if TYPE_CHECKING:
    import numpy.typing as npt

    from auvident.schema.artifacts import IdentifiedModel
    from auvident.stages.stepping import ModelStepper

    Array = npt.NDArray[np.float64]
State = Sequence[float] | Mapping[str, float]

DRAWS = 100  # models drawn for a band, as on the command line


class Model:
    """An identified model: coefficients with their uncertainty, effects, and the motion they make.

    From `auvident.load_model` or `Run.model`. SI and radians; SNAME axes: x forward, y starboard,
    z down. A positive rudder turns to port, a positive elevator pitches the bow down, whatever
    the signs in the log were.

    Attributes
    ----------
    artifact : pydantic model
        Everything that ``model.json`` has; `auvident schema model` says what each key means.
    path : Path or None
        The file.
    """

    def __init__(self, artifact: "IdentifiedModel", path: Path | None = None) -> None:
        self.artifact, self.path = artifact, path

    def __repr__(self) -> str:
        shown = self.artifact
        count = len(shown.effects)
        effects = "1 effect" if count == 1 else f"{count} effects"
        return f"<Model of {shown.vehicle}, {shown.plane} plane, {effects}>"

    @property
    def plane(self) -> Plane:
        """Plane of its motion: ``horizontal`` or ``vertical``."""
        return self.artifact.plane

    @property
    def states(self) -> tuple[str, str, str, str]:
        """Names of its states with their units: ``u_mps``, ``v_mps``, ``r_radps``, ``heading_rad``.

        In the vertical plane ``u_mps``, ``w_mps``, ``q_radps``, ``pitch_rad``.
        """
        first, second, third, fourth = STATE_COLUMNS[self.plane]
        return first, second, third, fourth

    @cached_property
    def coefficients(self) -> pd.DataFrame:
        """Coefficients and constants, by symbol: value, std, unit, prior, what the data say.

        Columns: ``plane``, ``value``, ``std``, ``unit``, ``prior``, ``prior_std``, ``prime`` (SNAME
        value without dimension; NaN of a constant), ``data_share`` (0 to 1, of the certainty),
        ``status`` (in words), ``source`` (identified, ase, given, kinematic), ``regressor``
        (what it multiplies), ``description``.
        """
        return coefficient_frame(self.artifact)

    @cached_property
    def effects(self) -> pd.DataFrame:
        """Effects beside the coefficients, by effect and parameter: value, std, unit, nuisance.

        ``nuisance`` are those estimated along in every model, of no interest in themselves.
        """
        return effect_frame(self.artifact)

    @cached_property
    def correlations(self) -> pd.DataFrame:
        """Correlations of the estimated parameters, symbol by symbol."""
        return correlation_frame(self.artifact)

    def simulate(
        self,
        inputs: "pd.DataFrame | str | Path",
        draws: int = DRAWS,
        *,
        speed_mps: float | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
        seed: int = 0,
        vehicle: "str | Path | None" = None,
        map: "str | Path | None" = None,
        rate_hz: float = 10.0,
        observer: Observer | None = None,
    ) -> pd.DataFrame:
        """Predict the motion from inputs alone, as ``auvident simulate --inputs`` does.

        Parameters
        ----------
        inputs : pandas.DataFrame, str or Path
            A log, read like any other with the signs of its vehicle; or a table in equal steps with
            ``time_s`` [s], ``rpm`` [1/min] and the fin of the plane (``rudder_rad`` or
            ``rudder_deg``, ``elevator_...``; positive to port, bow down). Where it has the states,
            the motion begins at those of the first row, else on a straight run.
        draws : int
            Models drawn from the covariance for the band; 0 for none.
        speed_mps : float, optional
            Begin on a straight run at this speed, in place of the measured state or of the speed
            in balance with the first rpm.
        from_s, to_s : float, optional
            First and last time [s].
        seed : int
            Of the draws.
        vehicle, map : path, optional
            Vehicle file for the signs, and column map, of a log.
        rate_hz : float
            Rows per second of a log on one clock.
        observer : Observer, optional

        Returns
        -------
        pandas.DataFrame
            ``time_s``, ``stretch``, inputs, states, in the horizontal plane ``north_m`` and
            ``east_m`` from the start, and ``..._low``, ``..._high`` of each state: where 95 of 100
            readings are expected.

        Raises
        ------
        InputError
            The log or the table cannot be used.
        NumericsError
            The motion diverges; says when.
        """
        from auvident.pipeline.inputs import trial_of
        from auvident.pipeline.predict import log_of_inputs, predict_trial, vehicle_of

        if isinstance(inputs, pd.DataFrame):
            trial = trial_of(inputs, (CONTROL_COLUMNS[self.plane][0], "rpm"))
        else:
            told = _path(vehicle)
            signs = vehicle_of(self.path, self.artifact, told, observer or Observer())
            trial = log_of_inputs(self.artifact, signs, Path(inputs), _path(map), rate_hz)
        window = (-np.inf if from_s is None else from_s, np.inf if to_s is None else to_s)
        options = {"window_s": window, "speed_mps": speed_mps, "samples": draws}
        return predict_trial(self.artifact, trial, seed, options, observer or Observer())

    def beyond(self, motion: pd.DataFrame) -> pd.DataFrame:
        """Where a motion leaves the range of the maneuvers that the model was identified from.

        Nothing tells how the vehicle behaves there, and no band covers it.

        Parameters
        ----------
        motion : pandas.DataFrame
            As `simulate` returns it.

        Returns
        -------
        pandas.DataFrame
            By quantity (``rudder``, ``u``, ``v``, ``r``; ``u_low`` is the lowest speed;
            ``elevator``, ``w``, ``q``): ``reaches``, ``identified``, ``unit``. Empty within the
            range, and of a model that does not know its own.
        """
        from auvident.stages.simulate import beyond_range

        return range_frame(beyond_range(self.artifact, motion))

    def step(self, state: State, rudder_rad: float, rpm: float, dt_s: float) -> "Array":
        """State after one step of the equations of motion, fin and propeller held.

        One Runge-Kutta step of the right-hand side that the identification and every prediction
        use. The fin is where it is: what a servo makes of an order is left to the caller, or to
        `start`, which remembers it.

        Parameters
        ----------
        state : sequence of 4 floats, or mapping
            As `states` names them: u, v [m/s], r [rad/s], heading [rad] (u, w, q, pitch).
        rudder_rad : float
            Angle of the fin of the plane; a positive rudder turns to port, a positive elevator
            pitches the bow down.
        rpm : float
            Of the propeller [1/min].
        dt_s : float
            [s]; 0.1 is fine for a small vehicle.

        Returns
        -------
        (4,) array

        Raises
        ------
        NumericsError
            The motion diverges.
        """
        _refuse_step(dt_s)
        return self._stepper.step(self._state(state), float(rudder_rad), rpm / 60.0, float(dt_s))

    def start(
        self,
        state: State | None = None,
        *,
        speed_mps: float | None = None,
        rudder_rad: float = 0.0,
        rpm: float = 0.0,
        dt_s: float = 0.1,
    ) -> "Simulation":
        """A simulation to be stepped, whose servo follows its orders as the model says.

        Parameters
        ----------
        state : sequence of 4 floats, or mapping, optional
            By default a straight run at `speed_mps`, else at rest.
        speed_mps : float, optional
        rudder_rad, rpm : float
            Angle of the servo and rate of the propeller at the start.
        dt_s : float
            Step [s].
        """
        if state is not None and speed_mps is not None:
            raise UsageError("state and speed_mps are both given", "start", "Give one of them.")
        begin = (speed_mps or 0.0, 0.0, 0.0, 0.0) if state is None else state
        return Simulation(self, self._state(begin), rudder_rad, rpm, dt_s)

    def maneuver(
        self,
        order: str,
        draws: int = DRAWS,
        *,
        speed_mps: float | None = None,
        rpm: float | None = None,
        rudder_rate_degps: float | None = None,
        seed: int = 0,
        observer: Observer | None = None,
    ) -> FlownManeuver:
        """Fly a standard maneuver, as ``auvident simulate --maneuver`` does.

        Parameters
        ----------
        order : str
            ``zigzag:10/10``, ``turning-circle:15``, ``spiral:25``, ``pull-out:15``,
            ``depth-step:5`` or ``vertical-zigzag:10/5``; angles in degrees, positive to
            starboard or bow up.
        draws : int
            Models drawn for the intervals (90 %); 0 for none.
        speed_mps, rpm : float, optional
            Of the approach; by default the speed of the trial.
        rudder_rate_degps : float, optional
            Of the fin; by default that of the model.
        seed : int
            Of the draws.
        observer : Observer, optional

        Raises
        ------
        UsageError, InputError
            No such maneuver, or one of the other plane.
        NumericsError
            The model cannot fly it.
        """
        from auvident.pipeline.desk import Asked, fly_model
        from auvident.schema.desk import desk_order

        asked = Asked(speed_mps, rpm, rudder_rate_degps, draws, seed)
        told = observer or Observer()
        return FlownManeuver(fly_model(self.artifact, self.path, desk_order(order), asked, told))

    @overload
    def export(self, format: str = "json", path: None = None) -> str: ...

    @overload
    def export(self, format: str, path: "str | Path") -> Path: ...

    def export(self, format: str = "json", path: "str | Path | None" = None) -> str | Path:
        """The model for use elsewhere, as ``auvident export`` writes it.

        Parameters
        ----------
        format : str
            As ``auvident export --format`` takes it: json, toml, csv, python, matlab, c, fmu, and
            of this plane alone pvs, gz and uuv (`WholeModel.export` has those of both).
        path : path, optional
            Write it to this file; of C its header is written beside it.

        Returns
        -------
        str or Path
            The text, or the file where one is given.

        Raises
        ------
        UsageError
            No such format, one that cannot hold the model, or fmu, which is no text, without a
            file.
        """
        from auvident.api.forms import exported

        return exported(self.artifact, self.path, format, path)

    @cached_property
    def _stepper(self) -> "ModelStepper":
        from auvident.stages.stepping import stepper_of

        return stepper_of(self.artifact)

    def _state(self, state: State) -> "Array":
        """The state as an array."""
        names = self.states
        if isinstance(state, Mapping | pd.Series):
            missing = [name for name in names if name not in state]
            values = [] if missing else [float(state[name]) for name in names]
        else:
            values = [float(x) for x in state]
        if len(values) != len(names):
            raise UsageError(
                "a state has four numbers", "state", f"In this order: {', '.join(names)}."
            )
        return np.array(values)

    def __getstate__(self) -> dict[str, Any]:
        return {"artifact": self.artifact, "path": self.path}


def _refuse_step(dt_s: float) -> None:
    if not 0.0 < dt_s < np.inf:
        raise UsageError(f"a step of {dt_s:g} s", "dt_s", "Give a positive number of seconds.")


def _path(path: "str | Path | None") -> Path | None:
    return None if path is None else Path(path)


class Simulation:
    """A model under way, one step at a time, with the memory of its servo; see `Model.start`.

    Attributes
    ----------
    dt_s : float
        Step [s].
    time_s : float
        Since the start.
    """

    def __init__(
        self, model: Model, state: "Array", rudder_rad: float, rpm: float, dt_s: float
    ) -> None:
        from auvident.stages.stepping import SteppedFleet

        _refuse_step(dt_s)
        self._fleet: SteppedFleet = SteppedFleet(
            model.artifact, state, rudder_rad, rpm / 60.0, dt_s
        )
        self.names, self.dt_s, self.time_s = model.states, dt_s, 0.0

    @property
    def state(self) -> "Array":
        """State (4,) now, as `Model.states` names it."""
        return self._fleet.state

    @property
    def way_m(self) -> "Array":
        """Way (2,) made through the water since the start: north and east; along and down."""
        return self._fleet.way_m.copy()

    @property
    def rudder_rad(self) -> float:
        """Angle of the servo now, which lags its orders."""
        return self._fleet.fin_rad

    def step(self, rudder_rad: float, rpm: float) -> "Array":
        """State (4,) one step later.

        Parameters
        ----------
        rudder_rad : float
            Angle ordered for the whole step; signs as of `Model.step`.
        rpm : float
            Rate ordered [1/min].

        Raises
        ------
        NumericsError
            The motion diverges.
        """
        after = self._fleet.step(float(rudder_rad), rpm / 60.0)
        self.time_s += self.dt_s
        return after
