"""One stage of a plan: the prior stays the ASE's, effective noise, what is free, errors."""

from dataclasses import fields, replace

import numpy as np
import pytest

from auvident.engines import estimator
from auvident.engines import noise as noise_module
from auvident.engines.carried import allowed
from auvident.engines.estimator import (
    data_information,
    free_positions,
    run_stage,
    stage_records,
)
from auvident.engines.free_run import OutputError, beginning_at, likelihood, predicted
from auvident.engines.noise import effective_noise, white
from auvident.engines.setup import Setup, active_states
from auvident.errors import NumericsError
from auvident.estimation.output_error import correlation_time
from auvident.physics.consistency import UNCONSTRAINED
from auvident.schema.plan import PlanStage, Tuning
from tests.engines.chain import cut, plan_named, setup_of

LINEAR = ("X_vv", "X_vr", "X_rr", "T_nn")
METHODS = ("filter", "output_error")


def stage(**changes) -> PlanStage:
    parts = {"name": "test", "system": "surge", "free": LINEAR, "maneuvers": ("turn",)}
    return PlanStage.model_validate(parts | changes)


class Unconstrained(Setup):
    """An identification that keeps nothing; so does one with other records or another plan."""

    constraints = UNCONSTRAINED


def linear_setup(filter: str = "ekf", **tuning) -> Setup:
    """The surge equation without u on its right-hand side: linear in state and parameters.

    No inequality bends it: thrust that no drag balances is next to none, and would be held there.
    """
    plan = plan_named("spiral").model_copy(update={"tuning": tuning})
    setup = setup_of(plan=plan, filter=filter)
    prior = setup.prior.copy()
    for symbol in ("X_uu", "T_nu", "X_uudd"):
        prior[setup.structure.index(symbol)] = 0.0
    records = {key: (kind, cut(record, 300)) for key, (kind, record) in setup.records.items()}
    parts = {f.name: getattr(setup, f.name) for f in fields(setup)}
    return Unconstrained(**parts | {"prior": prior, "records": records})


def elsewhere(setup: Setup) -> np.ndarray:
    """Parameters some standard deviations from the prior."""
    free = free_positions(setup, stage())
    p = setup.prior.copy()
    p[free] += setup.prior_std[free] * np.array([3.0, -2.0, 4.0, -1.5])
    return p


@pytest.fixture
def steady_noise(monkeypatch):
    """Noise that does not depend on the residuals, and so not on the start."""
    monkeypatch.setattr(estimator, "effective_noise", lambda output, p, std: 20.0 * std)
    monkeypatch.setattr(estimator, "coloured_noise", lambda output, p, std: white(20.0 * std))


# --- anchoring -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "kind"), [("filter", "ekf"), ("filter", "ukf"), ("output_error", "ekf")]
)
@pytest.mark.parametrize("tuning", [{}, {"X_vr": Tuning(prior=0.5), "thrust": Tuning(prior=2.0)}])
def test_the_start_of_a_stage_is_no_prior(steady_noise, method, kind, tuning) -> None:
    setup, how = linear_setup(kind, **tuning), stage(method=method)
    here = run_stage(setup, setup.prior, how)
    there = run_stage(setup, elsewhere(setup), how)
    free, scale = here.free, setup.prior_std[here.free]
    posterior = np.sqrt(np.diag(here.covariance))
    apart = (here.parameters - there.parameters)[free] / scale / posterior
    # linear: equal to rounding in the filter (condition 1e6); the fit stops at 1e-5 of its cost
    # (some 1e3), where Newton's last step has left 1e-3 of the 1e-2 allowed
    assert np.abs(apart).max() < (1e-6 if method == "filter" else 1e-2)
    np.testing.assert_allclose(here.covariance, there.covariance, atol=1e-9)
    moved = (elsewhere(setup) - here.parameters)[free] / scale / posterior
    assert np.abs(moved).max() > 1.0  # it did come back from somewhere else


@pytest.mark.parametrize("method", METHODS)
def test_the_same_data_twice_count_once(steady_noise, method) -> None:
    setup, how = linear_setup(), stage(method=method)
    once = run_stage(setup, setup.prior, how)
    twice = run_stage(setup, once.parameters, how)
    scale = setup.prior_std[once.free] * np.sqrt(np.diag(once.covariance))
    apart = (twice.parameters - once.parameters)[once.free] / scale
    assert np.abs(apart).max() < (1e-6 if method == "filter" else 1e-2)
    np.testing.assert_allclose(once.covariance, twice.covariance, atol=1e-9)


