"""Links that pages and docstrings get without being written: catalogue keys, and the sources cited by number.

An inline `cycloid.disc_pitch` leads to its section of the catalogue page, a plain 000 to 004 to its entry in the
bibliography.  Headings, formulas, code blocks and what is a link already stay as they are.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

from rverror.model.catalogue import CATALOGUE

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: A source by its number; 10 000, 0.001 and 1,000 are none.
SOURCE = re.compile(r"(?<![\w.,:/#-])(?<!\d )00[0-4](?![\w/-]|[.,]\d| \d)")
_AS_THEY_ARE = (nodes.reference, nodes.title, nodes.FixedTextElement, nodes.literal, nodes.math, nodes.Invisible)


def catalogue_anchor(key: str) -> str:
    """Anchor of a key's section on the catalogue page.

    >>> catalogue_anchor("cycloid.disc_pitch")
    'cycloid-disc-pitch'
    """
    return nodes.make_id(key)


def pieces(text: str) -> list[str]:
    """Text in parts, every second of which is the number of a source.

    >>> pieces("sources 001 and 004; 1.002")
    ['sources ', '001', ' and ', '004', '; 1.002']
    """
    numbers = SOURCE.findall(text)
    return [part for pair in zip(SOURCE.split(text), [*numbers, ""], strict=True) for part in pair][:-1]


class CrossLinks(SphinxPostTransform):
    """Writes the links once a page is whole, so that docstrings have them too."""

    default_priority = 900
    formats = ("html",)

    def run(self, **kwargs: Any) -> None:
        """Link every key and every source of the page."""
        for literal in list(self.document.findall(nodes.literal)):
            key = literal.astext()
            if key in CATALOGUE and not self._stays(literal.parent):
                literal.replace_self(self._link("catalogue", catalogue_anchor(key), literal.deepcopy()))
        if self.env.docname == "bibliography":
            return
        anchors = self.env.metadata["bibliography"].get("myst_slugs", {})
        for text in list(self.document.findall(nodes.Text)):
            if SOURCE.search(text) and not self._stays(text.parent):
                parts = [nodes.Text(part) for part in pieces(text)]
                linked = [self._link("bibliography", anchors[part][1], part) if at % 2 else part
                          for at, part in enumerate(parts)]  # fmt: skip
                text.parent.replace(text, [part for part in linked if part.astext()])

    @staticmethod
    def _stays(node: nodes.Element | None) -> bool:
        while node is not None:
            if isinstance(node, _AS_THEY_ARE) or node.tagname == "desc_signature":
                return True
            node = node.parent
        return False

    def _link(self, page: str, anchor: str, words: nodes.Node) -> nodes.reference:
        here = self.env.docname
        target = "" if here == page else self.app.builder.get_relative_uri(here, page)
        return nodes.reference("", "", words, internal=True, refuri=f"{target}#{anchor}")


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_post_transform(CrossLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
