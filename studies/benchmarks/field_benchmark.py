"""The exact field beside mpmath and magpylib: errors by region, and time for a million points, one, and the first.

`python -m studies.benchmarks.field_benchmark results/field` writes field.csv and FIELD.md. It needs magpylib, mpmath
and numba.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import metadata
from types import ModuleType

import numpy as np

from analytic import magnet
from geometry.arrays import Array
from geometry.design import BadInput, paper
from studies.benchmarks import benchmark_tables, field_reference
from studies.output import atomic_files, console, provenance, records
from studies.output.records import FlatRow

ABOUT = """\
Errors are |B - B_true| / |B_true|, of the Jacobian |J - J_true| / |J_true|, the worst of the points of a region and
of magnets with height/radius from 1e-6 to 1e3; the true values have 60 digits and take the points as they are in
double precision. Time for a million points around the paper's magnet (a normal distribution of 6 mm) is CPU time on
one thread, the median of runs in turn with magpylib. The cost of one point is that of a call with one point less
that of the same call with none, which is Python's own: converting, checking, allocating. First calls are those of a
new process, by the clock.
"""


RADIUS = 1.7
FLATNESS = (1e-6, 1e-3, 0.1, 1.0, 2.0, 30.0, 1e3)
"""Height over radius of the magnets."""
PROMISE = 1e-12
FASTER = 2.0
ONE_POINT_US = 5.0

FIRST = """
import json, time
begin = time.perf_counter()
from analytic import magnet
imported = time.perf_counter()
magnet.cylinder_field([[1.0, 2.0, 3.0]], 2, 2, 1.2)
first = time.perf_counter()
magnet.cylinder_field([[1.0, 2.0, 3.0]] * magnet.MANY, 2, 2, 1.2)
print(json.dumps([imported - begin, first - imported, time.perf_counter() - first]))
"""


@dataclass(frozen=True, slots=True)
class RegionErrors:
    """The worst relative errors of each program in a region of one magnet; NaN where none was measured."""

    region: str
    height_per_radius: float
    numpy: float = field(metadata={"column": "NumPy"})
    compiled: float
    magpylib: float
    numpy_jacobian: float = field(metadata={"column": "NumPy Jacobian"})
    compiled_jacobian: float = field(metadata={"column": "compiled Jacobian"})

    def row(self) -> FlatRow:
        """Its columns in field.csv."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class ProgramTimes:
    """CPU time for each of a million points, and clock time of a call with one point and with none, us."""

    program: str
    many_us: float
    one_us: float
    none_us: float


@dataclass(frozen=True, slots=True)
class FirstCall:
    """What a new process waits for, s: the import, the first call in NumPy, the kernel with its first call."""

    process: str
    import_s: float
    first_numpy_s: float
    kernel_s: float


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
                    numpy=_worst(magnet.in_numpy(points, a, h / 2, 1.0, slope=False)[0], true),
                    compiled=_worst(magnet.in_kernel(kernel, points, a, h / 2, 1.0, slope=False)[0], true),
                    magpylib=_worst(by_magpylib, true),
                    numpy_jacobian=_worst(magnet.in_numpy(some, a, h / 2, 1.0, slope=True)[1], slopes),
                    compiled_jacobian=_worst(magnet.in_kernel(kernel, some, a, h / 2, 1.0, slope=True)[1], slopes),
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
        "compiled": lambda x: magnet.in_kernel(kernel, x, *half, slope=False),
        "compiled, with Jacobian": lambda x: magnet.in_kernel(kernel, x, *half, slope=True),
        "NumPy": lambda x: magnet.in_numpy(x, *half, slope=False),
        "NumPy, with Jacobian": lambda x: magnet.in_numpy(x, *half, slope=True),
        f"magpylib {metadata.version('magpylib')}, getB": lambda x: other.getB(1e-3 * x),
    }
    many = np.random.default_rng(1).normal(size=(count, 3)) * 6
    spent: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(runs):
        for name, solve in programs.items():
            begin = time.process_time()
            solve(many)
            spent[name].append(1e6 * (time.process_time() - begin) / count)
    table = []
    for name, solve in programs.items():
        one, none = (_call_us(partial(solve, x), 5 * runs) for x in (many[:1].copy(), np.empty((0, 3))))
        table.append(ProgramTimes(name, statistics.median(spent[name]), one, none))
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


def report(
    errors: Sequence[RegionErrors], times: Sequence[ProgramTimes], calls: Sequence[FirstCall], about: dict[str, str]
) -> str:
    """FIELD.md."""
    own = max(max(error.numpy, error.compiled) for error in errors)
    fast, slow = times[0], times[-1]
    ratio, beyond = slow.many_us / fast.many_us, fast.one_us - fast.none_us
    lines = ["# The exact field", "", "`python -m studies.benchmarks.field_benchmark results/field`", ""]
    lines += _table(
        ["goal", "found", "met"],
        [
            [f"error at most {PROMISE:g} of B", f"{own:.1e}", _met(own <= PROMISE)],
            [f"a million points {FASTER:g} times as fast as magpylib", f"{ratio:.1f} times", _met(ratio >= FASTER)],
            [f"one point at most {ONE_POINT_US:g} us", f"{beyond:.1f} us", _met(beyond <= ONE_POINT_US)],
        ],
    )
    lines += ["", "## Worst relative error", ""]
    heads = ["region", "NumPy", "compiled", "NumPy Jacobian", "compiled Jacobian", "magpylib"]
    lines += _table(heads, _worst_by_region(errors))
    lines += ["", "Every region of every magnet is in field.csv.", "", "## Time", ""]
    heads = ["program", "us a point of a million", "call with one point, us", "call with none, us", "one point, us"]
    cells = [[t.program, *map(_us, (t.many_us, t.one_us, t.none_us, t.one_us - t.none_us))] for t in times]
    lines += _table(heads, cells)
    lines += ["", "## First calls", ""]
    heads = ["process", "import analytic.magnet, s", "first call in NumPy, s", "kernel loaded and called, s"]
    cells = [[c.process, f"{c.import_s:.2f}", f"{c.first_numpy_s:.2f}", f"{c.kernel_s:.2f}"] for c in calls]
    lines += _table(heads, cells)
    lines += [
        "",
        f"The kernel is loaded by a call with {magnet.MANY} points or more, or by `analytic.magnet.compiled()`.",
        "",
    ]
    lines += ["## How it was measured", "", *ABOUT.splitlines(), ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in about.items())]) + "\n"


def _worst_by_region(errors: Sequence[RegionErrors]) -> list[list[str]]:
    """Cells of each region: its name, and the worst error of each program over all magnets."""
    cells = []
    for region in dict.fromkeys(error.region for error in errors):
        own = [error for error in errors if error.region == region]
        worst = (
            max(error.numpy for error in own),
            max(error.compiled for error in own),
            max(error.numpy_jacobian for error in own),
            max(error.compiled_jacobian for error in own),
            max(error.magpylib for error in own),
        )
        cells.append([region, *map(_error, worst)])
    return cells


def _table(heads: list[str], rows: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (heads, ["---"] * len(heads), *rows)]


def _met(good: bool) -> str:
    return "yes" if good else "**no**"


def _error(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1e}"


def _us(value: float) -> str:
    return "refused" if math.isnan(value) else f"{value:.2f}"


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
        atomic_files.write_text(folder / "FIELD.md", report(by_region, times, calls, about))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "out/field")
