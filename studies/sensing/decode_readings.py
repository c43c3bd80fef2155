"""What `magtip decode` gives: poses and loads from readings on the command line or in a table."""

from __future__ import annotations

import contextlib
import csv
import io
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from studies.inputs import input_warnings, state_files, user_input
from studies.output import atomic_files, console
from studies.sensing.field_tables import read_rows

if TYPE_CHECKING:
    from analytic.decode import Decoded, Decoder
    from analytic.inverse.response_surface import Mechanics
    from analytic.inverse.workspace_limits import Limit
    from analytic.parts import Element
    from geometry.arrays import Array
    from studies.sensing.force_level_check import Gap


FOUND = ["status", "shift_x_mm", "shift_y_mm", "shift_z_mm", "tilt_rad", "tilt_y_rad", "force_x_N", "force_y_N"]
FOUND += ["force_z_N", "depth_mm", "shear_mm", "shear_y_mm", "condition", "multiplicity", "level"]
"""Columns that a table of readings gets."""
MOST_LOOKED_AT = 2000
"""Rows out of the workspace that are looked for outside it."""
RESPONSES, NO_LEVEL = "responses", "none"
"""Named in place of a level where states give the mechanics, and where nothing does."""
MANY = 500
"""Rows from which it pays to load the compiled field first."""

WHY = {
    "ok": "",
    "ambiguous": "several poses give these readings: the result is the pose nearest to rest, and poses_mm lists all",
    "out_of_workspace": "no pose of the magnet in the workspace gives these readings: check their order and units",
    "saturated": "a reading is saturated (at a rail of its element), so the pose is unknown: check its unit,"
    " or press and shear less",
    "not_finite": "a reading is missing or not a finite number",
    "tension": "the pose is known but its load is not, because the plate would have to pull on the tip there:"
    " give states over more depths and shears",
    "inconsistent": "no pose explains all readings together: check their order, units and the ambient field",
}
NO_CONTACT = (
    "the plate does not touch the tip at this pose (depth 0), so the load is 0: the shift of {:.2g} mm sideways "
    "comes from rounding or noise of the readings, an ambient field, or something other than the plate"
)


def beyond_sentence(coder: Decoder, end: Limit | None, *, solved: bool) -> str:
    """Why readings are out of the workspace, and what to do.

    Parameters
    ----------
    end : what keeps the pose out of it; None where there is no pose outside either.
    solved : whether the mechanics are those of states, or of formulas.
    """
    source, remedy = ("states", "solve") if solved else ("formulas", "give states by --responses that go")
    if end == "depth":
        return f"the magnet is deeper than {-coder.low[2]:.3g} mm, the limit of the {source}: {remedy} deeper"
    if end == "shear":
        return (
            f"the magnet is more than {coder.high[0]:.3g} mm sideways, the limit of the {source}: {remedy} farther "
            "sideways"
        )
    if end == "workspace":
        low, high = coder.low, coder.high
        return (
            f"the magnet is outside the workspace, {high[0]:.3g} mm sideways, {-low[2]:.3g} mm down and"
            f" {high[2]:.3g} mm up: press or shear less, or check order and units"
        )
    return WHY["out_of_workspace"]


def prepare(design: Design, level: str | None, file: Path | None, *, ignore_tilt: bool) -> Decoder:
    """The decoder of a design with the mechanics of a formula, or of responses in a file.

    Raises
    ------
    BadInput
        Both are given, or what they give cannot be used.
    """
    from analytic.decode import decoder

    law = mechanics_of(design, level, file)
    say_if_upright(law, ignore_tilt=ignore_tilt)
    return decoder(design, law, ignore_tilt=ignore_tilt)


def mechanics_of(design: Design, level: str | None, file: Path | None) -> Mechanics:
    """The mechanics of a level, or of responses in a file; of the level paper if neither is given."""
    if file is not None and level is not None:
        raise BadInput("--level and --responses exclude each other: give only one")
    return of_level(design, level or "paper") if file is None else of_file(file, design)


def level_name(level: str | None, file: Path | None, default: str = "paper") -> str:
    """The level that gives tilt and load, or "responses" where a file of states does; as `mechanics_of` chooses."""
    return RESPONSES if file is not None else level or default


