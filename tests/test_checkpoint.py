"""Which code kept answers depend on."""

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
    for name in ("fem/accuracy.py", "fem/solvers/accuracy.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("a = 1\n")
    monkeypatch.setattr(checkpoint, "ROOT", tmp_path)
    assert checkpoint.modules("fem", apart=["fem/accuracy.py"]) == [tmp_path / "fem/solvers/accuracy.py"]
