"""Pictures of a sensitivity study: bars of Sobol indices, mu* and sigma of Morris, histograms of made sensors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.output.table_plots import ANALYTIC, COLOURS, FEM, legend_columns, sheet
from studies.output.text_tables import titled
from studies.sensitivity.calibration import AxisSpread

WIDTH, BAR, COLUMNS = 7.0, 0.17, 3
"""Width of a picture, and height of a bar, in; number of panels side by side."""
BINS = 40
"""Number of bars of a histogram."""
PANELS = {
    "sensitivity": "sensitivity",
    "zeroed_force_error": "force error\nafter zeroing (N)",
    "recalibrated_force_error": "force error after\nrecalibration (N)",
}
"""Quantities with a histogram for each axis, and their labels."""
MARKERS = "osD^vP*XhH8p"
"""Markers of the inputs in a chart of Morris."""


def named(field: str) -> str:
    """Return the name of a field of a design as words, a line for each two.

    >>> named("magnet_edge_radius")
    'magnet edge\\nradius'
    """
    words = field.split("_")
    return "\n".join(" ".join(words[k : k + 2]) for k in range(0, len(words), 2))


def by_output(rows: Sequence[Any]) -> Iterator[tuple[str, list[Any]]]:
    """Yield the outputs with their rows, in order."""
    for output in dict.fromkeys(row.output for row in rows):
        yield output, [row for row in rows if row.output == output]


def sobol(path: Path, rows: Sequence[Any]) -> None:
    """Draw indices of first and total order of each output as bars with their intervals."""
    panels = [(output, each) for output, each in by_output(rows) if each[0].first_order is not None]
    if not panels:
        return
    lines = -(-len(panels) // COLUMNS)
    with sheet(path, WIDTH, lines * (BAR * 2 * len(panels[0][1]) + 0.9) + 0.4) as figure:
        axes = figure.subplots(lines, COLUMNS, squeeze=False, sharex=True, sharey=True).ravel()
        for axis, (output, each) in zip(axes, panels, strict=False):
            for shift, order, colour in ((-0.2, "first", FEM), (0.2, "total", ANALYTIC)):
                values = [getattr(row, f"{order}_order") for row in each]
                ends = [[getattr(row, f"{order}_order_{end}") for row in each] for end in ("low", "high")]
                below = [value - low for value, low in zip(values, ends[0], strict=True)]
                above = [high - value for value, high in zip(values, ends[1], strict=True)]
                places = [k + shift for k in range(len(each))]
                axis.barh(places, values, 0.38, color=colour, label=f"{order} order")
                axis.errorbar(values, places, xerr=[below, above], fmt="none", ecolor="#000000", capsize=2)
            axis.set_yticks(range(len(each)), [named(row.input) for row in each])
            axis.set_title(titled(output).partition(" (")[0], loc="left", fontsize=12)
        axes[0].invert_yaxis()
        axes[0].set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        _finish(figure, axes, len(panels), "Sobol index")


def morris(path: Path, rows: Sequence[Any]) -> None:
    """Draw sigma over mu* of each output, a marker for each input with its interval of mu*."""
    panels = [(output, each) for output, each in by_output(rows) if each[0].mu_star is not None]
    if not panels:
        return
    lines = -(-len(panels) // COLUMNS)
    with sheet(path, WIDTH, 2.2 * lines + 0.7) as figure:
        axes = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
        for axis, (output, each) in zip(axes, panels, strict=False):
            for k, row in enumerate(each):
                assert row.mu_star is not None
                assert row.mu_star_low is not None
                assert row.mu_star_high is not None
                span = [[row.mu_star - row.mu_star_low], [row.mu_star_high - row.mu_star]]
                axis.errorbar(
                    row.mu_star,
                    row.sigma,
                    xerr=span,
                    fmt=MARKERS[k % len(MARKERS)],
                    color=COLOURS[k % len(COLOURS)],
                    capsize=2,
                    label=named(row.input),
                    clip_on=False,
                )
            name, _, unit = titled(output).partition(" (")
            axis.set_title(name, loc="left", fontsize=12)
            axis.set(xlabel=f"µ* ({unit.rstrip(')')}/range)", ylabel="σ")
            axis.set_xlim(left=0)
            axis.set_ylim(bottom=0)
            _thin_ticks(axis)
        _finish(figure, axes, len(panels), "")


def monte_carlo(path: Path, axes: Mapping[str, AxisSpread], unit: str) -> None:
    """Draw histograms of sensitivity and errors of the made sensors, a line of panels for each axis."""
    import numpy as np

    spread = {name: axis for name, axis in axes.items() if np.isfinite(axis.made["sensitivity"]).any()}
    if not spread:
        return
    with sheet(path, WIDTH, 1.8 * len(spread) + 0.9) as figure:
        panels = figure.subplots(len(spread), len(PANELS), squeeze=False)
        for last, line, (name, one) in zip([*[False] * (len(spread) - 1), True], panels, spread.items(), strict=True):
            for axis, (quantity, label) in zip(line, PANELS.items(), strict=True):
                values = one.made[quantity]
                axis.hist(values[np.isfinite(values)], BINS, color=FEM)
                of_label = f"({unit})" if quantity == "sensitivity" else ""
                if last:
                    axis.set_xlabel(f"{label}\n{of_label}" if of_label else label)
                _thin_ticks(axis)
            line[0].axvline(one.nominal["sensitivity"], color=ANALYTIC, label="nominal design")
            line[0].set_ylabel(f"sensors, axis {name}")
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", frameon=False)


def _thin_ticks(axis: Any) -> None:
    """Write few and short numbers at the axes of a small panel."""
    axis.locator_params(nbins=3)
    for line in (axis.xaxis, axis.yaxis):
        line.set_major_formatter("{x:g}")


def _finish(figure: Any, axes: Any, used: int, label: str) -> None:
    """Remove empty panels, label the x axes, and add a legend above all panels."""
    for axis in axes[used:]:
        axis.remove()
    if label:
        for axis in axes[max(used - COLUMNS, 0) : used]:
            axis.set_xlabel(label)
            axis.tick_params(labelbottom=True)
    handles, across = legend_columns([axes[0].get_legend_handles_labels()[0]], figure.get_figwidth())
    figure.legend(handles=handles, loc="outside upper center", ncols=across, frameon=False)
