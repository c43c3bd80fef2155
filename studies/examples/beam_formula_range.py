"""Where does the paper's beam formula (5) hold? Press the sensor to 3 mm and compare the forces.

Two bodies are solved by finite elements: the sensor with its rigid magnet, and the same beam all of silicone, which
is what formula (5) describes. (5) holds for the silicone from 1.5 mm on. Below that it is low, because it grows with
the square of the depth and contact with the power 1.5. The rigid magnet raises the force by 20 to 60 %.
"""

from __future__ import annotations

from analytic import beam
from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load


def main() -> list[tuple[float, float, float, float]]:
    sensor = paper()
    loads = [Load(depth=depth) for depth in (0.25, 0.5, 1.0, 1.5, 2.0, 2.5)]
    silicone = trace(sensor, loads, QUICK, magnet="ignored", estimate=False)
    magnet = trace(sensor, loads, QUICK, magnet="rigid", estimate=False)

    rows = []
    print("depth mm   formula N   silicone N   off by   with magnet N")
    for load, bare, rigid in zip(loads, silicone, magnet, strict=True):
        formula = beam.solve(sensor, load, level="paper").force[2]
        force, stiff = bare.response.force[2], rigid.response.force[2]
        rows.append((load.depth, formula, force, stiff))
        print(f"{load.depth:8.2f} {formula:11.3f} {force:12.3f} {formula / force - 1:+8.1%} {stiff:15.3f}")
    return rows


if __name__ == "__main__":
    main()
