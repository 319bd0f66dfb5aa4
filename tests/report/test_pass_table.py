"""The table of passes: noise of a filter, noise of a fit."""

from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.report.tables_model import passes
from auvident.schema.artifacts import FittedNoise
from tests.engines.chain import identified


def test_a_fit_shows_sensor_noise_and_disturbance_and_a_filter_what_it_used() -> None:
    model = identified("harbour_trial").model
    last = model.stages[-1]
    fit = last.model_copy(
        update={
            "stage": "fit",
            "nis": {},
            "nis_mean": {},
            "observer_time_s": None,
            "fitted_noise": {
                "u_mps": FittedNoise(white_std=0.005, slow_std=0.012, slow_time_s=2.0)
            },
        }
    )
    table = written(passes(model.model_copy(update={"stages": (last, fit)})), PAGE)
    place = table.heads.index("noise u_mps")
    filtered, fitted = table.rows
    assert fitted[place] == "0.0050, 0.012 over 2.0 s"
    assert float(filtered[place]) > 0.0
    assert fitted[table.heads.index("noise v_mps")] == ""
    assert fitted[table.heads.index("NIS u_mps")] == ""
    assert float(filtered[table.heads.index("NIS u_mps")]) > 0.0


def test_a_fit_without_a_disturbance_shows_the_sensor_noise_alone() -> None:
    model = identified("harbour_trial").model
    white = FittedNoise(white_std=0.005, slow_std=0.0, slow_time_s=1.0)
    fit = model.stages[-1].model_copy(update={"fitted_noise": {"u_mps": white}})
    table = written(passes(model.model_copy(update={"stages": (fit,)})), PAGE)
    assert table.rows[0][table.heads.index("noise u_mps")] == "0.0050"
