"""Files are read within bounds: one without an end, a packed one, a deep one or one of long digits is a sentence."""

import gzip
import json
import struct
import time
import zlib
from pathlib import Path

import pytest

from geometry.design import BadInput, paper
from studies.calibration import bench_file
from studies.inputs import table_input, units, user_input
from studies.output import bounded_files, own_files, provenance
from studies.parts.requirements import read_requirements
from studies.web import folder_contents, page_content

DEEP = '{"a":' * 100_000


@pytest.mark.parametrize(
    "read",
    [
        lambda path: user_input.read_design(str(path)),
        lambda path: read_requirements(str(path)),
        lambda path: table_input.csv_rows(path),
        lambda path: next(table_input.json_objects(path)),
        lambda path: bounded_files.json_object(path),
    ],
)
def test_a_file_without_an_end_is_refused_after_its_limit(read, refused):
    with refused("/dev/zero", "MB, the most that is read"):
        read(Path("/dev/zero"))


def test_a_packed_file_counts_unpacked(tmp_path, refused, monkeypatch):
    monkeypatch.setattr(bounded_files, "MOST_BYTES", 1000)
    file = tmp_path / "table.csv.gz"
    file.write_bytes(gzip.compress(b"1,2,3\n" * 10_000))
    assert file.stat().st_size < 1000
    with pytest.raises(BadInput, match=r"the most that is read"):
        bounded_files.bytes_of(file, bounded_files.MOST_BYTES)


def test_rows_are_counted(tmp_path, refused, monkeypatch):
    monkeypatch.setattr(table_input, "MOST_ROWS", 5)
    file = tmp_path / "table.csv"
    file.write_text("a\n" + "1\n" * 4)
    assert len(table_input.csv_rows(file)) == 5
    file.write_text("a\n" + "1\n" * 6)
    with refused("has more than 5 rows"):
        table_input.csv_rows(file)
    file.write_text("{}\n" * 6)
    with refused("has more than 5 rows"):
        list(table_input.json_objects(file))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (DEEP, "nested more than 50 deep"),
        ('{"a": ' + "[" * 60 + "]" * 60 + "}", "nested more than 50 deep"),
        ('{"a": ' + "9" * 5000 + "}", "whole number of more than 19 digits"),
        ('{"a": 9223372036854775808}', "whole number of more than 19 digits"),
        ("{", "is not JSON"),
        ("[1]", "holds no JSON object"),
    ],
)
def test_objects_of_json_are_bounded(tmp_path, text, words, refused):
    (tmp_path / "run.json").write_text(text)
    with refused(words):
        bounded_files.json_object(tmp_path / "run.json")
    with refused("run.json is no record of a run"):
        provenance.read(tmp_path / "run.json")


def test_what_is_allowed_is_read_as_it_is(tmp_path):
    record = {"a": [[1, -(2**63) + 1, 1.5e300, True, None]], "b": {"c": {"d": "x[{" * 100}}}
    (tmp_path / "a.json").write_text(json.dumps(record))
    assert bounded_files.json_object(tmp_path / "a.json") == record
    table = {"a": 1, "b": [1.5, 2.0], "c": {"d": "0.05:0.01 " * 50}}
    assert bounded_files.toml_in('a = 1\nb = [1.5, 2.0]\nc.d = "' + "0.05:0.01 " * 50 + '" # ' + "." * 500) == table


def test_a_deep_line_of_a_list_of_files_lists_nothing(tmp_path):
    entry = json.dumps({"file": "a.csv", "sha256": "0"})
    (tmp_path / own_files.LIST).write_text(f"{DEEP}\n{entry}\n{'9' * 5000}\n[]\n")
    (tmp_path / "a.csv").write_text("mine")
    with pytest.raises(BadInput, match="was changed after magtip had written it"):
        own_files.check(tmp_path, ["a.csv"])


@pytest.mark.parametrize("text", ["1e300", "-1e31", "1e999"])
def test_numbers_whose_powers_are_none_are_refused(tmp_path, text, refused):
    table = tmp_path / "table.csv"
    table.write_text(f"force_N\n1\n{text}\n")
    with refused("line 3, column force_N: must be a finite number"):
        table_input.Measured(table).numbers("force_N")
    lines = tmp_path / "states.jsonl"
    lines.write_text(f'{{"a": {text}}}\n')
    with refused("line 1 has a number"):
        list(table_input.json_objects(lines))
    if "999" not in text:
        with refused("has a number beyond 1e\\+30"):
            folder_contents.csv_table(table)


def test_a_long_head_or_unit_takes_no_time(tmp_path, refused):
    blanks = " " * 60_000
    begin = time.process_time()
    assert table_input.split_head(f"S1{blanks}({blanks}V{blanks})") == ("S1", "V")
    assert table_input.split_head(f"S1 ({blanks}") == ("S1 (", "")
    with refused("is no unit for it"):
        units.quantity("force_z", f"5{blanks}x{blanks}y", "N")
    file = tmp_path / "run.csv"
    file.write_text(f"S1{blanks}x\n1\n")
    with refused("."):
        bench_file.read([file], paper())
    assert time.process_time() - begin < 5


def test_a_picture_of_too_many_pixels_is_named_and_left_out(tmp_path):
    parts = (
        b"IHDR" + struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0),
        b"IDAT" + zlib.compress(bytes(99)),
        b"IEND",
    )
    chunks = (struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
    (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    contents = folder_contents.Contents(tmp_path, "", pictures=["bomb.png"])
    remarks: list[str] = []
    assert page_content.sources(contents, set(), 10**6, remarks) == {}
    assert "bomb.png was not read: it is no picture (Image size (3600000000 pixels)" in remarks[0]
