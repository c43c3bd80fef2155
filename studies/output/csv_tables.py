"""Tables as CSV files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from studies.output.atomic_files import atomic


def write_table(path: Path, rows: Iterable[Mapping[str, Any]], digits: int = 6) -> None:
    """Write rows as CSV with a header; `digits` are significant, and a missing value is an empty cell."""
    import pandas as pd

    with atomic(path) as temporary:
        pd.DataFrame(list(rows)).to_csv(temporary, index=False, float_format=f"%.{digits}g", lineterminator="\n")
