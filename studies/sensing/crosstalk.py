"""How the beams of an array disturb each other: cross-talk, errors of the force over the pitch, forces of magnets.

Random loads of the range act on all beams at once; the same ones, by a fixed seed, at every pitch and polarity. The
readings of the whole array (`analytic.beam_arrays`), tared at rest, are decoded in three ways:

- **ignoring** the neighbours: each beam for itself;
- **subtracting**: each for itself again, less what its neighbours add in the poses so found, once;
- **jointly**: all poses from all readings.

A uniform field, the same for all beams, is rejected where that is asked for or required: jointly, with two chips a
beam or more, in such a field; and by each beam by itself where it has readings enough (`beams_decoder`).

Mechanics and elements count as exact. Forces in N, lengths in mm, fields in T unless a name says otherwise.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam_arrays, parts
from analytic.beam_arrays import BeamArray, readings_of_array
from analytic.decode import Decoder, decoder
from analytic.inverse import ambient_field, response_surface
from analytic.inverse.forward_model import model
from geometry.array_design import POLARITIES, layout_of, poles_of
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.output import console, page_templates
from studies.output.figures import LOG, Figure, panels, picture, rule, styles
from studies.output.records import FlatRow
from studies.output.result import Result, Table
from studies.sensing.array_readings import FAR_ERROR, WHOLE, Grid, with_reaches
from studies.sensing.decode_readings import Source
from studies.sensing.disturbed_loads import Loads, loads_of, shifts_under

if TYPE_CHECKING:
    import pandas as pd

    from analytic.inverse.response_surface import Mechanics
    from geometry.base import Plan
    from studies.inputs.option_groups import Arraying
    from studies.parts.requirements import Requirements

FILES = ("ARRAY.md", "pitches.csv", "crosstalk.csv", "array.png")
DECODERS = {"ignoring": "neighbours ignored", "subtracting": "subtracted once", "jointly": "decoded jointly"}
NEAREST, FARTHEST, STEPS = 1.0625, 5.0, 12
"""Pitches of the curve over D: the ends, and how many evenly on a logarithmic scale."""
FAR = (10.0, 20.0)
"""Pitches over D from which the law far away follows."""
FRAMES, MOST_LOADS, SEED = 16, 1024, 1
"""Number of random loads of the whole array, most loads of single beams in them, and their seed."""
MANY = 36
"""Number of beams from which on the time that all takes is told after the first pitch."""
REACHES = (1.5, 2.5)
"""Distances up to which sparse joint decoders take neighbours, over the pitch: 8 and 24 of them in a large grid."""
TIMED, REPEATS = 16, 9
"""Beams of the array whose decoding from readings alone is timed, and how often: the median counts."""
SIZES, SHARES = (2, 4, 8, 16), (1e-2, 1e-3)
"""Rows and columns of the arrays that are timed, and errors over the range for which these have a reach."""
EARTH_TURNED = 100e-6
"""Change of a uniform field, T, where the design states none: that of the earth by half a turn."""
REJECTED = {
    "none": "A uniform field is not rejected.",
    "jointly": "Decoded jointly, a uniform field is rejected, the same for all beams; a beam by itself, with "
    "neighbours ignored or subtracted, has too few readings for that.",
    "always": "A uniform field is rejected by each decoder; decoded jointly, it is the same for all beams.",
}
"""Which decoders reject a uniform field, and what is said of it."""
LIGHTER = 0.99
"""Shifts of the frame before over those of the frame, for the time of following a stream."""


def run(
    design: Design,
    mechanics: Callable[[], Source],
    grid: Grid,
    options: Arraying,
    needed: Requirements | None,
    single_base: Callable[[], Plan],
    progress: Progress,
) -> Result:
    """Return cross-talk, errors and forces of the array, and errors over the pitch for each polarity.

    mechanics : gives the mechanics of the design, which may take some seconds.
    needed : what the design states as required; else the range is that of a press of 3 D/8 with a shear of D/8.
    single_base : plans the base of a beam by itself.
    """
    # refused before the mechanics take their time
    pitch = grid.pitch_of(design)
    source = mechanics()
    coder, field = beams_decoder(design, source.law, needed, asked=options.reject_ambient)
    loads, full, words = loads_of(coder, needed)
    asked = grid.array(coder, pitch, grid.polarity, ambient=field is not None)
    beam_arrays.check_standing(asked)
    frames = max(2, min(FRAMES, MOST_LOADS // len(asked)))
    drawn = random_loads(coder, loads, frames * len(asked))
    force, shift = (rows.reshape(frames, len(asked), 3) for rows in drawn)
    rows = list(over_pitch(coder, grid, pitch, (force, shift), full, progress, field))
    own = next(row for row in rows if row["polarity"] == _name(grid.polarity) and row["pitch_mm"] == pitch)
    laws, smallest = _laws(coder, grid, rows, shift), _smallest(rows, options.error)
    matrix, near = cross_talk(coder, asked, loads)
    sparse = _sparse(coder, asked, force, shift, full)
    record = {
        "mechanics": source.name,
        "rows": None if grid.places else grid.rows,
        "columns": None if grid.places else grid.columns,
        "array": grid.words,
        "pitch_mm": pitch,
        "polarity": _name(grid.polarity),
        "full_scale_N": full,
        "full_scale": words,
        "frames": frames,
        "rejects_ambient": rejected(coder, asked),
        **{key: value for key, value in own.items() if key not in ("polarity", "pitch_mm", "status")},
        **_noise(coder, asked, force, shift),
        "magnets_change_N": change_of_forces(asked, shift),
        "dipole_force_over_exact": beam_arrays.dipole_share(design, pitch),
        "stiffness_N_per_mm": float(beam_arrays.stiffness(design)[0]),
        "critical_pitch_mm": beam_arrays.critical_pitch(asked),
        "cross_talk": near,
        "sparse": sparse,
        "laws": laws,
        "error_percent": options.error,
        "smallest_pitch": smallest,
        **_cost(coder, grid, asked, drawn[1], full),
    }
    page = page_templates.rendered(
        Path(__file__).with_name("ARRAY.md.j2"),
        record=record,
        reason=source.reason,
        decoders=DECODERS,
        forces=forces_in_words(record),
        field=REJECTED[record["rejects_ambient"]],
        cost=cost_in_words(record),
        whole=WHOLE,
        far=f"{100 * FAR_ERROR:g}",
    )
    return Result(
        title="Array",
        records=[record],
        shown=_shown(record, rows),
        tables={"pitches": rows, "crosstalk": matrix},
        pages={"ARRAY.md": page},
        files={"array.png": lambda path: picture(path, rows, lambda table: figures(table, options.error))},
        warnings=[*[source.warning] * bool(source.warning), *loads.warnings, *_base_warning(single_base, pitch)],
    )


def _shown(record: dict[str, Any], rows: list[FlatRow]) -> list[Table | str]:
    title = f"{record['array']}, {record['polarity']}, pitch {record['pitch_mm']:g} mm"
    errors = [
        {"decoder": name}
        | {key: record[f"{decoder}_{key}"] for key in ("N", "median_N", "percent", "no_force_percent")}
        for decoder, name in DECODERS.items()
    ]
    brief = [f"{name}_median_N" for name in DECODERS] + ["stray_change_mT", "margin"]
    brief += [f"{name}_no_force_percent" for name in ("subtracting", "jointly")]
    return [
        Table(title=f"Largest errors of the force in {record['frames']} random frames: {title}", rows=errors),
        REJECTED[record["rejects_ambient"]],
        Table(title="Cross-talk by distance", rows=record["cross_talk"]),
        Table(title="Over the pitch", rows=rows, brief=brief),
        Table(title="Far away", rows=record["laws"]),
        Table(title=f"Smallest pitch for an error of {record['error_percent']:g} %", rows=record["smallest_pitch"]),
        *[Table(title="Joint decoding with the nearest neighbours only", rows=record["sparse"])]
        * bool(record["sparse"]),
        forces_in_words(record),
        cost_in_words(record),
        Table(title="Joint decoding over the number of beams", rows=record["cost"]),
    ]


def _base_warning(single_base: Callable[[], Plan], pitch: float) -> list[str]:
    """Return a sentence where the bases of single sensors overlap at a pitch, mm."""
    try:
        width = 2 * single_base().half
    except BadInput as error:
        return [f"whether single bases have room at a pitch of {pitch:g} mm is not known: {error}"]
    if pitch >= width:
        return []
    said = f"single bases are {width:.3g} mm wide: at a pitch of {pitch:g} mm the beams need one base in common"
    return [f"{said}, which magtip cad makes for chips from a design file with [array]"]


def cost_in_words(record: dict[str, Any]) -> str:
    """Return the time of joint decoding, in a sentence."""
    return (
        f"Decoding {TIMED} beams jointly takes {record['decode_ms']:.3g} ms of one thread for a frame, and "
        f"{record['follow_ms']:.3g} ms from the poses of the frame before."
    )


def forces_in_words(record: dict[str, Any]) -> str:
    """Return what the magnets do to each other, in sentences."""
    critical = record["critical_pitch_mm"]
    snap = (
        "no neighbours snap together" if math.isnan(critical) else f"below {critical:.4g} mm neighbours snap together"
    )
    return (
        f"The magnets push or pull a beam at rest by up to {record['magnets_N']:.3g} N, which shifts it by up to "
        f"{record['magnets_shift_mm']:.3g} mm; {snap}. Under the loads this force changes by up to "
        f"{record['magnets_change_N']:.3g} N, which acts on the magnet and not on the tip, and no decoder takes "
        f"it off. Two dipoles would have {record['dipole_force_over_exact']:.3g} times the force of neighbours."
    )


def _name(polarity: str | tuple[str, ...]) -> str:
    return polarity if isinstance(polarity, str) else ",".join(polarity)


# Loads and errors


def beams_decoder(
    design: Design, law: Mechanics | None, needed: Requirements | None, *, asked: bool = False
) -> tuple[Decoder, Array | None]:
    """Return the decoder of a beam, and what the uniform field that joint decoding rejects adds to its readings.

    A field is rejected where it is asked for, and where it is required and the chips are as many as that takes. A
    beam by itself rejects it from nine readings on. It is (k,), T, in the middle of three axes; None where no field
    is rejected.
    """
    elements = parts.of_design(design)
    stated = needed is not None and needed.reject_ambient and design.chip_count >= needed.fewest_chips
    if not (asked or stated):
        return decoder(design, law), None
    coder = decoder(design, law, reject_ambient=len(elements) >= ambient_field.FEWEST)
    size = EARTH_TURNED if needed is None else needed.ambient_change
    return coder, size / math.sqrt(3) * ambient_field.directions(coder.forward.elements).sum(axis=1)


def rejected(coder: Decoder, array: BeamArray) -> str:
    """Return which decoders reject a uniform field, a key of `REJECTED`."""
    if coder.field_fit is not None:
        return "always"
    return "jointly" if array.ambient else "none"


def random_loads(coder: Decoder, loads: Loads, count: int) -> tuple[Array, Array]:
    """Return random forces of the range, (n, 3), N, and the shifts of the magnet under them, (n, 3), mm.

    The press is evenly distributed up to the largest one, the force along the plate up to its share of the largest
    one. Where the mechanics know no shift, others are drawn.
    """
    press = float(loads.force[:, 2].max())
    share = float(np.hypot(*loads.force[:, :2].T).max()) / press
    random = np.random.default_rng(SEED)
    normal = press * random.uniform(0, 1, 4 * count)
    tangential = share * normal * random.uniform(0, 1, 4 * count)
    turn = 2 * np.pi * random.uniform(0, 1, 4 * count)
    # the first one is rest, whose shift is known
    normal[0] = tangential[0] = 0.0
    shift = shifts_under(coder, normal, tangential, turn)
    known = np.flatnonzero(np.isfinite(shift[2]))[:count]
    if len(known) < count:
        raise BadInput("the mechanics know too few loads of the range: take others by --level, or require less")
    force = np.column_stack([tangential * np.cos(turn), tangential * np.sin(turn), normal])
    return force[known], shift.T[known]


def over_pitch(
    coder: Decoder,
    grid: Grid,
    pitch: float,
    drawn: tuple[Array, Array],
    full: float,
    progress: Progress,
    field: Array | None,
) -> list[FlatRow]:
    """Return the errors of all decoders over the pitch for each polarity, that of the array among them.

    field : of `beams_decoder`.
    """
    D = coder.forward.design.D
    between = [float(f"{each * D:.4g}") for each in np.geomspace(NEAREST, FARTHEST, STEPS)[:-1]]
    pitches = sorted({*between, *(each * D for each in (FARTHEST, *FAR)), pitch})
    cases = [(polarity, each) for polarity in grid.polarities for each in pitches]
    rows, begun = list[FlatRow](), time.monotonic()
    for k, (polarity, each) in enumerate(cases):
        left = (time.monotonic() - begun) / k * (len(cases) - k) if k else 0.0
        if k == 1 and len(grid) >= MANY:
            console.say(f"magtip: {grid.words} at {len(cases)} pitches and polarities: about {_minutes(left)}")
        told = f", about {_minutes(left)} left" if k and len(grid) >= MANY else ""
        progress(k / len(cases), f"{_name(polarity)}, pitch {each:g} mm{told}")
        array = grid.array(coder, each, polarity, ambient=field is not None)
        rows.append(errors_of_array(coder, array, _name(polarity), drawn, full, field))
    return rows


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.2g} min" if seconds >= 60 else f"{seconds:.0f} s"


def errors_of_array(
    coder: Decoder,
    array: BeamArray,
    polarity: str,
    drawn: tuple[Array, Array],
    full: float,
    field: Array | None = None,
) -> FlatRow:
    """Return the errors of all decoders, what the neighbours add to the readings, and forces of the magnets at rest.

    drawn : forces, N, and shifts of the magnets, mm, of all beams in some frames, (f, n, 3).
    full : of which percentages are, N. field : of `beams_decoder`.
    """
    force, shift = drawn
    magnets, stray = beam_arrays.rest(array), readings_of_array(array, 0 * shift[:1], own=False)
    found: FlatRow = {"polarity": polarity, "pitch_mm": array.pitch}
    decoded, status = dict.fromkeys(DECODERS, np.full_like(force, np.nan)), "ok"
    if inside := array.obstructed():
        status = f"{inside} lies inside a neighbour"
    elif not magnets.margin > 0:
        status = "neighbours snap together"
    else:
        decoded = forces_of_decoders(coder, array, readings_of_array(array, shift), field)
    for name in DECODERS:
        found |= errors(name, decoded[name], force, full)
    return found | {
        "stray_at_rest_mT": 1e3 * float(np.abs(stray).max()),
        "stray_change_mT": 1e3 * _change_of_stray(array, shift),
        "magnets_N": float(np.linalg.norm(magnets.force, axis=1).max()),
        "magnets_shift_mm": float(np.linalg.norm(magnets.shift, axis=1).max()),
        "margin": magnets.margin,
        "status": status,
    }


def forces_of_decoders(
    coder: Decoder, array: BeamArray, readings: Array, field: Array | None = None
) -> dict[str, Array]:
    """Return the decoded forces (f, n, 3), N, of readings (f, n, k), T, by the names of the decoders.

    field : what a uniform field adds to the readings that are decoded jointly, (k,), T, where the array rejects it.
    """
    shape = (*readings.shape[:2], 3)
    stray = readings_of_array(array, np.zeros((1, *shape[1:])), own=False)
    alone = beam_arrays.decoded_alone(coder, array, readings - stray)
    first = beam_arrays.at_rest_where_unknown(alone, shape)
    once = beam_arrays.less_neighbours(coder, array, readings, first)
    start = beam_arrays.at_rest_where_unknown(once, shape)
    if array.ambient:
        readings = readings if field is None else readings + field
        start = _start_in_field(coder, array, readings)
    joint = beam_arrays.decoded_jointly(coder, array, readings, start)
    forces = alone.force, once.force, _forces(coder, joint)
    return {name: force.reshape(shape) for name, force in zip(DECODERS, forces, strict=True)}


def _start_in_field(coder: Decoder, array: BeamArray, readings: Array) -> Array:
    """Return shifts (f, n, 3), mm, near those that readings (f, n, k), T, in an unknown field have."""
    start = np.zeros((*readings.shape[:2], 3))
    for _ in range(2):
        found = beam_arrays.shifts_alone(coder, array, readings, start)
        start = np.where(np.isfinite(found), found, start)
    return start


def errors(name: str, decoded: Array, force: Array, full: float) -> FlatRow:
    """Return largest and median error of the known ones of decoded forces (..., 3), N, and the share of others."""
    error = np.linalg.norm(decoded - force, axis=-1)
    known = error[np.isfinite(error)]
    largest, median = (float(known.max()), float(np.median(known))) if len(known) else (math.nan, math.nan)
    return {
        f"{name}_N": largest,
        f"{name}_median_N": median,
        f"{name}_percent": 100 * largest / full,
        f"{name}_no_force_percent": 100 * (1 - len(known) / error.size),
    }


def _noise(coder: Decoder, array: BeamArray, force: Array, shift: Array) -> FlatRow:
    """Return the root mean square of the force's error by noise, decoded jointly, and of beams by themselves.

    Those have no neighbours, and reject a field where they can do so by themselves.
    """
    if not coder.sigma.any():
        return {"noise_N": math.nan, "noise_alone_N": math.nan}
    noise = coder.sigma * np.random.default_rng(SEED).normal(size=(*shift.shape[:2], len(coder.sigma)))
    cases = ("noise_N", array, "jointly"), ("noise_alone_N", replace(array, reach=0.0, ambient=False), "ignoring")
    found = {}
    for name, which, how in cases:
        decoded = forces_of_decoders(coder, which, readings_of_array(which, shift) + noise)[how]
        found[name] = float(np.sqrt(np.nanmean(((decoded - force) ** 2).sum(axis=-1))))
    return found


def _sparse(coder: Decoder, array: BeamArray, force: Array, shift: Array, full: float) -> list[FlatRow]:
    """Return the errors of joint decoders that know the nearest neighbours only, and others as at rest.

    Reaches within which all beams lie are left out.
    """
    readings, rows = readings_of_array(array, shift), list[FlatRow]()
    for over_pitch in REACHES:
        near = replace(array, reach=over_pitch * array.pitch)
        if near.pairs.shape == array.pairs.shape:
            continue
        decoded = forces_of_decoders(coder, near, readings)["jointly"]
        rows.append(
            {"neighbours": _most_neighbours(near), "reach_mm": near.reach} | errors("error", decoded, force, full)
        )
    return rows


def _most_neighbours(array: BeamArray) -> int:
    """Return the largest number of neighbours that a beam has within the reach."""
    return int(np.bincount(array.pairs[0]).max()) - 1


def change_of_forces(array: BeamArray, shift: Array) -> float:
    """Return the largest change of a magnet's force by shifts (f, n, 3), mm, of all, N."""
    rest, _ = beam_arrays.magnet_forces(array, np.zeros(shift.shape[1:]))
    changes = [beam_arrays.magnet_forces(array, frame)[0] - rest for frame in shift]
    return float(np.linalg.norm(changes, axis=-1).max())


