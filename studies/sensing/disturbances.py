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
from analytic.decode import Decoder, decode, decoder, told_slopes
from analytic.hall import means_over_plates, plates_of
from analytic.inverse import response_surface
from analytic.inverse.forward_model import Forward, model, readings_at, readings_with_slopes, rotation
from analytic.parts import of_design
from analytic.surroundings import IronPiece, IronPlane, Neighbour, Poses, Surroundings
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

if TYPE_CHECKING:
    from studies.inputs.option_groups import Disturbing
    from studies.parts.requirements import Requirements

FILES = ("DISTURB.md", "disturbances.csv", "warming.csv")
USUAL_DEPTH, USUAL_SHEAR = 3 / 8, 1 / 8
"""Depth and shear over D whose forces are the range of a design that states none."""
WITHIN = 0.95
"""Largest depth of the usual loads over the deepest one that the mechanics know."""
ENOUGH = 0.5
"""Least share of readings with a force for which a worst error is said."""
TURNS = (2 * np.pi * np.arange(4) / 4).tolist()
"""Directions of a force along the plate."""
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


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """The loads at which errors are taken, rest first: forces (n, 3), N, poses under them, and what reads these.

    left_out : number of loads of the range that the mechanics do not reach.
    """

    force: Array
    poses: Poses
    sensor: Forward
    left_out: int

    def readings(self, shift: Array) -> Array:
        """Return the readings (n, k), T, of the elements at shifts (3, n), mm; NaN where a shift is."""
        found, known = np.full((shift.shape[1], len(self.sensor.elements)), np.nan), np.isfinite(shift).all(axis=0)
        found[known] = readings_at(self.sensor, shift[:, known]).T
        return found

    @property
    def warnings(self) -> list[str]:
        """A sentence where loads are left out."""
        said = f"{self.left_out} loads of the range lie beyond the mechanics: their errors are not known"
        return [said] * bool(self.left_out)