def test_the_fit_is_the_filter_without_process_noise(steady_noise) -> None:
    """On a linear problem both have the same posterior, but for the free start of the filter."""
    setup = linear_setup()
    calm = setup.plan.model_copy(update={"observer_time_s": 1e9})
    filtered = run_stage(replace(setup, plan=calm), setup.prior, stage())
    fitted = run_stage(setup, setup.prior, stage(method="output_error"))
    scale = setup.prior_std[fitted.free] * np.sqrt(np.diag(filtered.covariance))
    apart = (filtered.parameters - fitted.parameters)[fitted.free] / scale
    # the start, known to 3 standard deviations of a reading, is estimated by one of them only
    assert np.abs(apart).max() < 1.0
    assert np.all(np.diag(filtered.covariance) > 0.99 * np.diag(fitted.covariance))


def test_with_drift_the_start_hardly_leaks_into_the_result(steady_noise) -> None:
    """With drift the filter forgets its prior on the way, and the mean is put back nearly only."""
    setup = linear_setup(all=Tuning(drift=0.1))
    here = run_stage(setup, setup.prior, stage())
    there = run_stage(setup, elsewhere(setup), stage())

    def distance(by: np.ndarray) -> float:
        """In posterior standard deviations, whatever the directions."""
        away = by[here.free] / setup.prior_std[here.free]
        return float(np.sqrt(away @ np.linalg.solve(here.covariance, away)))

    # the drift of the pass is counted as if all of it came before the data: what is left of 17
    # standard deviations is 0.07 of them (0.06 with turn-3 for turn-2; wherever the starts lie 0.08
    # at most, as on the bay trial)
    leaked = distance(there.parameters - here.parameters)
    assert leaked < 0.1 * distance(elsewhere(setup) - setup.prior)
    assert there.passed is not None and here.passed is not None
    assert leaked < 0.5 * distance(there.passed.parameters - here.passed.parameters)


# --- effective noise -----------------------------------------------------------------------


def with_residual(setup: Setup, residual) -> Setup:
    """Every reading is the prediction of the prior plus a residual (n, 4) by record."""
    active = active_states("coupled", "horizontal")
    records = {}
    for number, (key, (kind, record)) in enumerate(setup.records.items()):
        if kind == "turn":
            exact = predicted(setup.frame, setup.prior, record, active)
            measured = exact + residual(number, len(exact))
            records[key] = (kind, replace(record, measured=measured))
    return replace(setup, records=records)


def noise_of(setup: Setup) -> np.ndarray:
    active = active_states("coupled", "horizontal")
    return noise_at(setup, setup.prior, [r for _, r in setup.records.values()], active)


def noise_at(setup: Setup, p, records, active) -> np.ndarray:
    """Effective noise of some records."""
    output = OutputError(setup.frame, tuple(records), active, white(setup.sensor_std))
    return effective_noise(output, p, setup.sensor_std)


def test_residuals_within_the_accuracy_of_the_sensor_leave_it_as_it_is() -> None:
    setup = setup_of()

    def tiny(number, n):
        return 1e-9 * np.random.default_rng(number).normal(size=(n, 4))

    noise = noise_of(with_residual(setup, tiny))
    # correlation time of white noise over 700 samples: 1 to 1.3, under the root
    assert (noise >= setup.sensor_std).all()
    assert (noise < 1.15 * setup.sensor_std).all()


def test_white_residuals_count_with_their_rms() -> None:
    setup = setup_of()

    def white(number, n):
        return 7 * setup.sensor_std * np.random.default_rng(number).normal(size=(n, 4))

    noise = noise_of(with_residual(setup, white)) / setup.sensor_std
    # rms of 2000 samples within 5 %, root of the correlation time up to 1.15
    assert (noise[:3] > 7 * 0.95).all() and (noise[:3] < 7 * 1.2).all()
    assert noise[3] == 1.0  # the heading is not active in this system


