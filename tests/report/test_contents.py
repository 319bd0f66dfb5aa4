"""Headings are linked to, and the first one after the summary begins the appendix."""

import re

from auvident.report.contents import with_contents

PAGE = """<!-- contents -->
<h2 class="front">Trust</h2><h2 class="plane" id="whole">Whole vehicle</h2>
<h2>Trials &amp; <i>record</i></h2><h2>Trials &amp; <i>record</i></h2>"""


def test_each_heading_has_a_link_and_leads_back() -> None:
    page = with_contents(PAGE)
    linked = re.findall(r'<a href="#([^"]*)">', page)
    assert linked == ["trust", "whole", "trials-record", "trials-record-2"]
    assert all(page.count(f'id="{name}"') == 1 for name in linked)
    assert page.count('href="#contents"') == 4 and page.count('id="contents"') == 1


def test_the_appendix_begins_after_the_summary() -> None:
    before, _, after = with_contents(PAGE).partition('class="appendix"')
    assert "Trust" in before and "Whole vehicle" in before
    assert after.count("class=") - after.count('class="up"') == 0


def test_a_page_without_headings_has_no_contents() -> None:
    assert "<details>" not in with_contents("<!-- contents --><p>nothing</p>")
