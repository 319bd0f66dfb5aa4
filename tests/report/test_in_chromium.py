"""The report in a browser: nothing runs off the page, nothing is too small or too faint to read."""

from pathlib import Path

import pytest

from tests.report.in_chromium import BROWSER, looked_at

VIEWS = [(width, scheme) for scheme in ("light", "dark") for width in (390, 1280)]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_the_report_can_be_read_on_a_phone_and_on_a_desk(completed: Path, tmp_path: Path) -> None:
    page = (completed / "runs/demo/report/report.html").read_text("utf-8")
    found = looked_at(page, VIEWS, tmp_path)
    assert [(view["width"], view["dark"]) for view in found] == [
        (width, scheme == "dark") for width, scheme in VIEWS
    ]
    for view in found:
        assert view["page"] <= view["width"]  # nothing to scroll sideways
        for nothing in ("errors", "small", "faint", "wide", "lost", "uneven"):
            assert view[nothing] == [], (view["width"], view["dark"], nothing)
        assert (view["images"], view["flat"]) == (0, 0)
        assert view["panels"] > 30 and view["words"] > 1000
