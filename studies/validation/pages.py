"""Tables and pages of the studies of validation: one writer for all of them, words in `templates`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from geometry.messages import Progress
from studies.output import page_templates
from studies.output.page_templates import filled, listed
from studies.output.result import collected

__all__ = ["Row", "collected", "failed", "filled", "listed", "records", "rendered", "told"]

Case = TypeVar("Case")

Row = dict[str, Any]
"""A row of a table: values by the names of their columns, with units."""
TEMPLATES = Path(__file__).parent / "templates"


def records(table: pd.DataFrame) -> list[Row]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def rendered(template: str, **values: Any) -> str:
    return page_templates.rendered(TEMPLATES / template, **values)


def failed(names: Sequence[str], count: int, what: str, between: str = "; ") -> list[str]:
    """Return the sentence that names what failed of `count` rows, for `Result.failures`; nothing if none failed."""
    return [f"{len(names)} of {count} {what}: {between.join(names)}"] if names else []


def told(progress: Progress, chosen: Sequence[Case], name: Callable[[Case], str]) -> Iterator[Case]:
    """Yield cases; the progress tells each by its name before."""
    for i, case in enumerate(chosen):
        progress(i / len(chosen), name(case))
        yield case
