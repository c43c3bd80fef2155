"""Checks of Coulomb friction against theory: onset of slip, full slip, cycles of shear, other models."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from fem.accuracy import QUICK, STANDARD, Accuracy
from fem.equilibrium import trace
from fem.scene import Model
from fem.solution import Solution
from geometry.bad_input import SolveFailed
from geometry.design import paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.output.figures import Figure, markers, rule, save, styles
from studies.output.result import Result
from studies.validation import pages
from studies.validation.pages import Check, Row

NAN = math.nan
FILES = ("FRICTION.md", "friction.csv", "friction.png")
DEPTH, TURN, TILT = 1.0, 2.0, 0.1
"""Depth of the press before full slip and before the cycle, and largest shear of the cycle, mm; tilt of the plate."""
MUS = {0.05: 0.5, 0.1: 1.0, 0.2: 2.0, 0.5: 4.0}
"""Coefficients of friction, and for each a shear beyond full slip, mm."""
SOLID_MODELS: tuple[Model, ...] = ("half", "full")
COARSE = replace(QUICK, name="coarse", section_size=0.2, harmonics=1)
ONSET = replace(STANDARD, name="onset", section_size=0.045, harmonics=2)
QUICK_ONSET = replace(ONSET, section_size=0.06, harmonics=1)
"""Accuracies for the onset. The stick area is counted in points of integration: its error is 16 % with edges of 0.09,
11 % with 0.06, 5 % with 0.045, and still 5 % with 0.03."""
SOLID = replace(QUICK, name="solid", solid_size=0.2, solid_patch=0.04)


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Check Coulomb friction against Cattaneo and Mindlin, full slip and energy; exit status 3 if a check fails.

    Parameters
    ----------
    quick
        Use coarser meshes and no tetrahedra: one minute instead of several.
    """
    curves: list[list[Solution]] = []
    loop: list[Solution] = []
    level = COARSE if quick else QUICK

    def sheared(mu: float) -> list[Row]:
        curves.append(curve(mu, MUS[mu], 8, level))
        return [full_slip(curves[-1])]

    def cycled() -> list[Row]:
        loop.extend(cycle(0.2, level))
        return closed(loop)

    parts: dict[str, Callable[[], list[Row]]] = {"onset": lambda: onset(QUICK_ONSET if quick else ONSET)}
    parts |= {f"full slip, mu = {mu:g}": partial(sheared, mu) for mu in MUS} | {"cycle": cycled}
    if not quick:
        parts |= {f"{model} model": partial(other_model, model) for model in SOLID_MODELS}
        parts["tilted plate"] = lambda: [tilted(SOLID)]
    checks: list[Row] = []
    for i, (name, part) in enumerate(parts.items()):
        progress(i / len(parts), name)
        try:
            checks += part()
        except SolveFailed as stop:
            checks.append(_check(name, f"no measurement: {stop}", NAN, NAN, NAN))
    return result(checks, curves, loop, "quick" if quick else "full")


def result(
    checks: Sequence[Row], curves: Sequence[Sequence[Solution]], loop: Sequence[Solution], run: str = "full"
) -> Result:
    misses = {check["quantity"]: check["off"] for check in checks if not check["passed"]}
    files = {"friction.png": lambda path: save(path, draw_friction(curves, loop))}
    page, look = {"rows": checks}, {"first": ("quantity", "value", "expected", "passed")}
    return pages.study(
        "friction", "Friction", checks, page, None, look, misses=misses, run=run, digits=9, files=files
    )


def _check(part: str, quantity: str, value: float, expected: float, bound: float) -> Row:
    check = Check(quantity, value, expected, bound)
    row: Row = {"check": part, "quantity": quantity, "value": value, "expected": expected}
    return row | {"off": check.off, "bound": bound, "passed": check.passed}


def _follow(
    loads: Sequence[Load], level: Accuracy, magnet: Magnet = "rigid", model: Model = "auto"
) -> list[Solution]:
    states = trace(paper(), loads, level, magnet=magnet, model=model, estimate=False)
    if states[-1].status != "ok":
        raise SolveFailed(states[-1].message)
    return states


def onset(level: Accuracy, mu: float = 0.3, depth: float = 1e-5) -> list[Row]:
    """Check tangential force and stick area against Cattaneo and Mindlin, up to full slip and beyond."""
    design = paper()
    G, nu, radius = design.E / 2 / (1 + design.nu), design.nu, math.sqrt(design.R * depth)
    normal = 4 / 3 * design.E / (1 - nu**2) * radius * depth
    full = 3 * mu * normal * (2 - nu) / (16 * G * radius)
    shares = (0.25, 0.5, 0.75, 1.5)
    loads = [Load(depth=depth, shear_x=share * full, friction=mu) for share in (0.0, *shares)]
    checks = []
    for share, state in zip(shares, _follow(loads, level, "ignored")[1:], strict=True):
        pull, _, push = state.response.force
        stick, where = max(1 - share, 0.0), f"at {share:g} of Mindlin's full-slip shear"
        name = f"tangential force / (mu F_N) {where}"
        checks.append(_check("onset", name, pull / (mu * push), 1 - stick**1.5, 0.04))
        if share >= 0.5:  # at a smaller share the slipping ring is narrower than an element
            stuck = NAN if state.slip_share is None else 1 - state.slip_share
            checks.append(_check("onset", f"stick share of the contact area {where}", stuck, stick, 0.15))
    return checks


