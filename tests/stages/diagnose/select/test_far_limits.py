"""A servo so slow that its limit is always reached, on a vehicle drawn by the generator."""

import sys
from pathlib import Path

from auvident.pipeline import run_stage
from auvident.pipeline.given import Given
from auvident.pipeline.steps import identifying_plan
from auvident.schema.effects import parameter_of
from auvident.stages.diagnose.fit.case import case_of
from auvident.stages.diagnose.fit.fits import log_gain
from auvident.stages.diagnose.select.refitting import first_steps
from auvident.stages.diagnose.select.screen import screen
from auvident.stages.diagnose.select.starts import baseline_of, is_limit
from auvident.stages.identify import prepare
from auvident.storage.run_directory import RunDirectory

SAMPLES = Path(__file__).resolve().parents[4] / "sample_logs"
SEED = 27  # rudder speed 5.3 deg/s; L/U 1.4 s, zigzags of 10 and 20 deg
LIMIT = "rudder_rate_limit"


def test_a_limit_that_is_always_reached_is_found_from_afar(tmp_path: Path) -> None:
    sys.path.insert(0, str(SAMPLES))
    from seatrial.population import draw

    drawn = draw(SEED)
    drawn.write(drawn.sail(), tmp_path / "trial", tmp_path / "vehicle.toml")
    logs = {"logs": (tmp_path / "trial",), "vehicle": tmp_path / "vehicle.toml"}
    for stage in ("ingest", "segment", "ase", "identify"):
        run_stage(stage, tmp_path / "run", logs if stage == "ingest" else None)
    run = RunDirectory(tmp_path / "run")
    given = Given(run, run.manifest())
    setup = prepare(
        given.trials,
        given.maneuvers,
        given.ase,
        given.vehicle,
        given.noise(),
        plane="horizontal",
        plan=identifying_plan(given),
        filter="ekf",
        engine="compiled",
    )
    case = case_of(setup, given.model, [])
    before = baseline_of(case)
    screened = screen(case, before, (LIMIT, "rudder_lag"))
    assert LIMIT in screened.short
    found = first_steps(case, before, screened)[LIMIT]
    assert log_gain(before, found) > 1000.0  # 2,100 when fitted to the end
    declared, (own,) = parameter_of(f"{LIMIT}.rate_degps"), case.positions(LIMIT)
    rate = declared.shown(found.parameters[own], 0.0)[0]
    assert abs(rate - drawn.planted[LIMIT]["rate_degps"]) < 0.05 * rate


def test_limits_are_those_that_do_nothing_until_they_are_reached() -> None:
    assert [is_limit(e) for e in (LIMIT, "rudder_stall", "rudder_lag", "current")] == [
        True,
        True,
        False,
        False,
    ]
