"""One measured solve, in a process of its own.

`python -m studies.benchmarks.benchmark_worker SPEC` prints one JSON object.

Imports are over before the clock starts, and so is the loading of the solver's library, so that they can be told
apart. CPU seconds count this process and its children; those of the children alone are the tetrahedral mesher's.
`SPEC` is a JSON object:

    {"task": "trace", "model", "magnet", "loads": [{"depth", ...}], "accuracy": {"section_size", ...}}
    {"task": "small shear", "depth"}         stiffness and tilt about a press, with the magnet, at level standard
    {"task": "modes", "count"}               natural frequencies with the magnet, at level standard
    {"task": "first", "command": [...]}      a command line of magtip, timed by the clock on the wall
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import runpy
import sys
import time
from typing import Any

Answer = dict[str, Any]


def main(text: str) -> None:
    """Do what a specification says and print the answer."""
    spec = json.loads(text)
    tasks = {"first": first, "trace": trace, "small shear": linearised, "modes": linearised}
    print(json.dumps(tasks[spec["task"]](spec)))


def trace(spec: Answer) -> Answer:
    """Follow a path of loads with the finite elements and tell forces, iterations and cost."""
    from dataclasses import replace

    from fem import accuracy as accuracy_levels
    from fem import equilibrium
    from fem.solvers import direct_solver
    from geometry.design import paper
    from geometry.loads import Load
    from geometry.meshing import mesh_cache

    pardiso = direct_solver.have_pardiso()
    loads = [Load(**load) for load in spec["loads"]]
    accuracy = replace(accuracy_levels.STANDARD, name="bench", **spec["accuracy"])
    before, wall, base = _cpu(), time.perf_counter(), _peak(resource.RUSAGE_SELF)
    with mesh_cache.bypassed():
        found = equilibrium.trace(
            paper(), loads, accuracy, magnet=spec["magnet"], model=spec["model"], estimate=False
        )
    own, children = (now - then for now, then in zip(_cpu(), before, strict=True))
    bad = [s for s in found if s.status != "ok"]
    return {
        "status": bad[0].status if bad else "ok",
        "message": bad[0].message if bad else "",
        "forces_N": [s.response.force for s in found],
        "tilts_rad": [(s.response.tilt,) for s in found if s.load.shears_tip],
        "dofs": found[-1].dofs,
        "iterations": sum(s.newton_iterations for s in found),
        "import_s": before[0],
        "cpu_s": own + children,
        "mesh_s": children,
        "wall_s": time.perf_counter() - wall,
        "base_MB": base,
        "solver": "pardiso" if pardiso else "superlu",
    }


def linearised(spec: Answer) -> Answer:
    """What follows from one tangent: a small shear, or vibrations."""
    import scipy.sparse.linalg  # noqa: F401

    from fem import modes, small_shear
    from fem.solvers import direct_solver
    from geometry.design import paper

    direct_solver.have_pardiso()
    before, wall, base = _cpu()[0], time.perf_counter(), _peak(resource.RUSAGE_SELF)
    if spec["task"] == "modes":
        modes.modes(paper(), count=spec["count"], estimate=False)
    else:
        small_shear.small_shear(paper(), spec["depth"], estimate=False)
    return {
        "status": "ok",
        "message": "",
        "import_s": before,
        "cpu_s": _cpu()[0] - before,
        "mesh_s": 0.0,
        "wall_s": time.perf_counter() - wall,
        "base_MB": base,
    }


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


def _cpu() -> tuple[float, float]:
    """CPU seconds of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), children.ru_utime + children.ru_stime


def _peak(who: int) -> float:
    """Largest resident memory so far, MB."""
    return resource.getrusage(who).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


if __name__ == "__main__":
    main(sys.argv[1])
