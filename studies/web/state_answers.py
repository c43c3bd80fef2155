"""The parts `state`, `curve` and `stability` of a page: numbers of one state, and what depends on the design alone.

A table has `columns` (names of the values and of what stands beside them, "" for nothing), `rows` (see `number`) and
a `message`. A figure has its `chart` in `page/charts.json`, the `title` of its values and its `rows`. What depends on
the level of the formulas stands by the names of all levels: the page shows the chosen one.

A state has its response, error estimates, readings, decoded load and formulas. The press of a curve has no friction,
whatever the friction of the shear. The stability comes first from the surrogate and then from finite elements.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam, hall
from analytic.inverse.forward_model import slopes_at
from analytic.parts import of_design
from fem.accuracy import LEVELS
from fem.equilibrium import walk
from fem.scene import Scene
from fem.solution import Solution
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import OF_READINGS, OF_TIME, BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet, Response
from studies import quantities
from studies.beam import surrogate_range, surrogate_response
from studies.mechanics import path_solver
from studies.mechanics.path_solver import frequency_unit
from studies.mechanics.store import Store
from studies.mechanics.stored_answers import asked, walked
from studies.output.records import FlatRow
from studies.simulation import state_rows
from studies.simulation.compare import default_loads
from studies.web.explorer_state import ExplorerState, Request
from studies.web.panels import Memory

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from studies.calibration.sensor_fit import Fit

DECODER_LEVEL = "finite"
"""Level of the formulas that give the load of a decoded pose."""

CALIBRATED = "Force, readings and decoded load are those of the calibrated sensor, with 90 % intervals."
NOT_CALIBRATED = "This is not the design that was calibrated: all numbers are those of the design."

Data = dict[str, Any]
PENDING = "± …"
"""In place of a half width that follows."""
AXES = ("force along x", "force along y", "normal force")
ROOM = 1.05
"""End of the axis of the readings over the rail."""


def number(name: str, unit: str, value: float | None, half_width: Any = None, beside: Any = None) -> Data:
    """Return a row: a value, None where it is unknown, its half width or a text, and what stands beside them."""
    return {"name": name, "unit": unit, "value": value, "half_width": half_width, "beside": beside}


def numbers(
    state: ExplorerState, solution: Solution, decoder: Decoder | None, made: Fit | None = None, calibration: str = ""
) -> Data:
    """Return the data of the part `state` without its section; without a decoder, `decoded` is None.

    Parameters
    ----------
    made : calibrated sensor of this design, whose force, readings and decoded load these are.
    calibration : what the page says of the calibration with which it was started.
    """
    widths, design = half_widths(solution), state.design
    data = {
        "calibration": calibration,
        "status": solution.status,
        "message": solution.message,
        "load": {"depth": solution.load.depth, "shear": list(solution.load.imposed_shear)},
        "response": response_data(solution.response),
        "estimates": widths,
        "seconds": solution.seconds,
        "readings": readings(design, solution.response, widths),
        "decoded": None if decoder is None else decoded(decoder, solution.response, widths),
        "formulas": {level: formula(design, state.load, level) for level in beam.LEVELS},
    }
    if made is not None:
        felt, own = response_of_made_sensor(solution.response, design, made)
        data, solution = data | _of_made_sensor(data, made, felt, own), replace(solution, response=felt)
    row = state_rows.solved_row(design, state.magnet, solution)
    tables = {
        "response": _response_table(data, row),
        "readings": _readings_table(data),
        "decoded": _decoded_table(data),
    }
    return data | {"tables": tables, "figures": {"readings": _readings_figure(data)}}


def response_of_made_sensor(response: Response, design: Design, made: Fit) -> tuple[Response, Data]:
    """Return a response of a design with the force of its calibrated sensor, and half widths and readings of this.

    The keys are those of the export: output, half_width (of the readings), rest, saturated, force_half_width_N.
    """
    from studies.calibration import calibration_file

    pose = (np.array([each, np.zeros(len(each))]) for each in (response.shift, response.rotation, response.force))
    shift, tilt, load = pose
    raw, half, force, force_half = made.answers(design.E_now, shift, tilt, load)
    output, saturated = calibration_file.outputs_of(made, raw)
    x, y, z = force[0].tolist()
    return replace(response, force=(x, y, z)), {
        "output": output[0].tolist(),
        "output_half_width": half[0].tolist(),
        "output_at_rest": output[1].tolist(),
        "saturated": saturated[0].tolist(),
        "force_half_width_N": force_half[0].tolist(),
    }


def _of_made_sensor(data: Data, made: Fit, felt: Response, own: Data) -> Data:
    """Return what a calibrated sensor changes in the part `state`."""
    from studies.calibration import calibration_file

    def wider(half: list[float] | None, name: str) -> list[float] | None:
        return None if half is None else np.hypot(half, own[name]).tolist()

    (row,) = calibration_file.decoded_rows(made, np.array([own["output"]]), None, np.zeros(1))
    force, half = ([row[f"{name}_{axis}_N"] for axis in "xyz"] for name in ("force", "half_width"))
    known, readings = row["status"] == "ok", data["readings"]
    return {
        "calibration": CALIBRATED,
        "response": response_data(felt),
        "estimates": data["estimates"] | {"force": wider(data["estimates"]["force"], "force_half_width_N")},
        "readings": readings
        | {
            "volts": own["output"],
            "rest": own["output_at_rest"],
            "half_width": wider(readings.get("half_width"), "output_half_width"),
            "saturated": own["saturated"],
        },
        "decoded": {
            "status": row["status"],
            "level": "calibration",
            "force": force if known else None,
            "half_width": half if known else None,
            "noise": None,
        },
    }


def response_data(response: Response) -> Data:
    """Return a response with its tilts in degrees."""
    return {
        "force": list(response.force),
        "shift": list(response.shift),
        "tilt": math.degrees(response.tilt),
        "tilt_y": math.degrees(response.tilt_y),
        "contact_radius": response.contact_radius,
    }


def quantity_rows(state: FlatRow, *, pending: bool) -> list[Data]:
    """Return the rows of what is stored of a state beside its response, and of what is derived, with half widths."""
    rows = []
    for part in quantities.state_parts():
        value = state[part.column]
        half: Any = state.get(f"{part.column}_half_width", _times(state.get(part.estimate_column), value))
        if pending and value is not None and (part.estimate or part.half_width):
            half = PENDING
        rows.append(number(part.name.replace("_", " "), quantities.UNITS[part.unit], value, half))
    return rows


def half_widths(solution: Solution) -> Data:
    """Return the half widths that the error estimates give the response: None where there is no estimate.

    The estimates of force and shift are relative to the length of the vector, so every component along the load has
    the same half width; the force along the shear has its own. A free sensor has no error.
    """
    if not solution.load.depth:
        return {"force": [0.0] * 3, "shift": [0.0] * 3, "tilt": 0.0, "contact_radius": None}
    estimates, response = solution.estimates, solution.response
    c, s = solution.load.direction
    aside = solution.load.shears_tip or bool(solution.load.plate_tilt)
    plane = (abs(c), abs(s)) if aside else (0.0, 0.0)
    force = _times(estimates.force, math.hypot(*response.force))
    sideways = _times(estimates.sideways, math.hypot(*response.force[:2]))
    sideways = force if sideways is None else sideways
    shift = _times(estimates.shift, math.hypot(*response.shift))
    tilt = _times(estimates.tilt, math.degrees(math.hypot(response.tilt, response.tilt_y)))
    return {
        "force": None if force is None or sideways is None else [sideways * plane[0], sideways * plane[1], force],
        "shift": None if shift is None else [shift * plane[0], shift * plane[1], shift],
        "tilt": tilt,
        "contact_radius": _times(estimates.contact_radius, response.contact_radius),
    }


def _times(share: float | None, value: float | None) -> float | None:
    return None if share is None or value is None else share * abs(value)


def readings(design: Design, response: Response, widths: Data) -> Data | None:
    """Return the readings of the Hall elements, at rest too, with half widths; None without a magnet.

    A half width is the sum of the slopes of a reading along shift and tilt, times the half widths of these.
    """
    if not design.shape.has_magnet:
        return None
    elements = of_design(design)
    try:
        now, rest = hall.readings(design, response), hall.readings(design)
    except BadInput as error:
        return {"message": str(error)}
    spread = None
    if widths["shift"] is not None and (widths["tilt"] is not None or not any(response.rotation)):
        spread = np.abs(reading_slopes(design, response)) @ pose_half_widths(response, widths)
    return {
        "elements": [element.name for element in elements],
        "units": list(now.units),
        "volts": list(now.output),
        "rest": list(rest.output),
        "half_width": None if spread is None else spread.tolist(),
        "saturated": list(now.saturated),
        "high": [element.high for element in elements],
    }


def pose_half_widths(response: Response, widths: Data) -> Array:
    """Return the half widths of the shift, mm, and of the rotation about x and y, rad, shape (5,)."""
    size = math.hypot(*response.rotation)
    tilt = math.radians(widths["tilt"] or 0.0)
    rx, ry = (abs(part) / size * tilt if size else 0.0 for part in response.rotation)
    return np.array([*widths["shift"], rx, ry])


def reading_slopes(design: Design, response: Response) -> Array:
    """Return the slopes of the outputs along shift and rotation, shape (elements, 5), V/mm and V/rad; 0 at a rail."""
    by_shift, by_rotation = slopes_at(design, response.shift, response.rotation)
    gains = np.array([element.gain for element in of_design(design)])
    saturated = np.array(hall.readings(design, response).saturated)
    slopes = gains[:, None] * np.concatenate([by_shift, by_rotation[:, :2]], axis=1)
    return np.asarray(np.where(saturated[:, None], 0.0, slopes))


def build_decoder(design: Design) -> Decoder | None:
    """Return the decoder of a design by the formulas, which takes some tenths of a second; None if it has none."""
    from analytic.decode import decoder
    from studies.sensing import decode_readings

    try:
        return decoder(design, decode_readings.of_level(design, DECODER_LEVEL))
    except BadInput:
        return None


def decoded(decoder: Decoder, response: Response, widths: Data) -> Data:
    """Return the load that the decoder finds in the readings of a response, with half widths and noise.

    A half width sums the slopes of the decoded force times the half widths of the readings, and adds the distance of
    the decoder's polynomials from the formulas. The noise is the standard deviation; None for elements without noise.
    """
    from analytic import decode
    from analytic.inverse import response_surface

    design, law = decoder.forward.design, decoder.mechanics
    assert law is not None
    fields = np.array([hall.readings(design, response).B_T])
    result = decode.decode(decoder, fields, near=response.shift)
    force = result.force[0]
    known = bool(np.isfinite(force).all())
    half_width = None
    if known and widths["shift"] is not None:
        slopes = response_surface.forces(law, result.shift[0][:, None])[1][:, :, 0].T
        spread = np.abs(slopes) @ np.array(widths["shift"])
        half_width = (spread + np.array([law.errors[1], law.errors[1], law.errors[2]])).tolist()
    return {
        "status": result.status[0],
        "level": DECODER_LEVEL,
        "force": force.tolist() if known else None,
        "half_width": half_width,
        "noise": result.noise_N[0].tolist() if np.isfinite(result.noise_N[0]).all() else None,
    }


def formula(design: Design, load: Load, level: str) -> Data:
    """Return what a level of the formulas says, tilts in degrees, with a message where it is not calibrated."""
    try:
        response = beam.solve(design, load, level)
    except BadInput as error:
        return {"force": None, "shift": None, "message": str(error)}
    return response_data(response) | {"message": beam.outside(design, load, level)}


def curve(design: Design, magnet: Magnet, level: str, store: Store | None, made: Fit | None = None) -> Data:
    """Return the press by finite elements up to the first state that fails, and by the formulas: None out of range.

    store : of its states; without one they are solved without error estimates, for a curve that is soon refined.
    made : calibrated sensor of this design, whose forces and half widths these are.
    """
    scene = Scene(design, tuple(default_loads(design)[0]), LEVELS[level], magnet)
    states = [*(walk(scene, estimate=False, ratios=False) if store is None else walked(scene, store))]
    solved = [state for state in states if state.status in ANSWERED]
    depths, rows = [state.load.depth for state in solved], [(state.response, state.estimates) for state in solved]
    force = [response.force[2] for response, _ in rows]
    half = [_times(share.force, math.hypot(*response.force)) for response, share in rows]
    if made is not None:
        shift, load = (np.array([getattr(one, name) for one, _ in rows]) for name in ("shift", "force"))
        _, _, felt, own = made.answers(design.E_now, shift, np.zeros((len(rows), 2)), load)
        force = felt[:, 2].tolist()
        half = [w if w is None else math.hypot(w, more) for w, more in zip(half, own[:, 2].tolist(), strict=True)]
    formulas: Data = {}
    for name in beam.LEVELS:
        answers = [formula(design, Load(depth=depth), name) for depth in depths]
        formulas[name] = {key: [one[key] and one[key][2] for one in answers] for key in ("force", "shift")}
    data = {
        "depth": depths,
        "force": force,
        "shift": [response.shift[2] for response, _ in rows],
        "estimates": {
            "force": half,
            "shift": [_times(share.shift, math.hypot(*response.shift)) for response, share in rows],
        },
        "status": [state.status for state in solved],
        "message": states[-1].message,
        "formulas": formulas,
    }
    return data | {"figures": _curve_figures(data)}


def stability_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, Data]]:
    """Yield the stability by the surrogate, and by finite elements at the level of the state."""
    state = request.state
    key = stability_key(state, level)
    if key not in memory.results.values and level == "quick":
        data = by_surrogate(state.design, state.magnet)
        if data is not None:
            yield "surrogate", data
    if level == state.level:
        compute = partial(by_finite_elements, state.design, state.magnet, level, memory.store)
        yield level, memory.results.get(key, compute)


def stability_key(state: ExplorerState, level: str) -> tuple[Any, ...]:
    """Return the key of the stability by finite elements among what is kept."""
    return "stability", mechanics(state.design), state.magnet, level


def mechanics(design: Design) -> tuple[Any, ...]:
    """Return the fields of a design on which its curve and its stability depend."""
    names = [spec.name for spec in dataclasses.fields(design)]
    return tuple(getattr(design, name) for name in names if name not in (*OF_READINGS, *OF_TIME))


def by_surrogate(design: Design, magnet: Magnet) -> Data | None:
    """Return the surrogate's answers with half widths of 90 % intervals; None where it refuses the design."""
    try:
        if surrogate_response.refusal(design, Load(depth=surrogate_range.SHALLOWEST * design.D), magnet):
            return None
    except (BadInput, ArithmeticError):
        return None
    beams = surrogate_response.beams_of([design])
    critical = beams.critical_depth()
    mode = beams.first_mode(np.array([design.magnet_density / design.density]))
    depth = float(critical.value[0]) * design.D
    unit = frequency_unit(design.D, design.E_now, design.density)
    found = math.isfinite(depth)
    known = bool(np.isfinite(mode.value[0]))
    numbers = {
        "critical_depth": depth if found else None,
        "estimate": float(critical.half_width[0]) * design.D if found else None,
        "first_mode_hz": unit * float(mode.value[0]) if known else None,
        "first_mode_estimate_hz": unit * float(mode.half_width[0]) if known else None,
    }
    return _stability(numbers, "surrogate", "by the surrogate, with 90 % intervals; finite elements follow")


