"""Press the paper's sensor by 1 mm with a flat plate and read its three Hall elements.

The finite elements give the force and the motion of the magnet; the magnet's field at the elements gives their
voltages. The formula (5) of the paper stands beside the force: it takes the magnet for silicone.
"""

from __future__ import annotations

from analytic import beam, hall
from fem.equilibrium import solve
from fem.solution import Solution
from geometry.design import paper
from geometry.loads import Load


def main() -> tuple[Solution, hall.Readings]:
    sensor = paper()
    press = Load(depth=1.0)
    state = solve(sensor, press)
    rest, pressed = hall.readings(sensor), hall.readings(sensor, state.response)

    error = "unknown" if state.estimates.force is None else f"about {state.estimates.force:.1%}"
    print(f"force          {state.response.force[2]:.2f} N, error {error}")
    print(f"by formula (5) {beam.solve(sensor, press).force[2]:.2f} N")
    print(f"magnet sinks   {-state.response.shift[2]:.3f} mm")
    for name, before, after in zip(("S1", "S2", "S3"), rest.V, pressed.V, strict=True):
        print(f"{name}             {before:.3f} V at rest, {after:.3f} V pressed")
    return state, pressed


if __name__ == "__main__":
    main()
