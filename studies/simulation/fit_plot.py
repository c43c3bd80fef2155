"""The plot of a uniaxial test with the laws fitted to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.output.table_plots import COLOURS, canvas, label


def draw(
    path: str | Path,
    stretch: Sequence[float],
    stress: Sequence[float],
    smooth: Sequence[float],
    curves: Mapping[str, Sequence[Any]],
) -> None:
    """A uniaxial test with the laws fitted to it, the best first, and what they leave over.

    Parameters
    ----------
    stretch, stress : points of the test, shape (n,), the stress in MPa.
    smooth : stretches of the curves.
    curves : for each law the stress at `smooth` and at `stretch`, MPa.
    """
    largest = max(abs(value) for value in stress)
    order = sorted(range(len(stretch)), key=lambda k: stretch[k])
    with canvas(path, 2, 1) as (figure, axes):
        axes[0].plot(stretch, stress, "o", color="#555555", markerfacecolor="white", label="test", zorder=1)
        for (law, (curve, at)), colour, dashes in zip(curves.items(), COLOURS, ("-", "--", "-.", ":"), strict=False):
            look = {"color": colour, "linestyle": dashes}
            axes[0].plot(smooth, curve, label=law, **look)
            rest = [100 * (at[k] - stress[k]) / largest for k in order]
            axes[1].plot([stretch[k] for k in order], rest, marker="o", markersize=3, **look)
        axes[1].axhline(0, color="#777777", linewidth=0.8)
        label(axes[0], "a", "nominal stress (MPa)")
        label(axes[1], "b", "law less test (% of max.)")
        axes[1].set_xlabel("stretch")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, columnspacing=1.2
        )
