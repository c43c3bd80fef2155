"""Decode readings: a design's decoder with its mechanics, one set of readings, and a table of them row by row.

A force is compared with that by level finite of the formulas at the same pose. Forces in N, lengths in mm.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analytic import beam, time_series
from analytic.decode import ambient_of, decode, decoder, exceeded_limit, field_of, poses_outside
from analytic.hall import at_rail
from analytic.inverse import response_surface
from analytic.parts import columns
from analytic.time_series import RelaxingForce, zero_offset, zeroed
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, tilts_of
from geometry.relaxation import Relaxation, moduli, relaxation_of
from studies.beam.beam_model import mechanics, motions
from studies.beam.formula_beams import FormulaBeams
from studies.inputs import table_input, user_input
from studies.inputs.option_groups import Decoding
from studies.output import atomic_files, console, page_templates
from studies.output.records import FlatRow
from studies.output.result import Result, failure_of, of_record
from studies.sensing.field_readings import read_rows, write_rows

if TYPE_CHECKING:
    from analytic.decode import Decoded, Decoder, Limit, Status
    from analytic.inverse.response_surface import Mechanics
    from analytic.parts import Element

sentences = partial(page_templates.sentences, Path(__file__).with_name("sentences.j2"))
RESPONSES, NO_LEVEL = "responses", "none"
"""Names in place of a level: states give the mechanics, and there are no mechanics."""
BEST = "finite"
"""The level with which the others are compared."""
APART = 0.1
"""Difference of the forces, over that of level finite, above which a warning is given."""
MISFIT = 0.1
"""Largest misfit of a level's force, over the force at half the depth of level finite, with which samples go on."""
WHY = {
    "ok": "",
    "ambiguous": "several poses give these readings: the result is the pose nearest to rest, and poses_mm lists all",
    "out_of_workspace": "no pose of the magnet in the workspace gives these readings: check their order and units",
    "saturated": "a reading is saturated (at a rail of its element), so the pose is unknown: check its unit,"
    " or press and shear less",
    "not_finite": "a reading is missing or not a finite number",
    "tension": "the pose is known but its load is not, because the plate would have to pull on the tip there:"
    " give states over more depths and shears",
    "frozen": "an element repeats its reading without its noise, so the load is not known: check the element and its"
    " wiring",
    "after_gap": "rows before it are missing or have no force; the force takes the motion between for straight",
    "jump": "a reading changed ten times as much as in the rows before: an impact, a reset or a disturbance",
    "untimed": "the time is not known, so the force is that of slow loading, which a fast press exceeds: give the"
    " device's time (--clock)",
    "uncalibrated": "the force may be one of the tolerances of a built sensor at rest: calibrate the sensor",
    "out_of_range": "readings, force or temperature lie beyond those of the bench: the force of the regression is"
    " extrapolated there, and its interval is not known; add such presses, or rows at rest, to the bench, or"
    " calibrate by the model",
    "inconsistent": "no pose explains all readings together: check their order, units and the ambient field",
}
WITH_POSE = {"ok", "ambiguous", "uncalibrated", "after_gap", "jump", "untimed", "out_of_range"}
"""Statuses with a pose and a load, or of a regression with a force."""
NO_CONTACT = (
    "the plate does not touch the tip at this pose (depth 0), so the load is 0: the shift of {:.2g} mm sideways "
    "comes from rounding or noise of the readings, an ambient field, or something other than the plate"
)


def limit_sentence(coder: Decoder, limit: Limit | None, source: Source) -> str:
    """Return a sentence: why readings are out of the workspace, and what to do.

    Parameters
    ----------
    limit : the limit that the pose exceeds; None if there is no pose outside the workspace either.
    """
    if limit is None:
        return WHY["out_of_workspace"]
    known = {"low": coder.low.tolist(), "high": coder.high.tolist(), "solved": source.name == RESPONSES}
    return sentences("limit", limit=limit, kind=source.kind, **known)[0]


