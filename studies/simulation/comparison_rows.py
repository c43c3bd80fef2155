"""The rows of a comparison and its findings: a press and a shear by three mechanics, their errors and readings.

Prefixes of columns: "fem" is the finite elements with the rigid magnet, "fem_homogeneous" those of a beam that is
all silicone, "analytic" the formulas, and "untilted" the pose of "fem" without its tilt. Errors of a quantity are
those of the formulas against both finite elements, in %. Errors of a reading are those against "fem", in % of full
scale: the largest change from rest that "fem" has of it in all rows; the second and the third element share one,
since a shear along y swaps them. What is not known is NaN.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from analytic import beam, hall
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, rotation_of
from studies.answers import percents
from studies.output import page_templates
from studies.quantities import QUANTITIES
from studies.sensing.field_readings import columns

if TYPE_CHECKING:
    import pandas as pd

TEMPLATE = Path(__file__).with_name("templates") / "compare.j2"
NAN = math.nan
Figures = dict[str, Any]
"""Figures of a comparison under their names in JSON, which carry those of the Hall elements."""
Kind = Literal["press", "shear"]
PARTS = {part.name: part for name in ("force", "shift", "tilt", "contact_radius") for part in QUANTITIES[name].parts}
"""Numbers of a response by their names."""
COMPARED: dict[Kind, dict[str, bool]] = {
    "press": {"force": True, "shift_z": True, "contact_radius": True},
    "shear": {"force_x": True, "force": True, "shift_x": True, "shift_z": False, "tilt": False},
}
"""Numbers that are compared, and whether errors are stated; in a shear the press force is `force_z`."""


def table(kind: Kind, design: Design, answers: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the rows of a press or a shear from the answers of the mechanics, by the prefixes of their columns.

    `with_reading_errors` fills the errors of the readings. The error estimates are relative errors of the force as a
    vector, and in a shear of its part along it.
    """
    import pandas as pd

    fem, bare, formula = (answers[name] for name in ("fem", "fem_homogeneous", "analytic"))
    found = {name: fem[name] for name in ("shear_mm", "depth_mm")[kind == "press" :]}
    for name, is_judged in COMPARED[kind].items():
        part = PARTS[name]
        values = {model: frame[part.column] for model, frame in answers.items()}
        part = replace(part, name="force_z") if (kind, name) == ("shear", "force") else part
        found |= {f"{model}_{part.column}": value for model, value in values.items()}
        for prefix, truth in (("", "fem"), ("homogeneous_", "fem_homogeneous")) if is_judged else ():
            # without a shear, what there is along x is the solver's rounding; a beam that gave way resists none
            resists = answers[truth]["force_x_N"] * fem["shear_mm"] > 0 if part.along_shear else True
            percentage = percents(values["analytic"].to_numpy(), values[truth].to_numpy())
            found[f"{prefix}{part.error_column}"] = np.where(resists, percentage, NAN)
    found |= _reading_columns(kind, design, fem, formula)
    for column in ("error_estimate", "sideways_error_estimate")[: 1 + (kind == "shear")]:
        found |= {column: fem[column], f"homogeneous_{column}": bare[column]}
    verdicts = [_verdict(*states) for states in zip(*(_states(answers[name]) for name in answers), strict=True)]
    found["status"], found["message"] = zip(*verdicts, strict=True)
    return pd.DataFrame(found)


def _states(answers: pd.DataFrame) -> list[tuple[str, str]]:
    return list(zip(answers["status"], answers["message"], strict=True))


def _verdict(fem: tuple[str, str], bare: tuple[str, str], formula: tuple[str, str]) -> tuple[str, str]:
    worst = min((fem[0], bare[0]), key=lambda status: (status in ANSWERED, status == "ok"))
    return worst, "; ".join(filter(None, dict.fromkeys((fem[1], bare[1], formula[1]))))


def _reading_columns(kind: Kind, design: Design, fem: pd.DataFrame, formula: pd.DataFrame) -> dict[str, Any]:
    """Return the columns of readings: all fields, then all outputs, then all errors, which are not known yet."""
    names, unit = columns(design)
    poses = {"fem": fem, "untilted": fem.assign(tilt_rad=0.0, tilt_y_rad=0.0), "analytic": formula}
    if kind == "press":
        names = names if len(names) > 3 else names[:2]  # the third reads what the second does
        del poses["untilted"]
    seen = {name: readings(design, frame) for name, frame in poses.items()}
    each = [(element, k, name) for k, element in enumerate(names) for name in poses]
    return {
        **{f"{name}_{element}_mT": seen[name][:, k, 0] for element, k, name in each},
        **{f"{name}_{element}_{unit}": seen[name][:, k, 1] for element, k, name in each},
        **{f"{name}_{element}_error_percent_FS": NAN for element, k, name in each if name != "fem"},
    }


