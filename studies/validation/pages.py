"""Tables and pages of the studies of validation: one writer for all of them, words in `templates`."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from studies.output.text_tables import cell, markdown

Row = dict[str, Any]
"""A row of a table: values by the names of their columns, with units."""
TEMPLATES = Path(__file__).parent / "templates"


def listed(lines: Iterable[str], nothing: str = "None.") -> str:
    """Return lines as a list, each once, or the text for none."""
    return "\n".join(f"- {line}" for line in dict.fromkeys(lines)) or nothing


def rendered(template: str, **values: Any) -> str:
    """Return the text of a file of `templates`; at most one empty line stands between two paragraphs."""
    text = _environment().get_template(template).render(values)
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def filled(text: str, **values: Any) -> str:
    """Return a template's text with these values."""
    return str(_environment().from_string(text).render(values))


@functools.cache
def _environment() -> Any:
    """Return the templates, with the filters `table`, `cell`, `listed`, and `f`, which formats as Python does."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "table": functools.partial(markdown, nothing="None."),
        "cell": cell,
        "listed": listed,
        "f": format,
    }
    return environment


def failed(names: Sequence[str], count: int, what: str, between: str = "; ") -> list[str]:
    """Return the sentence that names what failed of `count` rows, for `Result.failures`; nothing if none failed."""
    return [f"{len(names)} of {count} {what}: {between.join(names)}"] if names else []
