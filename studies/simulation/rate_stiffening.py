"""How a comparison's static forces change with the rate of the motion, from the relaxation of the silicone alone.

All stress that relaxes does so by one function G(t), so the force of a growing load follows from the static one by
superposition (exact for a held load, and for a sphere on a half space: Lee and Radok 1960),

    F(t) = int_0^t G(t - s) / G_E dF_static(s)          with a speed: the plate moves evenly from rest,
    F = G'(2 pi f) / G_E F_static                       with a frequency: the part in phase, steady and small,

G_E the modulus that the design's E is, long-term or instantaneous. Inertia is neglected; `magtip cycle` and
`magtip response` solve for the whole sensor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.relaxation import range_remedy, range_sentence, relaxation_of
from studies.output.records import FlatRow

TABLES = {"press": ("depth_mm", "fem_force_N"), "shear": ("shear_mm", "fem_force_x_N")}
"""Columns of the travel and of the force in the tables of a comparison."""


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
    design: Design, table: str, rows: Sequence[FlatRow], frequency: float | None, speed: float | None
) -> list[FlatRow]:
    """Return the rows of a table with the finite elements' force at a rate, N, and its change, %; without a rate the
    rows themselves.
    """
    if frequency is None and speed is None:
        return list(rows)
    way, column = TABLES[table]
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
    relaxation = relaxation_of(design)
    if not solved:
        return "no press was solved, so the force at this rate is not known"
    last = solved[-1]
    change, depth = last["fem_force_at_rate_change_percent"], last["depth_mm"]
    beside = f"{abs(change):.1f} % {'above' if change >= 0 else 'below'}"
    which = "at rest" if design.modulus == "long-term" else "with the instantaneous modulus"
    if frequency is not None:
        loss = float(relaxation.loss_factor(2 * math.pi * frequency))
        return (
            f"in small vibrations at {frequency:g} Hz the forces in phase are {beside} those {which}, and "
            f"the loss factor is {loss:.3g} (columns at_rate, without inertia; magtip response has it)"
        )
    return (
        f"pressed at {speed:g} mm/s to {depth:g} mm the force is {last['fem_force_at_rate_N']:.4g} N, "
        f"{beside} that {which} (columns at_rate, by superposition; magtip cycle solves for it)"
    )
