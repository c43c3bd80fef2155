"""The study of `magtip layout`: the map of a layout, better layouts, the paper's claim, and a range of loads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from geometry.messages import Progress
from studies.inputs.option_groups import Basis
from studies.output.figures import picture, save
from studies.output.result import Result, Table, Writer
from studies.sensing import (
    decode_readings,
    force_range,
    layout_figures,
    layout_metrics,
    layout_search,
    layout_uniqueness,
)

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.survey import Survey
    from studies.output.records import FlatRow
    from studies.sensing.claim_rows import Claim, HeightRow, LimitRow
    from studies.sensing.force_range import ForceRange
    from studies.sensing.layout_metrics import LayoutRow

FILES = ("layout.csv", "layout.png", "search.csv", "claim.csv", "claim.png", "force_range.csv", "LAYOUT.md")
"""Files of the study; those of search, claim and range of loads only if these were requested."""


NOISE = ("noise_worst_um", "noise_median_um", "noise_worst_N")
"""Columns of the noise of a layout that tables show."""
MOST_CLEARANCE = 100.0
"""mm."""


@dataclass(frozen=True, slots=True)
class Job:
    """Requested parts of the study: the map always, a search over ranges NAME=LOW,HIGH, the claim, and the resolution
    over a range of loads NORMAL,TANGENTIAL.
    """

    design: Design
    basis: Basis
    search: bool
    ranges: Sequence[str]
    count: int
    claim: bool
    force_range: str | None = None


def run(job: Job, progress: Progress) -> Result:
    """Evaluate the layout, and search and answer the claim if requested.

    Raises
    ------
    BadInput
        The design has no magnet, a layout or range is impossible, or `layout_metrics.mechanics_of` refuses.
    """
    from analytic import survey

    design, basis = job.design, job.basis
    law = layout_metrics.mechanics_of(design, basis.level, basis.responses)
    decode_readings.warn_if_upright(law, ignore_tilt=basis.ignore_tilt)
    if not 0 <= basis.clearance <= MOST_CLEARANCE:
        raise BadInput(f"--clearance must lie between 0 and {MOST_CLEARANCE:g} mm; got {basis.clearance:g}")
    if not 1 <= job.count <= layout_search.MOST_FOUND:
        raise BadInput(f"--count must lie between 1 and {layout_search.MOST_FOUND}; got {job.count}")
    limits = None if job.force_range is None else force_range.parse(job.force_range)
    bounds = layout_search.parse_ranges(design, job.ranges)
    if job.claim:
        layout_uniqueness.check(design)
    coder, noise = layout_metrics.prepare(design, law, basis)
    progress(0.0, "map of the workspace")
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    name = decode_readings.level_name(basis.level, basis.responses)
    layout = layout_metrics.layout_row(coder, poses, noise, name)
    loads = None if limits is None else force_range.loads(coder, *limits, basis.clearance)
    forces = None if loads is None or limits is None else force_range.evaluate(coder, loads, *limits, name)
    search = layout_search.run(design, law, basis, bounds, job.count, progress) if job.search else None
    claim = layout_uniqueness.run(design, progress) if job.claim else None
    files: dict[str, Writer] = {
        "layout.csv": lambda path: _write_map(path, coder, poses),
        "layout.png": lambda path: save(path, layout_figures.maps(coder, poses, basis.clearance)),
    }
    record, shown, tables = layout.row(), [Table(title="Layout", rows=[_shown(layout)])], {}
    if search is not None:
        record["search"] = tables["search"] = search
        shown.append(Table(title="Layouts, best first", rows=_shown_search(search)))
    if claim is not None:
        record["claim"] = claim.row()
        tables["claim"] = [row.row() for row in claim.heights]
        files["claim.png"] = partial(picture, rows=tables["claim"], draw=partial(layout_figures.claim, c=design.c))
        shown.append(Table(title="Claim", rows=_shown_claim(claim)))
    if loads is not None and forces is not None:
        record["force_range"] = forces.row()
        tables["force_range"] = [row.row() for row in force_range.table(loads)]
        shown.append(Table(title="Range of loads", rows=[_shown_forces(forces)]))
    warnings = [*layout.hits, *layout.warnings, *(forces.warnings if forces else ())]
    said = design.value_warnings()  # by the reader of the design
    return Result(
        title="Layout",
        records=[record],
        shown=shown,
        tables=tables,
        files=files,
        pages={"LAYOUT.md": text(layout, search, claim, forces)},
        warnings=[warning for warning in warnings if warning not in said],
    )


def _write_map(path: Path, coder: Decoder, poses: Survey) -> None:
    from studies.output.table_files import write_table

    write_table(path, map_rows(coder, poses))


def map_rows(coder: Decoder, poses: Survey) -> Iterator[FlatRow]:
    """Yield the row of each pose of the map.

    known, saturated, blocked : 0 or 1; `known` is 1 if the pose lies within the range of the mechanics.
    det_sign : sign of det J.
    multiplicity : number of poses with these readings; None if they were not searched.
    """
    from analytic.parts import columns

    names = columns(coder.forward.elements)
    known, blocked = poses.weight > 0, poses.blocked
    tilt, tilt_y = tilts_of(*poses.tilt)
    for k in range(len(known)):
        x, y, z = poses.shift[:, k].tolist()
        readings = zip(names, poses.readings[:, k].tolist(), strict=True)
        yield {
            "x_mm": x,
            "y_mm": y,
            "z_mm": z,
            "tilt_rad": tilt[k],
            "tilt_y_rad": tilt_y[k],
            **{f"{name}_mT": 1e3 * b for name, b in readings},
            "known": int(known[k]),
            "blocked": int(blocked[k]),
            "saturated": int(poses.saturated[k]),
            "det_sign": int(poses.sign[k]),
            "condition": poses.condition[k],
            "multiplicity": int(poses.multiplicity[k]) or None,
            "alike_apart_mm": poses.alike_mm[k],
            "noise_um": 1e3 * poses.noise_mm[k],
            "noise_N": poses.noise_N[k],
        }


def text(layout: LayoutRow, search: list[FlatRow] | None, claim: Claim | None, forces: ForceRange | None) -> str:
    """Return the text of LAYOUT.md without its origin."""
    lines = ["# The layout of the Hall elements", ""]
    verdict = layout.message
    lines += [f"{verdict[0].upper()}{verdict[1:]}.", "", *_figures(layout), ""]
    remarks = [f"- {sentence}" for sentence in (*layout.hits, *layout.warnings)]
    lines += [*remarks, ""] if remarks else []
    lines += ["![Condition, sign of det J, multiplicity and noise over x and z](layout.png)", ""]
    lines += ["Left: the plane y = 0. Right: the worst over all y. The table behind it is layout.csv.", ""]
    if forces is not None:
        lines += _forces(forces)
    if claim is not None:
        lines += _claim(claim)
    if search is not None:
        lines += ["## Other layouts, best first", "", *_search(search), ""]
    lines += ["## How it was made", "", *layout_metrics.ABOUT.splitlines()]
    if search is not None:
        lines += ["", *layout_search.ABOUT.splitlines()]
    return "\n".join(lines)


def _figures(layout: LayoutRow) -> list[str]:
    figures, (low, high) = layout.figures, layout.workspace_mm
    box = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True))
    noise = ", ".join(f"{1e6 * value:.3g}" for value in layout.noise_of_readings_T)
    places = {"f": layout.f_mm, "c": layout.c_mm, "chip_x": layout.chip_x_mm}
    place = "".join(f"{name} = {value:g} mm, " for name, value in places.items() if value is not None)
    rows: list[Sequence[str]] = [
        ("layout", f"{layout.layout}, {place}l0 = {layout.l0_mm:g} mm"),
        ("formulas or states, tilt, reading", f"{layout.mechanics}, {layout.tilt}, {layout.mode}"),
        ("workspace: shift of the magnet along x, y, z", f"{box} mm"),
        ("poses of the map; share with known tilt", f"{layout.poses}; {layout.known_percent:.3g} %"),
        ("unique", f"{figures.unique_percent:.4g} %"),
        ("ambiguous", f"{figures.ambiguous_percent:.4g} %"),
        ("saturated", f"{figures.saturated_percent:.4g} %"),
        ("blocked", f"{figures.blocked_percent:.4g} %"),
        ("det J > 0, < 0", f"{figures.det_positive_percent:.4g} %, {figures.det_negative_percent:.4g} %"),
        ("condition number, median and worst", _pair(figures.condition_median, figures.condition_worst)),
        ("noise of the pose, median and worst", _pair(figures.noise_median_um, figures.noise_worst_um, " µm")),
        ("noise of the force, median and worst", _pair(figures.noise_median_N, figures.noise_worst_N, " N")),
        ("along x, y, z, median", _axes(figures.noise_median_axes_N)),
        ("along x, y, z, worst", _axes(figures.noise_worst_axes_N)),
        ("noise of the readings", f"{noise} µT ({layout.noise_source})"),
    ]
    return _markdown(("", ""), rows)


def _pair(median: float | None, worst: float | None, unit: str = "") -> str:
    return f"{_text(median, unit)}, {_text(worst, unit)}"


def _axes(values: Sequence[float] | None) -> str:
    return "-" if values is None else ", ".join(_text(value) for value in values) + " N"


def _text(value: float | None, unit: str = "") -> str:
    """Format a value with three digits; a dash for None.

    >>> _text(12.345, " N"), _text(None), _text(float("inf"))
    ('12.3 N', '-', 'infinite')
    """
    if value is None or value != value:
        return "-"
    return "infinite" if abs(value) == float("inf") else f"{value:.3g}{unit}"


def _markdown(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [[cell.replace("|", "\\|") for cell in line] for line in (heads, ["---"] * len(heads), *rows)]
    return [f"| {' | '.join(line)} |" for line in lines]


def _forces(forces: ForceRange) -> list[str]:
    """Return the section on the resolution over a range of loads."""
    lines = ["## Resolution over the range of loads", "", f"{forces.message}.", ""]
    values = [
        ("at rest", forces.rest_N),
        ("median", forces.median_N),
        ("worst", forces.worst_N),
        ("full load, worst direction", forces.full_load_N),
    ]
    rows = [(name, *(_text(1e3 * v, " mN") for v in each)) for name, each in values if each is not None]
    if forces.worst_N_per_N is not None:
        rows.append(
            (
                "worst over the range's limit",
                *(_text(None if v is None else 100 * v, " %") for v in forces.worst_N_per_N),
            )
        )
    for name, places in (("load at the worst, N", forces.worst_at_N), ("shift at the worst, mm", forces.worst_at_mm)):
        if places is not None:
            rows.append((name, *(", ".join(f"{v + 0.0:.3g}" for v in place) for place in places)))
    lines += [*_markdown(("resolution", "x", "y", "z"), rows), ""]
    lines += [f"- {sentence}" for sentence in forces.warnings]
    return [*lines, "", *force_range.about().splitlines(), "", "The table behind it is force_range.csv.", ""]


def _search(rows: Sequence[FlatRow]) -> list[str]:
    heads = ["rank", "layout", "unique %", "saturated %", "blocked %", "worst condition"]
    heads += ["worst noise, µm", "median noise, µm", "worst noise, N"]
    cells = []
    for row in rows:
        keys = ("unique_percent", "saturated_percent", "blocked_percent", "condition_worst", *NOISE)
        cells.append([str(row["rank"] or "given"), f"`{row['settings']}`", *(_text(row[key]) for key in keys)])
    return _markdown(heads, cells)


def _claim(claim: Claim) -> list[str]:
    """Return the section on the claim: the answer for the design's layout, where it fails, and the method."""
    lines = ["## Are the readings unique to each position of the magnet?", ""]
    heads = ["readings", "workspace, mm", "unique", "poses with equal readings", "worst condition"]
    heads += [f"least difference, {each.apart:.2g} mm apart" for each in claim.forms[0].differences]
    cells = []
    for row in claim.forms:
        (low, high), figures = row.workspace_mm, row.figures
        box = f"±{high[0]:.2g}, ±{high[1]:.2g}, {low[2]:.2g} to {high[2]:.2g}"
        share, far = figures.alike_percent, figures.alike_apart_mm
        alike = f"{share:.3g} %, up to {far:.2g} mm apart" if share else "none"
        differences = [f"{each.over_noise:.3g} x noise" for each in row.differences]
        unique, condition = f"{figures.unique_percent:.4g} %", _text(figures.condition_worst)
        cells.append([row.readings, box, unique, alike, condition, *differences])
    lines += [f"- {sentence}" for sentence in layout_uniqueness.answer(claim)]
    lines += ["", "For the given layout:", "", *_markdown(heads, cells), ""]
    lines += ["For which c, and where it fails first:", "", *_limits(claim.limits), ""]
    lines += ["![Share of poses whose readings another pose gives too, over c](claim.png)", ""]
    return [*lines, *layout_uniqueness.ABOUT.splitlines(), "", "The table behind it is claim.csv.", ""]


