"""Rows of the tables of a sensitivity study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.inputs import study_axes
from studies.output import records
from studies.output.records import FlatRow
from studies.output.text_tables import heading
from studies.sensitivity.calibration_spread import CalibrationSpread
from studies.sensitivity.morris_effects import MorrisEffects
from studies.sensitivity.percentiles import percentile
from studies.sensitivity.sobol_indices import Ranges, SobolIndices

SHARES = (0.05, 0.5, 0.95)
"""Percentiles of the spread of a calibration."""


@dataclass(frozen=True, slots=True)
class SobolRow:
    """Indices of one input for one output; None where the output does not vary or every point has failed.

    `mean` and `standard_deviation` are those of the output, in the unit that its name ends with.
    `model_error_over_deviation` is the median half width of the model's 90 % interval over the standard deviation.
    """

    method: str
    output: str
    input: str
    low: float
    high: float
    unit: str
    first_order: float | None
    first_order_low: float | None
    first_order_high: float | None
    total_order: float | None
    total_order_low: float | None
    total_order_high: float | None
    points: int
    failed: int
    failed_percent: float
    mean: float | None
    standard_deviation: float | None
    model_error_over_deviation: float
    model: str

    def row(self) -> FlatRow:
        """Return the flat row for tables, CSV files and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class MorrisRow:
    """Elementary effects of one input on one output, in `effect_unit`; None where every point has failed."""

    method: str
    output: str
    input: str
    low: float
    high: float
    unit: str
    mu_star: float | None
    mu_star_low: float | None
    mu_star_high: float | None
    mu: float | None
    sigma: float | None
    sigma_low: float | None
    sigma_high: float | None
    effect_unit: str
    points: int
    failed: int
    failed_percent: float
    model: str

    def row(self) -> FlatRow:
        """Return the flat row for tables, CSV files and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class SpreadRow:
    """A percentile of a quantity of made sensors, with its 95 % interval; None where an end is not known.

    `low` counts failed sensors as lowest, `high` as highest. `model_error_percent` is the half width of the model's
    90 % interval of the nominal sensitivity.
    """

    method: str
    axis: str
    quantity: str
    unit: str
    nominal: float | None
    percentile: float
    value: float | None
    low: float | None
    high: float | None
    sensors: int
    failed: int
    model: str
    model_error_percent: float
    message: str

    def row(self) -> FlatRow:
        """Return the flat row for tables, CSV files and JSON."""
        return records.flat(self)


def sobol_rows(ranges: Ranges, output: str, indices: SobolIndices, error: float, model: str) -> list[SobolRow]:
    """Return the rows of an output."""
    return [
        SobolRow(
            method="sobol",
            output=output,
            input=name,
            low=ranges[name][0],
            high=ranges[name][1],
            unit=study_axes.AXES[name].unit,
            first_order=share(indices.first[k]),
            first_order_low=share(indices.first_low[k]),
            first_order_high=share(indices.first_high[k]),
            total_order=share(indices.total[k]),
            total_order_low=share(indices.total_low[k]),
            total_order_high=share(indices.total_high[k]),
            points=indices.points,
            failed=indices.failed,
            failed_percent=100 * indices.failed / indices.points,
            mean=known(indices.mean),
            standard_deviation=known(indices.deviation),
            model_error_over_deviation=error,
            model=model,
        )
        for k, name in enumerate(ranges)
    ]


def morris_rows(ranges: Ranges, output: str, effects: MorrisEffects, model: str) -> list[MorrisRow]:
    """Return the rows of an output."""
    unit = heading(output)[1] or output.rpartition("_")[2]
    return [
        MorrisRow(
            method="morris",
            output=output,
            input=name,
            low=ranges[name][0],
            high=ranges[name][1],
            unit=study_axes.AXES[name].unit,
            mu_star=known(effects.mu_star[k]),
            mu_star_low=known(effects.mu_star_low[k]),
            mu_star_high=known(effects.mu_star_high[k]),
            mu=known(effects.mu[k]),
            sigma=known(effects.sigma[k]),
            sigma_low=known(effects.sigma_low[k]),
            sigma_high=known(effects.sigma_high[k]),
            effect_unit=f"{unit} per full range",
            points=effects.points,
            failed=effects.failed,
            failed_percent=100 * effects.failed / effects.points,
            model=model,
        )
        for k, name in enumerate(ranges)
    ]


def spread_rows(spread: CalibrationSpread, unit: str, model: str) -> list[SpreadRow]:
    """Return the percentiles of all axes; `unit` is that of the readings."""
    rows = []
    for name, axis in spread.axes.items():
        failed = sum(map(bool, axis.refusals))
        quantities = {
            "sensitivity": (axis.sensitivity, f"{unit}/N", axis.nominal_sensitivity),
            "offset": (axis.offset, unit, axis.nominal_offset),
            "force_error": (axis.error, "N", 0.0),
            "zeroed_force_error": (axis.zeroed_error, "N", 0.0),
            "recalibrated_force_error": (axis.recalibrated_error, "N", 0.0),
        }
        for quantity, (values, own, nominal) in quantities.items():
            for share in SHARES:
                value, low, high = map(known, percentile(values, share))
                rows.append(
                    SpreadRow(
                        method="montecarlo",
                        axis=name,
                        quantity=quantity,
                        unit=own,
                        nominal=known(nominal),
                        percentile=100 * share,
                        value=value,
                        low=low,
                        high=high,
                        sensors=len(axis.refusals),
                        failed=failed,
                        model=model,
                        model_error_percent=100 * axis.model_error,
                        message=axis.message,
                    )
                )
    return rows


def sensor_rows(spread: CalibrationSpread, unit: str) -> list[FlatRow]:
    """Return a row for each made sensor: its values, and its calibration along each axis."""
    made = spread.sensors
    columns: dict[str, Sequence[object] | np.ndarray] = {
        "sensor": range(1, len(made) + 1),
        "status": ["failed" if reason else "ok" for reason in spread.refusals],
        "E_MPa": made.E,
        "nu": made.nu,
        "remanence_T": made.remanence,
        "magnet_diameter_mm": made.magnet_diameter,
        "magnet_height_mm": made.magnet_height,
    }
    for k, letter in enumerate("xyz"):
        columns[f"magnet_offset_{letter}_mm"] = made.magnet_offset[:, k]
    columns |= {"magnet_tilt_rad": made.magnet_tilt[:, 1], "magnet_tilt_y_rad": -made.magnet_tilt[:, 0]}
    for element in range(made.gain_factor.shape[1]):
        for k, letter in enumerate("xyz"):
            columns[f"element{element + 1}_offset_{letter}_mm"] = made.element_offset[:, element, k]
        columns[f"element{element + 1}_gain_factor"] = made.gain_factor[:, element]
        columns[f"element{element + 1}_null_shift_{unit}"] = made.null_shift[:, element]
    for name, axis in spread.axes.items():
        columns[f"{name}_sensitivity_{unit}_per_N"] = axis.sensitivity
        columns[f"{name}_offset_{unit}"] = axis.offset
        columns[f"{name}_force_error_N"] = axis.error
        columns[f"{name}_zeroed_force_error_N"] = axis.zeroed_error
        columns[f"{name}_recalibrated_force_error_N"] = axis.recalibrated_error
    columns["message"] = spread.refusals
    return _rows(columns)


def _rows(columns: Mapping[str, Sequence[object] | np.ndarray]) -> list[FlatRow]:
    """Return the rows of columns of equal length, with Python's own numbers."""
    lists = [values.tolist() if isinstance(values, np.ndarray) else list(values) for values in columns.values()]
    return [
        {
            name: known(value) if isinstance(value, float) else value
            for name, value in zip(columns, values, strict=True)
        }
        for values in zip(*lists, strict=True)
    ]


def known(value: float) -> float | None:
    """Return a number, None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def share(value: float) -> float | None:
    """Return an index without what is rounding only, None where it is not finite."""
    return round(float(value), 9) + 0.0 if np.isfinite(value) else None