def _stability(numbers: Data, source: str, message: str, *more: Data) -> Data:
    rows = [
        number("critical depth", "mm", numbers["critical_depth"], numbers["estimate"]),
        number("first mode", "Hz", numbers["first_mode_hz"], numbers["first_mode_estimate_hz"]),
        *more,
    ]
    return numbers | {"columns": [source, ""], "rows": rows, "message": message}


def by_finite_elements(design: Design, magnet: Magnet, level: str, store: Store) -> Data:
    """Return the answers of finite elements, with error estimates as half widths."""
    scene = Scene(design, (Load(),), LEVELS[level], magnet)
    critical = asked(path_solver.place(scene, "critical depth"), store, ["force_error_estimate"])
    first = asked(path_solver.place(scene, "modes", options={"count": 1}), store, ["estimates"])
    if not critical.values:
        raise SolveFailed(critical.message)
    message = "; ".join(filter(None, (critical.message, first.message)))
    D, E, values = design.D, design.E_now, critical.values
    depth, N, stable_to = (
        None if values[name] is None else unit * values[name]
        for name, unit in (
            ("critical_depth_over_D", D),
            ("critical_force_over_ED2", E * D**2),
            ("stable_to_over_D", D),
        )
    )
    error = None if math.isnan(critical.error_estimate) else critical.error_estimate
    (frequency,), (share,) = (first.values.get(name, [None]) for name in ("frequency", "estimates"))
    frequency = frequency and frequency * frequency_unit(D, E, design.density)
    numbers = {
        "critical_depth": depth,
        "estimate": _times(error, depth),
        "first_mode_hz": frequency,
        "first_mode_estimate_hz": _times(share, frequency),
    }
    force = number("critical force", "N", N, _times(values["force_error_estimate"], N))
    stable = number("stable to", "mm", stable_to)
    return _stability(numbers, "finite elements", message, force, stable)


