"""The study's own look at what a written model breaks of what physics knows."""

import json

import pytest

from auvident.constants import GRAVITY_MPS2
from auvident.physics.consistency import BY_CONSTRAINT
from tests.bench.physical import broken, broken_in


def row(symbol, value, prior=None, prior_std=0.1):
    return {"symbol": symbol, "value": value, "prior": prior or value, "prior_std": prior_std}


def model(plane="horizontal", x_g_m=0.0, constants=(), damping=0.1, **changed):
    """A body of 60 kg and 14 kg m2 in water; `changed` are values off their estimates."""
    side = ("Y", "N", "v", "r") if plane == "horizontal" else ("Z", "M", "w", "q")
    force, moment, a, b = side
    estimate = {"X_udot": -2.0, f"{force}_{a}dot": -60.0, f"{moment}_{b}dot": -10.0}
    estimate |= {f"{force}_{b}dot": 1.0, f"{moment}_{a}dot": 1.0, "T_nn": 0.1, "T_nu": -0.2}
    estimate |= {f"{force}_uud": 10.0, f"{moment}_uud": -8.0}
    rows = [row(name, changed.get(name, prior), prior) for name, prior in estimate.items()]
    body = {"mass_kg": 60.0, "x_g_m": x_g_m, "z_g_m": 0.02, "inertia_kgm2": 14.0}
    stated = [{"id": "hull_damping", "value": damping}]
    return {"plane": plane, "rigid_body": body, "coefficients": rows} | {
        "constants": list(constants),
        "constraints": stated,
    }


@pytest.mark.parametrize("plane", ["horizontal", "vertical"])
def test_a_healthy_model_breaks_nothing(plane):
    assert broken(model(plane)) == []


BREAKS = {
    "surge_added_mass": {"X_udot": 1.0},
    "lateral_added_mass": {"N_rdot": 3.0},
    "total_mass": {"Y_vdot": 40.0},
    "thrust": {"T_nn": -0.01},
    "thrust_loss": {"T_nu": 0.1},
    "N_uud": {"N_uud": 2.0},
}


@pytest.mark.parametrize("name", BREAKS)
def test_each_fault_is_seen(name):
    assert name in broken(model(**BREAKS[name]))


def test_damping_is_what_the_model_says():
    assert broken(model(damping=-0.01)) == ["hull_damping"]


def test_what_the_estimate_breaks_already_is_taken_at_its_word():
    given = model(X_udot=1.5)
    given["coefficients"][0]["prior"] = 1.0
    assert broken(given) == []


def test_an_uncertain_fin_may_push_to_either_side():
    uncertain = model(N_uud=2.0)
    uncertain["coefficients"][-1]["prior_std"] = 8.0
    assert broken(uncertain) == []


def test_an_identified_righting_moment_says_where_the_mass_lies():
    """m z_G of 30 kg m ties surge to pitch: less than half of the body's inertia is left."""
    far = model("vertical", constants=[row("z_GW", 30.0 * GRAVITY_MPS2, 12.0)])
    assert "total_mass" in broken(far)


def test_models_of_a_run(tmp_path):
    (tmp_path / "identify").mkdir()
    (tmp_path / "identify/model.json").write_text(json.dumps(model(T_nn=-0.01)), encoding="utf-8")
    assert broken_in(tmp_path) == {"identify/model.json": ["thrust"]}


def test_names_are_those_of_the_program():
    assert set(BREAKS) - {"N_uud"} <= set(BY_CONSTRAINT)
