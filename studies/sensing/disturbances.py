"""What the surroundings of a sensor do to the force that it tells, in N: fields, iron, neighbours, temperature.

At each of some loads of the range the magnet's pose follows from the mechanics; the readings there, and what the
surroundings add to them (`analytic.surroundings`), are decoded as the design's decoder does, and the error is that
of the decoded force vector. **Untared**: the disturbance comes after taring. **Tared**: the sensor was tared at rest
beside it; of a uniform field, it turned to any other direction since. What an object does that moves with the load,
such as a touched piece of iron, taring does not see.

The mechanics count as exact here, and so do the elements: errors of both are those of `sensitivity`. Forces in N,
lengths in mm, fields in T unless a name says otherwise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analytic import surroundings
from analytic.decode import Decoder, decoder, told_slopes
from analytic.hall import plates_of
from analytic.inverse import response_surface
from analytic.inverse.forward_model import readings_with_slopes
from analytic.parts import of_design
from analytic.surroundings import IronPiece, IronPlane, Neighbour, Poses, Surroundings
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.inputs import user_input
from studies.inputs.units import quantity
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.output.result import Result, Table
from studies.quantities import shown
from studies.sensing.decode_readings import Source
from studies.sensing.disturbed_loads import Loads, loads_of, shifts_under

if TYPE_CHECKING:
    from studies.inputs.option_groups import Disturbing
    from studies.parts.requirements import Requirements

FILES = ("DISTURB.md", "disturbances.csv", "warming.csv", "beams.csv")
ENOUGH = 0.5
"""Least share of readings with a force for which a worst error is said."""
DIRECTIONS = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
"""Directions of a uniform field or a moment: to the faces, edges and corners of a cube."""
SILICONE_EXPANSION, BASE_EXPANSION = 3e-4, 9e-5
"""Linear thermal expansion, 1/K, of silicone rubber (makers' data sheets state 2.5e-4 to 3.5e-4) and of a printed
base (ABS; PLA has 7e-5); assumed."""
SIDES = {"below": (0.0, 0.0, 1.0), "beside": (-1.0, 0.0, 0.0), "front": (0.0, 0.0, -1.0)}
"""Where a large piece of iron is, and the normal of its face towards the sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class Disturbance:
    """One kind of surroundings.

    name, words : what it is, and how large and where.
    kinds : returns what it may be, such as fields of several directions; the poses are those of a sensor under loads,
        rest first, for a neighbour of the same design.
    tared : where the sensor is tared at rest: beside the same kind, or any kind (it turns afterwards), or the first
        one (a neighbour at rest); or never, because the disturbance comes with the load.
    """

    name: str
    words: str
    kinds: Callable[[Poses], Sequence[Surroundings]]
    tared: Literal["same", "any", "first", "never"] = "same"


def run(
    design: Design,
    mechanics: Callable[[], Source],
    options: Disturbing,
    needed: Requirements | None,
    array: ArrayDesign | None,
    progress: Progress,
) -> Result:
    """Return errors of the decoded force under each disturbance, and per kelvin.

    mechanics : gives the mechanics of the design, which may take some seconds.
    needed : what the design states as required; else the range is that of a press of 3 D/8 with a shear of D/8.
    array : of which the design is one beam.
    """
    chosen, source = disturbances(design, options, array), mechanics()
    # of an array the field is that of all beams, and not one that a beam tells by itself
    coder = decoder(design, source.law, reject_ambient=options.reject_ambient and array is None)
    loads, full, words = loads_of(coder, needed, array, reject_ambient=options.reject_ambient)
    rows, beams = list[FlatRow](), list[FlatRow]()
    for k, one in enumerate(chosen):
        progress(k / (len(chosen) + 1), one.name)
        row, of_beams = _row(coder, one, loads, full)
        rows.append(row)
        beams += of_beams
    progress(len(chosen) / (len(chosen) + 1), "warming")
    warmed = warming(coder, loads, options, full)
    far = {field: surroundings.reach(design, field * 1e-3) for field in (0.5, 0.1)}
    price = loads.price(coder) if options.reject_ambient else 1.0
    record = {
        "mechanics": source.name,
        "rejects_ambient": options.reject_ambient,
        "noise_factor": price,
        "full_scale_N": full,
        "full_scale": words,
        "beams": loads.beams,
        "loads": len(loads.force) // loads.beams,
        "disturbances": rows,
        "warming_K": options.warming,
        "warming": warmed,
        **{f"field_below_{field:g}_mT_from_mm": distance for field, distance in far.items()},
    }
    outside = (
        f"The magnet's field is below 0.5 mT (cards, compasses) from {far[0.5]:.3g} mm off its centre on, and below "
        f"0.1 mT (a second sensor) from {far[0.1]:.3g} mm on."
    )
    page = page_templates.rendered(
        Path(__file__).with_name("DISTURB.md.j2"), record=record, outside=outside, reason=source.reason
    )
    brief = (
        "error_median_N",
        "error_beams_median_N",
        "tared_beams_median_N",
        "tared_median_N",
        "noticed_percent",
        "tared_noticed_percent",
    )
    return Result(
        title="Disturbances",
        records=[record],
        shown=[
            Table(title="Disturbances", rows=rows, brief=brief),
            Table(title=f"Warmer by {options.warming:g} K", rows=warmed, brief=brief),
            f"Percentages are of {full:.3g} N, {words}. {outside}",
            *[_price_words(price)] * options.reject_ambient,
        ],
        tables={"disturbances": rows, "warming": warmed} | ({"beams": beams} if array else {}),
        pages={"DISTURB.md": page},
        warnings=[*[source.warning] * bool(source.warning), *loads.warnings],
    )


def _price_words(factor: float) -> str:
    if math.isnan(factor):
        return "What --reject-ambient costs in noise is unknown: set the noise of the elements, such as chip_noise."
    return f"--reject-ambient costs {factor:.3g} times the noise of the force."


# Errors


def _row(coder: Decoder, one: Disturbance, loads: Loads, full: float) -> tuple[FlatRow, list[FlatRow]]:
    """Return the errors under a disturbance, of an array those of all beams, and of each beam of an array."""
    # (kinds, n, k)
    changes = np.array([loads.change(kind) for kind in one.kinds(loads.of_one)])
    at_rest = changes[:, :1]
    if one.tared == "any" and loads.beams > 1:
        # turned by half a turn
        tared = changes + at_rest
    elif one.tared == "any":
        tared = (changes - at_rest[:, None]).reshape(-1, *changes.shape[1:])
    else:
        tared = changes - {"same": at_rest, "first": at_rest[:1], "never": 0.0}[one.tared]
    row: FlatRow = {
        "disturbance": one.name,
        "size": one.words,
        "change_mT": 1e3 * float(np.nanmax(np.abs(changes))),
    }
    free = loads.readings(loads.poses.shift.T)
    untared, of_beams = _errors(coder, "error", free + changes, loads, full)
    after, tared_of_beams = _errors(coder, "tared", free + tared, loads, full)
    beams = [
        {"disturbance": one.name, "size": one.words} | own | more
        for own, more in zip(of_beams, tared_of_beams, strict=True)
    ]
    return row | untared | after, beams


def _errors(
    coder: Decoder, name: str, readings: Array, loads: Loads, full: float, stiffer: float = 1.0
) -> tuple[FlatRow, list[FlatRow]]:
    """Return worst and median error of the force of readings (..., n, k), T, over those with a force, N.

    And the shares of readings without a force, and with another status than ok, %. The silicone is `stiffer` times as
    stiff as the decoder's, which is known. Of an array the errors are those of all its beams, with the median of the
    beams' worst ones, and a row for each beam.
    """
    force, status = loads.decode(coder, readings.reshape(-1, readings.shape[-1]))
    error = stiffer * force - np.tile(loads.force, (len(force) // len(loads.force), 1))
    size = np.linalg.norm(error, axis=1)
    worst, median = _worst(size)
    prefix = "" if name == "error" else f"{name}_"
    row: FlatRow = {f"{name}_N": worst, f"{name}_median_N": median}
    beams = list[FlatRow]()
    if loads.beams > 1:
        each = [_worst(size[k :: loads.beams]) for k in range(loads.beams)]
        row[f"{name}_beams_median_N"] = float(np.median([largest for largest, _ in each]))
        beams = [
            {"beam": k, f"{name}_N": largest, f"{name}_median_N": half} for k, (largest, half) in enumerate(each, 1)
        ]
    return row | {
        f"{name}_percent": 100 * worst / full,
        f"{prefix}no_force_percent": 100 * float(np.isnan(size).mean()),
        f"{prefix}noticed_percent": 100 * float(np.mean(np.array(status) != "ok")),
    }, beams


def _worst(error: Array) -> tuple[float, float]:
    """Return largest and median error of those that are known, N; NaN where too few are."""
    known = error[np.isfinite(error)]
    # of a disturbance that leaves hardly any force, the few that are left tell nothing
    if not (len(known) >= ENOUGH * len(error) and len(known) > 0):
        return math.nan, math.nan
    return float(known.max()), float(np.median(known))


def warming(coder: Decoder, loads: Loads, options: Disturbing, full: float) -> list[FlatRow]:
    """Return errors of the force of a sensor that is warmer than its decoder takes it, cause by cause.

    Remanence, gain and modulus change as `Design.temperature` says; nulls drift by up to --null-drift, each to the
    side that moves a force most; the silicone below the magnet's centre expands and lifts it, the base expands and
    takes the elements along. What a magnet loses for good is not modelled, and the loads are held. Tared: at rest at
    the new temperature. To first order the signed error of the largest press is the sum of its causes without nulls.

    Where the temperature is known, such as from the chips, the readings are divided by what remanence and gain have
    become, and the force is multiplied by what the modulus has; the drift of a chip's gain has no known sign.
    """
    design, kelvin = coder.forward.design, options.warming
    warm = replace(design, temperature=design.temperature + kelvin)
    magnet, stiff = warm.remanence_now / design.remanence_now, warm.E_now / design.E_now
    three = design.hall_layout == "three"
    # the drift of a chip may be unknown, and so are its errors then
    of_chip = None if three else design.chip.gain_drift
    drift = design.hall_gain_drift if three else math.nan if of_chip is None else 100 * abs(of_chip)
    gain, rise = 1 + drift / 100 * kelvin, SILICONE_EXPANSION * kelvin * design.H
    free = loads.poses.shift.T
    turn = np.arctan2(loads.force[:, 1], loads.force[:, 0])
    # a press at the end of what is known may lie beyond it now: it has no error then
    softer = shifts_under(coder, loads.force[:, 2] / stiff, np.hypot(*loads.force[:, :2].T) / stiff, turn)
    lift = np.array([[0.0], [0.0], [rise]])
    known = "no data sheet states its drift" if math.isnan(drift) else f"{drift:g} %/K"
    told = f"gain of the elements ({known}{'' if three or math.isnan(drift) else ', a bound to either side'})"
    wider, nulls = loads.widened(1 + BASE_EXPANSION * kelvin), _null_shifts(coder, loads, options)
    of_nulls = "no data sheet states their drift" if nulls is None else f"{options.null_drift:g} uT/K, to either side"
    known_gain, known_nulls = 1.0 if math.isnan(gain) else gain, 0.0 if nulls is None else nulls[:, None]
    still = loads.readings(free)
    everything = magnet * known_gain * wider.readings(softer + lift)
    corrected = magnet * (known_gain if three else 1.0)
    # readings, and what is added to them with either sign; behind them what the decoder knows of the modulus
    causes: dict[str, tuple[Array, Array | float, float]] = {
        f"remanence ({design.remanence_drift:g} %/K)": (magnet * still, 0.0, 1.0),
        told: (gain * still, 0.0, 1.0),
        f"nulls of the elements ({of_nulls})": (still, math.nan if nulls is None else known_nulls, 1.0),
        f"modulus ({shown((stiff - 1) / kelvin, 'percent/K', 2)})": (loads.readings(softer), 0.0, 1.0),
        f"expansion of the silicone ({SILICONE_EXPANSION:g} /K)": (loads.readings(free + lift), 0.0, 1.0),
        f"expansion of the base ({BASE_EXPANSION:g} /K)": (wider.readings(free), 0.0, 1.0),
        "all that is known": (everything, known_nulls, 1.0),
        "what is left of it where the temperature is known": (
            everything / corrected,
            known_nulls / corrected,
            stiff,
        ),
    }
    rest, rows = still[:1], []
    for name, (signed, either, stiffer) in causes.items():
        readings = signed + either
        found, _ = _errors(coder, "error", readings, loads, full, stiffer)
        found |= _errors(coder, "tared", readings - readings[..., :1, :] + rest, loads, full, stiffer)[0]
        per_kelvin = {f"{key}_per_K": found[key] / abs(kelvin) for key in ("error_N", "tared_N")}
        press = math.nan if signed is still else _of_press(coder, signed, loads, stiffer)
        per_kelvin["press_N_per_K"] = press / kelvin
        rows.append({"cause": name} | per_kelvin | found)
    return rows


def _null_shifts(coder: Decoder, loads: Loads, options: Disturbing) -> Array | None:
    """Return drifts of the nulls (m, k), T, of the signs that move a force along x, y or z most, to first order."""
    if options.null_drift is None:
        return None
    law, shift = coder.mechanics, np.ascontiguousarray(loads.poses.shift.T)
    assert law is not None
    told = told_slopes(coder, readings_with_slopes(coder.forward, shift)[1])
    moves = np.linalg.pinv(told.transpose(2, 1, 0))
    by_reading = np.einsum("jin,njk->nik", response_surface.forces(law, shift)[1], moves)
    signs = np.unique(np.sign(by_reading).reshape(-1, by_reading.shape[2]), axis=0)
    return np.asarray(1e-6 * options.null_drift * options.warming * np.tile(signs, loads.beams))


def _of_press(coder: Decoder, readings: Array, loads: Loads, stiffer: float) -> float:
    """Return the signed error of the normal force of the largest upright press, N, from readings (n, k), T; `stiffer`
    is that of `_errors`."""
    upright = np.where(loads.force[:, :2].any(axis=1), -1.0, loads.force[:, 2])
    row = int(upright.argmax())
    frame, beam = divmod(row, loads.beams)
    return float(stiffer * loads.decode(coder, readings[frame : frame + 1])[0][beam, 2] - loads.force[row, 2])


# What surrounds the sensor


def disturbances(design: Design, options: Disturbing, array: ArrayDesign | None = None) -> list[Disturbance]:
    """Return what the options ask for; by default the usual ones, at distances in proportion to the sensor.

    Places are those from the middle of an array, distances beside it those from its outermost axis along x.
    """
    D, mu, ambient = design.D, options.permeability, options.ambient
    places = np.zeros((1, 2)) if array is None else array.places
    # the outermost axis
    edge, across = places[places[:, 0].argmax()].tolist()
    quantity("--ambient", ambient, "uT", 0.0, 1e6)
    quantity("--permeability", mu, "1", 1.0, 1e6)
    quantity("--warming", options.warming, "K", -200.0, 200.0)
    if not options.warming:
        raise BadInput("--warming must not be 0: give the change of the temperature in K")
    quantity("--gradient", options.gradient, "uT/mm", 0.0, 1e6)
    quantity("--null-drift", options.null_drift or 0.0, "uT/K", 0.0, 1e6)
    fields = [surroundings.uniform(1e-6 * ambient * v) for v in DIRECTIONS]
    middle = plates_of(of_design(array or design))[0].mean(axis=0)
    # as on the axis of a dipole: half as large, and reversed, across it
    forms = [1e-6 * options.gradient * (3 * np.outer(v, v) - np.eye(3)) / 2 for v in DIRECTIONS]
    # one of each two that are each other's reverse, whose errors are alike
    gradients = [surroundings.gradient(form, middle) for form in forms[: len(forms) // 2]]
    usual = [f"below={max(design.l0 - design.H, 0.0) + D / 2:.3g}", f"beside={2 * D:.3g}", "front=0"]
    balls = [f"{D / 2:.3g},{edge + 2 * D:.4g},{across:.4g},{design.H:.3g}"]
    rods = [f"{D / 2:.3g},{6 * D:.3g},{edge + 2 * D:.4g},{across:.4g},{design.H:.3g},0,1,0"]
    beside = [f"{edge + 2 * D:.4g},{across:.4g}"]
    return [
        Disturbance("uniform field", f"{ambient:g} uT, any direction", lambda _: fields, "any"),
        Disturbance("field gradient", f"{options.gradient:g} uT/mm, any direction", lambda _: gradients, "any"),
        *(_iron(design, places, text, mu) for text in (usual if options.iron is None else options.iron)),
        *(_ball(design, places, text, mu) for text in (balls if options.ball is None else options.ball)),
        *(_rod(design, places, text, mu) for text in (rods if options.rod is None else options.rod)),
        *(_beside(design, places, text) for text in (beside if options.neighbour is None else options.neighbour)),
        *(_jaw(design, array, gap) for gap in ([D] if options.jaw is None else options.jaw)),
        *(_motor(design, places, text) for text in options.motor or ()),
    ]


def _iron(design: Design, places: Array, text: str, mu: float) -> Disturbance:
    side, _, number = text.partition("=")
    edge = float(places[:, 0].max())
    across = max(design.R, float(plates_of(of_design(design))[0][:, 0].max()))
    least = {"below": max(design.l0 - design.H, 0.0), "beside": across, "front": 0.0}
    if side not in SIDES:
        raise BadInput(f"--iron takes {', '.join(SIDES)} and a distance, such as below=10; got {text!r}")
    (distance,) = _numbers(f"--iron {side}", number, "a distance in mm", 1)
    touched = side == "front" and distance == 0
    if not (touched or least[side] < distance <= 1e4):
        where = {"below": "the base plane, beyond the elements", "beside": "the axis, beyond beam and elements"}
        raise BadInput(
            f"--iron {side} must lie farther than {least[side]:.3g} mm from {where.get(side, 'the tip')}, and within "
            f"10 m; got {distance:g} mm"
        )
    point = {
        "below": (0.0, 0.0, -distance),
        "beside": (edge + distance, 0.0, 0.0),
        "front": (0.0, 0.0, design.L + distance),
    }
    plane = IronPlane(design, np.array(point[side]), np.array(SIDES[side]), mu, touched)
    if touched:
        return Disturbance("iron object", "large, pressed by the tip", lambda _: [plane], "never")
    words = {"below": "below the base plane", "beside": "from the axis", "front": "from the tip at rest"}
    return Disturbance(f"iron plane {side}", f"{distance:g} mm {words[side]}", lambda _: [plane])


def _ball(design: Design, places: Array, text: str, mu: float) -> Disturbance:
    diameter, x, y, z = _numbers("--ball", text, "DIAMETER,X,Y,Z in mm", 4)
    quantity("--ball: the diameter", diameter, "mm", 1e-3, 1e3)
    if not _outside(design, places, (x, y, z), diameter / 2):
        far = float(places[:, 0].max()) + design.R + diameter
        raise BadInput(f"--ball {text} overlaps the beam: move it out, such as to x = {far:.3g} mm")
    piece = IronPiece(design, np.array([x, y, z]), diameter, diameter, np.array([0.0, 0.0, 1.0]), mu)
    return Disturbance("iron ball", f"{diameter:g} mm, at {x:g}, {y:g}, {z:g} mm", lambda _: [piece])


def _rod(design: Design, places: Array, text: str, mu: float) -> Disturbance:
    values = _numbers("--rod", text, "DIAMETER,LENGTH,X,Y,Z,AX,AY,AZ in mm", 8)
    diameter, length = values[:2]
    place, axis = np.array(values[2:5]), np.array(values[5:])
    quantity("--rod: the diameter", diameter, "mm", 1e-3, 1e3)
    quantity("--rod: the length", length, "mm", diameter, 1e4)
    size = float(np.linalg.norm(axis))
    if not 0 < size < math.inf:
        raise BadInput(f"--rod {text}: the direction of the axis is 0 or not finite; give one such as 0,1,0")
    along = place + np.linspace(-1, 1, 101)[:, None] * (length - diameter) / 2 * axis / size
    if not all(_outside(design, places, at, diameter / 2) for at in along.tolist()):
        raise BadInput(f"--rod {text} overlaps the beam: move it out, or turn it")
    piece = IronPiece(design, place, diameter, length, axis, mu)
    where, along_words = (", ".join(f"{value:g}" for value in each) for each in (place, axis))
    words = f"{diameter:g} x {length:g} mm along {along_words}, at {where} mm"
    return Disturbance("iron rod", words, lambda _: [piece])


def _outside(design: Design, places: Array, point: Sequence[float], room: float) -> bool:
    """Return whether a point keeps a distance from the cylinders around the beams, mm."""
    x, y, z = point
    aside = np.maximum(np.hypot(*(places - [x, y]).T) - design.R, 0.0)
    return bool((np.hypot(aside, max(z - design.L, -z, 0.0)) > room).all())


def _beside(design: Design, places: Array, text: str) -> Disturbance:
    x, y = _numbers("--neighbour", text, "X,Y in mm", 2)
    if not np.hypot(*(places - [x, y]).T).min() > design.D:
        raise BadInput(
            f"--neighbour {text} overlaps the sensor: its axis must be farther away than D = {design.D:g} mm"
        )
    words = f"axis at {x:g}, {y:g} mm, under loads of its own"
    return Disturbance("second sensor beside", words, lambda poses: _others(design, [x, y, 0.0], poses), "first")


def _jaw(design: Design, array: ArrayDesign | None, gap: float) -> Disturbance:
    """Return the same sensor or array in the other jaw, turned by half a turn about x, all its beams alike."""
    quantity("--jaw", gap, "mm", 0.0, 1e4)
    words = f"tips {gap:g} mm apart at rest, under loads of its own"
    above = 2 * design.L + gap
    name = "sensor in the other jaw" if array is None else "array in the other jaw"
    places, poles = (np.zeros((1, 2)), np.ones(1)) if array is None else (array.places, array.poles)

    def kinds(poses: Poses) -> list[Surroundings]:
        beams = [_others(design, [x, -y, above], poses, facing=True) for x, y in places.tolist()]
        return [_together(each, poles) for each in zip(*beams, strict=True)]

    return Disturbance(name, words, kinds, "first")


def _together(magnets: Sequence[Surroundings], poles: Array) -> Surroundings:
    """Return the field of several magnets, some of them reversed."""
    return lambda points, poses: np.asarray(
        sum(pole * magnet(points, poses) for pole, magnet in zip(poles.tolist(), magnets, strict=True))
    )


def _others(design: Design, place: Sequence[float], poses: Poses, *, facing: bool = False) -> list[Surroundings]:
    return [
        Neighbour(design, np.array(place), shift, tilt, facing)
        for shift, tilt in zip(poses.shift, poses.tilt, strict=True)
    ]


def _motor(design: Design, places: Array, text: str) -> Disturbance:
    moment, x, y, z = _numbers("--motor", text, "MOMENT,X,Y,Z in A m2 and mm", 4)
    if not 0 < moment <= 1e3:
        raise BadInput(f"--motor: the moment must be above 0 and at most 1000 A m2; got {moment:g}")
    if not _outside(design, places, (x, y, z), design.D):
        raise BadInput(f"--motor {text} is too near: its place must lie D = {design.D:g} mm or more off the beam")
    kinds = [surroundings.motor(np.array([x, y, z]), moment * v) for v in DIRECTIONS]
    return Disturbance("motor", f"{moment:g} A m2, any direction, at {x:g}, {y:g}, {z:g} mm", lambda _: kinds, "any")


def _numbers(name: str, text: str, form: str, count: int) -> list[float]:
    values = user_input.parse_numbers(name, text)
    if len(values) != count or not all(map(math.isfinite, values)):
        raise BadInput(f"{name} takes {form}; got {text!r}")
    return values
