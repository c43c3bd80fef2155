"""Study firmware: the decoder of a design as a C header in an Arduino library, with examples and test vectors.

The header is a template beside this module; `studies.firmware.decoder_tables` makes its constants. The answers of the
test vectors are those of the decoder in Python, `reference`.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analytic import beam_arrays, time_series
from analytic.beam_arrays import BeamArray
from analytic.decode import Decoder, ambient_of, decode, decoder, field_of, spread, told_slopes
from analytic.inverse import pose_search
from analytic.inverse.forward_model import readings_at, readings_with_slopes
from analytic.inverse.response_surface import force_and_load, forces, shifts_of_forces
from analytic.parts import columns, with_noise
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.design_digest import digest
from geometry.messages import Progress
from studies.firmware import decoder_tables
from studies.firmware.decoder_tables import Tables
from studies.inputs.option_groups import Exporting
from studies.inputs.table_input import COLDEST, HOTTEST
from studies.inputs.user_input import design_text
from studies.output import page_templates
from studies.output.atomic_files import write_text
from studies.output.result import Result, Table, Writer
from studies.parts.part_tolerances import Tolerances, tolerances
from studies.parts.requirements import Requirements, full_scale
from studies.quantities import shown
from studies.sensing import decode_readings
from studies.sensing.decode_readings import QUANTILE
from studies.sensitivity import decode_tolerances
from studies.simulation import mechanics_sources

if TYPE_CHECKING:
    from analytic.decode import Decoded, Status
    from studies.calibration.sensor_fit import Fit

STATUSES: tuple[Status, ...] = (
    *("ok", "ambiguous", "out_of_workspace", "saturated", "not_finite"),
    *("tension", "uncalibrated", "frozen", "after_gap", "jump", "inconsistent"),
    "out_of_range",
)
"""Statuses of the decoder by their numbers in C."""
SIZES = (
    *(((8, 8, 4), 40), ((8, 8, 4), 28), ((8, 8, 4), 20), ((8, 8, 4), 16)),
    *(((6, 6, 4), 16), ((6, 6, 4), 12), ((6, 6, 4), 10), ((5, 5, 3), 12), ((5, 5, 3), 10)),
)
"""Cells of the grid of starts, and coefficients of the field along r and z; the first that fit are taken."""
CODE, CALIBRATED_CODE, WARM_CODE, REJECTING_CODE = 10_360, 480, 900, 230
"""Bytes beside the tables of a program for a Cortex-M4F with -Os, functions of math.h included (results/devices);
those of a calibration's intervals, of its temperature, and of an ambient field."""
CHIPS_CODE, CHIP_CODE, ARRAY_CODE, BEAM_CODE = 120, 205, 1320, 28
"""Further bytes of chips in place of one-axis elements, of each chip, of an array, and of each beam of it."""
MOMENTS = (1, 3, 5)
"""Orders of the moments of a neighbour's magnet."""
FRAMES = 32
"""Random frames at which the error of first order of an array is looked at."""
MOST_FLASH = 1_000_000
WORST = 0.5
"""Largest error of the force by the tables, % of full scale, with which a header is written."""
DIRECTION = 15.0
"""Angle between the directions of required loads whose errors are looked at, deg."""
STARTS, EVALUATIONS = 16, 13
"""Largest number of starts and of evaluations of the field of one decoding: they limit its time."""
SHORT, SAME, EDGE, FIT, REST = 1e-6, 2e-4, 1e-4, 2e-6, 2e-7
"""Over D: error at which the iteration ends, distance of two poses that count as one, of a pose beyond the edge of
the workspace, misfit of a pose as a distance, and height that counts as rest: above the rounding of float."""
ROUNDING = 4e-7
"""Misfit over the largest reading that rounding of float may leave."""
TRIED = 2000
"""Random poses of the workspace of which test vectors are taken: of the required loads they may be few."""
REACH = 1.2
"""Farthest that the iteration moves from a start, over the diagonal of a cell."""
EXAMPLES = {"three": "AnalogElements", "mlx90393": "MLX90393", "tlv493d": "TLx493D", "tle493d": "TLx493D",
            "tli493d": "TLx493D"}  # fmt: skip
