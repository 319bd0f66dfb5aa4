"""Every export that moves, flown over the held-out maneuvers of two samples, beside `simulate`.

Programs are run here, the FMU by FMPy. Those that go step by step (FMU, class) know no log from
before a maneuver: they are held against `simulate` for a log that begins there. gz-sim and
uuv_simulator are not run: their rows are by the equations that they document.
"""

import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from auvident.engines.carried import frame_of, vector_behind
from auvident.engines.prediction import readings
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.planes import BY_PLANE, Plane
from auvident.stages.export.cost import Cost, costs_of
from auvident.stages.export.gz import as_gz
from auvident.stages.export.simulators import read_gz, read_uuv
from auvident.stages.export.uuv import as_uuv
from auvident.stages.export.whole import whole_of
from tests.engines.chain import sample
from tests.engines.whole_world import TRIALS, held_out, planar
from tests.stages import test_export as programs

Rows = list[dict[str, Any]]
DEG = float(np.degrees(1.0))
SPEEDS = {"horizontal": ("u", "v", "r", "heading"), "vertical": ("u", "w", "q", "pitch")}
STEPWISE = ("fmu", "pvs")
SIMULATORS = {
    "gz": ("documented equations of gz-sim", as_gz, read_gz),
    "uuv": ("documented equations of uuv_simulator", as_uuv, read_uuv),
}
Flyer = Callable[[IdentifiedModel, list[programs.Case], Path], list[np.ndarray]]


def exports() -> dict[str, Rows]:
    """For each plane a row for each format: the tool, the largest difference, held-out errors."""
    return {f"{plane} plane, {trial}": _rows(plane, trial) for plane, trial in TRIALS.items()}


def _rows(plane: Plane, trial: str) -> Rows:
    model, (log,) = planar(plane), sample(trial).trials
    dt_s = 1.0 / log.rate_hz
    sensor = sensor_matrix(plane, model.sensing)
    records = [record_of(m, log, plane, sensor) for m in held_out(plane)]
    led = [programs.case_of(model, r, dt_s) for r in records]
    bare = [programs.case_of(model, without_lead(r), dt_s) for r in records]
    from_log, from_start = [c.expected for c in led], [c.expected for c in bare]
    rows = [_row("simulate", "auvident", plane, 0.0, _errors(model, records, from_log, dt_s))]
    for form, (tool, fly) in flyers().items():
        cases, expected = (bare, from_start) if form in STEPWISE else (led, from_log)
        with tempfile.TemporaryDirectory(prefix="auvident-exports-") as folder:
            flown = fly(model, cases, Path(folder))
        apart = max(float(np.abs(a - b).max()) for a, b in zip(flown, expected, strict=True))
        rows.append(_row(form, tool, plane, apart, _errors(model, records, flown, dt_s)))
    rows.append(_loop_of_pvs(model, plane, records, bare, from_start))
    whole, maneuvers = whole_of(model), sample(trial).maneuvers
    for form, (tool, write, read) in SIMULATORS.items():
        (cost,) = costs_of(model, whole, read(write(whole)), (log,), maneuvers)
        rows.append(_of_cost(form, tool, cost))
    return rows


def without_lead(record: Record) -> Record:
    """The record of a log that begins with it."""
    source = record.source
    assert source is not None
    lead = len(source.raw) - len(record.time_s)
    names = ("raw", "elapsed_s", "speed", "roll", "pitch", "depth")
    led = {n: values for n in names if (values := getattr(source, n)) is not None}
    return replace(record, source=replace(source, **{n: v[lead:] for n, v in led.items()}))


def _row(form: str, tool: str, plane: Plane, apart: float, errors: np.ndarray) -> dict[str, Any]:
    """Format, tool, largest difference of a state (SI), RMSE of held-out readings."""
    u, a, b, angle = SPEEDS[plane]
    scaled = errors * [1e3, 1e3, 1e3, DEG]
    names = (f"{u} mm/s", f"{a} mm/s", f"{b} mrad/s", f"{angle} deg")
    told = {n: float(np.round(e, 2)) for n, e in zip(names, scaled, strict=True)}
    return {"format": form, "run with": tool, "largest difference": f"{apart:.0e}", **told}


def _of_cost(form: str, tool: str, cost: Cost) -> dict[str, Any]:
    apart = max(cost.apart.values())
    return _row(form, tool, cost.plane, apart, np.array(list(cost.theirs.values())))


