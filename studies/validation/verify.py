"""Published and closed-form targets, each solved on a family of meshes and judged against a fixed tolerance.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.provenance import made, versions
from studies.validation.verify_targets import Quantity, Target, targets

ABOUT = """\
Three kinds of judgement: the value on the finest mesh, its Richardson extrapolation, or the order of convergence of
an error. The extrapolation fits f + C h^p to the three finest meshes; where they give no positive order, the finest
value stands. Tolerances are promises and are never widened to make a target pass.
"""

Progress = Callable[[float, str], None]
Row = dict[str, Any]

NAN = math.nan


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> list[Row]:
    """Solve and judge all targets, and write verify.csv and VERIFY.md if told where.

    Parameters
    ----------
    quick : the reduced targets.
    command : that this is run by.

    Returns
    -------
    One row per quantity.
    """
    origin, chosen = versions(), targets(quick=quick)
    rows: list[Row] = []
    for i, target in enumerate(chosen):
        rows += judge(target, i / len(chosen), progress)
    if folder is not None:
        write(folder, rows, origin, command)
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
        "note": target.note,
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


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """verify.csv with every digit, VERIFY.md to read."""
    write_table(folder / "verify.csv", rows, digits=12)
    failed = [row for row in rows if not row["passed"]]
    verdict = f"{len(rows) - len(failed)} of {len(rows)} targets are met."
    heads = ["target", "quantity", "published", "computed", "extrapolated", "order", "error %", "allowed %", ""]
    lines = ["# Verification", "", verdict, ""]
    lines += ["| " + " | ".join([*heads, "meshes"]) + " |", "|---" * (len(heads) + 1) + "|"]
    for row in rows:
        numbers = [_number(row[key], 6) for key in ("published", "computed", "extrapolated")]
        rest = [_number(row[key], 3) for key in ("order", "error_percent", "tolerance_percent")]
        verdict = "pass" if row["passed"] else f"**fail** {row['message']}".strip()
        lines.append(
            "| " + " | ".join([row["target"], row["quantity"], *numbers, *rest, verdict, row["meshes"]]) + " |"
        )
    lines += ["", *ABOUT.splitlines(), "", "Sources:", ""]
    lines += [f"- {name}: {source}" for name, source in {row["target"]: row["source"] for row in rows}.items()]
    lines += ["", "Notes:", ""]
    lines += [f"- {name}: {note}" for name, note in {row["target"]: row["note"] for row in rows}.items() if note]
    lines += ["", made(command, origin)]
    write_text(folder / "VERIFY.md", "\n".join(lines) + "\n")


def shown(row: Row) -> Row:
    """The row with enough digits of its values for a printed table."""
    return row | {key: _number(row[key], 6) for key in ("published", "computed", "extrapolated")}


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else ""


DETAILS = ("judged", "meshes", "source", "message", "note")
"""Left out of the printed table."""
