"""What a person sees of the residual loop on the console."""

from typing import Any

import pytest

from auvident.report import tables_loop as tables
from auvident.report.console import stage_report
from auvident.report.console_loop import MOST_CANDIDATES, discovery
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import CrossValidation, Finding
from auvident.schema.diagnosis import (
    Attempt,
    Comparison,
    CrossValidated,
    Diagnosis,
    UnexplainedForce,
)
from tests import loop_world
from tests.report.test_console import text_of


def text(cell: Any) -> str:
    return cell if isinstance(cell, str) else cell.text(TERMINAL)


def diagnosed(found: Diagnosis, brief: bool = False) -> str:
    return text_of(stage_report("diagnose", {"diagnose/diagnosis.json": found}, brief))


def refined(found: Comparison, brief: bool = False) -> str:
    return text_of(stage_report("refine", {"refine/comparison.json": found}, brief))


def moved_comparison() -> Comparison:
    from auvident.schema.diagnosis import CoefficientComparison as Row

    compared = loop_world.comparison(loop_world.diagnosis())
    row = {"unit": "kg m", "prior": -12.9, "prior_std": 6.9, "before_std": 3.7, "after_std": 3.1}
    rows = (
        Row(symbol="N_ur", before=-1.2, after=13.6, **row),  # type: ignore[arg-type]
        Row(symbol="Y_ur", before=-1.2, after=-1.3, **row),  # type: ignore[arg-type]
    )
    return compared.model_copy(update={"coefficients": rows})


