"""Outputs of a sensitivity study at its sampled cases, by the surrogate or a level of the formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import Design
from studies.sensing.field_readings import columns as element_columns
from studies.sensitivity.beam_motions import motions, readings
from studies.sensitivity.varied_inputs import SampledCases

PRESS = {"force_N": "force_z", "shift_z_mm": "shift_z", "contact_radius_mm": "contact_radius"}
"""Outputs of a press, and the quantities of `beam_motions` that they are."""
SHEAR = {"force_N": "force_z", "force_x_N": "force_x", "shift_z_mm": "shift_z", "shift_x_mm": "shift_x"} | {
    "tilt_rad": "tilt",
    "contact_radius_mm": "contact_radius",
}
"""Outputs of a press and a shear."""


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """An output at n points: values, NaN where it has failed, and half widths of the model's 90 % interval."""

    value: Array
    half_width: Array


def names(design: Design, *, sheared: bool) -> tuple[str, ...]:
    """Return the names of the outputs, with their units: those that `magtip sweep` has, too.

    >>> names(Design(), sheared=False)
    ('force_N', 'shift_z_mm', 'contact_radius_mm', 'S1_V', 'S2_V')
    """
    elements, unit = element_columns(design)
    # by symmetry the third element reads in a press what the second one does
    shown = list(elements)[: None if sheared else 2] if design.shape.has_magnet else []
    return (*(SHEAR if sheared else PRESS), *(f"{element}_{unit}" for element in shown))


def sampled_outputs(
    model: str, design: Design, cases: SampledCases, *, sheared: bool
) -> tuple[dict[str, Output], tuple[str, ...]]:
    """Return the outputs by their names, and why each case has failed, "" where it has not."""
    moved = motions(model, cases.designs, cases.depth[:, None], cases.shear[:, None])
    quantities = SHEAR if sheared else PRESS
    outputs = {
        name: Output(moved.values[key][:, 0], moved.half_widths[key][:, 0]) for name, key in quantities.items()
    }
    read, half_widths = readings(cases.designs, moved)
    _, unit = element_columns(design)
    scale = 1.0 if unit == "V" else 1e3
    for k, name in enumerate(names(design, sheared=sheared)[len(quantities) :]):
        outputs[name] = Output(scale * read[:, 0, k], scale * half_widths[:, 0, k])
    refusals = tuple(
        refusal or str(reason) for refusal, reason in zip(cases.refusals, moved.refusals[:, 0], strict=True)
    )
    return outputs, refusals


def relative_half_width(output: Output) -> float:
    """Return the median half width over the standard deviation of an output: how much of its variation is error."""
    known = np.isfinite(output.value)
    deviation = float(output.value[known].std()) if known.any() else 0.0
    return float(np.median(output.half_width[known])) / deviation if deviation else 0.0