def _errors(
    model: IdentifiedModel, records: list[Record], states: list[np.ndarray], dt_s: float
) -> np.ndarray:
    """RMSE (4,) of the readings that the states stand for."""
    frame, p, off = frame_of(model, dt_s), vector_behind(model), []
    for record, flown in zip(records, states, strict=True):
        difference = readings(frame, p, record, flown) - record.measured
        if BY_PLANE[model.plane].states[3].wraps:
            difference[:, 3] = (difference[:, 3] + np.pi) % (2.0 * np.pi) - np.pi
        off.append(difference)
    return np.asarray(np.sqrt(np.nanmean(np.vstack(off) ** 2, axis=0)))


def flyers() -> dict[str, tuple[str, Flyer]]:
    """Formats that run on this machine, with the tool that runs them."""
    found: dict[str, tuple[str, Flyer]] = {"python": ("Python", _in_python)}
    if programs.OCTAVE:
        found["matlab"] = ("GNU Octave", _in_octave)
    if programs.GCC:
        found["c"] = ("gcc", _in_c)
        with suppress(PackageNotFoundError):
            found["fmu"] = (f"FMPy {version('fmpy')}", _in_fmu)
    return found | {"pvs": ("Python, angles given", _in_pvs)}


def _in_python(model: IdentifiedModel, cases: list[programs.Case], _: Path) -> list[np.ndarray]:
    return [programs.in_python(model, case) for case in cases]


def _in_octave(
    model: IdentifiedModel, cases: list[programs.Case], folder: Path
) -> list[np.ndarray]:
    return programs.in_octave([(model, case) for case in cases], folder)


def _in_c(model: IdentifiedModel, cases: list[programs.Case], folder: Path) -> list[np.ndarray]:
    return [programs.in_c(model, c, folder / f"model{k}.c") for k, c in enumerate(cases)]


def _in_fmu(model: IdentifiedModel, cases: list[programs.Case], folder: Path) -> list[np.ndarray]:
    from tests.stages.test_export_fmu import in_fmu

    homes = [folder / str(k) for k in range(len(cases))]
    for home in homes:
        home.mkdir()
    return [in_fmu(model, case, home)[0] for case, home in zip(cases, homes, strict=True)]


def _in_pvs(model: IdentifiedModel, cases: list[programs.Case], _: Path) -> list[np.ndarray]:
    return [_flown(model, case, programs.in_python(model, case)) for case in cases]


def _flown(model: IdentifiedModel, case: programs.Case, angles: np.ndarray | None) -> np.ndarray:
    """States by the class: the angle as given, or integrated by Euler's method as the package."""
    from tests.stages.test_export_pvs import NU, vehicle_of

    row, vehicle = BY_PLANE[model.plane], vehicle_of(model)
    vehicle.elapsed = case.series["elapsed_s"]
    columns = [NU.index(name) for name in row.velocities]
    place = 3 + ("roll", "pitch", "heading").index(row.states[3].symbol)
    own, other, rate = np.transpose(case.inputs)
    fins = {row.fins[0]: own, row.fins[1]: other}
    controls = np.column_stack([-fins["rudder"], fins["elevator"], 60.0 * rate])
    nu, eta, u_actual, out = np.zeros(6), np.zeros(6), controls[0], []
    nu[columns], eta[place] = case.start[:3], case.start[3]
    for k, u_control in enumerate(controls):
        if angles is not None:
            eta[place] = angles[k, 3]
        out.append([*nu[columns], eta[place]])
        nu, u_actual = vehicle.dynamics(eta, nu, u_actual, u_control, case.dt_s)
        eta[place] += case.dt_s * nu[columns[2]]
    return np.array(out)


def _loop_of_pvs(
    model: IdentifiedModel,
    plane: Plane,
    records: list[Record],
    cases: list[programs.Case],
    expected: list[np.ndarray],
) -> dict[str, Any]:
    """The class in the loop of the package, which integrates the angles by Euler's method."""
    flown = [_flown(model, case, None) for case in cases]
    apart = max(float(np.abs(a - b).max()) for a, b in zip(flown, expected, strict=True))
    errors = _errors(model, records, flown, cases[0].dt_s)
    return _row("pvs", "loop of the package, 0.1 s", plane, apart, errors)