def gap_of(coder: Decoder, level: str, found: Decoded) -> Gap | None:
    """The forces that were decoded beside those of level finite; None where there is nothing to compare."""
    from studies.sensing import force_level_check

    if coder.mechanics is None or level in (force_level_check.BEST, RESPONSES):
        return None
    design, law = coder.forward.design, None
    # level finite may not carry this design at all
    with contextlib.suppress(BadInput):
        law = of_level(design, force_level_check.BEST)
    return force_level_check.gap(design, law, found.shift, found.force)


def say_if_upright(law: Mechanics | None, *, ignore_tilt: bool) -> None:
    """A warning where a tilt is to be ignored and there is none."""
    if ignore_tilt and law is not None and not law.tau.any():
        input_warnings.say_no_effect("--ignore-tilt", "the tilt is zero in these formulas or states")


def of_level(design: Design, level: str) -> Mechanics:
    """The mechanics of a level of the formulas, over the workspace or as far as they go."""
    from analytic import beam
    from analytic.inverse import response_surface

    if level not in beam.LEVELS:
        raise BadInput(f"level must be one of {', '.join(beam.LEVELS)}; got {level!r}")
    # the paper's magnet follows the tip by H/L; the other levels bend too much beyond the paper's own range of loads
    widest = 3 / 8 * design.D * (design.L / design.H if level == "paper" else 1.0)
    deepest = min(widest, design.R, 0.9 * (design.L - design.magnet_height))
    return response_surface.of_formula(lambda load: beam.solve(design, load, level), deepest, widest)


def of_file(path: Path, design: Design) -> Mechanics:
    """The mechanics of the states in a file that are ok, which were solved for this design."""
    from analytic.inverse import response_surface

    samples = [
        (state.load, state.response)
        for state in state_files.read(path, design)
        if state.status == "ok" and state.load is not None and state.response is not None
    ]
    try:
        return response_surface.of_samples(samples)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


def one(coder: Decoder, text: str, units: str | None, level: str) -> dict[str, Any]:
    """The record of one set of readings a,b,c; `level` as `level_name` names it."""
    from analytic.decode import decode
    from analytic.inverse import workspace_limits
    from studies.sensing import force_level_check

    chosen = coder.forward.elements
    values = user_input.parse_numbers("--readings", text)
    if len(values) != len(chosen):
        names = ",".join(element.name for element in chosen)
        raise BadInput(f"--readings takes {len(chosen)} numbers, {names}; got {len(values)} in {text!r}")
    field = in_tesla(chosen, [values], units)
    found = decode(coder, field)
    (status,) = found.status
    tilt, tilt_y = tilts_of(*found.tilt[0].tolist())
    out = status == "out_of_workspace"
    outside = workspace_limits.poses_outside(coder, field)[0] if out else None
    end = None if outside is None else workspace_limits.exceeded_limit(coder, outside)
    message = beyond_sentence(coder, end, solved=level == RESPONSES) if out else WHY[status]
    depth = float(found.load[0, 0])
    contact = None if math.isnan(depth) else depth > 0
    if contact is False:
        message = "; ".join(filter(None, [message, NO_CONTACT.format(math.hypot(*found.shift[0, :2]))]))
    gap = gap_of(coder, level, found)
    return {
        "status": status,
        "message": message,
        "level": level,
        "readings_T": field[0].tolist(),
        "shift_mm": found.shift[0].tolist(),
        "tilt_rad": tilt,
        "tilt_y_rad": tilt_y,
        "rotation_rad": found.tilt[0].tolist(),
        "force_N": found.force[0].tolist(),
        "finite_force_N": None if gap is None else gap.finite[0].tolist(),
        "contact": contact,
        "depth_mm": depth,
        "shear_mm": float(found.load[0, 1]),
        "shear_y_mm": float(found.load[0, 2]),
        "condition": float(found.condition[0]),
        "multiplicity": int(found.multiplicity[0]),
        "poses_mm": found.poses.tolist(),
        "noise_um": (1e3 * found.noise_mm[0]).tolist(),
        "noise_N": found.noise_N[0].tolist(),
        "beyond": end,
        "outside_mm": None if outside is None else outside.tolist(),
        "workspace_mm": [coder.low.tolist(), coder.high.tolist()],
        "fit_error_rad": coder.mechanics.errors[0] if coder.mechanics else None,
        "fit_error_N": max(coder.mechanics.errors[1:3]) if coder.mechanics else None,
        "warnings": [] if gap is None else force_level_check.warnings(level, gap),
    }


