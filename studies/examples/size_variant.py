"""Size a sensor for a press of 5 N from parts that are sold, and press it to 5 N.

The search takes diameter, length and parts from catalogues, and finite elements confirm its best variant. This search
is short: it has one magnet, one silicone and few candidates. A full one, with tables, yield, mould and recipe, is
`magtip size studies/examples/sizing/fingertip.toml --out out/size --export`.
"""

from dataclasses import replace

import magtip
from fem.accuracy import QUICK
from fem.analyses.force_targets import solve_force
from studies.sizing.sizing_study import Settings
from studies.sizing.variant_search import Effort


def main() -> tuple[float, float]:
    needed = magtip.Requirements(force_z=5.0, largest_strain=1.0, magnets=("5x3 N45",), silicones=("Smooth-Sil 940",))
    sizing = magtip.size(needed, Settings(Effort(16, 8), QUICK, points=1, sensors=20))
    (best,), design = sizing.front, sizing.front[0].variant.design
    print(f"D {design.D:g} mm, L {design.L:g} mm, Hall part {best.variant.hall_part.name}: {best.status}")
    state = solve_force(replace(design, E=best.variant.silicone.E_low), 5.0, QUICK)
    print(f"5 N at a depth of {state.load.depth:.2f} mm, with the least E of the silicone's range")
    return state.load.depth, best.solved["depth"] * design.D


if __name__ == "__main__":
    main()
