"""Make all files for a sensor and its casting mould, which has two cavities and is printed in resin.

The cavity is the beam, enlarged by the shrinkage of the silicone. The first pour fills the closed mould around the
pin that keeps the magnet's pocket free; the second one covers the magnet. The folder holds mould and base as STEP,
STL and 3MF, drawings, and the casting recipe, README.md. It is written only if every check passes.
`magtip cad --process sla --mold columns=2 --mold shrink=0.005` makes the same with a picture.
"""

from pathlib import Path

from geometry.design import Design
from geometry.mold import Mold, pours
from studies.fabrication.sensor_parts import build
from studies.fabrication.sensor_solids import FabricationChoices


def main(folder: str = "out/mold") -> tuple[float, float]:
    sensor = Design(D=10.0, L=12.0, f=7.0, l0=9.2)
    mold = Mold(process="sla", columns=2, shrink=0.005)
    built = build(sensor, Path(folder), lambda *_: None, FabricationChoices(mold), picture=False)
    for check in built["checks"]:
        print(f"{check['name']:48} {check['value']:8.3g} {check['unit']:4} must be {check['bound']}")
    first, second = pours(sensor, mold)
    print(f"silicone: {first / 1000:.2f} ml for the first pour, {second / 1000:.2f} ml for the second")
    return first, second


if __name__ == "__main__":
    main()
