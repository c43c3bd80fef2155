"""Published and closed-form problems, solved on families of meshes and checked against fixed tolerances.

ABOUT, which the report prints, says which value is checked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from geometry.bad_input import SolveFailed
from geometry.messages import Progress
from studies.output import records
from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.provenance import made, versions
from studies.output.records import FlatRow
from studies.validation.verification_target import Judged, Quantity, Target
from studies.validation.verify_targets import targets

ABOUT = """\
Each target is checked by one of three numbers: the value on the finest mesh, its Richardson extrapolation, or the
order of convergence of an error. The extrapolation fits f + C h^p to the three finest meshes. If these yield no
positive order, the value on the finest mesh is checked. Tolerances are fixed and are never widened to make a target
pass.
"""

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Comparison:
    """A computed quantity and its published value; NaN where nothing was computed.

    Attributes
    ----------
    computed : value on the finest mesh, or the order of convergence if that is checked.
    extrapolated, order : limit and order of Richardson's extrapolation.
    error_percent, tolerance_percent : percent of the published value.
    judged : which number is checked against the tolerance.
    seconds : time of all meshes of the target.
    meshes : elements along a side, joined by hyphens.
    message : reason why the problem was not solved, or empty.
    """

    target: str
    quantity: str
    published: float
    computed: float
    extrapolated: float
    order: float
    error_percent: float
    tolerance_percent: float
    judged: Judged
    passed: bool
    seconds: float
    meshes: str
    source: str
    note: str
    message: str

    def row(self) -> FlatRow:
        """Return the columns of verify.csv and JSON."""
        return records.flat(self)

    def printed(self) -> FlatRow:
        """Return the columns of a printed table, with enough digits of the values."""
        values = {"published": self.published, "computed": self.computed, "extrapolated": self.extrapolated}
        return self.row() | {name: _number(value, 6) for name, value in values.items()}


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> list[Comparison]:
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
    comparisons: list[Comparison] = []
    for i, target in enumerate(chosen):
        comparisons += evaluate(target, i / len(chosen), progress)
    if folder is not None:
        write(folder, comparisons, origin, command)
    return comparisons


def evaluate(target: Target, done: float = 0.0, progress: Progress | None = None) -> list[Comparison]:
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


def _comparison(
    target: Target, quantity: Quantity, family: Sequence[float], seconds: float, message: str
) -> Comparison:
    """Compare a quantity's values on the family of meshes, the finest last, with the published one."""
    computed = family[-1] if family else NAN
    extrapolated, order = richardson(target.meshes, family)
    if target.judged == "order" and family:
        (n0, n1), (e0, e1) = target.meshes[-2:], family[-2:]
        computed, extrapolated = math.log(e0 / e1) / math.log(n1 / n0), NAN
        order = computed
    checked = extrapolated if target.judged == "extrapolated" and math.isfinite(extrapolated) else computed
    error = checked - quantity.published
    return Comparison(
        target=target.name,
        quantity=quantity.name,
        published=quantity.published,
        computed=computed,
        extrapolated=extrapolated,
        order=order,
        error_percent=100 * error / quantity.published,
        tolerance_percent=100 * quantity.tolerance / quantity.published,
        judged=target.judged,
        passed=abs(error) <= quantity.tolerance,
        seconds=seconds,
        meshes="-".join(map(str, target.meshes)),
        source=target.source,
        note=target.note,
        message=message,
    )


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


def write(folder: Path, comparisons: Sequence[Comparison], origin: str, command: str) -> None:
    """Write verify.csv with 12 digits and the report VERIFY.md."""
    write_table(folder / "verify.csv", [c.row() for c in comparisons], digits=12)
    passed = sum(c.passed for c in comparisons)
    heads = ["target", "quantity", "published", "computed", "extrapolated", "order", "error %", "allowed %", ""]
    lines = ["# Verification", "", f"{passed} of {len(comparisons)} targets are met.", ""]
    lines += ["| " + " | ".join([*heads, "meshes"]) + " |", "|---" * (len(heads) + 1) + "|"]
    for c in comparisons:
        values = [_number(value, 6) for value in (c.published, c.computed, c.extrapolated)]
        errors = [_number(value, 3) for value in (c.order, c.error_percent, c.tolerance_percent)]
        verdict = "pass" if c.passed else f"**fail** {c.message}".strip()
        lines.append("| " + " | ".join([c.target, c.quantity, *values, *errors, verdict, c.meshes]) + " |")
    lines += ["", *ABOUT.splitlines(), "", "Sources:", ""]
    lines += [f"- {name}: {source}" for name, source in {c.target: c.source for c in comparisons}.items()]
    lines += ["", "Notes:", ""]
    lines += [f"- {name}: {note}" for name, note in {c.target: c.note for c in comparisons}.items() if note]
    lines += ["", made(command, origin)]
    write_text(folder / "VERIFY.md", "\n".join(lines) + "\n")


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else ""


DETAILS = ("judged", "meshes", "source", "message", "note")
"""Columns that the printed table leaves out."""
