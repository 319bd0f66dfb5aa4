"""Two planes made into one model: what they share, what follows, where everything comes from."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.errors import InputError, UsageError
from auvident.physics.six_dof_terms import COEFFICIENTS, ROLL_UNITS
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.combined import CombinedModel
from auvident.stages.combine import combine
from auvident.stages.combine.shared import Posterior, _conditioned, _pooled, join, posterior_of
from tests.engines.chain import identified, sample

SHARED = ("X_udot", "X_uu", "T_nn", "T_nu")
OF_FINS = {"horizontal": "X_uudrdr", "vertical": "X_uudede"}


def models() -> list[IdentifiedModel]:
    return [identified("harbour_trial").model, identified("dive_trial", "vertical").model]


def combined(which: slice = slice(None), **changes: object) -> CombinedModel:
    before = sample("harbour_trial")
    return combine(models()[which], before.vehicle, before.ase, **changes)


class TwoExperiments:
    """Linear measurements of shared and own parameters: their posterior is a closed form."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.std = rng.uniform(0.5, 2.0, 6)  # s1 s2 | a1 a2 | b1 b2
        self.prior = rng.normal(size=6)
        self.slopes = [rng.normal(size=(8, 6)), rng.normal(size=(8, 6))]
        self.slopes[0][:, 4:] = self.slopes[1][:, 2:4] = 0.0
        truth = self.prior + self.std * rng.normal(size=6)
        self.read = [a @ truth + 0.5 * rng.normal(size=8) for a in self.slopes]

    def posterior(self, which: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        information = np.diag(self.std**-2.0)
        vector = information @ self.prior
        for i in which:
            information = information + self.slopes[i].T @ self.slopes[i] / 0.25
            vector = vector + self.slopes[i].T @ self.read[i] / 0.25
        covariance = np.linalg.inv(information)
        return covariance @ vector, covariance

    def of_plane(self, i: int) -> Posterior:
        mean, covariance = self.posterior((i,))
        at, plane = ([0, 1, 2, 3], "horizontal") if i == 0 else ([0, 1, 4, 5], "vertical")
        names = tuple(("s1", "s2", "a1", "a2", "b1", "b2")[k] for k in at)
        taken = np.ix_(at, at)
        return Posterior(plane, names, mean[at], self.prior[at], self.std[at], covariance[taken])


@pytest.mark.parametrize("seed", range(10))
def test_two_posteriors_are_joined_as_if_all_data_had_been_fitted_at_once(seed: int) -> None:
    both = TwoExperiments(seed)
    planes = [both.of_plane(0), both.of_plane(1)]
    shared = ("s1", "s2")
    joined = _conditioned(planes, shared, *_pooled(*planes, shared), {}, ())
    mean, covariance = both.posterior((0, 1))
    assert joined.names == ("s1", "s2", "a1", "a2", "b1", "b2")
    np.testing.assert_allclose(joined.mean, mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(joined.covariance, covariance, rtol=1e-9, atol=1e-9)


def test_a_prior_that_no_data_narrowed_is_counted_once() -> None:
    one = Posterior("horizontal", ("s",), *(np.array([x]) for x in (2.0, 2.0, 0.5)), np.eye(1) / 4)
    other = replace(one, plane="vertical")
    mean, covariance = _pooled(one, other, ("s",))
    assert mean == pytest.approx([2.0])
    assert covariance == pytest.approx(np.array([[0.25]]))


def test_each_plane_is_taken_off_its_own_prior() -> None:
    """An estimate at another speed is no reading; a reading from another estimate is the same."""
    one = Posterior("horizontal", ("s",), *(np.array([x]) for x in (2.0, 2.0, 0.5)), np.eye(1) / 4)
    other = Posterior(
        "vertical", ("s",), *(np.array([x]) for x in (2.2, 2.2, 0.4)), np.eye(1) * 0.16
    )
    mean, covariance = _pooled(one, other, ("s",))
    assert mean == pytest.approx([2.0])
    assert covariance == pytest.approx(np.array([[0.25]]))
    reading, variance = 3.0, 0.09
    both = 1.0 / 0.16 + 1.0 / variance
    seen = replace(
        other,
        mean=np.array([(2.2 / 0.16 + reading / variance) / both]),
        covariance=np.eye(1) / both,
    )
    mean, covariance = _pooled(one, seen, ("s",))
    assert covariance == pytest.approx(np.array([[1.0 / (4.0 + 1.0 / variance)]]))
    assert mean == pytest.approx((4.0 * 2.0 + reading / variance) * covariance[0])


def test_every_coefficient_and_constant_is_there_with_its_origin() -> None:
    model = combined()
    origin = {e.symbol: e.origin for e in model.entries}
    assert set(origin) >= {
        *COEFFICIENTS,
        *ROLL_UNITS,
        "m",
        "I_yy",
        "I_zz",
        "W-B",
        "x_GW",
        "z_GW",
    } - {
        "K_nn",
        "K_nu",
    }
    assert {origin[s] for s in SHARED} == {"identified, both"}
    assert origin["Y_uv"] == origin["N_vdot"] == "identified, horizontal"
    assert origin["Z_uw"] == origin["M_wdot"] == "identified, vertical"
    assert [origin[s] for s in OF_FINS.values()] == [f"identified, {p}" for p in OF_FINS]
    assert "X_uudd" not in origin
    assert origin["K_up"] == "geometry"
    assert origin["m"] == "vehicle file"
    assert {f.code for f in model.findings} == {"no-torque", "roll-from-geometry"}
    assert model == CombinedModel.model_validate_json(model.model_dump_json(by_alias=True))


def test_shared_coefficients_lie_where_both_planes_allow_and_are_better_known() -> None:
    rows = {e.symbol: e for e in combined().entries}
    first, second = (posterior_of(m) for m in models())
    for symbol in SHARED:
        for one in (first, second):
            k = one.names.index(symbol)
            spread = np.sqrt(one.covariance[k, k])
            assert rows[symbol].std <= 1.001 * spread
            assert abs(rows[symbol].value - one.mean[k]) < 3.0 * spread


def test_each_fin_has_the_drag_of_the_plane_that_it_steers_in() -> None:
    """It follows the shared drag and thrust by its covariance, and nothing of the other plane."""
    whole = {e.symbol: e for e in combined().entries}
    before = sample("harbour_trial").ase.by_symbol()["X_uudd"]
    for model in models():
        row = next(c for c in model.coefficients if c.symbol == "X_uudd")
        symbol = OF_FINS[model.plane]
        assert abs(whole[symbol].value - row.value) < row.std
        assert (whole[symbol].unit, whole[symbol].std) == (row.unit, row.std)
    alone = {e.symbol: e for e in combined(slice(0, 1)).entries}
    assert (alone["X_uudede"].value, alone["X_uudede"].std) == (before.value, before.std)
    assert alone["X_uudede"].origin == "geometry"
    ratio = {s: e.value / e.prime for s, e in whole.items() if e.prime and s in OF_FINS.values()}
    assert len(ratio) == 2 and ratio["X_uudrdr"] == pytest.approx(ratio["X_uudede"])


def test_followers_stay_equal_in_every_draw() -> None:
    model = combined()
    for moved in model.draws(5, np.random.default_rng(1)):
        values = model.values(moved)
        assert values["N_vdot"] == pytest.approx(values["Y_rdot"])
        assert values["M_wdot"] == pytest.approx(values["Z_qdot"])


def test_draws_have_the_covariance_and_keep_the_signs_of_geometry() -> None:
    model = combined()
    drawn = model.draws(4000, np.random.default_rng(2))
    block = model.covariance[0]
    assert block.origin == "identified"
    sampled = np.cov(np.array([[moved[s] for s in block.symbols] for moved in drawn]).T)
    spread = np.sqrt(np.diag(block.matrix))
    # standard error of a correlation from 4000 draws is 0.016
    difference = (sampled - np.array(block.matrix)) / np.outer(spread, spread)
    assert np.abs(difference).max() < 0.09
    values = {e.symbol: e.value for e in model.entries}
    assert all(values["K_up"] + moved["K_up"] < 0.0 for moved in drawn)


def test_planes_that_contradict_each_other_are_named_and_the_better_one_counts() -> None:
    first, second = models()
    row = next(c for c in second.coefficients if c.symbol == "X_uu")
    away = row.model_copy(update={"value": row.value - 20.0})
    rows = tuple(away if c.symbol == "X_uu" else c for c in second.coefficients)
    joined = join([first, second.model_copy(update={"coefficients": rows})])
    (finding,) = joined.findings
    assert finding.code == "planes-disagree"
    (plane,) = joined.of["X_uu"]
    values = {"horizontal": first.values()["X_uu"], "vertical": away.value}
    assert joined.mean[joined.names.index("X_uu")] == pytest.approx(values[plane])


def test_a_plane_that_started_from_the_other_one_knows_both() -> None:
    first, second = models()
    rows = tuple(
        c.model_copy(update={"shared_with": "horizontal"}) if c.symbol in SHARED else c
        for c in second.coefficients
    )
    taken = second.model_copy(update={"coefficients": rows})
    joined = join([first, taken])
    for symbol in SHARED:
        assert joined.mean[joined.names.index(symbol)] == pytest.approx(taken.values()[symbol])
    # nothing moves in the plane that holds them; the other one follows
    assert joined.mean[joined.names.index("X_wq")] == pytest.approx(taken.values()["X_wq"])
    assert joined.mean[joined.names.index("X_vr")] != pytest.approx(first.values()["X_vr"])


def test_a_plane_without_a_model_is_that_of_the_geometry() -> None:
    model = combined(slice(0, 1))
    before = sample("harbour_trial").ase.by_symbol()
    rows = {e.symbol: e for e in model.entries}
    assert rows["Z_uw"].value == before["Z_uw"].value
    assert rows["Z_uw"].std == before["Z_uw"].std
    assert rows["X_uu"].origin == "identified, horizontal"
    assert "plane-from-geometry" in {f.code for f in model.findings}
    (block,) = (b for b in model.covariance if "Z_uw" in b.symbols)
    k = block.symbols.index("Z_uw")
    assert np.sqrt(block.matrix[k][k]) == pytest.approx(before["Z_uw"].std)
    assert np.linalg.eigvalsh(np.array(block.matrix)).min() > -1e-9


def test_without_models_given_coefficients_are_those_of_the_file() -> None:
    before = sample("harbour_trial")
    rows = [
        c.model_copy(update={"origin": "given"}) if c.symbol == "Y_uv" else c
        for c in before.ase.coefficients
    ]
    model = combine([], before.vehicle, before.ase.model_copy(update={"coefficients": rows}))
    origin = {e.symbol: e.origin for e in model.entries}
    assert origin["Y_uv"] == "vehicle file"
    assert origin["N_uv"] == "geometry"


def test_terms_of_roll_can_be_given() -> None:
    model = combined(roll={"I_xx": (0.2, 0.01), "K_pdot": (-0.1, 0.02), "K_nn": (1e-3, 1e-4)})
    rows = {e.symbol: (e.value, e.std) for e in model.entries}
    assert rows["I_xx"] == (0.2, 0.01)
    assert "K_up" not in rows
    assert "no-torque" not in {f.code for f in model.findings}


def test_effects_stay_with_their_plane() -> None:
    model = combined()
    rates = {n: v for n, v in model.parameters.items() if n.endswith("rate_degps")}
    assert len(rates) == 2
    for one in models():
        internal = {n: v for e in one.effects for n, v in e["internal"].items()}
        for name, value in internal.items():
            assert model.parameters[f"{one.plane} {name}"] == value


def test_two_models_of_one_plane_are_refused() -> None:
    before, (first, _) = sample("harbour_trial"), models()
    with pytest.raises(UsageError, match="two models of the horizontal plane") as caught:
        combine([first, first], before.vehicle, before.ase)
    assert "vertical" in caught.value.remedy


@pytest.mark.parametrize("change", [{"vehicle": "other"}, {"length_m": 2.0}])
def test_a_model_of_another_vehicle_is_refused(change: dict) -> None:
    before, (first, second) = sample("harbour_trial"), models()
    with pytest.raises(InputError, match="another vehicle"):
        combine([first, second.model_copy(update=change)], before.vehicle, before.ase)
