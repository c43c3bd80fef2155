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
from studies.beam import prediction, surrogate_range
from studies.beam.prediction import Beams, Quantity

REMEDY = ": take finite elements"


@dataclass(frozen=True, slots=True)
class Estimate:
    """A response by the surrogate.

    strain : largest strain of the silicone (see `fem.results.silicone_limits`).
    errors : half widths of 90 % intervals, over the lengths of force, shift and tilt, and of the force along a shear
        ("sideways") over itself; None for tilt and sideways of a press.
    """

    response: Response
    strain: float
    errors: Mapping[str, float | None]

    @property
    def message(self) -> str:
        """Which model the state is from, and its intervals, in a sentence."""
        named = {name.replace("sideways", "force along the shear"): width for name, width in self.errors.items()}
        shown = ", ".join(f"{name} +-{100 * width:.2g} %" for name, width in named.items() if width is not None)
        return f"by the surrogate; 90 % intervals: {shown}"


def respond(design: Design, load: Load, magnet: Magnet = "rigid") -> Estimate:
    """Return the response of a design to a load."""
    check_load(design, load, magnet)
    (estimate,) = respond_all([(design, load, magnet)])
    if isinstance(estimate, str):
        raise BadInput(estimate)
    return estimate


def respond_all(cases: Sequence[tuple[Design, Load, Magnet]]) -> list[Estimate | str]:
    """Return the response of each case, or the sentence why there is none; the cases are possible."""
    found = [refusal_of_kind(*case) for case in cases]
    answers: list[Estimate | str] = [f"{reason}{REMEDY}" for reason in found]
    known = [k for k, reason in enumerate(found) if not reason]
    if not known:
        return answers
    try:
        beams = beams_of([cases[k][0] for k in known])
    except BadInput as error:
        return [f"{reason or error}{REMEDY}" for reason in found]
    loads = [cases[k][1] for k in known]
    D = np.array([cases[k][0].D for k in known])
    depth = np.array([load.depth for load in loads])
    shear = np.array([load.shear if load.shears_tip else 0.0 for load in loads])
    # a shear of 0 is answered by the press
    press, sheared = beams.press((depth / D)[:, None]), beams.shear((depth / D)[:, None], (shear / D)[:, None])
    for row, (k, load) in enumerate(zip(known, loads, strict=True)):
        design = cases[k][0]
        if reason := load_refusal(beams, row, design.D, load.depth, float(shear[row])):
            answers[k] = f"{reason}{REMEDY}"
        else:
            answers[k] = _estimate(sheared if load.shears_tip else press, row, design, load)
    return answers


def _estimate(found: Mapping[str, Quantity], row: int, design: Design, load: Load) -> Estimate:
    q = {name: (float(one.value[row, 0]), float(one.half_width[row, 0])) for name, one in found.items()}
    errors, x, y = dict[str, float | None](), 1.0, 0.0
    if load.shears_tip:
        x, y = load.shear_x / load.shear, load.shear_y / load.shear
    else:
        q |= dict.fromkeys(("force_x", "shift_x", "tilt"), (0.0, 0.0))
        q |= {"force_z": q["force"], "shift_z": q["shift"]}
    for name in ("force", "shift"):
        size, width = (np.hypot(*pair) for pair in zip(q[f"{name}_x"], q[f"{name}_z"], strict=True))
        errors[name] = float(width / size)
    for name, key in (("tilt", "tilt"), ("sideways", "force_x")):
        errors[name] = q[key][1] / abs(q[key][0]) if load.shears_tip else None
    D, unit = design.D, design.E * design.D**2
    force, shift, tilt = q["force_x"][0] * unit, q["shift_x"][0] * D, q["tilt"][0]
    response = Response(
        force=(x * force, y * force, unit * q["force_z"][0]),
        shift=(x * shift, y * shift, -D * q["shift_z"][0]),
        tilt=x * tilt,
        contact_radius=D * q["contact_radius"][0],
        tilt_y=y * tilt,
    )
    return Estimate(response, q["strain"][0], errors)


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
    # without the response, which takes four times as long: the live page asks with every state
    if reason := refusal_of_kind(design, load, magnet):
        return reason
    try:
        beams = beams_of([design])
    except BadInput as error:
        return str(error)
    return load_refusal(beams, 0, design.D, load.depth, load.shear if load.shears_tip else 0.0)


def refusal_of_kind(design: Design, load: Load, magnet: Magnet) -> str:
    """Return why the surrogate refuses a kind of sensor or load; "" if it takes it."""
    reasons = {
        f"the surrogate knows the law neo-hookean only; got {design.law}": design.law != "neo-hookean",
        "the surrogate knows beams with a rigid magnet only": not design.shape.has_magnet or magnet == "ignored",
        "the surrogate does not know Coulomb friction": load.coulomb is not None,
        "the surrogate does not know grips": load.grip is not None,
        "the surrogate does not know tilted plates": bool(load.plate_tilt),
        "the surrogate does not know imperfections": bool(load.imperfection),
    }
    return next((text for text, refused in reasons.items() if refused), "")


def load_refusal(beams: Beams, k: int, D: float, depth: float, shear: float) -> str:
    """Return why the surrogate refuses a load of beam `k`, "" if it takes it.

    `depth`, `shear`: mm; a press has no shear.
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
