"""Contact problems on the paper's beam: Hertz's limit, and the error of the plate's penalty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fem.accuracy import LEVELS
from fem.equilibrium import trace
from fem.model import plate_contact
from fem.model.symmetry_models import MeshSpecification
from fem.solve.direct_solver import Solver
from fem.solve.load_stepping import Path
from fem.solve.newton import STOPPED, newton
from fem.solve.path_state import at_rest
from geometry.design import paper
from geometry.loads import Load, Magnet
from studies.validation.solid_problems import NotSolvedError


def hertz(level: str) -> tuple[float, ...]:
    """Return the force over Hertz's 4/3 E / (1 - nu^2) sqrt(R) d^1.5 at d = 1e-6, 1e-5, 1e-4 mm, and its exponent.

    The body is the paper's beam without its magnet, at an accuracy level (quick, standard, fine).
    """
    design, depths = paper(), (1e-6, 1e-5, 1e-4)
    ratios = []
    for depth in depths:
        state = trace(design, [Load(depth=depth)], LEVELS[level], magnet="ignored", estimate=False)[0]
        if state.status != "ok":
            raise NotSolvedError(state.message)
        constant = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R)
        ratios.append(state.response.force[2] / (constant * depth**1.5))
    slope = 1.5 + math.log(ratios[-1] / ratios[0]) / math.log(depths[-1] / depths[0])
    return (*ratios, slope)


def penalty(level: str, depth: float, magnet: Magnet) -> float:
    """Return the force on the paper's sensor with the plate's penalty SECTION_KAPPA over that on a rigid plate.

    The force is solved with 1, 3 and 10 times the penalty. It is linear in the inverse of the penalty, so that a line
    through the three forces gives that on a rigid plate, at inverse 0.

    Parameters
    ----------
    depth : of the press, over D.
    """
    design, size = paper(), LEVELS[level].section_size
    shape = design.shape.scaled(1 / design.D)
    tip = min(size, math.sqrt(shape.R * depth) * size / 2)
    path = Path(at_rest(MeshSpecification(shape, design.nu, magnet, size, tip).build()))
    forces, factors, solver = [], np.array([1.0, 3.0, 10.0]), Solver()
    try:
        reason, state = path.go(depth, np.zeros(2)), path.state
        system, q, plate, skin = state.d.system, state.q, state.plate, state.skin
        for factor in factors:
            harder = replace(plate, stiffness=factor * plate.stiffness)
            pressed = plate_contact.overlap(skin, system.state(q).u, plate) > 0
            answer = newton(system, solver, q, harder, pressed)
            reason = reason or answer.reason
            q = answer.state.q
            pushed = plate_contact.springs(skin, answer.state.u, harder).traction[..., 2]
            forces.append(float(np.sum(skin.weights * pushed)))
    finally:
        path.close()
        solver.close()
    if reason:
        raise NotSolvedError(STOPPED[reason])
    return forces[0] / float(np.polynomial.Polynomial.fit(1 / factors, forces, 1)(0.0))
