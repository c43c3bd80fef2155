import json

import pytest

from studies.output import run_record


def test_record_comes_back(tmp_path):
    run_record.write(tmp_path, "magtip compare paper", {"D": 8.0}, "on Python 3.12")
    run = run_record.read(tmp_path / run_record.NAME)
    assert run == run_record.Run(
        "magtip compare paper", "Made with `magtip compare paper`, on Python 3.12.", {"D": 8.0}
    )


def test_newer_format_is_refused(tmp_path, refused):
    (tmp_path / "run.json").write_text(json.dumps({"format": 2, "command": "", "made": "", "design": {}}))
    with refused("format 2", "newer"):
        run_record.read(tmp_path / "run.json")


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"format": 1, "command": "", "made": "", "design": 5}', "[" * 9999]
)
def test_other_files_are_refused(tmp_path, refused, text):
    (tmp_path / "run.json").write_text(text)
    with refused("run.json", "no record"):
        run_record.read(tmp_path / "run.json")
