"""A figure as markup of the page: what is drawn, what stands around it, how it is laid out."""

import re
from xml.etree import ElementTree

import matplotlib.artist
import numpy as np
import pytest
from matplotlib.axes import Axes

from auvident.report.figures import BLUE, VERMILLION, categories, new_figure, style, svg
from auvident.report.marks import ACROSS, DOWN, trace
from auvident.report.taken import taken


def steps(d: str) -> np.ndarray:
    """Corners of a path of one piece."""
    start, _, rest = d.removeprefix("M").partition("l")
    first = [int(x) for x in start.split()]
    moved = np.array(re.findall(r"-?\d+", rest), int).reshape(-1, 2)
    return np.cumsum(np.vstack([first, moved]), axis=0)


def test_a_path_has_the_corners_of_the_line_and_no_more() -> None:
    share = np.linspace(0.0, 1.0, 1001)
    bent = np.column_stack([share, np.where(share < 0.5, 0.0, share - 0.5)])
    found = steps(trace(bent))
    np.testing.assert_array_equal(found[[0, 1, -1]], [[0, DOWN], [1000, DOWN], [ACROSS, 500]])
    assert len(found) == 3  # the middles of straight runs are left out
    back = steps(trace(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]])))
    np.testing.assert_array_equal(back[:, 0], [0, ACROSS, ACROSS // 2])  # but not a turn


def test_the_peaks_of_a_noisy_line_stay() -> None:
    rng = np.random.default_rng(5)
    y = 0.5 + 0.1 * rng.standard_normal(1500)
    y[700], y[900] = 0.999, 0.001
    found = steps(trace(np.column_stack([np.linspace(0.0, 1.0, 1500), y])))
    assert (found[:, 1].min(), found[:, 1].max()) == (1, 999)


def test_a_hole_interrupts_a_path() -> None:
    points = np.column_stack([np.arange(9) / 8.0, np.full(9, 0.5)])
    points[4] = np.nan
    assert trace(points).count("M") == 2
    assert trace(np.full((3, 2), np.nan)) == ""


def drawn(**labels: str) -> str:
    with style():
        figure = new_figure(2.0)
        first, second = figure.subplots(2, 1, sharex=True)
        first.plot([0.0, 10.0], [-2.0, 2.0], color=BLUE, ls=(0, (4, 2)), lw=2.0, label="line")
        first.fill_between([0.0, 10.0], [-1.0, 0.0], [0.0, 1.0], color=VERMILLION, alpha=0.25)
        first.axvspan(2.5, 5.0, color=BLUE, alpha=0.4, hatch="////")
        first.axhline(0.0)
        second.scatter([1.0, 2.0], [3.0, 4.0], color=BLUE)
        second.errorbar([5.0], [3.5], xerr=[0.5], fmt="o")
        second.text(5.0, 3.5, "<here> & there")
        first.set_xlim(0.0, 10.0)
        first.set_ylabel(labels.get("y", "speed\nm/s"))
        first.set_title("RMSE 1 m/s", loc="right", color=VERMILLION)
        second.set_xlabel("time, s")
        figure.legend(handles=first.lines[:1])
        return svg(figure, "some", 'a "caption"')


def test_words_and_numbers_stand_around_the_panels() -> None:
    text = drawn()
    root = ElementTree.fromstring(text)
    words = [str(t).strip() for t in root.itertext() if str(t).strip()]
    for wanted in ("speed, m/s", "RMSE 1 m/s", "time, s", "line", "<here> & there", "−2", "10"):
        assert wanted in words, wanted
    assert words.count("10") == 1  # the upper panel shares the axis of the lower one
    assert root.attrib["aria-label"] == 'a "caption"' and root.attrib["role"] == "img"
    assert len(root.findall(".//div[@class='panel']")) == 2
    assert len(root.findall(".//div[@class='stack']")) == 1


def test_what_is_drawn_has_the_colours_of_the_page() -> None:
    text = drawn()
    assert '<span style="color:var(--vermillion)">RMSE 1 m/s</span>' in text
    assert BLUE not in text and 'stroke="var(--blue)"' in text
    assert 'stroke-dasharray="10 5"' in text  # of 2 pt, in pixels
    assert 'fill="var(--vermillion)" fill-opacity="0.25"' in text
    assert 'x="25%"' in text and 'width="25%"' in text  # the shade, from a quarter to a half
    assert text.count("url(#some-hatch0)") == 1 and 'id="some-hatch0"' in text


def test_a_user_s_names_do_no_harm() -> None:
    nasty = '<b>"A" & $B$</b>'
    text = drawn(y=nasty)
    assert nasty not in text
    assert nasty in list(ElementTree.fromstring(text).itertext())


def test_columns_stand_side_by_side_and_maps_name_their_cells() -> None:
    with style():
        figure = new_figure(3.0)
        left, right = figure.subplots(1, 2, width_ratios=[3, 1])
        right.imshow(np.array([[np.nan, 1.0], [0.5, np.nan]]), vmin=0.0, vmax=1.0)
        names = ["a_long_name_of_a_parameter" * 3, "b"]
        for axis in (right.xaxis, right.yaxis):
            categories(axis, names)
        left.plot([0.0, 1.0], [0.0, 1.0], "D")
        text = svg(figure, "map", "map")
    assert re.search(r"--columns:\d+fr \d+fr", text)
    assert text.count("<rect") == 2  # a cell without a value is none
    assert 'class="x upright"' in text and "aspect-ratio:1.000" in text
    assert text.count("◆") == 2


def test_rows_that_panels_share_begin_at_one_height() -> None:
    """Words above one of them alone would move its rows down."""
    with style():
        figure = new_figure(2.0)
        left, right = figure.subplots(1, 2, sharey=True)
        left.plot([0.0, 1.0], [0.0, 1.0])
        right.barh([0.0, 1.0], [1.0, 2.0])
        plain = svg(figure, "plain", "plain")
        right.set_title("share")
        text = svg(figure, "titled", "titled")
    assert 'class="head"' not in plain
    assert re.findall(r'<p class="head">(.*?)</p>', text) == [
        "<span>&nbsp;</span>",
        "<span><span>share</span></span>",
    ]


def test_what_has_no_mark_is_not_left_out_silently() -> None:
    with style():
        figure = new_figure(2.0)
        figure.subplots().add_artist(Unknown())
        with pytest.raises(TypeError, match="no mark for Unknown"):
            svg(figure, "a", "a")


class Unknown(matplotlib.artist.Artist):
    pass


def test_figures_of_a_page_make_no_ticks_but_those_that_are_asked_for() -> None:
    with style():
        axes = new_figure(2.0).subplots()
        axes.plot([0.0, 10.0], [-2.0, 2.0])
        axes.tick_params(labelbottom=False)
        assert axes.xaxis.majorTicks == [] and axes.yaxis.minorTicks == []
        assert "−1" in [t.get_text() for t in axes.get_yticklabels()]  # made when asked for
        with taken():
            assert type(new_figure(2.0).subplots()) is Axes  # as matplotlib makes it


def test_a_number_at_the_very_end_of_an_axis_stays_on_the_page() -> None:
    with style():
        figure = new_figure(2.0)
        axes = figure.subplots()
        axes.plot([0.0, 2000.0], [0.0, 1.0])
        axes.set_xlim(0.0, 2000.0)
        axes.set_xticks([0.0, 1000.0, 2000.0])
        page = svg(figure, "name", "A line")
    (last,) = re.findall(r"<text[^>]*>2000</text>", page)
    assert "text-anchor:end" in last and page.count("text-anchor:end") == 1
