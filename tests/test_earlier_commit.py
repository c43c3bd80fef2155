"""The packages of an earlier commit, unpacked from git."""

import importlib.util
import subprocess

import pytest

from geometry.design import BadInput
from studies.output.provenance import ROOT
from studies.validation import earlier_commit


def test_the_packages_of_a_commit_are_unpacked():
    if subprocess.run(["git", "-C", str(ROOT), "rev-parse", "HEAD"], capture_output=True, check=False).returncode:
        pytest.skip("this is no clone of the repository")
    with earlier_commit.unpacked("HEAD") as folder:
        assert {path.name for path in folder.iterdir()} == set(earlier_commit.PACKAGES)
        assert (folder / "fem" / "equilibrium.py").is_file()
    assert not folder.exists()


def test_without_a_repository_or_the_commit_one_sentence_says_so(tmp_path):
    for commit, repository in (("HEAD", tmp_path), ("no-such-commit", ROOT)):
        with (
            pytest.raises(BadInput, match=f"commit {commit} is left out: git cannot read it in .*whole history"),
            earlier_commit.unpacked(commit, repository),
        ):
            pass


def test_another_solver_is_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(earlier_commit, "have_pardiso", lambda: True)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(BadInput, match="is left out: it finds PARDISO by the package pypardiso only"):
        earlier_commit.check_solver()


def test_one_solver_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(earlier_commit, "have_pardiso", lambda: False)
    earlier_commit.check_solver()
