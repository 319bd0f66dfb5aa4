"""What a trial of a campaign says of its failure, however wide the terminal is."""

import pytest

from auvident.pipeline.campaign_jobs import Job, LocalProcesses, environment, problem_of


def test_the_process_of_a_trial_does_not_know_the_width_of_the_terminal(monkeypatch) -> None:
    """Each line of its error got a full stop: "a positive. rudder_deg turns the bow"."""
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("LINES", "20")
    assert not {"COLUMNS", "LINES"} & set(environment())
    job = Job("v/a", ("ingest", "no_such_log", "--vehicle", "no.toml", "--run", "/dev/null/x"))
    (done,) = LocalProcesses(1).each([job])
    assert done.exit_code and done.problem
    width = done.problem
    monkeypatch.delenv("COLUMNS")
    (done,) = LocalProcesses(1).each([job])
    assert done.problem == width


@pytest.mark.parametrize("ends", ["map:", "[rpm]", "}"])
def test_lines_of_toml_get_no_full_stop(ends: str) -> None:
    assert problem_of(f"Error: x {ends}\n  y\n") == f"x {ends} y"
