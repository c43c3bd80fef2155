"""Pictures of a layout: maps over x and z, and the share of ambiguous poses over c."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.output.table_plots import ANALYTIC, COLOURS, FEM, sheet

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.survey import Survey
    from geometry.arrays import Array
    from studies.sensing.claim_rows import HeightRow


PLANE = (61, 31)
"""Numbers of poses along x and z in the plane y = 0."""
STATES = {"tilt not known": "#ffffff", "saturated": "#cfcfcf", "blocked": "#8a8a8a"}
BOTH = "#F0E442"
MOST = 4
"""Largest number of poses with the same readings that the colour scale distinguishes."""
DECADES = 1e3
"""Largest ratio of the ends of a colour scale: values near a fold grow without bound."""


def maps(path: Path, coder: Decoder, whole: Survey, room: float = 0.0) -> None:
    """Plot condition number, sign of det J, multiplicity and noise over x and z: at y = 0, and the worst over y."""
    import numpy as np
    from matplotlib.patches import Patch
    from matplotlib.ticker import LogLocator, NullFormatter

    from analytic import survey

    x, z = (np.linspace(coder.low[k], coder.high[k], n) for k, n in zip((0, 2), PLANE, strict=True))
    shift = np.stack(np.meshgrid(x, [0.0], z, indexing="ij")).reshape(3, -1)
    plane = survey.at_poses(coder, shift, np.ones(shift.shape[1]), (len(x), 1, len(z)), clearance=room)
    with sheet(path, 7.0, 8.2, style={"axes.grid": False}) as figure:
        axes = figure.subplots(4, 2, sharex=True, sharey=True)
        scales = _scales([plane, whole])
        for row, (name, (label, look)) in enumerate(scales.items()):
            drawn = [_draw(axes[row, k], poses, name, look) for k, poses in enumerate((plane, whole))]
            bar = figure.colorbar(drawn[0], ax=axes[row, :], label=label, aspect=12, pad=0.02)
            if name == "sign":
                bar.set_ticks([-2 / 3, 0, 2 / 3], labels=["< 0", "both", "> 0"])
            if name in ("condition", "noise"):
                bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                bar.ax.yaxis.set_major_formatter("{x:g}")
                bar.ax.yaxis.set_minor_formatter(NullFormatter())
            if name == "multiplicity":
                bar.set_ticks(range(1, MOST + 1), labels=[*map(str, range(1, MOST)), f"{MOST}+"])
            axes[row, 0].set_ylabel("shift $z$ (mm)")
        for axis, title in zip(axes[0], ("plane $y$ = 0", "worst over all $y$"), strict=True):
            axis.set_title(title, fontsize=12)
        for axis in axes[-1]:
            axis.set_xlabel("magnet shift $x$ (mm)")
        axes[0, 0].set(xlim=x[[0, -1]], ylim=z[[0, -1]])
        states = [Patch(facecolor=c, edgecolor="#555555", linewidth=0.5, label=n) for n, c in STATES.items()]
        figure.legend(handles=states, loc="outside lower center", ncols=3, frameon=False)


def _scales(surveys: Sequence[Survey]) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return label and colours of each row of maps; all surveys share one scale."""
    import numpy as np
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, LogNorm

    norms = {}
    for name in ("condition", "noise"):
        values = np.concatenate([_values(s, name)[s.usable] for s in surveys])
        values = values[np.isfinite(values) & (values > 0)]
        low, high = (values.min(), values.max()) if len(values) else (1.0, 10.0)
        norms[name] = LogNorm(low, min(max(high, 2 * low), DECADES * low))
    signs = {"cmap": ListedColormap([FEM, BOTH, ANALYTIC]), "vmin": -1, "vmax": 1}
    many = {"cmap": colormaps["viridis"].resampled(MOST), "vmin": 0.5, "vmax": MOST + 0.5}
    return {
        "condition": ("condition number", {"cmap": "viridis", "norm": norms["condition"]}),
        "sign": ("sign of det $J$\n(readings by shift)", signs),
        "multiplicity": ("poses with\nequal readings", many),
        "noise": ("noise of the\ndecoded shift (µm)", {"cmap": "plasma", "norm": norms["noise"]}),
    }


def _values(poses: Survey, name: str) -> Array:
    import numpy as np

    chosen = {
        "condition": poses.condition,
        "sign": poses.sign,
        "multiplicity": np.minimum(poses.multiplicity, MOST),
        "noise": 1e3 * poses.noise_mm,
    }
    return np.asarray(chosen[name], dtype=np.float64)


def _draw(axis: Any, poses: Survey, name: str, look: dict[str, Any]) -> Any:
    """Draw one map; a point without a usable pose is grey."""
    import numpy as np
    from matplotlib.colors import ListedColormap

    counts = poses.counts
    usable = poses.usable.reshape(counts)
    values = _values(poses, name).reshape(counts)
    most = np.where(usable, values, -np.inf).max(axis=1)
    if name == "sign":
        least = np.where(usable, values, np.inf).min(axis=1)
        most = np.where(most == least, most, 0.0)
    some = usable.any(axis=1)
    free = (poses.weight > 0) & ~poses.blocked
    state = np.where(
        free.reshape(counts).any(axis=1), 1, np.where((poses.weight > 0).reshape(counts).any(axis=1), 2, 0)
    )
    x, z = poses.shift[0].reshape(counts)[:, 0, 0], poses.shift[2].reshape(counts)[0, 0]
    greys = ListedColormap(list(STATES.values()))
    axis.pcolormesh(x, z, state.T, cmap=greys, vmin=0, vmax=2, shading="nearest", rasterized=True)
    shown = np.ma.masked_where(~some, most)
    return axis.pcolormesh(x, z, shown.T, shading="nearest", rasterized=True, **look)


def claim(path: Path, rows: Sequence[HeightRow], c: float) -> None:
    """Plot the ambiguous share of the workspace over c, for each magnet and form of the readings."""
    magnets = sorted({(row.magnet_height_mm, row.l0_mm) for row in rows})
    forms = list(dict.fromkeys(row.readings for row in rows))
    with sheet(path, 7.0, 2.1 * len(magnets) + 0.9) as figure:
        axes = figure.subplots(len(magnets), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axis, (height, l0) in zip(axes, magnets, strict=True):
            for form, colour, mark in zip(forms, COLOURS, "os^", strict=False):
                own = [r for r in rows if (r.magnet_height_mm, r.l0_mm, r.readings) == (height, l0, form)]
                alike = [r.figures.alike_percent for r in own]
                axis.plot([r.c_mm for r in own], alike, color=colour, marker=mark, label=form)
            axis.axvline(c, color="#555555", linestyle=":", linewidth=1.2)
            axis.set_title(f"magnet {height:g} mm high, $l_0$ = {l0:g} mm", fontsize=11)
            axis.set_ylabel("ambiguous (%)")
        axes[0].set_yscale("symlog", linthresh=0.1, linscale=0.5)
        axes[0].set(ylim=(-0.01, 100), yticks=[0, 0.1, 1, 10, 100], yticklabels=["0", "0.1", "1", "10", "100"])
        axes[-1].set_xlabel("height $c$ of S2 and S3 over S1 (mm); dotted: the given layout")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
