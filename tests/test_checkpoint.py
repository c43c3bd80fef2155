"""Which code kept answers depend on."""

import json
from pathlib import Path

from studies.output import checkpoint


def test_a_digest_of_packages_covers_their_sub_packages(tmp_path, monkeypatch):
    """An edit of a solver, however deep its folder, must void what it solved before."""
    solver = tmp_path / "fem" / "solvers" / "newton.py"
    solver.parent.mkdir(parents=True)
    (tmp_path / "fem" / "stability.py").write_text("a = 1\n")
    solver.write_text("b = 1\n")
    monkeypatch.setattr(checkpoint, "ROOT", tmp_path)
    before = checkpoint.digest(checkpoint.modules("fem"))
    solver.write_text("b = 2\n")
    assert checkpoint.digest(checkpoint.modules("fem")) != before


def test_the_packages_of_the_product_are_found():
    names = {Path(file).name for file in checkpoint.modules("geometry", "fem")}
    assert {"newton.py", "section.py", "design.py"} <= names


def test_a_module_is_left_out_by_its_path_and_not_by_its_name(tmp_path, monkeypatch):
    for name in ("fem/accuracy.py", "fem/solve/accuracy.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("a = 1\n")
    monkeypatch.setattr(checkpoint, "ROOT", tmp_path)
    assert checkpoint.modules("fem", apart=["fem/accuracy.py"]) == [tmp_path / "fem/solve/accuracy.py"]


def test_a_result_keeps_the_commit_that_computed_it(tmp_path, monkeypatch):
    file = tmp_path / "solves.jsonl"
    monkeypatch.setattr(checkpoint, "commit", lambda: "abc")
    checkpoint.opened(file, "code").keep("a", 1.0)
    monkeypatch.setattr(checkpoint, "commit", lambda: "def")
    resumed = checkpoint.opened(file, "code")
    resumed.keep("b", 2.0)
    assert resumed.commits == {"a": "abc", "b": "def"}
    assert resumed.commits_of(["a", "b", "c"]) == "abc - def"
    assert checkpoint.solved_at(resumed.commits.values()) == "Computed at commits abc (1 results), def (1)."


def test_a_line_with_another_commit_than_it_was_written_with_is_damaged(tmp_path):
    file = tmp_path / "solves.jsonl"
    checkpoint.opened(file, "code").keep("a", 1.0)
    line = json.loads(file.read_text("utf-8"))
    file.write_text(json.dumps(line | {"commit": "other"}) + "\n", "utf-8")
    assert not checkpoint.opened(file, "code").known
