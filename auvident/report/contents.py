"""The table of contents of the page, made from its headings, and where its appendix begins."""

import re

from markupsafe import Markup

PLACE = "<!-- contents -->"  # in the template
HEADING = re.compile(r"<h2([^>]*)>(.*?)</h2>", re.DOTALL)
FRONT, PLANE = "front", "plane"  # classes: part of the summary; what the next ones belong to


def with_contents(page: str) -> str:
    """The page with links to its headings, each of which leads back.

    Parameters
    ----------
    page : str
        Markup with `PLACE` where the table of contents goes. A heading of class ``front``
        belongs to the summary; the first one of no class begins the appendix.
    """
    entries: list[tuple[str, str, bool]] = []
    begun = False

    def linked(match: re.Match[str]) -> str:
        nonlocal begun
        attributes, words = match.groups()
        kind = _attribute(attributes, "class")
        starts = not begun and kind not in (FRONT, PLANE)
        begun |= starts
        own = _attribute(attributes, "id")
        name = own or _free(words, {e[0] for e in entries})
        entries.append((name, words, kind == PLANE))
        look = ' class="appendix"' if starts else ""
        place = "" if own else f' id="{name}"'
        before = f"<a{place}{look}></a>" if place or look else ""
        up = '<a class="up" href="#contents" title="to the contents">↑</a>'
        return f"{before}<h2{attributes}>{words}{up}</h2>"

    text = HEADING.sub(linked, page)
    items = "".join(
        f'<li{" class=plane" if plane else ""}><a href="#{name}">{words}</a></li>'
        for name, words, plane in entries
    )
    folded = f"<details><summary>Contents</summary><ul>{items}</ul></details>" if items else ""
    return text.replace(PLACE, f'<nav id="contents">{folded}</nav>', 1)


def _attribute(text: str, name: str) -> str:
    found = re.search(rf'\b{name}="([^"]*)"', text)
    return found.group(1) if found else ""


def _free(words: str, taken: set[str]) -> str:
    """An identifier made from the words of a heading, which no other has."""
    plain = str(Markup(words).striptags()).lower()
    base = re.sub(r"[^a-z0-9]+", "-", plain).strip("-") or "section"
    name, count = base, 2
    while name in taken:
        name, count = f"{base}-{count}", count + 1
    return name
