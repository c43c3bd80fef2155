"""Pages of studies, which are Markdown, as parts of the report: title, lead, and the whole page as HTML.

Markdown is rendered without the HTML that it may contain, and relative links, which would lead out of the page, stay
as their text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, MutableSet
from typing import TYPE_CHECKING, Any

from studies.web.folder_contents import Contents

if TYPE_CHECKING:
    from markupsafe import Markup

MOST_LEAD = 900
"""Letters of a page that stand before the figures, if its paragraphs end there; the folded page has the rest."""
TITLES = {
    ("press.csv", "shear.csv"): "Comparison of formulas and finite elements",
    ("sweep.csv",): "Sweep",
    ("sweep.parquet",): "Sweep",
}
"""Titles of folders that have no page, by the tables that they hold."""


def title_of(contents: Contents) -> str:
    """Return the title of a folder: the heading of its page, else its kind, else its name."""
    for page in contents.pages.values():
        heading = re.search(r"^# (.+)$", page, flags=re.M)
        if heading:
            return heading[1].replace("`", "").strip()
    for files, title in TITLES.items():
        if all(name in contents.tables for name in files):
            return title
    return contents.name or contents.path.resolve().name


def lead_of(contents: Contents) -> Markup | str:
    """Return the first paragraphs of a folder's page, before its first section or picture."""
    for page in contents.pages.values():
        whole = re.split(r"^(?:## |!\[|\|)", page, maxsplit=1, flags=re.M)[0]
        blocks = [block for block in re.split(r"\n{2,}", whole) if block.strip() and not block.startswith("# ")]
        lead: list[str] = []
        for block in blocks:
            if lead and len("".join(lead)) + len(block) > MOST_LEAD:
                break
            lead.append(block)
        if lead:
            return page_html("\n\n".join(lead), {}, set())
    return ""


def page_html(text: str, pictures: Mapping[str, str], used: MutableSet[str]) -> Markup:
    """Return a page of Markdown as HTML.

    Parameters
    ----------
    pictures : addresses of the pictures in the page, by file name.
    used : takes the names of the pictures that the page shows.
    """
    from markdown_it import MarkdownIt
    from markupsafe import Markup, escape

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")

    def image(self: Any, tokens: Any, number: int, options: Any, env: Any) -> str:
        name = str(tokens[number].attrGet("src") or "")
        alt = escape(tokens[number].content)
        if name not in pictures:
            return f'<span class="note">[{alt}]</span>'
        used.add(name)
        return f'<img src="{escape(pictures[name])}" alt="{alt}">'

    def opened(self: Any, tokens: Any, number: int, options: Any, env: Any) -> str:
        target = str(tokens[number].attrGet("href") or "")
        if not target.startswith(("https://", "http://")):
            return "<span>"
        return f'<a rel="noreferrer" href="{escape(target)}">'

    def closed(self: Any, tokens: Any, number: int, options: Any, env: Any) -> str:
        depth = 0
        for token in reversed(tokens[:number]):
            depth += {"link_close": 1, "link_open": -1}.get(token.type, 0)
            if depth < 0:
                target = str(token.attrGet("href") or "")
                return "</a>" if target.startswith(("https://", "http://")) else "</span>"
        return "</span>"

    parser.add_render_rule("image", image)
    parser.add_render_rule("link_open", opened)
    parser.add_render_rule("link_close", closed)
    html = parser.render(text)
    # wide tables scroll by themselves, not the page
    html = html.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return Markup(html)
