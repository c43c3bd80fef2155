"""Contents of pages as the browser takes them: answers as JSON, Markdown of studies as HTML, pictures as addresses.

Markdown is rendered without the HTML that it may contain, and relative links, which would lead out of the page, stay
as their text. Pictures are made smaller so that a report stays small.
"""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable, Mapping, MutableSet
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output import figures, page_templates
from studies.output.bounded_files import bytes_of
from studies.web.panels import PANELS

if TYPE_CHECKING:
    from markupsafe import Markup

    from studies.web.folder_contents import Contents

PAGE = Path(__file__).parent / "page"
"""Files of the pages."""


def as_json(message: Any, array: Callable[[Any], Any] | None = None) -> str:
    """Return a message as JSON; numbers that are not finite become null, and arrays what `array` makes of them."""
    array = array or packed
    try:
        return json.dumps(message, allow_nan=False, separators=(",", ":"), default=array)
    except ValueError:
        return json.dumps(_finite(message), separators=(",", ":"), default=array)


def packed(array: Any) -> dict[str, str]:
    """Return an array as `Format.unpacked` in the page reads it: digits would take 20 times as long.

    >>> packed(np.array([1.0, 0.5])), packed(np.array([1, 2]))
    ({'float32': 'AACAPwAAAD8='}, {'uint16': 'AQACAA=='})
    """
    if not isinstance(array, np.ndarray):
        raise TypeError(f"an answer has no {type(array).__name__}")
    kind, name = "<f4", "float32"
    if array.dtype.kind in "iu":
        kind, name = ("<u2", "uint16") if array.size == 0 or array.max() < 1 << 16 else ("<u4", "uint32")
    return {name: base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode("ascii")}


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if value - value == 0 else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, (list, tuple)) else value


def explorer_page(*, offline: bool = False, of_array: bool = False) -> str:
    """Return the HTML of the live page, or of the one without a server, with its panels."""
    panels = [panel for panel in PANELS if (panel.offline or not offline) and (of_array or not panel.of_array)]
    return page_templates.rendered(PAGE / "index.html.j2", panels=panels)


def page_charts() -> dict[str, Any]:
    """Return the descriptions of the live page's figures, and the theme of all figures."""
    charts: dict[str, Any] = json.loads((PAGE / "charts.json").read_text("utf-8"))
    return charts | {"theme": page_theme()}


def page_theme() -> dict[str, Any]:
    """Return the theme of the figures with the colours of the page, which change with its own theme."""
    soft, ink = {"labelColor": "var(--soft)"}, {"titleColor": "var(--ink)"}
    own: dict[str, Any] = {
        "background": None,
        "range": {"category": [f"var(--s{k})" for k in range(len(figures.COLOURS))]},
        "axis": soft | ink | {"gridColor": "var(--grid)", "tickColor": "var(--soft)"},
        "legend": {"labelColor": "var(--ink)", "titleColor": "var(--soft)"},
        "header": {"labelColor": "var(--ink)"},
        "view": {"stroke": "var(--soft)"},
        "line": {"color": "var(--s0)"},
        "point": {"color": "var(--s0)"},
        "style": {
            "guide": {"color": "var(--soft)"},
            "guide-label": {"color": "var(--soft)"},
            "band": {"color": "var(--ink)"},
            "label": {"color": "var(--ink)"},
            "failed": {"color": "var(--soft)"},
        },
    }
    return _merged(figures.THEME, own)


def _merged(base: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested mappings with the values of the second one where it has some."""
    parts = {
        key: _merged(base.get(key, {}), value) if isinstance(value, Mapping) else value
        for key, value in other.items()
    }
    return {**base, **parts}


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
    tokens, links = parser.parse(text), list[str]()
    for token in (child for block in tokens for child in block.children or ()):
        if token.type == "link_open":
            target = str(token.attrs["href"])
            outer = target.startswith(("https://", "http://"))
            token.tag, token.attrs = ("a", {"rel": "noreferrer", "href": target}) if outer else ("span", {})
            links.append(token.tag)
        elif token.type == "link_close":
            token.tag = links.pop()
        elif token.type == "image":
            name, alt = str(token.attrs["src"]), escape(token.content)
            if name in pictures:
                used.add(name)
            shown = f'<img src="{escape(pictures[name])}" alt="{alt}">' if name in pictures else ""
            token.type, token.content = "html_inline", shown or f'<span class="note">[{alt}]</span>'
    html = parser.renderer.render(tokens, parser.options, {})
    # wide tables scroll by themselves, not the page
    html = html.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return Markup(html)


WIDTH = 1100
"""Width of a picture in the page, pixels: that of the text on a screen with some reserve."""
COLOURS = 64
MOST_PICTURE = 20_000_000
"""Largest file of a picture, bytes."""


def sources(contents: Contents, replaced: set[str], room: int, remarks: list[str]) -> dict[str, str]:
    """Return the addresses (data:) of a folder's pictures by file name, without those that a figure replaces.

    Pictures that cannot be read, or for which there is no room, bytes, are named in `remarks`.
    """
    from PIL import Image

    result: dict[str, str] = {}
    for name in contents.pictures:
        if name in replaced:
            continue
        try:
            source = _source(contents.path / name)
        # Pillow raises other errors than OSError for some damaged files, and its own for one of too many pixels
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            remarks.append(f"{name} was not read: it is no picture ({str(error).splitlines()[0]}).")
            continue
        if len(source) + sum(map(len, result.values())) > room:
            remarks.append(f"{name} is not shown: the page would become too large.")
            continue
        result[name] = source
    return result


def _source(path: Path) -> str:
    """Return a picture as an address; one of pixels gets fewer of them, and fewer colours."""
    if path.suffix.lower() == ".svg":
        # as an image, an SVG file runs no script and loads nothing
        return f"data:image/svg+xml;base64,{base64.b64encode(bytes_of(path, MOST_PICTURE)).decode()}"
    from PIL import Image

    with Image.open(path) as picture:
        whole = picture.convert("RGBA")
    plain = Image.new("RGB", whole.size, "white")
    plain.paste(whole, mask=whole.getchannel("A"))
    if plain.width > WIDTH:
        plain = plain.resize((WIDTH, round(plain.height * WIDTH / plain.width)), Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    plain.quantize(COLOURS, dither=Image.Dither.NONE).save(stream, "PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