def test_what_can_be_seen_stands_before_the_verdict() -> None:
    text = diagnosed(loop_world.diagnosis())
    order = [
        "would and would not show",
        "current ≥ 0.014 m/s",
        "no position was logged",
        "look alike",
        "Residual of the fit of the diagnosis",
        "Candidate effects",
        "Verdict: ",
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    assert loop_world.STATEMENT in text
    assert "roll_coupling: the log has no roll" in text


def test_the_residual_stands_against_the_noise() -> None:
    line = next(
        line for line in diagnosed(loop_world.diagnosis()).splitlines() if line.startswith(" u ")
    )
    assert line.split() == ["u", "m/s", "0.046", "0.005", "9.2", "0.0061", "4.2"]


def test_the_ranking_says_why_a_candidate_was_turned_down() -> None:
    text = diagnosed(loop_world.diagnosis())
    assert "as likely by chance (p = 0.62)" in text
    assert f"{len(loop_world.CANDIDATES) - MOST_CANDIDATES} more in diagnose/diagnosis.json" in text
    last = loop_world.CANDIDATES[-1]
    table = text[text.index("Candidate effects") : text.index("Verdict")]
    assert last.id not in table


def test_an_effect_stands_with_value_and_interval_of_each_parameter() -> None:
    for text in (diagnosed(loop_world.diagnosis()), refined(moved_comparison())):
        assert "a current of 0.15 m/s that sets to 145 degrees" in text
        assert "-0.129 to -0.113" in text
        assert "0.0732 to 0.0928" in text


def test_groups_and_what_is_left_are_named() -> None:
    found = loop_world.diagnosis(
        verdict="unexplained",
        ambiguous=(("rudder_offset", "hull_asymmetry"),),
        separate_by="vary the speed",
        unexplained={
            "correlates": [{"axis": "N", "regressor": "roll", "gain": 12.0, "rms_fall": {"r": 0.3}}]
        },
    )
    text = diagnosed(found)
    assert "These data cannot tell apart rudder_offset and hull_asymmetry" in text
    assert "These maneuvers would tell them apart: vary the speed" in text
    assert (
        "Unexplained: The remaining yaw moment follows the roll (12 nats, 30 % off the residual)."
        in text
    )
    ending = text_of(discovery(loop_world.comparison(found)))
    assert "cannot tell apart" in ending
    assert "The remaining yaw moment follows the roll (12 nats, 30 % off the residual)." in ending


def test_held_out_errors_before_and_after_with_the_interval_of_the_difference() -> None:
    text = refined(moved_comparison())
    line = next(line for line in text.splitlines() if line.startswith(" v "))
    assert "0.041" in line and "0.0055" in line
    assert "-0.036" in line and "-0.04 to -0.0001" in line


def test_only_coefficients_that_moved_are_listed() -> None:
    text = refined(moved_comparison())
    assert "+4.0" in text and "N_ur" in text
    assert "Y_ur" not in text


def test_nothing_found_is_one_sentence_without_tables_of_equal_numbers() -> None:
    compared = loop_world.comparison(loop_world.nothing())
    assert text_of(discovery(compared)).strip() == f"Verdict: {loop_world.NONE}"


def test_a_run_keeps_its_verdict_for_the_end() -> None:
    finding = Finding(code="few-maneuvers", message="only two maneuvers identify")
    found = loop_world.diagnosis(findings=(finding,))
    text = diagnosed(found, brief=True)
    assert "would and would not show" in text and "only two maneuvers identify" in text
    assert loop_world.STATEMENT not in text
    compared = moved_comparison().model_copy(update={"findings": (finding,)})
    assert refined(compared, brief=True).strip() == "only two maneuvers identify"


@pytest.mark.parametrize(
    "empty",
    [{"sees": ()}, {"residuals": ()}, {"candidates": ()}, {"lookalikes": ()}, {"effects": ()}],
    ids=str,
)
def test_what_is_missing_is_left_out(empty: dict[str, Any]) -> None:
    assert loop_world.STATEMENT in diagnosed(loop_world.diagnosis(**empty))


def test_an_event_has_its_place() -> None:
    found = loop_world.diagnosis(effects=(loop_world.EVENT,))
    assert "a disturbance harbour_trial-turn-2 at 431.5 s" in diagnosed(found)


def tried_comparison() -> Comparison:
    """What `refine` tried on a model: one attempt failed, one was for the sake of r."""
    errors = {"u": 0.046, "r": 0.0062}
    crossed = {
        when: {
            c: CrossValidation(rmse=f * e, nrmse=4.0 * f * e, se=0.1 * f * e, unit=unit)
            for (c, e), unit in zip(errors.items(), ("m/s", "rad/s"), strict=True)
        }
        for when, f in (("before", 1.0), ("after", 0.5))
    }
    ratios, se = {"u": 0.13, "r": 0.97}, {"u": 0.1, "r": 0.2}
    attempts = (
        Attempt(effects=()),
        Attempt(effects=("current",), failed="the covariance is singular"),
        Attempt(
            effects=("current",), ratios=ratios, left_out=ratios, left_out_se=se, ran_away=True
        ),
        Attempt(
            effects=("current",),
            ratios=ratios,
            left_out=ratios,
            left_out_se=se,
            keeps=("r",),
            taken=True,
        ),
    )
    force = UnexplainedForce(
        added=True,
        statement="An unnamed force improves the prediction: left-out v 0.21 to 0.09 (NRMSE).",
    )
    return loop_world.comparison(loop_world.diagnosis()).model_copy(
        update={
            "attempts": attempts,
            "cross_validation": CrossValidated(**crossed),
            "unexplained_force": force,
        }
    )


def test_attempts_have_left_out_ratios_with_their_errors() -> None:
    table = tables.attempts(tried_comparison())
    rows = [[text(cell) for cell in row] for row in table.rows]
    assert [row[:2] for row in rows] == [
        ["current", "failed"],
        ["current", "diverges"],
        ["current (for the sake of r)", "adopted"],
    ]
    assert rows[0][2:] == [TERMINAL.missing] * 4
    assert rows[2][2:] == ["0.130 ± 0.013", "0.97 ± 0.19", "0.13", "0.97"]


def test_the_cross_validation_of_the_final_model_stands_beside_that_of_the_first() -> None:
    shown = refined(tried_comparison())
    assert "each left out in turn, without and with" in shown
    assert "0.0460 ± 0.0046" in shown and "0.0230 ± 0.0023" in shown
    assert "0.00620 ± 0.00062" in shown  # rad/s, as the unit beside says
    assert "left out in turn, without" not in refined(loop_world.comparison(loop_world.nothing()))


def test_a_force_without_a_name_is_told_as_what_it_is() -> None:
    assert "An unnamed force improves the prediction: left-out v 0.21 to 0.09" in refined(
        tried_comparison()
    )
