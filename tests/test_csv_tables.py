"""Records as CSV: the text that pandas writes."""

import math

import pandas as pd
import pytest

from studies.output.csv_tables import write_table

ROWS = [
    {"depth_mm": 0.1, "solve": 1, "ok": True, "message": "", "number": 7},
    {"depth_mm": math.nan, "solve": 2, "ok": False, "message": 'a "b", c', "mixed": "text"},
    {"depth_mm": -1e-7, "solve": 3, "ok": True, "message": None, "mixed": 1.23456789, "number": 12345678},
]


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], []])
@pytest.mark.parametrize("digits", [3, 6, 12])
def test_text_is_what_pandas_writes(tmp_path, rows, digits):
    write_table(tmp_path / "t.csv", iter(rows), digits=digits)
    expected = pd.DataFrame(rows).to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n")
    assert (tmp_path / "t.csv").read_bytes() == expected.encode()
