"""Forces on many sensors, motions of their magnets and outputs, by the surrogate or by a level of the formulas.

The loads are those of both models, see `studies.beam.beam_model`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic import beam
from analytic.hall import batch_readings, converted
from analytic.parts import common_values
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load
from studies.beam import beam_model, surrogate_range, surrogate_response
from studies.beam.beam_model import Motions
from studies.beam.formula_beams import FormulaBeams
from studies.inputs import study_input
from studies.mechanics.study_cases import varied
from studies.sensing.field_readings import columns as element_columns
from studies.sensitivity.made_sensors import possible

SURROGATE = "surrogate"
MODELS = (SURROGATE, *beam.LEVELS)
"""Models of the mechanics."""
SPACING = 0.3
"""Distance of neighbouring training beams of the surrogate over its range: some 400 fill five dimensions."""
QUANTITIES = ("force_x", "force_z", "shift_x", "shift_z", "tilt", "contact_radius")
"""What is read of `Motions`."""
SHEAR = {
    "force_N": "force_z",
    "force_x_N": "force_x",
    "shift_z_mm": "shift_z",
    "shift_x_mm": "shift_x",
    "tilt_rad": "tilt",
    "contact_radius_mm": "contact_radius",
}
"""Outputs of a press and a shear, and which of `QUANTITIES` they are."""
PRESS = {name: SHEAR[name] for name in ("force_N", "shift_z_mm", "contact_radius_mm")}


@dataclass(frozen=True, slots=True)
class Press:
    """The load of a study: depth of the plate, mm, and shear along x with the tip stuck to the plate, mm."""

    depth: float
    shear: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.depth < math.inf:
            raise BadInput(f"--depth must be a finite number of mm above 0; got {self.depth:g}")
        if not 0 <= self.shear < math.inf:
            raise BadInput(f"--shear must be a finite number of mm, 0 or more; got {self.shear:g}")


def poses(values: Mapping[str, Array], towards_y: bool = False) -> tuple[Array, Array]:
    """Return shift, shape (n, k, 3), mm, and rotation vector, (n, k, 2), rad, for a shear along x or along y."""
    zero = np.zeros_like(values["shift_x"])
    x, z, tilt = values["shift_x"], values["shift_z"], values["tilt"]
    if towards_y:
        return np.stack([zero, x, z], axis=-1), np.stack([-tilt, zero], axis=-1)
    return np.stack([x, zero, z], axis=-1), np.stack([zero, tilt], axis=-1)


def motions(model: str, designs: Sequence[Design | None], depth: Array, shear: Array) -> Motions:
    """Return the results of n sensors, None for an impossible one, at depths and shears (n, k), mm, by a model."""
    if model not in MODELS:
        raise BadInput(f"the model must be one of {', '.join(MODELS)}; got {model!r}")
    values, half_widths = ({name: np.full(depth.shape, np.nan) for name in QUANTITIES} for _ in range(2))
    refusals = np.full(depth.shape, "", dtype=object)
    if model == SURROGATE:
        # a kind of sensor that the surrogate does not know is refused whatever its load
        for k, design in enumerate(designs):
            refusals[k] = "" if design is None else surrogate_response.refusal_of_kind(design, Load(), "rigid")
    rows = [k for k, design in enumerate(designs) if design is not None and not refusals[k].any()]
    known = [design for k in rows if (design := designs[k])]
    if known:
        beams = surrogate_response.beams_of(known) if model == SURROGATE else FormulaBeams(model, known)
        moved = beam_model.motions(beams, known, depth[rows], shear[rows])
        refusals[rows] = moved.refusals
        for name in QUANTITIES:
            values[name][rows], half_widths[name][rows] = moved.values[name], moved.half_widths[name]
    return Motions(values, half_widths, refusals)


def error_lengths(model: str, design: Design) -> dict[str, float]:
    """Return the distances in the inputs over which the error of a model varies, in the unit of each input.

    The error of the surrogate changes from one training beam to the next, which are about `SPACING` of its range
    apart. It does not depend on other inputs: forces are exactly proportional to E, for example.
    """
    if model != SURROGATE:
        return {}
    smaller = min(design.magnet_diameter, design.magnet_height) / design.D
    ranges = {
        "L": surrogate_range.LENGTH,
        "magnet_diameter": surrogate_range.DIAMETER,
        "magnet_height": surrogate_range.HEIGHT,
        "magnet_edge_radius": (0.0, surrogate_range.EDGE[1] * smaller),
        "depth": (surrogate_range.SHALLOWEST, surrogate_range.DEEPEST),
        "shear": (0.0, surrogate_range.FARTHEST),
        # D changes all of these ratios
        "D": (0.0, 1.0),
    }
    lengths = {name: SPACING * design.D * (high - low) for name, (low, high) in ranges.items()}
    return lengths | {"nu": SPACING * (surrogate_range.POISSON[1] - surrogate_range.POISSON[0])}


def readings(designs: Sequence[Design | None], moved: Motions) -> tuple[Array, Array]:
    """Return the outputs of the elements in all states, not rounded, shape (n, k, 3), V or T, and their half widths.

    The half widths follow from those of the motions, one motion after the other, added as independent errors; NaN
    where one of them is unknown.
    """
    widths = {name: moved.half_widths[name] for name in ("shift_x", "shift_z", "tilt")}
    causes = [name for name, width in widths.items() if (width > 0).any()]
    changed = [dict(moved.values) | {name: moved.values[name] + moved.half_widths[name]} for name in causes]
    # all variants at once: a design's magnet is then evaluated once
    stacked = {
        name: np.hstack([varied_values[name] for varied_values in (moved.values, *changed)]) for name in moved.values
    }
    outputs, *varied_outputs = np.split(_outputs(designs, stacked), len(changed) + 1, axis=1)
    squares = [(output - outputs) ** 2 for output in varied_outputs]
    width = np.sqrt(np.sum(squares, axis=0)) if squares else np.zeros_like(outputs)
    return outputs, np.where(np.isnan(sum(widths.values()))[..., None], np.nan, width)


def _outputs(designs: Sequence[Design | None], values: Mapping[str, Array]) -> Array:
    """Return the outputs of the elements within the rails, not rounded to the converter's steps, shape (n, k, m)."""
    shift, tilt = poses(values)
    count, states = shift.shape[:2]
    possible = [design for design in designs if design is not None]
    if not possible:
        return np.full((count, states, 3), np.nan)
    # an impossible sensor has no motion, so that any design may take its place
    stand_in = [design or possible[0] for design in designs]
    owner = np.repeat(np.arange(count), states)
    field = batch_readings(stand_in, owner, shift.reshape(-1, 3), tilt.reshape(-1, 2)).field_T
    gain, null, low, high, *_ = np.array([common_values(design) for design in stand_in])[owner].T[:, :, None]
    return converted(null + gain * field, low, high, np.zeros(1))[0].reshape(count, states, field.shape[1])


