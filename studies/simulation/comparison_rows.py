"""The rows of a comparison and its findings: a press and a shear by three mechanics, their errors, readings and rate.

Prefixes of columns: "fem" is the finite elements with the rigid magnet, "fem_homogeneous" those of a beam that is
all silicone, "analytic" the formulas, and "untilted" the pose of "fem" without its tilt. Errors of a quantity are
those of the formulas against both finite elements, in %. Errors of a reading are those against "fem", in % of full
scale: the largest change from rest that "fem" has of it in all rows; the second and the third element share one,
since a shear along y swaps them. What is not known is NaN.

How static forces change with the rate of the motion follows from the relaxation of the silicone alone. All stress
that relaxes does so by one function G(t), so the force of a growing load follows from the static one by superposition
(exact for a held load, and for a sphere on a half space: Lee and Radok 1960),

    F(t) = int_0^t G(t - s) / G_E dF_static(s)          with a speed: the plate moves evenly from rest,
    F = G'(2 pi f) / G_E F_static                       with a frequency: the part in phase, steady and small,

G_E the modulus that the design's E is, long-term or instantaneous. Inertia is neglected; `magtip cycle` and
`magtip response` solve for the whole sensor.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from analytic import beam, hall
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Response
from geometry.relaxation import range_remedy, range_sentence, relaxation_of
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns

TEMPLATE = Path(__file__).with_name("templates") / "compare.j2"
NAN = math.nan
Figures = dict[str, Any]
"""Figures of a comparison under their names in JSON, which carry those of the Hall elements."""
Error = tuple[float, float]
"""A depth or a shear, mm, and the error there, %."""
Kind = Literal["press", "shear"]
Poses = Mapping[str, Response | None]
"""Poses of the magnet by the prefixes fem, fem_homogeneous and analytic; None where one has no solution."""

QUANTITIES: dict[Kind, dict[str, tuple[str, Callable[[Response], float]]]] = {
    "press": {
        "force_N": ("force", lambda pose: pose.force[2]),
        "shift_z_mm": ("shift", lambda pose: pose.shift[2]),
        "contact_radius_mm": ("contact_radius", lambda pose: pose.contact_radius),
    },
    "shear": {
        "force_x_N": ("force_x", lambda pose: pose.force[0]),
        "force_z_N": ("force_z", lambda pose: pose.force[2]),
        "shift_x_mm": ("shift_x", lambda pose: pose.shift[0]),
        "shift_z_mm": ("", lambda pose: pose.shift[2]),
        "tilt_rad": ("", lambda pose: pose.tilt),
    },
}
"""Column of each quantity behind the model's prefix, the name of its errors ("" for none), and its value."""
ALONG = {"press": ("depth_mm", "fem_force_N"), "shear": ("shear_mm", "fem_force_x_N")}
"""Columns of the travel, and of the force along it."""


def row(kind: Kind, design: Design, load: Load, poses: Poses) -> FlatRow:
    """Return the columns of a state by all mechanics; `with_reading_errors` fills those of the readings' errors."""
    found: FlatRow = {} if kind == "press" else {"shear_mm": load.shear_x}
    found["depth_mm"] = load.depth
    for column, (error, value) in QUANTITIES[kind].items():
        by_model = {model: NAN if pose is None else value(pose) + 0.0 for model, pose in poses.items()}
        found |= {f"{model}_{column}": number for model, number in by_model.items()}
        # without a shear, what there is along x is the solver's rounding
        judged = bool(load.shear_x) or not error.endswith("_x")
        for bare, model in (("", "fem"), ("homogeneous_", "fem_homogeneous")) if error else ():
            percentage = percent(by_model["analytic"], by_model[model]) if judged else NAN
            found[f"{bare}{error}_error_percent"] = percentage
    return found | _reading_columns(kind, design, poses)


def _reading_columns(kind: Kind, design: Design, poses: Poses) -> FlatRow:
    """Return the columns of readings: all fields, then all outputs, then all errors, which are not known yet."""
    names, unit = columns(design)
    models = {"fem": poses["fem"], "analytic": poses["analytic"]}
    if kind == "press":
        names = names if len(names) > 3 else names[:2]  # the third reads what the second does
    else:
        upright = None if poses["fem"] is None else dataclasses.replace(poses["fem"], tilt=0.0)
        models = {"fem": poses["fem"], "untilted": upright, "analytic": poses["analytic"]}
    seen = {model: readings(design, pose) for model, pose in models.items()}
    each = [(name, k, model) for k, name in enumerate(names) for model in models]
    return {
        **{f"{model}_{name}_mT": seen[model][k][0] for name, k, model in each},
        **{f"{model}_{name}_{unit}": seen[model][k][1] for name, k, model in each},
        **{f"{model}_{name}_error_percent_FS": NAN for name, k, model in each if model != "fem"},
    }