def result(record: FlatRow) -> Result:
    """Return the result of one decoded set of readings; without a pose it has failed."""
    found = of_record("Decoded", record)
    warnings = [*found.warnings, *([record["message"]] if record["status"] == "ambiguous" else [])]
    lost = [] if record["status"] in WITH_POSE else failure_of([record])
    return dataclasses.replace(found, warnings=warnings, failures=lost)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Source:
    """Mechanics of a decoder and where they come from.

    Attributes
    ----------
    name : a level of the formulas, "surrogate", "fem", or RESPONSES for states in a file.
    reason : why it is this source, in words.
    half_width : the half width of the 90 % interval of the force under a load, over the force; None where the source
        has no intervals.
    warning : what speaks against the forces of this source; empty where nothing does.
    chosen : whether nobody asked for this source: it is the best one that covers the design.
    """

    name: str
    law: Mechanics
    reason: str
    half_width: Callable[[Load], float] | None = None
    warning: str = ""
    chosen: bool = False

    @property
    def is_formula(self) -> bool:
        return self.name in beam.LEVELS

    @property
    def kind(self) -> str:
        """What ends where its forces end, in words."""
        if self.is_formula:
            return "formulas"
        return {RESPONSES: "states", "fem": "solved states"}.get(self.name, self.name)

    @property
    def said(self) -> list[str]:
        """Name and reason, in a sentence, if the source was chosen."""
        return [f"level {self.name}: {self.reason}"] * self.chosen


def prepare(design: Design, source: Source, *, ignore_tilt: bool = False, reject_ambient: bool = False) -> Decoder:
    """Return the decoder of a design with the mechanics of a source."""
    warn_if_upright(source.law, ignore_tilt=ignore_tilt)
    return decoder(design, source.law, ignore_tilt=ignore_tilt, reject_ambient=reject_ambient)


def warn_if_upright(law: Mechanics | None, *, ignore_tilt: bool) -> None:
    """Warn if --ignore-tilt has no effect because the mechanics have no tilt."""
    if ignore_tilt and law is not None and not law.tau.any():
        user_input.say_no_effect("--ignore-tilt", "the tilt is zero in these formulas or states")


def of_level(design: Design, level: str) -> Mechanics:
    """Return the mechanics of a level of the formulas, over the workspace or up to the limits of the formulas.

    The force of a thin layer below a large magnet grows by orders of magnitude beyond the depths of level finite
    (`analytic.beam.DEEPEST`). Where no polynomial follows that, the samples end there.
    """
    if level not in beam.LEVELS:
        raise BadInput(f"level must be one of {', '.join(beam.LEVELS)}; got {level!r}")
    # the paper's magnet follows the tip by H/L; the other levels bend too much beyond the paper's own range of loads
    widest = 3 / 8 * design.D * (design.L / design.H if level == "paper" else 1.0)
    deepest = min(widest, design.R, 0.9 * (design.L - design.magnet_height))

    def fitted(deepest: float) -> Mechanics:
        depth, shear = (each[None] for each in response_surface.loads_between(deepest, widest))
        return mechanics(motions(FormulaBeams(level, [design]), [design], depth, shear), depth, shear)

    law, known = fitted(deepest), min(deepest, beam.DEEPEST * design.D)
    # a level that does not carry a press of half this depth has no other samples
    with contextlib.suppress(BadInput):
        if law.errors[2] > MISFIT * beam.solve(design, Load(known / 2), level).force[2]:
            return fitted(known)
    return law


def of_file(path: Path, design: Design) -> Mechanics:
    """Return the mechanics of the converged states in a file; the states must belong to this design."""
    samples = [
        (state.load, state.response)
        for state in table_input.read_states(path, design)
        if state.status in ANSWERED and state.load is not None and state.response is not None
    ]
    try:
        return response_surface.of_samples(samples)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


