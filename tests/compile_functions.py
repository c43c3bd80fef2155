"""Compile what numba compiles for the tests, once: `python tests/compile_functions.py`.

Else each process that needs a function while no other has written its file compiles it too.
"""

from dataclasses import replace

import numpy as np

from analytic import beam_arrays, decode
from analytic.inverse import forward_model, response_surface
from analytic.magnet import cylinder_field
from fem.accuracy import QUICK
from fem.analyses.timed_path import TimedLoad, follow
from fem.equilibrium import solve
from geometry.array_design import grid_array
from geometry.base import Base, array_plan
from geometry.design import LAWS, Design, paper
from geometry.loads import Load
from studies.fabrication import array_board
from studies.simulation.mechanics_sources import of_surrogate

LOAD = Load(depth=0.1, shear_x=0.1)


def main():
    for law in LAWS:
        solve(Design(law=law), LOAD)
    soft = replace(paper(), prony="0.3:0.5 0.2:4", modulus="instantaneous")
    coarse = replace(QUICK, section_size=0.3, section_patch=0.1)
    for law in ("prony", "finite"):
        list(follow(soft, [TimedLoad(0.1, LOAD)], coarse, law=law))
    coder, pads = decode.decoder(paper()), np.zeros((1, 2, 3))
    decode.decode(coder, [[0.01, 0.01, 0.01]])
    beam_arrays.decoded_jointly(coder, beam_arrays.beam_array(coder.forward, 1, 2, 16.0, "up"), pads, pads)
    array_board.wired(array_plan(grid_array(Design(hall_layout="tmag5273a1", l0=8.0), 1, 2, 12.0), Base()))
    cylinder_field(np.full((100, 3), 5.0), 2.0, 2.0, 1.0)
    mechanics, shift = of_surrogate(paper()).law, np.full((3, 1), -0.1)
    response_surface.forces(mechanics, shift)
    forward_model.rotation(mechanics.tilt, shift)
    upright, size = np.array([[[0.0, 0.0, 1.0]]]), np.array([[4.0, 2.0]])
    forward_model.readings_of_sensors(5 * upright, upright, np.zeros(1, int), size, 0 * upright, upright)


if __name__ == "__main__":
    main()
