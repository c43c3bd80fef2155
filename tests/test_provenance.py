"""Which commit and which versions a result names."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studies.output import provenance

NAME = ("-c", "user.name=a", "-c", "user.email=a@b.invalid")
PROJECT = '[project]\nname = "{}"\n'


def git(folder, *words):
    return subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


def copied(folder):
    """A copy of the module's package below a folder."""
    package = folder / "studies"
    shutil.copytree(Path(provenance.__file__).parent, package / "output")
    (package / "__init__.py").touch()
    return package


def commit_of(package):
    code = "from studies.output.provenance import commit; print(commit())"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": PATH, "PYTHONPATH": str(provenance.ROOT)},
    )
    return ended.stdout.strip()


PATH = str(Path(shutil.which("git") or "").parent)


@pytest.fixture
def repository(tmp_path):
    """A repository with one commit."""
    git(tmp_path, "init", "-q")
    (tmp_path / "pyproject.toml").write_text(PROJECT.format("theirs"))
    git(tmp_path, "add", "-A")
    git(tmp_path, *NAME, "commit", "-qm", "one")
    return tmp_path


def test_an_installed_copy_inside_another_repository_names_no_commit(repository):
    assert commit_of(copied(repository / "venv" / "site-packages")) == "None"


def test_a_copy_at_the_top_of_another_repository_names_no_commit(repository):
    package = copied(repository)
    git(repository, "add", "-A")
    git(repository, *NAME, "commit", "-qm", "two")
    assert commit_of(package) == "None"


def test_a_copy_that_its_repository_does_not_hold_names_no_commit(repository):
    (repository / "pyproject.toml").write_text(PROJECT.format("magtip"))
    assert commit_of(copied(repository)) == "None"


def test_a_checkout_of_the_project_names_its_commit_and_whether_it_was_changed(repository):
    package = copied(repository)
    (repository / "pyproject.toml").write_text(PROJECT.format("magtip"))
    git(repository, "add", "-A")
    git(repository, *NAME, "commit", "-qm", "two")
    head = git(repository, "rev-parse", "--short", "HEAD")
    assert commit_of(package) == head
    (repository / "README.md").write_text("not a source of results")
    git(repository, "add", "README.md")
    assert commit_of(package) == head
    (package / "__init__.py").write_text("changed = True\n")
    assert commit_of(package) == f"{head}-dirty"


def test_versions_leave_out_what_is_not_installed():
    text = provenance.versions(["numba-that-nobody-has", "altair"])
    assert text.startswith("on Python 3.")
    assert "nobody" not in text
    assert ", altair " in text