# Tables of rows with words, units and half widths, notes below them, and figures


def _response_table(data: Data, state: FlatRow) -> Data:
    response, widths, formulas = data["response"], data["estimates"], data["formulas"]
    is_known = widths["force"] is not None

    def row(name: str, unit: str, quantity: str, k: int | None = None) -> Data:
        def at(values: Any) -> Any:
            return values if values is None or k is None else values[k]

        beside = {level: at(one.get(quantity)) for level, one in formulas.items()}
        if quantity.startswith("tilt") and beside["paper"] is None and formulas["paper"]["force"]:
            beside["paper"] = "no formula"
        half = widths["tilt" if quantity == "tilt_y" else quantity]
        return number(name, unit, at(response[quantity]), at(half) if is_known else PENDING, beside)

    rows = [row(name, "N", "force", k) for k, name in zip((2, 0, 1), (AXES[2], *AXES[:2]), strict=True)]
    rows += [row(f"shift along {axis}", "mm", "shift", k) for k, axis in enumerate("xyz")]
    rows += [row("tilt towards x", "deg", "tilt"), row("tilt towards y", "deg", "tilt_y")]
    rows.append(row("contact radius", "mm", "contact_radius"))
    rows += quantity_rows(state, pending=not is_known)
    notes = {
        level: " ".join(filter(None, [data["calibration"], one["message"] and f"Formula {level}: {one['message']}"]))
        for level, one in formulas.items()
    }
    return {
        "columns": ["finite elements", {level: f"formula {level}" for level in formulas}],
        "rows": rows,
        "message": notes,
    }


