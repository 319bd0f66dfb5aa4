"""What a refinement changed: errors in closed form, intervals, and what is handed on."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

from auvident.engines.carried import Carried, effect_rows
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import (
    ChannelMetrics,
    Finding,
    IdentifiedModel,
    ManeuverMetrics,
    Maneuvers,
    Metrics,
)
from auvident.schema.diagnosis import Comparison, Diagnosis, EffectFound, ParameterValue
from auvident.stages.identify.setup import prepare
from auvident.stages.refine import (
    attempts,
    carried_of,
    compare,
    findings_of,
    first_without_rise,
    worst_rise,
)
from tests.engines.chain import plan_named, sample

DT, N = 0.1, 600
OFF = {"u_mps": (0.03, 0.01), "v_mps": (-0.02, -0.02), "r_radps": (0.004, 0.006)}
ROLES = {"straight-1": "identify", "turn-1": "validate", "zigzag-1": "validate"}
NONE = Diagnosis(plane="horizontal", verdict="none_found", statement="Nothing.")


def predicted(when: int, noise: float = 0.0) -> pd.DataFrame:
    """Readings of three maneuvers and predictions that are off by `OFF`, before or after."""
    pieces = []
    for k, name in enumerate(ROLES):
        time = 100.0 * k + DT * np.arange(N)
        piece = {"maneuver": name, "kind": name.split("-")[0], "time_s": time, "rpm": 900.0}
        for c, (column, away) in enumerate(OFF.items()):
            measured = np.sin(0.1 * time + c)
            wrong = np.random.default_rng(100 * k + 10 * c + when).normal(size=N) * noise
            piece |= {f"{column}_measured": measured,
                      f"{column}_simulated": measured + away[when] * (k + 1) + wrong}  # fmt: skip
        pieces.append(pd.DataFrame(piece))
    return pd.concat(pieces, ignore_index=True)


MANEUVERS = Maneuvers.model_validate({
    "maneuvers": [
        {"id": name, "trial": "t", "kind": name.split("-")[0], "t_start_s": 100.0 * k,
         "t_end_s": 100.0 * k + DT * N, "role": role}
        for k, (name, role) in enumerate(ROLES.items())
    ]
})  # fmt: skip


@cache
def model() -> IdentifiedModel:
    return sample("harbour_trial").identify().model


def compared(before: pd.DataFrame, after: pd.DataFrame, seed: int = 0) -> Comparison:
    return compare(NONE, MANEUVERS, model(), model(), before, after, seed=seed)


# --- errors --------------------------------------------------------------------------------


def test_errors_are_root_mean_squares_over_all_samples_of_a_role() -> None:
    found = compared(predicted(0), predicted(1))
    assert found.held_out.maneuvers == ("turn-1", "zigzag-1")
    assert found.identify.maneuvers == ("straight-1",)
    for column, away in OFF.items():
        channel = column[0]
        for when, errors in ((0, found.held_out.before), (1, found.held_out.after)):
            expected = abs(away[when]) * np.sqrt((2**2 + 3**2) / 2)  # two of equal length
            assert errors[channel].rmse == pytest.approx(expected, rel=1e-12)
        assert found.identify.before[channel].rmse == pytest.approx(abs(away[0]), rel=1e-12)
    one = {m.id: m for m in found.maneuvers}
    assert one["zigzag-1"].after["r"].rmse == pytest.approx(0.018)
    assert {m.id: m.role for m in found.maneuvers} == ROLES
    assert {e.unit for e in (found.held_out.before["u"], found.held_out.before["v"])} == {"m/s"}


def test_normalised_errors_are_over_the_spread_of_what_was_measured() -> None:
    found, table = compared(predicted(0), predicted(1)), predicted(0)
    held = table[table["maneuver"] != "straight-1"]
    for column in OFF:
        error = found.held_out.before[column[0]]
        spread = np.std(held[f"{column}_measured"].to_numpy())
        assert error.nrmse == pytest.approx(error.rmse / spread, rel=1e-12)


def test_rows_without_a_reading_do_not_count() -> None:
    before, after = predicted(0), predicted(1)
    gone = before.index % 3 == 0
    for table in (before, after):
        table.loc[gone, "u_mps_measured"] = np.nan
        table.loc[gone, "u_mps_simulated"] = 1e6
    found, whole = compared(before, after), compared(predicted(0), predicted(1))
    for when in ("before", "after"):
        ours, theirs = (getattr(c.held_out, when)["u"].rmse for c in (found, whole))
        assert ours == pytest.approx(theirs, rel=1e-12)
    assert found.held_out.difference["u"].high < 0.0


def test_a_channel_that_nobody_measured_is_left_out() -> None:
    before, after = (predicted(k).assign(v_mps_measured=np.nan) for k in (0, 1))
    found = compared(before, after)
    assert set(found.held_out.before) == {"u", "r"} == set(found.held_out.difference)


# --- intervals -----------------------------------------------------------------------------


def test_the_interval_of_equal_predictions_is_zero() -> None:
    found = compared(predicted(0, 0.01), predicted(0, 0.01))
    for d in found.held_out.difference.values():
        assert (d.value, d.low, d.high) == (0.0, 0.0, 0.0)


def test_the_interval_holds_the_difference_and_tells_better_from_worse() -> None:
    found = compared(predicted(0, 0.005), predicted(1, 0.005)).held_out
    for channel, d in found.difference.items():
        away = found.after[channel].rmse - found.before[channel].rmse
        assert d.value == pytest.approx(away, rel=1e-12)
        assert d.low <= d.value <= d.high
    assert found.difference["u"].high < 0.0 < found.difference["r"].low


def test_the_interval_holds_the_true_difference_as_often_as_it_says() -> None:
    """No difference but noise: zero is inside in nearly all of 40 repetitions."""
    inside = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        tables = [predicted(0), predicted(0)]
        for table in tables:
            table["u_mps_simulated"] += 0.05 * rng.normal(size=len(table))
        d = compared(tables[0], tables[1]).held_out.difference["u"]
        inside += d.low <= 0.0 <= d.high
    # 95 % of 40 are 38; six blocks of time are few, and the binomial has a deviation of 1.4
    assert inside >= 30


def test_the_same_seed_gives_the_same_interval() -> None:
    tables = predicted(0, 0.02), predicted(1, 0.02)
    one, two, other = (compared(*tables, seed=s) for s in (1, 1, 2))
    assert one == two
    assert one.held_out.difference != other.held_out.difference
    assert one.held_out.before == other.held_out.before


# --- what is handed on ---------------------------------------------------------------------

OFFSET = EffectFound(
    id="rudder_offset", family="actuation",
    parameters=(ParameterValue(symbol="offset_deg", value=1.0, std=0.1, unit="deg", low=0.8,
                               high=1.2),),
)  # fmt: skip
CARRIED = {
    "start": {"rudder_offset.offset_deg": 0.0175, "rudder_lag.lag_s": 0.03},
    "prior": {"rudder_offset.offset_deg": 0.0}, "prior_std": {"rudder_offset.offset_deg": 0.035},
}  # fmt: skip
EVENT = EffectFound(
    id="one_off_event", family="environment", parameters=(), maneuver="turn-2", time_s=431.5,
    duration_s=6.0,
)  # fmt: skip


def diagnosis(*effects: EffectFound) -> Diagnosis:
    return NONE.model_copy(update={"effects": effects, "carried": CARRIED})


def test_nothing_found_is_nothing_carried() -> None:
    assert carried_of(diagnosis()) is None
    wave = EVENT.model_copy(update={"id": "wave", "maneuver": None, "time_s": None})
    assert carried_of(diagnosis(wave)) is None


def test_what_has_a_prior_is_estimated_and_the_rest_given() -> None:
    found = carried_of(diagnosis(OFFSET))
    assert found is not None
    assert found.effects == ("rudder_offset",)
    assert found.ids("horizontal") == ("rudder_offset", "rudder_lag")
    assert found.start["rudder_lag.lag_s"] == 0.03
    assert "rudder_lag.lag_s" not in found.prior_std


def test_the_delay_of_a_sensor_is_held_as_the_diagnosis_found_it() -> None:
    late = EffectFound(id="gyro_delay", family="sensing", parameters=())
    found = diagnosis(late).model_copy(update={"carried": {
        "start": {"gyro_delay.delay_s": 0.3, "rudder_lag.lag_s": 0.03},
        "prior": {"gyro_delay.delay_s": 0.1}, "prior_std": {"gyro_delay.delay_s": 0.05},
    }})  # fmt: skip
    carried = carried_of(found)
    assert carried is not None and carried.effects == ("gyro_delay",)
    chain = sample("harbour_trial")
    setup, _ = prepare(
        chain.trials, chain.maneuvers, chain.ase, chain.vehicle, chain.noise, plane="horizontal",
        plan=plan_named("spiral"), filter="ekf", engine="compiled", carried=carried,
    )  # fmt: skip
    i = setup.structure.index("gyro_delay.delay_s")
    assert (setup.prior[i], setup.prior_std[i]) == (0.3, 0.0)


def test_an_effect_is_told_beyond_what_is_usual_and_not_beyond_its_prior() -> None:
    names = ("gyro_delay", "linear_drag")
    structure = structure_of("horizontal", names)
    p = np.zeros(len(structure.parameters))
    p[structure.index("gyro_delay.delay_s")], p[structure.index("linear_drag.X_u")] = 0.3, -1.0
    delay, drag = effect_rows(structure, p, {}, {"linear_drag.X_u": -0.4}, names)
    assert delay["parameters"][0]["value"] == pytest.approx(0.3)
    assert drag["parameters"][0]["value"] == pytest.approx(-0.6)
    assert drag["internal"] == {"linear_drag.X_u": -1.0}


def test_an_event_is_masked_and_not_modelled() -> None:
    found = carried_of(diagnosis(EVENT))
    assert found is not None
    assert found.windows == (("turn-2", 431.5, 437.5),)
    assert found.effects == ()  # what every model is allowed is carried all the same
    both = carried_of(diagnosis(EVENT, OFFSET))
    assert both is not None
    assert (both.effects, both.windows) == (("rudder_offset",), found.windows)


def test_masked_windows_have_no_readings() -> None:
    chain = sample("harbour_trial")
    chosen = next(m for m in chain.maneuvers.maneuvers if m.role == "identify")
    start, end = chosen.t_start_s + 2.0, chosen.t_start_s + 5.0
    window = EVENT.model_copy(
        update={"maneuver": chosen.id, "time_s": start, "duration_s": end - start}
    )
    setups = [
        prepare(
            chain.trials, chain.maneuvers, chain.ase, chain.vehicle, chain.noise,
            plane="horizontal", plan=plan_named("spiral"), filter="ekf", engine="compiled",
            carried=carried,
        )[0]
        for carried in (None, carried_of(diagnosis(window)))
    ]  # fmt: skip
    for name, (_, record) in setups[1].records.items():
        whole = setups[0].records[name][1]
        inside = (record.time_s >= start) & (record.time_s <= end) & (name == chosen.id)
        assert np.isnan(record.measured[inside]).all()
        np.testing.assert_array_equal(record.measured[~inside], whole.measured[~inside])
        np.testing.assert_array_equal(record.given, whole.given)
        assert inside.any() == (name == chosen.id)


def refined(value: float, std: float) -> IdentifiedModel:
    offset = {"symbol": "offset_deg", "value": value, "std": std, "unit": "deg"}
    row = {"id": "rudder_offset", "family": "actuation", "silent": False, "internal": {},
           "parameters": [offset]}  # fmt: skip
    return model().model_copy(update={"effects": (row,)})


@pytest.mark.parametrize(
    ("value", "std", "half"),
    [
        (1.0, 0.01, 0.2),  # the diagnosis' own interval is the wider one
        (1.1, 0.5, 1.96 * 0.5),  # the filter's is
        (2.0, 0.01, 1.96 * 1.0),  # they differ: as wide as that
    ],
)
def test_the_interval_of_an_effect_is_the_widest(value, std, half) -> None:
    found = compare(diagnosis(OFFSET), MANEUVERS, model(), refined(value, std), predicted(0),
                    predicted(1)).effects[0].parameters[0]  # fmt: skip
    assert found.value == value
    assert found.high == pytest.approx(value + half)
    assert found.low == pytest.approx(value - half)
    assert found.std == pytest.approx(half / 1.96)


def test_coefficients_stand_side_by_side() -> None:
    other = model().model_copy(update={
        "coefficients": tuple(
            c.model_copy(update={"value": 2.0 * c.value}) for c in model().coefficients
        )
    })  # fmt: skip
    found = compare(NONE, MANEUVERS, model(), other, predicted(0), predicted(1)).coefficients
    assert [c.symbol for c in found] == [c.symbol for c in model().coefficients]
    assert all(c.after == 2.0 * c.before for c in found)


# --- errors that rise ----------------------------------------------------------------------


def errors(u: float, v: float = 1.0, r: float = 1.0, away: str = "") -> Metrics:
    """Metrics with these errors in the maneuvers that identify; one may have run away."""
    channels = {
        name: ChannelMetrics(rmse=rmse, nrmse=rmse, r2=0.0, theil=0.0, unit="-", samples=9)
        for name, rmse in (("u", u), ("v", v), ("r", r), ("heading", 9.0))
    }
    stayed = tuple(
        ManeuverMetrics.model_validate({
            "id": name, "trial": "t", "kind": name.split("-")[0], "role": role,
            "duration_s": DT * N, "channels": channels,
        })
        for name, role in ROLES.items() if name != away
    )  # fmt: skip
    ran = (Finding(code="ran-away", message="", where=away),) if away else ()
    return Metrics(maneuvers=stayed, summary={"identify": channels}, findings=ran)


def carried_effects(*effects: str) -> Carried:
    names = ("current.north_mps", "rudder_lag.lag_s", "rudder_rate_limit.rate_degps")
    return Carried(
        effects=effects, start=dict.fromkeys(names, 0.1) | {"Y_uv": -20.0},
        prior=dict.fromkeys(names, 0.0), prior_std=dict.fromkeys(names, 1.0), usual={},
    )  # fmt: skip


def test_the_first_model_with_which_nothing_rises_is_taken() -> None:
    tried = []

    def attempts_with(*after: Metrics):
        for k, metrics in enumerate(after):
            tried.append(k)
            yield k, metrics

    before = errors(1.0)
    assert first_without_rise(before, attempts_with(errors(0.5, r=1.01), errors(0.1))) == 0
    assert tried == [0]  # the second one was not even made
    assert first_without_rise(before, attempts_with(errors(0.5, r=1.4), errors(0.9))) == 1
    assert first_without_rise(before, attempts_with(errors(1.0, r=1.1), errors(1.2))) == 0
    assert (
        first_without_rise(before, attempts_with(errors(0.1, away="straight-1"), errors(1.3))) == 1
    )
    with pytest.raises(ValueError, match="nothing"):
        first_without_rise(before, attempts_with())


def test_the_worst_rise_is_that_of_a_channel_with_its_name() -> None:
    assert worst_rise(errors(1.0), errors(0.5, v=0.9, r=1.4)) == (pytest.approx(0.4), "r")
    assert worst_rise(errors(1.0), errors(0.5, 0.5, 0.5))[0] == pytest.approx(-0.5)
    assert worst_rise(errors(1.0), errors(0.5, away="straight-1"))[0] == float("inf")


def test_a_held_out_maneuver_that_runs_away_chooses_nothing() -> None:
    with_it, without = errors(0.5, away="turn-1"), errors(0.5)
    assert worst_rise(errors(1.0), with_it) == worst_rise(errors(1.0), without)


def test_the_second_attempt_has_the_allowances_of_the_model_before() -> None:
    before = model()
    assert [e["id"] for e in before.effects] == ["rudder_rate_limit"]
    whole, lean = attempts(carried_effects("current"), before)
    assert "rudder_lag.lag_s" in whole.start and "rudder_lag.lag_s" not in lean.start
    for values in (lean.prior, lean.prior_std):
        assert set(values) == {"current.north_mps", "rudder_rate_limit.rate_degps"}
    assert lean.start["Y_uv"] == -20.0
    assert attempts(lean, before) == (lean,)
    assert attempts(None, before) == (None,)


def test_a_rise_that_remains_is_a_finding() -> None:
    (finding,) = findings_of((0.41, "r"), carried_effects("current"))
    assert finding.code == "error-rises" and "41 %" in finding.message and finding.where == "r"
    assert findings_of((0.02, "r"), carried_effects("current")) == ()
    assert findings_of((0.41, "r"), carried_effects()) == ()  # an event was masked