# Cross-talk, and laws over the pitch


def cross_talk(coder: Decoder, array: BeamArray, loads: Loads) -> tuple[list[FlatRow], list[FlatRow]]:
    """Return d(reading of a beam)/d(force on a beam), mT/N, all of them, and the largest by the beams' distance.

    All beams are pressed alike, by about half of the largest press.
    """
    law, n = coder.mechanics, len(array)
    assert law is not None
    upright = np.flatnonzero(~loads.force[:, :2].any(axis=1) & (loads.force[:, 2] > 0))
    middle = upright[np.abs(loads.force[upright, 2] - loads.force[:, 2].max() / 2).argmin()]
    shift = loads.poses.shift[middle]
    _, A = beam_arrays.slopes_of_array(array, np.broadcast_to(shift, (1, n, 3)))
    by_shift = response_surface.forces(law, shift[:, None])[1][:, :, 0].T
    # (beam, element, beam, axis of the force)
    by_force = 1e3 * A[0] @ np.linalg.inv(by_shift)
    decoded = np.array([by_shift @ np.linalg.pinv(by_force[i, :, i] @ by_shift) for i in range(n)])
    told = 100 * np.einsum("iak,ikjb->iajb", decoded, by_force)
    rows: list[FlatRow] = [
        {"reading_of_beam": i + 1, "element": element.name, "force_on_beam": j + 1}
        | {f"d{axis}_mT_per_N": float(value) for axis, value in zip("xyz", by_force[i, k, j], strict=True)}
        for i in range(n)
        for j in range(n)
        for k, element in enumerate(coder.forward.elements)
    ]
    apart = np.round(array.pitch * np.linalg.norm(array.layout[:, None] - array.layout, axis=-1), 6)
    near: list[FlatRow] = []
    for distance in np.unique(apart).tolist():
        first, second = np.nonzero(apart == distance)
        of_axis = {
            f"reading_by_F{axis}_mT_per_N": float(np.abs(by_force[first, :, second, k]).max())
            for k, axis in enumerate("xyz")
        }
        ignored = float(np.linalg.norm(told[first, :, second], axis=1).max())
        near.append({"distance_mm": distance} | of_axis | {"decoded_percent": ignored})
    return rows, near


