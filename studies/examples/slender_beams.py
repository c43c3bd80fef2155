"""Where does the beam assumption hold? The paper's formulas against finite elements, over the slenderness L/D.

A beam of silicone alone, as the formulas assume, is pressed to D/20 and then sheared by D/10 with a plate that sticks
to the tip. (5) spreads the depth over the whole length, but most of it is indentation of the tip: the longer the
beam, the lower it is. (6) leaves out the deflection by shear, which counts in a short beam, and the press, which
softens a slender one: it is off by a quarter at best. Level finite has all of these and is within 10 %.
"""

from analytic import beam
from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import Design
from geometry.loads import Load


def main() -> dict[tuple[float, str], tuple[float, float]]:
    load, errors = Load(depth=0.4, shear_x=0.8, friction="stick"), {}
    print("L/D  level   press force  shear force")
    for slenderness in (1.0, 2.0, 3.0, 4.0):
        sensor = Design(D=8.0, L=8.0 * slenderness, magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
        true = solve(sensor, load, QUICK, magnet="ignored").response.force
        for level in ("paper", "finite"):
            formula = beam.solve(sensor, load, level).force
            press, shear = errors[slenderness, level] = formula[2] / true[2] - 1, formula[0] / true[0] - 1
            print(f"{slenderness:3.0f}  {level:7} {press:+11.1%} {shear:+12.1%}")
    return errors


if __name__ == "__main__":
    main()
