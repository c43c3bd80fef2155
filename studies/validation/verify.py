"""Published and closed-form problems, solved on families of meshes and checked against fixed tolerances.

ABOUT, which the report prints, says which value is checked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path

from geometry.bad_input import SolveFailed
from geometry.messages import Progress
from studies.output.csv_tables import write_table
from studies.output.provenance import versions
from studies.validation import pages
from studies.validation.pages import Row
from studies.validation.verify_targets import Quantity, Target, targets

ABOUT = """\
Each target is checked by one of three numbers: the value on the finest mesh, its Richardson extrapolation, or the
order of convergence of an error. The extrapolation fits f + C h^p to the three finest meshes. If these yield no
positive order, the value on the finest mesh is checked. Tolerances are fixed and are never widened to make a target
pass.
"""

NAN = math.nan


DETAILS = ("judged", "meshes", "source", "message", "note")
"""Columns that the printed table leaves out."""


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> list[Row]:
    """Solve all targets, and write verify.csv and VERIFY.md if a folder is given.

    Parameters
    ----------
    quick : solve the reduced targets.
    command : the command line that the report quotes.

    Returns
    -------
    One comparison per quantity.
    """
    origin, chosen = versions(), targets(quick=quick)
    comparisons: list[Row] = []
    for i, target in enumerate(chosen):
        comparisons += evaluate(target, i / len(chosen), progress)
    if folder is not None:
        write(folder, comparisons, origin, command)
    return comparisons


def evaluate(target: Target, done: float = 0.0, progress: Progress | None = None) -> list[Row]:
    """Comparisons of one target; a problem that finds no solution fails with the reason in `message`.

    Parameters
    ----------
    done : share of the targets solved before, for the progress.
    """
    begin, message = time.perf_counter(), ""
    values: list[Sequence[float]] = []
    for n in target.meshes:
        if progress is not None:
            progress(done, target.name + (f", mesh {n}" if len(target.meshes) > 1 else ""))
        try:
            values.append(target.solve(n))
        except SolveFailed as error:
            message = f"mesh {n}: {error}"
            break
    seconds = time.perf_counter() - begin
    families = [[] if message else [float(answer[i]) for answer in values] for i in range(len(target.quantities))]
    return [
        _comparison(target, quantity, family, seconds, message)
        for quantity, family in zip(target.quantities, families, strict=True)
    ]


def _comparison(target: Target, quantity: Quantity, family: Sequence[float], seconds: float, message: str) -> Row:
    """Compare a quantity's values on the family of meshes, the finest last, with the published one.

    `computed` is the value on the finest mesh, or the order of convergence if that is checked; `extrapolated` and
    `order` are limit and order of Richardson's extrapolation; NaN where nothing was computed.
    """
    computed = family[-1] if family else NAN
    extrapolated, order = richardson(target.meshes, family)
    if target.judged == "order" and family:
        (n0, n1), (e0, e1) = target.meshes[-2:], family[-2:]
        computed, extrapolated = math.log(e0 / e1) / math.log(n1 / n0), NAN
        order = computed
    checked = extrapolated if target.judged == "extrapolated" and math.isfinite(extrapolated) else computed
    error = checked - quantity.published
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
        "note": target.note,
        "message": message,
    }


def richardson(meshes: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Return limit f and order p of f + C / n^p through the three finest meshes; NaN if no p in (0.2, 8) fits.

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


def write(folder: Path, comparisons: Sequence[Row], origin: str, command: str) -> None:
    """Write verify.csv with 12 digits and the report VERIFY.md."""
    write_table(folder / "verify.csv", comparisons, digits=12)
    met = f"{sum(c['passed'] for c in comparisons)} of {len(comparisons)} targets are met."
    shown = [printed(c) | {"": "pass" if c["passed"] else f"**fail** {c['message']}".strip()} for c in comparisons]
    heads = {name: name for name in ("target", "quantity", "published", "computed", "extrapolated", "order")}
    heads |= {"error_percent": "error %", "tolerance_percent": "allowed %", "": "", "meshes": "meshes"}
    sources = {c["target"]: c["source"] for c in comparisons}
    notes = {c["target"]: c["note"] for c in comparisons if c["note"]}
    blocks = ["# Verification", met, pages.markdown(shown, heads), ABOUT]
    blocks += ["Sources:", pages.listed(f"{name}: {text}" for name, text in sources.items())]
    blocks += ["Notes:", pages.listed(f"{name}: {text}" for name, text in notes.items())]
    pages.write(folder / "VERIFY.md", blocks, command, origin)


def printed(comparison: Row) -> Row:
    """Return a row with enough digits of the values, for a printed table."""
    names = ("published", "computed", "extrapolated")
    return comparison | {name: pages.cell(comparison[name], 6) for name in names}
