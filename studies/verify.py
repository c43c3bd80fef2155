"""Published and closed-form targets, each solved on a family of meshes and judged against a fixed tolerance.

Three kinds of judgement: the value on the finest mesh, its Richardson extrapolation, or the order of convergence of
an error. The extrapolation fits f + C h^p to the three finest meshes; where they give no positive order, the finest
value stands. Tolerances are promises and are never widened to make a target pass.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from analytic.magnet import cylinder_field
from studies import manufactured, problems
from studies.compare import write_table
from studies.files import write_text

Progress = Callable[[float, str], None]
Row = dict[str, Any]
Judged = Literal["finest", "extrapolated", "order"]

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Quantity:
    """One published number and how far the computed one may be from it, in the unit of both."""

    name: str
    published: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class Target:
    """A problem: `solve(n)` gives its quantities on mesh n; `quick` are the meshes of a reduced run."""

    name: str
    source: str
    solve: Callable[[int], Sequence[float]]
    quantities: tuple[Quantity, ...]
    meshes: tuple[int, ...] = (1,)
    quick: tuple[int, ...] = (1,)
    judged: Judged = "finest"


def _magnet(_: int) -> tuple[float, ...]:
    field = cylinder_field([[0, 0, z] for z in (5.0, 6.0, 7.0, 8.0)], 2.0, 4.0, 1.2)
    return tuple(1e3 * float(value) for value in field[:, 2])


def _blocks(_: int) -> tuple[float, ...]:
    cube = [problems.stretched_cube(2.0, mode)[0] for mode in ("uniaxial", "equibiaxial", "planar")]
    return (*cube, problems.stretched_cylinder(2.0)[0], *problems.sheared_cube(0.8))


def _relative(name: str, published: float, tolerance: float) -> Quantity:
    return Quantity(name, published, tolerance * abs(published))


def targets(*, quick: bool = False) -> list[Target]:
    """All of them, cheap ones first; if quick on the coarser meshes, and Reese's block at its two lower pressures."""
    reese = _reese((20, 40) if quick else (20, 40, 60, 80))
    found = [*_closed_forms(), *_families(), *_manufactured(), reese]
    return [replace(target, meshes=target.quick) for target in found] if quick else found


def _closed_forms() -> list[Target]:
    field = zip((5, 6, 7, 8), (77.684, 45.429, 28.626, 19.138), strict=True)
    block = (
        ("uniaxial P/mu, stretch 2, cube", 2 - 2**-2),
        ("equibiaxial P/mu, stretch 2, cube", 2 - 2**-5),
        ("planar P/mu, stretch 2, cube", 2 - 2**-3),
        ("uniaxial P/mu, stretch 2, section", 2 - 2**-2),
        ("simple shear 0.8, sigma_xz/mu", 0.8),
        ("simple shear 0.8, (sigma_xx - sigma_zz)/mu", 0.64),
    )
    depths = [_relative(f"F / Hertz at {d} mm", 1.0, 5e-3) for d in ("1e-6", "1e-5", "1e-4")]
    levels = ("quick", "standard", "fine")
    return [
        Target(
            "magnet 4 x 4 mm",
            "closed form",
            _magnet,
            tuple(Quantity(f"B_z, mT, at {z} mm", b, 6e-4) for z, b in field),
        ),
        Target("homogeneous states", "closed form", _blocks, tuple(_relative(*pair, 1e-10) for pair in block)),
        Target(
            "Hertz contact",
            "Hertz 1882; meshes are quick, standard and fine",
            lambda n: problems.hertz(levels[n - 1]),
            (*depths, Quantity("exponent of the force", 1.5, 3e-3)),
            meshes=(3,),
            quick=(3,),
        ),
    ]


def _families() -> list[Target]:
    sphere = ((1.25, 0.5518685), (2.0, 0.8069266))
    cylinder = ((0.25, 1.1963), (1.0, 2.955), (4.0, 32.36))
    return [
        Target(
            "thick sphere",
            "Bower, solidmechanics.org 4.2",
            partial(problems.thick_sphere, stretches=(1.25, 2.0)),
            tuple(_relative(f"p/mu at stretch {stretch:g}", p, 1e-4) for stretch, p in sphere),
            meshes=(4, 8, 16),
            quick=(4, 8),
        ),
        *(
            Target(
                f"bonded cylinder, S = {S:g}",
                "fine axisymmetric Taylor-Hood elements",
                partial(problems.bonded_cylinder, S=S),
                (_relative("E_a/E", modulus, 1e-3),),
                meshes=(16, 32, 64),
                quick=(8, 16, 32),
            )
            for S, modulus in cylinder
        ),
        Target(
            "Cook's membrane",
            "Elmer's test, after Mueller 2015",
            problems.cook,
            (_relative("u_y(48, 60), mm", 4.701, 2e-3),),
            meshes=(16, 32, 64),
            quick=(8, 16, 32),
            judged="extrapolated",
        ),
    ]


def _manufactured() -> list[Target]:
    orders = (Quantity("order of the displacement, L2", 3.0, 0.15), Quantity("order of the pressure, L2", 2.0, 0.15))
    meshes = {"tetrahedron": ((4, 6, 8), (2, 4))}
    return [
        Target(
            f"manufactured, {name}",
            "theory of P2/P1 elements",
            partial(manufactured.errors, name),
            orders,
            *meshes.get(name, ((8, 16, 32), (12, 24))),
            judged="order",
        )
        for name in manufactured.CASES
    ]


