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
- Curve: presses to the depth to which they are known to stay stable, with the formulas beside them.
- Field lines: of the exact field in the plane of the section.
- Stability: the critical depth of a frictionless press, and the first mode at rest.

Slopes along d and s are differences over 2 `STEP`, cut at the ends of the range; for s near 0 by symmetry: u, t and
F_t are odd, w and F_n even. Units mm, N, MPa, T, V, rad; tilts leave in degrees.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic import beam, force_resolution, hall, parts
from analytic.batch_readings import batch_readings
from analytic.force_resolution import Loaded
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Response, check_load, rotation_of
from studies.exploration.solved_paths import frequency_unit
from studies.explorer import state_answers
from studies.explorer.explorer_state import ExplorerState
from studies.surrogate import surrogate_range, surrogate_response
from studies.surrogate.prediction import Beams

LEVEL = "surrogate"
"""Level of the answers, as the page shows it."""
STEP = 4e-3
"""Half of the distance over which responses and readings are differenced, over D and in rad."""
SINGULAR = 1e-4
"""Determinant of the slopes of the readings, with columns of length 1, below which no load is decoded."""
CURVE_POINTS = 25
"""Depths of a curve."""
LINE_STARTS = (-0.95, -0.8, -0.6, -0.35, -0.12, 0.12, 0.35, 0.6, 0.8, 0.95)
"""Where field lines begin on the magnet's upper face, over its radius."""
LINE_STEP, LINE_BOX, LINE_STEPS, LINE_CLEAR = 0.04, 2.5, 200, 0.01
"""Length of a step and largest distance from the magnet, over D, most steps, and distance of the first point above
the face over half the magnet's height."""
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
    response = Response(
        (c * tangential, s * tangential, normal), (c * u, s * u, w), c * t, plane.contact_radius[0], s * t
    )
    return response, plane


def state_part(state: ExplorerState) -> Part:
    """Return the part `state` of an answer, without its section."""
    design, load = state.design, state.load
    response, plane = solve(state)
    slopes = field_slopes(design, plane)
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
        "readings": readings_part(design, response, plane, slopes),
        "decoded": decoded_part(design, load, response, plane, slopes),
        "formula": formula_part(design, load, "paper"),
        "formula_level": {"level": state.formula_level, **formula_part(design, load, state.formula_level)},
    }


def formula_part(design: Design, load: Load, level: str) -> Part:
    """Return what a level of the formulas says, tilts in degrees, with a message where it is not calibrated."""
    try:
        response = beam.solve(design, load, level)
    except BadInput as error:
        return {"force": None, "shift": None, "message": str(error)}
    return state_answers.response_data(response) | {"message": beam.outside(design, load, level)}


def readings_part(design: Design, response: Response, plane: Plane, slopes: Array) -> Part:
    """Return the readings in the state and at rest, with half widths and noise; `slopes` as of `field_slopes`."""
    elements = parts.of_design(design)
    pose, rest = hall.readings(design, response), hall.readings(design)
    widths = np.abs(slopes) @ plane.half_width[:3]
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


def decoded_part(design: Design, load: Load, response: Response, plane: Plane, slopes: Array) -> Part:
    """Return the load that the readings decode to, with half widths and noise; None and a status without one."""
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
    carried = np.abs(through @ slopes) @ plane.half_width[:3]
    noise = np.array([element.noise_T for element in elements])
    return {
        "status": "ok",
        "level": LEVEL,
        "force": (np.array(response.force) + through @ off).tolist(),
        "half_width": (own + carried).tolist(),
        "noise": force_resolution.force_resolution(J[None], K[None], noise)[0].tolist(),
    }


def curve_part(state: ExplorerState) -> Part:
    """Return force and shift over the depth of frictionless presses, with the formulas beside them."""
    design = state.design
    beams = _beams(design)
    deepest = float(beams.stable_to()[0])
    low, high = surrogate_range.SHALLOWEST * design.D, deepest * design.D
    depth = np.linspace(low, high, CURVE_POINTS)
    press = beams.press(np.minimum(depth / design.D, deepest)[None])
    unit = design.E * design.D**2
    return {
        "depth": depth.tolist(),
        "force": (unit * press["force"].value[0]).tolist(),
        "shift": (-design.D * press["shift"].value[0]).tolist(),
        "estimates": {
            "force": (unit * press["force"].half_width[0]).tolist(),
            "shift": (design.D * press["shift"].half_width[0]).tolist(),
        },
        "paper": _formula_curve(design, depth, "paper"),
        "level": {"name": state.formula_level, **_formula_curve(design, depth, state.formula_level)},
    }


def _formula_curve(design: Design, depth: Array, level: str) -> Part:
    """Return normal force and shift along z by a level of the formulas; None where it refuses a depth."""
    answers = [formula_part(design, Load(depth=each), level) for each in depth.tolist()]
    return {
        name: [None if answer[name] is None else answer[name][2] for answer in answers] for name in ("force", "shift")
    }


