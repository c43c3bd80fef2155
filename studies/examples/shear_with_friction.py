"""Press the sensor by 1 mm, then move the plate sideways with Coulomb friction until the whole contact slips.

At first only the edge of the contact slips and the force grows with the shear. The slipping part grows inwards; at
full slip the tangential force is the coefficient of friction times the normal force, and stays so.
"""

from __future__ import annotations

from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.solution import Solution
from geometry.design import paper
from geometry.loads import Load

MU = 0.1


def main() -> list[Solution]:
    loads = [Load(depth=1.0, shear_x=shear, friction=MU) for shear in (0.25, 0.5, 1.0, 1.5)]
    states = trace(paper(), loads, QUICK, estimate=False)

    print("shear mm   F_x N   F_z N   F_x/F_z   share that slips   magnet leans")
    for state in states:
        x, _, z = state.response.force
        slips, tilt = state.slip_share or 0.0, state.response.tilt
        print(f"{state.load.shear_x:8.2f} {x:7.3f} {z:7.3f} {x / z:9.3f} {slips:18.0%} {tilt:10.3f} rad")
    return states


if __name__ == "__main__":
    main()