def _limits(rows: Sequence[LimitRow]) -> list[str]:
    heads = ["magnet height, mm", "l0, mm", "readings", "unique for c, mm", "there, or just below", "just above"]
    cells = []
    for row in rows:
        low, high = row.unique_from_c_mm, row.unique_to_c_mm
        span = f"{'any' if low is None else f'{low:.3g}'} to {'any' if high is None else f'{high:.3g}'}"
        cells.append(
            [
                f"{row.magnet_height_mm:g}",
                f"{row.l0_mm:g}",
                row.readings,
                span if row.unique else "not at c next to the given",
                _failure(row.below),
                _failure(row.above),
            ]
        )
    return _markdown(heads, cells)


def _failure(row: HeightRow | None) -> str:
    """Return the ambiguous share and the range of shifts in which it lies."""
    if row is None:
        return ""
    figures = row.figures
    spans = {"x": figures.alike_x_mm, "y": figures.alike_y_mm, "z": figures.alike_z_mm}
    box = ", ".join(f"{name} {_span(ends)}" for name, ends in spans.items() if ends is not None)
    return f"c = {row.c_mm:.3g}: {figures.alike_percent:.2g} %, up to {figures.alike_apart_mm:.2g} mm apart, at {box}"


def _span(ends: Sequence[float]) -> str:
    low, high = ends
    return f"{low:.2g}" if high - low < 1e-9 else f"{low:.2g} to {high:.2g}"