@dataclass(frozen=True, slots=True)
class Summary:
    """What is to be said of a table that was decoded.

    Attributes
    ----------
    counts : rows of each status.
    ends : of the first `MOST_LOOKED_AT` rows out of the workspace, what keeps how many of them out.
    warnings : about the level's forces.
    """

    counts: dict[str, int]
    ends: dict[Limit | None, int]
    warnings: list[str]


def table(
    coder: Decoder, path: Path, units: str | None, out: Path | None, level: str, *, as_json: bool = False
) -> Summary:
    """Decode a table of readings as a stream, write it with the columns `FOUND` added, and say what is in it.

    Without `out` it is printed; as JSON an object for each row, with its number and what the elements read.

    The table's head names a column for each element in order, such as S1_V,S2_V,S3_V (or _T for flux densities);
    further columns stay as they are. An empty or NaN reading gets the status not_finite.

    Raises
    ------
    BadInput
        A file cannot be read or written, or is no such table.
    """
    import numpy as np

    from analytic import magnet
    from analytic.decode import decode
    from analytic.parts import columns

    chosen = coder.forward.elements
    unit = units or chosen[0].unit
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    heads = {kind: [f"{name}_{kind}" for name in columns(chosen)] for kind in ("V", "T")}
    other = "T" if unit == "V" else "V"
    head, rows, values = read_rows(
        path,
        heads[unit],
        FOUND,
        holes=True,
        instead={f"--units {other}": heads[other]} if chosen[0].unit == "V" else {},
    )
    if len(rows) >= MANY:
        magnet.compiled()
    field = in_tesla(chosen, values, unit)
    with console.progress(as_json=as_json) if len(rows) >= MANY else contextlib.nullcontext() as progress:
        if progress is not None:
            progress(0.0, f"poses of {len(rows)} rows")
        found = decode(coder, field, follow=True)
    tilt, tilt_y = tilts_of(*found.tilt.T)
    numbers = np.column_stack([found.shift, tilt, tilt_y, found.force, found.load, found.condition])
    if as_json and target is None:
        lines = zip(field.tolist(), found.status, numbers.tolist(), found.multiplicity.tolist(), strict=True)
        console.report(
            [
                {"row": k, "readings_T": b} | dict(zip(FOUND, (status, *line, many, level), strict=True))
                for k, (b, status, line, many) in enumerate(lines, 1)
            ],
            as_json=True,
        )
        return _summary(coder, found, field, level)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *FOUND])
    for row, status, line, many in zip(rows, found.status, numbers.tolist(), found.multiplicity, strict=True):
        writer.writerow([*row, status, *("" if math.isnan(v) else repr(v + 0.0) for v in line), many, level])
    if target is None:
        print(text.getvalue(), end="", flush=True)
    else:
        atomic_files.write_text(target, text.getvalue())
    return _summary(coder, found, field, level)


def _summary(coder: Decoder, found: Decoded, field: Array, level: str) -> Summary:
    from studies.sensing import force_level_check

    gap = gap_of(coder, level, found)
    counts: dict[str, int] = {name: found.status.count(name) for name in WHY if name in found.status}
    return Summary(counts, _ends(coder, found, field), [] if gap is None else force_level_check.warnings(level, gap))


def _ends(coder: Decoder, found: Decoded, field: Array) -> dict[Limit | None, int]:
    """What keeps rows out of the workspace, and how many of them."""
    from analytic.inverse import workspace_limits

    rows = [k for k, status in enumerate(found.status) if status == "out_of_workspace"][:MOST_LOOKED_AT]
    ends = (
        [workspace_limits.exceeded_limit(coder, pose) for pose in workspace_limits.poses_outside(coder, field[rows])]
        if rows
        else []
    )
    return dict(Counter(ends))


def in_tesla(elements: Sequence[Element], values: Any, units: str | None) -> Array:
    """Readings (n, k) as flux densities, T."""
    import numpy as np

    from analytic.decode import field_of

    own = elements[0].unit
    if units in (None, own):
        return field_of(elements, values)
    if units == "V":
        raise BadInput(
            "the output of these elements is a flux density: leave --units V out and give the readings in T"
        )
    return np.asarray(values, dtype=np.float64)
