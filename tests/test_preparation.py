"""Loading of the compiled loops."""

from dataclasses import replace

import numpy as np

from analytic import magnet
from fem import equilibrium, preparation
from fem.accuracy import QUICK
from fem.model import material
from geometry import section
from geometry.design import LAWS, Design, paper
from geometry.loads import Load

ROUGH = replace(QUICK, section_size=0.35, section_patch=0.12, harmonics=1)


def test_the_small_section_has_a_magnet_and_elements_at_it():
    system = preparation.small_section(material.neo_hookean, 1)
    assert system.n_rigid == 3
    assert np.isin(system.elements.cells, system.glued).any()


def test_examples_are_all_laws():
    assert list(preparation.EXAMPLES) == list(LAWS)
    assert all(material.law(name, constants) for name, constants in preparation.EXAMPLES.items())


def test_nothing_is_left_to_compile():
    """`make test` and long-running processes rely on this, also for other sections, loads and fields."""
    from numba.core import event

    preparation.prepare()
    points = np.linspace(1.0, 9.0, 3 * magnet.MIN_COMPILED_POINTS).reshape(-1, 3)
    magnet.cylinder_field_jacobian(points, 1.0, 1.0, 1.2)
    with event.install_recorder("numba:compile") as recorder:
        for kind in ("hole", "meshed", "none"):
            section.section(paper().shape, 2.0, rim=(1.0, 0.2), magnet=kind)
        for law in LAWS:
            solution = equilibrium.solve(Design(law=law), Load(depth=0.1, shear_x=0.1), ROUGH)
            assert solution.status == "ok"
        magnet.cylinder_field_jacobian(points, 1.0, 2.0, 1.2)
    assert [str(data.data["dispatcher"]) for _, data in recorder.buffer] == []