def percent(model: float, truth: float) -> float:
    """Return the relative error in %; NaN if the reference is 0 or unknown.

    >>> percent(1.5, 1.0), percent(1.0, 0.0)
    (50.0, nan)
    """
    return 100 * (model / truth - 1) if truth else NAN


def readings(design: Design, pose: Response | None) -> list[tuple[float, float]]:
    """Return field, mT, and output, V, or mT for a chip, of the elements at a pose.

    NaN without a pose, a magnet or a finite field.
    """
    unknown = [(NAN, NAN)] * design.element_count
    if pose is None or not design.shape.has_magnet:
        return unknown
    try:
        seen = hall.readings(design, pose)
    except BadInput:
        return unknown
    sizes = [1.0 if unit == "V" else 1e3 for unit in seen.units]
    return [(1e3 * b, size * output) for b, output, size in zip(seen.B_T, seen.output, sizes, strict=True)]


def at_rest(design: Design) -> list[tuple[float, float]]:
    """Return the readings without a load."""
    return readings(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0))


def with_reading_errors(design: Design, rows: Sequence[FlatRow]) -> list[FlatRow]:
    """Return all rows of press and shear with the errors of their readings in % of full scale."""
    names, rest, largest = columns(design)[0], at_rest(design), [0.0, 0.0]
    for k, (name, (at, _)) in enumerate(zip(names, rest, strict=True)):
        changes = [abs(row[f"fem_{name}_mT"] - at) for row in rows if f"fem_{name}_mT" in row]
        # the elements along z, and all others
        largest[k % 3 > 0] = max(largest[k % 3 > 0], *(c for c in changes if not math.isnan(c)), 0.0)
    scales = {name: largest[k % 3 > 0] or NAN for k, name in enumerate(names)}

    def errors(row: FlatRow) -> FlatRow:
        return {
            f"{model}_{name}_error_percent_FS": 100 * (row[f"{model}_{name}_mT"] - row[f"fem_{name}_mT"]) / scale
            for name, scale in scales.items()
            for model in ("untilted", "analytic")
            if f"{model}_{name}_mT" in row
        }

    return [row | errors(row) for row in rows]


def check_rate(design: Design, travel: float, frequency: float | None, speed: float | None) -> None:
    """Refuse rates that contradict each other, or for which the branches do not speak; travel of the plate in mm."""
    if frequency is not None and speed is not None:
        raise BadInput("--frequency and --speed both give the rate of the motion: leave one of them out")
    for name, value, unit in (("frequency", frequency, "Hz"), ("speed", speed, "mm/s")):
        if value is not None and not 0 < value < math.inf:
            raise BadInput(f"--{name} must be above 0 {unit}; got {value:g}")
    times = [] if speed is None else [travel / speed]
    frequencies = [] if frequency is None else [frequency]
    sentence = range_sentence(relaxation_of(design), times=times, frequencies=frequencies)
    if sentence:
        raise BadInput(f"{sentence}: {range_remedy(design)}")


def factors(design: Design, travel: Array, force: Array, frequency: float | None, speed: float | None) -> Array:
    """Return the force at a rate over the static force (n,), at rising travels (n,), mm, from 0; NaN where unknown.

    >>> from geometry.design import Design
    >>> stiff = Design(prony="0.5:1", modulus="instantaneous")
    >>> factors(stiff, np.array([1.0]), np.array([2.0]), None, 1e6).round(3).tolist()
    [1.0]
    """
    relaxation = relaxation_of(design)
    own = 1.0 if design.modulus == "instantaneous" else relaxation.rest
    if frequency is not None:
        storage = float(relaxation.complex_modulus(2 * math.pi * frequency).real)
        return np.where(np.isnan(force), np.nan, storage / own)
    assert speed is not None
    known = np.flatnonzero(~np.isnan(force) & (travel > 0))
    g, tau = np.array(relaxation.shares), np.array(relaxation.times)
    ratio, overstress = np.full(len(force), np.nan), np.zeros(len(g))
    last = (0.0, 0.0)
    for k in known.tolist():
        # exact for a force that grows linearly between the rows of the table
        x = (travel[k] - last[0]) / speed / tau
        overstress = overstress * np.exp(-x) + g * -np.expm1(-x) / x * (force[k] - last[1])
        ratio[k] = (relaxation.rest * force[k] + overstress.sum()) / (own * force[k])
        last = float(travel[k]), float(force[k])
    return ratio