def run(
    design: Design,
    mechanics: Callable[[], Source],
    options: Disturbing,
    needed: Requirements | None,
    progress: Progress,
) -> Result:
    """Return errors of the decoded force under each disturbance, and per kelvin.

    mechanics : gives the mechanics of the design, which may take some seconds.
    needed : what the design states as required; else the range is that of a press of 3 D/8 with a shear of D/8.
    """
    chosen, source = disturbances(design, options), mechanics()
    coder = decoder(design, source.law, reject_ambient=options.reject_ambient)
    loads, full, words = loads_of(coder, needed)
    rows = []
    for k, one in enumerate(chosen):
        progress(k / (len(chosen) + 1), one.name)
        rows.append(_row(coder, one, loads, full))
    progress(len(chosen) / (len(chosen) + 1), "warming")
    warmed = warming(coder, loads, options, full)
    far = {field: surroundings.reach(design, field * 1e-3) for field in (0.5, 0.1)}
    price = _price(coder, design, loads) if options.reject_ambient else 1.0
    record = {
        "mechanics": source.name,
        "rejects_ambient": options.reject_ambient,
        "noise_factor": price,
        "full_scale_N": full,
        "full_scale": words,
        "loads": len(loads.force),
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
    brief = ("error_median_N", "tared_median_N", "noticed_percent", "tared_noticed_percent")
    return Result(
        title="Disturbances",
        records=[record],
        shown=[
            Table(title="Disturbances", rows=rows, brief=brief),
            Table(title=f"Warmer by {options.warming:g} K", rows=warmed, brief=brief),
            f"Percentages are of {full:.3g} N, {words}. {outside}",
            *[_price_words(price)] * options.reject_ambient,
        ],
        tables={"disturbances": rows, "warming": warmed},
        pages={"DISTURB.md": page},
        warnings=[*[source.warning] * bool(source.warning), *loads.warnings],
    )


# Loads


def loads_of(coder: Decoder, needed: Requirements | None) -> tuple[Loads, float, str]:
    """Return the loads, the force of which percentages are, N, and which one it is, in words."""
    assert coder.mechanics is not None
    if needed is not None:
        pairs, full, words = needed.loads().tolist(), needed.force_z, "the required press"
    else:
        depth, full, along = _usual_forces(coder)
        pairs = [*([share * full, 0.0] for share in (0.25, 0.5, 1.0)), [full / 2, along], [full, along]]
        words = f"a press of {depth:.3g} mm, for the design states no required one"
    asked = [(0.0, 0.0, 0.0), *((n, t, turn) for n, t in pairs for turn in (TURNS if t else TURNS[:1]))]
    normal, tangential, turn = np.array(asked).T
    shift = shifts_under(coder, normal, tangential, turn)
    known = np.isfinite(shift[2])
    if not known[1:].any():
        raise BadInput(
            f"the mechanics reach no load of the range up to {full:.3g} N: take others by --level, or require less"
        )
    force = np.column_stack([tangential * np.cos(turn), tangential * np.sin(turn), normal])
    return Loads(force[known], _poses(coder, shift[:, known]), coder.forward, int((~known).sum())), full, words


def shifts_under(coder: Decoder, normal: Array, tangential: Array, turn: Array) -> Array:
    """Return the shifts (3, n) of the magnet under forces, the first of which are none; NaN where none is known."""
    law = coder.mechanics
    assert law is not None
    u, w = response_surface.shifts_of_forces(law, coder.low, coder.high, tangential, normal)
    u[0] = w[0] = 0.0
    # rounded, so that a force along an axis has no component of 1e-16 across it
    return np.stack([u * np.round(np.cos(turn), 15), u * np.round(np.sin(turn), 15), w])


def _poses(coder: Decoder, shift: Array) -> Poses:
    law = coder.mechanics
    assert law is not None
    depth = response_surface.force_and_load(law, shift, contact=False)[1][0]
    return Poses(shift.T, rotation(coder.forward.tau, shift).T, np.maximum(depth, 0.0))


def _price_words(factor: float) -> str:
    if math.isnan(factor):
        return "What --reject-ambient costs in noise is unknown: set the noise of the elements, such as chip_noise."
    return f"--reject-ambient costs {factor:.3g} times the noise of the force."


def _price(coder: Decoder, design: Design, loads: Loads) -> float:
    """Return by which factor a rejected field makes the noise of the force larger: the median over loads and axes."""
    plain, readings = decoder(design, coder.mechanics), loads.readings(loads.poses.shift.T)
    ratio = decode(coder, readings).noise_N / decode(plain, readings).noise_N
    return float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else math.nan


def _usual_forces(coder: Decoder) -> tuple[float, float, float]:
    """Return depth, mm, and force, N, of the usual press or of nearly the deepest known one, and the force along the
    plate of the usual shear at it, N."""
    law, D = coder.mechanics, coder.forward.design.D
    assert law is not None
    axes = np.linspace(0, coder.high[0], 81), np.linspace(coder.low[2], 0, 81)
    u, w = (values.ravel() for values in np.meshgrid(*axes))
    force, plate, _ = response_surface.force_and_load(law, np.stack([u, 0 * u, w]), contact=False)
    upright = np.flatnonzero(u == 0)
    # at the end of what is known the least disturbance would leave no force
    deepest = min(USUAL_DEPTH * D, WITHIN * float(np.nanmax(plate[0, upright])))
    press = upright[np.nanargmin(np.abs(plate[0, upright] - deepest))]
    sheared = np.nanargmin(np.hypot(plate[0] - plate[0, press], plate[1] - USUAL_SHEAR * D))
    return float(plate[0, press]), float(force[2, press]), float(abs(force[0, sheared]))


# Errors


def _row(coder: Decoder, one: Disturbance, loads: Loads, full: float) -> FlatRow:
    elements, poses = coder.forward.elements, loads.poses
    points, owners = plates_of(elements)
    # (kinds, n, k)
    changes = np.array([
        means_over_plates(kind(points, poses).reshape(-1, 3), elements, owners) for kind in one.kinds(poses)
    ])  # fmt: skip
    at_rest = changes[:, :1]
    if one.tared == "any":
        tared = (changes - at_rest[:, None]).reshape(-1, *changes.shape[1:])
    else:
        tared = changes - {"same": at_rest, "first": at_rest[:1], "never": 0.0}[one.tared]
    found: FlatRow = {
        "disturbance": one.name,
        "size": one.words,
        "change_mT": 1e3 * float(np.nanmax(np.abs(changes))),
    }
    free = loads.readings(poses.shift.T)
    return (
        found
        | _errors(coder, "error", free + changes, loads, full)
        | _errors(coder, "tared", free + tared, loads, full)
    )


def _errors(coder: Decoder, name: str, readings: Array, loads: Loads, full: float, stiffer: float = 1.0) -> FlatRow:
    """Return worst and median error of the force of readings (..., n, k), T, over those with a force, N.

    And the shares of readings without a force, and with another status than ok, %. The silicone is `stiffer` times as
    stiff as the decoder's, which is known.
    """
    rows = readings.reshape(-1, readings.shape[-1])
    found = decode(coder, rows)
    error = stiffer * found.force - np.tile(loads.force, (len(rows) // len(loads.force), 1))
    error = np.linalg.norm(error, axis=1)
    known = error[np.isfinite(error)]
    # of a disturbance that leaves hardly any force, the few that are left tell nothing
    said = len(known) >= ENOUGH * len(error) and len(known) > 0
    worst, median = (float(known.max()), float(np.median(known))) if said else (math.nan, math.nan)
    prefix = "" if name == "error" else f"{name}_"
    return {
        f"{name}_N": worst,
        f"{name}_median_N": median,
        f"{name}_percent": 100 * worst / full,
        f"{prefix}no_force_percent": 100 * (1 - len(known) / len(error)),
        f"{prefix}noticed_percent": 100 * float(np.mean(np.array(found.status) != "ok")),
    }


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
    wider, nulls = _on_a_wider_base(loads, kelvin), _null_shifts(coder, loads, options)
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
        found = _errors(coder, "error", readings, loads, full, stiffer)
        found |= _errors(coder, "tared", readings - readings[..., :1, :] + rest, loads, full, stiffer)
        per_kelvin = {f"{key}_per_K": found[key] / abs(kelvin) for key in ("error_N", "tared_N")}
        press = math.nan if signed is still else _of_press(coder, signed, loads, stiffer)
        per_kelvin["press_N_per_K"] = press / kelvin
        rows.append({"cause": name} | per_kelvin | found)
    return rows


def _on_a_wider_base(loads: Loads, kelvin: float) -> Loads:
    """Return loads whose readings are those of elements on a warmer base."""
    grown = 1 + BASE_EXPANSION * kelvin
    elements = [
        replace(e, position=(e.position[0] * grown, e.position[1] * grown, e.position[2] * grown))
        for e in loads.sensor.elements
    ]
    return replace(loads, sensor=model(loads.sensor.design, loads.sensor.tau, elements=elements))


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
    return 1e-6 * options.null_drift * options.warming * signs


def _of_press(coder: Decoder, readings: Array, loads: Loads, stiffer: float) -> float:
    """Return the signed error of the normal force of the largest upright press, N, from readings (n, k), T; `stiffer`
    is that of `_errors`."""
    upright = np.where(loads.force[:, :2].any(axis=1), -1.0, loads.force[:, 2])
    row = int(upright.argmax())
    return float(stiffer * decode(coder, readings[row : row + 1]).force[0, 2] - loads.force[row, 2])


# What surrounds the sensor


def disturbances(design: Design, options: Disturbing) -> list[Disturbance]:
    """Return what the options ask for; by default the usual ones, at distances in proportion to the sensor."""
    D, mu, ambient = design.D, options.permeability, options.ambient
    quantity("--ambient", ambient, "uT", 0.0, 1e6)
    quantity("--permeability", mu, "1", 1.0, 1e6)
    quantity("--warming", options.warming, "K", -200.0, 200.0)
    if not options.warming:
        raise BadInput("--warming must not be 0: give the change of the temperature in K")
    quantity("--gradient", options.gradient, "uT/mm", 0.0, 1e6)
    quantity("--null-drift", options.null_drift or 0.0, "uT/K", 0.0, 1e6)
    fields = [surroundings.uniform(1e-6 * ambient * v) for v in DIRECTIONS]
    middle = plates_of(of_design(design))[0].mean(axis=0)
    # as on the axis of a dipole: half as large, and reversed, across it
    forms = [1e-6 * options.gradient * (3 * np.outer(v, v) - np.eye(3)) / 2 for v in DIRECTIONS]
    # one of each two that are each other's reverse, whose errors are alike
    gradients = [surroundings.gradient(form, middle) for form in forms[: len(forms) // 2]]
    usual = [f"below={max(design.l0 - design.H, 0.0) + D / 2:.3g}", f"beside={2 * D:.3g}", "front=0"]
    balls = [f"{D / 2:.3g},{2 * D:.3g},0,{design.H:.3g}"]
    rods = [f"{D / 2:.3g},{6 * D:.3g},{2 * D:.3g},0,{design.H:.3g},0,1,0"]
    return [
        Disturbance("uniform field", f"{ambient:g} uT, any direction", lambda _: fields, "any"),
        Disturbance("field gradient", f"{options.gradient:g} uT/mm, any direction", lambda _: gradients, "any"),
        *(_iron(design, text, mu) for text in (usual if options.iron is None else options.iron)),
        *(_ball(design, text, mu) for text in (balls if options.ball is None else options.ball)),
        *(_rod(design, text, mu) for text in (rods if options.rod is None else options.rod)),
        *(_beside(design, text) for text in ([f"{2 * D:.3g},0"] if options.neighbour is None else options.neighbour)),
        *(_jaw(design, gap) for gap in ([D] if options.jaw is None else options.jaw)),
        *(_motor(design, text) for text in options.motor or ()),
    ]


def _iron(design: Design, text: str, mu: float) -> Disturbance:
    side, _, number = text.partition("=")
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
    point = {"below": (0.0, 0.0, -distance), "beside": (distance, 0.0, 0.0), "front": (0.0, 0.0, design.L + distance)}
    plane = IronPlane(design, np.array(point[side]), np.array(SIDES[side]), mu, touched)
    if touched:
        return Disturbance("iron object", "large, pressed by the tip", lambda _: [plane], "never")
    words = {"below": "below the base plane", "beside": "from the axis", "front": "from the tip at rest"}
    return Disturbance(f"iron plane {side}", f"{distance:g} mm {words[side]}", lambda _: [plane])


def _ball(design: Design, text: str, mu: float) -> Disturbance:
    diameter, x, y, z = _numbers("--ball", text, "DIAMETER,X,Y,Z in mm", 4)
    quantity("--ball: the diameter", diameter, "mm", 1e-3, 1e3)
    if not _outside(design, x, y, z, diameter / 2):
        raise BadInput(f"--ball {text} overlaps the beam: move it out, such as to x = {design.R + diameter:.3g} mm")
    piece = IronPiece(design, np.array([x, y, z]), diameter, diameter, np.array([0.0, 0.0, 1.0]), mu)
    return Disturbance("iron ball", f"{diameter:g} mm, at {x:g}, {y:g}, {z:g} mm", lambda _: [piece])


def _rod(design: Design, text: str, mu: float) -> Disturbance:
    values = _numbers("--rod", text, "DIAMETER,LENGTH,X,Y,Z,AX,AY,AZ in mm", 8)
    diameter, length = values[:2]
    place, axis = np.array(values[2:5]), np.array(values[5:])
    quantity("--rod: the diameter", diameter, "mm", 1e-3, 1e3)
    quantity("--rod: the length", length, "mm", diameter, 1e4)
    size = float(np.linalg.norm(axis))
    if not 0 < size < math.inf:
        raise BadInput(f"--rod {text}: the direction of the axis is 0 or not finite; give one such as 0,1,0")
    along = place + np.linspace(-1, 1, 101)[:, None] * (length - diameter) / 2 * axis / size
    if not all(_outside(design, x, y, z, diameter / 2) for x, y, z in along.tolist()):
        raise BadInput(f"--rod {text} overlaps the beam: move it out, or turn it")
    piece = IronPiece(design, place, diameter, length, axis, mu)
    where, along_words = (", ".join(f"{value:g}" for value in each) for each in (place, axis))
    words = f"{diameter:g} x {length:g} mm along {along_words}, at {where} mm"
    return Disturbance("iron rod", words, lambda _: [piece])


def _outside(design: Design, x: float, y: float, z: float, room: float) -> bool:
    """Return whether a point keeps a distance from the cylinder around the beam, mm."""
    aside, above = max(math.hypot(x, y) - design.R, 0.0), max(z - design.L, -z, 0.0)
    return math.hypot(aside, above) > room


def _beside(design: Design, text: str) -> Disturbance:
    x, y = _numbers("--neighbour", text, "X,Y in mm", 2)
    if not math.hypot(x, y) > design.D:
        raise BadInput(
            f"--neighbour {text} overlaps the sensor: its axis must be farther away than D = {design.D:g} mm"
        )
    words = f"axis at {x:g}, {y:g} mm, under loads of its own"
    return Disturbance("second sensor beside", words, lambda poses: _others(design, [x, y, 0.0], poses), "first")


def _jaw(design: Design, gap: float) -> Disturbance:
    quantity("--jaw", gap, "mm", 0.0, 1e4)
    place = [0.0, 0.0, 2 * design.L + gap]
    words = f"tips {gap:g} mm apart at rest, under loads of its own"
    return Disturbance(
        "sensor in the other jaw", words, lambda poses: _others(design, place, poses, facing=True), "first"
    )


def _others(design: Design, place: Sequence[float], poses: Poses, *, facing: bool = False) -> list[Surroundings]:
    return [
        Neighbour(design, np.array(place), shift, tilt, facing)
        for shift, tilt in zip(poses.shift, poses.tilt, strict=True)
    ]


def _motor(design: Design, text: str) -> Disturbance:
    moment, x, y, z = _numbers("--motor", text, "MOMENT,X,Y,Z in A m2 and mm", 4)
    if not 0 < moment <= 1e3:
        raise BadInput(f"--motor: the moment must be above 0 and at most 1000 A m2; got {moment:g}")
    if not _outside(design, x, y, z, design.D):
        raise BadInput(f"--motor {text} is too near: its place must lie D = {design.D:g} mm or more off the beam")
    kinds = [surroundings.motor(np.array([x, y, z]), moment * v) for v in DIRECTIONS]
    return Disturbance("motor", f"{moment:g} A m2, any direction, at {x:g}, {y:g}, {z:g} mm", lambda _: kinds, "any")


def _numbers(name: str, text: str, form: str, count: int) -> list[float]:
    values = user_input.parse_numbers(name, text)
    if len(values) != count or not all(map(math.isfinite, values)):
        raise BadInput(f"{name} takes {form}; got {text!r}")
    return values