def test_correlated_residuals_count_less_by_the_root_of_their_correlation_time() -> None:
    setup, a = setup_of(), 0.9

    def correlated(number, n):
        rng, x = np.random.default_rng(number), np.zeros((n, 4))
        for k in range(1, n):
            x[k] = a * x[k - 1] + rng.normal(size=4) * np.sqrt(1 - a * a)
        return 7 * setup.sensor_std * x

    noise = noise_of(with_residual(setup, correlated)) / setup.sensor_std
    closed = 7 * np.sqrt((1 + a) / (1 - a))  # 30.5
    # 2000 samples of 19 correlated ones: some 100 independent; the correlation time is known to a
    # third, its root to a sixth or so, the mean of three channels to a tenth; three times that
    assert abs(float(np.mean(noise[:3])) / closed - 1) < 0.3


def test_a_prediction_that_ran_away_is_far_out_but_finite() -> None:
    setup = setup_of()
    p = setup.prior.copy()
    p[setup.structure.index("X_uu")] = +60.0
    records = stage_records(setup, stage())
    noise = noise_at(setup, p, records, active_states("coupled", "horizontal"))
    spread = np.nanstd(np.concatenate([r.measured for r in records])[:, 0])
    assert np.isfinite(noise).all()
    assert noise[0] > 5 * spread


def test_readings_after_a_prediction_ran_away_count_as_ten_times_their_spread(monkeypatch) -> None:
    setup = setup_of()
    (record, *_) = stage_records(setup, stage())
    lost = np.full((len(record), 4), np.nan)
    monkeypatch.setattr(noise_module, "predicted", lambda *_: lost)
    found = noise_at(setup, setup.prior, [record], active_states("coupled", "horizontal"))
    read = record.measured[np.isfinite(record.measured[:, 0]), 0]
    off = noise_module.ESCAPED * np.full(len(read), read.std())
    longest = round(noise_module.LONGEST_CORRELATION_S / setup.dt_s)
    assert found[0] == pytest.approx(off[0] * np.sqrt(correlation_time(off, longest)))


def test_readings_count_by_what_is_left_from_the_line_or_from_the_starts_of_the_fit() -> None:
    """The starts of a fit are made wrong here, so that the two differ."""
    setup = with_residual(setup_of(), lambda number, n: np.zeros((n, 4)))
    turns = stage(system="coupled", maneuvers=("turn",))
    p, off = setup.prior, np.array([0.1, 0.0, 0.0, 0.0])
    for own_starts in (False, True):
        task = estimator.task_of(replace(setup, own_starts=own_starts), turns)
        begun = tuple(beginning_at(record, off) for record in task.output.records)
        update = estimator._noise_update(task, False)
        noise = update(replace(task.output, records=begun), p).colours[0].white
        line = effective_noise(task.output, p, setup.sensor_std)[0]
        assert noise > 2.0 * line if own_starts else noise == line
        outcome = estimator.run_stage(
            task.setup, p, turns.model_copy(update={"method": "output_error"})
        )
        np.testing.assert_array_equal(outcome.noise, [c.white for c in outcome.colours])


