"""Pages in Markdown: the words of a study are a template (Jinja2) beside its code."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from studies.output import literals
from studies.output.text_tables import cell, markdown
from studies.quantities import UNITS, shown


def rendered(template: Path, **values: Any) -> str:
    """Return the text of a template; at most one empty line stands between two paragraphs."""
    text = _environment(template.parent).get_template(template.name).render(values)
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def sentences(template: Path, part: str, **values: Any) -> list[str]:
    """Return the items of the list that a block of a template makes, each on one line."""
    found = _environment(template.parent).get_template(template.name)
    text = "".join(found.blocks[part](found.new_context(values)))
    return [" ".join(item.split()) for item in re.split(r"^-\s", text, flags=re.MULTILINE)[1:]]


def filled(text: str, **values: Any) -> str:
    """Return a template's text with these values."""
    return str(_environment(Path(__file__).parent).from_string(text).render(values))


def sentence(text: str) -> str:
    """Return a text that begins with a capital letter, unless its first word is a name such as outer_size or l0.

    >>> sentence("the plate slips"), sentence("outer_size must exceed D"), sentence("l0 is small")
    ('The plate slips', 'outer_size must exceed D', 'l0 is small')
    """
    return text[:1].upper() + text[1:] if re.match(r"[a-z]+(-[a-z]+)*[,:;.]?(\s|$)", text) else text


def listed(lines: Iterable[str], nothing: str = "None.") -> str:
    """Return lines as a list, each once, or the text for none."""
    return "\n".join(f"- {line}" for line in dict.fromkeys(lines)) or nothing


@functools.cache
def _environment(folder: Path) -> Any:
    """Return the templates, with the filters `table`, `cell`, `listed`, `sentence`, `shown` of a number with unit,
    `f`, which formats as Python does, and for a user's texts `md`, `code` (of Markdown) and `comment` (of C).

    A template of HTML escapes by itself.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(["html.j2"], default_for_string=False),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "table": functools.partial(markdown, nothing="None."),
        "cell": cell,
        "listed": listed,
        "sentence": sentence,
        "shown": shown,
        "f": format,
        "md": literals.in_markdown,
        "code": literals.as_code,
        "comment": literals.in_comment,
    }
    environment.globals["UNITS"] = UNITS
    environment.tests["finite"] = math.isfinite
    return environment
