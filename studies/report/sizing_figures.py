"""Figures of a sizing (`magtip size`): the front by finite elements, the surrogate's differences, the yield."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Guide, Panel, Series, series
from studies.report.sweep_figures import name_of

FRONTS = (
    ("fem_range_z_N", "fem_resolution_z_mN", "Resolution over range, finite elements"),
    ("fem_range_z_N", "outer_size_mm", "Outer size over range, finite elements"),
    ("fem_range_x_N", "fem_resolution_x_mN", "Sideways resolution over sideways range, finite elements"),
)
"""Pairs of columns of front.csv that are drawn."""
SHOWN = (
    *("rank", "status", "D_mm", "L_mm", "magnet", "silicone", "hall_part"),
    *("fem_range_z_N", "fem_resolution_z_mN", "fem_strain_percent", "outer_size_mm"),
)
"""Columns of front.csv that the page shows as a table."""
BEST, PASSED, FAILED = 0, 2, 1
"""Styles of the best variant, of those that pass, and of those that finite elements removed."""


def front(table: Table) -> list[Figure]:
    """Return the front in its objectives, and how far the surrogate was from finite elements."""
    rank = table.floats("rank")
    ok = table.ok
    names = _names(table)
    figures = []
    for x, y, title in FRONTS:
        if not table.has(x, y) or not _varies(table.floats(x)) or not _varies(table.floats(y)):
            continue
        parts = _groups(table, x, y, rank, ok, names)
        caption = f"{int(ok.sum())} of {len(table)} variants of the front meet all requirements by finite elements. "
        best = np.flatnonzero(rank == 1)
        if len(best):
            row = best[0]
            caption += (
                f"The best one, {names[row]}, has {_value(x, table.floats(x)[row])} and "
                f"{_value(y, table.floats(y)[row])}."
            )
        axis = Axis(name_of(y.removeprefix("fem_")), log="resolution" in y)
        figures.append(
            Figure(
                title,
                caption,
                Axis(name_of(x.removeprefix("fem_"))),
                axis,
                (Panel("", parts),),
                source=table.name,
                replaces=("front.png",),
            )
        )
    return [*figures, *_differences(table, names)]


def _varies(values: Array) -> bool:
    """Return whether a column has two different numbers."""
    return len(set(values[np.isfinite(values)].tolist())) > 1


def front_sheet(table: Table) -> Table:
    """Return the main columns of the front, with the numbers of finite elements."""
    names = [name for name in SHOWN if name in table.columns]
    return Table("Front", {name.removeprefix("fem_"): table.columns[name] for name in names})


def sheets(record: Mapping[str, Any]) -> list[Table]:
    """Return the tables of sizing.json: requirements with the margins of the best variant, and what conflicts."""
    winner = record.get("winner") or {}
    margins = winner.get("margins") or {}
    rows = [
        {
            "requirement": str(row.get("requirement", "")).replace("_", " "),
            "value": row.get("value"),
            "unit": "" if row.get("unit") == "1" else row.get("unit"),
            "margin of the best variant (%)": _percent(margins.get(row.get("requirement"))),
        }
        for row in _rows(record, "requirements")
        if row.get("value") is not None
    ]
    conflict = _rows(record, "conflict")
    return [_table(name, part) for name, part in (("Requirements", rows), ("Conflict", conflict)) if part]


def _rows(record: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    """Return a list of objects of a record; empty if it is none."""
    rows = record.get(name)
    return [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def _percent(margin: Any) -> float | None:
    return 100 * margin if isinstance(margin, (int, float)) else None


def _table(name: str, rows: list[dict[str, Any]]) -> Table:
    """Return rows as a table."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = {key: ["" if row.get(key) is None else row[key] for row in rows] for key in columns}
    return Table(name, {key: np.array(values, dtype=object) for key, values in cells.items()})