def _laws(coder: Decoder, grid: Grid, rows: list[FlatRow], shift: Array) -> list[FlatRow]:
    """Return for each polarity the powers by which field, its change and error fall between the pitches `FAR`.

    The field at rest falls by the third power, its change by shifts of the neighbours by the fourth, and by their
    tilt by the third again, but from far less: the error lies between.
    """
    design = coder.forward.design
    still = model(design, elements=coder.forward.elements)
    apart, found = math.log(FAR[1] / FAR[0]), list[FlatRow]()
    for polarity in dict.fromkeys(row["polarity"] for row in rows):
        of_it = {row["pitch_mm"]: row for row in rows if row["polarity"] == polarity}
        near, far = (of_it[each * design.D] for each in FAR)
        poles = polarity if polarity in POLARITIES else grid.polarity
        changes = [
            _change_of_stray(replace(grid.array(coder, each * design.D, poles), forward=still), shift) for each in FAR
        ]
        at = of_it[FARTHEST * design.D]
        found.append({
            "polarity": polarity,
            "field_power": math.log(near["stray_at_rest_mT"] / far["stray_at_rest_mT"]) / apart,
            "by_shift_power": math.log(changes[0] / changes[1]) / apart,
            "error_power": math.log(near["ignoring_N"] / far["ignoring_N"]) / apart,
            "error_over_(l0/p)^4_percent": at["ignoring_percent"] * (at["pitch_mm"] / design.l0) ** 4,
        })  # fmt: skip
    return found


