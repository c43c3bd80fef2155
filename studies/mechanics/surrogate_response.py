"""The response of one design to one load by the surrogate, in the user's units, with 90 % intervals.

What it does not know it refuses: other laws than neo-Hookean, designs without a magnet, beams and loads outside its
range, Coulomb friction, grips, tilted plates, imperfections, presses and shears beyond the depth to which a press is
known to stay stable; and everything if its file is older than the finite elements. All users take `refusal`, or for
many beams at once `Beams.knows` and `load_refusal`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response, check_load
from studies.mechanics import prediction, surrogate_range
from studies.mechanics.prediction import Beams, Quantity


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
    (estimate,) = respond_all([(design, load, magnet)])
    if isinstance(estimate, str):
        raise BadInput(estimate)
    return estimate


def respond_all(cases: Sequence[tuple[Design, Load, Magnet]]) -> list[Estimate | str]:
    """Return the response of each case, or the sentence why there is none; the cases are possible."""
    found = [_refusal_of_kind(*case) for case in cases]
    answers: list[Estimate | str] = [f"{reason}: take finite elements" for reason in found]
    known = [k for k, reason in enumerate(found) if not reason]
    if not known:
        return answers
    try:
        beams = beams_of([cases[k][0] for k in known])
    except BadInput as error:
        return [f"{reason or error}: take finite elements" for reason in found]
    loads = [cases[k][1] for k in known]
    D = np.array([cases[k][0].D for k in known])
    depth = np.array([load.depth for load in loads])
    shear = np.array([load.shear if load.shears_tip else 0.0 for load in loads])
    # a shear of 0 is answered by the press
    press, sheared = beams.press((depth / D)[:, None]), beams.shear((depth / D)[:, None], (shear / D)[:, None])
    for row, (k, load) in enumerate(zip(known, loads, strict=True)):
        design = cases[k][0]
        if reason := load_refusal(beams, row, design.D, load.depth, float(shear[row])):
            answers[k] = f"{reason}: take finite elements"
        elif load.shears_tip:
            answers[k] = _sheared(sheared, row, design, load)
        else:
            answers[k] = _pressed(press, row, design)
    return answers


def _pressed(press: Mapping[str, Quantity], row: int, design: Design) -> Estimate:
    q = {name: _number(quantity, row) for name, quantity in press.items()}
    force, shift, D, unit = q["force"], q["shift"], design.D, design.E * design.D**2
    response = Response((0.0, 0.0, unit * force[0]), (0.0, 0.0, -D * shift[0]), 0.0, D * q["contact_radius"][0])
    return Estimate(response, q["strain"][0], force[1] / force[0], shift[1] / abs(shift[0]))


def _sheared(sheared: Mapping[str, Quantity], row: int, design: Design, load: Load) -> Estimate:
    x, y = load.shear_x / load.shear, load.shear_y / load.shear
    q = {name: _number(quantity, row) for name, quantity in sheared.items()}
    D, unit = design.D, design.E * design.D**2
    force, shift, tilt = q["force_x"][0] * unit, q["shift_x"][0] * D, q["tilt"][0]
    response = Response(
        force=(x * force, y * force, unit * q["force_z"][0]),
        shift=(x * shift, y * shift, -D * q["shift_z"][0]),
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
    reason = _refusal_of_kind(design, load, magnet)
    if reason:
        return reason
    try:
        beams = beams_of([design])
    except BadInput as error:
        return str(error)
    return load_refusal(beams, 0, design.D, load.depth, load.shear if load.shears_tip else 0.0)


def _refusal_of_kind(design: Design, load: Load, magnet: Magnet) -> str:
    """Return why the surrogate refuses a kind of sensor or load; "" if it takes it."""
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
    return ""


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


def _number(quantity: Quantity, row: int) -> tuple[float, float]:
    return float(quantity.value[row, 0]), float(quantity.half_width[row, 0])


def surrogate_message(estimate: Estimate) -> str:
    """Return which model a state is from, and its 90 % intervals, in a sentence."""
    widths = {"force": estimate.force_error, "shift": estimate.shift_error, "tilt": estimate.tilt_error}
    widths["force along the shear"] = estimate.sideways_error
    shown = ", ".join(f"{name} +-{100 * width:.2g} %" for name, width in widths.items() if width is not None)
    return f"by the surrogate; 90 % intervals: {shown}"
