"""The study of `magtip layout`: the map of a layout, better layouts, the paper's claim, and a range of loads."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic import survey
from analytic.decode import Decoder
from analytic.parts import columns
from analytic.survey import Survey
from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from geometry.messages import Progress
from studies.inputs.option_groups import Basis, LayoutParts
from studies.output import page_templates
from studies.output.figures import (
    COLOURS,
    FREE,
    LOG,
    Figure,
    numbers,
    panels,
    picture,
    rule,
    save,
    styles,
    texts,
)
from studies.output.maps import heat
from studies.output.records import FlatRow
from studies.output.result import Result, Table, Writer
from studies.output.table_files import write_table
from studies.quantities import shown
from studies.sensing import decode_readings, force_range, layout_metrics, layout_search, layout_uniqueness
from studies.sensing.decode_readings import Source
from studies.sensing.layout_uniqueness import Claim

if TYPE_CHECKING:
    import pandas as pd

FILES = ("layout.csv", "layout.png", "search.csv", "claim.csv", "claim.png", "force_range.csv", "LAYOUT.md")
"""Files of the study; those of search, claim and range of loads only if these were requested."""
MOST_CLEARANCE = 100.0
"""mm."""


def run(
    design: Design, mechanics: Callable[[], Source], basis: Basis, parts: LayoutParts, progress: Progress
) -> Result:
    """Evaluate the layout, and search, answer the claim and survey a range of loads if requested.

    mechanics : gives the mechanics of the design, which may take some seconds.
    """
    count = layout_search.USUAL if parts.count is None else parts.count
    if not 0 <= basis.clearance <= MOST_CLEARANCE:
        raise BadInput(f"--clearance must lie between 0 and {MOST_CLEARANCE:g} mm; got {basis.clearance:g}")
    if not 1 <= count <= layout_search.MOST_FOUND:
        raise BadInput(f"--count must lie between 1 and {layout_search.MOST_FOUND}; got {count}")
    limits = None if parts.force_range is None else force_range.parse(parts.force_range)
    bounds = layout_search.parse_ranges(design, parts.ranges or ())
    if parts.claim:
        layout_uniqueness.check(design)
    source = mechanics()
    decode_readings.warn_if_upright(source.law, ignore_tilt=basis.ignore_tilt)
    coder, noise = layout_metrics.prepare(design, source.law, basis)
    progress(0.0, "map of the workspace")
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    layout = layout_metrics.layout_row(coder, poses, noise, source)
    if basis.reject_ambient:
        layout["noise_factor"] = layout_metrics.price(design, source.law, basis, poses)
    files: dict[str, Writer] = {
        "layout.csv": lambda path: write_table(path, map_table(coder, poses).to_dict("records")),
        "layout.png": lambda path: save(path, maps(coder, poses, basis.clearance)),
    }
    record, shown, tables = dict(layout), [Table(title="Layout", rows=[_shown(layout)])], {}
    search, claim, forces = None, None, None
    if limits is not None:
        loads = force_range.loads(coder, *limits, basis.clearance)
        forces = force_range.evaluate(coder, loads, *limits, source)
        tables["force_range"] = force_range.table(loads).to_dict("records")
    if parts.search:
        record["search"] = tables["search"] = search = layout_search.run(
            design, source.law, basis, bounds, count, progress
        )
        shown.append(Table(title="Layouts, best first", rows=_shown_search(search)))
    if parts.claim:
        claim = layout_uniqueness.run(design, progress)
        record["claim"], tables["claim"] = claim, claim["heights"]
        files["claim.png"] = partial(picture, rows=tables["claim"], draw=partial(claim_figures, c=design.c))
        shown.append(Table(title="Claim", rows=_shown_claim(claim)))
    if forces is not None:
        record["force_range"], tables["force_range"] = forces, tables.pop("force_range")
        shown.append(Table(title="Range of loads", rows=[_shown_forces(forces)]))
    warnings = [
        *[source.warning] * bool(source.warning),
        *layout["hits"],
        *layout["warnings"],
        *(forces["warnings"] if forces else ()),
    ]
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
    import pandas as pd

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
    return page_templates.rendered(
        Path(__file__).with_name("LAYOUT.md.j2"),
        layout=layout,
        search=search,
        claim=claim,
        forces=forces,
        counts=force_range.COUNTS,
        differences=layout_uniqueness.differences,
        answers=[] if claim is None else layout_uniqueness.answer(claim),
    )


# On a terminal


def _shown(layout: FlatRow) -> FlatRow:
    hidden = ["status", "elements", "hits", "warnings", "poses"]
    hidden += ["known_percent"] if layout["known_percent"] == 100 else []
    hidden += ["most_alike", "alike_apart_mm"] if layout["most_alike"] == 1 else []
    short = {name: value for name, value in layout.items() if name not in hidden and value is not None}
    low, high = short.pop("workspace_mm")
    return short | {"workspace_mm": [f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True)]}


def _shown_forces(forces: FlatRow) -> FlatRow:
    row = {name: value for name, value in forces.items() if value not in (None, []) and name != "warnings"}
    for name in {"worst_at_N", "worst_at_mm"} & set(row):
        row[name] = ["; ".join(shown(v) for v in vector) for vector in row[name]]
    return row


def _shown_search(rows: list[FlatRow]) -> list[FlatRow]:
    keys = ("settings", "unique_percent", "condition_worst", "noise_worst_um", "noise_median_um", "noise_worst_N")
    shown = [key for key in (*keys, "noise_factor") if key in rows[0]]
    return [{"rank": row["rank"] or "given", **{key: row[key] for key in shown}} for row in rows]


def _shown_claim(claim: Claim) -> list[FlatRow]:
    """Return the design's layout form by form, and the range of c."""
    keys = ("readings", "unique_percent", "alike_percent", "alike_apart_mm")
    rows = []
    for form in claim["forms"]:
        limit = next(row for row in claim["limits"] if row["readings"] == form["readings"])
        row = {name: value for name, value in form.items() if name in keys or name.startswith("difference")}
        rows.append(row | {key: limit[key] for key in ("unique_from_c_mm", "unique_to_c_mm")})
    return rows


