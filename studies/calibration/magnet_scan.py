"""A scan: what a 3-axis chip reads while a stage moves the bare magnet along known positions, without silicone.

The field is that of `analytic.hall.field_at` at the chip, for a magnet at the stage's position (x, y, z), turned by
the yaw of the stage about z, plus an offset (3,), with a tilt (2,) about its centre:

    B_i = J / J_0 (B(Rz(yaw) position + offset, tilt) . n_i) + z_i

z_i is the offset of an axis with the ambient field. Least squares with normal priors; the noise follows from the
residuals. J is the polarisation at the working point: a flat magnet demagnetises itself, so it lies below the
remanence of the data sheet. A scan along one line hardly tells J from the height, or an offset sideways from a tilt:
their correlations are told. Lengths mm, angles rad, T.
"""

from __future__ import annotations

import itertools
import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import parts
from analytic.hall import field_at, rotated
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.inputs.table_input import Measured, split_head
from studies.inputs.units import IN_HEADS
from studies.output import page_templates
from studies.output.figures import FREE, Figure, picture, styles, thinned
from studies.output.result import Result, Table
from studies.quantities import shown

if TYPE_CHECKING:
    import pandas as pd

    from studies.output.records import FlatRow

FILES = ("scan.csv", "scan.png", "unknowns.csv")
UNKNOWNS = {
    "J": ("T", 0.2), "offset_x": ("mm", 1.0), "offset_y": ("mm", 1.0), "offset_z": ("mm", 1.0),
    "tilt_x": ("rad", 0.05), "tilt_y": ("rad", 0.05), "yaw": ("rad", 0.05),
    "chip_tilt_x": ("rad", 0.05), "chip_tilt_y": ("rad", 0.05),
    "zero_x": ("T", 3e-4), "zero_y": ("T", 3e-4), "zero_z": ("T", 3e-4),
}  # fmt: skip
"""Units and standard deviations of the priors about the design: of J relative, of offsets those of a chip's axes."""
TOLD = 0.9
"""Correlation that is told."""


def read(file: Path) -> tuple[Array, Array]:
    """Return positions (n, 3), mm, and the field along x, y, z (n, 3), T, NaN for axes that are not there.

    Heads are x_mm, y_mm, z_mm (0 where a column is missing) and Bx_mT, By_mT, Bz_mT, in any unit.
    """
    raw = Measured(file)
    columns: dict[str, Any] = {}
    for head in raw.heads:
        name, unit = split_head(head)
        name = name.lower()
        kind = "mm" if name in ("x", "y", "z") else "T" if name in ("bx", "by", "bz") else ""
        if kind and unit not in IN_HEADS[kind]:
            raise BadInput(
                f"the column {head!r} needs a unit, one of {', '.join(IN_HEADS[kind])}, as in {name}_{kind}"
            )
        if kind:
            columns[name] = raw.numbers(head, holes=True) * IN_HEADS[kind][unit]
    count = len(raw.rows)
    if not any(name in columns for name in ("bx", "by", "bz")) or not any(name in columns for name in "xyz"):
        raise BadInput(f"{file.name} is no scan: its heads must be x_mm (y_mm, z_mm) and Bx_mT, By_mT, Bz_mT")
    position = np.stack([columns.get(name, np.zeros(count)) for name in "xyz"], axis=1)
    field = np.stack([columns.get(f"b{name}", np.full(count, np.nan)) for name in "xyz"], axis=1)
    known = np.isfinite(position).all(axis=1) & np.isfinite(field).any(axis=1)
    if np.isfinite(field[known]).sum() < len(UNKNOWNS):
        raise BadInput(f"{file.name} has fewer numbers than the {len(UNKNOWNS)} unknowns of a scan: add positions")
    return position[known], field[known]


