"""Pictures of a sweep over sampled points: each quantity over each axis, its error over the two most effective."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.exploration import sweep_maps
from studies.exploration.sweep_axes import Axis, axis_of, index_of, log_spaced, scale, turn, wrapped
from studies.exploration.sweep_cube import failed
from studies.exploration.sweep_views import Shown
from studies.output import table_plots
from studies.output.table_plots import COLOURS
from studies.output.text_tables import with_unit

MOST_COLUMNS = 4
"""Greatest number of axes side by side."""
MANY = 500
"""Number of points beyond which they have no edges and show through each other."""
BINS = 8
"""Number of parts of an axis between whose means the effect of the axis is measured."""
MARKERS = "o^sDv<"


def draw(
    names: Iterator[Path],
    columns: Mapping[str, NDArray[Any]],
    axes: Mapping[str, Sequence[float | str]],
    shown: Sequence[Shown],
    notes: Sequence[str],
) -> list[Path]:
    """Draw the pictures of all quantities; return their files."""
    named = {name: _sampled_axis(name, values, columns[name]) for name, values in axes.items()}
    jobs = []
    for quantity in shown:
        targets = [_numbers(columns, column) for column in (quantity.errors or quantity.values).values()]
        target = max(targets, key=lambda values: float(np.nan_to_num(np.nanstd(values))))
        order = sorted(named.values(), key=lambda axis: -effect(position(axis, columns), target))
        parts = math.ceil(len(order) / MOST_COLUMNS)
        size = math.ceil(len(order) / parts)
        for k in range(0, len(order), size):
            pair = _pair(order) if k == 0 and quantity.errors else []
            jobs.append((quantity, order[k : k + size], pair))
    files = list(itertools.islice(names, len(jobs)))
    for n, (file, (quantity, own, pair)) in enumerate(zip(files, jobs, strict=True), start=1):
        counted = [f"Picture {n} of {len(jobs)}."] if len(jobs) > 1 else []
        _picture(file, columns, quantity, own, pair, [*notes, *counted])
    return files


def _pair(order: Sequence[Axis]) -> list[Axis]:
    """Return the first two axes, numbers before texts; none if there is only one."""
    return sorted(order, key=lambda axis: axis.texts)[:2] if len(order) > 1 else []


def _sampled_axis(name: str, values: Sequence[float | str], column: NDArray[Any]) -> Axis:
    """Return an axis with all values of its column; texts keep the study's order."""
    texts = any(isinstance(value, str) for value in (*values, *np.asarray(column).ravel()[:1].tolist()))
    every = list(dict.fromkeys([*values, *column.tolist()])) if texts else np.unique(column.astype(float)).tolist()
    return axis_of(name, every)


def position(axis: Axis, columns: Mapping[str, NDArray[Any]]) -> Array:
    """Return the rows' coordinates on an axis, shape (n,)."""
    column = columns[axis.column]
    return index_of(axis, column).astype(float) if axis.texts else np.asarray(column, dtype=float)


def _numbers(columns: Mapping[str, NDArray[Any]], name: str) -> Array:
    return np.where(failed(columns), np.nan, np.asarray(columns[name], dtype=float))


def effect(x: Array, y: Array) -> float:
    """Return the share of the variance of y that the means over parts of x explain, 0 to 1."""
    some = np.isfinite(y)
    x, y = x[some], y[some]
    if len(y) < 2 or not y.std() > 0:
        return 0.0
    parts = np.array_split(y[np.argsort(x, kind="stable")], min(BINS, len(y)))
    between = sum(len(part) * (part.mean() - y.mean()) ** 2 for part in parts)
    return float(between / (len(y) * y.var()))


def _picture(
    file: Path,
    columns: Mapping[str, NDArray[Any]],
    quantity: Shown,
    axes: Sequence[Axis],
    pair: Sequence[Axis],
    notes: Sequence[str],
) -> None:
    """Draw values and errors of a quantity over some axes, and the errors over a pair of axes."""
    width = 7.0 if len(axes) <= 3 else 9.0
    text = "\n".join(part for note in notes for part in textwrap.wrap(note, int(width * 11)))
    rows = [(quantity.values, with_unit(quantity.label, quantity.unit), False)]
    if quantity.errors:
        rows.append((quantity.errors, with_unit(f"error of {quantity.label}", quantity.error_unit), True))
    maps = list(quantity.errors.items()) if pair else []
    across = min(2, len(maps)) or 1
    upper, lower = 2.45 * len(rows) + 0.5, 2.9 * math.ceil(len(maps) / across)
    with table_plots.sheet(file, width, upper + lower + 0.5 + 0.19 * len(text.splitlines())) as figure:
        # panels and maps with colour bars have layouts of their own
        parts = figure.subfigures(2, 1, height_ratios=[upper, lower]) if maps else [figure]
        grid = parts[0].subplots(len(rows), len(axes), squeeze=False, sharex="col", sharey="row")
        for r, (models, label, error) in enumerate(rows):
            for c, axis in enumerate(axes):
                _points(grid[r, c], columns, axis, models, list(quantity.values), error=error)
                _scale(grid[r, c], "x", axis, 0.8 * width / len(axes))
                grid[r, c].locator_params(axis="y", nbins=5)
            _foot(grid[r], columns, axes)
            grid[r, 0].set_ylabel(wrapped(label, 2.2))
        for panel, axis in zip(grid[-1], axes, strict=True):
            panel.set_xlabel(axis.label)
            turn(panel, axis, 0.8 * width / len(axes))
        for k, (model, column) in enumerate(maps):
            panel = parts[1].add_subplot(math.ceil(len(maps) / across), across, k + 1)
            inches = 0.7 * width / across
            _map(
                parts[1],
                panel,
                columns,
                pair,
                column,
                f"{quantity.label},\n{with_unit(f'error of {model}', quantity.error_unit)}",
                inches,
            )
        handles, count = table_plots.legend_columns(_handles(columns, quantity), width)
        figure.legend(handles=handles, loc="outside upper center", ncols=count, frameon=False)
        if text:
            figure.supxlabel(text, fontsize=10, color="#555555")


