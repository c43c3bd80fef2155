"""A source distribution is built, a wheel from it, and the wheel runs where nothing of the project was installed."""

import subprocess
import sys
import tarfile
from importlib import metadata
from pathlib import Path

import plain_environment

ROOT = Path(__file__).resolve().parent.parent


def ran(*words, cwd):
    done = subprocess.run(list(map(str, words)), cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_of_a_source_distribution_runs_in_an_empty_environment(tmp_path):
    """With the packages that it asks for and no extra; a preset shows its data files."""
    ran(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path, cwd=ROOT)
    (source,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    ran(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=tmp_path / source.name[:-7])
    (wheel,) = tmp_path.glob("*.whl")
    empty = tmp_path / "empty"
    plain_environment.make(empty, ["magtip"], without=["magtip"])
    python, pip = empty / "bin" / "python", [sys.executable, "-m", "pip", "--python", empty / "bin" / "python"]
    ran(*pip, "install", "-q", "--no-deps", "--no-index", "--no-compile", wheel, cwd=tmp_path)
    assert ran(empty / "bin" / "magtip", "--version", cwd=tmp_path).strip() == metadata.version("magtip")
    tried = 'import magtip; print(magtip.__file__, magtip.preset("fingertip").D, magtip.Load(depth=1.0).depth)'
    where, *values = ran(python, "-c", tried, cwd=tmp_path).split()
    assert Path(where).is_relative_to(empty)
    assert values == ["6.4", "1.0"]