def decode_text(coder: Decoder, text: str, decoding: Decoding, source: Source) -> tuple[FlatRow, Array, Decoded]:
    """Decode one set of readings a,b,c, by the mechanics of a source.

    Returns
    -------
    record : for the user. contact : whether the plate touches the tip; None if the load is unknown. condition :
        condition number of the readings with respect to the shift. multiplicity : number of poses that have these
        readings; poses_mm lists their shifts. noise_um, noise_N : standard deviations of shift and force that the
        elements' noise causes; noise_N_per_N : over the size of the force, NaN without one. finite_force_N : force
        by level finite at this pose; None if it is not compared. beyond : limit of the workspace that the pose
        exceeds; outside_mm : shift of the pose outside the workspace, NaN without one. fit_error_rad, fit_error_N :
        errors of the polynomials for tilt and force; None without mechanics. level_half_width_N : half width of the
        90 % interval of the force by the source at this load; None where it has none.
    field, decoded : the readings, shape (1, k), T, and what was decoded from them.
    """
    elements = coder.forward.elements
    values = user_input.parse_numbers("--readings", text)
    if len(values) != len(elements):
        names = ",".join(element.name for element in elements)
        raise BadInput(f"--readings takes {len(elements)} numbers, {names}; got {len(values)} in {text!r}")
    field = in_tesla(elements, [values], decoding.units)
    decoded = decode(coder, field)
    tilt, tilt_y = tilts_of(*decoded.tilt[0].tolist())
    depth, shear, shear_y = decoded.load[0].tolist()
    contact = None if math.isnan(depth) else depth > 0
    gap, size = force_gap(coder, source.name, decoded.shift, decoded.force), math.hypot(*decoded.force[0].tolist())
    ambient = ambient_columns(coder, field, decoded.shift)[0].tolist()
    record = {
        "status": decoded.status[0],
        "message": "",
        "level": source.name,
        "level_reason": source.reason,
        "readings_T": field[0].tolist(),
        "shift_mm": decoded.shift[0].tolist(),
        "tilt_rad": tilt,
        "tilt_y_rad": tilt_y,
        "rotation_rad": decoded.tilt[0].tolist(),
        "force_N": decoded.force[0].tolist(),
        "finite_force_N": None if gap is None or source.name == BEST else gap.finite[0].tolist(),
        "contact": contact,
        "depth_mm": depth,
        "shear_mm": shear,
        "shear_y_mm": shear_y,
        "condition": float(decoded.condition[0]),
        "multiplicity": int(decoded.multiplicity[0]),
        "poses_mm": decoded.poses.tolist(),
        "noise_um": (1e3 * decoded.noise_mm[0]).tolist(),
        "noise_N": decoded.noise_N[0].tolist(),
        "noise_N_per_N": [noise / size if size else math.nan for noise in decoded.noise_N[0].tolist()],
        "beyond": None,
        "outside_mm": None,
        "workspace_mm": [coder.low.tolist(), coder.high.tolist()],
        "fit_error_rad": coder.mechanics.errors[0] if coder.mechanics else None,
        "fit_error_N": max(coder.mechanics.errors[1:3]) if coder.mechanics else None,
        "level_half_width_N": _half_width(source, decoded.load[0], size),
        **ambient_record(ambient),
        "warnings": [*[source.warning] * bool(source.warning), *level_warnings(source.name, gap)],
    }
    return record | _why(coder, field, decoded, source, contact=contact), field, decoded


def ambient_columns(coder: Decoder, field: Array, shift: Array) -> Array:
    """Return `AMBIENT_COLUMNS`, (n, 6), of rows of readings (n, k), T, with shifts (n, 3), mm; (n, 0) where no field
    is rejected."""
    if coder.field_fit is None:
        return np.empty((len(field), 0))
    found, deviation = ambient_of(coder, field, shift)
    return 1e6 * np.hstack([found, QUANTILE * deviation])


def ambient_record(row: Sequence[float]) -> FlatRow:
    """Return the keys of one row of `ambient_columns`; none where it is empty."""
    return {"ambient_uT": list(row[:3]), "ambient_half_width_uT": list(row[3:])} if row else {}


def _half_width(source: Source, load: Array, size: float) -> float | None:
    """Return the half width of the 90 % interval of a force of a size, N, by a source at a load (3,), mm."""
    if source.half_width is None or not size > 0:
        return None
    depth, x, y = load.tolist()
    return size * source.half_width(Load(depth, x, y, friction="stick"))


def _why(coder: Decoder, field: Array, decoded: Decoded, source: Source, *, contact: bool | None) -> FlatRow:
    (status,) = decoded.status
    found: FlatRow = {"message": WHY[status]}
    if status == "out_of_workspace":
        (pose,) = poses_outside(coder, field)
        limit = exceeded_limit(coder, pose)
        message = limit_sentence(coder, limit, source)
        found = {"message": message, "beyond": limit, "outside_mm": pose.tolist()}
    if contact is False:
        said = NO_CONTACT.format(math.hypot(*decoded.shift[0, :2]))
        found["message"] = "; ".join(filter(None, [found["message"], said]))
    return found


def in_tesla(elements: Sequence[Element], values: Any, units: str | None) -> Array:
    """Convert readings, shape (n, k), in V, T or (`units` None) the elements' own unit to flux densities, T."""
    unit = elements[0].unit
    if units in (None, unit):
        return field_of(elements, values)
    if units == "V":
        raise BadInput(
            "the output of these elements is a flux density: leave --units V out and give the readings in T"
        )
    return np.asarray(values, dtype=np.float64)