def _reese(levels: tuple[int, ...]) -> Target:
    published = {20: 22.0, 40: 42.5, 60: 59.0, 80: 70.0}
    return Target(
        "Reese's block",
        "Reese, Wriggers & Reddy 2000",
        partial(problems.reese_block, levels=levels),
        tuple(Quantity(f"compression, %, p/p0 = {level}", published[level], 0.5) for level in levels),
        meshes=(4, 8, 12),
        quick=(4,),
        judged="extrapolated",
    )


def run(*, quick: bool = False, folder: Path | None = None, progress: Progress | None = None) -> list[Row]:
    """Solve and judge all targets, and write verify.csv and VERIFY.md if told where.

    Parameters
    ----------
    quick : the reduced targets.

    Returns
    -------
    One row per quantity.
    """
    chosen = targets(quick=quick)
    rows: list[Row] = []
    for i, target in enumerate(chosen):
        rows += judge(target, i / len(chosen), progress)
    if folder is not None:
        write(folder, rows, quick=quick)
    return rows


def judge(target: Target, done: float = 0.0, progress: Progress | None = None) -> list[Row]:
    """Rows of one target; a problem that finds no solution fails with the reason in `message`."""
    begin, message = time.perf_counter(), ""
    values: list[Sequence[float]] = []
    for n in target.meshes:
        if progress is not None:
            progress(done, target.name + (f", mesh {n}" if len(target.meshes) > 1 else ""))
        try:
            values.append(target.solve(n))
        except ArithmeticError as error:
            message = f"mesh {n}: {error}"
            break
    seconds = time.perf_counter() - begin
    rows = []
    for i, quantity in enumerate(target.quantities):
        family = [] if message else [float(row[i]) for row in values]
        rows.append(_row(target, quantity, family, seconds) | {"message": message})
    return rows


def _row(target: Target, quantity: Quantity, family: Sequence[float], seconds: float) -> Row:
    computed = family[-1] if family else NAN
    extrapolated, order = richardson(target.meshes, family)
    if target.judged == "order" and family:
        (n0, n1), (e0, e1) = target.meshes[-2:], family[-2:]
        computed, extrapolated = math.log(e0 / e1) / math.log(n1 / n0), NAN
        order = computed
    counts = extrapolated if target.judged == "extrapolated" and math.isfinite(extrapolated) else computed
    error = counts - quantity.published
    return {
        "target": target.name,
        "quantity": quantity.name,
        "published": quantity.published,
        "computed": computed,
        "extrapolated": extrapolated,
        "order": order,
        "error_percent": 100 * error / quantity.published,
        "tolerance_percent": 100 * quantity.tolerance / quantity.published,
        "judged": target.judged,
        "passed": abs(error) <= quantity.tolerance,
        "seconds": seconds,
        "meshes": "-".join(map(str, target.meshes)),
        "source": target.source,
    }


def richardson(meshes: Sequence[int], values: Sequence[float]) -> tuple[float, float]:
    """Limit f and order p of f + C / n^p through the three finest meshes; NaN where there is none with 0.2 < p < 8.

    >>> f, p = richardson((2, 4, 6), [1 + n**-1.5 for n in (2, 4, 6)])
    >>> round(f, 10), round(p, 10)
    (1.0, 1.5)
    >>> richardson((1, 2, 4), (1.0, 2.0, 1.5))
    (nan, nan)
    """
    from scipy.optimize import brentq

    if len(values) < 3:
        return NAN, NAN
    (a, b, c), (f, g, h) = (float(n) for n in meshes[-3:]), values[-3:]
    if f == g or (h - g) / (g - f) <= 0:
        return NAN, NAN

    def excess(p: float) -> float:
        return float((b**-p - c**-p) / (a**-p - b**-p)) - (h - g) / (g - f)

    if excess(0.2) * excess(8.0) > 0:
        return NAN, NAN
    p = float(brentq(excess, 0.2, 8.0, xtol=1e-13))
    return float(h + (h - g) * c**-p / (b**-p - c**-p)), p


def write(folder: Path, rows: Sequence[Row], *, quick: bool) -> None:
    """verify.csv with every digit, VERIFY.md to read."""
    write_table(folder / "verify.csv", rows, digits=12)
    failed = [row for row in rows if not row["passed"]]
    verdict = f"{len(rows) - len(failed)} of {len(rows)} targets are met."
    heads = ["target", "quantity", "published", "computed", "extrapolated", "order", "error %", "allowed %", ""]
    lines = ["# Verification", "", f"`magtip verify{' --quick' if quick else ''}`: {verdict}", ""]
    lines += ["| " + " | ".join([*heads, "meshes"]) + " |", "|---" * (len(heads) + 1) + "|"]
    for row in rows:
        numbers = [_number(row[key], 6) for key in ("published", "computed", "extrapolated")]
        rest = [_number(row[key], 3) for key in ("order", "error_percent", "tolerance_percent")]
        verdict = "pass" if row["passed"] else f"**fail** {row['message']}".strip()
        lines.append(
            "| " + " | ".join([row["target"], row["quantity"], *numbers, *rest, verdict, row["meshes"]]) + " |"
        )
    lines += ["", *(__doc__ or "").split("\n\n", 1)[1].strip().splitlines(), "", "Sources:", ""]
    lines += [f"- {name}: {source}" for name, source in {row["target"]: row["source"] for row in rows}.items()]
    write_text(folder / "VERIFY.md", "\n".join(lines) + "\n")


def shown(row: Row) -> Row:
    """The row with enough digits of its values for a printed table."""
    return row | {key: _number(row[key], 6) for key in ("published", "computed", "extrapolated")}


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else ""


DETAILS = ("judged", "meshes", "source", "message")
"""Left out of the printed table."""
