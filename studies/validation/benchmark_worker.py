"""One measured task, in a process of its own.

`python studies/validation/benchmark_worker.py SPEC` prints one JSON object. The packages are those of PYTHONPATH:
today's, or those of the commit with which `studies.validation.earlier_commit` compares them.

The clock starts after the imports and after a small task of the same kind, which loads the solver's library and the
functions that numba has compiled. CPU seconds count this process and its children; those of the children alone are
the tetrahedral mesher's. `SPEC` is a JSON object:

    {"task": "trace", "model", "magnet", "loads": [{"depth", ...}], "accuracy": {"section_size", ...}}
                                             with "operations": true those of the linear algebra
                                             instead of the time
    {"task": "small shear", "depth"}         stiffness and tilt about a press, with the magnet, at level standard
    {"task": "modes", "count"}               natural frequencies with the magnet, at level standard
    {"task": "section", "designs": [{"D", ...}], "size"}  meshes of the sections of designs, size over D
    {"task": "field", "points", "threads"}   the field of the paper's magnet
    {"task": "magpylib", "points"}           the same by magpylib
    {"task": "compiled functions"}           the wait for compiling, or for loading, all functions for numba
    {"task": "machine"}                      multiplications of matrices and memory per second
    {"task": "first", "command": [...]}      a command line of magtip, timed by the clock on the wall
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import json
import math
import os
import resource
import runpy
import statistics
import sys
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

Answer = dict[str, Any]

SOLVER = ("fem.solve.pardiso", "fem.linear")
ACCURACY = ("fem.accuracy", "fem.levels")
LOADS = ("geometry.loads", "geometry.scene")
CACHE = ("geometry.meshing.mesh_cache", "geometry.cache")
SMALL_SHEAR = ("fem.analyses.small_shear", "fem.analyses.stability")
"""Names of modules: today's, and those of the earlier commit."""
WARM = {"section_size": 0.25, "section_patch": 0.03, "harmonics": 2}
"""Accuracy of the small solve before the clock starts."""


def main(text: str) -> None:
    """Do what a specification says and print the answer."""
    spec = json.loads(text)
    tasks = {
        "first": first,
        "trace": trace,
        "small shear": linearised,
        "modes": linearised,
        "section": sections,
        "field": field,
        "magpylib": magpylib,
        "compiled functions": compiled_functions,
        "machine": machine,
    }
    print(json.dumps(tasks[spec["task"]](spec)))


def trace(spec: Answer) -> Answer:
    """Follow a path of loads with the finite elements and tell forces, iterations and cost."""
    solver, compiled = _module(*SOLVER), _prepared()
    base = _peak(resource.RUSAGE_SELF)
    _trace(_smaller(spec))
    before, wall = _cpu(), time.perf_counter()
    if spec.get("operations"):
        return _counted(lambda: _trace(spec))
    found = _trace(spec)
    own, children = (now - then for now, then in zip(_cpu(), before, strict=True))
    bad = [s for s in found if s.status != "ok"]
    return {
        "status": bad[0].status if bad else "ok",
        "message": bad[0].message if bad else "",
        "forces_N": [s.response.force for s in found],
        "tilts_rad": [(s.response.tilt,) for s in found if s.load.shear_x],
        "dofs": found[-1].dofs,
        "iterations": sum(s.newton_iterations for s in found),
        "import_s": before[0],
        "cpu_s": own + children,
        "mesh_s": children,
        "wall_s": time.perf_counter() - wall,
        "base_MB": base,
        "solver": "pardiso" if solver.have_pardiso() else "superlu",
        "compiled": compiled,
    }


def _trace(spec: Answer) -> list[Any]:
    """Return the states of a path of loads."""
    from dataclasses import replace

    from fem import equilibrium
    from geometry.design import paper

    Load, levels = _module(*LOADS).Load, _module(*ACCURACY)
    loads = [Load(**load) for load in spec["loads"]]
    accuracy = replace(levels.STANDARD, name="bench", **spec["accuracy"])
    design = replace(paper(), **spec.get("design", {}))
    with _module(*CACHE).bypassed():
        model, magnet = spec["model"], spec["magnet"]
        return list(equilibrium.trace(design, loads, accuracy, magnet=magnet, model=model, estimate=False))


