"""The exact field beside mpmath and magpylib: errors by region, and time for a million points, one, and the first.

`python -m studies.benchmarks.field_benchmark results/field` writes field.csv and FIELD.md. It needs magpylib, mpmath
and numba.

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
import timeit
from collections.abc import Callable
from functools import partial
from importlib import metadata
from types import ModuleType

import numpy as np

from analytic import magnet
from geometry.arrays import Array
from geometry.design import BadInput, paper
from studies.benchmarks import benchmark_tables, field_reference, field_report
from studies.benchmarks.field_report import FirstCall, ProgramTimes, RegionErrors
from studies.output import atomic_files, console, provenance

ABOUT = """\
The error of the field is |B - B_true| / |B_true|, that of the Jacobian |J - J_true| / |J_true|. The tables show the
largest error over the points of a region and over magnets with height/radius from 1e-6 to 1e3. The true values have
60 digits, for exactly the double-precision coordinates of the points.

The time for a million points around the paper's magnet (normally distributed, standard deviation 6 mm) is CPU time
on one thread, the median of runs by turns with magpylib; the clock shows the gain of a second thread, if both cores
are idle. The ratios are medians over the turns. The cost of one point is the time of a call with one point
less that of a call without points; the latter is the overhead of Python for conversion, checks and allocation.
First calls are wall time in a new process.
"""


RADIUS = 1.7
FLATNESS = (1e-6, 1e-3, 0.1, 1.0, 2.0, 30.0, 1e3)
"""Height over radius of the magnets."""

FIRST = """
import json, time
begin = time.perf_counter()
from analytic import magnet
imported = time.perf_counter()
magnet.cylinder_field([[1.0, 2.0, 3.0]], 2, 2, 1.2)
first = time.perf_counter()
magnet.cylinder_field([[1.0, 2.0, 3.0]] * magnet.MIN_COMPILED_POINTS, 2, 2, 1.2)
print(json.dumps([imported - begin, first - imported, time.perf_counter() - first]))
"""


def regions(flatness: float, count: int) -> dict[str, Array]:
    """Points of each region of a magnet of RADIUS, shape (count, 3), mm."""
    rng = np.random.default_rng(20160403)
    a, h = RADIUS, RADIUS * flatness
    size = math.hypot(a, h / 2)
    c, s = (f(rng.uniform(0, 2 * np.pi, count)) for f in (np.cos, np.sin))
    scale = np.hypot(c, s)
    c, s = c / scale, s / scale
    u, v = rng.uniform(-1, 1, (2, count))
    way = np.column_stack([np.sqrt(1 - u * u) * c, np.sqrt(1 - u * u) * s, u])
    step, angle = 10.0 ** rng.uniform(-12, -2, count), rng.uniform(0, 2 * np.pi, count)
    inner = a * np.sqrt(rng.uniform(0, 0.98, count))

    def ring(rho: Array, z: Array) -> Array:
        return np.column_stack([rho * c, rho * s, z])

    side = np.where(u < 0, -1.0, 1.0)
    return {
        "inside": ring(inner, 0.49 * h * v),
        "on the axis": np.column_stack([0 * u, 0 * u, 3 * h * v]),
        "1e-9 radii from the axis": ring(1e-9 * a + 0 * u, 3 * h * v),
        "1e-12 radii from the hull": ring(a * (1 + 1e-12 * side), 0.4 * h * v),
        "1e-12 radii from a face": ring(inner, h / 2 + 1e-12 * a * side),
        "1e-12 to 1e-2 radii from the rim": ring(a * (1 + step * np.cos(angle)), h / 2 + a * step * np.sin(angle)),
        "above the rim (r = radius)": ring(a * (1 + 1e-15 + 0 * u), h * (1 + 2 * np.abs(v))),
        "around it, to 5 sizes": way * (size * (1 + 4 * np.abs(v)))[:, None],
        "10 to 1e3 radii away": way * (a * 10.0 ** (2 + v))[:, None] + [0, 0, h],
        "1e3 to 1e6 radii away": way * (a * 10.0 ** (4.5 + 1.5 * v))[:, None] + [0, 0, h],
    }


def errors(count: int = 24, jacobians: int = 6) -> list[RegionErrors]:
    """The worst error of each program in each region of each magnet."""
    import magpylib

    kernel = _kernel()
    table = []
    for flatness in FLATNESS:
        a, h = RADIUS, RADIUS * flatness
        other = magpylib.magnet.Cylinder(polarization=(0, 0, 1), dimension=(2e-3 * a, 1e-3 * h))
        for name, points in regions(flatness, count).items():
            true = [field_reference.field(p, a, h) for p in points]
            slopes = [field_reference.jacobian(p, a, h) for p in points[:jacobians]] if "axis" not in name else []
            some = points[: len(slopes)]
            with np.errstate(all="ignore"):
                by_magpylib = np.asarray(other.getB(1e-3 * points))
            table.append(
                RegionErrors(
                    region=name,
                    height_per_radius=flatness,
                    numpy=_worst(magnet.numpy_field(points, a, h / 2, 1.0, slope=False)[0], true),
                    compiled=_worst(magnet.compiled_field(kernel, points, a, h / 2, 1.0, slope=False)[0], true),
                    magpylib=_worst(by_magpylib, true),
                    numpy_jacobian=_worst(magnet.numpy_field(some, a, h / 2, 1.0, slope=True)[1], slopes),
                    compiled_jacobian=_worst(
                        magnet.compiled_field(kernel, some, a, h / 2, 1.0, slope=True)[1], slopes
                    ),
                )
            )
    return table


def _kernel() -> ModuleType:
    kernel = magnet.compiled()
    if kernel is None:
        raise BadInput("the compiled kernel needs numba, which is not installed: install the extra `fast`")
    return kernel


def _worst(computed: Array, true: list[Array]) -> float:
    return max((field_reference.relative(b, t) for b, t in zip(computed, true, strict=True)), default=math.nan)


def speed(count: int = 1_000_000, runs: int = 5) -> list[ProgramTimes]:
    """CPU time for many points and clock time for one, of each program."""
    import magpylib

    kernel = _kernel()
    design = paper()
    radius, height = design.magnet_diameter / 2, design.magnet_height
    other = magpylib.magnet.Cylinder(polarization=(0, 0, design.remanence), dimension=(2e-3 * radius, 1e-3 * height))
    half = (radius, height / 2, design.remanence)
    programs: dict[str, Callable[[Array], object]] = {
        "compiled": lambda x: magnet.compiled_field(kernel, x, *half, slope=False),
        "compiled, two threads": lambda x: magnet.compiled_field(kernel, x, *half, slope=False, threads=2),
        "compiled, with Jacobian": lambda x: magnet.compiled_field(kernel, x, *half, slope=True),
        "NumPy": lambda x: magnet.numpy_field(x, *half, slope=False),
        "NumPy, with Jacobian": lambda x: magnet.numpy_field(x, *half, slope=True),
        f"magpylib {metadata.version('magpylib')}, getB": lambda x: other.getB(1e-3 * x),
    }
    many = np.random.default_rng(1).normal(size=(count, 3)) * 6
    for solve in programs.values():
        solve(many[:2000].copy())  # numba compiles or reads its functions at the first call
    cpu_us, clock_us = np.empty((2, len(programs), runs))
    for turn in range(runs):
        for k, solve in enumerate(programs.values()):
            begin = time.process_time(), time.perf_counter()
            solve(many)
            ended = time.process_time(), time.perf_counter()
            cpu_us[k, turn], clock_us[k, turn] = (1e6 * (b - a) / count for a, b in zip(begin, ended, strict=True))
    table = []
    for k, (name, solve) in enumerate(programs.items()):
        one, none = (_call_us(partial(solve, x), 5 * runs) for x in (many[:1].copy(), np.empty((0, 3))))
        table.append(
            ProgramTimes(
                name,
                many_us=float(np.median(cpu_us[k])),
                clock_us=float(np.median(clock_us[k])),
                faster=float(np.median(cpu_us[-1] / cpu_us[k])),
                shorter=float(np.median(clock_us[0] / clock_us[k])),
                one_us=one,
                none_us=none,
            )
        )
    return table


def _call_us(call: Callable[[], object], repeats: int) -> float:
    """The least of several means over 20 ms; NaN where the call is refused, as one without points by magpylib."""
    timer = timeit.Timer(call)
    try:
        number = 1 + int(0.02 / min(timer.repeat(3, 3)) * 3)
    except ValueError:
        return math.nan
    return 1e6 * min(timer.repeat(repeats, number)) / number


def first_calls() -> list[FirstCall]:
    """What a new process waits for: without anything compiled yet, and again."""
    calls = []
    with tempfile.TemporaryDirectory() as cache:
        for name in ("nothing compiled yet", "again"):
            env = {**os.environ, "NUMBA_CACHE_DIR": cache}
            ended = subprocess.run(
                [sys.executable, "-c", FIRST],
                cwd=provenance.ROOT,
                env=env,
                capture_output=True,
                text=True,
                check=True,
            )
            imports, first, load = json.loads(ended.stdout)
            calls.append(FirstCall(name, imports, first, load))
    return calls


def main(out: str) -> None:
    """Measure, and write field.csv and FIELD.md into a folder."""
    from studies.output.csv_tables import write_table

    with atomic_files.filled(out) as folder:
        about = benchmark_tables.machine()
        about |= {name: metadata.version(name) for name in ("numba", "magpylib", "mpmath")}
        times = speed()
        console.say("speed measured")
        calls = first_calls()
        by_region = errors()
        write_table(folder / "field.csv", [error.row() for error in by_region], digits=3)
        atomic_files.write_text(folder / "FIELD.md", field_report.report(by_region, times, calls, about, ABOUT))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "out/field")
