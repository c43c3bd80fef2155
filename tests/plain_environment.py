"""Make an environment without the extras: `python tests/plain_environment.py FOLDER`.

It holds links to the packages of the environment that runs this which magtip needs without an extra, and pytest: the
same versions, in a second. What an extra brings is not there.
"""

import re
import sys
import venv
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

TESTS = ("pytest", "pytest-timeout")


def needed(names):
    """Distributions by their names: these, and all that they need."""
    found, waiting = {}, [Requirement(name) for name in names]
    while waiting:
        requirement = waiting.pop()
        extras = {"", *requirement.extras}
        known = found.setdefault(re.sub(r"[-_.]+", "-", requirement.name).lower(), set())
        if not extras <= known:
            known |= extras
            for text in metadata.requires(requirement.name) or []:
                other = Requirement(text)
                if other.marker is None or any(other.marker.evaluate({"extra": extra}) for extra in extras):
                    waiting.append(other)
    return found


def make(folder, names=("magtip", *TESTS), without=()):
    """Make an environment of what these need, without some of it."""
    venv.create(folder, clear=True, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for name in needed(names).keys() - set(without):
        files = metadata.files(name) or []
        for top in {file.parts[0] for file in files} - {"..", "__pycache__"}:
            link = packages / top
            if not link.exists():
                link.symlink_to(metadata.distribution(name).locate_file(top))


if __name__ == "__main__":
    make(Path(sys.argv[1]))
