"""Files of `magtip sensitivity`: SENSITIVITY.md, and for each method a table and a picture."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from geometry.design import Design
from studies.output.records import FlatRow
from studies.output.result import Result, Table, Writer
from studies.output.text_tables import titled
from studies.sensitivity import sensitivity_plots
from studies.sensitivity.percentiles import percentile
from studies.sensitivity.sensitivity_rows import MorrisRow, SobolRow
from studies.sensitivity.sensitivity_study import MonteCarloStudy, MorrisStudy, SobolStudy, summary
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press

FILES = (
    "SENSITIVITY.md",
    *("sobol.csv", "sobol.png", "morris.csv", "morris_cases.csv", "morris.png"),
    *("montecarlo.csv", "percentiles.csv", "montecarlo.png"),
)
"""Files of the study; those of a method only if it was requested."""

LEAST_SHARE = 0.05
"""Least total order of an input that the page names in a sentence."""

SOBOL = """\
The first-order index is the share of the output's variance that an input explains alone, the total order also its
share with all interactions. In brackets: the interval for sampling (95 %), the model's stated error, and every value
that failed points may have between the least and the largest of the others. All inputs are uniform in their ranges.
"""
MORRIS = """\
µ* is the mean magnitude of the change of the output over the full range of an input, from finite elements; σ is the
standard deviation of the change: large where the input acts nonlinearly or with others. In brackets: 95 % by
bootstrap over the trajectories for µ*, and every value that failed cases may have between the least and the largest
of the others; the brackets of σ have the latter only.
"""
MONTE_CARLO = """\
Each made sensor is calibrated over the force range of the design itself. The sensitivity is the change of the reading
of an axis' element over the force range; the offset is its reading without a force on this axis. The force error is
the largest over the range: with the nominal sensor's calibration; after zeroing without a force; and after one-point
recalibration of offset and gain. In brackets: 95 % interval of the percentile, with failed sensors on the worse side.
The magnet's offset and tilt, and those of the elements, change the readings, not the mechanics. Readings are those
before the converter rounds them: noise and steps limit the resolution, and are no deviation of a sensor.
"""


@dataclass(frozen=True, slots=True)
class Results:
    """Results of the methods that were requested, and what they had in common."""

    design: Design
    load: Press
    tolerances: Tolerances
    sobol: SobolStudy | None = None
    morris: MorrisStudy | None = None
    monte_carlo: MonteCarloStudy | None = None


def result_of(results: Results) -> Result:
    """Return tables, pictures and page; the study has failed if every case of a method has failed."""
    tables: dict[str, Sequence[FlatRow]] = {}
    files: dict[str, Writer] = {}
    shown, remarks = [], []
    every_case_failed = False

    def add(study: SobolStudy | MorrisStudy | MonteCarloStudy, count: int, doubt: str, table: Table) -> None:
        nonlocal every_case_failed
        shown.append(table)
        remarks.append("; ".join(filter(None, (summary(study.reasons, count), doubt))))
        every_case_failed |= sum(study.reasons.values()) >= count

    common = ("method", "low", "high", "unit", "points", "failed", "failed_percent", "model")
    if (sobol := results.sobol) is not None:
        rows = tables["sobol"] = [row.row() for row in sobol.rows]
        files["sobol.png"] = lambda path: sensitivity_plots.sobol(path, sobol.rows)
        first: tuple[str, ...] = ("output", "input", "first_order", "total_order")
        table = Table(title="Sobol indices", rows=rows, brief=(*common, "mean"), first=first)
        add(sobol, sobol.rows[0].points, doubt(sobol.rows), table)
    if (morris := results.morris) is not None:
        rows = tables["morris"] = [row.row() for row in morris.rows]
        tables["morris_cases"] = morris.cases
        files["morris.png"] = lambda path: sensitivity_plots.morris(path, morris.rows)
        first = ("output", "input", "mu_star", "sigma", "effect_unit")
        table = Table(title="Morris' effects", rows=rows, brief=(*common, "sigma_low", "sigma_high"), first=first)
        add(morris, morris.rows[0].points, morris.doubt, table)
    if (made_sensors := results.monte_carlo) is not None:
        rows = tables["percentiles"] = [row.row() for row in made_sensors.rows]
        tables["montecarlo"] = made_sensors.sensors
        files["montecarlo.png"] = lambda path: sensitivity_plots.monte_carlo(path, made_sensors)
        first = ("axis", "quantity", "unit", "percentile", "value")
        brief = ("method", "sensors", "failed", "model", "model_error_percent", "message")
        table = Table(title="Calibration of made sensors", rows=rows, brief=brief, first=first)
        add(made_sensors, made_sensors.rows[0].sensors, "", table)
    said = [remark for remark in remarks if remark]
    return Result(
        title="Sensitivity",
        records=[row for table in shown for row in table.rows],
        shown=shown,
        tables=tables,
        files=files,
        pages={"SENSITIVITY.md": text(results)},
        packages=("SALib", "matplotlib"),
        remarks=[] if every_case_failed else said,
        failures=said if every_case_failed else [],
    )


def text(results: Results) -> str:
    """Return the text of SENSITIVITY.md without its origin."""
    load = results.load
    shear = f", sheared by {load.shear:g} mm with the tip stuck to the plate" if load.shear else ""
    lines = ["# Sensitivity and tolerances", "", f"Pressed to {load.depth:g} mm{shear}.", ""]
    if results.sobol is not None:
        lines += _sobol(results.sobol)
    if results.morris is not None:
        lines += _morris(results.morris)
    if results.monte_carlo is not None:
        lines += [*_monte_carlo(results.monte_carlo), *_tolerances(results)]
    return "\n".join(lines)


def _sobol(study: SobolStudy) -> list[str]:
    first = study.rows[0]
    lines = ["## Sobol indices", "", *SOBOL.splitlines(), ""]
    lines += [
        *_ranges(study.rows),
        f"{first.points} points by model {first.model}; {_failures(study, first.points)}.",
        "",
    ]
    warning = doubt(study.rows)
    lines += [*_largest_shares(study.rows), *(["", f"**Warning: {warning}.**"] if warning else []), ""]
    cells = []
    for output, rows in sensitivity_plots.by_output(study.rows):
        error = f"{rows[0].model_error_over_deviation:.2g}"
        for row in rows:
            orders = [_value(row, "first_order"), _value(row, "total_order")]
            cells.append([titled(output), row.input, *orders, error])
    lines += _markdown(("output", "input", "first order", "total order", "model's error / deviation"), cells)
    return [*lines, "", "![Sobol indices with their intervals](sobol.png)", ""]


def doubt(rows: Sequence[SobolRow]) -> str:
    """Return a sentence that names the outputs that vary by less than the model's error, "" if there is none."""
    names = dict.fromkeys(titled(row.output) for row in rows if row.model_error_over_deviation > 1)
    return (
        f"do not read the indices of {', '.join(names)}: the model's error exceeds the variation of the output, so "
        "that their intervals reach from 0 to 1; vary the inputs in wider ranges, or use --methods morris"
        if names
        else ""
    )