"""Examples by the beginning of the layout's name."""
OTHER = "OtherChip"
SKETCHES = ("SelfTest", *dict.fromkeys([*EXAMPLES.values(), OTHER]))
HEADER, VECTORS = "src/magtip_decoder.h", "src/magtip_vectors.h"
PLAIN = (HEADER, VECTORS, "extras/test_vectors.csv", "library.properties", "keywords.txt", "README.md")
FILES = (*PLAIN, *(f"examples/{name}/{name}.ino" for name in SKETCHES))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Firmware:
    """A decoder with what its export in C needs.

    Attributes
    ----------
    design : as it was given.
    source : of the mechanics, in words.
    made : tolerances of a made sensor; None for one that was calibrated.
    rest : C^-1 of made sensors' readings at rest, shape (3, 3), 1/T^2, and chi^2 below which a row may be of one.
    errors : largest errors by the tables of shift, mm, and force, N, and the largest force, N, in the workspace.
    scale : largest error of the force by the tables, N, the force of which errors are percentages, N, and which one
        it is, in words: in the required loads, or in the workspace where nothing is required.
    rated : largest normal force of the sensor, and largest force along its plate, N.
    array : the beams, of which the sensor is one; None for a single sensor.
    first_order : largest and median error of the force of an array, N, because its beams are not decoded jointly, and
        the share of beams without a force, in random poses of all beams at once, under rated loads at most.
    """

    coder: Decoder
    design: Design
    source: str
    made: Tolerances | None
    rest: tuple[Array, float]
    tables: Tables
    errors: tuple[float, float, float]
    scale: tuple[float, float, str]
    rated: tuple[float, float]
    array: BeamArray | None = None
    first_order: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def percent(self) -> float:
        """Largest error of the force by the tables, % of the force `scale`."""
        return 100 * self.scale[0] / self.scale[1]

    @property
    def code(self) -> int:
        return code_of(self.coder, self.array, calibrated=self.made is None, warm=self.is_warm)

    @property
    def is_warm(self) -> bool:
        """Whether the decoder takes a temperature."""
        return "warming" in self.tables.floats

    @property
    def flash(self) -> int:
        return self.tables.size + self.code

    @property
    def state(self) -> int:
        """Bytes of `magtip_sensor`, of an array those of all its beams."""
        recent, beams = time_series.RECENT, 1 if self.array is None else len(self.array)
        count = len(self.tables.floats["rest"])
        return (
            beams
            * 4
            * (3 + 4 * count + recent * (count + 1) + 2 + 3 * len(self.tables.floats["branches"]) + 6 + self.is_warm)
        )


def code_of(coder: Decoder, array: BeamArray | None, *, calibrated: bool, warm: bool) -> int:
    design, rejects = coder.forward.design, coder.field_fit is not None
    chips = 0 if design.hall_layout == "three" else CHIPS_CODE + CHIP_CODE * int(design.chip_count)
    beams = 0 if array is None else ARRAY_CODE + BEAM_CODE * len(array)
    return CODE + chips + beams + calibrated * CALIBRATED_CODE + warm * WARM_CODE + rejects * REJECTING_CODE


def bytes_of(text: str) -> int:
    """Return a number of bytes, such as 64k or 16384.

    >>> bytes_of("16k"), bytes_of("20000")
    (16384, 20000)
    """
    match = re.fullmatch(r"(\d+)\s*(k?)(i?B)?", text.strip(), re.IGNORECASE)
    size = int(match[1]) * (1024 if match[2] else 1) if match else 0
    if not 0 < size <= MOST_FLASH:
        raise BadInput(f"--flash takes a size such as 64k or 16384 (bytes), at most {MOST_FLASH}; got {text!r}")
    return size


