"""References of the study of cost and error: answers of three meshes, extrapolated, with their error bars.

Each component of an answer (forces, shift, tilt, flux densities) is extrapolated by itself: f + C h^p is fitted to
the three meshes. Where it converges too slowly, or not steadily, because the edge of the contact area moves from
element to element, the reference is the finest mesh. The error bar is the difference between reference and finest
mesh, or without an extrapolation the largest difference between the meshes.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analytic import hall
from geometry.design import BadInput, Design
from geometry.loads import Load, Response
from studies.validation.verify import richardson

QUANTITIES = ("force", "shift", "tilt", "sideways", "along", "readings")
"""Quantities whose errors are measured; sideways is the force along the shear alone, a part of `force`, relative to
itself; along is the same force, relative to the larger one of itself and that of the unpressed beam."""
LEAST_ORDER = 0.8
"""Least observed order for an extrapolation: a lower one multiplies the last difference by more than three."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad, force in N or flux density in T below which a relative error has no meaning."""
CLEAR = 3.0
"""A reference judges an error clearly if its bar is at most a third of the error."""

Components = dict[str, tuple[float, ...]]
"""Components of each quantity; mm, N, rad and T."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference of one state.

    Attributes
    ----------
    values : components of each quantity.
    bars : error bar of each component.
    orders : observed orders of the components that were extrapolated.
    """

    values: Components
    bars: Components
    orders: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TrueError:
    """Error of a quantity and error bar of the reference, percent of the quantity or of full scale."""

    percent: float
    bar_percent: float

    @property
    def clear(self) -> bool:
        """Whether the bar is at most a third of the error."""
        return CLEAR * self.bar_percent <= self.percent


def components(design: Design, load: Load, response: Response) -> Components:
    """Return the components of each quantity in one state; without tilt and sideways where nothing shears the tip."""
    values: Components = {"force": response.force, "shift": response.shift}
    if load.shears_tip:
        values |= {"tilt": (response.tilt,), "sideways": response.force[:1]}
    if design.shape.has_magnet:
        # there is no reading where the magnet has reached an element
        with contextlib.suppress(BadInput):
            values["readings"] = hall.readings(design, response).B_T
    return values


def extrapolate(sizes: Sequence[float], answers: Sequence[Components]) -> Reference:
    """Return the reference from the answers of three meshes.

    Parameters
    ----------
    sizes : edge lengths of the meshes, in decreasing order.
    """
    values, bars, orders = Components(), Components(), []
    for name in set.intersection(*(set(answer) for answer in answers)):
        limits, widths = [], []
        for column in zip(*(answer[name] for answer in answers), strict=True):
            limit, order = richardson([1 / size for size in sizes], column)
            if order >= LEAST_ORDER:
                orders.append(order)
                limits.append(limit)
                widths.append(abs(limit - column[-1]))
            else:
                limits.append(column[-1])
                widths.append(max(column) - min(column))
        values[name], bars[name] = tuple(limits), tuple(widths)
    return Reference(values, bars, tuple(orders))


def full_scales(design: Design, references: Sequence[Reference]) -> tuple[float, ...]:
    """Return the full scale of each element, T: its largest change from rest on a path; S2 and S3 share theirs."""
    readings = [one.values["readings"] for one in references if "readings" in one.values]
    if not readings:
        return ()
    rest = hall.readings(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)).B_T
    first, second, third = (
        max(abs(value - still) for value in column)
        for column, still in zip(zip(*readings, strict=True), rest, strict=True)
    )
    return first, max(second, third), max(second, third)


def true_errors(
    answer: Components, reference: Reference, scales: Sequence[float], unpressed_N: float = 0.0
) -> Mapping[str, TrueError]:
    """Return the errors of an answer against the reference of its state; none where the reference is nearly 0.

    Parameters
    ----------
    scales : full scale of each element, T.
    unpressed_N : force along the same shear of the unpressed beam.
    """
    errors = {}
    for name in QUANTITIES:
        if name not in answer or name not in reference.values:
            continue
        value, bar = reference.values[name], reference.bars[name]
        differences = [a - b for a, b in zip(answer[name], value, strict=True)]
        if name == "readings":
            if min(scales, default=0.0) > NOTHING:
                worst = max(abs(d) / scale for d, scale in zip(differences, scales, strict=True))
                errors[name] = TrueError(100 * worst, 100 * max(b / s for b, s in zip(bar, scales, strict=True)))
        elif math.hypot(*value) > NOTHING:
            size = math.hypot(*value)
            errors[name] = TrueError(100 * math.hypot(*differences) / size, 100 * math.hypot(*bar) / size)
    if "sideways" in answer and "sideways" in reference.values:
        ((own,), (true,)), (width,) = (answer["sideways"], reference.values["sideways"]), reference.bars["sideways"]
        size = max(abs(true), unpressed_N)
        errors["along"] = TrueError(100 * abs(own - true) / size, 100 * width / size)
    return errors
