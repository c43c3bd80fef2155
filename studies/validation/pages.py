"""Tables and pages of the studies of validation: one writer for all of them, words in `templates`."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.output.atomic_files import write_text
from studies.output.provenance import made

Row = dict[str, Any]
"""A row of a table: values by the names of their columns, with units."""
TEMPLATES = Path(__file__).parent / "templates"


def markdown(rows: Sequence[Mapping[str, Any]], heads: Mapping[str, str] | None = None, digits: int = 3) -> str:
    """Return a Markdown table of rows.

    Parameters
    ----------
    heads : columns that are shown, in order, with their heads; default: all columns of the first row.
    digits : significant digits of floats.

    >>> print(markdown([{"tip": "free", "E_MPa": 0.59871, "met": True}, {"tip": "held", "E_MPa": None}]))
    | tip | E_MPa | met |
    |---|---|---|
    | free | 0.599 | yes |
    | held |  |  |
    """
    if not rows:
        return "None."
    heads = heads or {name: name for name in rows[0]}
    lines = [list(heads.values()), *([cell(row.get(name), digits) for name in heads] for row in rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in lines)
    return "\n".join([first, f"|{'---|' * len(heads)}", *rest])


def cell(value: Any, digits: int = 3) -> str:
    """Return a value as a cell: no number is empty, a missed yes or no is bold."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value).replace("|B|", "\\|B\\|")


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
    environment.filters |= {"table": markdown, "cell": cell, "listed": listed, "f": format}
    return environment


def failed(names: Sequence[str], count: int, what: str, between: str = "; ") -> list[str]:
    """Return the sentence that names what failed of `count` rows, for `Result.failures`; nothing if none failed."""
    return [f"{len(names)} of {count} {what}: {between.join(names)}"] if names else []


def write(path: Path, blocks: Iterable[str], command: str, origin: str) -> None:
    """Write the blocks of a page, without the empty ones, and its origin."""
    write_text(
        path, "\n\n".join([*(block.strip() for block in blocks if block.strip()), made(command, origin)]) + "\n"
    )
