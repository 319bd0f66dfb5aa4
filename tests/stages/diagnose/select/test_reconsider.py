"""Effects seen together: two that do what one does are put in its place, and only those."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvident.engines.free_run import NOTHING
from auvident.engines.prediction import At, readings_with_slopes
from auvident.stages.diagnose.fit.case import ACTIVE, Case
from auvident.stages.diagnose.fit.fits import Fitted, log_gain
from auvident.stages.diagnose.fit.refits import apart, from_estimate, prior_cost, without
from auvident.stages.diagnose.select.reconsider import Exchange, exchanges, reconsider
from tests.stages.diagnose.loop_chain import small_case, small_fit

PAIR = ("rudder_offset", "dvl_misalignment")
WHOLE = "hull_asymmetry"
ALL = (*PAIR, WHOLE, "propeller_side_force", "current")
OFFSET, TURNED = math.radians(2.0), math.radians(3.0)


def wanted(*effects: str, staying: tuple[str, ...] = (), newest: tuple[str, ...] = ()) -> set:
    fitted = replace(small_fit(), effects=effects)
    return set(exchanges(fitted, ALL, staying, newest))


# --- what is tried -------------------------------------------------------------------------


def test_an_asymmetry_is_tried_as_two_effects_at_once() -> None:
    assert wanted(WHOLE, newest=(WHOLE,)) == {Exchange((WHOLE,), PAIR)}


def test_the_effect_of_a_pair_that_is_there_stays() -> None:
    found = wanted("dvl_misalignment", WHOLE, newest=(WHOLE,))
    assert found == {Exchange((WHOLE,), ("rudder_offset",))}


def test_two_effects_are_tried_as_one() -> None:
    found = wanted(*PAIR, newest=PAIR[1:])
    assert Exchange(PAIR, (WHOLE,)) in found
    assert Exchange(("rudder_offset",), (WHOLE,)) in found


def test_what_stays_is_not_exchanged() -> None:
    assert not wanted(*PAIR, staying=PAIR)
    assert not wanted("current", "dvl_misalignment")  # nothing looks like these


# --- on readings with an offset and a misalignment, or none ----------------------------------


@cache
def planted() -> tuple[Case, Fitted]:
    """Readings of a vehicle with both effects of the pair, fitted with an asymmetric hull."""
    case, rng = small_case(), np.random.default_rng(7)
    p = small_fit().parameters.copy()
    p[case.positions(PAIR[0])], p[case.positions(PAIR[1])] = OFFSET, TURNED
    records, at = [], At(case.setup.frame, p, case.setup.free(NOTHING))
    for record in case.records:
        found = readings_with_slopes(at, record, ACTIVE)
        assert found is not None
        measured = record.measured.copy()
        noise = rng.normal(size=(len(measured), 3)) * case.setup.sensor_std[:3]
        measured[:, :3] = np.where(
            np.isfinite(measured[:, :3]), found.readings[:, :3] + noise, np.nan
        )
        records.append(replace(record, measured=measured))
    made = replace(case, records=tuple(records))
    fitted = from_estimate(made, (WHOLE,), made.setup.prior)
    assert fitted is not None
    return made, fitted


def test_the_pair_takes_the_place_of_the_asymmetry() -> None:
    case, fitted = planted()
    found, steps = reconsider(case, ALL, fitted, ())
    assert found.effects == PAIR
    assert steps == [f"{WHOLE} replaced by {' and '.join(PAIR)}"]
    assert log_gain(fitted, found) > 0.0
    sizes = [found.parameters[case.positions(e)[0]] for e in PAIR]
    assert sizes == pytest.approx([OFFSET, TURNED], abs=math.radians(0.3))


def test_off_is_off_and_sizes_cost() -> None:
    case, fitted = planted()
    own = case.positions(WHOLE)
    off = without(case, fitted.parameters, (WHOLE,))
    np.testing.assert_array_equal(off[own], case.setup.prior[own])
    assert prior_cost(case, replace(fitted, parameters=off)) == 0.0
    off[own[0]] += 2.0 * case.setup.prior_std[own[0]]
    assert prior_cost(case, replace(fitted, parameters=off)) == pytest.approx(2.0)
    assert apart(fitted, (WHOLE,)) == ()
