"""A model of six degrees of freedom to look at and to simulate."""

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np
import pandas as pd

from auvident.api.frames import finding_frame, range_frame, whole_frame
from auvident.api.maneuver import FlownManeuver
from auvident.pipeline.observer import Observer

if TYPE_CHECKING:
    from auvident.schema.combined import CombinedModel
    from auvident.schema.vehicle import Vehicle

DRAWS = 100


class WholeModel:
    """A model of six degrees of freedom, from runs of both planes and geometry.

    From `auvident.combine`, `auvident.load_whole_model` or `Run.whole`; SI, SNAME axes.

    Attributes
    ----------
    artifact : pydantic model
        Everything that its file has; `auvident schema combined` says what each key means.
    path : Path or None
        The file.
    """

    def __init__(
        self,
        artifact: "CombinedModel",
        path: Path | None = None,
        vehicle: "Vehicle | None" = None,
    ) -> None:
        self.artifact, self.path, self._vehicle = artifact, path, vehicle

    def __repr__(self) -> str:
        planes = " and ".join(m.plane for m in self.artifact.models) or "nothing"
        return f"<WholeModel of {self.artifact.vehicle}, {planes} identified>"

    @cached_property
    def coefficients(self) -> pd.DataFrame:
        """Coefficients and constants, by symbol: value, std, unit, source, prime, data_share."""
        return whole_frame(self.artifact)

    @cached_property
    def findings(self) -> pd.DataFrame:
        """What to know before the numbers are trusted."""
        return finding_frame(("combine", "", finding) for finding in self.artifact.findings)

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
        """Predict the motion in six degrees of freedom, as ``auvident simulate --inputs`` does.

        Parameters
        ----------
        inputs : pandas.DataFrame, str or Path
            As of `Model.simulate`; a table needs rudder, elevator and rpm.
        draws, speed_mps, from_s, to_s, seed, vehicle, map, rate_hz, observer
            As of `Model.simulate`.

        Returns
        -------
        pandas.DataFrame
            ``time_s``, ``stretch``, inputs, velocities through the water, roll, pitch, heading,
            way from the start, depth; ``..._low`` and ``..._high``: band of 95 % of the
            readings, or of the models drawn where the model tells of no errors of a channel.

        Raises
        ------
        InputError
            The log or the table cannot be used.
        NumericsError
            The motion diverges; says when.
        """
        from auvident.pipeline.inputs import trial_of
        from auvident.pipeline.whole import log_of_all_inputs, predict_whole_trial, signs_of
        from auvident.stages.combine import INPUT_COLUMNS

        told = observer or Observer()
        if isinstance(inputs, pd.DataFrame):
            trial = trial_of(inputs, INPUT_COLUMNS)
        else:
            file = None if vehicle is None else Path(vehicle)
            signs = signs_of(self.path, self.artifact, self._vehicle, file, told)
            column_map = None if map is None else Path(map)
            trial = log_of_all_inputs(signs, Path(inputs), column_map, rate_hz)
        window = (-np.inf if from_s is None else from_s, np.inf if to_s is None else to_s)
        options = {"window_s": window, "speed_mps": speed_mps, "samples": draws}
        return predict_whole_trial(self.artifact, trial, seed, options, told)

    def beyond(self, motion: pd.DataFrame) -> pd.DataFrame:
        """Where a motion leaves what the models of both planes were identified from.

        As of `Model.beyond`; a speed that either plane knows is known.

        Parameters
        ----------
        motion : pandas.DataFrame
            As `simulate` returns it.
        """
        from auvident.stages.combine import beyond_ranges

        return range_frame(beyond_ranges(self.artifact, motion))

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
        """Fly a standard maneuver of either plane; arguments as of `Model.maneuver`."""
        from auvident.pipeline.desk import Asked, fly_whole
        from auvident.schema.desk import desk_order

        asked = Asked(speed_mps, rpm, rudder_rate_degps, draws, seed)
        name, told = str(self.path or self.artifact.vehicle), observer or Observer()
        return FlownManeuver(fly_whole(self.artifact, name, desk_order(order), asked, told))

    def save(self, path: "str | Path") -> Path:
        """Write it to a file (JSON), as ``auvident combine --output`` does."""
        from auvident.pipeline.whole import write_combined

        write_combined(self.artifact, Path(path))
        return Path(path)

    @overload
    def export(self, format: str, path: None = None) -> str: ...

    @overload
    def export(self, format: str, path: "str | Path") -> Path: ...

    def export(self, format: str, path: "str | Path | None" = None) -> str | Path:
        """The model for a simulator of six degrees of freedom: pvs, gz or uuv.

        Parameters
        ----------
        format : str
        path : path, optional
            Write it to this file.

        Returns
        -------
        str or Path
            The text, or the file where one is given.

        Raises
        ------
        UsageError
            No such format, or one of a plane.
        """
        from auvident.api.forms import exported

        return exported(self.artifact, self.path, format, path)
