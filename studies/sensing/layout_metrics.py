"""Figures of a layout from its map: shares of the workspace, condition number, noise, and a summary sentence."""

from __future__ import annotations

import dataclasses

import numpy as np

from analytic import decode, parts
from analytic.decode import Decoder
from analytic.inverse.response_surface import Mechanics
from analytic.survey import Survey, survey
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.inputs.option_groups import Basis
from studies.output.records import FlatRow
from studies.sensing import decode_readings
from studies.sensing.decode_readings import Source

COUNTS = (25, 25, 13)
"""Numbers of poses of the map along x, y and z."""


def prepare(
    design: Design,
    law: Mechanics,
    basis: Basis,
    cells: tuple[int, int, int] | None = None,
) -> tuple[Decoder, str]:
    """Return the decoder of a design, and the source of its elements' noise.

    If no element has a noise or a step, elements with an output in V get those of `analytic.parts.CONVERTER`.
    """
    if basis.mode == "magnitude" and basis.reject_ambient:
        raise BadInput(
            "|B| does not grow by that of an ambient field: leave --mode magnitude or --reject-ambient out"
        )
    if basis.mode == "magnitude" and design.hall_layout != "three":
        raise BadInput("a 3-axis chip gives only one |B|, which cannot determine a pose: leave --mode magnitude out")
    elements, source = parts.with_noise(parts.of_design(design))
    coder = decode.decoder(
        design,
        law,
        ignore_tilt=basis.ignore_tilt,
        elements=elements,
        mode=basis.mode,
        cells=cells or decode.CELLS,
        reject_ambient=basis.reject_ambient,
    )
    return coder, source


def price(design: Design, law: Mechanics, basis: Basis, poses: Survey) -> float | None:
    """Return by which factor a rejected ambient field makes the noise of the force larger, the median over usable
    poses; None where it is not rejected or no pose is usable."""
    if not basis.reject_ambient:
        return None
    plain, _ = prepare(design, law, dataclasses.replace(basis, reject_ambient=False), cells=(1, 1, 1))
    before = survey(plain, poses.counts, multiplicity=False, clearance=basis.clearance)
    ratio = (poses.noise_N / before.noise_N)[poses.usable]
    return float(np.median(ratio)) if len(ratio) else None


def layout_row(coder: Decoder, poses: Survey, noise: str, mechanics: Source) -> FlatRow:
    """Return all figures of a layout from its survey, with its elements and the settings of the evaluation."""
    design, elements = coder.forward.design, coder.forward.elements
    three = design.hall_layout == "three"
    measured = figures(poses)
    known = 100 * float((poses.weight > 0).mean())
    return {
        "status": "ok",
        "message": "; ".join(decode_readings.sentences("layout", f=measured, known=known, percent=percent_text)),
        "layout": design.hall_layout,
        "elements": [element.name for element in elements],
        "f_mm": design.f if three else None,
        "l0_mm": design.l0,
        "c_mm": design.c if three else None,
        "chip_x_mm": None if three else design.chip_x,
        "chip_count": None if three else design.chip_count,
        "mechanics": mechanics.name,
        "mechanics_reason": mechanics.reason,
        "tilt": "followed" if coder.forward.tau[0].any() else "none",
        "mode": coder.forward.mode,
        "workspace_mm": [coder.low.tolist(), coder.high.tolist()],
        "poses": len(poses.weight),
        "known_percent": known,
        **measured,
        "noise_of_readings_T": coder.sigma.tolist(),
        "noise_source": noise,
        "hits": decode_readings.sentences(
            "hits",
            elements=elements,
            magnet=[poses.share(hit) for hit in poses.magnet_hits],
            wall=[poses.share(hit) for hit in poses.wall_hits],
            ground=poses.share(poses.grounded),
            percent=percent_text,
        ),
        "warnings": design.warnings(),
    }


def figures(poses: Survey) -> FlatRow:
    """Return shares, sign of det J, condition number and noise of the poses of a survey.

    Condition number and noise are infinite on a fold, and None if no pose is usable. folded : whether det J changes
    its sign. most_alike : largest number of poses with the same readings, and alike_apart_mm : the largest distance
    between such poses. worst_at_mm : shift of the pose with the largest noise. noise_median_axes_N,
    noise_worst_axes_N : noise of the force along x, y and z.
    """
    many, usable, known = poses.multiplicity > 1, poses.usable, poses.weight > 0
    places = np.flatnonzero(usable)
    condition, micrometres, newtons = (
        _median_and_worst(poses, values) for values in (poses.condition, 1e3 * poses.noise_mm, 1.0 * poses.noise_N)
    )
    axes = [
        None if any(value is None for value in values) else list(values)
        for values in zip(*(_median_and_worst(poses, values) for values in poses.axis_noise_N), strict=True)
    ]
    return {
        "unique_percent": 100 * poses.share(usable & ~many),
        "ambiguous_percent": 100 * poses.share(usable & many),
        "saturated_percent": 100 * poses.share(poses.saturated & ~poses.blocked),
        "blocked_percent": 100 * poses.share(poses.blocked),
        "det_positive_percent": 100 * poses.share(poses.sign > 0),
        "det_negative_percent": 100 * poses.share(poses.sign < 0),
        "folded": poses.folded,
        "most_alike": int(poses.multiplicity[known].max()),
        "alike_apart_mm": float(poses.alike_mm[usable & many].max(initial=0.0)),
        "condition_median": condition[0],
        "condition_worst": condition[1],
        "noise_median_um": micrometres[0],
        "noise_worst_um": micrometres[1],
        "noise_median_N": newtons[0],
        "noise_worst_N": newtons[1],
        "worst_at_mm": poses.shift[:, places[poses.noise_mm[places].argmax()]].tolist() if len(places) else None,
        "noise_median_axes_N": axes[0],
        "noise_worst_axes_N": axes[1],
    }


def _median_and_worst(poses: Survey, values: Array) -> tuple[float | None, float | None]:
    usable = values[poses.usable]
    if not len(usable):
        return None, None
    # on a fold the worst is infinite
    return float(np.median(usable)), float(np.inf if poses.folded else usable.max())


def percent_text(value: float) -> str:
    """Format a share with enough digits that it is never rounded to 0 or 100.

    >>> percent_text(0.004), percent_text(12.3456), percent_text(99.98), percent_text(100.0)
    ('below 0.01 %', '12.3 %', '99.98 %', '100 %')
    """
    if 0 < value < 0.01:
        return "below 0.01 %"
    return f"{value:.3g} %" if value < 99.5 else f"{value:.4g} %"