def _readings_table(data: Data) -> Data:
    read = data["readings"]
    if read is None or "volts" not in read:
        return {"rows": [], "message": read["message"] if read else "This sensor has no magnet to read."}
    half = read["half_width"] or [PENDING] * len(read["volts"])
    rows = [
        number(f"{name} (at its rail)" if saturated else name, unit, volts, width, volts - rest)
        for name, unit, volts, rest, width, saturated in zip(
            read["elements"], read["units"], read["volts"], read["rest"], half, read["saturated"], strict=True
        )
    ]
    return {"columns": ["under this load", "change"], "rows": rows, "message": ""}


def _decoded_table(data: Data) -> Data:
    found, read = data["decoded"], data["readings"]
    if read is None or "volts" not in read:
        return {"rows": [], "message": "There are no readings to decode."}
    force, half, noise = ((found and found[key]) or [None] * 3 for key in ("force", "half_width", "noise"))
    rows = [number(*row) for row in zip(AXES, "NNN", force, half, noise, strict=True)]
    return {"columns": ["from the readings", "noise (rms)"], "rows": rows, "message": found and _decoding(data)}


def _decoding(data: Data) -> str:
    """Return what the decoded load rests on; half widths of formulas are those of their fit to the readings."""
    found, status = data["decoded"], data["decoded"]["status"].replace("_", " ")
    if found["level"] == "calibration":
        return f"By the calibration, status {status}: 90 % intervals, with noise."
    text = f"By the formulas of level {found['level']}, status {status}."
    if found["force"]:
        off = [abs(own - fem) for own, fem in zip(found["force"], data["response"]["force"], strict=True)]
        where = f"here the {AXES[off.index(max(off))]} is {max(off):.4g} N off the finite elements"
        text += f" Half widths do not cover the error of the formulas: {where}."
    return text + ("" if found["noise"] else " Give the Hall elements a noise to see its effect on the forces.")