def _foot(panels: Sequence[Any], columns: Mapping[str, NDArray[Any]], axes: Sequence[Axis]) -> None:
    """Draw failed cases as crosses at the lower edge of panels that share their range of values."""
    lost = failed(columns)
    if not lost.any():
        return
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(low - 0.1 * (high - low), high)
    for panel, axis in zip(panels, axes, strict=True):
        x, edge = position(axis, columns)[lost], panel.get_xaxis_transform()
        panel.plot(x, np.full(len(x), 0.04), "x", color="#555555", transform=edge, markersize=4, label="_failed")


def _scale(panel: Any, way: str, axis: Axis, inches: float) -> None:
    """Scale an axis; that of many points is logarithmic if their quantiles are log-spaced."""
    few = axis
    if not axis.texts and len(axis) > BINS:
        quantiles = np.quantile(axis.positions, np.linspace(0.02, 0.98, BINS))
        spread = np.geomspace if log_spaced(quantiles) else np.linspace
        few = Axis(axis.column, tuple(spread(axis.values[0], axis.values[-1], 4 * BINS)), texts=False)
    scale(panel, way, few, inches)


def _size(count: int) -> float:
    """Return the size of the points of a panel, points: smaller where there are many."""
    return float(np.clip(60 / math.sqrt(max(count, 1)), 0.8, 5.0))


def _points(
    panel: Any,
    columns: Mapping[str, NDArray[Any]],
    axis: Axis,
    models: Mapping[str, str],
    order: Sequence[str],
    *,
    error: bool,
) -> None:
    """Draw the values of all models over an axis; failed cases are crosses at the lower edge."""
    x = position(axis, columns)
    size = _size(len(x))
    if error:
        table_plots.bands(panel)
    for model, column in models.items():
        n = order.index(model) if model in order else 0
        face = COLOURS[n] if n == 0 else "none"
        style: dict[str, Any] = {"color": COLOURS[n], "markerfacecolor": face, "markersize": size, "mew": 0.7}
        panel.plot(
            x,
            _numbers(columns, column),
            MARKERS[n % 6],
            rasterized=True,
            alpha=0.8 if len(x) <= MANY else 0.4,
            **style,
        )


def _map(
    figure: Any,
    panel: Any,
    columns: Mapping[str, NDArray[Any]],
    pair: Sequence[Axis],
    column: str,
    label: str,
    inches: float,
) -> None:
    """Draw an error as colours of the points over two axes."""
    x, y = (position(axis, columns) for axis in pair)
    values, lost = _numbers(columns, column), failed(columns)
    norm, extend = sweep_maps.error_norm(values)
    order = np.argsort(np.nan_to_num(abs(values)), kind="stable")
    order = order[np.isfinite(values[order])]
    style: dict[str, Any] = {"cmap": sweep_maps.ERRORS, "norm": norm, "edgecolors": "#555555"}
    style["linewidths"] = 0.3 if len(x) <= MANY else 0.0
    size = float(np.clip(280 / math.sqrt(len(x)), 1.5, 8.0)) ** 2
    points = panel.scatter(x[order], y[order], s=size, c=values[order], rasterized=True, **style)
    panel.plot(x[lost], y[lost], "x", color="#555555", markersize=4, label="_failed")
    for way, axis in zip("xy", pair, strict=True):
        _scale(panel, way, axis, inches if way == "x" else 2.2)
    panel.set(xlabel=pair[0].label, ylabel=pair[1].label)
    bar = figure.colorbar(points, ax=panel, extend=extend, pad=0.02)
    bar.set_label(label, fontsize=10)


def _handles(columns: Mapping[str, NDArray[Any]], quantity: Shown) -> list[list[Any]]:
    """Return the groups of the legend's entries."""
    from matplotlib.lines import Line2D

    models: list[Any] = []
    for n, model in enumerate(quantity.values):
        face = COLOURS[n] if n == 0 else "none"
        style: dict[str, Any] = {"color": COLOURS[n], "markerfacecolor": face, "linestyle": "none"}
        models.append(Line2D([], [], marker=MARKERS[n % 6], label=model, **style))
    others = table_plots.band_handles() if quantity.errors else []
    lost = failed(columns)
    if lost.any():
        others.append(sweep_maps.failed_handle(int(lost.sum()), len(lost), maps=False))
    return [models, others] if others else [models]