def field_lines_part(state: ExplorerState) -> Part:
    """Return field lines of the magnet in the plane of the section, [x, z], mm.

    Lines begin on the face of the magnet towards the tip and follow B, or -B if the north pole points down, by
    Runge-Kutta steps of order 4 and length `LINE_STEP`, to the magnet or to `LINE_BOX` from its centre.
    """
    design = state.design
    plane = solve(state)[1]
    u, w, t = plane.value[:3].tolist()
    # the section is drawn along the direction with x > 0, or along y
    way = 1.0 if not plane.shear or (state.load.shear_x or state.load.shear_y) > 0 else -1.0
    u, t = way * u, way * t
    a, b, centre = design.magnet_diameter / 2, design.magnet_height / 2, np.array([u, design.H + w])
    along, across = np.array([math.sin(t), math.cos(t)]), np.array([math.cos(t), -math.sin(t)])
    starts = np.array(LINE_STARTS)[:, None] * a * across + (1 + LINE_CLEAR) * b * along + centre
    sign = -1.0 if design.polarisation > 0 else 1.0

    def direction(points: Array) -> Array:
        where = np.stack([points[:, 0], np.zeros(len(points)), points[:, 1]], axis=1)
        B = hall.field_at(where, design, (u, 0.0, w), rotation_of(t, 0.0))[:, [0, 2]]
        return np.asarray(sign * B / np.linalg.norm(B, axis=1)[:, None])

    lines = [[start] for start in starts]
    active, h = np.arange(len(lines)), LINE_STEP * design.D
    for _ in range(LINE_STEPS):
        x = np.array([lines[k][-1] for k in active])
        k1 = direction(x)
        k2 = direction(x + h / 2 * k1)
        k3 = direction(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + direction(x + h * k3))
        off = x - centre
        outside = ~((np.abs(off @ across) < a) & (np.abs(off @ along) < b))
        for k, point in zip(active[outside], x[outside], strict=True):
            lines[k].append(point)
        active = active[outside & (np.linalg.norm(off, axis=1) < LINE_BOX * design.D)]
        if not len(active):
            break
    return {"lines": [np.array(line).tolist() for line in lines]}


def stability_part(state: ExplorerState) -> Part:
    """Return critical depth, mm, and first mode, Hz, with half widths; None without a value in the range.

    `stable_to` is the depth to which a press is known to stay stable, mm.
    """
    design, beams = state.design, _beams(state.design)
    critical, mode = beams.critical_depth(), beams.first_mode(np.array([design.magnet_density / design.density]))
    unit = frequency_unit(design.D, design.E, design.density)
    return {
        "critical_depth": _finite(design.D * critical.value[0]),
        "estimate": _finite(design.D * critical.half_width[0]),
        "stable_to": design.D * float(beams.stable_to()[0]),
        "first_mode_hz": _finite(unit * mode.value[0]),
        "first_mode_estimate_hz": _finite(unit * mode.half_width[0]),
    }


@functools.lru_cache(maxsize=2)
def _beams(design: Design) -> Beams:
    """Return the beam of a design, which keeps its response to presses; kept for the parts of one answer."""
    return surrogate_response.beams_of([design])


def _plane_of(design: Design, load: Load) -> Plane:
    """Return the response in the plane of the shear to a load that the surrogate takes."""
    beams, D, unit = _beams(design), design.D, design.E * design.D**2
    depth = np.array([[load.depth / D]])
    scale = np.array([D, -D, 1.0, unit, unit])
    if load.shears_tip:
        q = beams.shear(depth, np.array([[load.shear / D]]))
        values, widths = (
            np.array([getattr(q[name], kind).item() for name in PLANE]) for kind in ("value", "half_width")
        )
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

    # the ends of the range cut a difference on one side
    most, farthest = float(beams.stable_to()[0]), float(beams.farthest[0])
    d, s = min(load.depth / D, most), min(plane.shear / D, farthest)
    low, high = max(d - STEP, surrogate_range.SHALLOWEST_SHEAR), min(d + STEP, most)
    near, far = s - STEP, min(s + STEP, farthest)
    q = beams.shear(np.array([[high, low, d, d, d]]), np.abs([[s, s, far, near, 0.0]]))
    values = scale * np.stack([q[name].value[0] for name in PLANE], axis=1)
    if near < 0:
        values[3] *= ODD
    depth_slopes = (values[0] - values[1]) / ((high - low) * D)
    shear_slopes = (values[2] - values[3]) / ((far - near) * D)
    value = plane.value if plane.shear else values[4]
    rows = (value[None], depth_slopes[None], shear_slopes[None])
    return force_resolution.turned(*rows, np.array([plane.shear]), np.array([plane.azimuth]))


def field_slopes(design: Design, plane: Plane) -> Array:
    """Return the slopes of B.n along u, w and t, shape (3, 3), T/mm and T/rad."""
    c, s = math.cos(plane.azimuth), math.sin(plane.azimuth)
    steps = STEP * np.array([design.D, design.D, 1.0])
    u, w, t = (plane.value[:3] + np.concatenate([np.diag(steps), -np.diag(steps)])).T
    shift, tilt = np.stack([c * u, s * u, w], axis=1), np.stack(rotation_of(c * t, s * t), axis=1)
    field = batch_readings([design], np.zeros(6, dtype=np.int64), shift, tilt).field_T
    return np.asarray(((field[:3] - field[3:]) / (2 * steps)[:, None]).T)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
