"""Tables of records as CSV files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from studies.output import table_files


def write_table(path: Path, rows: Iterable[Mapping[str, Any]], digits: int = 6) -> None:
    """Write rows as CSV with a header; `digits` are significant, and a missing value is an empty cell."""
    import pandas as pd

    frame = pd.DataFrame(list(rows))
    with table_files.writer(path, digits=digits) as write:
        write({name: frame[name].to_numpy() for name in frame})
