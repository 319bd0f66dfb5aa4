"""The section "What the model lacks" of the HTML report."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from auvident.pipeline.given import Given
from auvident.pipeline.reporting import report_data
from auvident.report.html import render
from auvident.report.html_data import ReportData, quantity
from auvident.report.html_loop import lacks, with_refined
from auvident.report.html_summary import summary, verdict_lines
from auvident.report.html_words import cards, factor, warnings
from auvident.report.numbers import PAGE
from auvident.schema.artifacts import CrossValidation, Finding
from auvident.schema.diagnosis import Comparison, CrossValidated, Diagnosis, Difference
from auvident.stages.refine.compare import worse_channels
from auvident.storage.run_directory import RunDirectory
from tests import loop_world
from tests.report import drawings
from tests.report.test_html import Page

HEADING = "What the model lacks"
NEXT = "Trial at a glance"


@pytest.fixture(scope="module")
def data(completed: Path) -> ReportData:
    """A finished run in which a current was found."""
    run = RunDirectory(completed / "runs/demo")
    found = report_data(Given(run, run.manifest(), also=frozenset({"diagnose", "refine"})))
    assert found.maneuvers and found.model
    chosen = loop_world.in_plane(found.maneuvers, found.model)
    diagnosis = loop_world.diagnosis([m.id for m in chosen if m.role == "identify"])
    comparison = loop_world.comparison(diagnosis, found.model, chosen)
    residuals = loop_world.residual_table(found.trials, chosen)
    return replace(found, diagnosis=diagnosis, comparison=comparison, residuals=residuals)


@pytest.fixture(scope="module")
def small(data: ReportData) -> ReportData:
    """The same with the section alone: what else the report draws takes its time."""
    return replace(data, trials=(), history=None, simulation=None)


@pytest.fixture(scope="module")
def text(data: ReportData) -> str:
    return render(data)


@pytest.fixture(scope="module")
def section(text: str) -> str:
    whole = Page(text).text
    assert whole.index(HEADING) < whole.index(NEXT)
    return whole[whole.index(HEADING) : whole.index(NEXT)]


def with_diagnosis(data: ReportData, **update: Any) -> ReportData:
    assert data.diagnosis
    return replace(data, diagnosis=data.diagnosis.model_copy(update=update))


def test_verdict_and_held_out_errors_stand_at_the_top_of_the_page(text: str) -> None:
    whole = Page(text).text
    top = whole[: whole.index("How far to trust it")]
    assert "A current of 0.15 m/s" in top
    assert "held-out RMSE u 0.046 → 0.0061 m/s" in top and "r 0.36 → 0.34 deg/s" in top


def test_the_cards_show_the_final_model_with_the_identified_one_beside_it(
    data: ReportData, text: str
) -> None:
    assert data.metrics
    identified, u = data.metrics.summary["validate"]["u"], cards(data)[0]
    assert (u["name"], u["rmse"]) == ("u", "0.00610\u00a0m/s")
    assert u["identified"].startswith(quantity(identified.rmse, "m/s"))
    ratio = loop_world.AFTER["u"] / identified.rmse
    assert data.final_errors()["u"].nrmse == pytest.approx(identified.nrmse * ratio)
    assert abs(ratio - 1.0) < 0.05 and u["by_effects"] == "about the same"
    whole = Page(text).text
    assert "The final model, with a current of 0.15 m/s" in whole
    assert "alone, with the final model, refine/model.json" in whole


@pytest.mark.parametrize(
    ("ratio", "words"),
    [(2.04, "2.0 times smaller"), (0.5, "2.0 times larger"), (0.96, "about the same"), (None, "–")],
)
def test_a_ratio_of_errors_in_words(ratio: float | None, words: str) -> None:
    assert factor(ratio) == words


def test_what_left_out_in_turn_is_no_better_stands_beside_what_is(data: ReportData) -> None:
    """Of the tanker only the held-out errors were told, which fall; those left out in turn rise."""
    assert data.comparison

    def told(**after: float) -> str:
        before = {"u": 0.02, "v": 0.03, "heading": 0.1}
        crossed = CrossValidated(
            **{
                name: {
                    k: CrossValidation(rmse=x, nrmse=x, se=0.01, unit="m/s")
                    for k, x in (before | own).items()
                }
                for name, own in (("before", {}), ("after", after))
            }
        )
        compared = data.comparison.model_copy(update={"cross_validation": crossed})
        found = replace(data, comparison=compared)
        (lines,) = (lines for word, lines in summary(found) if word == "It lacked")
        return " ".join(lines)

    assert told(u=0.01, v=0.04, heading=0.2).endswith(
        "Identifying maneuvers, each left out in turn, are no better: v 0.030 → 0.040\u00a0m/s."
    )
    assert "left out in turn" not in told(u=0.01, v=0.02)


def test_the_figure_of_candidates_says_what_it_shows(data: ReportData) -> None:
    assert data.diagnosis
    plain = with_diagnosis(
        replace(data, comparison=None),
        candidates=[
            c.model_copy(
                update={
                    "rejected": "gains little",
                    "held_back_gain": None,
                    "parameters": [
                        p.model_copy(update={"low": None, "high": None}) for p in c.parameters
                    ],
                }
            )
            for c in data.diagnosis.candidates
        ],
    )
    found, none = lacks(replace(data, comparison=None)), lacks(plain)
    assert found and none
    assert "blue: accepted" in found.bars
    assert "blue" not in none.bars and "Diamonds" not in none.bars
    heads = [c.head for c in none.candidates.columns]
    assert "size" in heads and "size, 95 % interval" not in heads


def test_what_may_be_chance_and_what_got_worse_is_said(data: ReportData) -> None:
    assert data.comparison
    held = data.comparison.held_out
    changed = {
        **held.difference,
        "v": Difference(value=-0.01, low=-0.03, high=0.0),
        "r": Difference(value=0.002, low=0.001, high=0.003),
    }
    compared = data.comparison.model_copy(
        update={"held_out": held.model_copy(update={"difference": changed})}
    )
    doubted = replace(data, comparison=compared)
    (lines,) = (lines for word, lines in summary(doubted) if word == "It lacked")
    assert lines[0].count("chance is not excluded for v.") == 1 and lines[0].count("(worse)") == 1
    worse = {c["name"] for c in cards(doubted) if c["worse_by_effects"]}
    assert worse == {"r"} and not any(c["worse_by_effects"] for c in cards(data))


def test_of_what_is_in_doubt_alone_it_is_not_said_that_the_model_lacked_it(
    data: ReportData,
) -> None:
    assert data.comparison
    doubt = {
        "verdict": "unexplained",
        "effects": (),
        "not_confirmed": data.comparison.effects,
        "unexplained": {"nearest": "current", "channels": ["u"], "correlates": []},
    }
    rows = dict(summary(replace(data, comparison=data.comparison.model_copy(update=doubt))))
    assert "It lacked" not in rows and ", not confirmed" in rows["It may lack"][0]
    assert rows["What remains"][0].startswith(
        "Without what is not confirmed an unexplained residual. Closest of the listed effects"
    )


def test_without_a_compass_a_current_has_no_north(data: ReportData) -> None:
    assert data.comparison
    (current,) = data.comparison.effects
    turned = current.model_copy(update={"frame": "bow"})
    found = replace(data, comparison=data.comparison.model_copy(update={"effects": (turned,)}))
    for told, axes in ((data, ("(north ", ", east ")), (found, ("(ahead ", ", to starboard "))):
        (lines,) = (lines for word, lines in summary(told) if word == "It lacked")
        assert all(axis in lines[0] for axis in axes)


def test_the_track_of_the_final_model_is_that_of_its_predictions(data: ReportData) -> None:
    assert data.comparison and data.is_refined
    assert data.final_errors()["track"].rmse == data.comparison.held_out.after["track"].rmse
    (first, *_) = data.comparison.maneuvers
    assert data.refined_channels()[first.id]["track"] == first.after["track"]


def test_the_final_model_is_shown_with_the_earlier_one_beside_it(small: ReportData) -> None:
    """Coefficients, figures of maneuvers, horizons and tests, all of the refined model."""
    data = replace(small, residuals=None)
    assert data.model and data.metrics
    values = {c.symbol: 1.1 * c.value for c in data.model.coefficients}
    final = data.model.model_copy(
        update={
            "coefficients": tuple(
                c.model_copy(update={"value": values[c.symbol]}) for c in data.model.coefficients
            )
        }
    )
    turn = next(m for m in data.metrics.maneuvers if m.turn and m.role == "validate")
    assert turn.turn
    simulated = {**turn.turn["simulated"], "advance_m": 77.7}
    other = turn.model_copy(update={"turn": {**turn.turn, "simulated": simulated}})
    metrics = data.metrics.model_copy(
        update={"maneuvers": tuple(other if m.id == turn.id else m for m in data.metrics.maneuvers)}
    )
    shown = replace(data, refined_model=final, refined_metrics=metrics, refined=None)
    page = Page(render(shown)).text
    assert "measured → final model" in page and "→ 77.7" in page
    assert "predicted by the final model in windows" in page
    assert "identified model" not in page[page.index("Standard maneuvers") : page.index(HEADING)]
    row = page[page.index("axial drag (u|u|)") :]
    before, after = (
        PAGE.with_std(v, c.std)
        for c in data.model.coefficients
        if c.symbol == "X_uu"
        for v in (c.value, values["X_uu"])
    )
    assert row.index(after) < row.index(before) < row.index("axial force")
    assert shown.earlier == "" and other in shown.finally_held_out()
    earlier = replace(shown, refined_metrics=None)  # a run of an earlier version
    assert earlier.earlier == "identified " and turn in earlier.finally_held_out()


def test_a_run_that_added_nothing_has_one_model(data: ReportData) -> None:
    assert data.comparison
    same = tuple(c.model_copy(update={"after": c.before}) for c in data.comparison.coefficients)
    alone = replace(
        data, comparison=data.comparison.model_copy(update={"coefficients": same, "effects": ()})
    )
    assert alone.final_errors() == alone.identified_errors()
    assert verdict_lines(alone)[0].startswith("The identified model predicts")


def with_findings(data: ReportData, name: str, *findings: Finding) -> ReportData:
    """The same with other findings of an artifact."""
    artifact = getattr(data, name).model_copy(update={"findings": findings})
    return replace(data, **{name: artifact})


def test_channels_that_the_effects_made_worse_are_told(data: ReportData) -> None:
    assert data.comparison
    held = data.comparison.held_out
    worse = {**held.difference, "r": Difference(value=0.002, low=0.001, high=0.003)}
    found = worse_channels(held.model_copy(update={"difference": worse}))
    told = {w.finding.code: w for w in warnings(with_findings(data, "comparison", *found))}
    assert told["worse-refined"].finding.where.startswith("r (")
    assert "worse-refined" not in {w.finding.code for w in warnings(data)}


def test_of_the_errors_those_of_the_final_model_are_told(data: ReportData) -> None:
    before, after, other = (
        Finding(code="no-better", where=c, message=f"{c} is predicted no better") for c in "urv"
    )
    other = other.model_copy(update={"code": "nothing_held_out"})
    both = with_findings(with_findings(data, "metrics", before, other), "comparison", after)
    told = [(w.stage, w.finding.where) for w in warnings(both) if w.finding in (before, after)]
    assert told == [("refine", "r")]
    assert other in [w.finding for w in warnings(both)]
    alone = replace(both, comparison=None)
    told = [(w.stage, w.finding.where) for w in warnings(alone) if w.finding in (before, after)]
    assert told == [("validate", "u")]


def test_no_finding_is_told_twice(small: ReportData) -> None:
    """A refinement hands on what the diagnosis said."""
    finding = Finding(code="few-maneuvers", message="only two maneuvers identify", where="t")
    both = with_findings(with_diagnosis(small, findings=(finding,)), "comparison", finding)
    assert [w.stage for w in warnings(both) if w.finding == finding] == ["diagnose"]
    assert Page(render(both)).text.count("only two maneuvers identify") == 1


def test_the_section_has_everything_of_the_diagnosis(data: ReportData, section: str) -> None:
    assert data.diagnosis
    wanted = [c.id for c in data.diagnosis.candidates]
    wanted += [c.rejected for c in data.diagnosis.candidates]
    wanted += [s.why for s in data.diagnosis.sees]
    wanted += [*data.diagnosis.missing, *data.diagnosis.steps]
    wanted += [
        "rudder_offset, hull_asymmetry (correlation 0.998)",
        "vary the speed while the rudder is amidships",
    ]
    wanted += ["0.5 % of healthy vehicles have a candidate as strong", "−0.129 to −0.113"]
    wanted += ["p: how often the strongest candidate of a healthy vehicle"]
    assert [w for w in wanted if w not in section] == []


def test_every_maneuver_stands_before_and_after_held_out_ones_first(
    data: ReportData, section: str
) -> None:
    assert data.comparison
    found = [section.index(m.id) for m in data.comparison.maneuvers]
    held = [
        p for p, m in zip(found, data.comparison.maneuvers, strict=True) if m.role == "validate"
    ]
    assert max(held) < min(set(found) - set(held))
    assert "0.0460 → 0.00610 *" in section  # its interval excludes zero
    assert "0.355 → 0.344 *" in section  # deg/s


def test_a_difference_that_may_be_none_has_no_star(data: ReportData) -> None:
    from auvident.report.numbers import PAGE
    from auvident.report.tables import written
    from auvident.report.tables_loop import maneuvers
    from auvident.schema.diagnosis import Difference

    assert data.comparison
    unsure = data.comparison.maneuvers[0].model_copy(
        update={"difference": {"u": Difference(value=-0.04, low=-0.09, high=0.01)}}
    )
    assert written(maneuvers([unsure]), PAGE).rows[0][3] == "0.0460 → 0.00610"


def test_coefficients_that_moved_are_in_it(section: str) -> None:
    moved = section[section.index("moved by more than two") :]
    assert "N_ur" in moved and "+4.0" in moved and "Y_ur" not in moved


def test_its_figures_are_drawn_and_well_formed(text: str) -> None:
    part = text[text.index(f"<h2>{HEADING}") : text.index(f"<h2>{NEXT}")]
    labels = re.findall(r'aria-label="([^"]*)"', part)
    assert len(labels) == 3
    for figure in re.findall(r"<svg.*?</svg>", part, flags=re.DOTALL):
        ElementTree.fromstring(figure)


def test_the_page_needs_nothing_else_and_repeats_itself(data: ReportData, text: str) -> None:
    page = Page(text)
    assert page.open == [] and len(page.ids) == len(set(page.ids))
    assert "http:" not in text and "https:" not in text
    drawings.drawn.clear()
    assert render(data) == text


def test_without_the_loop_there_is_no_section(small: ReportData) -> None:
    bare = replace(small, diagnosis=None, comparison=None, residuals=None)
    assert HEADING not in Page(render(bare)).text
    assert lacks(bare) is None


def test_a_diagnosis_alone_is_told(small: ReportData) -> None:
    page = Page(render(replace(small, comparison=None))).text
    assert "It lacked A current of 0.15 m/s" in page and "Candidate effects" in page
    assert "Held-out errors without and with the effects" not in page


def test_a_comparison_alone_is_told(small: ReportData) -> None:
    page = Page(render(replace(small, diagnosis=None, residuals=None))).text
    assert "Held-out errors without and with the effects" in page
    assert "Effects that these maneuvers would" not in page


def test_nothing_found_is_good_news_and_draws_no_change(small: ReportData) -> None:
    assert small.maneuvers and small.model
    none = loop_world.nothing()
    chosen = loop_world.in_plane(small.maneuvers, small.model)
    compared = loop_world.comparison(none, small.model, chosen)
    found = replace(small, diagnosis=none, comparison=compared)
    told = lacks(found)
    assert told and (told.grade, told.held_out, told.maneuvers) == ("good", None, None)
    page = Page(render(found)).text
    assert loop_world.NONE in page
    assert "moved by more than two" not in page and "Candidate effects, none accepted" in page


def test_what_only_fits_better_is_told_before_a_refinement_as_well(small: ReportData) -> None:
    wide = loop_world.CURRENT.model_copy(
        update={
            "parameters": tuple(
                p.model_copy(update={"interval": (-1.0, 1.0)})
                for p in loop_world.CURRENT.parameters
            )
        }
    )
    none = loop_world.nothing().model_copy(update={"not_confirmed": (wide,)})
    found = replace(small, diagnosis=none, comparison=None)
    told = lacks(found)
    assert told and told.grade == "good" and len(told.effects.rows) == len(wide.parameters)
    assert "not confirmed" in str(summary(found))
    assert "not confirmed" in Page(render(found)).text


@pytest.mark.parametrize("verdict", ["none_found", "effect_found", "ambiguous", "unexplained"])
def test_every_verdict_has_words(data: ReportData, verdict: str) -> None:
    assert data.diagnosis
    found = data.diagnosis.model_copy(update={"verdict": verdict})
    told = lacks(replace(data, diagnosis=found, comparison=None))
    assert told and told.verdict and told.grade in ("good", "fair", "poor")


def test_groups_and_what_is_left_are_named(small: ReportData) -> None:
    rest = {
        "correlates": [
            {"axis": "N", "regressor": "cos 2 heading", "gain": 41.0, "rms_fall": {"r": 0.12}}
        ],
        "nearest": "propeller_race",
        "channels": ["v", "r"],
    }
    found = with_diagnosis(
        small,
        verdict="unexplained",
        unexplained=rest,
        separate_by="vary the speed",
        ambiguous=(("rudder_offset", "hull_asymmetry"),),
    )
    page = Page(render(replace(found, comparison=None))).text
    assert (
        "The remaining yaw moment follows cos 2 heading (41 nats, 12 % off the residual)." in page
    )
    assert "not confirmed: propeller_race." in page and "Affected channels: v, r." in page
    assert "Maneuvers that would: vary the speed" in page


def test_findings_of_the_loop_are_among_the_warnings(small: ReportData) -> None:
    finding = Finding(code="few-maneuvers", message="only two maneuvers identify")
    assert (
        "only two maneuvers identify"
        in Page(render(with_diagnosis(small, findings=(finding,)))).text
    )


def test_texts_of_the_artifacts_are_escaped(small: ReportData) -> None:
    nasty = '<b>"A" & $B$</b>'
    found = with_diagnosis(small, statement=nasty, steps=(nasty,), missing=(nasty,))
    text = render(replace(found, comparison=None))
    assert nasty not in text
    assert Page(text).open == []


def test_artifacts_are_read_as_they_are_written(data: ReportData) -> None:
    assert data.diagnosis and data.comparison
    for artifact, model in ((data.diagnosis, Diagnosis), (data.comparison, Comparison)):
        assert model.model_validate_json(artifact.model_dump_json(by_alias=True)) == artifact


def refined_table(data: ReportData) -> Any:
    """As if the refined model predicted what was measured."""
    assert data.simulation is not None
    columns = [c for c in data.simulation if c.endswith("_simulated")]
    measured = {c: data.simulation[c.replace("_simulated", "_measured")] for c in columns}
    return data.simulation.assign(**measured)


def test_the_refined_prediction_is_drawn_beside_the_others(data: ReportData) -> None:
    refined = refined_table(data)
    assert "final model, with the effects" in render(replace(data, refined=refined))
    assert "final model, with the effects" not in render(replace(data, refined=None))


def test_the_refined_prediction_is_taken_row_by_row(data: ReportData) -> None:
    assert data.simulation is not None and data.comparison
    refined, maneuver = refined_table(data), data.held_out()[0].id
    rows = data.simulation[data.simulation["maneuver"] == maneuver]
    found = with_refined(rows, replace(data, refined=refined), maneuver)
    np.testing.assert_array_equal(found["u_mps_refined"], rows["u_mps_measured"])
    np.testing.assert_array_equal(found["u_mps_simulated"], rows["u_mps_simulated"])
    wider = refined.assign(u_mps_lo=refined["u_mps_lo"] - 1.0, u_mps_hi=refined["u_mps_hi"] + 1.0)
    band = with_refined(rows, replace(data, refined=wider), maneuver)  # of the final model
    np.testing.assert_allclose(band["u_mps_hi"], rows["u_mps_hi"] + 1.0)
    without = refined.drop(columns=["u_mps_lo", "u_mps_hi"])
    assert "u_mps_lo" not in with_refined(rows, replace(data, refined=without), maneuver)
    shorter = refined.drop(index=rows.index[:1])  # not the same rows: not drawn
    assert "u_mps_refined" not in with_refined(rows, replace(data, refined=shorter), maneuver)
    unchanged = data.comparison.model_copy(update={"effects": ()})
    told = replace(data, refined=refined, comparison=unchanged)
    assert "u_mps_refined" not in with_refined(rows, told, maneuver)


@pytest.mark.parametrize(("plane", "words"), [("horizontal", "heading"), ("vertical", "pitch")])
def test_a_force_is_said_to_follow_the_angle_of_the_plane(
    small: ReportData, plane: str, words: str
) -> None:
    assert small.diagnosis is not None
    other = small.diagnosis.model_copy(update={"plane": plane})
    found = lacks(replace(small, diagnosis=other))
    assert found is not None and f"follows the {words}" in found.suggests
