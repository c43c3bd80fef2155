"""Figures of sensitivity and of tolerances (`magtip sensitivity`): Sobol indices, Morris' effects, made sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Ints
from studies.output.text_tables import with_unit
from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Guide, Panel, Series, grouped, series
from studies.report.sweep_figures import name_of

APART = 0.17
"""Distance of both orders of an index from the middle of their line, lines."""
MADE = {
    "sensitivity": "sensitivity",
    "zeroed_force_error_N": "force error after zeroing (N)",
    "recalibrated_force_error_N": "force error after recalibration (N)",
}
"""Quantities of made sensors that are drawn, by the middle of their columns' names."""


def sobol(table: Table) -> list[Figure]:
    """Return the indices of first and total order of each input, a panel for each output."""
    panels, sentences = [], []
    every = list(dict.fromkeys(table.texts("input")))
    place = {name: len(every) - 1 - k for k, name in enumerate(every)}
    inputs = table.texts("input")
    for output, rows in grouped(table.texts("output")).items():
        total = table.floats("total_order")[rows]
        if not np.isfinite(total).any():
            continue
        names = [inputs[row] for row in rows]
        parts = [_order(table, rows, order, shift, place) for order, shift in (("first", APART), ("total", -APART))]
        panels.append(Panel(name_of(output), tuple(parts)))
        largest = int(np.nanargmax(total))
        sentences.append(
            f"{name_of(output).partition(' (')[0]} {names[largest].replace('_', ' ')} ({total[largest]:.2f})"
        )
    failed, points = int(np.nansum(table.floats("failed")[:1])), int(np.nansum(table.floats("points")[:1]))
    caption = (
        f"Largest total index: {'; '.join(sentences[:6])}. Bars are 95 % intervals; {failed} of {points} points "
        "failed, which the intervals include. A total index above the first-order one means that inputs interact."
    )
    error, outputs = table.floats("model_error_over_deviation"), table.texts("output")
    doubtful = dict.fromkeys(name_of(outputs[row]).partition(" (")[0] for row in np.flatnonzero(error > 1).tolist())
    if doubtful:
        caption += f" Do not read those of {', '.join(doubtful)}: the model's error exceeds the variation."
    return [
        Figure(
            "Sobol indices",
            caption,
            Axis("index (share of the variance)"),
            Axis("", categories=tuple(name.replace("_", " ") for name in reversed(every))),
            tuple(panels),
            guides=(Guide("x", 0.0),),
            source=table.name,
            replaces=("sobol.png",),
        )
    ]


def _order(table: Table, rows: Sequence[int], order: str, shift: float, place: dict[str, int]) -> Series:
    """Return the indices of one order of one output."""
    inputs = [table.texts("input")[row] for row in rows]
    return series(
        f"{order} order",
        table.floats(f"{order}_order")[rows],
        [place[name] + shift for name in inputs],
        0 if order == "first" else 1,
        line=False,
        low=table.floats(f"{order}_order_low")[rows],
        high=table.floats(f"{order}_order_high")[rows],
        across=True,
        names=[name.replace("_", " ") for name in inputs],
    )


def morris(table: Table) -> list[Figure]:
    """Return sigma over mu* of each input, a panel for each output."""
    panels = []
    styles = {name: k for k, name in enumerate(dict.fromkeys(table.texts("input")))}
    for output, rows in grouped(table.texts("output")).items():
        star, sigma = table.floats("mu_star"), table.floats("sigma")
        parts = [
            series(
                table.texts("input")[row].replace("_", " "),
                star[[row]],
                sigma[[row]],
                styles[table.texts("input")[row]],
                line=False,
                low=table.floats("mu_star_low")[[row]],
                high=table.floats("mu_star_high")[[row]],
                across=True,
            )
            for row in rows
            if np.isfinite(star[row])
        ]
        unit = next((text for text in table.texts("effect_unit") if text), "")
        unit = table.texts("effect_unit")[rows[0]] or unit
        if parts:
            panels.append(
                Panel(
                    name_of(output).partition(" (")[0], tuple(parts), x=with_unit("\N{GREEK SMALL LETTER MU}*", unit)
                )
            )
    failed, points = int(np.nansum(table.floats("failed")[:1])), int(np.nansum(table.floats("points")[:1]))
    caption = (
        "Right: inputs that matter. Up: inputs whose effect depends on the others or is not linear. "
        f"\N{GREEK SMALL LETTER SIGMA} has the unit of \N{GREEK SMALL LETTER MU}*. Bars are 95 % intervals; {failed} "
        f"of {points} points failed."
    )
    return [
        Figure(
            "Morris' effects by finite elements",
            caption,
            Axis("\N{GREEK SMALL LETTER MU}*"),
            Axis("\N{GREEK SMALL LETTER SIGMA}"),
            tuple(panels),
            shared=False,
            source=table.name,
            replaces=("morris.png",),
        )
    ]


def made_sensors(table: Table) -> list[Figure]:
    """Return the distribution of sensitivity and force errors of made sensors, a line for each axis."""
    panels, sentences = [], []
    for middle, title in MADE.items():
        parts, unit = [], ""
        for style, way in enumerate("zxy"):
            name = _column(table, f"{way}_{middle}")
            if not name:
                continue
            unit = name.partition("sensitivity_")[2].replace("_per_", "/")
            values = np.sort(table.floats(name)[np.isfinite(table.floats(name))])
            if not len(values):
                continue
            # failed sensors are never below a value: the curve then ends below 100 %
            share = 100 * np.arange(1, len(values) + 1) / len(table)
            shown = _evenly(len(values))
            parts.append(series(f"axis {way}", values[shown], share[shown], style, mark=False))
            if middle.startswith("zeroed"):
                sentences.append(f"{way} {np.quantile(values, 0.95):.3g} N")
        if parts:
            panels.append(Panel(title.partition(" (")[0], tuple(parts), x=with_unit(title, unit)))
    failed = len(table) - int(table.ok.sum())
    caption = (
        f"Share of {len(table)} made sensors below a value; {failed} failed and count as above every value. 95 % of "
        f"the sensors that work have a force error after zeroing of at most: {', '.join(sentences)}."
    )
    return [
        Figure(
            "Sensors made within their tolerances",
            caption,
            Axis("value"),
            Axis("sensors below (%)"),
            tuple(panels),
            shared=False,
            guides=(Guide("y", 95.0, "95 %"),),
            source=table.name,
            replaces=("montecarlo.png",),
        )
    ]


def _column(table: Table, start: str) -> str:
    """Return the first column whose name starts like this."""
    return next((name for name in table.columns if name.startswith(start)), "")


def _evenly(count: int) -> Ints:
    """Return at most 200 indices, evenly spaced: a curve needs no more."""
    return np.unique(np.linspace(0, count - 1, min(count, 200)).round().astype(np.int64))