def _counted(solve: Callable[[], object]) -> Answer:
    """Return the operations of the linear algebra of a solve."""
    from studies.validation import operation_counts

    with operation_counts.counted() as counts:
        solve()
    return {"status": "ok", "message": "", **counts.row()}


def _smaller(spec: Answer) -> Answer:
    """Return the small solve before that of a specification: of another design, so that nothing of it is reused.

    That of a solid is of a section with harmonics, because its mesher would take seconds.
    """
    tenth = [
        {name: value / 10 if name in ("depth", "shear_x") else value for name, value in load.items()}
        for load in (spec["loads"] if spec["loads"][-1].get("shear_x") else spec["loads"][:1])
    ]
    return {
        **spec,
        "model": "harmonic" if spec["model"] in ("half", "full") else spec["model"],
        "loads": tenth,
        "accuracy": WARM,
        "design": {"D": 8.2},
    }


def linearised(spec: Answer) -> Answer:
    """What follows from one tangent: a small shear, or vibrations."""
    import scipy.sparse.linalg  # noqa: F401

    from fem.analyses import modes
    from geometry.design import paper

    _module(*SOLVER).have_pardiso()
    compiled, base = _prepared(), _peak(resource.RUSAGE_SELF)
    task: Callable[..., Any] = modes.modes
    options: Answer = {"count": spec.get("count")}
    if spec["task"] == "small shear":
        task, options = _module(*SMALL_SHEAR).small_shear, {"depth": spec["depth"]}
    if "estimate" in inspect.signature(task).parameters:
        options["estimate"] = False
    with _module(*CACHE).bypassed():
        task(_other(), **options)
        if spec.get("operations"):
            return _counted(lambda: task(paper(), **options))
        return _timed(lambda: task(paper(), **options)) | {"base_MB": base, "compiled": compiled}


def sections(spec: Answer) -> Answer:
    """Mesh the sections of designs; `each_s` has the CPU seconds of each, None where there is no mesh."""
    from dataclasses import replace

    from geometry.design import paper
    from geometry.section import section

    compiled = _prepared()

    def seconds(design: Any) -> float:
        size = spec["size"] * design.D
        # the tip of a press to D/8
        tip = size / 0.72 * math.sqrt(design.R / (8 * design.D))
        begin = time.process_time()
        section(design.shape, size, tip_size=min(tip, size))
        return time.process_time() - begin

    seconds(_other())
    each: list[float | None] = []
    before = _cpu()[0]
    for fields in spec["designs"]:
        try:
            each.append(seconds(replace(paper(), **fields)))
        except (ValueError, RuntimeError):  # no such design, or no mesh
            each.append(None)
    meshed = [value for value in each if value is not None]
    return {
        "status": "ok",
        "message": "",
        "import_s": before,
        "cpu_s": statistics.median(meshed),
        "each_s": each,
        "compiled": compiled,
    }


def field(spec: Answer) -> Answer:
    """Compute the field of the paper's magnet at points around it."""
    from analytic import magnet
    from geometry.design import paper

    design = paper()
    values = design.magnet_diameter / 2, design.magnet_height, design.remanence
    return _field(spec["points"], lambda x: magnet.cylinder_field(x, *values))


def magpylib(spec: Answer) -> Answer:
    """Compute the same field by magpylib."""
    import magpylib

    from geometry.design import paper

    design = paper()
    size = 1e-3 * design.magnet_diameter, 1e-3 * design.magnet_height
    source = magpylib.magnet.Cylinder(polarization=(0, 0, design.remanence), dimension=size)
    return _field(spec["points"], lambda x: source.getB(1e-3 * x)) | {"version": magpylib.__version__}


def _field(count: int, solve: Callable[[Any], Any]) -> Answer:
    """Time a field at normally distributed points, standard deviation 6 mm."""
    import numpy as np

    points = np.random.default_rng(1).normal(size=(count, 3)) * 6
    solve(points[: min(count, 2000)].copy())
    return _timed(lambda: solve(points))


def _timed(solve: Callable[[], object]) -> Answer:
    """Return CPU seconds and time of a solve, after the CPU seconds before it."""
    before, wall = _cpu()[0], time.perf_counter()
    solve()
    return {
        "status": "ok",
        "message": "",
        "import_s": before,
        "cpu_s": _cpu()[0] - before,
        "mesh_s": 0.0,
        "wall_s": time.perf_counter() - wall,
    }


