"""The study of `magtip layout`: the map of a layout, better layouts, the paper's claim, and a range of loads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from geometry.messages import Progress
from studies.inputs.option_groups import Basis, LayoutParts
from studies.output import page_templates
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
    import pandas as pd

    from analytic.decode import Decoder
    from analytic.survey import Survey
    from studies.output.records import FlatRow
    from studies.sensing.layout_uniqueness import Claim

FILES = ("layout.csv", "layout.png", "search.csv", "claim.csv", "claim.png", "force_range.csv", "LAYOUT.md")
"""Files of the study; those of search, claim and range of loads only if these were requested."""


NOISE = ("noise_worst_um", "noise_median_um", "noise_worst_N")
"""Columns of the noise of a layout that tables show."""
MOST_CLEARANCE = 100.0
"""mm."""


def run(design: Design, basis: Basis, parts: LayoutParts, progress: Progress) -> Result:
    """Evaluate the layout, and search, answer the claim and survey a range of loads if requested.

    Raises
    ------
    BadInput
        The design has no magnet, a layout or range is impossible, or `layout_metrics.mechanics_of` refuses.
    """
    from analytic import survey
    from studies.output.table_files import write_table

    count = layout_search.USUAL if parts.count is None else parts.count
    law = layout_metrics.mechanics_of(design, basis.level, basis.responses)
    decode_readings.warn_if_upright(law, ignore_tilt=basis.ignore_tilt)
    if not 0 <= basis.clearance <= MOST_CLEARANCE:
        raise BadInput(f"--clearance must lie between 0 and {MOST_CLEARANCE:g} mm; got {basis.clearance:g}")
    if not 1 <= count <= layout_search.MOST_FOUND:
        raise BadInput(f"--count must lie between 1 and {layout_search.MOST_FOUND}; got {count}")
    limits = None if parts.force_range is None else force_range.parse(parts.force_range)
    bounds = layout_search.parse_ranges(design, parts.ranges or ())
    if parts.claim:
        layout_uniqueness.check(design)
    coder, noise = layout_metrics.prepare(design, law, basis)
    progress(0.0, "map of the workspace")
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    name = decode_readings.level_name(basis.level, basis.responses)
    layout = layout_metrics.layout_row(coder, poses, noise, name)
    loads = None if limits is None else force_range.loads(coder, *limits, basis.clearance)
    forces = None if loads is None or limits is None else force_range.evaluate(coder, loads, *limits, name)
    search = layout_search.run(design, law, basis, bounds, count, progress) if parts.search else None
    claim = layout_uniqueness.run(design, progress) if parts.claim else None
    files: dict[str, Writer] = {
        "layout.csv": lambda path: write_table(path, map_table(coder, poses).to_dict("records")),
        "layout.png": lambda path: save(path, layout_figures.maps(coder, poses, basis.clearance)),
    }
    record, shown, tables = dict(layout), [Table(title="Layout", rows=[_shown(layout)])], {}
    if search is not None:
        record["search"] = tables["search"] = search
        shown.append(Table(title="Layouts, best first", rows=_shown_search(search)))
    if claim is not None:
        record["claim"], tables["claim"] = claim, claim["heights"]
        files["claim.png"] = partial(picture, rows=tables["claim"], draw=partial(layout_figures.claim, c=design.c))
        shown.append(Table(title="Claim", rows=_shown_claim(claim)))
    if loads is not None and forces is not None:
        record["force_range"], tables["force_range"] = forces, force_range.table(loads).to_dict("records")
        shown.append(Table(title="Range of loads", rows=[_shown_forces(forces)]))
    warnings = [*layout["hits"], *layout["warnings"], *(forces["warnings"] if forces else ())]
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


def map_table(coder: Decoder, poses: Survey) -> pd.DataFrame:
    """Return the table of the poses of the map.

    known, saturated, blocked : 0 or 1; `known` is 1 if the pose lies within the range of the mechanics.
    det_sign : sign of det J.
    multiplicity : number of poses with these readings; NaN if they were not searched.
    """
    import numpy as np
    import pandas as pd

    from analytic.parts import columns

    tilt, tilt_y = tilts_of(*poses.tilt)
    flags = {"known": poses.weight > 0, "blocked": poses.blocked, "saturated": poses.saturated}
    return pd.DataFrame({
        **{f"{axis}_mm": shift for axis, shift in zip("xyz", poses.shift, strict=True)},
        "tilt_rad": tilt,
        "tilt_y_rad": tilt_y,
        **{f"{name}_mT": 1e3 * b for name, b in zip(columns(coder.forward.elements), poses.readings, strict=True)},
        **{name: flag.astype(int) for name, flag in flags.items()},
        "det_sign": poses.sign,
        "condition": poses.condition,
        "multiplicity": np.where(poses.multiplicity, poses.multiplicity, np.nan),
        "alike_apart_mm": poses.alike_mm,
        "noise_um": 1e3 * poses.noise_mm,
        "noise_N": poses.noise_N,
    })  # fmt: skip


def text(layout: FlatRow, search: list[FlatRow] | None, claim: Claim | None, forces: FlatRow | None) -> str:
    """Return the text of LAYOUT.md without its origin."""
    low, high = layout["workspace_mm"]
    values = {} if claim is None else {"answers": layout_uniqueness.answer(claim)}
    return page_templates.rendered(
        Path(__file__).with_name("LAYOUT.md.j2"),
        layout=layout,
        search=search,
        claim=claim,
        forces=forces,
        box=", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True)),
        counts=force_range.COUNTS,
        differences=layout_uniqueness.differences,
        failure=_failure,
        text=_text,
        vector=_vector,
        **values,
    )


def _text(value: float | None, unit: str = "") -> str:
    """Format a value with three digits; a dash for None.

    >>> _text(12.345, " N"), _text(None), _text(float("inf"))
    ('12.3 N', '-', 'infinite')
    """
    if value is None or value != value:
        return "-"
    return "infinite" if abs(value) == float("inf") else f"{value:.3g}{unit}"


def _vector(values: Iterable[float]) -> str:
    return ", ".join(f"{value + 0.0:.3g}" for value in values)


def _failure(row: FlatRow | None) -> str:
    """Return the ambiguous share and the range of shifts in which it lies."""
    if row is None:
        return ""
    spans = {name: row[f"alike_{name}_mm"] for name in "xyz"}
    box = ", ".join(f"{name} {_span(ends)}" for name, ends in spans.items() if ends is not None)
    share, apart = row["alike_percent"], row["alike_apart_mm"]
    return f"c = {row['c_mm']:.3g}: {share:.2g} %, up to {apart:.2g} mm apart, at {box}"


def _span(ends: Sequence[float]) -> str:
    low, high = ends
    return f"{low:.2g}" if high - low < 1e-9 else f"{low:.2g} to {high:.2g}"


# On a terminal

PLACES = ("worst_at_N", "worst_at_mm")
"""Keys of a range of loads with a vector for each axis."""


def _shown(layout: FlatRow) -> FlatRow:
    hidden = ["status", "elements", "hits", "warnings", "poses"]
    hidden += ["known_percent"] if layout["known_percent"] == 100 else []
    hidden += ["most_alike", "alike_apart_mm"] if layout["most_alike"] == 1 else []
    short = {name: value for name, value in layout.items() if name not in hidden and value is not None}
    low, high = short.pop("workspace_mm")
    short["workspace_mm"] = [f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True)]
    return short


def _shown_forces(forces: FlatRow) -> FlatRow:
    row = {name: value for name, value in forces.items() if value not in (None, []) and name != "warnings"}
    places = {
        name: ["; ".join(f"{v + 0.0:.3g}" for v in vector) for vector in row[name]] for name in PLACES if name in row
    }
    return row | places


def _shown_search(rows: Sequence[FlatRow]) -> list[FlatRow]:
    """Return the rows of a search for the terminal; files and JSON have all shares."""
    keys = ("settings", "unique_percent", "condition_worst", *NOISE)
    return [{"rank": row["rank"] or "given", **{key: row[key] for key in keys}} for row in rows]


def _shown_claim(claim: Claim) -> list[FlatRow]:
    """Return the rows of the claim for the terminal: the design's layout form by form, and the range of c."""
    keys = ("readings", "unique_percent", "alike_percent", "alike_apart_mm")
    rows = []
    for form in claim["forms"]:
        limit = next(row for row in claim["limits"] if row["readings"] == form["readings"])
        row = {name: value for name, value in form.items() if name in keys or name.startswith("difference")}
        rows.append(row | {key: limit[key] for key in ("unique_from_c_mm", "unique_to_c_mm")})
    return rows
