"""What `magtip cad` makes, measured: volumes, triangles against their tolerance, checks at extremes, and time.

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import csv
import io
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry.design import BadInput, Design, paper
from studies.benchmarks import benchmark_tables
from studies.output import atomic_files, console, provenance, records
from studies.output.records import FlatRow

ABOUT = """\
`python -m studies.benchmarks.cad_benchmark results/cad` writes CAD.md, cad.csv and the pictures of the paper's
sensor.

The volumes of beam, magnet and silicone are compared with their closed forms. The volumes of the STEP files, which
are read back, and of the triangles are compared with those of the solids. The deviation of the triangles is the
largest distance between the beam's facets and its exact surface, at seven points of each facet. The whole command
runs in a separate process and is timed from start to end; the fastest run counts, because other processes may run
on the same machine. The time of one more variant is the difference between a long and a short batch, over the
difference in their numbers of designs, which leaves out the start and the imports.
"""

BARE = {"magnet_diameter": 0.0, "magnet_height": 0.0, "magnet_edge_radius": 0.0}
SMALL = {"magnet_diameter": 0.2, "magnet_height": 0.2, "magnet_edge_radius": 0.02}

EXTREMES: dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    "paper": ({}, {}),
    "paper, resin, 1 % shrinkage, 1 degree of draft": ({}, {"process": "sla", "shrink": 0.01, "draft": 1.0}),
    "paper, 3 x 2 cavities": ({}, {"columns": 3, "rows": 2}),
    "paper, 5 x 5 cavities": ({}, {"columns": 5, "rows": 5}),
    "paper, split B, vent at the tip": ({}, {"split": 1, "tip_vent": 1.0}),
    "magnet of 0.2 mm": (SMALL, {}),
    "magnet of 7.4 x 1 mm, wall of 0.15 mm": ({"magnet_diameter": 7.4, "magnet_height": 1.0}, {}),
    "D = 1, L = 0.8": ({"D": 1.0, "L": 0.8, "l0": 3.0, **SMALL}, {"process": "sla"}),
    "D = 50, L = 400": ({"D": 50.0, "L": 400.0, "l0": 380.0, "f": 40.0}, {}),
    "L = D/2 + 0.05, no magnet": ({"L": 4.05, "f": 6.0, "l0": 3.0, **BARE}, {}),
    "elements above the base (c = 6)": ({"c": 6.0, "f": 9.0, "l0": 7.0}, {}),
    "3-axis chip": ({"hall_layout": "tmag5273a1"}, {}),
}
"""Fields of the design, and options of the mould."""

TOLERANCES = (0.1, 0.02, 0.004, 0.001)

LONG, SHORT = 12, 4
"""Variants of the two batches that are timed."""

RUNS = 3
"""Runs of the whole command."""


@dataclass(frozen=True, slots=True)
class PartVolume:
    """A part's volume, and the relative errors of its files; the closed form's as text, empty where there is none."""

    part: str
    volume_mm3: float
    closed_form_error: str = field(metadata={"column": "against closed form"})
    step_error: float = field(metadata={"column": "STEP read back"})
    stl_error: float = field(metadata={"column": "STL"})
    triangles: int


@dataclass(frozen=True, slots=True)
class TriangleErrors:
    """Triangles of the beam for a tolerance: largest distance from its surface, and relative error of the volume."""

    tolerance_mm: float
    deviation_mm: float
    triangles: int
    volume_error: float = field(metadata={"column": "volume"})


@dataclass(frozen=True, slots=True)
class ExtremeResult:
    """All parts of one design at a limit of the input ranges.

    Attributes
    ----------
    checks : how many passed, of how many.
    cavity_error : volume of the cavity against beam less pin, relative; NaN where there are no checks.
    stl_error : the worst relative error of the parts' volumes.
    """

    case: str
    status: str
    parts: int
    checks: str
    cavity_error: float = field(metadata={"column": "cavity"})
    stl_error: float = field(metadata={"column": "STL"})
    cpu_s: float
    notes: str


@dataclass(frozen=True, slots=True)
class CommandTime:
    """Time of a command, by the clock and of the processor; None where processes share it."""

    what: str
    wall_s: float
    cpu_s: float | None


@dataclass(frozen=True, slots=True)
class Measurements:
    """All that this benchmark measures."""

    times: Sequence[CommandTime]
    volumes: Sequence[PartVolume]
    tolerances: Sequence[TriangleErrors]
    extremes: Sequence[ExtremeResult]


def volumes(folder: Path) -> list[PartVolume]:
    """Write the paper's sensor into a folder, and compare its parts' volumes."""
    import build123d as bd

    from geometry.cad import beam_volume, magnet_volume
    from studies.fabrication import sensor_parts

    shape = paper().shape
    whole, magnet = beam_volume(shape), magnet_volume(shape)
    exact = {"beam": whole, "magnet": magnet, "silicone": whole - magnet}
    fabricated = sensor_parts.build(paper(), folder, _silent)
    parts = []
    for part in fabricated.parts:
        name, volume = part.name, part.volume_mm3
        read = float(bd.import_step(folder / f"{name}.step").volume)
        form = f"{abs(volume / exact[name] - 1):.1e}" if name in exact else ""
        errors = form, abs(read / volume - 1), part.relative_error
        parts.append(PartVolume(name, volume, *errors, part.triangles))
    return parts


def tolerances() -> list[TriangleErrors]:
    """Deviation and volume of the beam's triangles for several tolerances."""
    from geometry import cad
    from geometry.fabrication import solid_files

    errors = []
    for tolerance in TOLERANCES:
        solid = cad.beam(paper())
        mesh = solid_files.triangulated(solid, tolerance, math.pi)
        volume_error = float(mesh.volume / solid.volume - 1)
        errors.append(TriangleErrors(tolerance, deviation(mesh), len(mesh.faces), volume_error))
    return errors