def names(design: Design, *, sheared: bool) -> tuple[str, ...]:
    """Return the names of the outputs, with their units: those that `magtip sweep` has, too.

    >>> names(Design(), sheared=False)
    ('force_N', 'shift_z_mm', 'contact_radius_mm', 'S1_V', 'S2_V')
    """
    elements, unit = element_columns(design)
    # by symmetry the last of three elements reads in a press what the second one does
    shown = list(elements)[: None if sheared or len(elements) > 3 else 2] if design.shape.has_magnet else []
    return (*(SHEAR if sheared else PRESS), *(f"{element}_{unit}" for element in shown))


def sampled_outputs(
    model: str,
    design: Design,
    ranges: Mapping[str, tuple[float, float]],
    points: Array,
    load: Press,
    *,
    sheared: bool,
) -> tuple[dict[str, tuple[Array, Array]], tuple[str, ...]]:
    """Return the outputs at points (n, d) by their names, and why each point has failed, "" where it has not.

    An output is its values, NaN where it has failed, and the half widths of the model's 90 % interval, each of shape
    (n,). Hall elements keep their places, as in `study_cases.varied`.
    """
    columns = dict(zip(ranges, points.T, strict=True))
    fields = {name: values for name, values in columns.items() if name in study_input.DESIGN}
    made = [possible(varied, design, {name: float(of[k]) for name, of in fields.items()}) for k in range(len(points))]
    designs, impossible = zip(*made, strict=True)
    depth, shear = (columns.get(name, np.full(len(points), getattr(load, name))) for name in ("depth", "shear"))
    moved = motions(model, designs, depth[:, None], shear[:, None])
    quantities = SHEAR if sheared else PRESS
    outputs = {name: (moved.values[key][:, 0], moved.half_widths[key][:, 0]) for name, key in quantities.items()}
    read, half_widths = readings(designs, moved)
    scale = 1.0 if element_columns(design)[1] == "V" else 1e3
    for k, name in enumerate(names(design, sheared=sheared)[len(quantities) :]):
        outputs[name] = scale * read[:, 0, k], scale * half_widths[:, 0, k]
    refusals = zip(impossible, moved.refusals[:, 0], strict=True)
    return outputs, tuple(reason or str(refused) for reason, refused in refusals)
