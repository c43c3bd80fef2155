"""What `magtip stability` says: when a press gives way sideways, and how stiff it is against a small shear."""

from __future__ import annotations

from dataclasses import astuple
from typing import Any

from analytic import buckling
from geometry.design import BadInput, Design
from geometry.loads import Magnet
from geometry.messages import Progress

PER_MM = ("stiffness_N_per_mm", "shift_per_mm", "tilt_rad_per_mm")
ESTIMATES = ("stiffness_error_estimate", "shift_error_estimate", "tilt_error_estimate")


def run(design: Design, magnet: Magnet, accuracy: str, depth: float | None, progress: Progress) -> dict[str, Any]:
    """One record: critical depths and forces of a free and a guided tip, formulas' loads, small shear at a depth.

    None stands where there is no instability down to the depth that was looked at (`stable_to_mm`), and the values
    at a depth are left out without one.
    """
    from fem import small_shear, stability
    from fem.accuracy import LEVELS

    if depth is not None:
        small_shear.check_depth(design, depth, magnet)
    level = LEVELS[accuracy]
    progress(0.0, "free tip")
    free = stability.critical(design, magnet, accuracy=level)
    progress(0.4, "guided tip")
    guided = stability.critical(design, magnet, guided=True, accuracy=level)
    record: dict[str, Any] = {
        "status": "ok",
        "message": "; ".join(text for text in (free.message, guided.message) if text),
        "critical_depth_mm": free.depth,
        "critical_force_N": free.force,
        "critical_depth_error_estimate": free.estimates.depth,
        "critical_force_error_estimate": free.estimates.force,
        "stable_to_mm": free.stable_to,
        "euler_N": buckling.euler(design),
        "haringx_N": buckling.haringx(design),
        "haringx_depth_mm": buckling.depth(design, buckling.haringx(design)),
        "guided_critical_depth_mm": guided.depth,
        "guided_critical_force_N": guided.force,
        "guided_critical_depth_error_estimate": guided.estimates.depth,
        "guided_critical_force_error_estimate": guided.estimates.force,
        "guided_stable_to_mm": guided.stable_to,
        "guided_euler_N": buckling.euler(design, buckling.GUIDED),
    }
    return record if depth is None else record | _at(design, magnet, accuracy, depth, record, progress)


def _at(
    design: Design, magnet: Magnet, accuracy: str, depth: float, record: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    """What the record says of a small shear at a depth; with status not_converged if the press does not reach it."""
    from fem import small_shear
    from fem.accuracy import LEVELS

    progress(0.8, f"shear at depth {depth:g} mm")
    said = [record["message"]] if record["message"] else []
    try:
        small = small_shear.small_shear(design, depth, magnet, accuracy=LEVELS[accuracy])
    except BadInput as error:
        none = dict.fromkeys(("force_N", "contact_radius_mm", *PER_MM, *ESTIMATES))
        return {"status": "not_converged", "message": "; ".join([*said, str(error)]), "depth_mm": depth} | none
    free, guided = record["critical_depth_mm"], record["guided_critical_depth_mm"]
    if guided is not None and depth > guided:
        said.append(f"at depth {depth:g} mm the straight press is unstable even with a guided tip")
    elif free is not None and depth > free:
        said.append(
            f"at depth {depth:g} mm the straight press is unstable if the tip slides freely: stiffness, shift and "
            "tilt hold for a tip that sticks to the plate"
        )
    elif depth > record["stable_to_mm"]:
        limit = record["stable_to_mm"]
        said.append(f"at depth {depth:g} mm stability is unknown: the search ended at {limit:.4g} mm")
    return {
        "message": "; ".join(said),
        "depth_mm": depth,
        "force_N": [0.0, 0.0, small.force],
        "contact_radius_mm": small.contact_radius,
        **dict(zip(PER_MM, (small.stiffness, small.shift, small.tilt), strict=True)),
        **dict(zip(ESTIMATES, astuple(small.estimates), strict=True)),
    }


def shown(record: dict[str, Any]) -> dict[str, Any]:
    """The record for a person to read: where nothing was found, up to which depth it was looked for."""
    texts = {}
    for name in ("", "guided_"):
        if record[f"{name}critical_depth_mm"] is None:
            texts[f"{name}critical_depth_mm"] = f"none up to {record[f'{name}stable_to_mm']:.5g}"
    return record | texts
