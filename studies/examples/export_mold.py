"""Make the two-part casting mould of a sensor, two cavities for a resin printer, as STEP, STL and 3MF files.

The cavity is the beam, enlarged by the shrinkage of the silicone. The first pour fills the closed mould around the
pin that keeps the magnet's pocket free; the second one covers the magnet. `magtip cad` does this too, and adds the
base, drawings, a recipe and checks.
"""

from __future__ import annotations

from pathlib import Path

from geometry.design import Design
from geometry.fabrication import mold_solids, solid_files
from geometry.mold import Mold, pours


def main(folder: str = "out/mold") -> tuple[float, float]:
    sensor = Design(D=10.0, L=12.0, l0=8.4)
    mold = Mold(process="sla", columns=2, shrink=0.005)
    parts = dict(zip(("mold_a", "mold_b"), mold_solids.parts(sensor, mold), strict=True))
    Path(folder).mkdir(parents=True, exist_ok=True)
    facets = {name: (solid, solid_files.facets(name, solid)) for name, solid in parts.items()}
    solid_files.export(facets, folder)

    for name, solid in parts.items():
        size = solid.bounding_box().size
        print(f"{folder}/{name}.stl  {size.X:.1f} x {size.Y:.1f} x {size.Z:.1f} mm")
    first, second = pours(sensor, mold)
    print(f"silicone: {first / 1000:.2f} ml for the first pour, {second / 1000:.2f} ml for the second")
    return first, second


if __name__ == "__main__":
    main()