POSE_COLUMNS = ["status", "shift_x_mm", "shift_y_mm", "shift_z_mm", "tilt_rad", "tilt_y_rad"]
LOAD_COLUMNS = ["force_x_N", "force_y_N", "force_z_N", "depth_mm", "shear_mm", "shear_y_mm"]
COLUMNS = [*POSE_COLUMNS, *LOAD_COLUMNS, "condition", "multiplicity", "level"]
"""Columns that decoding adds to a table of readings."""
TIME_COLUMNS = ["relaxing_x_N", "relaxing_y_N", "relaxing_z_N", "law_error_N"]
"""Columns that it adds to one with `time_s`: the part of the force that slow loading does not have, and how much the
force changes with a `doubted` law."""
AMBIENT_COLUMNS = [f"ambient_{name}{axis}_uT" for name in ("", "half_width_") for axis in "xyz"]
"""Columns that it adds where an ambient field is rejected: that field, and half of its 90 % interval by noise."""
QUANTILE = 1.6449
"""Half width of a 90 % interval of a normal distribution over its standard deviation."""
HALF, TENTH = 0.5, 0.1
"""Share by which an assumed loss factor, and measured branches, may be off in `law_error_N`."""
MOST_SEARCHED = 2000
"""Number of rows out of the workspace whose poses are searched outside it: a limit of the time, not of the result."""
MANY = 500
"""Number of rows from which a terminal shows the progress."""


def decode_file(
    coder: Decoder,
    decoding: Decoding,
    source: Source,
    out: Path | None,
    check: Callable[[Array, Decoded], tuple[list[Status], list[str]]],
    *,
    as_json: bool = False,
) -> Result:
    """Decode a table of readings as a stream, add the columns `COLUMNS` and count the rows of each status.

    Without `out` the table is printed; as JSON, one object for each row with its number and its readings. Columns
    other than those of the elements, in their order, are copied. A row with an empty or NaN reading gets the status
    not_finite. `check` returns the status of each row, which may differ from the decoder's, and warnings. A row
    without an answer is a failure.
    """
    elements = coder.forward.elements
    assert decoding.file is not None
    unit = decoding.units or elements[0].unit
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    heads = {kind: [f"{name}_{kind}" for name in columns(elements)] for kind in ("V", "T")}
    second_unit = "T" if unit == "V" else "V"
    head, rows, values = read_rows(
        decoding.file,
        heads[unit],
        [*COLUMNS, *TIME_COLUMNS, *AMBIENT_COLUMNS],
        holes=True,
        instead={f"--units {second_unit}": heads[second_unit]} if elements[0].unit == "V" else {},
    )
    field, times = in_tesla(elements, values, unit), times_of(decoding, head, rows)
    if decoding.zero is not None:
        full = at_rail(elements, field.T).T
        offset = zero_offset(coder, np.where(full, np.nan, field)[rows_at_rest(decoding, field, times, full)])
        field, coder = field + offset, zeroed(coder, offset)
    with console.progress(as_json=as_json) if len(rows) >= MANY else contextlib.nullcontext() as progress:
        if progress is not None:
            progress(0.0, f"poses of {len(rows)} rows")
        decoded = slow = decode(coder, field, follow=True)
    statuses, said = check(field, slow)
    ambient, relaxing = ambient_columns(coder, field, slow.shift), np.empty((len(rows), 0))
    added = AMBIENT_COLUMNS[: ambient.shape[1]]
    if times is not None:
        force, statuses, relaxing = over_time(coder, field, times, slow.force, slow.load, statuses)
        decoded = dataclasses.replace(slow, force=force, load=np.where(np.isnan(force[:, 2:]), np.nan, slow.load))
        added = [*TIME_COLUMNS, *added]
        said = [*said, *law_sentences(coder.forward.design, relaxing)]
    tilt, tilt_y = tilts_of(*decoded.tilt.T)
    parts = (decoded.shift, tilt, tilt_y, decoded.force, decoded.load, decoded.condition, relaxing, ambient)
    names = [*COLUMNS[:-2], *added, *COLUMNS[-2:]]
    numbers = zip(statuses, np.column_stack(parts).tolist(), decoded.multiplicity.tolist(), strict=True)
    found = [(status, *line, count, source.name) for status, line, count in numbers]
    result = partial(_result, coder, slow, field, source, statuses, said)
    if as_json and target is None:
        rows_of = enumerate(zip(field.tolist(), found, strict=True), 1)
        console.report(
            [{"row": k, "readings_T": b} | dict(zip(names, row, strict=True)) for k, (b, row) in rows_of],
            as_json=True,
        )
        return result(printed=True)
    write_rows(target, [*head, *names], rows, found)
    return result(printed=target is None)