def prepare(
    design: Design,
    options: Exporting,
    made: Tolerances | None = None,
    needed: Requirements | None = None,
    array: ArrayDesign | None = None,
) -> Firmware:
    """Return what the export of a design's decoder needs, with tables that fit into the flash.

    Raises
    ------
    BadInput
        The design cannot be decoded, the flash is too small for it, or the calibration is of another design.
    """
    flash, room = options.flash, bytes_of(options.flash)
    if options.calibration is not None:
        coder, unsure, warming = calibrated(design, options.calibration, reject_ambient=options.reject_ambient)
        source, sizes, rest = "a calibration of this sensor", None, (np.zeros((len(coder.sigma),) * 2), 0.0)
    else:
        chosen = mechanics_sources.source_of(design, options.source)
        coder, unsure, warming = decoder(design, chosen.law, reject_ambient=options.reject_ambient), None, {}
        source = mechanics_sources.in_words(chosen)
        sizes = tolerances() if made is None else made
        at_rest = decode_tolerances.AtRest(coder, sizes)
        # the share of made sensors beyond a row below this is at least DOUBTFUL
        limit = float(at_rest.of_made[-math.ceil(decode_tolerances.DOUBTFUL * len(at_rest.of_made))])
        rest = at_rest.inverse, limit
    beams = None if array is None else beam_arrays.standing(coder.forward, array)
    code = code_of(coder, beams, calibrated=unsure is not None, warm=bool(warming))
    tables = _fitting(coder, room - code, code, flash, unsure, warming)
    errors = decoder_tables.errors_of(coder, tables)
    share = 100 * errors[1] / errors[2]
    if not share <= WORST:
        raise BadInput(
            f"the tables for --flash {flash} would miss {share:.2g} % of the largest force, more than {WORST:g} %: "
            "raise --flash, or keep the elements farther from the magnet (larger l0)"
        )
    scale = errors[1], *full_scale(needed, errors[2], "the largest force of the workspace")
    if needed is not None:
        scale = required_error(coder, tables, needed), *scale[1:]
    firmware = Firmware(coder, design, source, sizes, rest, tables, errors, scale, rated_forces(coder, needed), beams)
    return firmware if beams is None else dataclasses.replace(firmware, first_order=_first_order(firmware, beams))


