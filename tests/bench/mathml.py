"""Equations of the documentation for the site: a Markdown extension, LaTeX to MathML.

Pages write them as GitHub shows them, `` $`E = m c^2`$ `` in a line and a block fenced as ``math``.
Browsers draw MathML themselves, so that the site needs no script and no fonts for it.
"""

import re
from typing import Any
from xml.etree.ElementTree import Element

import latex2mathml.converter
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor

BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = r"\$`([^`]+)`\$"
BEFORE_FENCES, BEFORE_CODE = 30, 200  # priorities: fenced blocks have 25, code in a line 190


class Blocks(Preprocessor):
    """Blocks fenced as ``math``."""

    def run(self, lines: list[str]) -> list[str]:
        """The lines with a placeholder for each block."""
        return BLOCK.sub(self._stored, "\n".join(lines)).split("\n")

    def _stored(self, found: re.Match[str]) -> str:
        drawn = latex2mathml.converter.convert(found[1].strip(), display="block")
        return "\n" + self.md.htmlStash.store(f'<div class="equation">{drawn}</div>') + "\n"


class InLine(InlineProcessor):
    """Equations within a line of text."""

    def handleMatch(  # type: ignore[override]
        self, m: re.Match[str], data: str
    ) -> tuple[Element | str, int, int]:
        """A placeholder for the equation."""
        drawn = latex2mathml.converter.convert(m[1])
        return self.md.htmlStash.store(drawn), m.start(0), m.end(0)


class Equations(Extension):
    """Both ways of writing an equation."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Before fenced blocks and code are looked for."""
        md.preprocessors.register(Blocks(md), "equations", BEFORE_FENCES)
        md.inlinePatterns.register(InLine(INLINE, md), "equations", BEFORE_CODE)


def makeExtension(**options: Any) -> Equations:
    """What Markdown asks a module of an extension for."""
    return Equations(**options)
