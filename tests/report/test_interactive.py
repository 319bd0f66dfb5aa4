"""Figures for plotly: the same data as those that are drawn; refused where plotly is missing."""

import html
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auvident.report.figures import BLUE, VERMILLION, categories, new_figure, style, svg
from auvident.report.html import render
from auvident.report.html_data import ReportData
from tests.command_line import Called

TIME = np.linspace(0.0, 10.0, 7)


def plots(text: str) -> list[dict[str, Any]]:
    return [json.loads(html.unescape(p)) for p in re.findall(r'data-plot="([^"]*)"', text)]


@pytest.fixture(scope="module")
def stack() -> dict[str, Any]:
    with style(live=True):
        figure = new_figure(2.0)
        first, second = figure.subplots(2, 1, sharex=True)
        first.plot(TIME, np.sin(TIME), color=BLUE, label="model", drawstyle="steps-post")
        first.fill_between(TIME, -TIME, TIME, color=VERMILLION, alpha=0.25)
        first.axvspan(2.5, 5.0, color=BLUE, alpha=0.4)
        first.set_ylabel("speed\nm/s")
        second.barh([0.0, 1.0], [3.0, 4.0])
        second.text(5.0, 0.5, "<here>")
        categories(second.yaxis, ["u", "v"])
        second.set_xlabel("time, s")
        figure.legend(handles=first.lines)
        text = svg(figure, "some", "caption")
    (found,) = plots(text)
    assert 'aria-label="caption"' in text and ">model<" in text
    return found


def test_a_line_has_its_data_and_its_name(stack: dict[str, Any]) -> None:
    line = next(t for t in stack["data"] if t.get("mode") == "lines")
    np.testing.assert_allclose(line["x"], TIME, rtol=1e-4)
    np.testing.assert_allclose(line["y"], np.sin(TIME), rtol=1e-4)
    assert (line["name"], line["line"]["shape"]) == ("model", "hv")
    assert line["line"]["color"] == "var(--blue)"


def test_bands_bars_and_shades_are_where_they_are_drawn(stack: dict[str, Any]) -> None:
    band = next(t for t in stack["data"] if t.get("fill") == "toself")
    there = np.array([v for v in band["y"] if v is not None])
    assert (there.min(), there.max()) == pytest.approx((-10.0, 10.0), abs=1e-3)
    shade, *bars = stack["layout"]["shapes"]
    assert (shade["x0"], shade["x1"]) == pytest.approx((2.5, 5.0))
    assert (shade["xref"], shade["yref"]) == ("x", "y domain")
    assert [bar["x1"] for bar in bars] == pytest.approx([3.0, 4.0])
    assert all(bar["yref"] == "y2" for bar in bars)


def test_panels_share_the_axis_across_and_keep_their_words(stack: dict[str, Any]) -> None:
    layout = stack["layout"]
    assert {t["xaxis"] for t in stack["data"]} == {"x"}
    assert layout["xaxis"]["title"]["text"] == "time, s"
    assert layout["yaxis2"]["ticktext"] == ["u", "v"]
    assert layout["yaxis"]["domain"][0] > layout["yaxis2"]["domain"][1]
    words = [note["text"] for note in layout["annotations"]]
    assert "<b>speed, m/s</b>" in words and "&lt;here&gt;" in words


def test_figures_are_drawn_again_afterwards() -> None:
    with style():
        figure = new_figure(1.0)
        figure.subplots().plot(TIME, TIME)
        assert "data-plot" not in svg(figure, "a", "a")


def test_the_page_has_the_library_in_it() -> None:
    pytest.importorskip("plotly")
    page = render(ReportData(), live=True)
    assert "Plotly.newPlot" in page and "<script src" not in page
    assert "<script" not in render(ReportData())


def test_without_plotly_it_is_refused_with_the_remedy(
    auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    called = auvident("report", tmp_path, "--interactive")
    assert called.code == 2
    assert "needs plotly" in called.err and "auvident[interactive]" in called.err