def _first_order(firmware: Firmware, beams: BeamArray) -> tuple[float, float, float]:
    """Return largest and median error of the force, N, of beams not decoded jointly, and the share of the
    beams for which no force is found, in random poses of all beams at once, under rated loads at most."""
    coder, n = firmware.coder, len(beams)
    assert coder.mechanics is not None
    random = np.random.default_rng(1).uniform(coder.low, coder.high, (TRIED + 8 * FRAMES * n, 3)).T
    usual = random[:, ~beyond(firmware, random) & (random[2] < 0)][:, : FRAMES * n]
    shift = usual.T[: usual.shape[1] // n * n].reshape(-1, n, 3).copy()
    found = reference_of_array(coder, beams, beam_arrays.readings_of_array(beams, shift)).force
    error = np.linalg.norm(found - force_and_load(coder.mechanics, shift.reshape(-1, 3).T.copy())[0].T, axis=1)
    known = error[np.isfinite(error)]
    lost = 1 - len(known) / len(error) if len(error) else math.nan
    return (float(known.max()), float(np.median(known)), lost) if len(known) else (math.nan, math.nan, lost)


def reference_of_array(coder: Decoder, beams: BeamArray, fields: Array) -> Decoded:
    """Return what Python decodes to first order from fields (f, n, k), T, of an array."""
    stray = beam_arrays.readings_of_array(beams, np.zeros((1, len(beams), 3)), own=False)
    alone = beam_arrays.decoded_alone(coder, beams, fields - stray)
    first = beam_arrays.at_rest_where_unknown(alone, (*fields.shape[:2], 3))
    return beam_arrays.less_neighbours(coder, beams, fields, first)


def moments_of(design: Design) -> Array:
    """Return the moments K_n of a magnet, T mm^(n + 2), of the orders `MOMENTS`.

    The charges +-J on its faces have the potential sum K_n P_n(cos t) / d^(n + 1) outside the sphere around it; the
    integrals over a face are those of polynomials. The dipole's is J V / (4 pi).
    """
    radius, half = design.magnet_diameter / 2, design.magnet_height / 2
    nodes, weights = np.polynomial.legendre.leggauss(2 + max(MOMENTS))
    rho = radius * (nodes + 1) / 2
    d = np.hypot(rho, half)
    found = [d**n * np.polynomial.legendre.legval(half / d, np.eye(n + 1)[n]) @ (rho * weights) for n in MOMENTS]
    # two faces, 2 pi rho d rho, over 4 pi
    return np.asarray(-design.polarisation * radius / 2 * np.array(found))


def array_tables(beams: BeamArray) -> dict[str, Array]:
    """Return the constants of an array in C."""
    stray = beam_arrays.readings_of_array(beams, np.zeros((1, len(beams), 3)), own=False)[0]
    return {
        "beam_places": beams.pitch * np.pad(beams.layout, ((0, 0), (0, 1))),
        "poles": beams.poles,
        "moments": moments_of(beams.forward.design),
        "stray": stray * beams.poles[:, None],
    }


def rated_forces(coder: Decoder, needed: Requirements | None) -> tuple[float, float]:
    """Return the largest required normal force, and the largest force along the plate, N.

    Where nothing is required, they are those of the deepest press of the mechanics. Corners of the workspace lie
    beyond all samples: there polynomials may give a hundred times as much.
    """
    if needed is not None:
        return needed.force_z, needed.force_x or needed.friction * needed.force_z
    assert coder.mechanics is not None
    press = float(forces(coder.mechanics, np.array([[0.0], [0.0], [-coder.mechanics.sink]]))[0][2, 0])
    return press, mechanics_sources.LARGEST_FRICTION * press


def required_error(coder: Decoder, tables: Tables, needed: Requirements) -> float:
    """Return the largest error of the force by the tables under required loads, N; NaN if none is reached."""
    assert coder.mechanics is not None
    normal, aside = needed.loads(dense=True).T
    u, w = shifts_of_forces(coder.mechanics, coder.low, coder.high, aside, normal)
    ways = np.radians(np.arange(0.0, 360.0, DIRECTION))
    shift = np.stack([np.outer(np.cos(ways), u), np.outer(np.sin(ways), u), np.tile(w, (len(ways), 1))], axis=-1)
    return decoder_tables.errors_of(coder, tables, shift[:, np.isfinite(u)].reshape(-1, 3))[1]


def calibrated(
    design: Design, path: Path, *, reject_ambient: bool = False
) -> tuple[Decoder, Callable[[Array], Array], dict[str, Array]]:
    """Return the decoder of a calibration, what this leaves unsure of the force (n, 3), N, at shifts (n, 3), and the
    constants of its temperature, if its bench had one.

    What is unsure is half of a 90 % interval at T_0, with or without a zero, beside noise and fit of the mechanics.
    """
    from studies.calibration import calibrated_forces, calibration_file

    found = calibration_file.of_design(path, design, reject_ambient=reject_ambient)
    thermal = calibration_file.is_thermal(found)
    # the temperature may not be known
    coder = calibrated_forces.coder_of(found, warm=not thermal)

    def unsure(shift: Array) -> Array:
        wide = [calibrated_forces.widths_beside_noise(found, shift, zeroed=zeroed) for zeroed in (False, True)]
        return np.maximum(*wide)

    return coder, unsure, _warming(found) if thermal else {}


def half_widths(coder: Decoder, sigma: Array, shift: Array) -> Array:
    """Return half of the 90 % intervals of forces of slow loading at shifts (n, 3), N, shape (n, 3).

    They contain the noise of the readings, standard deviations `sigma` (k,) in T, and the fit of the mechanics.
    """
    law = coder.mechanics
    assert law is not None
    fit = np.array([law.errors[1], law.errors[1], law.errors[2]]) / 2
    slopes, by_shift = readings_with_slopes(coder.forward, shift.T.copy())[1], forces(law, shift.T)[1]
    noise = np.einsum("jin,jkn->nik", by_shift, spread(sigma, told_slopes(coder, slopes)))
    return np.asarray(QUANTILE * np.sqrt(np.square(noise).sum(axis=2) + fit**2))


def _warming(found: Fit) -> dict[str, Array]:
    """Return the constants of an estimated sensor's temperature: its two coefficients, 1/K, T_0, half of the 90 %
    intervals of a temperature that is not known, K, and of the coefficients' sum, 1/K; the ambient field, T.

    A share of the field has an error of the coefficients times T - T_0, which adds to all others here: more than its
    root of a sum of squares, whatever the correlation.
    """
    from studies.calibration import calibrated_forces

    sensor, names = found.sensor, ("remanence_per_K", "gain_per_K")
    at = [sensor.unknowns.names.index(name) for name in names]
    of_sum = math.sqrt(max(float(found.covariance[np.ix_(at, at)].sum()), 0.0))
    wide = QUANTILE * calibrated_forces.UNKNOWN
    values = [*found.theta[at].tolist(), sensor.temperature_C, wide, QUANTILE * of_sum]
    return {"warming": np.array(values), "ambient": np.array(list(calibrated_forces.ambient_of(found).values()))}


def _fitting(
    coder: Decoder,
    room: int,
    code: int,
    flash: str,
    unsure: Callable[[Array], Array] | None,
    warming: Mapping[str, Array],
) -> Tables:
    """Return the largest tables that fit into the room, bytes, which the code leaves."""
    doubt = decode_readings.TENTH if coder.forward.design.prony else decode_readings.HALF
    for cells, knots in SIZES:
        tables = decoder_tables.tables_of(coder, cells, (knots, knots), doubt, unsure, warming)
        if tables.size <= room:
            return tables
    raise BadInput(
        f"--flash {flash} is too small: the smallest decoder of this design takes {tables.size + code} bytes, "
        f"{code} of them code"
    )


def reference(coder: Decoder, made: Tolerances | None, outputs: Array, times: Array | None = None) -> dict[str, Any]:
    """Return what Python decodes from outputs of the elements (n, 3): status, shift, tilt, force, poses; and the
    field, T, of a decoder that rejects one (ambient).

    times : shape (n,), s; with them, the force is that of a silicone that relaxes.
    """
    field = field_of(coder.forward.elements, outputs)
    found = decode(coder, field, follow=True)
    status = found.status if made is None else decode_tolerances.check(coder, field, found, made).status
    force = found.force
    if times is not None:
        status, force = time_series.over_time(coder, times, field, status, found.force, found.load)
    answer = {"status": status, "shift": found.shift, "tilt": found.tilt, "force": force}
    if coder.field_fit is not None:
        answer["ambient"] = ambient_of(coder, field, found.shift)[0]
    return answer | {"poses": found.multiplicity}


def outputs_at(coder: Decoder, shift: Array) -> Array:
    """Return outputs of the elements (n, 3) at shifts (3, n), mm, in float as C gets them, as double."""
    elements = coder.forward.elements
    null, gain = (np.array([getattr(e, name) for e in elements]) for name in ("null", "gain"))
    outputs = null + gain * readings_at(coder.forward, np.ascontiguousarray(shift)).T
    return outputs.astype(np.float32).astype(np.float64)


def vectors(firmware: Firmware) -> list[dict[str, Any]]:
    """Return test vectors: poses with rated forces and bad readings, then a time series with a gap and a jump.

    Column `seconds` is empty for single rows; a series begins with 0.
    """
    coder, rng = firmware.coder, np.random.default_rng(1)
    low, high = coder.low, coder.high
    # above the height at rest, where rounding decides whether there is a force
    clear = high[2] / 2
    random = rng.uniform(low, high, (TRIED, 3)).T
    chosen = random[:, ~beyond(firmware, random)][:, :30]
    single = outputs_at(coder, np.column_stack([[0.0, 0.0, clear], chosen]))
    bad = np.array([[1.1 * e.high for e in coder.forward.elements], single[1], 2 * single[2] - single[3]])
    bad[1, 1] = np.nan
    single = np.concatenate([single, bad])
    t = np.linspace(0, 1, 60)
    path = np.stack([0.4 * high[0] * np.sin(5 * t), 0.3 * high[1] * np.sin(8 * t), 0.4 * low[2] * np.sin(3 * t)])
    at_rest = np.array([[0.0], [0.0], [clear]])
    # as far as the forces are rated
    shares = (share for share in np.linspace(1, 0, 21) if not beyond(firmware, share * path + at_rest).any())
    path = next(shares) * path + at_rest
    series = outputs_at(coder, path)
    series[30, 0], series[40] = np.nan, series[10]
    times = (0.01 * np.arange(60) + 0.05 * (np.arange(60) >= 50)).astype(np.float32).astype(np.float64)
    names = [f"{name}_{coder.forward.elements[0].unit}" for name in columns(coder.forward.elements)]
    rows = []
    for outputs, at in ((single, None), (series, times)):
        found = reference(coder, firmware.made, outputs, at)
        for k, output in enumerate(outputs.tolist()):
            seconds = math.nan if at is None else float(at[k] - at[max(k - 1, 0)])
            row = {**dict(zip(names, output, strict=True)), "seconds": seconds, "status": found["status"][k]}
            for name, unit in (("shift", "mm"), ("force", "N")):
                row |= {f"{name}_{axis}_{unit}": v for axis, v in zip("xyz", found[name][k].tolist(), strict=True)}
            rows.append(row)
    return rows


def beyond(firmware: Firmware, shift: Array) -> NDArray[np.bool_]:
    """Return whether the forces of slow loading at shifts (3, n), mm, exceed the rated ones; not without one."""
    assert firmware.coder.mechanics is not None
    force, _, _ = force_and_load(firmware.coder.mechanics, np.ascontiguousarray(shift))
    normal, aside = firmware.rated
    return np.asarray((force[2] > normal) | (np.hypot(force[0], force[1]) > aside))


# C text


def number(value: float) -> str:
    """Return a number as a constant of C, float.

    >>> number(0.1), number(1e-7), number(3), number(float("nan"))
    ('0.1f', '1e-07f', '3.0f', 'NAN')
    """
    return "NAN" if math.isnan(value) else f"{np.float32(value)!s}f"


def _braces(values: Any) -> str:
    if isinstance(values, list):
        return "{" + ", ".join(map(_braces, values)) + "}"
    return number(values) if isinstance(values, float) else str(values)


def declaration(name: str, values: NDArray[Any]) -> str:
    """Return the declaration of a constant array, in lines of at most 120 characters."""
    kind = {"f": "float", "i": "int16_t", "u": "uint8_t"}[values.dtype.kind]
    dims = "".join(f"[{n}]" for n in values.shape)
    text = f"static const {kind} {name}{dims} = {_braces(values.tolist())};"
    return "\n    ".join(re.findall(r".{1,114}(?:\s|$)", text)).replace(" \n", "\n")


def header(firmware: Firmware, command: str) -> str:
    """Return the text of magtip_decoder.h."""
    coder, tables = firmware.coder, firmware.tables
    design, elements, floats = firmware.design, coder.forward.elements, tables.floats
    diagonal = float(np.linalg.norm(floats["edge"]))
    inverse, limit = firmware.rest
    arrays: dict[str, NDArray[Any]] = {**floats, "at_rest": inverse.astype(np.float32), **tables.integers}
    if firmware.array is not None:
        arrays |= {name: values.astype(np.float32) for name, values in array_tables(firmware.array).items()}
    largest = float(np.abs(readings_at(coder.forward, np.stack([coder.low, coder.high], axis=1))).max())
    numbers = {
        "share": len(elements) / len(floats["places"]),
        "apart_2": (0.8 * diagonal) ** 2,
        "farthest": 0.5 + decoder_tables.margin_of(coder),
        "short": SHORT * design.D,
        "scale": 1e-3 * design.D,
        "fit_2": (FIT * design.D) ** 2,
        "rounding_2": (ROUNDING * largest) ** 2,
        "reach": REACH * diagonal,
        "probe": 0.03 * diagonal,
        "longest": design.D / 16,
        "edge": EDGE * design.D + firmware.errors[0],
        "rest": REST * design.D,
        "same": SAME * design.D,
        "quantile": QUANTILE,
        "jump": time_series.JUMP,
        "late": time_series.LATE,
        "chi": limit,
        "coldest": COLDEST,
        "hottest": HOTTEST,
    }
    counts = {
        "branches": len(floats["branches"]),
        "recent": time_series.RECENT,
        "repeats": time_series.REPEATS,
        "field": floats["spline"].shape[1:3],
        "cells": tables.cells,
        "nodes": [n + 1 for n in tables.cells],
        "corners": [int(np.ravel_multi_index(tuple(c), [n + 1 for n in tables.cells])) for c in pose_search.CORNERS],
        "points": len(floats["places"]),
        "folds": len(coder.table.corners) > 0,
        "twins": len(coder.table.corners) > 0 and len(elements) == 3,
        "elements": len(elements),
        "calibrated": "unsure" in tables.integers,
        "thermal": firmware.is_warm,
        "rejects": coder.field_fit is not None,
        "beams": 0 if firmware.array is None else len(firmware.array),
        "starts": STARTS,
        "evaluations": EVALUATIONS,
    }
    return rendered(
        "magtip_decoder.h.j2",
        **_told(firmware, command),
        **{name: number(value) for name, value in numbers.items()},
        arrays=[declaration(f"magtip_{name}", values) for name, values in arrays.items()],
        shape={name: list(values.shape) for name, values in floats.items()},
        n=counts,
        design=design_text(design).splitlines(),
        noise=with_noise(elements)[1],
        first_order=firmware.first_order,
        unknown_K=f"{floats['warming'][3]:.0f}" if firmware.is_warm else "",
    )


def rendered(template: str, **values: Any) -> str:
    return page_templates.rendered(Path(__file__).with_name(template), **values) + "\n"


def _told(firmware: Firmware, command: str) -> dict[str, Any]:
    """Return what pages and comments say of an export."""
    elements, shift = firmware.coder.forward.elements, firmware.errors[0]
    design = firmware.design
    return {
        "command": command,
        "digest": digest(dataclasses.asdict(design)),
        "layout": design.hall_layout,
        "names": [e.name for e in elements],
        "unit": elements[0].unit,
        "source": firmware.source,
        "regression": False,
        "beams": 0 if firmware.array is None else len(firmware.array),
        "calibrated": firmware.made is None,
        "thermal": firmware.is_warm,
        "statuses": STATUSES,
        "rails": (elements[0].low, elements[0].high),
        "average": elements[0].average,
        "doubt_percent": 100 * float(firmware.tables.floats["slow"][3]),
        "example": example_of(design),
        "table_bytes": firmware.tables.size,
        "code_bytes": firmware.code,
        "state_bytes": firmware.state,
        "shift_um": 1e3 * shift,
        "force_percent": firmware.percent,
        "full": firmware.scale[1],
        "of_what": firmware.scale[2],
        "low": firmware.coder.low.tolist(),
        "high": firmware.coder.high.tolist(),
    }


def example_of(design: Design) -> str:
    if design.chip_count > 1:
        return OTHER
    return next((name for start, name in EXAMPLES.items() if design.hall_layout.startswith(start)), OTHER)


def vectors_header(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the test vectors as constants of C."""
    table = np.array([[v for key, v in row.items() if key != "status"] for row in rows], dtype=np.float32)
    numbers = np.array([STATUSES.index(row["status"]) for row in rows], dtype=np.uint8)
    arrays: dict[str, NDArray[Any]] = {
        "readings": table[:, :-7],
        "seconds": table[:, -7],
        "status": numbers,
        "answers": table[:, -6:],
    }
    declared = [declaration(f"magtip_vector_{name}", values) for name, values in arrays.items()]
    return rendered("magtip_vectors.h.j2", arrays=declared, count=len(rows))


def vectors_table(rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if v != v else v for key, v in row.items()} for row in rows)
    return text.getvalue()


def texts(firmware: Firmware, command: str) -> dict[str, str]:
    """Return the texts of all files of the library by their names."""
    rows, told = vectors(firmware), _told(firmware, command)
    found = {HEADER: header(firmware, command), VECTORS: vectors_header(rows), PLAIN[2]: vectors_table(rows)}
    return found | surroundings(told)


def surroundings(told: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts around header and test vectors by their names: the library's description and its sketches."""
    found = {name: rendered(f"{name}.j2", **told) for name in PLAIN[3:]}
    for name, template in (("SelfTest", "SelfTest"), (told["example"], "sketch")):
        found[f"examples/{name}/{name}.ino"] = rendered(f"{template}.ino.j2", **told)
    return found


def run(
    design: Design,
    options: Exporting,
    made: Tolerances | None,
    needed: Requirements | None,
    array: ArrayDesign | None,
    command: str,
    more: Mapping[str, Writer],
    progress: Progress,
) -> Result:
    """Return the library with the decoder of a design, and `more` files.

    needed : requirements of the design, of whose press errors are percentages; None without any.
    """
    progress(0.0, "tables")
    firmware = prepare(design, options, made, needed, array)
    progress(0.5, "test vectors")
    files = {name: partial(write_text, text=text) for name, text in texts(firmware, command).items()}
    force, full, of_what = firmware.scale
    assert firmware.coder.mechanics is not None
    fit_error = max(firmware.coder.mechanics.errors[1:3])
    record = {
        "status": "ok",
        "digest": digest(dataclasses.asdict(design)),
        "flash_bytes": firmware.flash,
        "table_bytes": firmware.tables.size,
        "state_bytes": firmware.state,
        "table_error_mm": firmware.errors[0],
        "table_error_N": force,
        "table_error_percent": firmware.percent,
        "full_scale_N": full,
        "full_scale": of_what,
        "fit_error_N": fit_error,
        "fit_error_percent": 100 * fit_error / full,
        "example": example_of(design),
    }
    off = "" if options.calibration else "; what a made sensor differs from the design comes on top: calibrate it"
    remark = (
        f"the tables add {force:.1g} N to the error of the mechanics ({firmware.source}), which the decoder's "
        f"polynomials miss by up to {fit_error:.2g} N, {shown(fit_error / full, 'percent', 2)} of {of_what} "
        f"({full:.4g} N){off}"
    )
    remarks = [remark]
    if firmware.is_warm:
        wide = float(firmware.tables.floats["warming"][3])
        remarks.append(
            "give the decoder the temperature by magtip_set_temperature: without it the intervals hold for "
            f"{wide:.0f} K more or less"
        )
    if firmware.array is not None:
        worst, median, lost = firmware.first_order
        record |= {"beams": len(firmware.array), "first_order_N": worst, "first_order_median_N": median}
        record["first_order_no_force_percent"] = 100 * lost
        remarks.append(
            f"magtip_array_step decodes {len(firmware.array)} beams to first order, which adds an error of up to "
            f"{worst:.2g} N, {median:.2g} N in the median, in random poses of all beams under rated loads at most: "
            f"{100 * lost:.2g} % of the beams have no force then; test vectors and sketch are those of one beam"
        )
    return Result(
        title="Firmware",
        records=[record],
        shown=[Table(title="Firmware", rows=[record])],
        remarks=remarks,
        files={**files, **more},
    )
