"""The last lines of a command: the report, and the next command."""

import io
from pathlib import Path
from typing import Any

import pytest

from auvident.cli.watch import Watch
from auvident.report.closing import after_diagnose, after_refine, after_run, in_one_line
from auvident.schema.diagnosis import UnexplainedForce
from auvident.schema.logs import CheckMade, Quality, TrialQuality
from tests import loop_world
from tests.report.test_console import text_of

RUN = Path("runs/a trial")


def last(pieces: list[Any]) -> str:
    return text_of(pieces).splitlines()[-1]


def quality(*checks: CheckMade) -> Quality:
    trial = TrialQuality.model_construct(trial="t", checks_made=checks)
    return Quality.model_construct(trials=(trial,))


def check(name: str, outcome: str, fix: str) -> CheckMade:
    return CheckMade.model_construct(name=name, outcome=outcome, fix=fix)


@pytest.mark.parametrize(
    ("verdict", "command"),
    [
        ("effect_found", "refine"),
        ("ambiguous", "refine"),
        ("partly_explained", "refine"),
        ("unexplained", "report"),
        ("none_found", "report"),
    ],
)
def test_a_diagnosis_with_something_to_add_is_followed_by_the_refinement(
    verdict: str, command: str
) -> None:
    assert last(after_diagnose(RUN, ["none_found", verdict])) == (
        f"  auvident {command} 'runs/a trial'"
    )


def test_a_command_stays_in_one_line_whatever_the_width(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setenv("COLUMNS", "20")
    for piece in after_refine(Path("runs/a_run_with_a_long_name")):
        Watch().show(piece)
    assert stream.getvalue().splitlines()[-1] == "  auvident report runs/a_run_with_a_long_name"


def test_a_refinement_is_followed_by_the_report() -> None:
    assert last(after_refine(Path("runs/demo"))) == "  auvident report runs/demo"


def test_a_correction_comes_before_everything_else() -> None:
    found = quality(
        check("rudder_sign", "contradicts", "sign = -1"),
        check("gyro_scale", "contradicts", ""),
        check("dvl_axes", "agrees", "x"),
    )
    text = text_of(after_run(Path("runs/demo"), [], found))
    assert text.splitlines()[0] == "Report: runs/demo/report/report.html"
    assert text.splitlines()[-1] == "  auvident run --run runs/demo --fix rudder_sign"


def test_what_no_effect_explains_may_be_taken_by_an_unnamed_force() -> None:
    open_ = loop_world.comparison(loop_world.diagnosis(verdict="unexplained"))
    run = Path("runs/demo")
    assert last(after_run(run, [open_], None)).endswith("refine runs/demo --with-unexplained")
    force = UnexplainedForce(added=True, statement="An unnamed force improves the prediction.")
    tried = open_.model_copy(update={"unexplained_force": force})
    assert last(after_run(run, [tried], quality())) == "  auvident plan-trial runs/demo"


def test_a_quiet_run_says_the_verdict_of_each_plane_and_the_report() -> None:
    found = loop_world.comparison(loop_world.nothing())
    one, report = in_one_line(RUN, [("", found)]), "Report: runs/a trial/report/report.html"
    assert one == f"{loop_world.NONE} {report}"
    both = in_one_line(RUN, [("", found), ("vertical", found)])
    assert both.startswith(f"Horizontal plane: {loop_world.NONE} Vertical plane: ")
    assert "\n" not in both and both.count(report) == 1
    assert in_one_line(RUN, [("", None)]) == f"No verdict. {report}"
    assert in_one_line(RUN, []) == f"No verdict. {report}"
