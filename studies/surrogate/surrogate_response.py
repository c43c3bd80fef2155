"""The response of one design to one load by the surrogate, in the user's units, with 90 % intervals.

What it does not know it refuses: other laws than neo-Hookean, designs without a magnet, beams and loads outside its
range, Coulomb friction, grips, tilted plates, imperfections, presses and shears beyond the depth to which a press is
known to stay stable; and everything if its file is older than the finite elements. All users take `refusal`, or for
many beams at once `Beams.knows` and `load_refusal`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response, check_load
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.prediction import Beams, Quantity


@dataclass(frozen=True, slots=True)
class Estimate:
    """A response by the surrogate.

    Attributes
    ----------
    strain : largest strain of the silicone (see `fem.results.silicone_limits`).
    force_error, shift_error, tilt_error : half widths of 90 % intervals, over the length of force, shift and tilt.
    sideways_error : half width of the force along a shear, over this force.
    """

    response: Response
    strain: float
    force_error: float
    shift_error: float
    tilt_error: float | None = None
    sideways_error: float | None = None


def respond(design: Design, load: Load, magnet: Magnet = "rigid") -> Estimate:
    """Return the response of a design to a load.

    Raises
    ------
    BadInput
        Design or load lie outside the range; the sentence says in what.
    """
    check_load(design, load, magnet)
    reason = refusal(design, load, magnet)
    if reason:
        raise BadInput(f"{reason}: take finite elements")
    beams = beams_of([design])
    D, unit = design.D, design.E * design.D**2
    depth = np.array([[load.depth / D]])
    if not load.shears_tip:
        press = {name: _number(quantity) for name, quantity in beams.press(depth).items()}
        force, shift = press["force"], press["shift"]
        response = Response(
            (0.0, 0.0, unit * force[0]), (0.0, 0.0, -D * shift[0]), 0.0, D * press["contact_radius"][0]
        )
        return Estimate(response, press["strain"][0], force[1] / force[0], shift[1] / abs(shift[0]))
    x, y = load.shear_x / load.shear, load.shear_y / load.shear
    q = {name: _number(one) for name, one in beams.shear(depth, np.array([[load.shear / D]])).items()}
    along, tilt = q["force_x"][0] * unit, q["tilt"][0]
    shift_x = q["shift_x"][0] * D
    response = Response(
        force=(x * along, y * along, unit * q["force_z"][0]),
        shift=(x * shift_x, y * shift_x, -D * q["shift_z"][0]),
        tilt=x * tilt,
        contact_radius=D * q["contact_radius"][0],
        tilt_y=y * tilt,
    )
    size = {name: float(np.hypot(q[f"{name}_x"][0], q[f"{name}_z"][0])) for name in ("force", "shift")}
    widths = {name: float(np.hypot(q[f"{name}_x"][1], q[f"{name}_z"][1])) / size[name] for name in ("force", "shift")}
    tilt_error, sideways_error = (q[name][1] / abs(q[name][0]) for name in ("tilt", "force_x"))
    return Estimate(response, q["strain"][0], widths["force"], widths["shift"], tilt_error, sideways_error)


def beams_of(designs: list[Design]) -> Beams:
    """Return the beams of designs that have a magnet."""

    def over_D(name: str) -> Array:
        return np.array([getattr(design, name) / design.D for design in designs])

    return prediction.beams(
        over_D("L"),
        over_D("magnet_diameter"),
        over_D("magnet_height"),
        np.array([design.nu for design in designs]),
        over_D("magnet_edge_radius"),
    )


def refusal(design: Design, load: Load, magnet: Magnet) -> str:
    """Return why the surrogate refuses a case, "" if it takes it."""
    for refused, text in (
        (design.law != "neo-hookean", f"the surrogate knows the law neo-hookean only; got {design.law}"),
        (not design.shape.has_magnet or magnet == "ignored", "the surrogate knows beams with a rigid magnet only"),
        (load.coulomb is not None, "the surrogate does not know Coulomb friction"),
        (load.grip is not None, "the surrogate does not know grips"),
        (bool(load.plate_tilt), "the surrogate does not know tilted plates"),
        (bool(load.imperfection), "the surrogate does not know imperfections"),
    ):
        if refused:
            return text
    try:
        beams = beams_of([design])
    except BadInput as error:
        return str(error)
    return load_refusal(beams, 0, design.D, load.depth, load.shear if load.shears_tip else 0.0)


def load_refusal(beams: Beams, k: int, D: float, depth: float, shear: float) -> str:
    """Return why the surrogate refuses a load of beam `k`, "" if it takes it.

    Parameters
    ----------
    depth, shear : mm; a press has no shear.
    """
    if beams.outside[k]:
        return str(beams.outside[k])
    least = surrogate_range.SHALLOWEST_SHEAR if shear else surrogate_range.SHALLOWEST
    most = float(beams.deepest[k])
    if not least - 1e-9 <= depth / D <= most + 1e-9:
        return f"the surrogate knows depths of {least * D:.3g} to {most * D:.3g} mm here; got {depth:g} mm"
    if not shear / D <= beams.farthest[k] + 1e-9:
        return f"the surrogate knows shears to {float(beams.farthest[k]) * D:.3g} mm here; got {shear:g} mm"
    stable = float(beams.stable_to()[k])
    if not depth / D <= stable + 1e-9:
        return (
            f"the surrogate knows a press to stay stable to {stable * D:.3g} mm here, and nothing deeper; "
            f"got {depth:g} mm"
        )
    return ""


def _number(quantity: Quantity) -> tuple[float, float]:
    """Return value and half width of a single case."""
    return float(quantity.value.item()), float(quantity.half_width.item())