def _change_of_stray(array: BeamArray, shift: Array) -> float:
    """Return the largest change from rest of what the neighbours add to a reading, T."""
    change = readings_of_array(array, shift, own=False) - readings_of_array(array, 0 * shift[:1], own=False)
    return float(np.abs(change).max())


def _smallest(rows: list[FlatRow], limit: float) -> list[FlatRow]:
    """Return for each polarity and decoder the pitch from which on the largest error stays within a limit, percent.

    Between two pitches it is interpolated on logarithmic scales; where all are within it, the first one is an upper
    bound.
    """
    found: list[FlatRow] = []
    for polarity in dict.fromkeys(row["polarity"] for row in rows):
        of_it = [row for row in rows if row["polarity"] == polarity]
        for name, words in DECODERS.items():
            error = np.array([row[f"{name}_percent"] for row in of_it])
            lost = np.array([row[f"{name}_no_force_percent"] > 0 for row in of_it])
            pitches = np.array([row["pitch_mm"] for row in of_it])
            beyond = np.flatnonzero(lost | ~(error <= limit))
            last = beyond[-1] if len(beyond) else -1
            if last == len(pitches) - 1:
                smallest = math.nan
            elif last < 0 or lost[last]:
                smallest = float(pitches[last + 1])
            else:
                at = np.interp(math.log(limit), *(np.log(each[[last + 1, last]]) for each in (error, pitches)))
                smallest = math.exp(at)
            found.append({
                "polarity": polarity, "decoder": words, "smallest_pitch_mm": smallest,
                "bound": "at most" if last < 0 else "",
            })  # fmt: skip
    return found


