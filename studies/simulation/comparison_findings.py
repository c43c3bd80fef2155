"""Findings of a comparison: figures from its tables, and sentences made from the figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from analytic import beam
from geometry.design import Design
from geometry.loads import ANSWERED, Load
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns
from studies.simulation.comparison_rows import NAN, at_rest

Figures = dict[str, Any]
"""Figures of a comparison under their names in JSON, which carry those of the Hall elements."""
Span = tuple[float, float]
Error = tuple[float, float]
"""A depth or a shear, mm, and the error there, %."""


# Figures


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
    figures["sentences"] = [*press_sentences(figures), *shear_sentences(figures), *trust_sentences(figures)]
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
    """Return the largest known estimate of both finite elements, %."""
    estimates = [row[f"{beam}{column}"] for row in rows for beam in ("", "homogeneous_")]
    return 100 * max(filter(math.isfinite, estimates), default=NAN)


def _worst(name: str, errors: Sequence[Error]) -> dict[str, float]:
    """Return the error of largest magnitude and its place, under a name."""
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


# Sentences


def press_sentences(figures: Mapping[str, Any]) -> list[str]:
    """Return the findings of the press."""
    lines = []
    for name, text in (("homogeneous", "of a beam that is all silicone"), ("rigid", "with the rigid magnet inside")):
        five, ten = (figures[f"{name}_within_{bound}_percent_mm"] for bound in (5, 10))
        prefix = "homogeneous_" if name == "homogeneous" else ""
        worst = figures[f"worst_{prefix}force_error_percent"]
        if not math.isfinite(worst):
            lines.append(f"Press force {text}: no depth to compare.")
            continue
        at = figures[f"worst_{prefix}force_error_percent_at_mm"]
        held = f"within 5 % of the finite elements {_where(five, figures)}, and within 10 % {_where(ten, figures)}"
        lines.append(
            f"Press force {text}: the paper's F(d) is {held if ten else 'never within 10 % of the finite elements'}; "
            f"its worst error is {worst:+z.0f} %, at {at:.3g} mm."
        )
    worst, at = (figures[f"worst_shift_error_percent{end}"] for end in ("", "_at_mm"))
    if math.isfinite(worst):
        why = (
            ": a uniform bar spreads the compression evenly, a round tip takes most of it itself" if worst > 0 else ""
        )
        lines.append(
            f"Sinking of the magnet: the paper's value is off by up to {worst:+z.0f} % (at {at:.3g} mm){why}."
        )
    first, second, third = figures["elements"]
    errors = [figures[f"worst_analytic_{name}_error_percent_FS"] for name in (first, second)]
    if math.isfinite(errors[0]):
        lines.append(
            f"Readings at equal depth: off by up to {errors[0]:+z.0f} % of full scale in {_words(first)} and "
            f"{errors[1]:+z.0f} % in {_words(second)} and {_words(third)}."
        )
    output = f"{first}_{figures['output']}"
    worst = figures[f"{output}_against_force_error_percent_FS"]
    if math.isfinite(worst):
        volts = figures["output"] == "V"
        what = "Voltage of S1" if volts else f"Output of {_words(first)}"
        lines.append(
            f"{what} at equal force (the paper reports less than 5 %{'' if volts else ' of its S1'}), up to "
            f"{figures[f'{output}_against_force_up_to_N']:.3g} N: off by up to {worst:+z.0f} % of full scale; "
            f"{'this agrees with the paper.' if abs(worst) < 5 else 'the finite elements do not confirm the claim.'}"
        )
    if math.isfinite(figures["secant_force_N"]):
        lines.append(
            f"Formula (5) with (7) is a secant law: at {figures['secant_depth_mm']:.3g} mm it gives "
            f"{figures['secant_force_N']:.2f} N, while the same stiffness taken as a tangent gives "
            f"{figures['tangent_force_N']:.2f} N. Its contact area (7) is twice Hertz's at first touch and "
            f"{figures['area_over_hertz']:.2f} times at that depth."
        )
    return lines


def shear_sentences(figures: Mapping[str, Any]) -> list[str]:
    """Return the findings of the sheared press."""
    if not math.isfinite(figures.get("fem_first_stiffness_N_per_mm", NAN)):
        return ["Shear: the finite elements reached no state to compare."]
    stiff, bare = (figures[f"{model}_first_stiffness_N_per_mm"] for model in ("fem", "fem_homogeneous"))
    worst, at = (figures[f"worst_force_x_error_percent{end}"] for end in ("", "_at_mm"))
    shift, tilt = (figures[f"fem_first_{name}_per_mm"] for name in ("shift", "tilt_deg"))
    lines = []
    lines.append(
        f"Shear stiffness, plate stuck to a tip pressed by {figures['shear_depth_mm']:.3g} mm: the paper's 3EI/L³ is "
        f"{figures['shear_stiffness_N_per_mm']:.3f} N/mm; the finite elements give {stiff:.3f} N/mm with the rigid "
        f"magnet and {bare:.3f} N/mm all silicone, over the first {figures['first_shear_mm']:.3g} mm. Against the "
        f"former, the paper's shear force is off by up to {worst:+z.0f} % (at {at:.3g} mm)."
    )
    lines.append(
        f"For each mm of shear the magnet moves sideways by {shift:.2f} mm (paper: "
        f"{figures['analytic_shift_per_mm']:.2f} mm) and tilts by {tilt:.1f}° (paper: 0°)."
    )
    tilted, whole = (
        [figures[f"worst_shear_{model}_{name}_error_percent_FS"] for name in figures["elements"]]
        for model in ("untilted", "analytic")
    )
    if all(math.isfinite(value) for value in (*tilted, *whole)):
        guilty = max(map(abs, tilted)) >= 0.5 * max(map(abs, whole))
        elements = ", ".join(map(_words, figures["elements"]))
        lines.append(
            f"Readings of {elements}: off by up to {_list(whole)} % of full scale. With the finite elements' "
            f"position of the magnet but without its tilt they are still off by up to {_list(tilted)} %: the tilt "
            f"{'explains most of' if guilty else 'alone does not explain'} the paper's error"
            f"{'.' if guilty else '; the wrong position of the magnet matters more.'}"
        )
    return lines


def trust_sentences(figures: Mapping[str, Any]) -> list[str]:
    """Return sentences on the uncertainty of the finite elements themselves."""
    lines = []
    if math.isfinite(figures["press_error_estimate_percent"]):
        lines.append(
            "Press: by comparison with a coarser mesh, the error of the force is estimated at "
            f"{figures['press_error_estimate_percent']:.2g} % at most."
        )
    if math.isfinite(figures["shear_force_x_error_estimate_percent"]):
        lines.append(
            "Shear: by comparison with a coarser mesh and one harmonic fewer, the error of the shear force (Fx) is "
            f"estimated at {figures['shear_force_x_error_estimate_percent']:.2g} % at most, that of the whole force, "
            f"which is mainly the press force, at {figures['shear_error_estimate_percent']:.2g} %."
        )
    missing = figures["missing_states"]
    lines.append(
        f"{missing} state{'s were' if missing > 1 else ' was'} not reached; the table says why."
        if missing
        else "Every requested state was reached."
    )
    return lines


def _words(element: str) -> str:
    return element.replace("_", " ")


def _where(runs: Sequence[Span], figures: Mapping[str, Any]) -> str:
    depths = figures["depths_mm"]
    if not runs:
        return "at none of the depths"
    if list(runs) == [(depths[0], depths[-1])]:
        return f"at all depths ({depths[0]:.3g} to {depths[-1]:.3g} mm)"
    return "at " + " and ".join(f"{a:.3g} mm" if a == b else f"{a:.3g} to {b:.3g} mm" for a, b in runs)


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:+z.0f}" for value in values)