def _readings_figure(data: Data) -> Data | None:
    """Return the readings as bars, with those at rest; the axis ends beyond the rails. None without readings."""
    read = data["readings"]
    if read is None or "volts" not in read:
        return None
    half, ends = read["half_width"] or [0.0] * len(read["volts"]), [ROOM * end for end in read["high"]]
    if min(read["volts"]) < 0:
        ends[0] = -ends[0]
    columns = {"value": read["volts"], "rest": read["rest"], "end": ends}
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    for name, row, width in zip(read["elements"], rows, half, strict=True):
        # of several chips, whose names would overlap, the number and the axis
        short = name.removeprefix("chip") if name.startswith("chip") and name[4:5].isdigit() else name
        row |= {"element": short, "low": row["value"] - width, "high": row["value"] + width}
    return {"chart": "readings", "title": f"reading ({read['units'][0]})", "rows": rows}


CURVES = {"force": ("normal force (N)", 1.0), "shift": ("shift downwards (mm)", -1.0)}


def _curve_figures(data: Data) -> Data:
    """Return force and shift over the depth by finite elements and by the formulas of all levels."""
    figures = {}
    for quantity, (title, sign) in CURVES.items():
        lines = {"finite elements": (data[quantity], data["estimates"][quantity])}
        for level in beam.LEVELS:
            name = "paper's formula" if level == "paper" else f"formula {level}"
            lines[name] = data["formulas"][level][quantity], [None] * len(data["depth"])
        rows = [
            {"depth": depth, "value": sign * value, "model": model}
            | ({} if half is None else {"low": sign * value - half, "high": sign * value + half})
            for model, (values, widths) in lines.items()
            for depth, value, half in zip(data["depth"], values, widths, strict=True)
            if value is not None
        ]
        figures[quantity] = {"chart": "curve", "title": title, "rows": rows}
    return figures
