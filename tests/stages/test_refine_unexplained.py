"""A force without a name: it predicts what no effect explains, or it is not added."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from auvident.engines.carried import Carried
from auvident.errors import NumericsError
from auvident.pipeline.steps import DEFAULT_PLAN
from auvident.schema.diagnosis import UnexplainedForce
from auvident.schema.effects import UNEXPLAINED
from auvident.stages.identify import Identification
from auvident.stages.refine import Base, with_unexplained
from auvident.stages.refine.unexplained import SPREADS
from auvident.stages.simulate import simulate
from auvident.stages.validate import Validation
from tests.bench.effects_cases import Case
from tests.bench.effects_trial import sail
from tests.engines.chain import SAMPLES, Chain, chain_of, plan_named, validated
from tests.session import once
from tests.stages.test_refine import model
from tests.stages.test_refine_left_out import alike, summary, with_left_out

# a side force and a yaw moment with twice the heading, of which no effect of the program knows
OUTSIDE = Case(1037, "remus100", "outside", ("heading_force",))
NAMES = UNEXPLAINED.names("horizontal")


def sailed(folder: Path) -> Chain:
    sail(OUTSIDE, folder / "trial")
    return chain_of([folder / "trial"], SAMPLES / "remus100.toml")


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Chain:
    return sailed(tmp_path_factory.mktemp("outside"))


def refined(
    chain: Chain,
) -> tuple[Validation, tuple[Carried, Identification, Validation], UnexplainedForce]:
    """The trial identified, and again with the force."""
    plan = plan_named(DEFAULT_PLAN)

    def again(carried: Carried | None) -> tuple[Identification, Validation]:
        found = chain.identify(plan=plan, carried=carried)
        return found, chain.validate(found.model)

    first, before = again(None)
    base = Base.of(None, plan.nuisance, first.model, before)
    made, force = with_unexplained(base, again, chain.maneuvers, heading=True)
    assert made is not None and made.found is not None
    return before, (made.carried, *made.found), force


@pytest.fixture(scope="module")
def found(chain: Chain):
    return refined(chain)


def test_it_predicts_a_force_that_no_effect_explains(found) -> None:
    """Held-out errors fall, and the left-out ones that chose it had told so."""
    before, (_, _, after), force = found
    assert force.added and force.spread in SPREADS
    assert [one.taken for one in force.tried].count(True) == 1
    old, new = (v.metrics.summary["validate"] for v in (before, after))
    # measured: v 0.246 to 0.071, r 0.077 to 0.027 of the standard deviation
    assert new["v"].nrmse < 0.5 * old["v"].nrmse and new["r"].nrmse < 0.6 * old["r"].nrmse
    assert force.left_out is not None and force.held_out is not None
    assert force.left_out.after["v"].rmse < 0.6 * force.left_out.before["v"].rmse
    assert force.held_out.after["v"].rmse == pytest.approx(new["v"].rmse)
    assert force.statement.startswith("An unnamed force improves the prediction: left-out u ")
    assert f"v {old['v'].nrmse:.2g} to {new['v'].nrmse:.2g}" in force.statement


def test_its_spread_is_the_one_with_the_smallest_left_out_errors(found) -> None:
    _, _, force = found
    able = [t for t in force.tried if t.balance is not None and not t.ran_away]
    best = min(able, key=lambda t: t.balance)
    assert best.taken and best.spread == force.spread
    assert best.balance + best.balance_se < 0.0


def test_the_model_has_it_without_a_claim_and_simulate_flies_it(found, chain) -> None:
    _, (_, identified, after), _ = found
    (row,) = [e for e in identified.model.effects if e["id"] == UNEXPLAINED.id]
    assert row["nuisance"] and set(row["internal"]) == set(NAMES)
    held = next(m for m in chain.maneuvers.maneuvers if m.role == "validate")
    window = (held.t_start_s, held.t_end_s)
    trial = chain.trials[0]
    told = {"window_s": window, "samples": 0, "rng": np.random.default_rng(0)}
    flown = simulate(identified.model, trial, **told)
    predicted = after.simulation[after.simulation["maneuver"] == held.id]
    reading = predicted["v_mps_simulated"].to_numpy()

    def at_dvl(states):  # v of the DVL, where it sits
        return (states["v_mps"] + identified.model.sensing.dvl_x_m * states["r_radps"]).to_numpy()

    np.testing.assert_allclose(at_dvl(flown), reading, atol=1e-9)  # rounding
    rest = identified.model.model_copy(
        update={"effects": tuple(e for e in identified.model.effects if e is not row)}
    )
    gone = at_dvl(simulate(rest, trial, **told)) - reading
    assert np.sqrt(np.mean(gone**2)) > 0.01  # [m/s] measured 0.020 in a turn


# --- when it is not added ------------------------------------------------------------------


def base() -> Base:
    return Base(Carried(), with_left_out(alike()), validated("harbour_trial"))


def tried(*left_out):
    outcomes = iter(left_out)

    def again(carried: Carried):
        one = next(outcomes)
        if one is None:
            raise NumericsError("the prediction diverges")
        return SimpleNamespace(model=with_left_out(one)), base().prediction

    return with_unexplained(base(), again, maneuvers(), heading=True)


@once
def maneuvers():
    from tests.engines.chain import sample

    return sample("harbour_trial").maneuvers


def test_it_is_not_added_where_left_out_errors_do_not_fall() -> None:
    made, force = tried(alike(), alike(u=1.1), alike(), alike(r=2.0))
    assert made is None and not force.added and force.left_out is None
    assert [t.spread for t in force.tried] == list(SPREADS)
    assert force.statement.startswith("No unnamed force was added: it does not lower")


def test_too_few_maneuvers_tell_nothing_and_a_failure_is_an_attempt() -> None:
    made, force = tried(alike(2), alike(2), None, None)
    assert made is None and "too few maneuvers" in force.statement
    assert [t.failed for t in force.tried] == ["", "", *["the prediction diverges"] * 2]
    made, force = tried(None, alike(v=0.5), alike(v=0.4), None)
    assert made is not None and force.spread == SPREADS[2]


def test_it_is_not_added_where_it_loses_a_maneuver_whatever_the_others_gain() -> None:
    half = dict.fromkeys(("u", "v", "r"), 0.5)
    one_lost = summary(half, half, half, {})
    made, force = tried(*[one_lost] * len(SPREADS))
    assert made is None and all(t.ran_away for t in force.tried)
    made, _ = tried(*[summary(*[half] * 4)] * len(SPREADS))
    assert made is not None


def test_its_priors_scale_with_the_vehicle_and_need_a_heading_where_they_follow_it() -> None:
    narrow, wide = (base().with_force(s, heading=True).prior_std for s in (0.1, 1.0))
    assert set(narrow) == set(NAMES)
    assert all(wide[n] == pytest.approx(10.0 * narrow[n]) for n in NAMES)
    speed = float(validated("harbour_trial").simulation["u_mps_measured"].median())
    told = model()
    # 0.005 density/2 L^2 U^2 at a sway of 0.2 U
    size = 0.5 * told.density_kgpm3 * told.length_m**2 * speed
    assert wide["unexplained_force.Y_v"] == pytest.approx(0.005 / 0.2 * size)
    blind = base().with_force(1.0, heading=False).prior_std
    assert not any("cos" in n or "sin" in n for n in blind) and len(blind) == 25