def costs(coder: Decoder, like: BeamArray, polarity: str, shift: Array, full: float) -> list[FlatRow]:
    """Return times of joint decoding, and errors by the reach, of square arrays of the sizes `SIZES`.

    For each of them all magnets count, and those within the least reaches for the errors `SHARES`.

    like : array of the same pitch, which rejects a field or not.
    shift : random shifts under loads, (m, 3), mm. full : force of which errors are percentages, N.
    """
    found: list[FlatRow] = []
    for size in SIZES:
        whole = replace(like, layout=layout_of(size, size), poles=poles_of(polarity, size, size))
        stated = [(whole, 0.0), *with_reaches(coder, whole, SHARES)[0]]
        errors = {near.reach: (near, error) for near, error in stated}
        frames = np.resize(shift, (2, len(whole), 3))
        readings = readings_of_array(whole, frames)
        for near, error in errors.values():
            follow = partial(beam_arrays.decoded_jointly, coder, near, readings, LIGHTER * frames)
            # what the array keeps is there before
            _ = near.arguments, near.far
            spent, decoded = _median_ms(follow, max(1, 2 * TIMED // len(whole)))
            off = np.linalg.norm(_forces(coder, decoded) - _forces(coder, frames), axis=-1)
            found.append({
                "beams": len(whole), "neighbours": _most_neighbours(near),
                "reach_mm": near.reach if math.isfinite(near.reach) else math.nan,
                "stated_N": error, "stated_percent": 100 * error / full,
                "error_N": float(off.max()), "error_percent": 100 * float(off.max()) / full,
                "follow_ms": spent / len(frames),
            })  # fmt: skip
    return found


def _forces(coder: Decoder, shift: Array) -> Array:
    assert coder.mechanics is not None
    flat = np.ascontiguousarray(shift.reshape(-1, 3).T)
    return response_surface.force_and_load(coder.mechanics, flat)[0].T.reshape(shift.shape)


def _median_ms(decode: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Return the median of the processor's times, ms, and what was decoded."""
    times, found = [], None
    for _ in range(repeats):
        start = time.thread_time()
        found = decode()
        times.append(1e3 * (time.thread_time() - start))
    return float(np.median(times)), found


def _cost(coder: Decoder, grid: Grid, like: BeamArray, shift: Array, full: float) -> dict[str, Any]:
    """Return the times of decoding a frame of `TIMED` beams, ms, from its readings alone and from poses nearby, and
    of other sizes."""
    polarity = grid.polarity if isinstance(grid.polarity, str) else "up"
    rows, side = costs(coder, like, polarity, shift, full), math.isqrt(TIMED)
    array = replace(like, layout=layout_of(side, side), poles=poles_of(polarity, side, side))
    readings = readings_of_array(array, np.resize(shift, (1, TIMED, 3)))
    alone = partial(forces_of_decoders, coder, array, readings)
    follow = next(row["follow_ms"] for row in rows if row["beams"] == TIMED)
    return {"decode_ms": _median_ms(alone, REPEATS)[0], "follow_ms": follow, "cost": rows}


# The figure


DRAWN = ("polarity", "pitch_mm", *(f"{name}_percent" for name in DECODERS), "ignoring_no_force_percent")
"""Columns that the figure takes."""


def figures(table: pd.DataFrame, limit: float = 1.0) -> list[Figure]:
    """Return the error over the pitch, a panel for each polarity, beside the law of the gradient of a dipole.

    limit : error at which a line is drawn, percent.
    """
    import altair as alt
    import pandas as pd

    x, y, law = "pitch (mm)", "largest error of the force (% of the range)", "proportional to 1/pitch^4"
    # the farthest pitches are those of the law, beyond what is built
    shown = table[table["pitch_mm"] <= (1 + 1e-6) * FARTHEST / FAR[-1] * table["pitch_mm"].max()]
    if not shown["ignoring_percent"].any():
        return []
    parts = [
        pd.DataFrame({
            x: shown["pitch_mm"], y: shown[f"{name}_percent"], "series": DECODERS[name], "panel": shown["polarity"],
        })
        for name in ("ignoring", "subtracting")
    ]  # fmt: skip
    ends = shown["pitch_mm"].iloc[[0, -1]].to_numpy()
    parts += [
        pd.DataFrame({
            x: ends, y: of_it["ignoring_percent"].iloc[-1] * (ends[1] / ends) ** 4, "series": law, "panel": polarity,
        })
        for polarity, of_it in shown.groupby("polarity", sort=False)
    ]  # fmt: skip
    data = pd.concat(parts, ignore_index=True).dropna(ignore_index=True)
    low, high = np.log10(data[y].min()), np.log10(data[y].max())
    powers = (10.0 ** np.arange(math.ceil(low), math.floor(high) + 1)).tolist()
    looks = styles([*list(DECODERS.values())[:2], law], lines=[law])
    axes = {"x": alt.X(x, **LOG), "y": alt.Y(y, **(LOG | {"axis": {"format": "~g", "values": powers}}))}
    of_law = f"datum.series == '{law}'"
    lines = alt.Chart().transform_filter(f"!({of_law})").mark_line(point=True).encode(**axes, **looks)
    guide = alt.Chart().transform_filter(of_law).mark_line(strokeDash=[5, 4]).encode(**axes, color=looks["color"])
    chart = panels(alt.layer(*rule("y", limit), guide, lines), data)
    caption = "Largest error of the decoded force over random loads on all beams at once, tared at rest."
    worst = table.loc[table["ignoring_no_force_percent"].idxmax()]
    lost, at = worst["ignoring_no_force_percent"], worst["pitch_mm"]
    notes = [
        "Largest of some random frames of loads on all beams, tared at rest.",
        f"The level dashed line lies at {limit:g} %.",
        *[f"Readings that give no force, with neighbours ignored up to {lost:.2g} % at {at:g} mm, are not counted."]
        * bool(lost),
        f"Jointly decoded, no error exceeds {table['jointly_percent'].max():.1g} %.",
        "Subtracted once, a beam without a pose counts as at rest, which makes steps.",
    ]
    return [Figure("Error of the force by the neighbours in an array", caption, chart, data, (" ".join(notes),))]