def test_missing_readings_do_not_make_a_residual_white() -> None:
    """The correlation counts in samples that were taken."""
    setup = setup_of()

    def constant(number, n):
        x = np.full((n, 4), 1.0)
        x[::2] = np.nan
        return x

    noise = noise_of(with_residual(setup, constant))
    lengths = [len(r.time_s) // 2 for _, r in with_residual(setup, constant).records.values()]
    times = [correlation_time(np.ones(n), 600) for n in lengths]
    expected = np.sqrt(np.average(times, weights=lengths))
    np.testing.assert_allclose(noise[:3], expected, rtol=1e-6)


def test_a_record_without_a_reading_of_a_channel_says_nothing_about_it() -> None:
    setup = setup_of()
    turn = [kind for kind, _ in setup.records.values()].index("turn")

    def without_sway(number, n):
        x = np.full((n, 4), 1.0)
        x[:, 1] = np.nan if number == turn else 1.0
        return x

    whole = with_residual(setup, lambda number, n: np.ones((n, 4)))
    missing = noise_of(with_residual(setup, without_sway))
    others = dict(list(whole.records.items())[1:])  # it holds the turns alone
    assert len(others) == len(whole.records) - 1
    assert missing[0] == noise_of(whole)[0]
    assert missing[1] == noise_of(replace(whole, records=others))[1]


# --- what is free --------------------------------------------------------------------------


def test_free_are_the_named_coefficients_but_followers_and_what_is_certain() -> None:
    setup = setup_of()
    certain = setup.prior_std.copy()
    certain[setup.structure.index("Y_vdot")] = 0.0
    positions = free_positions(replace(setup, prior_std=certain), stage(free=("inertia", "Y_uv")))
    found = [setup.structure.parameters[i] for i in positions]
    assert found == ["Y_rdot", "Y_uv", "N_rdot"]  # no N_vdot: it follows Y_rdot


@pytest.mark.parametrize("method", METHODS)
def test_followers_move_along_and_others_stay(method) -> None:
    setup = setup_of()
    setup = replace(
        setup, records={k: (kind, cut(r, 250)) for k, (kind, r) in setup.records.items()}
    )
    how = stage(free=("inertia", "lift"), system="lateral", maneuvers=("zigzag",), method=method)
    outcome = run_stage(setup, setup.prior, how)
    moved = outcome.parameters - setup.prior
    leader, follower = (setup.structure.index(s) for s in ("Y_rdot", "N_vdot"))
    assert moved[follower] == pytest.approx(moved[leader], rel=1e-9)
    assert moved[leader] != 0.0
    held = np.setdiff1d(np.arange(len(moved)), [*outcome.free, follower])
    assert (moved[held] == 0.0).all()
    assert outcome.ids and all("zigzag" in name for name in outcome.ids)
    assert (np.linalg.eigvalsh(outcome.covariance) > 0).all()
    assert (np.diag(outcome.covariance) <= 1.0 + 1e-12).all()  # never less certain than before


def test_a_tighter_prior_moves_less(steady_noise) -> None:
    loose = run_stage(linear_setup(), linear_setup().prior, stage())
    tight = run_stage(linear_setup(turning_drag=Tuning(prior=1e-3)), linear_setup().prior, stage())
    scale = linear_setup().prior_std[loose.free]
    moved = [(o.parameters - linear_setup().prior)[o.free] / scale for o in (loose, tight)]
    assert np.abs(moved[0][:3]).max() > 0.1
    assert np.abs(moved[1][:3]).max() < 0.01
    np.testing.assert_allclose(np.diag(tight.covariance)[:3], 1e-6, rtol=0.05)


@pytest.mark.parametrize(
    ("system", "plane", "expected"),
    [
        ("surge", "horizontal", [1, 0, 0, 0]),
        ("lateral", "vertical", [0, 1, 1, 0]),
        ("coupled", "horizontal", [1, 1, 1, 0]),
        ("coupled", "vertical", [1, 1, 1, 1]),  # the pitch acts back through the weight
    ],
)
def test_active_states(system, plane, expected) -> None:
    assert active_states(system, plane).astype(int).tolist() == expected


def test_information_of_the_data_is_symmetric_and_what_the_fit_found(steady_noise) -> None:
    setup, how = linear_setup(), stage(method="output_error")
    outcome = run_stage(setup, setup.prior, how)
    information = data_information(setup, outcome, how)
    np.testing.assert_array_equal(information, information.T)
    np.testing.assert_allclose(
        np.linalg.inv(information + np.eye(4)), outcome.covariance, rtol=1e-9, atol=1e-12
    )


def test_both_methods_count_the_same_readings_in_the_vertical_plane() -> None:
    setup = setup_of("dive_trial", "vertical")
    pieces = [(key, kind, cut(r, 100)) for key, (kind, r) in setup.records.items()][:2]
    setup = replace(setup, records={key: (kind, r) for key, kind, r in pieces})
    free = {"free": ("lift",), "system": "coupled", "maneuvers": ("straight", "turn", "zigzag")}
    counts = [run_stage(setup, setup.prior, stage(**free, method=m)).samples for m in METHODS]
    assert counts[0] == counts[1]


# --- errors --------------------------------------------------------------------------------


def test_a_stage_without_maneuvers_is_an_error_that_names_it() -> None:
    setup = setup_of()
    turns = {k: v for k, v in setup.records.items() if v[0] == "turn"}
    with pytest.raises(NumericsError, match="no maneuver of kind zigzag") as caught:
        run_stage(replace(setup, records=turns), setup.prior, stage(maneuvers=("zigzag",)))
    assert caught.value.exit_code == 5
    assert "'test'" in caught.value.where


def test_a_stage_with_nothing_free_is_an_error() -> None:
    setup = setup_of()
    certain = replace(setup, prior_std=np.zeros_like(setup.prior_std))
    with pytest.raises(NumericsError, match="no free coefficient") as caught:
        run_stage(certain, setup.prior, stage())
    assert "'test'" in caught.value.where


# --- recovery ------------------------------------------------------------------------------

EVERYTHING = {"free": ("all",), "system": "coupled", "maneuvers": ("straight", "turn", "zigzag")}


def drawn(setup: Setup, seed: int) -> tuple[np.ndarray, Setup]:
    """Coefficients from the prior, and what sensors of the stated accuracy would have logged.

    Drawn again where the vehicle would not go straight, or spin, with the logged inputs.
    """
    rng, active = np.random.default_rng(seed), active_states("coupled", "horizontal")
    free = free_positions(setup, stage(**EVERYTHING))
    while True:
        p = setup.prior.copy()
        p[free] += setup.prior_std[free] * rng.normal(size=len(free))
        for follower, leader in setup.followers:
            p[follower] = setup.prior[follower] + p[leader] - setup.prior[leader]
        records = {}
        for key, (kind, record) in setup.records.items():
            exact = predicted(setup.frame, p, record, active)
            if not (np.abs(exact[:, 2]) < 1.0).all() or not (np.abs(exact[:, 0] - 2.6) < 2.4).all():
                break
            read = exact + setup.sensor_std * rng.normal(size=exact.shape)
            read[np.isnan(record.measured)] = np.nan
            records[key] = (kind, replace(record, measured=read))
        if len(records) == len(setup.records):
            return p, replace(setup, records=records)


def squared_distance(seed: int, method: str, passes: int) -> float:
    """Squared error over claimed covariance, per coefficient, after passes and a last stage."""
    truth, setup = drawn(setup_of(), seed)
    p = setup.prior
    for how in ("filter",) * passes + (method,):
        outcome = run_stage(setup, p, stage(**EVERYTHING, method=how))
        p = outcome.parameters
    error = (p - truth)[outcome.free] / setup.prior_std[outcome.free]
    return float(error @ np.linalg.solve(outcome.covariance, error)) / len(error)


def test_known_coefficients_are_recovered_within_their_stated_uncertainty() -> None:
    """The fit of the prediction, on data with the noise it supposes."""
    found = [squared_distance(seed, "output_error", 2) for seed in range(5)]
    # chi-square with 5 x 21 degrees of freedom over 105: 1 +- 0.14; four deviations either way,
    # and some more above for the linearisation of the covariance
    assert 0.5 < np.mean(found) < 1.8
    assert max(found) < 3.5


def test_the_filter_claims_no_more_than_it_knows() -> None:
    """Where its passes, each linear in the coefficients about where it starts, no longer move."""
    found = [squared_distance(seed, "filter", 6) for seed in range(5)]
    assert 0.1 < np.mean(found) < 1.4
    assert max(found) < 3.5


@pytest.mark.parametrize("filter", ["ekf", "ukf"])
def test_a_filter_learns_nothing_where_its_readings_show_nothing(filter) -> None:
    """Directions such as the scale of an equation keep the prior, wherever the pass arrives."""
    _, setup = drawn(replace(setup_of(), filter=filter), 0)
    everything = stage(**EVERYTHING)
    begun = run_stage(setup, setup.prior, everything)
    ended = run_stage(setup, begun.parameters, everything)
    seen, directions = np.linalg.eigh(data_information(setup, begun, everything))
    unseen = directions[:, seen < 1e-9]  # others are seen with 1e-6 and more
    assert unseen.shape[1] == 4
    # exact for derivatives; differences between sigma points bend by the square of their distance
    assert np.diag(unseen.T @ ended.covariance @ unseen).min() > 0.9995


# --- likelihood of the fit -----------------------------------------------------------------


def residuals_by_hand(setup: Setup, p, record, active, noise) -> np.ndarray:
    """Predicted minus measured over the noise, one below the other."""
    away = (predicted(setup.frame, p, record, active) - record.measured) / noise
    return away[:, active][np.isfinite(record.measured[:, active])]


def test_the_likelihood_is_that_of_explicit_residuals_with_the_best_start() -> None:
    setup = setup_of()
    active, noise = np.array([True, True, True, False]), 5.0 * setup.sensor_std
    free = np.array([setup.structure.index(s) for s in ("X_uu", "Y_uv", "N_uud", "Y_rdot")])
    records = [cut(record, 150) for _, record in list(setup.records.values())[:2]]
    half, gradient, curvature = 0.0, np.zeros(4), np.zeros((4, 4))
    for record in records:

        def residuals(theta: np.ndarray, record=record) -> np.ndarray:
            p = setup.prior.copy()
            p[free] += setup.prior_std[free] * theta[3:]
            p[setup.structure.index("N_vdot")] = p[setup.structure.index("Y_rdot")]
            moved = replace(record, start=record.start + np.append(theta[:3], 0.0))
            return residuals_by_hand(setup, p, moved, active, noise)

        h, r = 1e-5, residuals(np.zeros(7))
        j = np.stack([(residuals(h * e) - residuals(-h * e)) / (2 * h) for e in np.eye(7)], axis=1)
        prior = np.zeros((7, 7))
        prior[:3, :3] = np.diag((30.0 * noise[:3]) ** -2.0)  # of the start
        g, k = j.T @ r, j.T @ j + prior
        share = np.linalg.solve(k[:3, :3], np.column_stack([g[:3], k[:3, 3:]]))
        half += 0.5 * r @ r - 0.5 * g[:3] @ share[:, 0]
        gradient += g[3:] - k[3:, :3] @ share[:, 0]
        curvature += k[3:, 3:] - k[3:, :3] @ share[:, 1:]
    output = OutputError(setup.frame, tuple(records), active, white(noise))
    found = likelihood(output, setup.prior, setup.free(free))
    # central differences: second order in h and rounding over h, 1e-9 of slopes up to 1e3; kinks
    # of |v| and |r| within h of a few rows
    assert found[0] == pytest.approx(half, rel=1e-6)
    np.testing.assert_allclose(found[1], gradient, rtol=1e-4, atol=1e-4 * np.abs(gradient).max())
    size = np.sqrt(np.diag(curvature))
    np.testing.assert_allclose(
        found[2] / np.outer(size, size), curvature / np.outer(size, size), atol=1e-5
    )
    np.testing.assert_array_equal(found[2], found[2].T)


def test_the_likelihood_is_infinite_where_the_prediction_runs_away() -> None:
    setup = setup_of()
    p = setup.prior.copy()
    p[setup.structure.index("X_uu")] = 60.0
    active, free = np.array([True, True, True, False]), np.array([setup.structure.index("Y_uv")])
    record = next(iter(setup.records.values()))[1]
    output = OutputError(setup.frame, (record,), active, white(setup.sensor_std))
    assert likelihood(output, p, setup.free(free))[0] == np.inf


# --- refinement: where it starts, how far it goes ---------------------------------------------


def test_a_refinement_from_where_the_motion_runs_away_starts_from_the_prior(steady_noise) -> None:
    setup = linear_setup()
    setup, wild = replace(setup, start=setup.prior), setup.prior.copy()
    wild[setup.structure.index("X_rr")] = 1e9
    here = run_stage(setup, setup.prior, stage(method="output_error"))
    there = run_stage(setup, wild, stage(method="output_error"))
    np.testing.assert_allclose(there.parameters, here.parameters, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_nuisance_stays_within_its_bounds(method) -> None:
    """No servo turns before it is told to: the sample's readings shifted so that it would."""
    plan = plan_named("spiral")
    setup = setup_of(plan=plan, carried=allowed(("rudder_lag",), "horizontal", 1.7))
    early = {
        name: (kind, replace(record, source=replace(record.source, raw=late(record.source.raw))))
        for name, (kind, record) in setup.records.items()
    }
    lateral = ("inertia", "lift", "cross_flow", "control")
    how = stage(method=method, system="lateral", free=lateral, maneuvers=("zigzag",))
    found = run_stage(replace(setup, records=early), setup.start, how)
    lag = found.parameters[setup.structure.index("rudder_lag.lag_s")]
    assert lag == pytest.approx(0.0, abs=1e-12)


def late(raw: np.ndarray) -> np.ndarray:
    """Inputs half a second later than they were."""
    return np.concatenate([np.repeat(raw[:1], 5, axis=0), raw[:-5]])
