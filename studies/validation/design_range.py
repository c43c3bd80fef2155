"""Solids, moulds and meshes of designs sampled over all input ranges."""

import math
import time
from collections.abc import Sequence

import numpy as np
import pandas as pd
import skfem
from scipy.stats import qmc

from fem.accuracy import QUICK, STANDARD
from geometry.design import BadInput, Design
from geometry.mesh import tetrahedra
from geometry.meshing.mesh_quality import quality
from geometry.messages import Progress
from geometry.section import section
from studies.inputs.option_groups import Whole
from studies.output.goals import Goal
from studies.output.result import Result
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("RANGE.md", "range.csv")
SEED, MOST = 1960, 1024
"""Seed of the sequence, and largest number of designs."""
WALL, LEAST_STEM = 0.15, 0.05
"""Wall of silicone that the largest magnet leaves, and least L - D/2, mm."""
LEAST_DIAMETER, LEAST_HEIGHT, SLENDER = 0.2, 0.1, (0.1, 4.0)
"""Least diameter and height of a magnet, mm, and limits of its height / diameter."""
END = 0.1
"""Share of the samples at each end of each quantity's range."""
VOLUME, BASE, LEAST_JACOBIAN = 1e-5, 1e-4, 0.05
"""Largest relative errors of volumes and of the base, and least ratio of the Jacobians of a cell."""
STEPS = {"solids": "mould and solids", "section": "section mesh", "solid_mesh": "mesh of tetrahedra"}
"""Steps, in words."""
MADE, POSSIBLE = 90.0, 25.0
"""Least shares of the possible designs that pass each step, which others refuse for a reason, and of the sampled
designs that are possible, %: more refusals would leave the study without anything to judge."""
SIZES = ("D", "L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
COLUMNS = (
    *("wall_mm", "solids", "solids_s", "section", "section_ms", "triangles", "section_volume_error"),
    *("least_angle_rad", "solid_mesh", "tetrahedra", "mesh_s", "mesh_cpu_s", "silicone_volume_error"),
    *("magnet_volume_error", "base_error", "gap_over_D", "least_jacobian", "least_shape", "mean_shape"),
)
"""Columns of range.csv after sizes, status ("impossible": the design itself is refused) and message; `solids`,
`section` and `solid_mesh` are outcomes of the steps: ok, impossible, failed. The others are measured numbers, None
where a step was not reached or did not pass; errors are relative."""


def samples(count: int) -> list[Row]:
    points = qmc.Sobol(5, seed=SEED).random_base2(math.ceil(math.log2(max(count, 2))))[:count]
    return [_sample(x) for x in np.clip((points - END) / (1 - 2 * END), 0.0, 1.0).tolist()]


def _sample(x: list[float]) -> Row:
    """Return the design at a point of the unit cube.

    The coordinates stand for D, the stem L - D/2, and the magnet's diameter, height / diameter and edge radius.
    """
    D = _down(50 ** x[0])
    stem = _down(LEAST_STEM * (9.5 * D / LEAST_STEM) ** x[1])
    ratio = SLENDER[0] * (SLENDER[1] / SLENDER[0]) ** x[3]
    least = max(LEAST_DIAMETER, LEAST_HEIGHT / ratio)
    most = min(2 * (D / 2 - WALL) / math.hypot(1, ratio), 2 * (stem - WALL) / ratio)
    wide = _down(least * (max(most, least) / least) ** x[2])
    tall = _down(ratio * wide)
    edge = _down(x[4] * min(wide, tall) / 4) if x[4] else 0.0
    sizes = {"D": D, "L": round(D / 2 + stem, 6), "magnet_diameter": wide, "magnet_height": tall}
    return sizes | {"magnet_edge_radius": edge, "l0": round(D / 2 + stem + 1, 6)}


def _down(value: float) -> float:
    """Return a positive value rounded down to four digits.

    A value that differs from four digits only by floating-point error keeps these digits: hence 1e-9.
    """
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / step + 1e-9) * step:.6g}")


def run(progress: Progress, *, quick: bool = False, count: Whole = 64) -> Result:
    """Make solids, mould and meshes of designs sampled over all input ranges; exit status 3 if one fails.

    Nothing of a run that was stopped is kept: start it again.

    Parameters
    ----------
    quick
        Use the first four designs: 15 seconds.
    count
        Number of sampled designs, 1 to 1024; 64 take some minutes.
    """
    count = 4 if quick else count
    if not 1 <= count <= MOST:
        raise BadInput(f"--count must lie between 1 and {MOST}; got {count}")
    chosen = pages.told(progress, list(enumerate(samples(count))), lambda case: f"design {case[0]}")
    return pages.collected((examine(number, sample) for number, sample in chosen), result)


def result(rows: Sequence[Row]) -> Result:
    spread = summary(rows)
    return pages.study("range", "Range of designs", rows, {"rows": rows, "spread": spread}, spread, goals=goals(rows))


