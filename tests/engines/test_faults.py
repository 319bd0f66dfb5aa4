"""A filter that cannot go on says which maneuver, when and what; never NaN."""

import numpy as np
import pytest

from auvident.engines import compiled, reference
from auvident.errors import NumericsError
from tests.engines.chain import cut, problem_of, setup_of

SURGE, LATERAL = (True, False, False, False), (False, True, True, False)
LIFT = ("Y_uv", "Y_ur", "N_uv", "N_ur", "Y_uud", "N_uud")
DRAG = ("X_uu", "T_nn", "T_nu")
LONG = "harbour_trial-zigzag-2"
SHORT = "harbour_trial-turn-1"
RUNS = [
    pytest.param(compiled.run, "ekf", id="compiled-ekf"),
    pytest.param(compiled.run, "ukf", id="compiled-ukf"),
]
FILTERPY_RUNS = [
    pytest.param(reference.run, "ekf", id="filterpy-ekf"),
    pytest.param(reference.run, "ukf", id="filterpy-ukf"),
]


def problem(symbols, active, blind_from: int | None = None, parameters=(), **changes):
    setup = setup_of()
    pieces = [cut(setup.records[LONG][1], 180), cut(setup.records[SHORT][1], 120)]
    if blind_from is not None:
        for piece in pieces:
            piece.measured[blind_from:] = np.nan
    p = setup.prior.copy()
    for symbol, value in dict(parameters).items():
        p[setup.structure.index(symbol)] = value
    return problem_of(
        setup, pieces, symbols, active, channels=np.array(active), parameters=p, **changes
    )


def indefinite():
    """Two parameters more than perfectly correlated."""
    covariance = np.eye(6)
    covariance[0, 1] = covariance[1, 0] = 1.5
    return problem(LIFT, LATERAL, theta_covariance=covariance)


def diverging():
    """Drag that pushes, and no reading after the first two seconds."""
    return problem(DRAG, SURGE, blind_from=20, parameters={"X_uu": 200.0})


def singular():
    return problem(DRAG, SURGE, parameters={"X_udot": 100.0})


def caught(run, kind, made) -> NumericsError:
    with pytest.raises(NumericsError) as info:
        run(made, kind)
    assert info.value.exit_code == 5
    assert info.value.remedy
    return info.value


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_an_indefinite_covariance_stops_the_filter(run, kind) -> None:
    error = caught(run, kind, indefinite())
    assert "covariance is no longer positive definite" in error.problem
    assert f"maneuver {LONG}" in error.where
    assert " s after its start" in error.where
    if kind == "ukf":  # its Cholesky factor sees it at once, the EKF at the first bad variance
        assert ", 0.0 s" in error.where


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_noise_that_is_not_a_number_stops_the_filter(run, kind) -> None:
    made = problem(LIFT, LATERAL, process_std=np.full(4, np.nan))
    assert "covariance is no longer positive definite" in caught(run, kind, made).problem


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_a_diverging_state_stops_the_filter(run, kind) -> None:
    error = caught(run, kind, diverging())
    assert "the state diverged" in error.problem
    assert "maneuver harbour_trial-" in error.where
    assert error.where.endswith(", surge u")
    seconds = float(error.where.split(", ")[1].split(" s")[0])
    assert 0.0 <= seconds < 18.0


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_the_maneuver_that_diverges_is_the_one_named(run, kind) -> None:
    made = diverging()
    # the long record keeps its readings, and weighs enough to hold its own state
    made.records.inputs[0, :, 2] = 0.0
    made.start[0, 0] = 0.0
    made.records.measured[0, :180, 0] = 0.0
    made.start_std[0] = 1e-6
    made.process_std[0] = 1e-6
    assert SHORT in caught(run, kind, made).where


@pytest.mark.parametrize(
    ("run", "kind"),
    [
        RUNS[0],
        pytest.param(compiled.run, "ukf", id="compiled-ukf"),
    ],
)
def test_the_state_that_diverges_is_the_one_named(run, kind) -> None:
    pushing = {"Y_v|v|": 3e4, "N_r|r|": 3e4, "Y_uv": 500.0, "N_ur": 500.0}
    error = caught(run, kind, problem(LIFT, LATERAL, blind_from=20, parameters=pushing))
    assert error.where.endswith((", sway v", ", yaw rate r"))  # u is given in this system


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_a_mass_matrix_that_is_not_positive_stops_the_filter(run, kind) -> None:
    error = caught(run, kind, singular())
    assert "mass matrix is not positive definite" in error.problem
    assert error.where == "horizontal plane, added masses X_udot, Y_vdot, Y_rdot, N_vdot, N_rdot"
    assert "maneuver" not in str(error)  # none of them is to blame, nor helps to hold one out


def test_a_prior_that_reaches_a_negative_mass_stops_the_ukf() -> None:
    """Its sigma points try the mass matrix at one standard deviation."""
    made = problem(("X_udot", "X_uu"), SURGE, scale=np.array([100.0, 1.0]))
    assert "mass matrix is not positive definite" in caught(compiled.run, "ukf", made).problem


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_an_exactly_singular_mass_matrix_stops_the_filter(run, kind) -> None:
    setup = setup_of()
    mass = float(setup.prior[setup.structure.index("m")])
    caught(run, kind, problem(DRAG, SURGE, parameters={"X_udot": mass}))


@pytest.mark.parametrize(("run", "kind"), RUNS)
def test_two_negative_masses_stop_the_filter(run, kind) -> None:
    caught(run, kind, problem(LIFT, LATERAL, parameters={"Y_vdot": 100.0, "N_rdot": 100.0}))


@pytest.mark.filterwarnings("ignore")  # filterpy warns on its way down
@pytest.mark.parametrize(
    ("run", "kind", "made"),
    [
        pytest.param(reference.run, "ekf", indefinite, id="ekf-indefinite"),
        pytest.param(reference.run, "ekf", diverging, id="ekf-diverging"),
        pytest.param(reference.run, "ekf", singular, id="ekf-singular"),
        pytest.param(reference.run, "ukf", indefinite, id="ukf-indefinite"),
        pytest.param(reference.run, "ukf", diverging, id="ukf-diverging"),
        pytest.param(reference.run, "ukf", singular, id="ukf-singular"),
    ],
)
def test_filterpys_engine_has_the_same_errors(run, kind, made) -> None:
    where = caught(run, kind, made()).where
    assert ("added masses X_udot" if made is singular else LONG) in where