def deviation(mesh: Any) -> float:
    """Return the largest distance of points of the beam's facets from its wall and dome, mm."""
    import numpy as np

    share = np.array([(1, 1, 1), (3, 3, 0), (3, 0, 3), (0, 3, 3), (4, 1, 1), (1, 4, 1), (1, 1, 4)]) / 6
    share[0] /= 0.5
    points = np.einsum("pk,tkx->tpx", share, mesh.triangles).reshape(-1, 3)
    points = points[points[:, 2] > 1e-6]
    up = np.maximum(points[:, 2] - paper().H, 0.0)
    return float(np.abs(np.hypot(np.hypot(points[:, 0], points[:, 1]), up) - paper().R).max())


def extremes(folder: Path) -> list[ExtremeResult]:
    """Make all parts of designs at the limits of the input ranges."""
    from geometry.mold import Mold
    from studies.fabrication import sensor_parts, sensor_solids
    from studies.fabrication.fabrication_rows import FabricationRow

    results = []
    for k, (name, (fields, choices)) in enumerate(EXTREMES.items()):
        start = time.process_time()
        fabrication = sensor_solids.FabricationChoices(mold=Mold(**choices))
        try:
            fabricated = sensor_parts.build(Design(**fields), folder / str(k), _silent, fabrication)
        except BadInput as error:
            fabricated = FabricationRow("bad_input", str(error), folder / str(k))
        checks = {check.name: check for check in fabricated.checks}
        passed = sum(check.passed for check in checks.values())
        cavity = checks["cavity volume against beam minus pin"].value if checks else math.nan
        worst = max((abs(part.relative_error) for part in fabricated.parts), default=math.nan)
        results.append(
            ExtremeResult(
                case=name,
                status=fabricated.status,
                parts=len(fabricated.parts),
                checks=f"{passed} of {len(checks)}",
                cavity_error=abs(cavity),
                stl_error=worst,
                cpu_s=time.process_time() - start,
                notes="; ".join([fabricated.message, *fabricated.warnings]).strip("; "),
            )
        )
        console.say(f"{name}: {fabricated.status}")
    return results


def times(folder: Path) -> list[CommandTime]:
    """Whole commands in processes of their own, by the clock and in CPU time with that of their children."""
    from studies.fabrication import design_variants

    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    env = {**os.environ, "PYTHONPATH": str(provenance.ROOT)}
    command = [sys.executable, "-c", code, "cad", "paper", "--out", str(folder / "one")]
    runs = []
    for _ in range(RUNS):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, env=env)
        after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
        runs.append((wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime))
    wall, cpu = min(runs)
    commands = [CommandTime(f"magtip cad paper, imports included, fastest of {RUNS}", wall, cpu)]
    for workers in (1, os.cpu_count() or 1):
        spent = []
        for count in (SHORT, LONG):
            axes = {"L": [9 + 0.1 * k for k in range(count)]}
            start, used = time.perf_counter(), time.process_time()
            list(design_variants.batch(paper(), axes, folder / f"{workers}-{count}", _silent, workers=workers))
            spent.append((time.perf_counter() - start, time.process_time() - used))
        wall, cpu = ((spent[1][k] - spent[0][k]) / (LONG - SHORT) for k in (0, 1))
        name = f"one more variant in a batch, {workers} {'process' if workers == 1 else 'processes'}"
        commands.append(CommandTime(name, wall, cpu if workers == 1 else None))
    return commands


def document(measured: Measurements, about: dict[str, str]) -> str:
    """Return the text of CAD.md."""
    lines = ["# Measurements of CAD and moulds", "", *ABOUT.splitlines(), ""]
    tables: dict[str, Sequence[PartVolume | TriangleErrors | ExtremeResult | CommandTime]] = {
        "Parts of the paper's sensor: volume and its relative errors": measured.volumes,
        "Triangles of the beam against the requested tolerance": measured.tolerances,
        "Designs and moulds at the limits of the input ranges": measured.extremes,
        "Time, s": measured.times,
    }
    for title, table in tables.items():
        rows = [records.flat(record) for record in table]
        lines += [f"## {title}", "", "| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
        lines += ["| " + " | ".join(_cell(value) for value in row.values()) + " |" for row in rows] + [""]
    lines += ["## The paper's sensor", "", "![cut open](assembly.png)", ""]
    lines += [f"![{name}]({name}.svg)" for name in ("sensor", "base", "mold")]
    return "\n".join([*lines, "", "## Made with", "", *(f"- {name}: {text}" for name, text in about.items()), ""])


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.2e}" if 0 < abs(value) < 1e-3 else f"{value:.5g}"
    return str(value)


def _csv(rows: Sequence[FlatRow]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _silent(fraction: float, text: str) -> None:
    """No progress."""


def main(out: str) -> None:
    """Measure, and write everything into a folder."""
    about = benchmark_tables.machine()
    with atomic_files.filled(out) as folder, tempfile.TemporaryDirectory() as work:
        scratch = Path(work)
        timed, parts, triangles = times(scratch), volumes(scratch / "paper"), tolerances()
        console.say("paper's sensor done")
        measured = Measurements(timed, parts, triangles, extremes(scratch / "extremes"))
        for name in ("assembly.png", "sensor.svg", "base.svg", "mold.svg"):
            with atomic_files.atomic(folder / name) as temporary:
                temporary.write_bytes((scratch / "paper" / name).read_bytes())
        atomic_files.write_text(folder / "cad.csv", _csv([records.flat(result) for result in measured.extremes]))
        atomic_files.write_text(folder / "CAD.md", document(measured, about))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(Path("out", "cadbench")))
