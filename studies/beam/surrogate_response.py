"""The response of one design to one load by the surrogate, in the user's units, with 90 % intervals.

What it does not know it refuses: other laws than neo-Hookean, designs without a magnet, beams and loads outside its
range, Coulomb friction, grips, tilted plates, imperfections, presses and shears beyond the depth to which a press is
known to stay stable; and everything if its file is older than the finite elements. All users take `refusal`, or for
many beams at once `Beams.refusals`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response, check_load
from studies.beam import prediction
from studies.beam.beam_model import ODD, Motions, motions
from studies.beam.prediction import Beams
from studies.quantities import shown

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
        widths = [f"{name} +-{shown(width, 'percent', 2)}" for name, width in named.items() if width is not None]
        return f"by the surrogate; 90 % intervals: {', '.join(widths)}"


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
    # a shear that does not move the tip is answered by the press
    depth, shear = np.array([(load.depth, load.shear if load.shears_tip else 0.0) for load in loads]).T[..., None]
    moved = motions(beams, [cases[k][0] for k in known], depth, shear)
    for row, (k, load) in enumerate(zip(known, loads, strict=True)):
        reason = moved.refusals[row, 0]
        answers[k] = f"{reason}{REMEDY}" if reason else _estimate(moved, row, load)
    return answers


def _estimate(moved: Motions, row: int, load: Load) -> Estimate:
    q, widths = ({name: float(of[row, 0]) for name, of in each.items()} for each in (moved.values, moved.half_widths))
    errors, x, y = dict[str, float | None](), 1.0, 0.0
    if load.shears_tip:
        x, y = load.shear_x / load.shear, load.shear_y / load.shear
    for name in ("force", "shift"):
        size, width = (np.hypot(each[f"{name}_x"], each[f"{name}_z"]) for each in (q, widths))
        errors[name] = float(width / size)
    for name, key in (("tilt", "tilt"), ("sideways", "force_x")):
        errors[name] = widths[key] / abs(q[key]) if load.shears_tip else None
    force, shift, tilt = (q[name] for name in ODD)
    response = Response(
        force=(x * force, y * force, q["force_z"]),
        shift=(x * shift, y * shift, q["shift_z"]),
        tilt=x * tilt,
        contact_radius=q["contact_radius"],
        tilt_y=y * tilt,
    )
    return Estimate(response, q["strain"], errors)


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
    shear = load.shear if load.shears_tip else 0.0
    depth_over_D, shear_over_D = np.array([[[load.depth]], [[shear]]]) / design.D
    return str(beams.refusals(depth_over_D, shear_over_D, np.array([design.D]))[0, 0])


def refusal_of_kind(design: Design, load: Load, magnet: Magnet) -> str:
    """Return why the surrogate refuses a kind of sensor or load; "" if it takes it."""
    reasons = {
        f"the surrogate knows the law neo-hookean only; got {design.law}": design.law != "neo-hookean",
        "the surrogate knows beams with a rigid magnet only": not design.shape.has_magnet or magnet == "ignored",
        "the surrogate does not know Coulomb friction": load.coulomb is not None,
    } | {
        f"the surrogate does not know {each}": True for each in load.beyond("depth", "shear_x", "shear_y", "friction")
    }
    return next((text for text, refused in reasons.items() if refused), "")
