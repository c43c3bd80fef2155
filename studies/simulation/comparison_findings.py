"""Findings of a comparison: figures from its tables, and sentences made from the figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analytic import beam
from geometry.design import Design
from geometry.loads import ANSWERED, Load
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns
from studies.simulation.comparison_rows import NAN, at_rest

TEMPLATE = Path(__file__).with_name("templates") / "compare.j2"
Figures = dict[str, Any]
"""Figures of a comparison under their names in JSON, which carry those of the Hall elements."""
Span = tuple[float, float]
Error = tuple[float, float]
"""A depth or a shear, mm, and the error there, %."""


def findings(design: Design, press: Sequence[FlatRow], shear: Sequence[FlatRow]) -> Figures:
    """Return the figures of the rows of `compare.run`, NaN or empty without rows, and the sentences from them.

    Spans are pairs (first, last) of neighbouring depths of the table, mm. A "worst" figure is the one of largest
    magnitude, beside the depth or shear where it occurs.
    """
    names, unit = columns(design)
    figures: Figures = {"depths_mm": [row["depth_mm"] for row in press], "elements": names, "output": unit}
    rigid = _along(press, "depth_mm", "force_error_percent")
    bare = _along(press, "depth_mm", "homogeneous_force_error_percent")
    for beam_name, prefix, errors in (("homogeneous", "homogeneous_", bare), ("rigid", "", rigid)):
        for bound in (5, 10):
            figures[f"{beam_name}_within_{bound}_percent_mm"] = spans(errors, bound)
        figures |= _worst(f"{prefix}force_error_percent", errors)
    figures |= _worst("shift_error_percent", _along(press, "depth_mm", "shift_error_percent"))
    for column in (f"analytic_{name}_error_percent_FS" for name in names[:2]):
        figures |= _worst(column, _along(press, "depth_mm", column))
    figures |= _output_against_force(design, press, f"{names[0]}_{unit}")
    figures |= _secant(design, figures["depths_mm"])
    figures |= _shear_figures(design, shear, names)
    for label, rows in (("press", press), ("shear", shear)):
        figures[f"{label}_error_estimate_percent"] = _largest_percent(rows, "error_estimate")
    figures["shear_force_x_error_estimate_percent"] = _largest_percent(shear, "sideways_error_estimate")
    figures["missing_states"] = sum(row["status"] not in ANSWERED for row in (*press, *shear))
    figures["warnings"] = design.warnings()
    figures["sentences"] = [text for part in ("press", "shear", "trust") for text in sentences(part, figures)]
    return figures


def spans(errors: Sequence[Error], bound: float) -> list[Span]:
    """Return the runs of neighbouring places at which an error stays within a bound, in %.

    >>> spans([(1.0, -9.0), (2.0, 4.0), (3.0, 1.0)], 5)
    [(2.0, 3.0)]
    """
    runs: list[Span] = []
    inside = False
    for place, error in errors:
        fits = abs(error) <= bound
        if fits:
            runs.append((runs.pop()[0] if inside else place, place))
        inside = fits
    return runs


def _along(rows: Sequence[FlatRow], place: str, column: str) -> list[Error]:
    return [(row[place], row[column]) for row in rows]


def _largest_percent(rows: Sequence[FlatRow], column: str) -> float:
    estimates = [row[f"{beam}{column}"] for row in rows for beam in ("", "homogeneous_")]
    return 100 * max(filter(math.isfinite, estimates), default=NAN)


def _worst(name: str, errors: Sequence[Error]) -> dict[str, float]:
    finite = [(place, error) for place, error in errors if math.isfinite(error)]
    place, error = max(finite, key=lambda pair: abs(pair[1]), default=(NAN, NAN))
    return {f"worst_{name}": error, f"worst_{name}_at_mm": place}


def _output_against_force(design: Design, press: Sequence[FlatRow], output: str) -> dict[str, float]:
    """Repeat the paper's test: errors of the output of S1 at equal force, in % of its largest change in the FEM."""
    needed = ("fem_force_N", f"fem_{output}", "analytic_force_N", f"analytic_{output}")
    points = [tuple(row[name] for name in needed) for row in press]
    finite = [point for point in points if all(map(math.isfinite, point))]
    result = {f"{output}_against_force_error_percent_FS": NAN, f"{output}_against_force_up_to_N": NAN}
    if not finite:
        return result
    import numpy as np

    _, rest = at_rest(design)[0]
    force, seen, model_force, model_seen = np.array(finite).T
    shared = force <= model_force.max()
    if not shared.any() or seen[-1] == rest:
        return result
    at_equal_force = np.interp(force[shared], np.append(0.0, model_force), np.append(rest, model_seen))
    error = 100 * (at_equal_force - seen[shared]) / np.abs(seen - rest).max()
    result[f"{output}_against_force_error_percent_FS"] = float(error[np.abs(error).argmax()])
    result[f"{output}_against_force_up_to_N"] = float(force[shared].max())
    return result