def _largest_shares(rows: Sequence[SobolRow]) -> list[str]:
    """Return for each output the inputs whose total order is at least `LEAST_SHARE`, the largest first."""
    lines = []
    for output, each in sensitivity_plots.by_output(rows):
        shares = [(row.total_order, row.input) for row in each if row.total_order is not None]
        named = [
            f"{name} {100 * share:.0f} %" for share, name in sorted(shares, reverse=True) if share >= LEAST_SHARE
        ]
        # the interval of an index is then wide: the estimate alone would mislead
        doubt = "; the model's error exceeds this variation" if each[0].model_error_over_deviation > 1 else ""
        lines += [f"- {titled(output)} varies with {', '.join(named)}{doubt}."] if named else []
    return lines


def _morris(study: MorrisStudy) -> list[str]:
    first = study.rows[0]
    lines = ["## Morris' effects", "", *MORRIS.splitlines(), ""]
    lines += [*_ranges(study.rows), f"{first.points} cases by {first.model}; {_failures(study, first.points)}.", ""]
    if study.doubt:
        lines += [f"{study.doubt}.", ""]
    if study.reasons:
        lines += [f"The fast model replaces {study.replaced} of the failed cases in the estimates.", ""]
    cells = [
        [titled(row.output), row.input, _value(row, "mu_star"), _value(row, "sigma"), row.effect_unit]
        for row in study.rows
    ]
    lines += _markdown(("output", "input", "µ*", "σ", "unit"), cells)
    return [*lines, "", "![Standard deviation over mean magnitude of the effects](morris.png)", ""]


