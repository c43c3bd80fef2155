import json

import numpy as np
import pytest

from studies.web import folder_contents


def test_files_are_read_by_their_kind(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "t.csv").write_text("x,name,good\n1,one,True\n,two,False\n")
    (tmp_path / "a" / "PAGE.md").write_text("# Title\n")
    (tmp_path / "a" / "design.toml").write_text("D = 10\nL = 12\n")
    (tmp_path / "a" / "cup.png").write_bytes(b"")
    (tmp_path / "a" / "beam.stl").write_bytes(b"")
    (tmp_path / "a" / ".hidden.csv").write_text("x\n")
    root, folder = [*folder_contents.read(tmp_path), None][:2]
    assert root.name == "a"
    assert folder is None
    table = root.tables["t.csv"]
    assert len(table) == 2
    np.testing.assert_array_equal(table.frame["x"], [1, np.nan])
    assert table.frame["good"].tolist() == ["True", "False"]
    assert root.designs["design.toml"].D == 10
    assert root.pictures == ["cup.png"]
    assert list(root.pages) == ["PAGE.md"]
    assert root.unread == []


def test_states_become_a_table(tmp_path):
    state = {"depth_mm": 1.0, "status": "ok", "force_N": [0.0, 0.0, 4.2], "shift_mm": [0, 0, -0.3], "stop": None}
    (tmp_path / "states.jsonl").write_text(json.dumps(state) + "\n")
    (folder,) = folder_contents.read(tmp_path)
    assert folder.tables["states.jsonl"].frame["force_z_N"].tolist() == [4.2]
    assert folder.tables["states.jsonl"].frame["shift_z_mm"].tolist() == [-0.3]


def test_parquet_table_is_read(tmp_path):
    import pandas as pd

    pd.DataFrame({"D_mm": [6.0, 8.0], "status": ["ok", "ok"]}).to_parquet(tmp_path / "sweep.parquet")
    (folder,) = folder_contents.read(tmp_path)
    np.testing.assert_array_equal(folder.tables["sweep.parquet"].frame["D_mm"], [6, 8])
    assert folder.tables["sweep.parquet"].ok.all()


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("t.csv", "a,b\n1\n", "1 values for 2 columns"),
        ("t.csv", "a;b\n1;2\n", "semicolons"),
        ("t.csv", "", "empty"),
        ("t.json", "{", "is not JSON"),
        ("t.json", "[1]", "no JSON object"),
        ("t.toml", "depth_of_field = 3", "depth_of_field"),
        ("t.parquet", "no", "no Parquet table"),
        ("t.jsonl", "no", "is not JSON"),
        ("t.xyz", "no", "'.xyz'"),
        ("run.json", "{}", "no record"),
    ],
)
def test_what_is_not_read_is_named_in_one_sentence(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    (tmp_path / "good.md").write_text("Made with `magtip demo`\n")
    (folder,) = folder_contents.read(tmp_path)
    (sentence,) = folder.unread
    assert sentence.startswith(name)
    assert reason in sentence
    assert "\n" not in sentence


def test_many_folders_are_refused(tmp_path, refused, monkeypatch):
    monkeypatch.setattr(folder_contents, "MOST_FOLDERS", 3)
    for k in range(4):
        (tmp_path / str(k)).mkdir()
    with refused("more than 3 sub-folders"):
        folder_contents.read(tmp_path)


def test_version_counts_only_in_files_of_magtip(tmp_path, refused):
    (tmp_path / "package.json").write_text('{"version": 9}')
    assert folder_contents.read(tmp_path)[0].records == {"package.json": {"version": 9}}
    (tmp_path / "sizing.json").write_text('{"version": 9}')
    with refused("sizing.json", "format 9", "newer"):
        folder_contents.read(tmp_path)
