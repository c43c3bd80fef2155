"""Functions that numba compiles."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp

from fem.model.sparse_pattern import Pattern
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
    from analytic.inverse import forward_model, pose_search, response_surface
    from fem.model import element_assembly, material, viscoelasticity

    modules = (
        compiled_functions(),
        forward_model,
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


# The pattern of sparse matrices that are summed from element matrices.


RNG = np.random.default_rng(2)


def test_places_of_entries_are_those_of_the_matrix():
    """Two elements with three nodes of two fields; two fields are eliminated."""
    numbers = np.array([[0, 1], [-1, 2], [3, 4], [5, -1]])
    cells = np.array([[0, 1, 2], [3, 2, 1]])
    pattern = Pattern([(cells, cells)], (numbers >= 0).sum(axis=1))
    places = {}
    for element, cell in enumerate(cells):
        for a, first in enumerate(cell):
            for b, second in enumerate(cell):
                for i in numbers[first][numbers[first] >= 0]:
                    for k in numbers[second][numbers[second] >= i]:
                        place = pattern.diagonal[i] + pattern.offsets[0][element, a, b] + pattern.inside[k]
                        assert places.setdefault((int(i), int(k)), place) == place
    data = np.zeros(pattern.entries)
    for (i, k), place in places.items():
        data[place] = 10 * i + k + 1
    matrix = pattern.with_data(data).toarray()
    assert {(i, k): matrix[i, k] for i, k in places} == {(i, k): 10 * i + k + 1 for i, k in places}
    # every pair of unknowns of an element has a place
    assert np.count_nonzero(matrix) == len(places) == pattern.entries


def test_unsymmetric_matrices_of_the_last_group_are_summed_whole():
    """Both groups couple the same unknowns, as a body and its skin do; one unknown is eliminated."""
    numbers = np.array([[0, 1], [2, -1], [3, 4]])
    cells, facets = np.array([[0, 1, 2]]), np.array([[2, 0], [1, 2]])
    unknowns = numbers[facets].reshape(2, -1)
    pattern = Pattern([(cells, cells), (facets, facets)], (numbers >= 0).sum(axis=1), unknowns)
    S = RNG.normal(size=(2, 4, 4))
    dense = np.zeros((5, 5))
    for own, matrix in zip(unknowns, S, strict=True):
        kept = own >= 0
        dense[np.ix_(own[kept], own[kept])] += matrix[np.ix_(kept, kept)]
    # as the compiled loops do: the upper triangles are summed, each entry at its place
    places = sp.coo_matrix(pattern.with_data(np.arange(1.0, pattern.entries + 1)))
    data = np.zeros(pattern.entries)
    upper = np.triu(np.ones((5, 5), dtype=bool))
    for i, k, number in zip(places.row, places.col, places.data.astype(int), strict=True):
        data[number - 1] = dense[i, k] if upper[i, k] else 0.0
    np.testing.assert_allclose(pattern.unfold(pattern.with_data(data), S).toarray(), dense, atol=1e-14)