# Figures

STATES = {"tilt not known": "#ffffff", "saturated": "#cfcfcf", "blocked": "#8a8a8a"}
"""What a place without a usable pose is, and its colour."""
SIGNS = {"< 0": COLOURS[0], "both": "#F0E442", "> 0": COLOURS[1]}
EQUAL = {"1": "#440154", "2": "#31688e", "3": "#35b779", "4 or more": "#fde725"}
"""Numbers of poses with the same readings that the colours distinguish."""
DECADES = 1e3
"""Largest ratio of the ends of a colour scale: values near a fold grow without bound."""
NONE = 0.01
"""Share at which none is drawn on a logarithmic axis, %."""
MAPS = {
    "condition number": ("Condition number", {}),
    "sign of det J": ("Sign of det J, of the readings by the shift", SIGNS | STATES),
    "poses with equal readings": ("Poses with equal readings", EQUAL | STATES),
    "noise (µm)": ("Noise of the decoded shift", {}),
}
"""Columns that are drawn as maps, with their titles, and colours of names."""


def maps(coder: Decoder, box: Survey, room: float = 0.0) -> list[Figure]:
    """Return condition number, sign of det J, multiplicity and noise over x and z: at y = 0, and the worst over y."""
    import pandas as pd

    x, _, z = (np.unique(axis) for axis in box.shift)
    shift = np.stack(np.meshgrid(x, [0.0], z, indexing="ij")).reshape(3, -1)
    plane = survey.at_poses(coder, shift, np.ones(shift.shape[1]), (len(x), 1, len(z)), clearance=room)
    cells = pd.concat(
        [_cells(plane).assign(panel="plane y = 0"), _cells(box).assign(panel="worst over all y")], ignore_index=True
    )
    axes = ("shift x (mm)", "shift z (mm)")
    return [
        heat(title, "", cells[[*axes, "panel", name]], axes, name, colours=colours)
        for name, (title, colours) in MAPS.items()
    ]


def _cells(poses: Survey) -> pd.DataFrame:
    """Return the worst values over y at each place of x and z; a place without a usable pose has its reason."""
    import pandas as pd

    counts, usable = poses.counts, poses.usable.reshape(poses.counts)

    def worst(values: object, sign: int = 1) -> np.ndarray:
        every = np.asarray(values, dtype=np.float64).reshape(counts)
        return np.asarray(sign * np.where(usable, sign * every, -np.inf).max(axis=1))

    known = poses.weight > 0
    free, seen = (part.reshape(counts).any(axis=1) for part in (known & ~poses.blocked, known))
    some, sign = usable.any(axis=1), worst(poses.sign)
    place = np.where(some & (sign == worst(poses.sign, -1)), sign, 0.0).astype(int) + 1
    unknown, saturated, blocked = STATES
    state = np.where(free, saturated, np.where(seen, blocked, unknown))
    equal = np.clip(np.where(some, worst(poses.multiplicity), 1), 1, len(EQUAL)).astype(int)
    x, z = poses.shift[0].reshape(counts)[:, 0, 0], poses.shift[2].reshape(counts)[0, 0]
    grid = np.meshgrid(np.round(x, 4), np.round(z, 4), indexing="ij")
    table = {
        "shift x (mm)": grid[0],
        "shift z (mm)": grid[1],
        "condition number": _limited(np.where(some, worst(poses.condition), np.nan)),
        "sign of det J": np.where(some, np.take(list(SIGNS), place), state),
        "poses with equal readings": np.where(some, np.take(list(EQUAL), equal - 1), state),
        "noise (µm)": _limited(np.where(some, 1e3 * worst(poses.noise_mm), np.nan)),
    }
    return pd.DataFrame({name: values.ravel() for name, values in table.items()})


def _limited(values: np.ndarray) -> np.ndarray:
    known = values[np.isfinite(values) & (values > 0)]
    return np.minimum(values, DECADES * known.min()) if len(known) else values


def claim_figures(table: pd.DataFrame, c: float) -> list[Figure]:
    """Return the ambiguous share of the workspace over c, of the rows of claim.csv, with the given c, mm, marked."""
    import altair as alt
    import pandas as pd

    x, y = "height c of S2 and S3 over S1 (mm)", "ambiguous poses (%)"
    magnets = zip(numbers(table, "magnet_height_mm"), numbers(table, "l0_mm"), strict=True)
    data = pd.DataFrame({
        x: numbers(table, "c_mm"),
        y: numbers(table, "alike_percent").clip(lower=NONE),
        "panel": [f"magnet {height:g} mm high, l0 = {l0:g} mm" for height, l0 in magnets],
        "series": texts(table, "readings"),
    })  # fmt: skip
    data = data.dropna(subset=[x, y], ignore_index=True)
    lines = alt.Chart().mark_line(point=True).encode(x=alt.X(x, **FREE), y=alt.Y(y, **LOG), **styles(data["series"]))
    chart = panels(alt.layer(*rule("x", c, "the given layout"), lines), data, columns=1)
    return [Figure("Ambiguous share of the workspace", f"{NONE:g} % stands for none.", chart, data)]
