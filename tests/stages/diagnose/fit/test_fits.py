"""Fits of a diagnosis: priors, nuisances, bounds, sensor checks, masks; and what is judged."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.free_run import (
    RecordResidual,
    likelihood,
    normal_equations,
    residual_of,
    residuals_of,
    white_error,
)
from auvident.engines.records import NORTH
from auvident.physics.terms import LINEAR_DRAG
from auvident.schema.effects import in_plane, parameter_of
from auvident.stages.diagnose.checks.kinematics import SensorCheck
from auvident.stages.diagnose.fit import case as cases
from auvident.stages.diagnose.fit.case import ACTIVE, NUISANCE_REACH
from auvident.stages.diagnose.fit.fits import (
    Fitted,
    check_cost,
    fit_with,
    log_gain,
    noise_of,
    output_error,
    prior_of,
    started,
)
from auvident.stages.diagnose.fit.refits import SETTLED, nested, refit, settled
from auvident.stages.diagnose.score.first_order import in_parts
from auvident.stages.diagnose.select.candidates import bounds_of, impossible, size_of
from tests.stages.diagnose.loop_chain import loop, small_case, small_fit

LAG, LIMIT = "rudder_lag.lag_s", "rudder_rate_limit.rate_degps"
BIAS = "gyro_bias.bias_degps"


def checked(mean: float, std: float):
    """The case with a sensor check that knows the bias of the gyro."""
    check = SensorCheck((BIAS,), np.array([mean]), np.array([[std**2]]), 100, 0.001, "made up")
    return replace(small_case(), checks=(check,))


def unit_of(name: str) -> float:
    """What the sizes of a parameter are multiplied by for this vehicle: L/U of a time."""
    made = loop("harbour_trial")
    records = [record for _, record in made.setup.records.values()]
    return cases.size_unit(parameter_of(name), made.model, cases.sizes_of(records))


# --- what is free, and how far -------------------------------------------------------------


def test_effects_are_off_in_the_identified_model_and_in_the_prior() -> None:
    case = small_case()
    for i, name in enumerate(case.names):
        if "." in name:
            assert case.identified[i] == 0.0
            expected = case.setup.prior[i]
            assert expected == 0.0 or name == "linear_drag.X_u"  # the friction line
            assert case.low[i] <= expected <= case.high[i]


def test_every_fit_frees_coefficients_and_nuisances_but_no_inertia() -> None:
    case = small_case()
    names = {case.names[i] for i in case.with_baseline(("current",))}
    assert {"current.north_mps", "current.east_mps", LAG, "Y_uv", "T_nn"} <= names
    assert not {n for n in names if n.endswith("dot")}
    assert BIAS not in names


def test_a_nuisance_is_tight_until_its_effect_is_tried() -> None:
    case = small_case()
    free = case.with_baseline(("rudder_lag",))
    at = int(np.flatnonzero(free == case.position(LAG))[0])
    scale, declared = case.setup.prior_std[free][at], parameter_of(LAG)
    unit = unit_of(LAG)
    assert unit == pytest.approx(1.33 / 1.48, rel=0.02)  # L/U of the trial
    spread, reach = [], []
    for open_ in ((), case.positions("rudder_lag")):
        prior = prior_of(case, free, open_)
        spread.append(scale / np.sqrt(prior.information[at, at]))
        reach.append((prior.low[at] * scale, prior.high[at] * scale))
    assert spread == pytest.approx([declared.nuisance_std * unit, declared.prior * unit])
    assert reach[0] == pytest.approx((0.0, NUISANCE_REACH * declared.nuisance_std * unit))
    assert reach[1] == pytest.approx((declared.low * unit, declared.high * unit))


def test_what_the_sensors_say_counts_like_a_prior() -> None:
    case = checked(0.004, 0.001)
    free = case.with_baseline(("gyro_bias",))
    at = int(np.flatnonzero(free == case.position(BIAS))[0])
    found = prior_of(case, free, case.positions("gyro_bias"))
    prior, scale = parameter_of(BIAS).prior * unit_of(BIAS), case.setup.prior_std[free][at]
    assert scale / np.sqrt(found.information[at, at]) == pytest.approx((prior**-2 + 1e6) ** -0.5)
    assert found.mean[at] * scale == pytest.approx(0.004 * 1e6 / (1e6 + prior**-2))
    rest = np.delete(np.arange(len(free)), at)
    plain = prior_of(small_case(), free, case.positions("gyro_bias"))
    np.testing.assert_array_equal(found.mean[rest], plain.mean[rest])
    # and it costs where the effect is not free
    assert check_cost(case, case.identified) == pytest.approx(0.5 * 16.0)
    assert check_cost(small_case(), case.identified) == 0.0


def test_a_sensor_check_alone_can_call_for_an_effect() -> None:
    case = checked(0.004, 0.0002)
    before = fit_with(case, (), small_fit().parameters, small_fit().colours)
    after = fit_with(case, ("gyro_bias",), small_fit().parameters, small_fit().colours)
    assert before is not None and after is not None
    assert after.parameters[case.position(BIAS)] == pytest.approx(0.004, abs=0.0006)
    assert log_gain(before, after) > 100.0  # of the 200 nats of the check


def test_fits_stay_within_their_bounds() -> None:
    case = small_case()
    found = fit_with(case, ("current", "rudder_lag"), small_fit().parameters, small_fit().colours)
    assert found is not None
    prior = prior_of(case, found.free, case.positions(*found.effects))
    theta = found.parameters[found.free] / case.setup.prior_std[found.free]
    assert ((theta >= prior.low - 1e-12) & (theta <= prior.high + 1e-12)).all()
    held = np.setdiff1d(np.arange(len(case.names)), found.free)
    np.testing.assert_array_equal(found.parameters[held], small_fit().parameters[held])


# --- residuals -----------------------------------------------------------------------------


def test_parts_of_a_record_are_those_of_its_residual() -> None:
    """Half the squares with the start eliminated, against a fitted start explicitly."""
    case, fitted = small_case(), small_fit()
    output = output_error(case, fitted.colours)
    for record in case.records:
        parts = normal_equations(output, fitted.parameters, record, output.no_parameter)
        found = residual_of(output, output.at(fitted.parameters), record)
        assert parts is not None and found is not None
        white = white_error(found.error, fitted.colours, case.setup.dt_s)
        # the parts also count how far the start had to move, in units of what was known of it
        squares = 0.5 * float(np.sum(white**2))
        assert squares <= parts[0] * (1 + 1e-9)
        assert squares > parts[0] - 5.0  # three numbers, none of them far beyond its wide prior


def test_log_likelihood_and_rms_are_of_the_residuals() -> None:
    case, fitted = small_case(), small_fit()
    found = residuals_of(output_error(case, fitted.colours), fitted.parameters)
    assert found is not None
    noise = noise_of(case, found)
    pooled = np.concatenate([r.error for r in found])[:, :3]
    np.testing.assert_allclose(noise.rms, np.sqrt(np.nanmean(pooled**2, axis=0)))
    np.testing.assert_allclose(noise.rms, fitted.rms, rtol=0.05)
    assert noise.log_likelihood == pytest.approx(fitted.log_likelihood, abs=5.0)
    assert len(noise.colours) == 3


def test_masked_readings_do_not_count() -> None:
    case = small_case()
    record = case.records[1]
    start, end = record.time_s[0] + 3.0, record.time_s[0] + 8.0
    masked = case.masked([(record.id, start, end)])
    for one, other in zip(masked.records, case.records, strict=True):
        inside = (one.time_s >= start) & (one.time_s <= end) & (one.id == record.id)
        assert np.isnan(one.measured[inside]).all()
        np.testing.assert_array_equal(one.measured[~inside], other.measured[~inside])
    output = output_error(masked, small_fit().colours)
    found = residual_of(output, output.at(small_fit().parameters), masked.records[1])
    assert found is not None
    inside = (record.time_s >= start) & (record.time_s <= end)
    assert np.isnan(found.error[inside]).all()
    assert np.isfinite(found.error[~inside][:, ACTIVE]).any()
    assert not np.isnan(record.measured[inside]).all()  # the case itself is as it was


def test_a_model_that_runs_away_is_no_fit() -> None:
    case, p = small_case(), small_fit().parameters.copy()
    p[case.position("X_uu")] = -1e6  # a step of 0.1 s is far too long for such a drag
    assert residuals_of(output_error(case, small_fit().colours), p) is None
    assert fit_with(case, (), p, small_fit().colours) is None


def test_a_hull_that_drives_itself_is_no_start() -> None:
    """A prediction with it runs away; the fit begins at the nearest hull that does not."""
    case, p = small_case(), small_fit().parameters.copy()
    p[case.position("X_uu")] = 1e4
    assert residuals_of(output_error(case, small_fit().colours), p) is None
    found = fit_with(case, (), p, small_fit().colours)
    assert found is not None
    assert (case.setup.constraints(found.parameters)[0] >= 0.0).all()


# --- candidates ----------------------------------------------------------------------------


def test_effects_that_no_log_can_show_are_not_tried() -> None:
    setup = loop("harbour_trial").setup
    records = [r for _, r in setup.records.values()]
    every = {e.id for e in in_plane("horizontal")}
    bare = []
    for r in records:
        assert r.source is not None
        zero = replace(
            r.source, roll=0 * r.source.roll, pitch=0 * r.source.pitch, rates=0 * r.source.rates
        )
        measured = r.measured.copy()
        measured[:, 3] = np.nan
        bare.append(replace(r, measured=measured, source=zero))
    there, missing = cases.testable(setup, bare)
    gone = every - {e.id for e in there}
    assert {"current", "gyro_scale", "roll_coupling", "dvl_height", "weight_excess"} <= gone
    assert {"heading_rad", "roll_rad", "p_radps", "pitch_rad"} <= set(missing)
    assert "rudder_offset" in {e.id for e in there}


def test_a_pitch_rate_stands_for_no_roll_rate() -> None:
    setup, records = loop("harbour_trial").setup, []
    for _, r in setup.records.values():
        rates = np.column_stack([np.zeros(len(r)), 0.01 * np.ones(len(r))])
        records.append(replace(r, source=replace(r.source, rates=rates)))
    there, missing = cases.testable(setup, records)
    assert "p_radps" in missing and "dvl_height" not in {e.id for e in there}


@pytest.mark.parametrize(
    ("frames", "shown"),
    [(("trial",), True), (("trial", "another"), False), (("trial", NORTH), False)],
)
def test_a_current_is_tried_without_a_compass_where_all_headings_count_from_one_bow(
    frames, shown
) -> None:
    setup, records = loop("harbour_trial").setup, []
    for k, (_, r) in enumerate(setup.records.values()):
        measured = r.measured.copy()
        measured[:, 3] = np.nan
        source = replace(r.source, frame=frames[k % len(frames)])
        records.append(replace(r, measured=measured, source=source))
    there, missing = cases.testable(setup, records)
    ids = {e.id for e in there}
    assert ("current" in ids) == shown
    # what a gyro has turned tells neither its scale nor a slow change of the current
    assert not {"gyro_scale", "current_drift", "wave"} & ids and "heading_rad" in missing
    assert cases.counted_from(records) == "bow"


def test_logged_headings_count_from_north() -> None:
    records = [r for _, r in loop("harbour_trial").setup.records.values()]
    assert cases.counted_from(records) == "north"


def test_a_fit_without_effects_begins_at_what_every_vehicle_is_expected_to_have() -> None:
    case = small_case()
    q, nuisance = case.at_rest(np.zeros(len(case.names))), case.nuisance_std > 0.0
    expected = nuisance & (case.setup.prior != 0.0)
    assert LINEAR_DRAG in {case.names[i] for i in np.flatnonzero(expected)}
    np.testing.assert_array_equal(q[expected], case.setup.prior[expected])
    one_sided = nuisance & ~expected & (case.low == 0.0)
    assert one_sided.any()
    np.testing.assert_array_equal(q[one_sided], case.nuisance_std[one_sided])
    assert not q[~(expected | one_sided)].any()


def residuals_at(case: cases.Case, base: Fitted, p: np.ndarray) -> list[RecordResidual]:
    found = residuals_of(output_error(case, base.colours), p)
    assert found is not None
    return list(found)


def test_sizes_are_in_practical_units_beyond_what_is_expected() -> None:
    case, base = small_case(), small_fit()
    p = case.at_rest(case.setup.prior)
    for effect in ("current", "rudder_offset", "dvl_misalignment", "linear_drag"):
        q = p.copy()
        positions = case.positions(effect)
        for i in positions:
            declared = parameter_of(case.names[i])
            unit = case.setup.prior_std[i] / declared.prior
            q[i] = case.setup.prior[i] + declared.practical * unit
        assert size_of(case, effect, replace(base, parameters=q)) == pytest.approx(
            np.sqrt(len(positions))
        )
    assert size_of(case, "linear_drag", replace(base, parameters=p)) == pytest.approx(0.0)


@pytest.mark.parametrize("effect", ["rudder_delay", "rudder_lag", "dvl_delay"])
def test_a_time_within_half_a_step_of_the_grid_is_too_small(effect: str) -> None:
    case, base = small_case(), small_fit()
    (i,) = case.positions(effect)
    coarse = replace(case, setup=replace(case.setup, dt_s=1.0))
    found = replace(base, parameters=case.setup.prior.copy())
    found.parameters[i] += 0.49
    assert size_of(case, effect, found) > 1.0 > size_of(coarse, effect, found)
    found.parameters[i] += 0.02
    assert size_of(coarse, effect, found) > 1.0
    assert coarse.practical([case.position("current.north_mps")]) == pytest.approx(
        case.practical([case.position("current.north_mps")])
    )


@pytest.mark.parametrize("name", ["hull_asymmetry", "propeller_side_force"])
def test_a_force_is_as_large_as_what_it_does(name) -> None:
    """An offset of the rudder is a side force and a moment: it is as large by either name."""
    case, base = small_case(), small_fit()
    own, offset = case.positions(name), case.positions("rudder_offset")
    by_parts = in_parts(case, base, name)
    assert by_parts is not None and by_parts.shape == (2, len(own))
    # so much of both that the rudder is laid by three practical sizes, and nothing drifts
    sizes = np.linalg.solve(by_parts, [3.0, 0.0])
    p = base.parameters.copy()
    p[own] = case.setup.prior[own] + sizes * case.setup.prior_std[own]
    # the model has moved a little with it, and so have the signatures
    assert size_of(case, name, replace(base, parameters=p)) == pytest.approx(3.0, rel=0.05)
    q = base.parameters.copy()
    declared = parameter_of("rudder_offset.offset_deg")
    q[offset] = 3.0 * declared.practical * case.setup.prior_std[offset] / declared.prior
    by_offset, by_force, straight = (
        np.concatenate([r.error[:, 1:3] for r in residuals_at(case, base, x)])
        for x in (q, p, base.parameters)
    )
    one, other = by_offset - straight, by_force - straight
    seen = np.isfinite(one) & np.isfinite(other)
    left = [
        1.0 - np.sum((one - other)[:, k][seen[:, k]] ** 2) / np.sum(one[:, k][seen[:, k]] ** 2)
        for k in range(2)
    ]
    assert min(left) > 0.8  # in turns the three do not go with the speeds in one way


def test_only_bounds_other_than_off_are_bounds() -> None:
    case, at = small_case(), small_case().position(LAG)
    for value, sides in ((case.low[at], {}), (0.3, {}), (case.high[at], {at: 1.0})):
        p = case.identified.copy()
        p[at] = value
        assert bounds_of(case, "rudder_lag", p) == sides
        assert not impossible(case, "rudder_lag", p)
    at = case.position("current.north_mps")
    for value, side in ((case.low[at], -1.0), (case.high[at], 1.0)):
        p = case.identified.copy()
        p[at] = value
        assert bounds_of(case, "current", p) == {at: side}
        assert not impossible(case, "current", p)  # either way is as likely


def test_a_bound_is_of_the_wrong_kind_where_sizes_end_sooner() -> None:
    case = small_case()
    at = case.position("rudder_delay.delay_s")
    for value, wrong in ((case.low[at], True), (-0.1, False), (case.high[at], False)):
        p = case.identified.copy()
        p[at] = value
        assert impossible(case, "rudder_delay", p) == wrong


def slopes_of(case, fitted, p, step=1e-5):
    """Slopes of the cost at p by differences and as the fit takes them, and its curvature."""
    output, free = output_error(case, fitted.colours), case.setup.free(fitted.free)

    def half(by):
        return likelihood(output, free.moved(p, by), free)

    axes = step * np.eye(len(fitted.free))
    found = np.array([(half(e)[0] - half(-e)[0]) / (2 * step) for e in axes])
    return found, *half(np.zeros(len(axes)))


def test_slopes_of_the_servo_are_those_of_the_cost() -> None:
    fitted = small_fit()
    p, at = fitted.parameters.copy(), [small_case().position(name) for name in (LAG, LIMIT)]
    p[at] = (0.4, 0.5) * small_case().setup.prior_std[at]
    case = started(small_case(), replace(fitted, parameters=p))
    slopes, _, gradient, curvature = slopes_of(case, fitted, p)
    own = np.searchsorted(fitted.free, at)
    # in standard deviations
    assert np.abs((gradient - slopes) / np.sqrt(np.diag(curvature)))[own].max() < 0.2


def test_a_fit_ends_where_its_cost_is_least() -> None:
    """What its slopes by differences promise is a small part of a nat."""
    fitted = settled(small_case(), small_fit())
    case = started(small_case(), fitted)
    prior = prior_of(case, fitted.free, case.positions(*fitted.effects))
    theta = fitted.parameters[fitted.free] / case.setup.prior_std[fitted.free]
    inside = (theta > prior.low + 1e-4) & (theta < prior.high - 1e-4)
    assert LAG in {case.names[i] for i in fitted.free[inside]}
    slopes, _, _, curvature = slopes_of(case, fitted, fitted.parameters)
    downhill = (slopes + prior.information @ (theta - prior.mean))[inside]
    whole = (curvature + prior.information)[np.ix_(inside, inside)]
    assert 0.5 * downhill @ np.linalg.solve(whole, downhill) < 0.05


# --- sensors that are late -----------------------------------------------------------------


# [nats] a reading's density is 4 (m/s) or 6 (rad/s) nats, which is what losing one used to cost
LIKE_OTHERS = 2.5


@pytest.mark.parametrize("name", ["dvl_delay.delay_s", "gyro_delay.delay_s"])
@pytest.mark.parametrize("late", [-0.3, -1e-6, 1e-6, 0.3])
def test_a_late_sensor_gains_nothing_by_the_readings_it_loses(name, late) -> None:
    """A reading from before its record is lost; it must count neither for nor against a delay."""
    fitted = small_fit()
    case = started(small_case(), fitted)
    p = fitted.parameters.copy()
    p[case.position(name)] = late
    found = residuals_of(output_error(case, fitted.colours), p)
    assert found is not None
    seen = [np.isfinite(r.error[:, :3]).sum() for r in found]
    whole = [np.isfinite(r.measured[:, :3]).sum() for r in case.records]
    assert sum(seen) < sum(whole)
    value = noise_of(case, found).log_likelihood
    half = cost_of(case, p, fitted.colours)
    if abs(late) < 1e-3:  # as without any delay, but for first readings, which fit a little worse
        lost = sum(whole) - sum(seen)
        assert abs(value - fitted.log_likelihood) < LIKE_OTHERS * lost
        assert abs(half - cost_of(case, fitted.parameters, fitted.colours)) < LIKE_OTHERS * lost
    else:  # the readings of a healthy sensor say that it is not late
        assert value < fitted.log_likelihood - 20.0
        assert half > cost_of(case, fitted.parameters, fitted.colours) + 20.0


def cost_of(case, p, colours) -> float:
    """Half the squared errors of all records."""
    output = output_error(case, colours)
    return likelihood(output, p, output.no_parameter)[0]


# --- a fit that contains another -----------------------------------------------------------


def lost(effect: str, size: float, likelihood: float) -> Fitted:
    """A fit with an effect that ended somewhere."""
    case, before = small_case(), small_fit()
    p = before.parameters.copy()
    p[case.positions(effect)] = size
    return replace(
        before,
        effects=(effect,),
        parameters=p,
        log_likelihood=likelihood,
        free=case.with_baseline((effect,)),
    )


@pytest.mark.parametrize("effect", ["rudder_lag", "dvl_lever_arm", "gyro_delay"])
def test_a_fit_never_ends_below_the_model_that_it_contains(effect) -> None:
    case, before = small_case(), small_fit()
    found = nested(case, before, lost(effect, 0.4, before.log_likelihood - 109.0))
    assert found.effects == (effect,)
    assert log_gain(before, found) >= 0.0
    assert set(case.positions(effect)) <= set(found.free)


def test_a_fit_that_is_better_than_its_base_stays_as_it_is() -> None:
    better = lost("rudder_lag", 0.1, small_fit().log_likelihood + 3.0)
    assert nested(small_case(), small_fit(), better) is better


def test_a_fit_is_carried_on_until_it_gains_no_more() -> None:
    """Two rounds of eight steps from far away are not the end of the way."""
    case, before = small_case(), small_fit()
    start = case.at_rest(case.setup.prior)
    begun = fit_with(case, ("gyro_bias",), start, before.colours, rounds=1, steps=1)
    assert begun is not None
    found = settled(case, begun)
    again = refit(case, found.effects, [found.parameters], found)
    assert again is not None and log_gain(found, again) < SETTLED
    assert log_gain(before, found) > -SETTLED