def compiled_functions(spec: Answer) -> Answer:
    """Time numba's import, and small solves of all kinds twice: the first compiles, or loads, their functions."""
    from geometry.design import paper

    begin = time.perf_counter()
    usable = _prepared()
    imported = time.perf_counter() - begin
    shear = [{"depth": 0.2, "friction": "stick"}, {"depth": 0.2, "shear_x": 0.1, "friction": "stick"}]
    slip = [{**load, "friction": 0.5} for load in shear]
    half = {"solid_size": 0.3, "solid_patch": 0.1}
    solves: list[Answer] = [
        {"model": "axisymmetric", "magnet": "ignored", "loads": [{"depth": 0.2}], "accuracy": WARM},
        {"model": "harmonic", "magnet": "rigid", "loads": shear, "accuracy": WARM},
        {"model": "harmonic", "magnet": "rigid", "loads": slip, "accuracy": WARM},
        {"model": "half", "magnet": "rigid", "loads": shear[:1], "accuracy": half},
    ]
    from analytic import magnet
    from fem.analyses import modes, small_shear

    passes = []
    for _ in range(2):
        begin = time.perf_counter()
        for solve in solves:
            _trace(solve)
        small_shear.small_shear(paper(), 0.2, estimate=False)
        modes.modes(paper(), count=1, estimate=False)
        magnet.cylinder_field([[1.0, 2.0, 3.0]] * magnet.MIN_COMPILED_POINTS, 2, 2, 1.2)
        passes.append(time.perf_counter() - begin)
    wait = imported + max(passes[0] - passes[1], 0.0) if usable else 0.0
    return {"status": "ok", "message": "", "import_s": imported, "wall_s": wait, "compiled": usable}


def machine(spec: Answer) -> Answer:
    """Measure floating-point operations a second in products of matrices, and bytes a second in sums of arrays."""
    import numpy as np

    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 1000, 1000))
    long = rng.normal(size=(3, 8_000_000))

    def least(work: Callable[[], object]) -> float:
        times = []
        for _ in range(7):
            begin = time.process_time()
            work()
            times.append(time.process_time() - begin)
        return min(times)

    product, total = least(lambda: a @ b), least(lambda: np.add(long[0], long[1], out=long[2]))
    return {"status": "ok", "message": "", "flops_per_s": 2e9 / product, "bytes_per_s": long.nbytes / total}


def first(spec: Answer) -> Answer:
    """Imports and one command line, as a user waits for them: by the clock on the wall."""
    begin = time.perf_counter()
    import cyclopts  # noqa: F401

    from studies import deferred_modules

    deferred_modules.defer()  # as the command does before it imports anything of finite elements
    import fem.equilibrium  # noqa: F401
    from studies.inputs.exit_status import GOOD
    from studies.simulation import load_cases  # noqa: F401

    imported = time.perf_counter()
    # by its name, as Python starts it: the command line imports the benchmarks, not they it
    sys.argv = ["magtip", *spec["command"]]
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        try:
            runpy.run_module("studies.cli", run_name="__main__")
        except SystemExit as end:
            status = end.code
    return {
        "status": "ok" if status == GOOD else "failed",
        "message": "" if status == GOOD else f"exit status {status}",
        "import_s": imported - begin,
        "wall_s": time.perf_counter() - begin,
    }


def _module(*names: str) -> ModuleType:
    """Import the first of some modules that exists."""
    for name in names[:-1]:
        with contextlib.suppress(ModuleNotFoundError):
            return importlib.import_module(name)
    return importlib.import_module(names[-1])


def _prepared() -> bool:
    """Import numba, by which all solves run compiled; return whether they do: those of the earlier commit do not."""
    try:
        importlib.import_module("geometry.compiled")
    except ModuleNotFoundError:
        return False
    importlib.import_module("numba")
    return True


def _other() -> Any:
    """Return another design than the paper's, whose results help none of the paper's."""
    from dataclasses import replace

    from geometry.design import paper

    return replace(paper(), D=8.2)


def _cpu() -> tuple[float, float]:
    """CPU seconds of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), children.ru_utime + children.ru_stime


def _peak(who: int) -> float:
    """Largest resident memory so far, MB."""
    return resource.getrusage(who).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


if __name__ == "__main__":
    main(sys.argv[1])