# On a terminal

PLACES = ("worst_at_N", "worst_at_mm")
"""Keys of a range of loads with a vector for each axis."""


def _shown(layout: LayoutRow) -> FlatRow:
    """Return the row of a layout for the terminal."""
    hidden = ["status", "elements", "hits", "warnings", "poses"]
    hidden += ["known_percent"] if layout.known_percent == 100 else []
    hidden += ["most_alike", "alike_apart_mm"] if layout.figures.most_alike == 1 else []
    short = {name: value for name, value in layout.row().items() if name not in hidden and value is not None}
    low, high = short.pop("workspace_mm")
    short["workspace_mm"] = [f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True)]
    return short


def _shown_forces(forces: ForceRange) -> FlatRow:
    """Return the row of a range of loads for the terminal."""
    row = {name: value for name, value in forces.row().items() if value not in (None, []) and name != "warnings"}
    places = {name: ["; ".join(f"{v + 0.0:.3g}" for v in one) for one in row[name]] for name in PLACES if name in row}
    return row | places


def _shown_search(rows: Sequence[FlatRow]) -> list[FlatRow]:
    """Return the rows of a search for the terminal; files and JSON have all shares."""
    keys = ("settings", "unique_percent", "condition_worst", *NOISE)
    return [{"rank": row["rank"] or "given", **{key: row[key] for key in keys}} for row in rows]


def _shown_claim(claim: Claim) -> list[FlatRow]:
    """Return the rows of the claim for the terminal: the design's layout form by form, and the range of c."""
    rows = []
    for form in claim.forms:
        limit = next(row for row in claim.limits if row.readings == form.readings)
        shares = ("readings", "unique_percent", "alike_percent", "alike_apart_mm")
        row = {name: value for name, value in form.row().items() if name in shares or name.startswith("difference")}
        rows.append(row | {"unique_from_c_mm": limit.unique_from_c_mm, "unique_to_c_mm": limit.unique_to_c_mm})
    return rows
