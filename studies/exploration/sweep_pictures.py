"""What the pictures of a sweep show: the rows that are drawn, and the quantities in them.

Of a study with more than a million cases every k-th value of its longest axes is drawn, and a note says so; the table
has all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.exploration import sweep_axes, sweep_plot
from studies.exploration.model_results import prefixes
from studies.exploration.plate_motion import TIMED
from studies.exploration.study_cases import Columns, Plan
from studies.exploration.sweep_plot import Shown
from studies.inputs import study_axes
from studies.inputs.study_axes import Factor
from studies.inputs.user_input import Value

MOST_DRAWN = 1_000_000
"""Largest number of cases that are drawn; it bounds the memory, at about 100 MB."""
ROUNDING = 1e-6
"""Magnitude over the largest one up to which a value is 0 but for rounding."""
LARGE = 1000
"""Number of cases from which on the pictures leave out axes whose effect on the shown quantities is known."""


class Collected:
    """The rows of a sweep that its pictures show."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._fixed = _fixed(plan)
        counts = [factor.count for factor in plan.factors]
        drawn = [1 if k in self._fixed else count for k, count in enumerate(counts)]
        while math.prod(drawn) > MOST_DRAWN:
            longest = drawn.index(max(drawn))
            drawn[longest] = max(1, (drawn[longest] + 1) // 2)
        self._thinned = {
            plan.factors[k].names[0]: (drawn[k], count)
            for k, count in enumerate(counts)
            if drawn[k] < count and k not in self._fixed
        }
        self._chosen = [
            np.isin(np.arange(count), np.unique(np.round(np.linspace(0, count - 1, few)).astype(int)))
            for count, few in zip(counts, drawn, strict=True)
        ]
        for k, point in self._fixed.items():
            self._chosen[k] = np.arange(counts[k]) == point
        self._parts: list[Columns] = []
        self._shown: list[Shown] = []

    def add(self, table: Columns, indices: NDArray[np.int64]) -> None:
        """Keep those rows of a table that are drawn."""
        rows = np.ones(len(indices), dtype=bool)
        stride = self.plan.count
        for factor, chosen in zip(self.plan.factors, self._chosen, strict=True):
            stride //= factor.count
            rows &= chosen[indices // stride % factor.count]
        if rows.any():
            self._shown = _shown(self.plan, table)
            names = {name for one in self._shown for name in (*one.values.values(), *one.errors.values())}
            names |= {study_axes.column(axis) for axis in self.plan.axes} | {"status", "message"}
            self._parts.append({name: table[name][rows] for name in names})

    def draw(self, path: Path) -> list[Path]:
        """Draw the pictures, and return their files."""
        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        sampled = any(factor.sampled for factor in self.plan.factors)
        axes: dict[str, list[float | str]] = {}
        for factor in (factor for k, factor in enumerate(self.plan.factors) if k not in self._fixed):
            if _needs_all(factor):
                name = ", ".join(sweep_axes.symbol(study_axes.column(one)) for one in factor.names)
                axes[name] = _together(factor, {one: _texts(factor, one) for one in factor.names})
                rows = _together(factor, {one: columns[study_axes.column(one)] for one in factor.names})
                columns[name] = np.array(rows, dtype=object)
                continue
            for name in factor.names if factor.sampled else (_leader(factor),):
                column = study_axes.column(name)
                axes[column] = list(dict.fromkeys(columns[column].tolist()))
        shown = [_comparable(one, columns) for one in self._shown]
        return sweep_plot.draw(path, columns, axes, shown, sampled=sampled, notes=self._notes())

    def _notes(self) -> list[str]:
        """Say in sentences what the pictures leave out."""
        notes = []
        for k, point in self._fixed.items():
            factor = self.plan.factors[k]
            if "E" in factor.names:
                E = factor.values[factor.names.index("E")][point]
                notes.append(f"Forces are proportional to E: drawn for E = {E:g} MPa.")
            others = [name for name in factor.names if name != "E"]
            if others:
                notes.append(
                    f"{', '.join(others)} {'has' if len(others) == 1 else 'have'} no effect on what is shown."
                )
        for factor in (factor for k, factor in enumerate(self.plan.factors) if k not in self._fixed):
            leader = _leader(factor)
            others = [] if factor.sampled or _needs_all(factor) else [name for name in factor.names if name != leader]
            if others:
                notes.append(
                    f"{', '.join(others)} {'varies' if len(others) == 1 else 'vary'} together with {leader}."
                )
        return notes + [
            f"Of {count} values of {name}, {few} are drawn; the table has all."
            for name, (few, count) in self._thinned.items()
        ]


def _fixed(plan: Plan) -> dict[int, int]:
    """Return the factors of a large study that the pictures show at one point only, with the number of this point.

    Forces do not depend on the Hall elements and the remanence, and are proportional to E.
    """
    matter = plan.matters("problems")
    idle = [k for k, factor in enumerate(plan.factors) if k not in matter and factor.count > 1]
    if "modes" in plan.quantities or "critical_depth" in plan.quantities:
        idle = [k for k in idle if "E" not in plan.factors[k].names]
    if plan.count < LARGE or len(idle) == len(plan.factors):
        return {}
    fixed = {}
    for k in idle:
        names, values = plan.factors[k].names, plan.factors[k].values
        E = [float(value) for value in values[names.index("E")]] if "E" in names else [plan.design.E]
        fixed[k] = min(range(len(E)), key=lambda point: abs(E[point] - plan.design.E))
    return fixed


def _texts(factor: Factor, name: str) -> Sequence[Value]:
    """Return all values of an axis as its column has them."""
    values = list(factor.values[factor.names.index(name)])
    named = any(isinstance(value, str) for value in values)
    return [value if isinstance(value, str) else f"{value:.12g}" for value in values] if named else values


def _leader(factor: Factor) -> str:
    """Return the axis that stands for a zipped group: the one with the most different values."""
    counts = [len(set(values)) for values in factor.values]
    return factor.names[counts.index(max(counts))]


def _needs_all(factor: Factor) -> bool:
    """Return whether the points of a zipped group are told apart by the values of all its axes only."""
    return not factor.sampled and len(factor.names) > 1 and len(set(_texts(factor, _leader(factor)))) < factor.count


def _together(factor: Factor, values: Mapping[str, Sequence[Value] | NDArray[np.generic]]) -> list[float | str]:
    """Return the values of all axes of a zipped group at each point as one text, such as "8 mm, 9 mm"."""
    units = [sweep_axes.split(study_axes.column(name))[1] for name in factor.names]
    return [
        ", ".join(f"{sweep_axes.text_of(value)} {unit}".strip() for value, unit in zip(point, units, strict=True))
        for point in zip(*(values[name] for name in factor.names), strict=True)
    ]


def _comparable(shown: Shown, columns: Columns) -> Shown:
    """Return a quantity whose errors mean something.

    Where a model has the other sign than the reference, an error relative to the reference says too low of what is
    too high. The errors are then differences from the reference over its largest magnitude, in columns of their own.
    """
    references = [column for model, column in shown.values.items() if model not in shown.errors]
    if not references or not shown.errors:
        return shown
    truth = np.asarray(columns[references[0]], dtype=float)
    models = {model: np.asarray(columns[shown.values[model]], dtype=float) for model in shown.errors}
    with np.errstate(invalid="ignore"):
        largest = float(np.nanmax(abs(truth), initial=0.0))
        if not any((values * truth < -((ROUNDING * largest) ** 2)).any() for values in models.values()):
            return shown
    errors = {}
    for model, values in models.items():
        errors[model] = f"{shown.errors[model]} of the largest"
        columns[errors[model]] = 100 * (values - truth) / largest
    return replace(shown, errors=errors, error_unit="% of the largest value")


def _shown(plan: Plan, columns: Mapping[str, NDArray[np.float64]]) -> list[Shown]:
    """Return the quantities to draw that the table has, the most telling ones first."""
    names = [("press force", "N", "force_N", "force_error_percent")]
    if plan.loads_sideways:
        shear = ("shear force", "N", "force_x_N", "force_x_error_percent")
        names = [shear, *names] if "shear" in plan.axes or plan.load.get("shear") else [*names, shear]
    names += [
        ("shift of the magnet along z", "mm", "shift_z_mm", "shift_error_percent"),
        ("tilt of the magnet", "rad", "tilt_rad", "tilt_error_percent"),
    ]
    before = prefixes(plan)
    labels = {model.name: f"FEM {model.name}" if len(plan.fem) > 1 else "FEM" for model in plan.fem}
    labels |= {level: f"formula {level}" for level in plan.formulas}
    shown = []
    for label, unit, value, error in names:
        values = {labels[name]: f"{before[name]}{value}" for name in labels if f"{before[name]}{value}" in columns}
        candidates = {name: (error if len(before) <= 2 else f"{before[name]}{error}") for name in labels}
        errors = {
            labels[name]: column
            for name, column in candidates.items()
            if column in columns and (plan.reference is None or name != plan.reference.name)
        }
        if values:
            shown.append(Shown(label, unit, values, errors))
    extra = [
        ("critical depth", "mm", "critical_depth_mm"),
        ("first natural frequency", "Hz", "mode1_Hz"),
        ("gain of the magnet's shift per N", "1", "response_gain"),
        ("-3 dB bandwidth per N", "Hz", "response_bandwidth_Hz"),
        ("first resonance per N", "Hz", "response_resonance_Hz"),
        ("gap of the loop at mid-stroke", "% of full scale", "loop_gap_percent"),
    ]
    shown += [Shown(label, unit, {"FEM": column}, {}) for label, unit, column in extra if column in columns]
    return shown[:1] if not any(name in plan.quantities for name in ("critical_depth", "modes", *TIMED)) else shown