def summary(rows: Sequence[Row]) -> list[Row]:
    sizes = pd.DataFrame(rows, columns=list(COLUMNS)).drop(columns=list(STEPS)).astype(float).abs()
    table = sizes.dropna(axis=1, how="all").agg(["min", "median", "max"]).T
    table.columns = ["least", "median", "greatest"]
    return pages.records(table.rename_axis("quantity").reset_index())


def goals(rows: Sequence[Row]) -> list[Goal]:
    failed = [str(row["design"]) for row in rows if row["status"] == "failed"]
    possible = sum(row["status"] != "impossible" for row in rows)
    named = f" (design {', '.join(failed)})" if failed else ""
    found = [Goal(f"designs that fail{named}", len(failed), 0, possible)]
    counts = {"designs that are possible": (possible, POSSIBLE, len(rows))}
    for step, words in STEPS.items():
        good = sum(row[step] == "ok" for row in rows)
        counts[f"possible designs with a {words}"] = good, MADE, possible
    return found + [
        Goal(name, 100 * good / max(count, 1), least, count, "%", at_least=True)
        for name, (good, least, count) in counts.items()
    ]


def examine(number: int, sample: Row) -> Row:
    """Return the row of one design; an exception other than BadInput is a failure, with its text as message."""
    sizes = {f"{name}_mm": sample[name] for name in SIZES}
    row: Row = {"design": number} | sizes | {"status": "ok", "message": ""} | dict.fromkeys(COLUMNS)
    try:
        design = Design(**sample)
    except BadInput as refusal:
        return row | {"status": "impossible", "message": str(refusal)}
    row["wall_mm"] = design.shape.wall
    for name, step in zip(STEPS, (_solids, _section, _solid_mesh), strict=True):
        try:
            row |= {name: "ok"} | step(design)
        except BadInput as refusal:
            row |= {name: "impossible", "message": str(refusal)}
        except Exception as error:
            # the study exists to find unforeseen failures, so that every exception becomes a row
            row |= {name: "failed", "status": "failed", "message": f"{name}: {type(error).__name__}: {error}"}
    return row


def _solids(design: Design) -> Row:
    """Compare the volumes of the three bodies with their closed forms, and run the checks of the mould."""
    from geometry import cad, mold
    from geometry.fabrication import mold_solids

    begin = time.perf_counter()
    shape, choices = design.shape, mold.Mold()
    beam, magnet = cad.beam_volume(shape), cad.magnet_volume(shape)
    bodies = ((cad.beam(design), beam), (cad.magnet(design), magnet), (cad.silicone(design), beam - magnet))
    for body, volume in bodies:
        if not (body.is_valid and abs(float(body.volume) / volume - 1) < 1e-9):
            raise RuntimeError(f"a solid of {body.volume:.9g} mm3 is not valid or has the wrong volume")
    checks = mold_solids.checks(design, choices, *mold_solids.closed_mold(design, choices))
    failed = [check.name for check in checks if not check.passed]
    if failed:
        raise RuntimeError(f"the mould fails its check '{failed[0]}'")
    return {"solids_s": time.perf_counter() - begin}


def _section(design: Design) -> Row:
    """Mesh the (r, z) section with the magnet as a hole; check its volume of revolution and its angles."""
    from geometry import cad

    shape = design.shape
    begin = time.perf_counter()
    mesh = section(shape, STANDARD.section_size * shape.D)
    seconds = time.perf_counter() - begin
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), intorder=6)
    volume = 2 * math.pi * float((basis.global_coordinates()[0] * basis.dx).sum())
    error = volume / (cad.beam_volume(shape) - cad.magnet_volume(shape)) - 1
    corners = mesh.doflocs[0, mesh.t] + 1j * mesh.doflocs[1, mesh.t]
    angles = np.angle((np.roll(corners, 1, axis=0) - corners) / (np.roll(corners, -1, axis=0) - corners))
    if not (abs(error) < VOLUME and angles.min() > 0):
        raise RuntimeError(f"a volume error of {error:.2g}, a least angle of {angles.min():.2g} rad")
    row = {"section_ms": 1e3 * seconds, "triangles": mesh.nelements, "section_volume_error": error}
    return row | {"least_angle_rad": float(np.abs(angles).min())}


def _solid_mesh(design: Design) -> Row:
    size = QUICK.solid_size * design.D
    begin, spent = time.perf_counter(), time.process_time()
    mesh = tetrahedra(design.shape, size)
    seconds, cpu = time.perf_counter() - begin, time.process_time() - spent
    measured = quality(mesh, design.shape)
    errors = measured["volume_errors"]
    right = all(abs(error) < VOLUME for error in errors.values()) and abs(measured["base_error"]) < BASE
    if not (right and measured["least_jacobian"] >= LEAST_JACOBIAN):
        raise RuntimeError(f"{measured}")
    row = {
        "tetrahedra": measured["cells"],
        "mesh_s": seconds,
        "mesh_cpu_s": cpu,
        "gap_over_D": measured["gap"] / design.D,
    }
    row |= {f"{name}_volume_error": errors[name] for name in ("silicone", "magnet")}
    return row | {name: measured[name] for name in ("base_error", "least_jacobian", "least_shape", "mean_shape")}