def _names(table: Table) -> list[str]:
    """Return what each variant is called in readouts."""
    D, L = table.floats("D_mm"), table.floats("L_mm")
    parts = [table.texts(name) for name in ("magnet", "silicone", "hall_part") if name in table.columns]
    sizes = [f"D {a:g} mm, L {b:g} mm" for a, b in zip(D, L, strict=True)]
    return [", ".join(text for text in (size, *rest) if text) for size, *rest in zip(sizes, *parts, strict=True)]


def _groups(table: Table, x: str, y: str, rank: Array, ok: NDArray[np.bool_], names: list[str]) -> tuple[Series, ...]:
    """Return the best variant, the others that pass, and those that failed."""
    groups = (
        ("best variant", BEST, ok & (rank == 1)),
        ("meets all requirements", PASSED, ok & (rank != 1)),
        ("removed by finite elements", FAILED, ~ok),
    )
    parts = []
    for label, style, rows in groups:
        own = [names[row] for row in np.flatnonzero(rows).tolist()]
        ranks = [f"{value:.0f}" if np.isfinite(value) else "" for value in rank[rows]]
        one = series(label, table.floats(x)[rows], table.floats(y)[rows], style, line=False, names=own, labels=ranks)
        parts += [one] if one.y else []
    return tuple(parts)


def _value(column: str, value: float) -> str:
    """Return a quantity in words."""
    name, _, unit = name_of(column.removeprefix("fem_")).partition(" (")
    return f"{name} {value:.3g} {unit.rstrip(')')}"


def _differences(table: Table, names: list[str]) -> list[Figure]:
    """Return the differences between surrogate and finite elements, a line for each quantity."""
    end = "_difference_percent"
    columns = [name for name in table.columns if name.endswith(end) and np.isfinite(table.floats(name)).any()]
    if not columns:
        return []
    parts = []
    for label, style, rows in (
        ("meets all requirements", PASSED, table.ok),
        ("removed by finite elements", FAILED, ~table.ok),
    ):
        x = np.concatenate([table.floats(name)[rows] for name in columns])
        place = np.repeat(np.arange(len(columns))[::-1].astype(float), int(rows.sum()))
        own = [names[row] for row in np.flatnonzero(rows).tolist()] * len(columns)
        one = series(label, x, place, style, line=False, names=np.array(own))
        parts += [one] if one.y else []
    largest = max(columns, key=lambda name: float(np.nanmax(np.abs(table.floats(name)))))
    worst = table.floats(largest)[np.nanargmax(np.abs(table.floats(largest)))]
    title = name_of(largest.removesuffix(end))
    caption = (
        f"Each point is one variant of the front. The largest difference is that of the {title}, {worst:+.2g} %."
    )
    return [
        Figure(
            "Surrogate against finite elements",
            caption,
            Axis("difference (%)"),
            Axis("", categories=tuple(name_of(name.removesuffix(end)) for name in reversed(columns))),
            (Panel("", tuple(parts)),),
            guides=(Guide("x", 0.0),),
            source=table.name,
        )
    ]


def made_within(table: Table) -> list[Figure]:
    """Return the share of made sensors within specification, for all requirements and for each."""
    names = [text.replace("_", " ") for text in table.texts("requirement")]
    share = table.floats("within_percent")
    one = series(
        "made sensors within",
        share,
        np.arange(len(names))[::-1].astype(float),
        0,
        line=False,
        low=table.floats("low_percent"),
        high=table.floats("high_percent"),
        across=True,
        names=np.array(names),
    )
    sensors = int(np.nan_to_num(table.floats("sensors")).max(initial=0))
    every = dict(zip(names, share.tolist(), strict=True))
    caption = f"Bars are 95 % intervals for {sensors} made sensors, without the errors of the surrogate."
    if "all" in every:
        caption = f"{every['all']:.3g} % of {sensors} made sensors meet all requirements. {caption}"
    return [
        Figure(
            "Yield of the best variant",
            caption,
            Axis("made sensors within (%)"),
            Axis("", categories=tuple(reversed(names))),
            (Panel("", (one,)),),
            source=table.name,
        )
    ]
