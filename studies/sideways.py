"""What `magtip stability` says: when a press gives way sideways, and how stiff it is against a small shear."""

from __future__ import annotations

from typing import Any

from analytic import buckling
from geometry.design import Design
from geometry.scene import Magnet
from studies.console import Progress


def run(design: Design, magnet: Magnet, accuracy: str, depth: float | None, progress: Progress) -> dict[str, Any]:
    """One record: critical depths and forces of a free and a guided tip, formulas' loads, small shear at a depth.

    None stands where there is no instability down to the depth that was looked at (`stable_to_mm`), and the values
    at a depth are left out without one.
    """
    from fem import stability
    from fem.levels import LEVELS

    if depth is not None:
        stability.check_depth(design, depth, magnet)
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
        "stable_to_mm": free.stable_to,
        "euler_N": buckling.euler(design),
        "haringx_N": buckling.haringx(design),
        "haringx_depth_mm": buckling.depth(design, buckling.haringx(design)),
        "guided_critical_depth_mm": guided.depth,
        "guided_critical_force_N": guided.force,
        "guided_stable_to_mm": guided.stable_to,
        "guided_euler_N": buckling.euler(design, buckling.GUIDED),
    }
    if depth is not None:
        progress(0.8, f"shear at depth {depth:g} mm")
        small = stability.small_shear(design, depth, magnet, accuracy=level)
        record |= {
            "depth_mm": depth,
            "force_N": [0.0, 0.0, small.force],
            "contact_radius_mm": small.contact_radius,
            "stiffness_N_per_mm": small.stiffness,
            "shift_per_mm": small.shift,
            "tilt_rad_per_mm": small.tilt,
        }
    return record
