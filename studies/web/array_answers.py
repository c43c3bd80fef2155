"""The part `array` of a page: the forces on the beams of an array, and what decoders find in the readings of all.

The loads are those that the page sets, presses and shears that stick to the tip. Shift, tilt and force of each beam
follow from the mechanics of the decoder, which therefore have no part in its errors: the surrogate's, or those of the
formulas where it does not know the design. Readings are those of all magnets (`analytic.beam_arrays`); they are
decoded as in `studies.sensing.crosstalk`, jointly, and each beam for itself after taring at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from analytic import beam_arrays, parts
from analytic.beam_arrays import BeamArray
from analytic.decode import Decoder, decoder, state
from analytic.inverse import response_surface
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.quantities import shown
from studies.sensing import crosstalk, decode_readings
from studies.sensing.array_readings import Grid
from studies.simulation import mechanics_sources
from studies.web.explorer_state import ExplorerState, Request
from studies.web.panels import Memory
from studies.web.state_answers import AXES, DECODER_LEVEL, number
from studies.web.time_answers import refusal

Data = dict[str, Any]
SHOWN = {"jointly": "decoded jointly", "ignoring": "neighbours ignored"}
"""Decoders of `crosstalk` that the page shows."""
ROUNDING = 1e-9
"""Error that is said to be none, N: joint decoding ends some digits before."""


class Sensor(NamedTuple):
    """An array with the decoder of its beams, and which mechanics these have, in a sentence."""

    array: ArrayDesign
    coder: Decoder
    beams: BeamArray
    words: str


def array_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, Data]]:
    """Yield forces, readings and decoded forces of the beams."""
    if request.stated is None:
        return
    try:
        yield level, _answer(request.state, request.stated, memory)
    except BadInput as error:
        yield level, refusal(str(error))


def _answer(asked: ExplorerState, stated: Grid, memory: Memory) -> Data:
    grid, design = asked.array.grid(stated), asked.design
    if not design.shape.has_magnet or asked.magnet != "rigid":
        raise BadInput("the beams of an array have rigid magnets: a sensor without one reads nothing")
    coder, words = memory.results.get(("beam decoder", design), partial(coder_of, design))
    array = grid.design(design)
    beams = memory.results.get(("array", design, grid), partial(beam_arrays.standing, coder.forward, array))
    sensor = Sensor(array, coder, beams, words)
    shift, tilt, force = poses_of(sensor, loads_of(asked, len(array)))
    whole, own = beam_arrays.readings_in_poses(array, shift, tilt)
    found = crosstalk.forces_of_decoders(coder, beams, whole[None])
    decoded = {name: found[name][0] for name in SHOWN}
    errors = {name: np.linalg.norm(each - force, axis=1) for name, each in decoded.items()}
    k = asked.array.beam - 1
    tables = {
        "array_forces": _forces(k, force, decoded),
        "array_readings": _readings(design, whole[k], own[k]),
        "array_errors": _errors(force, errors),
    }
    tables["array_forces"]["message"] = _message(sensor, errors)
    picture = {
        "places": array.places.tolist(),
        "poles": array.poles.tolist(),
        "diameter": design.D,
        "forces": {"set": force.tolist()} | {name: each.tolist() for name, each in decoded.items()},
    }
    return {"picture": picture, "tables": tables}


def coder_of(design: Design) -> tuple[Decoder, str]:
    """Return the decoder of a beam with the best mechanics that need no finite elements, and which these are."""
    try:
        source = mechanics_sources.of_surrogate(design)
    except BadInput as error:
        law = decode_readings.of_level(design, DECODER_LEVEL)
        return decoder(design, law), f"Mechanics: formulas of level {DECODER_LEVEL} ({error})."
    return decoder(design, source.law), f"Mechanics: {mechanics_sources.in_words(source)}."


def loads_of(asked: ExplorerState, count: int) -> Array:
    """Return depth and shears of the plates on all beams, (n, 3), mm, that of the state among them."""
    load, loads = asked.load, np.zeros((count, 3))
    if load.plate_tilt or load.coulomb is not None:
        raise BadInput(
            "the loads of an array are upright presses, and shears that stick: set the plate tilt to 0, and friction "
            "to stick or none"
        )
    named = {**asked.array.loads, asked.array.beam: (load.depth, load.shear_x, load.shear_y)}
    for k, each in named.items():
        if not 1 <= k <= count:
            raise BadInput(f"there is no beam {k}: the array has {count} beams")
        loads[k - 1] = each
    if asked.friction == "none":
        loads[:, 1:] = 0.0
    return loads


def poses_of(sensor: Sensor, loads: Array) -> tuple[Array, Array, Array]:
    """Return shifts (n, 3), mm, rotation vectors (n, 2), rad, and forces (n, 3), N, under loads (n, 3), mm."""
    coder, law = sensor.coder, sensor.coder.mechanics
    assert law is not None
    aside = np.hypot(loads[:, 1], loads[:, 2])
    u, w = response_surface.shifts_of_loads(law, coder.low, coder.high, loads[:, 0], aside)
    way = loads[:, 1:] / np.where(aside > 0, aside, 1.0)[:, None]
    shift = np.column_stack([u[:, None] * way, w])
    tilt, force, _, _ = state(coder, np.ascontiguousarray(shift.T))
    if len(lost := np.flatnonzero(~np.isfinite(force).all(axis=0))):
        k = lost[0]
        raise BadInput(
            f"beam {k + 1}: a press of {loads[k, 0]:.3g} mm with a shear of {aside[k]:.3g} mm is beyond the "
            f"mechanics of an array, in which the magnet sinks by up to {law.sink:.3g} mm: give less"
        )
    return shift, tilt.T, force.T


def _forces(k: int, force: Array, decoded: dict[str, Array]) -> Data:
    rows = [
        number(AXES[axis], "N", force[k, axis], beside=[each[k, axis] for each in decoded.values()])
        for axis in (2, 0, 1)
    ]
    return {"columns": [f"beam {k + 1}, as set", *SHOWN.values()], "rows": rows}


def _readings(design: Design, whole: Array, own: Array) -> Data:
    elements = parts.of_design(design)
    volts = elements[0].unit == "V"
    rows = []
    for element, total, alone in zip(elements, whole.tolist(), own.tolist(), strict=True):
        gain, null = (element.gain, element.null) if volts else (1e3, 0.0)
        rows.append(number(element.name, "V" if volts else "mT", null + gain * total, beside=gain * (total - alone)))
    return {"columns": ["reading", "of it by neighbours"], "rows": rows, "message": ""}


def _errors(force: Array, errors: dict[str, Array]) -> Data:
    size = np.linalg.norm(force, axis=1)
    rows = [
        number(f"beam {k + 1}", "N", size[k], beside=[each[k] for each in errors.values()]) for k in range(len(force))
    ]
    return {"columns": ["force", *(f"error, {words}" for words in SHOWN.values())], "rows": rows, "message": ""}


def _message(sensor: Sensor, errors: dict[str, Array]) -> str:
    """Return the largest errors of the force, and what they rest on."""
    said = []
    for name, words in SHOWN.items():
        known, lost = np.nan_to_num(errors[name], nan=-1.0), int(np.isnan(errors[name]).sum())
        worst = int(known.argmax())
        size = shown(float(known[worst]), "N", 2)
        text = f"{size} (beam {worst + 1})" if known[worst] > ROUNDING else "below 1e-9 N"
        texts = [text] * (lost < len(known)) + [f"no force of {lost} beam{'s' * (lost > 1)}"] * bool(lost)
        said.append(f"{words} {' and '.join(texts)}")
    pitch = f"{len(sensor.array)} beams, the nearest {sensor.array.pitch:.4g} mm apart."
    rules = "Both decoders are tared at rest, and take a magnet that seems to rise for one without a load."
    return f"Largest error of the force: {'; '.join(said)}. {pitch} {sensor.words} {rules}"