def curve(mu: float, farthest: float, count: int, level: Accuracy) -> list[Solution]:
    shears = np.linspace(0.0, farthest, count + 1)
    states = _follow([Load(depth=DEPTH, shear_x=float(x), friction=mu) for x in shears], level)
    if states[-1].slip_share != 1:
        raise SolveFailed(f"at mu = {mu:g} and a shear of {farthest:g} mm the contact does not slip as a whole")
    return states


def full_slip(states: Sequence[Solution]) -> Row:
    last, mu = states[-1], float(states[-1].load.friction)
    ratio = last.response.force[0] / last.response.force[2]
    return _check("full slip", f"tangential / normal force, mu = {mu:g}", ratio, mu, 0.01)


def cycle(mu: float, level: Accuracy, steps: int = 10) -> list[Solution]:
    up = np.linspace(0, TURN, steps // 2 + 1)
    shears = [*up, *np.linspace(TURN, -TURN, 2 * steps + 1)[1:], *np.linspace(-TURN, TURN, 2 * steps + 1)[1:]]
    return _follow([Load(depth=DEPTH, shear_x=float(x), friction=mu) for x in shears], level)


def closed(states: Sequence[Solution]) -> list[Row]:
    """Check that a cycle closes, that its branches mirror each other, and that its area is the dissipated energy."""
    shear, force = [s.load.shear_x for s in states], [s.response.force[0] for s in states]
    turn, back, end = shear.index(max(shear)), shear.index(min(shear)), len(shear) - 1
    loop = slice(turn, end + 1)
    area = float(np.trapezoid(force[loop], shear[loop]))
    lost = states[end].dissipated - states[turn].dissipated
    opposite = "force at the opposite end of the shear / force at the start"
    return [
        _check("cycle", "force at the end / force at the start", force[end] / force[turn], 1.0, 0.005),
        _check("cycle", opposite, force[back] / force[turn], -1.0, 0.005),
        _check("cycle", "dissipated energy / area of the loop", lost / area, 1.0, 0.02),
    ]


def other_model(model: Model, mu: float = 0.2, shears: Sequence[float] = (0.25, 1.0)) -> list[Row]:
    loads = [Load(depth=0.5, shear_x=shear, friction=mu) for shear in shears]
    solid = _follow(loads, SOLID, "ignored", model=model)
    section = _follow(loads, STANDARD, "ignored", model="harmonic")
    checks = []
    for one, other in zip(solid, section, strict=True):
        where = f"at a shear of {one.load.shear_x:g} mm / that of the harmonic model"
        for i, name in ((0, "tangential"), (2, "normal")):
            ratio = one.response.force[i] / other.response.force[i]
            checks.append(_check(f"{model} model", f"{name} force {where}", ratio, 1.0, 0.02))
    return checks


def tilted(level: Accuracy, mu: float = 0.3, depth: float = 0.5, shear: float = 2.5) -> Row:
    """Check full slip under a tilted plate. A response holds the tip's force along x and the plate's along z."""
    load = Load(depth=depth, shear_x=shear, friction=mu, plate_tilt=TILT)
    (state,) = _follow([load], level, "ignored", model="full")
    x, _, z = state.response.force
    along, across = x * math.cos(TILT) + z * math.sin(TILT), z * math.cos(TILT) - x * math.sin(TILT)
    if state.slip_share != 1:
        raise SolveFailed(f"under a tilted plate a shear of {shear:g} mm is not enough for full slip")
    name = f"force along / across the plate, tilt {TILT:g} rad, mu = {mu:g}"
    return _check("tilted plate", name, along / across, mu, 0.01)


def draw_friction(curves: Sequence[Sequence[Solution]], loop: Sequence[Solution]) -> list[Figure]:
    import altair as alt

    x, ratio, force = "shear (mm)", "tangential over normal force", "force along the shear (N)"

    def table(states: Sequence[Solution]) -> pd.DataFrame:
        found = pd.DataFrame([state.response.force for state in states], columns=[force, "y", "z"])
        found[x], found[ratio] = [state.load.shear_x for state in states], found[force] / found["z"]
        return found.assign(series=f"\N{GREEK SMALL LETTER MU} = {states[0].load.friction:g}")

    figures = []
    if curves:
        limits = [layer for states in curves for layer in rule("y", float(states[0].load.friction))]
        slips = pd.concat([table(states)[[x, ratio, "series"]] for states in curves], ignore_index=True)
        lines = alt.Chart().mark_line(point=markers(slips)).encode(x=x, y=ratio, **styles(slips["series"]))
        figures.append(Figure("Onset of slip", "", alt.layer(*limits, lines, data=slips), slips))
    if loop:
        cycle = table(loop)
        title = f"A cycle of shear, {cycle['series'].iloc[0]}"
        cycle = cycle[[x, force]]
        whole = alt.Chart(cycle.reset_index(names="order"))
        line = whole.mark_line(point=markers(cycle)).encode(x=x, y=force, order="order")
        figures.append(Figure(title, "", line, cycle))
    return figures
