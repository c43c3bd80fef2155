"""One measured task, in a process of its own.

`python studies/validation/bench/bench_worker.py SPEC` prints one JSON object. The clock starts after the imports and
after a small task of the same kind, which loads the solver's library and the functions that numba has compiled. CPU
seconds count this process and its children. `SPEC` is one of:

    {"task": "trace", "model", "magnet", "loads": [{"depth", ...}], "accuracy": {"section_size", ...}}
    {"task": "small shear", "depth"}         stiffness and tilt about a press, with the magnet, at level standard
    {"task": "modes", "count"}               natural frequencies with the magnet, at level standard
    {"task": "field", "points"}              the field of the paper's magnet
    {"task": "magpylib", "points"}           the same by magpylib
"""

import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.design import paper

Answer = dict[str, Any]

OTHER: Answer = {"D": 8.2}
"""Fields of the design that is solved before the clock starts: nothing of it is used again."""
WARM = {"section_size": 0.25, "section_patch": 0.03, "harmonics": 2}
"""Accuracy of that solve."""


def main(text: str) -> None:
    spec = json.loads(text)
    tasks = {"trace": trace, "small shear": tangent, "modes": tangent, "field": field, "magpylib": field}
    print(json.dumps(tasks[spec["task"]](spec)))


def trace(spec: Answer) -> Answer:
    """Follow a path of loads with the finite elements and tell forces, iterations and cost."""
    from fem import equilibrium
    from fem.accuracy import STANDARD
    from geometry.loads import Load

    def states(given: Answer) -> list[Any]:
        loads = [Load(**load) for load in given["loads"]]
        accuracy = replace(STANDARD, name="bench", **given["accuracy"])
        design = replace(paper(), **given.get("design", {}))
        return equilibrium.trace(
            design, loads, accuracy, magnet=given["magnet"], model=given["model"], estimate=False
        )

    # that of a solid is of a section with harmonics, which loads the same compiled functions
    model = "harmonic" if spec["model"] in ("half", "full") else spec["model"]
    own = spec["loads"] if spec["loads"][-1].get("shear_x") else spec["loads"][:1]
    tenth = [{k: v / 10 if k in ("depth", "shear_x") else v for k, v in load.items()} for load in own]
    small = {**spec, "model": model, "loads": tenth, "accuracy": WARM, "design": OTHER}
    found, cost = timed(lambda: states(small), lambda: states(spec))
    bad = next((s for s in found if s.status != "ok"), None)
    answer = {"forces_N": [s.response.force for s in found], "dofs": found[-1].dofs}
    answer |= {"tilts_rad": [(s.response.tilt,) for s in found if s.load.shear_x]}
    answer |= {"iterations": sum(s.newton_iterations for s in found)}
    return cost | answer | ({"status": bad.status, "message": bad.message} if bad else {})


def tangent(spec: Answer) -> Answer:
    from fem.analyses.modes import modes
    from fem.analyses.small_shear import small_shear

    def solve(design: Any) -> None:
        if spec["task"] == "modes":
            modes(design, count=spec["count"], estimate=False)
        else:
            small_shear(design, spec["depth"], estimate=False)

    return timed(lambda: solve(replace(paper(), **OTHER)), lambda: solve(paper()))[1]


def field(spec: Answer) -> Answer:
    """Compute the field of the paper's magnet at normally distributed points, standard deviation 6 mm."""
    design, version = paper(), ""
    points = np.random.default_rng(1).normal(size=(spec["points"], 3)) * 6
    solve: Callable[[Any], Any]
    if spec["task"] == "magpylib":
        import magpylib

        size = 1e-3 * design.magnet_diameter, 1e-3 * design.magnet_height
        source = magpylib.magnet.Cylinder(polarization=(0, 0, design.remanence), dimension=size)
        solve, version = lambda x: source.getB(1e-3 * x), str(magpylib.__version__)
    else:
        from analytic.magnet import cylinder_field

        magnet = design.magnet_diameter / 2, design.magnet_height, design.remanence
        solve = lambda x: cylinder_field(x, *magnet)  # noqa: E731
    return timed(lambda: solve(points[:2000].copy()), lambda: solve(points))[1] | {"version": version}


def timed(small: Callable[[], object], solve: Callable[[], Any]) -> tuple[Any, Answer]:
    imported, base = cpu()[0], peak()
    small()
    before, wall = cpu(), time.perf_counter()
    found = solve()
    own, children = (now - then for now, then in zip(cpu(), before, strict=True))
    cost = {"import_s": imported, "cpu_s": own + children, "base_MB": base}
    return found, cost | {"status": "ok", "message": "", "wall_s": time.perf_counter() - wall}


def cpu() -> tuple[float, float]:
    """Return CPU seconds of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), children.ru_utime + children.ru_stime


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


if __name__ == "__main__":
    main(sys.argv[1])
