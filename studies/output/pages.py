"""Pages in Markdown: the words of a study are a template (Jinja2) beside its code."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any

from studies.output.markdown_tables import markdown


def rendered(template: Path, **values: Any) -> str:
    """Return the text of a template; at most one empty line stands between two paragraphs.

    Its filters are `table`, which returns rows as a Markdown table, and `f`, which formats as Python does.
    """
    text = _environment(template.parent).get_template(template.name).render(values)
    return re.sub(r"\n{3,}", "\n\n", text).strip()


@functools.cache
def _environment(folder: Path) -> Any:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"table": markdown, "f": format}
    return environment
