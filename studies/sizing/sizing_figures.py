"""Figures and tables of a sizing (`magtip size`): front by finite elements, differences of the surrogate, yield."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.loads import ANSWERED
from studies.output.figures import FREE, LOG, Figure, beside, labels, numbers, rule, styles, texts
from studies.output.text_tables import name_and_unit, quantity_name

if TYPE_CHECKING:
    import pandas as pd

FRONTS = (
    ("fem_range_z_N", "fem_resolution_z_mN", "Resolution over range (number: rank)"),
    ("fem_range_z_N", "outer_size_mm", "Outer size over range (number: rank)"),
    ("fem_range_x_N", "fem_resolution_x_mN", "Sideways resolution over sideways range (number: rank)"),
)
"""Pairs of columns of front.csv that are drawn."""
SHOWN = (
    *("rank", "status", "D_mm", "L_mm", "magnet", "silicone", "hall_part"),
    *("fem_range_z_N", "fem_resolution_z_mN", "fem_strain_percent", "outer_size_mm"),
)
"""Columns of front.csv that the page shows as a table."""
BEST, REMOVED, PASSED = "best variant", "removed by finite elements", "meets all requirements"
DOUBTED = "unknown whether it meets all"
KINDS = (BEST, REMOVED, PASSED, DOUBTED)
DIFFERENCE = "_difference_percent"


def front(table: pd.DataFrame) -> list[Figure]:
    """Return the front in its objectives, and how far the surrogate was from finite elements."""
    import altair as alt
    import pandas as pd

    names, rank, kinds = _names(table), numbers(table, "rank"), _kinds(table)
    kinds, passed = np.where((kinds == PASSED) & (rank == 1), BEST, kinds), int((kinds == PASSED).sum())
    doubted = int((kinds == DOUBTED).sum())
    unknown = f"; of {doubted} more it is unknown" if doubted else ""
    figures = []
    for across, up, title in FRONTS:
        if numbers(table, across).nunique() < 2 or numbers(table, up).nunique() < 2:
            continue
        x, y = (quantity_name(name.removeprefix("fem_")) for name in (across, up))
        caption = (
            f"{passed} of {len(table)} variants of the front meet all requirements by finite elements{unknown}. "
        )
        for row in np.flatnonzero(rank == 1)[:1]:
            caption += f"The best one, {names[row]}, has {_value(table, across, row)} and {_value(table, up, row)}."
        caption += " Variants whose scores differ by less than their errors share a rank."
        data = pd.DataFrame({x: numbers(table, across), y: numbers(table, up), "series": kinds, "point": names})
        data["label"] = [f"{one:.0f}" if np.isfinite(one) else "" for one in rank]
        data = data.dropna(subset=[x, y])
        log = "y" if "resolution" in up else ""
        axes = alt.Chart().encode(x=alt.X(x, **FREE), y=alt.Y(y, **(LOG if log else FREE)))
        points = axes.mark_point().encode(**styles(KINDS))
        chart = alt.layer(points, *labels(axes), data=beside(data, x, y, log))
        figures.append(Figure(title, caption, chart, data))
    return [*figures, *_differences(table, names)]


def _kinds(table: pd.DataFrame) -> np.ndarray:
    """Return of each variant whether it meets all requirements, as far as that is known."""
    # a variant that is not removed has a reason where it is unknown whether a requirement is met
    doubted = texts(table, "reason") != ""
    return np.where(~table["status"].isin(ANSWERED), REMOVED, np.where(doubted, DOUBTED, PASSED))


def front_sheet(table: pd.DataFrame) -> pd.DataFrame:
    """Return the main columns of the front, with the numbers of finite elements."""
    shown = table[[name for name in SHOWN if name in table]]
    return shown.rename(columns=lambda name: name.removeprefix("fem_"))


def sheets(record: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Return the tables of sizing.json: requirements with the margins of the best variant, and what conflicts."""
    import pandas as pd

    margins = (record.get("winner") or {}).get("margins") or {}
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
    return {name: pd.DataFrame(part) for name, part in (("Requirements", rows), ("Conflict", conflict)) if part}


def _rows(record: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    rows = record.get(name)
    return [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def _percent(margin: Any) -> float | None:
    return 100 * margin if isinstance(margin, (int, float)) else None


def _names(table: pd.DataFrame) -> list[str]:
    sizes = [f"D {D:g} mm, L {L:g} mm" for D, L in zip(numbers(table, "D_mm"), numbers(table, "L_mm"), strict=True)]
    parts = [texts(table, name) for name in ("magnet", "silicone", "hall_part")]
    return [", ".join(text for text in texts_of if text) for texts_of in zip(sizes, *parts, strict=True)]


def _value(table: pd.DataFrame, column: str, row: int) -> str:
    name, unit = name_and_unit(column.removeprefix("fem_"))
    return f"{name} {numbers(table, column).iloc[row]:.3g} {unit}"


def _differences(table: pd.DataFrame, names: list[str]) -> list[Figure]:
    import altair as alt
    import pandas as pd

    columns = [name for name in table.columns if name.endswith(DIFFERENCE) and numbers(table, name).notna().any()]
    if not columns:
        return []
    kinds = _kinds(table)
    x = "difference (%)"
    parts = [
        pd.DataFrame({x: numbers(table, name), "series": kinds, "point": names}).assign(
            quantity=quantity_name(name.removesuffix(DIFFERENCE))
        )
        for name in columns
    ]
    data = pd.concat(parts, ignore_index=True).dropna(subset=x)
    worst = data.loc[data[x].abs().idxmax()]
    caption = (
        "Each point is one variant of the front. The largest difference is that of the "
        f"{worst['quantity']}, {worst[x]:+.2g} %."
    )
    points = alt.Chart().mark_point().encode(
        x=x, y=alt.Y("quantity", sort=None), yOffset=alt.YOffset("series:N", sort=None), **styles(KINDS)
    ).properties(height=alt.Step(11))  # fmt: skip
    chart = alt.layer(*rule("x", 0.0), points, data=data)
    return [Figure("Surrogate against finite elements", caption, chart, data)]


def made_within(table: pd.DataFrame) -> list[Figure]:
    """Return the share of made sensors within specification, for all requirements and for each."""
    import altair as alt
    import pandas as pd

    x = "made sensors within (%)"
    data = pd.DataFrame({
        x: numbers(table, "within_percent"),
        "requirement": texts(table, "requirement").str.replace("_", " "),
        "low": numbers(table, "low_percent"),
        "high": numbers(table, "high_percent"),
    })  # fmt: skip
    sensors = int(numbers(table, "sensors").fillna(0).max())
    caption = f"Bars are 95 % intervals for {sensors} made sensors, without the errors of the surrogate."
    for share in data[x][data["requirement"] == "all"]:
        caption = f"{share:.3g} % of {sensors} made sensors meet all requirements. {caption}"
    shares = alt.Chart(data).encode(y=alt.Y("requirement", sort=None))
    bars = shares.mark_rule().encode(x=alt.X("low", title=x), x2="high")
    points = shares.mark_point().encode(x=alt.X(x, **FREE))
    return [Figure("Yield of the best variant", caption, bars + points, data)]
