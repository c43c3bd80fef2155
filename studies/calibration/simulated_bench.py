"""Simulate a test stand: presses and shears of a sensor whose parts deviate within their tolerances, and a recording.

`python -m studies.calibration.simulated_bench FOLDER` writes bench.csv, twelve presses as a stand measures them, and
recording.csv, a slow press and shear over time with the true forces beside the readings. The silicone, magnet and
elements of this sensor are drawn at random (`studies.sensitivity.made_sensors`); the forces are those of finite
elements.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.arrays import Array
from geometry.design import paper
from geometry.loads import Load
from studies.parts.part_tolerances import tolerances
from studies.sensitivity.made_sensors import MadeSensors, made_readings, made_sensors

if TYPE_CHECKING:
    import pandas as pd

FORCE_NOISE, READING_NOISE = 0.02, 2.5e-4
"""Standard deviations of a measured force, N, and of a reading, V."""
STAND_ZERO, STAND_COMPLIANCE = 0.1, 0.004
"""Depth that the stand shows at first touch, mm, and how much it gives way, mm/N."""
READINGS, FORCES, TRUE = ["S1_V", "S2_V", "S3_V"], ["Fx_N", "Fy_N", "Fz_N"], ["true x", "true y", "true z"]


def states(made: MadeSensors, loads: list[Load], angle: float) -> tuple[Array, Array]:
    """Return readings (n, 3), V, and forces (n, 3), N, of a made sensor; its shear points along an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    read, force = [], []
    design = made.designs[0]
    assert design is not None
    for state in trace(design, loads, QUICK, estimate=False):
        (x, _, z), (u, _, w), lean = state.response.force, state.response.shift, state.response.tilt
        shift, turn = np.array([[[c * u, s * u, w]]]), np.array([[[-s * lean, c * lean]]])
        read.append(made_readings(made, shift, turn).output[0, 0])
        force.append([c * x, s * x, z])
    return np.array(read), np.array(force)


def bench(seed: int, count: int) -> pd.DataFrame:
    """Return what a stand measures under `count` presses and shears, and the true forces."""
    import pandas as pd

    rng, made = np.random.default_rng(seed), made_sensors(paper(), tolerances(), 1, seed)
    rows = []
    for k in range(count):
        depth = 0.4 + 1.7 * (3 * (k // 3) + 1.5) / count
        load = Load(depth=depth, shear_x=(0.1, 0.5, 0.9)[k % 3] * depth, friction="stick")
        read, force = states(made, [load], 2.4 * k)
        noise = np.array([READING_NOISE] * 3 + [FORCE_NOISE] * 3) * rng.normal(size=6)
        shown = depth + STAND_COMPLIANCE * force[0, 2] + STAND_ZERO
        rows.append([*np.append(read[0], force[0]) + noise, shown, *force[0]])
    return pd.DataFrame(rows, columns=[*READINGS, *FORCES, "depth_mm", *TRUE])


def recording(seed: int, count: int = 60) -> pd.DataFrame:
    """Return readings over time, from rest to a press of 1.5 mm and a shear of 0.6 mm, and the true forces."""
    import pandas as pd

    rng, made = np.random.default_rng(seed + 1), made_sensors(paper(), tolerances(), 1, seed)
    share = np.linspace(0, 1, count // 2 + 1)[1:]
    loads = [Load(depth=1.5 * d, friction="stick") for d in share]
    loads += [Load(depth=1.5, shear_x=0.6 * s, friction="stick") for s in share]
    read, force = states(made, loads, 0.7)
    rest = made_readings(made, np.zeros((1, 1, 3)), np.zeros((1, 1, 2))).output[0]
    read, force = np.vstack([np.repeat(rest, 20, axis=0), read]), np.vstack([np.zeros((20, 3)), force])
    read += READING_NOISE * rng.normal(size=read.shape)
    # minutes, so that the silicone has relaxed in every row
    times = 5.0 * np.arange(len(read))[:, None]
    return pd.DataFrame(np.hstack([times, read, force]), columns=["time_s", *READINGS, *TRUE])


def main(folder: Path, seed: int = 5) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in (("bench.csv", bench(seed, 12).drop(columns=TRUE)), ("recording.csv", recording(seed))):
        table.round(6).to_csv(folder / name, index=False)
        print(f"{folder / name}: {len(table)} rows")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/bench"))
