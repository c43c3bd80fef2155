"""What the page without a server computes for a state: the definition that its JavaScript is tested against.

The response is that of the surrogate (`studies.surrogate`), with half widths of 90 % intervals. In the plane of the
shear it depends on the depth d and the shear s only:

    p(d, s) = (u, w, t) shift along the shear and along z, and tilt;    F(d, s) = (F_t, F_n).

- Readings: those of the pose. The half width of a reading is the sum of its slopes along u, w and t, times the half
  widths of these; 0 at a rail.
- Decoded load: steps of the converter change the reading B by dB. With q = (depth, shear x, shear y), J = dB/dq and
  K = dF/dq, the decoded force is F + K J^-1 dB. Its half width is the sum of that of F and of those of u, w and t
  through K J^-1; its noise is `analytic.force_resolution`. There is none where a reading is at a rail, below the
  least depth of a shear, or where J is singular. The decoder has the surrogate's mechanics.
- Curve: presses over the whole range of depths, with the formulas beside them.
- Stability: the critical depth of a frictionless press, and the first mode at rest.

Slopes along d and s are differences over 2 `STEP`, cut at the ends of the range; for s near 0 by symmetry: u, t and
F_t are odd, w and F_n even. Units mm, N, MPa, T, V, rad; tilts leave in degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic import beam, force_resolution, hall, parts
from analytic.force_resolution import Loaded
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Response, check_load, rotation_of
from studies.explorer.explorer_state import ExplorerState
from studies.exploration.solved_paths import frequency_unit
from studies.surrogate import surrogate_range, surrogate_response
from studies.surrogate.prediction import Beams

LEVEL = "surrogate"
"""Level of the answers, as the page shows it."""
STEP = 1e-3
"""Half of the distance over which responses and readings are differenced, over D and in rad."""
SINGULAR = 1e-5
"""Determinant of the slopes of the readings, with columns of length 1, below which no load is decoded."""
CURVE_POINTS = 41
"""Depths of a curve."""
PLANE = ("shift_x", "shift_z", "tilt", "force_x", "force_z")
"""Quantities in the plane of the shear."""
ODD = np.array([-1.0, 1.0, -1.0, -1.0, 1.0])
"""Their signs for a shear to the other side."""

Part = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Plane:
    """The response in the plane of the shear, in the order of `PLANE`, with half widths; mm, mm, rad, N, N.

    Attributes
    ----------
    value, half_width : shape (5,).
    azimuth : direction of the shear from x towards y, rad; 0 without one.
    shear : mm; 0 for a press.
    """

    value: Array
    half_width: Array
    azimuth: float
    shear: float
    contact_radius: tuple[float, float]
    strain: tuple[float, float]


def solve(state: ExplorerState) -> tuple[Response, Plane]:
    """Return the response of the surrogate to the load of a state, and the same in the plane of the shear.

    Raises
    ------
    BadInput
        The surrogate refuses the state, with the sentence of `surrogate_response.respond`.
    """
    design, load = state.design, state.load
    check_load(design, load, state.magnet)
    reason = surrogate_response.refusal(design, load, state.magnet)
    if reason:
        raise BadInput(f"{reason}: take finite elements")
    plane = _plane_of(design, load)
    u, w, t, tangential, normal = plane.value.tolist()
    c, s = (load.shear_x / load.shear, load.shear_y / load.shear) if load.shears_tip else (1.0, 0.0)
    response = Response((c * tangential, s * tangential, normal), (c * u, s * u, w), c * t, plane.contact_radius[0], s * t)
    return response, plane


def state_part(state: ExplorerState) -> Part:
    """Return the part `state` of an answer, without its section."""
    design, load = state.design, state.load
    response, plane = solve(state)
    u, w, t, tangential, normal = plane.half_width.tolist()
    c, s = abs(math.cos(plane.azimuth)), abs(math.sin(plane.azimuth))
    return {
        "status": "ok",
        "message": "",
        "model": LEVEL,
        "load": {"depth": load.depth, "shear": list(load.imposed_shear)},
        "response": {
            "force": list(response.force),
            "shift": list(response.shift),
            "tilt": math.degrees(response.tilt),
            "tilt_y": math.degrees(response.tilt_y),
            "contact_radius": response.contact_radius,
        },
        "estimates": {
            "force": [c * tangential, s * tangential, normal],
            "shift": [c * u, s * u, w],
            "tilt": math.degrees(t),
            "contact_radius": plane.contact_radius[1],
            "strain": plane.strain[1],
        },
        "strain": plane.strain[0],
        "readings": readings_part(design, response, plane),
        "decoded": decoded_part(design, load, response, plane),
        "formula": formula_part(design, load, "paper"),
        "formula_level": {"level": state.formula_level, **formula_part(design, load, state.formula_level)},
    }


def formula_part(design: Design, load: Load, level: str) -> Part:
    """Return force, shift and tilt by a level of the formulas, with a message where it is not calibrated for a load."""
    try:
        response = beam.solve(design, load, level)
    except BadInput as error:
        return {"force": None, "shift": None, "message": str(error)}
    answer = {"force": list(response.force), "shift": list(response.shift), "tilt": math.degrees(response.tilt)}
    return answer | {"message": beam.outside(design, load, level)}


def readings_part(design: Design, response: Response, plane: Plane) -> Part:
    """Return the readings in the state and at rest, with half widths and noise."""
    elements = parts.of_design(design)
    pose, rest = hall.readings(design, response), hall.readings(design)
    widths = np.abs(_field_slopes(design, plane)) @ plane.half_width[:3]
    return {
        "elements": [element.name for element in elements],
        "units": list(pose.units),
        "volts": list(pose.output),
        "rest": list(rest.output),
        "half_width": [
            0.0 if saturated else element.gain * float(width)
            for element, width, saturated in zip(elements, widths, pose.saturated, strict=True)
        ],
        "noise": [element.noise_T * element.gain for element in elements],
        "saturated": list(pose.saturated),
        "low": [element.low for element in elements],
        "high": [element.high for element in elements],
    }


def decoded_part(design: Design, load: Load, response: Response, plane: Plane) -> Part:
    """Return the load that the readings decode to, with half widths and noise; a status and None where there is none."""
    elements, _ = parts.with_noise(parts.of_design(design))
    pose = hall.readings(design, response, elements=elements)
    none = {"level": LEVEL, "force": None, "half_width": None, "noise": None}
    if any(pose.saturated):
        return {"status": "saturated"} | none
    if load.depth < surrogate_range.SHALLOWEST_SHEAR * design.D:
        return {"status": "out_of_workspace"} | none
    loaded = _loaded(design, load, plane)
    J = force_resolution.reading_slopes([design], np.zeros(1, dtype=np.int64), loaded)[0]
    K = loaded.force_slopes[0]
    if not abs(np.linalg.det(J / np.linalg.norm(J, axis=0))) > SINGULAR:
        return {"status": "ambiguous"} | none
    gain, null = (np.array([getattr(element, name) for element in elements]) for name in ("gain", "null"))
    off = (np.array(pose.output) - null) / gain - np.array(pose.B_T)
    through = K @ np.linalg.inv(J)
    c, s = abs(math.cos(plane.azimuth)), abs(math.sin(plane.azimuth))
    own = plane.half_width[3] * np.array([c, s, 0.0]) + plane.half_width[4] * np.array([0.0, 0.0, 1.0])
    carried = np.abs(through @ _field_slopes(design, plane)) @ plane.half_width[:3]
    noise = np.array([element.noise_T for element in elements])
    return {
        "status": "ok",
        "level": LEVEL,
        "force": (np.array(response.force) + through @ off).tolist(),
        "half_width": (own + carried).tolist(),
        "noise": force_resolution.force_resolution(J[None], K[None], noise)[0].tolist(),
    }


def curve_part(state: ExplorerState) -> Part:
    """Return force and sinking of the magnet over the depth of frictionless presses, with the formulas beside them."""
    design = state.design
    beams = _beams(design)
    low, high = surrogate_range.SHALLOWEST * design.D, float(beams.deepest[0]) * design.D
    depth = np.linspace(low, high, CURVE_POINTS)
    press = beams.press(np.minimum(depth / design.D, beams.deepest[0])[None])
    unit = design.E * design.D**2
    part: Part = {
        "depth": depth.tolist(),
        "force": (unit * press["force"].value[0]).tolist(),
        "force_half_width": (unit * press["force"].half_width[0]).tolist(),
        "shift": (-design.D * press["shift"].value[0]).tolist(),
        "shift_half_width": (design.D * press["shift"].half_width[0]).tolist(),
    }
    for level in dict.fromkeys(("paper", state.formula_level)):
        answers = [formula_part(design, Load(depth=each), level) for each in depth.tolist()]
        part[level] = {
            name: [None if answer[name] is None else answer[name][2] for answer in answers]
            for name in ("force", "shift")
        }
    return part


def stability_part(state: ExplorerState) -> Part:
    """Return critical depth, mm, and first mode, Hz, with half widths; None without a value in the range."""
    design, beams = state.design, _beams(state.design)
    critical, mode = beams.critical_depth(), beams.first_mode(np.array([design.magnet_density / design.density]))
    unit = frequency_unit(design.D, design.E, design.density)
    return {
        "critical_depth": _finite(design.D * critical.value[0]),
        "estimate": _finite(design.D * critical.half_width[0]),
        "first_mode_hz": _finite(unit * mode.value[0]),
        "first_mode_estimate": _finite(unit * mode.half_width[0]),
    }


def _beams(design: Design) -> Beams:
    return surrogate_response.beams_of([design])


def _plane_of(design: Design, load: Load) -> Plane:
    """Return the response in the plane of the shear to a load that the surrogate takes."""
    beams, D, unit = _beams(design), design.D, design.E * design.D**2
    depth = np.array([[load.depth / D]])
    scale = np.array([D, -D, 1.0, unit, unit])
    if load.shears_tip:
        q = beams.shear(depth, np.array([[load.shear / D]]))
        values, widths = (np.array([getattr(q[name], kind).item() for name in PLANE]) for kind in ("value", "half_width"))
    else:
        q = beams.press(depth)
        values, widths = (
            np.array([0.0, getattr(q["shift"], kind).item(), 0.0, 0.0, getattr(q["force"], kind).item()])
            for kind in ("value", "half_width")
        )
    contact, strain = q["contact_radius"], q["strain"]
    return Plane(
        value=scale * values,
        half_width=np.abs(scale) * widths,
        azimuth=math.atan2(load.shear_y, load.shear_x) if load.shears_tip else 0.0,
        shear=load.shear if load.shears_tip else 0.0,
        contact_radius=(D * contact.value.item(), D * contact.half_width.item()),
        strain=(strain.value.item(), strain.half_width.item()),
    )


def _loaded(design: Design, load: Load, plane: Plane) -> Loaded:
    """Return pose and force with their slopes along depth, shear x and shear y."""
    beams, D = _beams(design), design.D
    scale = np.array([D, -D, 1.0, design.E * D**2, design.E * D**2])

    def at(depth: float, shear: float) -> Array:
        q = beams.shear(np.array([[depth]]), np.array([[abs(shear)]]))
        values = np.array([q[name].value.item() for name in PLANE])
        return scale * values * (ODD if shear < 0 else 1.0)

    # the ends of the range cut a difference on one side
    d, s = min(load.depth / D, float(beams.deepest[0])), min(plane.shear / D, float(beams.farthest[0]))
    low, high = max(d - STEP, surrogate_range.SHALLOWEST_SHEAR), min(d + STEP, float(beams.deepest[0]))
    near, far = s - STEP, min(s + STEP, float(beams.farthest[0]))
    depth_slopes = (at(high, s) - at(low, s)) / ((high - low) * D)
    shear_slopes = (at(d, far) - at(d, near)) / ((far - near) * D)
    value = plane.value if plane.shear else at(d, 0.0)
    rows = (value[None], depth_slopes[None], shear_slopes[None])
    return force_resolution.turned(*rows, np.array([plane.shear]), np.array([plane.azimuth]))


def _field_slopes(design: Design, plane: Plane) -> Array:
    """Return the slopes of B.n along u, w and t, shape (3, 3), T/mm and T/rad."""
    c, s = math.cos(plane.azimuth), math.sin(plane.azimuth)
    columns = []
    for k, step in enumerate((STEP * design.D, STEP * design.D, STEP)):
        ends = []
        for sign in (1.0, -1.0):
            u, w, t = plane.value[:3] + sign * step * np.eye(3)[k]
            pose = hall.readings(design, shift=(c * u, s * u, w), tilt=rotation_of(c * t, s * t))
            ends.append(np.array(pose.B_T))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
