"""Functions that numba compiles."""

import os
import re
import subprocess
import sys

import pytest

from geometry import compiled

SCRIPT = """
from geometry.compiled import compiled
from numba.core import event

@compiled
def half(x):
    return x / 2

print(half(0.0) / half(3.0), half.stats.cache_path)
"""


@pytest.mark.parametrize(("numba", "openmp", "count"), [("", "2", 2), ("3", "4", 3), ("16", "no", 8), ("0", "", 8)])
def test_threads_are_the_cores_or_fewer_if_the_environment_says_so(monkeypatch, numba, openmp, count):
    monkeypatch.setattr(compiled, "cores", lambda: 8)
    monkeypatch.setenv("NUMBA_NUM_THREADS", numba)
    monkeypatch.setenv("OMP_NUM_THREADS", openmp)
    assert compiled.threads() == count


def test_without_a_writable_folder_functions_are_compiled_by_each_process(tmp_path):
    script, blocked = tmp_path / "script.py", tmp_path / "file"
    script.write_text(SCRIPT)
    blocked.write_text("")
    # numba finds no place for its files: it looks only in the folder that the first variable names
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(blocked / "inside"),
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, env=environment, check=True)
    assert run.stdout.split() == ["0.0", "None"]


def test_every_compiled_source_is_in_the_digest():
    """Else a change in one file would leave machine code of the old one in the files of its callers."""
    from analytic.cylinder import compiled_functions
    from analytic.inverse import forward_model, joint_poses, pose_search, response_surface
    from fem.model import element_assembly, material, viscoelasticity

    modules = (
        compiled_functions(),
        forward_model,
        joint_poses,
        pose_search,
        response_surface,
        element_assembly,
        material,
        viscoelasticity,
    )
    functions = [value for module in modules for value in vars(module).values() if hasattr(value, "py_func")]
    assert len(functions) > 20
    files = {os.path.realpath(function.py_func.__code__.co_filename) for function in functions}
    assert files <= {os.path.realpath(file) for file in compiled.sources()}
    # their constants are frozen into the machine code
    read = {
        (vars(sys.modules[function.__module__])[name], name)
        for function in functions
        for name in function.py_func.__code__.co_names
        if isinstance(vars(sys.modules[function.__module__]).get(name), int | float)
    }
    defined = "\n".join(file.read_text() for file in compiled.sources())
    assert [name for _, name in read if not re.search(rf"^[A-Z_, ]*\b{name}\b.* = ", defined, re.MULTILINE)] == []
    assert all(function.py_func.__qualname__.endswith(compiled._digest()) for function in functions)