def times_of(decoding: Decoding, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Array | None:
    """Return the column time_s of a table's rows (n,), s, ascending; None without one."""
    if "time_s" not in head:
        return None
    at, last = head.index("time_s"), -math.inf
    times = np.empty(len(rows))
    for k, row in enumerate(rows):
        value = table_input.number(row[at])
        if value is None or not last <= value < math.inf:
            raise BadInput(
                f"{decoding.file}, row {k + 1}: time_s must be a number of s, not below that of the row before; got "
                f"{row[at]!r}"
            )
        times[k] = last = value
    return times


def rows_at_rest(
    decoding: Decoding, readings: Array, times: Array | None, full: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which rows (n,) of readings (n, k), of which some are `full` (at a rail), lie in the time of --zero."""
    text = decoding.zero or ""
    if times is None:
        raise BadInput(f"--zero needs the time of each row: {decoding.file} has no column time_s")
    ends = user_input.parse_numbers("--zero", text)
    if len(ends) == 1:
        ends = [float(times[0]), *ends]
        if not ends[0] < ends[1]:
            raise BadInput(
                f"--zero {text} takes no row for rest, since the first one is at {ends[0]:g} s: give a later time "
                "TO, until which nothing touches the sensor, or leave --zero out"
            )
    if len(ends) != 2 or not ends[0] < ends[1]:
        raise BadInput(f"--zero takes times FROM,TO in s, the first one before the second, or TO alone; got {text!r}")
    inside = (ends[0] <= times) & (times <= ends[1])
    if not (np.isfinite(readings) & ~full)[inside].any(axis=0).all():
        raise BadInput(
            f"--zero {text}: no row with readings lies in this time, or an element has none within its rails; the "
            f"rows go from {times[0]:g} to {times[-1]:g} s"
        )
    return np.asarray(inside)


def over_time(
    coder: Decoder, field: Array, times: Array, slow: Array, load: Array, statuses: Sequence[Status]
) -> tuple[Array, list[Status], Array]:
    """Return forces (n, 3) of a silicone that relaxes, the statuses of their rows, and `TIME_COLUMNS` (n, 4).

    `field`, `slow`, `load`: of rows at times (n,), s: readings (n, k), T, and force of slow loading (n, 3) with its
    load.
    """
    found, force = time_series.over_time(coder, times, field, statuses, slow, load)
    known = np.where(np.array(found)[:, None] == "frozen", np.nan, slow)
    return force, found, np.column_stack([force - slow, law_errors(coder.forward.design, times, known, load, force)])


def most_growth(design: Design) -> float:
    """Return by how much an error of the force of slow loading, by the design's E, may grow in one that relaxes."""
    return moduli(design)[1] / design.E_now / relaxation_of(design).rest


def law_errors(design: Design, times: Array, slow: Array, load: Array, force: Array) -> Array:
    """Return how much forces (n, 3) at times (n,), s, would change (n,), N, with a `doubted` law."""
    off = np.zeros(len(force))
    for branches in doubted_branches(design):
        law = RelaxingForce(design, branches)
        rows = zip(times.tolist(), slow, load[:, 1:], strict=True)
        off = np.maximum(off, np.linalg.norm([law.step(*row) for row in rows] - force, axis=1))
    return off


def doubted_branches(design: Design) -> list[Relaxation]:
    """Return the branches of an assumed loss factor that is off by HALF, or measured ones that are off by TENTH."""
    known = relaxation_of(design)
    off = TENTH if design.prony else HALF
    grown = [np.array(known.shares) / known.rest * (1 + sign * off) for sign in (-1, 1)]
    # the modulus of slow loading stays: shares of the long-term modulus grow, not those of the instantaneous one
    return [Relaxation(tuple((g / (1 + g.sum())).tolist()), known.times, known.covered) for g in grown]


def law_sentences(design: Design, relaxing: Array) -> list[str]:
    """Return how much of the forces `TIME_COLUMNS` (n, 4) say that the silicone relaxes, and how sure that is."""
    if not relaxation_of(design).times or not np.isfinite(relaxing).any():
        return []
    part, off = float(np.nanmax(np.linalg.norm(relaxing[:, :3], axis=1))), float(np.nanmax(relaxing[:, 3]))
    return sentences("law", most=part, off=off, design=design, tenth=100 * TENTH)


def _result(
    coder: Decoder,
    decoded: Decoded,
    field: Array,
    source: Source,
    statuses: list[Status],
    said: list[str],
    *,
    printed: bool,
) -> Result:
    gap = force_gap(coder, source.name, decoded.shift, decoded.force)
    counts: dict[str, int] = {name: statuses.count(name) for name in WHY if name in statuses}
    remarks, failures = source.said, list[str]()
    for status, count in counts.items():
        why = [WHY[status]]
        if status == "out_of_workspace":
            rows = [k for k, word in enumerate(decoded.status) if word == "out_of_workspace"][:MOST_SEARCHED]
            limits = Counter(exceeded_limit(coder, pose) for pose in poses_outside(coder, field[rows]))
            texts = {limit: limit_sentence(coder, limit, source) for limit in limits}
            why = [texts[limit] + (f" ({n} of {count})" if len(texts) > 1 else "") for limit, n in limits.items()]
        if status != "ok":
            said_of = remarks if status in WITH_POSE else failures
            said_of.append(f"{count} of {len(statuses)} rows {status}: {'; '.join(why)}")
    if len(failures) > 1:
        unknown = sum(count for status, count in counts.items() if status not in WITH_POSE)
        failures.append(f"{unknown} of {len(statuses)} rows have no answer")
    return Result(
        title="Decoded",
        records=[] if printed else [counts],
        shown=[],
        warnings=[*[source.warning] * bool(source.warning), *level_warnings(source.name, gap), *said],
        remarks=remarks,
        failures=failures,
    )


# The force of a level beside that of level finite
#
# The levels below finite assume small loads, and level paper a bar without contact or magnet: on the paper's sensor
# its press force is a third of that by finite elements. Both forces are therefore compared at the same shift of the
# magnet, within the range in which level finite was compared with finite elements (`analytic.beam.outside`).


class Gap(NamedTuple):
    """Forces (F_x, F_y, F_n) of a level and of level finite at the same poses, each shape (n, 3), N.

    `finite` is NaN outside the range of level finite. `slack` is the error of the polynomials by which the decoder
    represents level finite, N.
    """

    force: Array
    finite: Array
    slack: float


def force_gap(coder: Decoder, level: str, shift: Array, force: Array) -> Gap | None:
    """Compare forces (n, 3), N, at shifts (n, 3), mm, with level finite; None for a source better than that."""
    if coder.mechanics is None or level not in beam.LEVELS:
        return None
    design, law = coder.forward.design, coder.mechanics if level == BEST else None
    # level finite refuses some designs; the gap is then of unknown size
    with contextlib.suppress(BadInput):
        law = law or of_level(design, BEST)
    return Gap(force, finite_force(design, law, shift), max(law.errors[1:3]) if law else 0.0)


def finite_force(design: Design, law: Mechanics | None, shift: Array) -> Array:
    """Return the force (n, 3), N, by the mechanics of level finite at shifts (n, 3), mm.

    It is NaN outside the range of `analytic.beam.outside`, and without mechanics, because the level refuses a design.
    """
    if law is None:
        return np.full(shift.shape, np.nan)
    force, load, _ = response_surface.force_and_load(law, np.ascontiguousarray(shift.T))
    low, high = response_surface.workspace(design, law)
    inside = ((shift >= low) & (shift <= high)).all(axis=1) & (load[0] <= beam.DEEPEST * design.D)
    inside &= np.hypot(load[1], load[2]) <= beam.FARTHEST * design.D
    inside &= not beam.outside(design, Load(), BEST)
    return np.where(inside, force, np.nan).T


def level_warnings(level: str, gap: Gap | None) -> list[str]:
    """Return warnings: forces that differ much from level finite, and forces whose error is unknown."""
    if gap is None:
        return []
    chosen, best, apart = (
        np.sqrt((values**2).sum(axis=1)) for values in (gap.force, gap.finite, gap.force - gap.finite)
    )
    wide, shares = apart > np.maximum(APART * best, gap.slack), apart / np.maximum(best, gap.slack)
    worst = int(np.argmax(np.where(wide, shares, -np.inf)))
    return sentences(
        "level",
        level=level,
        best_level=BEST,
        count=len(wide),
        wide=int(wide.sum()),
        limit=100 * APART,
        share=100 * shares[worst],
        row=worst + 1,
        chosen=chosen[worst],
        best=best[worst],
        unknown=int(((chosen > 0) & np.isnan(best)).sum()),
    )