def readings(design: Design, poses: pd.DataFrame) -> Array:
    """Return field, mT, and output, V, or mT for a chip, of the elements at poses, shape (n, elements, 2).

    NaN without a pose, a magnet or a finite field.
    """
    found = np.full((len(poses), design.element_count, 2), NAN)
    shifts, tilts = poses[["shift_x_mm", "shift_y_mm", "shift_z_mm"]], poses[["tilt_rad", "tilt_y_rad"]]
    for k, (shift, (tilt, tilt_y)) in enumerate(zip(shifts.to_numpy(), tilts.to_numpy(), strict=True)):
        if np.isnan(shift).any() or not design.shape.has_magnet:
            continue
        with contextlib.suppress(BadInput):
            seen = hall.readings(design, shift=tuple(shift.tolist()), tilt=rotation_of(tilt, tilt_y))
            sizes = [1.0 if unit == "V" else 1e3 for unit in seen.units]
            found[k] = np.transpose([1e3 * np.array(seen.B_T), np.array(sizes) * np.array(seen.output)])
    return found


def at_rest(design: Design) -> Array:
    """Return field and output of the elements without a load, shape (elements, 2)."""
    import pandas as pd

    names = ("shift_x_mm", "shift_y_mm", "shift_z_mm", "tilt_rad", "tilt_y_rad")
    return np.asarray(readings(design, pd.DataFrame([dict.fromkeys(names, 0.0)]))[0])


def with_reading_errors(design: Design, press: pd.DataFrame, shear: pd.DataFrame) -> tuple[pd.DataFrame, ...]:
    """Return press and shear with the errors of their readings in % of full scale."""
    names, rest, largest = columns(design)[0], at_rest(design), [0.0, 0.0]
    for k, (name, (at, _)) in enumerate(zip(names, rest, strict=True)):
        seen = [part[f"fem_{name}_mT"] for part in (press, shear) if f"fem_{name}_mT" in part]
        changes = [float((values - at).abs().max()) for values in seen]
        # the elements along z, and all others
        largest[k % 3 > 0] = max(largest[k % 3 > 0], *(c for c in changes if not math.isnan(c)), 0.0)
    scales = {name: largest[k % 3 > 0] or NAN for k, name in enumerate(names)}
    return tuple(
        part.assign(**{
            f"{model}_{name}_error_percent_FS": 100 * (part[f"{model}_{name}_mT"] - part[f"fem_{name}_mT"]) / scale
            for name, scale in scales.items()
            for model in ("untilted", "analytic")
            if f"{model}_{name}_mT" in part
        })
        for part in (press, shear)
    )  # fmt: skip


# Findings: figures from the tables, and sentences made from the figures


def findings(design: Design, press: pd.DataFrame, shear: pd.DataFrame) -> Figures:
    """Return the figures of both tables, NaN or empty without rows, and the sentences from them.

    Spans are pairs (first, last) of neighbouring depths of the table, mm. A "worst" figure is the one of largest
    magnitude, beside the depth or shear where it occurs.
    """
    names, unit = columns(design)
    figures: Figures = {"depths_mm": press["depth_mm"].tolist(), "elements": names, "output": unit}
    for beam_name, prefix in (("homogeneous", "homogeneous_"), ("rigid", "")):
        errors = list(zip(press["depth_mm"].tolist(), press[f"{prefix}force_error_percent"].tolist(), strict=True))
        for bound in (5, 10):
            figures[f"{beam_name}_within_{bound}_percent_mm"] = spans(errors, bound)
        figures |= _worst(press, "depth_mm", f"{prefix}force_error_percent")
    for column in ("shift_error_percent", *(f"analytic_{name}_error_percent_FS" for name in names[:2])):
        figures |= _worst(press, "depth_mm", column)
    figures |= _output_against_force(design, press, f"{names[0]}_{unit}")
    figures |= _secant(design, figures["depths_mm"])
    figures |= _shear_figures(design, shear, names)
    for label, part in (("press", press), ("shear", shear)):
        figures[f"{label}_error_estimate_percent"] = _largest_percent(part, "error_estimate")
    figures["shear_force_x_error_estimate_percent"] = _largest_percent(shear, "sideways_error_estimate")
    figures["missing_states"] = sum(int((~part["status"].isin(ANSWERED)).sum()) for part in (press, shear))
    figures["warnings"] = design.warnings()
    figures["sentences"] = [text for part in ("press", "shear", "trust") for text in sentences(part, figures)]
    return figures