def fit(design: Design, position: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Return the unknowns (J relative to the design's), their covariance, and the fitted field (n, 3), T."""
    from scipy.optimize import least_squares

    chip = np.array(parts.of_design(design)[0].position)
    deviation = np.array([each for _, each in UNKNOWNS.values()])
    known = np.isfinite(measured)

    def field(theta: Array) -> Array:
        J, offset, tilt, yaw, zero = theta[0], theta[1:4], theta[4:6], theta[6], theta[9:]
        c, s = math.cos(yaw), math.sin(yaw)
        turned = position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        B = field_at(np.tile(chip, (len(position), 1)), design, turned + offset, np.tile(tilt, (len(position), 1)))
        # the chip's axes lean, so that it sees the field turned the other way
        return np.asarray((1 + J) * rotated(B, -theta[7:9]) + zero)

    unit, noise = np.zeros(len(deviation)), 1e-4
    for _ in range(3):  # the noise follows from the residuals

        def errors(unit: Array, noise: float = noise) -> Array:
            return np.append(((measured - field(unit * deviation)) / noise)[known], unit)

        found = least_squares(errors, unit, method="lm")
        unit = found.x
        left = (measured - field(unit * deviation))[known]
        noise = float(np.sqrt(np.square(left).sum() / (known.sum() - len(unit))))
    covariance = np.linalg.inv(found.jac.T @ found.jac) * np.outer(deviation, deviation)
    return unit * deviation, covariance, field(unit * deviation)


def run(design: Design, file: Path, progress: Progress) -> Result:
    """Fit a magnet to a scan.

    Raises
    ------
    BadInput
        The file is no scan, or the design has no chip or no magnet.
    """
    if design.hall_layout == "three" or design.chip_count > 1 or not design.shape.has_magnet:
        raise BadInput(
            "a scan is read by a 3-axis chip: set hall_layout to one, magnet_diameter, magnet_height and l0, the "
            "height of the magnet's centre over the chip"
        )
    position, measured = read(file)
    progress(0.1, f"{len(position)} positions")
    theta, covariance, fitted = fit(design, position, measured)
    size = np.sqrt(np.diag(covariance))
    value, wide = theta.copy(), size.copy()
    value[0], wide[0] = design.remanence_now * (1 + theta[0]), design.remanence_now * size[0]
    rows: list[FlatRow] = [
        {"name": name, "unit": unit, "value": v, "deviation": d}
        for (name, (unit, _)), v, d in zip(UNKNOWNS.items(), value.tolist(), wide.tolist(), strict=True)
    ]
    names, correlation = list(UNKNOWNS), covariance / np.outer(size, size)
    told = [
        f"{names[i]} and {names[j]} move together in this scan (correlation {correlation[i, j]:.2f})"
        for i, j in itertools.combinations(range(len(names)), 2)
        if abs(correlation[i, j]) > TOLD
    ]
    if told:
        told.append("a scan at two heights, and along x and y, tells them apart")
    rms = float(np.sqrt(np.nanmean(np.square(measured - fitted))))
    table = [
        {"x_mm": x, "y_mm": y, "z_mm": z, "axis": axis, "measured_mT": 1e3 * m, "fitted_mT": 1e3 * f}
        for (x, y, z), ms, fs in zip(position.tolist(), measured.tolist(), fitted.tolist(), strict=True)
        for axis, m, f in zip("xyz", ms, fs, strict=True)
    ]
    record: FlatRow = {
        "positions": len(position), "rms_mT": 1e3 * rms, "J_T": float(value[0]), "J_deviation_T": float(wide[0]),
        "unknowns": rows, "sentences": told,
    }  # fmt: skip
    if value[0] < 0:
        told.append("J is negative: the magnet's north pole points the other way, set magnet_north")
    note = "J is the polarisation at the working point, below the remanence of the data sheet for a flat magnet"
    return Result(
        title="Scan",
        records=[record],
        shown=[
            Table(title="Unknowns", rows=rows),
            f"Residuals {shown(rms, 'mT', 2)} (root of the mean square) at {len(position)} positions.",
            *(f"{page_templates.sentence(each)}." for each in (*told, note)),
        ],
        tables={"scan": table, "unknowns": rows},
        files={"scan.png": partial(picture, rows=table, draw=figures)},
    )


def figures(table: pd.DataFrame) -> list[Figure]:
    """Return what was measured less what was fitted, by axis, over the way of the stage."""
    import altair as alt

    first = table.loc[[0], ["x_mm", "y_mm", "z_mm"]].to_numpy()
    x, y = "distance from the first position (mm)", "measured less fitted (mT)"
    data = table.assign(**{
        x: np.linalg.norm(table[["x_mm", "y_mm", "z_mm"]].to_numpy() - first, axis=1),
        y: table.measured_mT - table.fitted_mT,
        "series": "B" + table.axis,
    }).dropna(subset=[x, y], ignore_index=True)  # fmt: skip
    drawn, note = thinned(data, y)
    chart = alt.Chart(drawn).transform_filter("datum.drawn").mark_point().encode(
        x=x, y=alt.Y(y, **FREE), **styles(data["series"])
    )  # fmt: skip
    return [Figure("Residuals of the scan", "Measured less fitted flux density of each axis.", chart, data, note)]
