"""Tables written batch by batch: round trips, missing values, memory, refusals."""

import math
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from geometry.design import BadInput
from studies.output.table_files import ROW_GROUP, write_table, writer

SUFFIXES = (".csv", ".parquet")
MEMORY = """
import resource, sys
import numpy as np
from studies.output.table_files import writer

def table(batches):
    with writer(sys.argv[1]) as write:
        for start in range(batches):
            write({f"x{k}": np.arange(20_000.0) + 0.1 * k + start for k in range(8)} | {"n": np.arange(20_000)})
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

print(table(6), table(16))
"""


def batch(start, count):
    values = np.arange(start, start + count) / 7
    values[::3] = np.nan
    texts = np.array([None if k % 4 else f"row, {k}" for k in range(start, start + count)], dtype=object)
    return {"force_N": values, "solve": np.arange(start, start + count), "ok": values > 1, "message": texts}


def joined(*batches):
    return pd.DataFrame({name: np.concatenate([b[name] for b in batches]) for name in batches[0]})


def written(path, *batches, **options):
    with writer(path, **options) as write:
        for columns in batches:
            write(columns)
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip(tmp_path, suffix):
    batches = batch(0, 5), batch(5, 1), batch(6, 30)
    path = written(tmp_path / f"t{suffix}", *batches, digits=17)
    table = parquet.read_table(path).to_pandas() if suffix == ".parquet" else pd.read_csv(path)
    pd.testing.assert_frame_equal(table, joined(*batches))


def test_csv_is_what_pandas_writes(tmp_path):
    wide = np.array([0.0, -0.0, 1e-300, 123456789.0, np.inf, -np.inf, np.nan, 0.1, 1e6])
    batches = [batch(0, 9) | {"wide": wide, 'a "name", quoted': np.full(9, np.nan)} for _ in range(2)]
    expected = joined(*batches).to_csv(index=False, float_format="%.6g", lineterminator="\n")
    assert written(tmp_path / "t.csv", *batches).read_text(encoding="utf-8") == expected


def test_parquet_stores_null_for_nan(tmp_path):
    table = parquet.read_table(written(tmp_path / "t.parquet", batch(0, 9)))
    assert (table["force_N"].null_count, table["message"].null_count) == (3, 6)


def test_first_batch_of_nan_and_none_only(tmp_path):
    first = {"x": np.full(3, np.nan), "text": np.full(3, None, dtype=object)}
    second = {"x": np.array([1.5, 2.5]), "text": np.array(["a", "b"], dtype=object)}
    table = parquet.read_table(written(tmp_path / "t.parquet", first, second))
    assert table.to_pydict() == {"x": [None, None, None, 1.5, 2.5], "text": [None, None, None, "a", "b"]}


def test_whole_numbers_may_follow_in_a_column_of_floats(tmp_path):
    path = written(tmp_path / "t.parquet", {"x": np.array([np.nan])}, {"x": np.array([3])})
    assert parquet.read_table(path).to_pydict() == {"x": [None, 3.0]}


def test_an_array_may_be_filled_again(tmp_path):
    values = np.zeros(3)
    with writer(tmp_path / "t.parquet") as write:
        for k in range(3):
            values[:] = k
            write({"x": values})
    assert parquet.read_table(tmp_path / "t.parquet")["x"].to_pylist() == [0] * 3 + [1] * 3 + [2] * 3


def test_metadata_and_encoding(tmp_path):
    path = written(tmp_path / "t.parquet", batch(0, 9), about={"command": "magtip sweep"})
    file = parquet.ParquetFile(path)
    assert file.schema_arrow.metadata[b"command"] == b"magtip sweep"
    column = file.metadata.row_group(0).column(3)
    assert (column.path_in_schema, column.compression) == ("message", "ZSTD")
    assert "RLE_DICTIONARY" in column.encodings


def test_small_batches_share_a_group_and_large_ones_are_split(tmp_path):
    small = written(tmp_path / "s.parquet", *[{"x": np.arange(10.0)}] * 20)
    large = written(tmp_path / "l.parquet", {"x": np.arange(2.5 * ROW_GROUP)})
    assert parquet.ParquetFile(small).num_row_groups == 1
    assert parquet.ParquetFile(large).num_row_groups == 3


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_table_without_rows(tmp_path, suffix):
    path = written(tmp_path / f"t{suffix}", {"a": np.zeros(0), "b": np.zeros(0)})
    table = parquet.read_table(path).to_pandas() if suffix == ".parquet" else pd.read_csv(path)
    assert (list(table), len(table)) == (["a", "b"], 0)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_table_without_batches(tmp_path, suffix):
    assert written(tmp_path / f"t{suffix}").exists()


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("columns", [{"x": np.zeros(2), "y": np.zeros(3)}, {"x": np.zeros(2)}])
def test_wrong_batch_leaves_nothing(tmp_path, suffix, columns):
    with pytest.raises((ValueError, KeyError)):
        written(tmp_path / f"t{suffix}", {"x": np.zeros(2), "y": np.ones(2)}, columns)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_exception_keeps_the_file_of_before(tmp_path, suffix):
    path = tmp_path / f"t{suffix}"
    path.write_text("before")
    with pytest.raises((AttributeError, TypeError)):
        written(path, {"x": np.zeros(2)}, None)
    assert path.read_text() == "before"
    assert list(tmp_path.glob("[!.]*")) == [path]


def test_unknown_suffix(tmp_path):
    with pytest.raises(BadInput, match=r"must end in \.csv or \.parquet"), writer(tmp_path / "t.xlsx"):
        pass


def test_memory_does_not_grow_with_the_rows(tmp_path):
    pytest.importorskip("resource")
    run = [sys.executable, "-c", MEMORY, str(tmp_path / "t.parquet")]
    first, last = map(int, subprocess.run(run, capture_output=True, text=True, check=True).stdout.split())
    # the 200 000 rows more of the second table have 14 MB
    assert last - first < 5_000


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