def _monte_carlo(study: MonteCarloStudy) -> list[str]:
    first = study.rows[0]
    lines = ["## Made sensors", "", *MONTE_CARLO.splitlines(), ""]
    lines += [f"{first.sensors} sensors by model {first.model}; {_failures(study, first.sensors)}.", ""]
    for name, axis in study.spread.axes.items():
        low, high = axis.force_range
        error = (
            f"; model's 90 % interval of its sensitivity: ± {100 * axis.model_error:.2g} %"
            if axis.model_error
            else ""
        )
        lines += [f"- Axis {name}: {low:.3g} to {high:.3g} N{error}{f'; {axis.message}' if axis.message else ''}."]
    lines += [*_force_errors(study), ""]
    cells = []
    keys = dict.fromkeys((row.axis, row.quantity) for row in study.rows)
    for axis_name, quantity in keys:
        rows = [row for row in study.rows if (row.axis, row.quantity) == (axis_name, quantity)]
        values = [_bracketed(row.value, row.low, row.high) for row in rows]
        nominal = "" if quantity.endswith("error") else _number(rows[0].nominal)
        cells.append([axis_name, quantity.replace("_", " "), rows[0].unit, nominal, *values])
    shares = [f"{row.percentile:g} %" for row in study.rows[:3]]
    lines += [*_markdown(("axis", "quantity", "unit", "nominal", *shares), cells)]
    return [*lines, "", "![Histograms of sensitivity and force errors](montecarlo.png)", ""]


def _force_errors(study: MonteCarloStudy) -> list[str]:
    """Return for each axis the 95th percentile of the force errors, in N and of the span of the force range."""
    lines = []
    for name, axis in study.spread.axes.items():
        span = axis.force_range[1] - axis.force_range[0]
        worst = [percentile(values, 0.95)[0] for values in (axis.error, axis.zeroed_error, axis.recalibrated_error)]
        texts = [f"{error:.2g} N ({100 * error / span:.3g} % of the range)" for error in worst]
        if all(map(math.isfinite, worst)):
            lines.append(
                f"- Along {name} 95 % of the sensors that have not failed err by at most {texts[0]} with the nominal "
                f"calibration, {texts[1]} after zeroing, and {texts[2]} after recalibration."
            )
    return lines


def _tolerances(results: Results) -> list[str]:
    """Return the table of the tolerances that have an effect, with their sources."""
    chip = results.design.hall_layout != "three"
    cells = []
    for spec in dataclasses.fields(results.tolerances):
        if spec.name in (("hall_gain", "hall_null") if chip else ("chip_gain", "chip_null")):
            continue
        value, unit = getattr(results.tolerances, spec.name), spec.metadata["unit"]
        default = value == spec.default
        source = f"{'assumed: ' if spec.metadata['assumed'] else ''}{spec.metadata['source']}"
        size = f"± {value:g} {'' if unit == '1' else unit.replace('percent', '%')}".strip()
        cells.append([spec.metadata["text"], size, spec.metadata["shape"], source if default else "set by the user"])
    head = ["Tolerances; a normal deviation has half the tolerance as standard deviation and is cut off at it:", ""]
    return [*head, *_markdown(("value", "tolerance", "distribution", "source"), cells), ""]


def _ranges(rows: Sequence[SobolRow] | Sequence[MorrisRow]) -> list[str]:
    """Return the ranges of the inputs as a list."""
    of_first = [row for row in rows if row.output == rows[0].output]
    unit = {row.input: "" if row.unit == "1" else f" {row.unit}" for row in of_first}
    return [*(f"- {row.input}: {row.low:.6g} to {row.high:.6g}{unit[row.input]}" for row in of_first), ""]


def _failures(study: SobolStudy | MorrisStudy | MonteCarloStudy, count: int) -> str:
    return summary(study.reasons, count) or "none has failed"


def _value(row: SobolRow | MorrisRow, name: str) -> str:
    return _bracketed(getattr(row, name), getattr(row, f"{name}_low"), getattr(row, f"{name}_high"))


def _bracketed(value: float | None, low: float | None, high: float | None) -> str:
    """Format a value with its interval.

    >>> _bracketed(0.123456, 0.1, None), _bracketed(None, None, None)
    ('0.123 (0.1 to -)', '-')
    """
    return "-" if value is None else f"{_number(value)} ({_number(low)} to {_number(high)})"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:.3g}"


def _markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [[cell.replace("|", "\\|") for cell in line] for line in (heads, ["---"] * len(heads), *rows)]
    return [f"| {' | '.join(line)} |" for line in lines]