def with_rate(
    design: Design, kind: Kind, rows: Sequence[FlatRow], frequency: float | None, speed: float | None
) -> list[FlatRow]:
    """Return the rows with the finite elements' force at a rate, N, and its change, %; without a rate the rows."""
    if frequency is None and speed is None:
        return list(rows)
    way, column = ALONG[kind]
    travel, force = (np.array([float(str(row[name])) for row in rows]) for name in (way, column))
    ratio = factors(design, travel, force, frequency, speed)
    name = column.replace("_N", "")
    return [
        row | {f"{name}_at_rate_N": float(f * r), f"{name}_at_rate_change_percent": float(100 * (r - 1))}
        for row, f, r in zip(rows, force, ratio, strict=True)
    ]


def rate_sentence(design: Design, rows: Sequence[FlatRow], frequency: float | None, speed: float | None) -> str:
    """Return what the rate does to the force of the deepest press that was solved, in a sentence."""
    solved = [row for row in rows if row["fem_force_at_rate_N"] == row["fem_force_at_rate_N"]]
    if not solved:
        return "no press was solved, so the force at this rate is not known"
    last = solved[-1]
    (text,) = page_templates.sentences(
        TEMPLATE,
        "rate",
        change=last["fem_force_at_rate_change_percent"],
        depth=last["depth_mm"],
        force=last["fem_force_at_rate_N"],
        modulus=design.modulus,
        frequency=frequency,
        speed=speed,
        loss=None if frequency is None else float(relaxation_of(design).loss_factor(2 * math.pi * frequency)),
    )
    return text


# Findings: figures from the tables, and sentences made from the figures


def findings(design: Design, press: Sequence[FlatRow], shear: Sequence[FlatRow]) -> Figures:
    """Return the figures of the rows of `compare.run`, NaN or empty without rows, and the sentences from them.

    Spans are pairs (first, last) of neighbouring depths of the table, mm. A "worst" figure is the one of largest
    magnitude, beside the depth or shear where it occurs.
    """
    names, unit = columns(design)
    figures: Figures = {"depths_mm": [row["depth_mm"] for row in press], "elements": names, "output": unit}
    for beam_name, prefix in (("homogeneous", "homogeneous_"), ("rigid", "")):
        errors = [(row["depth_mm"], row[f"{prefix}force_error_percent"]) for row in press]
        for bound in (5, 10):
            figures[f"{beam_name}_within_{bound}_percent_mm"] = spans(errors, bound)
        figures |= _worst(press, "depth_mm", f"{prefix}force_error_percent")
    for column in ("shift_error_percent", *(f"analytic_{name}_error_percent_FS" for name in names[:2])):
        figures |= _worst(press, "depth_mm", column)
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


def spans(errors: Sequence[Error], bound: float) -> list[tuple[float, float]]:
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


def _largest_percent(rows: Sequence[FlatRow], column: str) -> float:
    estimates = [row[f"{beam}{column}"] for row in rows for beam in ("", "homogeneous_")]
    return 100 * max(filter(math.isfinite, estimates), default=NAN)


def _worst(rows: Sequence[FlatRow], place: str, column: str, prefix: str = "") -> dict[str, float]:
    finite = [(row[place], row[column]) for row in rows if math.isfinite(row[column])]
    at, error = max(finite, key=lambda pair: abs(pair[1]), default=(NAN, NAN))
    return {f"worst_{prefix}{column}": error, f"worst_{prefix}{column}_at_mm": at}


def _output_against_force(design: Design, press: Sequence[FlatRow], output: str) -> dict[str, float]:
    """Repeat the paper's test: errors of the output of S1 at equal force, in % of its largest change in the FEM."""
    needed = ("fem_force_N", f"fem_{output}", "analytic_force_N", f"analytic_{output}")
    points = [tuple(row[name] for name in needed) for row in press]
    finite = [point for point in points if all(map(math.isfinite, point))]
    _, rest = at_rest(design)[0]
    force, seen, model_force, model_seen = np.array(finite).reshape(-1, 4).T
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
