"""What validation says of its own figures, by models that are wrong in a known way."""

import pytest

from auvident.schema.artifacts import Finding, IdentifiedModel, Metrics
from auvident.stages.validate import validate
from auvident.stages.validate.findings import WORSE, findings_of
from tests.stages.test_validate import base, changed, maneuvers, sailed

ESTIMATE, GIVEN = "the estimate from geometry (ASE)", "the given coefficients (prior)"


def with_rows(model: IdentifiedModel, **columns) -> IdentifiedModel:
    """Columns of the coefficients, each a mapping from symbol to value."""
    rows = [
        c.model_copy(update={k: v[c.symbol] for k, v in columns.items() if c.symbol in v})
        for c in model.coefficients
    ]
    return model.model_copy(update={"coefficients": tuple(rows)})


def metrics_of(model: IdentifiedModel, **options) -> Metrics:
    """The world is the one of `base`, whatever the model."""
    return validate([sailed(base())], maneuvers(), model, **options).metrics


def true_prior() -> IdentifiedModel:
    """A model that starts from the truth."""
    return with_rows(base(), prior=base().values())


def said(metrics: Metrics, code: str) -> list[Finding]:
    return [f for f in metrics.findings if f.code == code]


def test_a_channel_that_is_missed_by_its_own_variation_is_not_predicted() -> None:
    metrics = metrics_of(
        changed(base(), Y_uud=-base().values()["Y_uud"], N_uud=-base().values()["N_uud"])
    )
    found = {f.where: f for f in said(metrics, "not-predicted")}
    pooled = metrics.summary["validate"]
    assert set(found) == {name for name, m in pooled.items() if m.nrmse >= 1.0} >= {"r"}
    assert found["r"].value == pooled["r"].nrmse
    assert found["r"].threshold == 1.0 and found["r"].remedy
    expected = "not predicted: the error is no smaller than the variation of the channel"
    assert found["r"].message == expected


def test_data_that_made_a_channel_worse_are_called_so() -> None:
    metrics = metrics_of(changed(true_prior(), X_uu=0.8 * base().values()["X_uu"]))
    found = {f.where: f for f in said(metrics, "no-better")}
    after, before = metrics.summary["validate"]["u"], metrics.ase.summary["validate"]["u"]
    assert found["u"].value == pytest.approx((before.rmse / after.rmse) ** 2)
    assert found["u"].threshold == 1.0 and found["u"].remedy
    words = "predicted no better in the held-out maneuvers than with"
    assert found["u"].message == f"{words} {ESTIMATE}"
    given = metrics_of(changed(true_prior(), X_uu=0.8 * base().values()["X_uu"]), estimated=False)
    assert f"{words} {GIVEN}" in {f.message for f in given.findings}


def test_where_the_prior_did_not_predict_the_same_maneuvers_nothing_pooled_is_compared() -> None:
    model = changed(true_prior(), X_uu=0.8 * base().values()["X_uu"])
    metrics = metrics_of(model)
    assert metrics.ase is not None
    others = metrics.ase.model_copy(update={"maneuvers": ()})
    found = findings_of(metrics.model_copy(update={"ase": others}), model)
    assert "no-better" not in {f.code for f in found}
    assert "no-better" in {f.code for f in findings_of(metrics, model)}


def test_single_maneuvers_that_are_predicted_worse_are_named_with_their_channels() -> None:
    metrics = metrics_of(changed(true_prior(), X_uu=0.8 * base().values()["X_uu"]))
    (found,) = said(metrics, "worse-than-prior")
    assert found.where.startswith("made-turn-1 (u")  # the zigzag identifies
    assert found.value > found.threshold == WORSE and found.remedy
    after, before = (
        next(m for m in x.maneuvers if m.role == "validate").channels["u"]
        for x in (metrics, metrics.ase)
    )
    pooled = metrics.summary["validate"]["u"]
    excess = (after.rmse**2 - before.rmse**2) ** 0.5
    assert found.value >= excess * pooled.nrmse / pooled.rmse > WORSE
    assert found.message == ("predicted worse than with " + ESTIMATE)
    assert "their" not in found.remedy  # of one maneuver, often of one channel


def test_what_is_worse_by_little_of_what_the_channel_varies_by_is_no_finding() -> None:
    metrics = metrics_of(changed(true_prior(), X_uu=0.998 * base().values()["X_uu"]))
    (after,) = (m.channels["u"] for m in metrics.maneuvers if m.role == "validate")
    assert metrics.ase is not None
    (before,) = (m.channels["u"] for m in metrics.ase.maneuvers if m.role == "validate")
    assert after.rmse > before.rmse and not said(metrics, "worse-than-prior")


def test_a_model_better_than_its_prior_has_no_such_finding() -> None:
    codes = {f.code for f in metrics_of(base()).findings}
    assert not codes & {"not-predicted", "no-better", "worse-than-prior", "prior-ran-away"}


def test_coefficients_that_rest_on_the_prior_are_named() -> None:
    shares = dict.fromkeys(base().values(), 0.9) | {"Y_rdot": 0.2, "N_uv": 0.49, "N_ur": 0.5}
    (found,) = said(metrics_of(with_rows(base(), data_share=shares)), "rests-on-prior")
    assert found.where == "Y_rdot, N_uv"
    assert (found.value, found.threshold) == (0.2, 0.5) and found.remedy
    assert found.message.startswith(
        f"2 of {len(shares)} coefficients are determined more by the prior than"
    )
    sure = with_rows(base(), data_share=dict.fromkeys(shares, 0.9))
    assert not said(metrics_of(sure), "rests-on-prior")


def test_a_prior_that_ran_away_is_not_compared() -> None:
    metrics = metrics_of(with_rows(base(), prior={"X_uu": 200.0}))
    found = said(metrics, "prior-ran-away")
    assert {f.where for f in found} == {"made-zigzag-1", "made-turn-1"}
    assert all(ESTIMATE in f.message and f.remedy for f in found)
    codes = {f.code for f in metrics.findings}
    assert not codes & {"no-better", "worse-than-prior", "prediction-ran-away"}