def _secant(design: Design, depths: Sequence[float]) -> dict[str, float]:
    """Return force (5) with (7) at the deepest valid depth, as secant and as tangent law, and area over Hertz's."""
    deepest = max((depth for depth in depths if 0 < depth <= design.R), default=NAN)
    if not deepest > 0:
        return {"secant_depth_mm": NAN, "secant_force_N": NAN, "tangent_force_N": NAN, "area_over_hertz": NAN}
    tangent = design.E * math.pi / design.L * (design.D * deepest**2 / 2 - deepest**3 / 3)
    return {
        "secant_depth_mm": deepest,
        "secant_force_N": beam.solve(design, Load(depth=deepest)).force[2],
        "tangent_force_N": tangent,
        "area_over_hertz": 2 - deepest / design.R,
    }


def _shear_figures(design: Design, shear: Sequence[FlatRow], elements: Sequence[str]) -> dict[str, float]:
    moved = [
        row
        for row in shear
        if row["shear_mm"] and math.isfinite(row["fem_force_x_N"]) and math.isfinite(row["fem_homogeneous_force_x_N"])
    ]
    figures = {"shear_depth_mm": shear[0]["depth_mm"] if shear else NAN}
    figures["shear_stiffness_N_per_mm"] = beam.cantilever_stiffness(design)
    for label, row in zip(("first", "last"), (moved[0], moved[-1]) if moved else (), strict=False):
        figures |= _per_mm(label, row)
    for column in ("force_x_error_percent", "homogeneous_force_x_error_percent"):
        figures |= _worst(column, _along(moved, "shear_mm", column))
    for column in (f"{model}_{name}_error_percent_FS" for model in ("untilted", "analytic") for name in elements):
        figures |= _worst(f"shear_{column}", _along(shear, "shear_mm", column))
    return figures


def _per_mm(label: str, row: FlatRow) -> dict[str, float]:
    """Return stiffness, tilt and shift of a sheared state per mm of shear."""
    way = row["shear_mm"]
    found = {f"{label}_shear_mm": way}
    for model in ("fem", "fem_homogeneous"):
        found[f"{model}_{label}_stiffness_N_per_mm"] = row[f"{model}_force_x_N"] / way
        found[f"{model}_{label}_tilt_deg_per_mm"] = math.degrees(row[f"{model}_tilt_rad"]) / way
        found[f"{model}_{label}_shift_per_mm"] = row[f"{model}_shift_x_mm"] / way
    return found | {"analytic_shift_per_mm": row["analytic_shift_x_mm"] / way}


def sentences(part: str, figures: Figures) -> list[str]:
    """Return the findings of the press or of the shear, or how far to trust them ("trust")."""
    tilted, whole = (
        [figures[f"worst_shear_{model}_{name}_error_percent_FS"] for name in figures["elements"]]
        for model in ("untilted", "analytic")
    )
    return page_templates.sentences(TEMPLATE, part, f=figures, tilted=tilted, whole=whole)
