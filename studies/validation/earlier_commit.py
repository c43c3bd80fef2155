"""The packages of the commit with which the bench compares the speed of today's: unpacked from git."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import subprocess
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from fem.solve.pardiso import have_pardiso
from geometry.design import BadInput
from studies.output.provenance import ROOT

COMMIT = "f83a532"
"""The commit, before functions of the finite elements and of the mesher were compiled."""
PACKAGES = ("geometry", "fem", "analytic")


def check_solver() -> None:
    """Refuse a comparison of two solvers: the commit finds PARDISO by the package pypardiso only.

    Raises
    ------
    BadInput
        magtip has PARDISO, and pypardiso is not installed.
    """
    if have_pardiso() and importlib.util.find_spec("pypardiso") is None:
        raise BadInput(
            f"the comparison with commit {COMMIT} is left out: it finds PARDISO by the package pypardiso only, and "
            "would use a slower solver without it; install pypardiso beside magtip"
        )


@contextlib.contextmanager
def unpacked(commit: str, repository: Path = ROOT) -> Iterator[Path]:
    """Unpack the packages of a commit into a temporary folder, for PYTHONPATH.

    Raises
    ------
    BadInput
        The repository's folder is no git repository, or does not have the commit.
    """
    command = ["git", "-C", str(repository), "archive", "--format=tar", commit, *PACKAGES]
    try:
        ended = subprocess.run(command, capture_output=True, check=False)
    except OSError as error:
        raise BadInput(f"the comparison with commit {commit} needs git, which does not start: {error}") from error
    if ended.returncode:
        reason = ended.stderr.decode(errors="replace").strip() or f"exit status {ended.returncode}"
        raise BadInput(
            f"the comparison with commit {commit} is left out: git cannot read it in {repository} ({reason}); "
            "run bench in a clone of the repository with its whole history"
        )
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(ended.stdout)) as archive:
            archive.extractall(folder, filter="data")
        yield Path(folder)
