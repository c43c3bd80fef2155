"""Loading the compiled loops before they are needed, in long-running processes, benchmarks and `make test`."""

from __future__ import annotations

import numpy as np
import skfem

from fem.model import elements, rigid_inclusion, viscoelasticity
from fem.model.material import Law, lame, law
from fem.model.nonlinear_system import System
from fem.model.symmetry_models import specification
from fem.scene import Scene
from fem.solve.press import solve_press
from geometry.design import paper
from geometry.loads import Load

EXAMPLES = {"neo-hookean": (), "mooney-rivlin": (0.5,), "yeoh": (0.1, 0.1), "ogden": (2.0, -2.0, 0.5)}
"""Each law with some constants."""


def prepare() -> None:
    """Load the compiled loops of all models and laws, or compile them once after an installation.

    Otherwise a process loads or compiles each loop at its first use.
    """
    for name, constants in EXAMPLES.items():
        for harmonics in (0, 1):
            system = small_section(law(name, constants), harmonics)
            state = system.admissible(np.zeros(system.size))
            assert state is not None
            system.assemble(state, None)
    # springs of the plate, chosen and by their overlap
    solve_press(specification(Scene(paper(), (Load(),)), 0.4, 0.2), 0.02)
    # a time step of each viscoelastic law
    branches = viscoelasticity.Branches(np.array([0.5]), np.array([1.0]), 1.0)
    for name in ("prony", "finite"):
        (m, q), t = system.elements.weights.shape, len(system.elements.angles.theta)
        assert state is not None
        system.viscous = viscoelasticity.at_rest(name, branches, (t, m, q)).overstress(1.0)
        system.assemble(state, None)


def small_section(isochoric: Law, harmonics: int) -> System:
    """Return a section of two triangles, whose inner side is a rigid magnet."""
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_tensor(np.array([1.0, 2.0]), np.array([0.0, 1.0])))
    e = elements.build(mesh, axisymmetric=True, harmonics=harmonics)
    inner = np.flatnonzero(e.nodes[:, 0] < 1 + 1e-9)
    body = rigid_inclusion.section(e.nodes[inner], e.angles)
    fixed = np.zeros((len(e.nodes), e.angles.fields), dtype=bool)
    return System(e, None, *lame(1.0, 0.49), fixed, inner, body, law=isochoric)