def spans(errors: Sequence[tuple[float, float]], bound: float) -> list[tuple[float, float]]:
    """Return the runs of neighbouring places at which an error stays within a bound, in %.

    >>> spans([(1.0, -9.0), (2.0, 4.0), (3.0, 1.0)], 5)
    [(2.0, 3.0)]
    """
    runs: list[tuple[float, float]] = []
    inside = False
    for place, error in errors:
        fits = abs(error) <= bound
        if fits:
            runs.append((runs.pop()[0] if inside else place, place))
        inside = fits
    return runs


def _largest_percent(table: pd.DataFrame, column: str) -> float:
    return 100 * float(table[[column, f"homogeneous_{column}"]].max(axis=None))


def _worst(table: pd.DataFrame, place: str, column: str, prefix: str = "") -> dict[str, float]:
    known, at, error = table[column].dropna().abs(), NAN, NAN
    if len(known):
        at, error = table.loc[known.idxmax(), [place, column]].tolist()
    return {f"worst_{prefix}{column}": error, f"worst_{prefix}{column}_at_mm": at}


def _output_against_force(design: Design, press: pd.DataFrame, output: str) -> dict[str, float]:
    """Repeat the paper's test: errors of the output of S1 at equal force, in % of its largest change in the FEM."""
    needed = ["fem_force_N", f"fem_{output}", "analytic_force_N", f"analytic_{output}"]
    force, seen, model_force, model_seen = press[needed].dropna().to_numpy(float).T
    _, rest = at_rest(design)[0].tolist()
    shared, worst, most = force <= model_force.max(initial=-np.inf), NAN, NAN
    if shared.any() and seen[-1] != rest:
        at_equal_force = np.interp(force[shared], np.append(0.0, model_force), np.append(rest, model_seen))
        error = 100 * (at_equal_force - seen[shared]) / np.abs(seen - rest).max()
        worst, most = float(error[np.abs(error).argmax()]), float(force[shared].max())
    return {f"{output}_against_force_error_percent_FS": worst, f"{output}_against_force_up_to_N": most}


def _secant(design: Design, depths: Sequence[float]) -> dict[str, float]:
    """Return force (5) with (7) at the deepest valid depth, as secant and as tangent law, and area over Hertz's."""
    deepest = max((depth for depth in depths if 0 < depth <= design.R), default=NAN)
    if not deepest > 0:
        return {"secant_depth_mm": NAN, "secant_force_N": NAN, "tangent_force_N": NAN, "area_over_hertz": NAN}
    tangent = design.E_now * math.pi / design.L * (design.D * deepest**2 / 2 - deepest**3 / 3)
    return {
        "secant_depth_mm": deepest,
        "secant_force_N": beam.solve(design, Load(depth=deepest)).force[2],
        "tangent_force_N": tangent,
        "area_over_hertz": 2 - deepest / design.R,
    }


def _shear_figures(design: Design, shear: pd.DataFrame, elements: Sequence[str]) -> dict[str, float]:
    moved = shear[shear["shear_mm"] != 0].dropna(subset=["fem_force_x_N", "fem_homogeneous_force_x_N"])
    figures = {"shear_depth_mm": float(shear["depth_mm"].iloc[0]) if len(shear) else NAN}
    figures["shear_stiffness_N_per_mm"] = beam.cantilever_stiffness(design)
    rows = moved.to_dict("records")
    for label, row in zip(("first", "last"), (rows[0], rows[-1]) if rows else (), strict=False):
        way = figures[f"{label}_shear_mm"] = row["shear_mm"]
        for model in ("fem", "fem_homogeneous"):
            figures[f"{model}_{label}_stiffness_N_per_mm"] = row[f"{model}_force_x_N"] / way
            figures[f"{model}_{label}_tilt_deg_per_mm"] = math.degrees(row[f"{model}_tilt_rad"]) / way
            figures[f"{model}_{label}_shift_per_mm"] = row[f"{model}_shift_x_mm"] / way
        figures["analytic_shift_per_mm"] = row["analytic_shift_x_mm"] / way
    for column in ("force_x_error_percent", "homogeneous_force_x_error_percent"):
        figures |= _worst(moved, "shear_mm", column)
    for column in (f"{model}_{name}_error_percent_FS" for model in ("untilted", "analytic") for name in elements):
        figures |= _worst(shear, "shear_mm", column, "shear_")
    return figures


def sentences(part: str, figures: Figures) -> list[str]:
    """Return the findings of the press or of the shear, or how far to trust them ("trust")."""
    tilted, whole = (
        [figures[f"worst_shear_{model}_{name}_error_percent_FS"] for name in figures["elements"]]
        for model in ("untilted", "analytic")
    )
    return page_templates.sentences(TEMPLATE, part, f=figures, tilted=tilted, whole=whole)
