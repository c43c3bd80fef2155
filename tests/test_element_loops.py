"""Compiled loops over the elements against NumPy: residual, tangent, energy, and the least volume ratio."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from test_nonlinear_system import RNG, SCENES, plate, smooth

from fem import material
from fem.discretisation import element_loops
from geometry import compiled

pytest.importorskip("numba", reason="the loops need the extra `fast`")

LAWS = {
    "neo-hookean": (),
    "mooney-rivlin": (0.3,),
    "yeoh": (0.1, 0.02),
    "ogden": (1.3, -2.0, 0.3),
}
REL = 1e-12


def both(call):
    """The result of a call by NumPy and by the compiled loops."""
    with compiled.uncompiled():
        by_numpy = call()
    compiled.prepare()
    return by_numpy, call()


def assert_equal_assemblies(first, second):
    assert second.energy == pytest.approx(first.energy, rel=REL)
    scale = np.abs(first.forces).max()
    np.testing.assert_allclose(second.forces, first.forces, rtol=REL, atol=REL * scale)
    np.testing.assert_allclose(second.residual, first.residual, rtol=REL, atol=REL * scale)
    if first.matrix is not None:
        scale = np.sqrt(np.abs(first.matrix.diagonal()))
        difference = np.abs(second.matrix - first.matrix).tocoo()
        assert (difference.data <= REL * np.maximum(scale[difference.row] * scale[difference.col], 1)).all()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["half ball", "sensor", "one harmonic"])
def test_every_law_on_every_kind_of_element(name, law):
    system, flat = plate(name, 0.02, shear=0.003)
    system.law = material.law(law, LAWS[law])
    q = smooth(system)
    assert_equal_assemblies(*both(lambda: system.assemble(system.admissible(q), flat)))


@pytest.mark.parametrize("name", SCENES)
def test_every_model(name):
    system, flat = plate(name, 0.02, tilt=0.05 if name == "half ball" else 0.0)
    q = smooth(system)
    assert_equal_assemblies(*both(lambda: system.assemble(system.admissible(q), flat)))
    assert_equal_assemblies(*both(lambda: system.assemble(system.admissible(q), flat, tangent=False)))
    first, second = both(lambda: system.admissible(q).least_J)
    assert second == pytest.approx(first, rel=REL)


@pytest.mark.parametrize("name", SCENES)
def test_the_mass_of_every_model(name):
    system = SCENES[name]()
    first, second = both(lambda: system.mass(2.0, np.arange(1.0, 1 + system.n_rigid)))
    assert abs(second - first).max() <= REL * abs(first).max()


def test_strains_that_are_kept_are_those_of_the_state():
    """In whatever order states are checked and assembled, the results are those of a system without a past."""
    system, flat = plate("sensor", 0.02)
    compiled.prepare()
    q = smooth(system)
    one, other = system.admissible(q), system.admissible(0.7 * q)
    for state in (one, other, other, one):
        alone = plate("sensor", 0.02)[0].assemble(state, flat)
        np.testing.assert_array_equal(system.assemble(state, flat).residual, alone.residual)


@pytest.mark.parametrize("name", ["cylinder", "harmonics"])
def test_inverted_silicone_is_refused(name):
    system = SCENES[name]()
    q = np.zeros(system.size)
    q[: system.n_free] = 10 * smooth(system)[: system.n_free] / 0.001
    assert both(lambda: system.admissible(q)) == (None, None)


def test_tiny_strains_keep_their_digits():
    system = SCENES["sensor"]()
    q = 1e-9 * smooth(system)
    first, second = both(lambda: system.assemble(system.state(q), None))
    np.testing.assert_allclose(second.forces, first.forces, rtol=1e-9, atol=1e-12 * np.abs(first.forces).max())


def test_a_law_without_loops_is_computed_by_numpy():
    compiled.prepare()
    elements = SCENES["cube"]().elements
    assert element_loops.usable(material.neo_hookean, elements)
    assert not element_loops.usable(lambda k, mu, p=0.0: material.neo_hookean(k, mu, p), elements)


READ_ONLY = """
import numpy as np
from fem import material
from fem.preparation import small_section
from geometry import compiled

compiled.prepare()
system = small_section(material.neo_hookean, 0)
assembly = system.assemble(system.admissible(np.zeros(system.size)), None)
print(assembly.matrix.nnz > 0, "_loops" in vars(system))
"""


def test_without_a_writable_folder_numpy_computes(tmp_path):
    # numba finds no place for its files: it looks only in the folder that the first variable names
    blocked = tmp_path / "file"
    blocked.write_text("")
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(blocked / "inside"),
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
    }
    run = subprocess.run(
        [sys.executable, "-c", READ_ONLY], capture_output=True, text=True, env=environment, check=True
    )
    assert run.stdout.split() == ["True", "False"]


def test_neighbouring_tetrahedra_follow_each_other():
    """The steps between tetrahedra in order are far shorter than between tetrahedra in random order."""
    e = SCENES["half ball"]().elements
    shuffled = replace(e, cells=RNG.permutation(e.cells))
    order = np.argsort(element_loops.places_on_curve(shuffled), kind="stable")
    centres = shuffled.nodes[shuffled.corners].mean(axis=1)
    before, after = (np.linalg.norm(np.diff(x, axis=0), axis=1).mean() for x in (centres, centres[order]))
    assert after < before / 2
