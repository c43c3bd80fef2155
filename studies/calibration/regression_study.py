"""Study calibrate by a regression, and both decoders side by side on rows that they have not seen."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic import parts
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from studies.calibration import calibration_file, force_regression
from studies.calibration.bench_file import FORCES, Bench
from studies.calibration.force_regression import AXES, KINDS, HeldOut, Regression
from studies.inputs.user_input import design_text
from studies.output import page_templates
from studies.output.atomic_files import write_text
from studies.output.figures import Figure, save
from studies.output.result import Result, Rows, Table
from studies.parts.requirements import Requirements, design_table
from studies.sensing.decode_readings import QUANTILE

if TYPE_CHECKING:
    from studies.output.records import FlatRow

ASSUMED_NOISE = 0.005
"""Error of measured forces that is assumed unless it is stated or estimated, over the largest force."""
BETTER = 1.5
"""Error of one decoder over that of the other on held-out rows from which the other one is recommended."""
ONE_RUN = (
    "there is one run only, so errors on held-out rows are those of parts of it, and another run may be worse: "
    "record a second one"
)
"""Warning of a bench; it concerns errors on held-out rows, and no decoded force."""
MODEL = "calibration"
"""Name of the model of the sensor in tables of methods."""


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Rows of a bench that count.

    Attributes
    ----------
    measured : (n, k + 6) readings, forces at their times, and motions, of all rows.
    lag : of the forces behind the readings, s; None where it is not known.
    rows : numbers of the rows with all readings within the rails of their elements, and a force.
    said, copied : sentences on rows that do not count, or repeat another one; the latter alone.
    needed : requirements of the sensor; None without any.
    """

    bench: Bench
    measured: Array
    lag: float | None
    rows: Ints
    said: Sequence[str]
    copied: Sequence[str]
    needed: Requirements | None = None

    @property
    def readings(self) -> Array:
        """Readings (n, k) of the rows that count."""
        return np.asarray(self.measured[self.rows, : len(self.bench.readings)])

    @property
    def force(self) -> Array:
        """Forces (n, 3) of the rows that count."""
        k = len(self.bench.readings)
        return np.asarray(self.measured[self.rows, k : k + 3])

    @property
    def parts(self) -> list[tuple[str, Ints, Ints]]:
        """Name, training rows and held-out rows, counted among those that count."""
        place = np.full(len(self.measured), -1)
        place[self.rows] = np.arange(len(self.rows))
        every = force_regression.folds(self.bench, self.rows)
        return [(name, place[train], place[test]) for name, train, test in every]


def tried(recorded: Recorded) -> list[HeldOut]:
    """Return what regressions of each degree give for held-out rows.

    Raises
    ------
    BadInput
        The rows are too few.
    """
    readings, force, every = recorded.readings, recorded.force, recorded.parts
    force_regression.check_rows(readings, force, every)
    return [force_regression.held_out(readings, force, every, degree) for degree in KINDS]


def _errors(method: str, force: Array, truth: Array, inside: float) -> FlatRow:
    """Return the errors of decoded forces (n, 3): by axis, and of the vector of the measured components."""
    measured = np.isfinite(truth)
    off = np.where(measured, force - truth, 0.0)
    known = np.isfinite(off).all(axis=1)
    row: FlatRow = {"method": method, "rows": len(truth), "lost": int((~known).sum())}
    for k, axis in enumerate(AXES):
        own = off[known & measured[:, k], k]
        row[f"rmse_{axis}_N"] = math.sqrt(float(np.square(own).mean())) if len(own) else math.nan
    whole = math.sqrt(float(np.square(off[known]).sum(axis=1).mean())) if known.any() else math.nan
    return row | {"rmse_N": whole, "inside_percent": inside}


def _of_regressions(recorded: Recorded, found: Sequence[HeldOut]) -> list[FlatRow]:
    truth = recorded.force
    return [
        _errors(f"{KINDS[each.degree]} ridge", each.force, truth, 100 * float(np.nanmean(each.inside(truth))))
        for each in found
    ]


def best_of(rows: Rows) -> FlatRow | None:
    """Return the row of the least error on held-out rows; None where none is known."""
    known = [dict(row) for row in rows if math.isfinite(row["rmse_N"])]
    return min(known, key=lambda row: float(row["rmse_N"]), default=None)


def decoders(recorded: Recorded, by_model: Array, summary: FlatRow) -> list[FlatRow]:
    """Return the errors of the model, which was written, and of both regressions, side by side on held-out rows.

    by_model : (n, 3) forces of all rows by the model.
    summary : its errors over all held-out rows.
    """
    rows = [_errors(MODEL, by_model[recorded.rows], recorded.force, summary["inside_percent"])]
    with contextlib.suppress(BadInput):  # too few rows for a regression
        rows += _of_regressions(recorded, tried(recorded))
    return _marked(rows, MODEL)


def _marked(rows: Rows, written: str) -> list[FlatRow]:
    """Return rows with the mark of the method that calibration.json holds."""
    return [{**row, "written": "yes" if row["method"] == written else "no"} for row in rows]


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """The better regression of a bench.

    Attributes
    ----------
    found, chosen : the regression, and what its degree gives for held-out rows.
    rows : errors of both degrees.
    """

    recorded: Recorded
    found: Regression
    chosen: HeldOut
    rows: Sequence[FlatRow]


def compared(design: Design, recorded: Recorded, force_noise: float | None) -> Compared:
    """Return the regression of the degree that decodes held-out rows best.

    force_noise : standard deviation of a measured force, N; at rest is what such an error explains.

    Raises
    ------
    BadInput
        The rows are too few for a linear regression.
    """
    candidates = tried(recorded)
    rows = _of_regressions(recorded, candidates)
    chosen = candidates[int(np.argmin([row["rmse_N"] for row in rows]))]
    force = np.nan_to_num(recorded.force)
    noise = force_noise or ASSUMED_NOISE * float(np.abs(force).max())
    rest = np.asarray((np.abs(force) <= QUANTILE * noise).all(axis=1))
    temperature = recorded.bench.values(["temperature_C"])[recorded.rows, 0]
    found = force_regression.regression(design, recorded.readings, recorded.force, chosen, rest, temperature)
    return Compared(recorded, found, chosen, rows)


def ranges(found: Regression, names: Sequence[str], unit: str) -> list[FlatRow]:
    """Return the range of each reading, force and temperature of the bench."""
    rows: list[FlatRow] = []
    ends = [(name, unit, *found.span[:, k]) for k, name in enumerate(names)]
    ends += [(f"F{axis}", "N", *found.forces[:, k]) for k, axis in enumerate(AXES)]
    ends += [("temperature", "C", *found.temperature_C)]
    for name, own_unit, least, most in ends:
        rows.append({"name": name, "unit": own_unit, "least": float(least), "most": float(most)})
    return rows


def sentences(one: Compared) -> list[str]:
    """Return what the regression does not know, in words."""
    found, said = one.found, []
    if np.isnan(found.rest).any():
        said.append(
            "no row is at rest, so no zero can be taken, and a sensor at rest may be out of range: add rows without "
            "a force to the bench"
        )
    if lost := [name for name, value in zip(FORCES, found.law.constant, strict=True) if math.isnan(value)]:
        said.append(f"{', '.join(lost)} {'were' if lost[1:] else 'was'} not measured, and stays unknown")
    if found.is_thermal:
        cold, warm = found.temperature_C
        said.append(
            f"a regression corrects no temperature: intervals hold from {cold:.3g} to {warm:.3g} C, as on the bench"
        )
    else:
        said.append("the temperature of the bench is not known, and a regression corrects none")
    return said


def why_model(model: FlatRow, best: FlatRow | None, other: str) -> list[str]:
    """Return why the model was written, and how to get the regression, in sentences.

    model, best : errors on held-out rows, of the better regression; None without one.
    other : command of the regression.
    """
    written = "the model of the sensor is in calibration.json, the default decoder"
    if best is None:
        return [f"{written}; the rows are too few for a regression"]
    ratio = best["rmse_N"] / model["rmse_N"] if model["rmse_N"] > 0 else math.inf
    times = f"{ratio:.2g} times better" if ratio > 1 else f"{1 / ratio:.2g} times worse"
    compared = f"it decodes held-out rows {times} than the {best['method']} regression"
    return [f"{written}; {compared}" if math.isfinite(ratio) else written, f"for the regression: {other}"]


def lasting(warnings: Sequence[str]) -> list[str]:
    """Return the warnings that each verb says again which takes the calibration."""
    return [text for text in warnings if text != ONE_RUN]


def is_curve(learning: Rows) -> bool:
    """Return whether rows of a learning curve have more than one number of training rows, which a dozen presses have
    not."""
    return len({row["training_rows"] for row in learning}) > 1


def _why(one: Compared, model: FlatRow | None, said: str, other: str) -> list[str]:
    """Return which decoder was written and why, and how to get the other one, in sentences.

    model : its errors; None without one, for which `said` is the reason.
    """
    own = best_of(one.rows)
    assert own is not None
    written = f"the {one.found.words} is in calibration.json, because --decoder regression asked for it"
    if model is None or not math.isfinite(model["rmse_N"]):
        return [f"{written}; the model of the sensor does not decode these rows: {said}"]
    ratio = model["rmse_N"] / own["rmse_N"]
    times = f"{ratio:.2g} times better" if ratio > 1 else f"{1 / ratio:.2g} times worse"
    return [
        f"{written}; it decodes held-out rows {times} than the model of the sensor",
        f"the model has poses, and forces beyond the bench: {other}",
    ]


def result(
    one: Compared, model: Result | str, other: str, figures: Callable[[Array, Array, Rows], list[Figure]]
) -> Result:
    """Return the calibration by a regression.

    model : the result of the calibration by the model, or why there is none.
    other : command of that calibration.
    """
    found, recorded = one.found, one.recorded
    design, bench, law = found.design, recorded.bench, found.law
    of_model = None if isinstance(model, str) else dict(model.tables["decoders"][0])
    reason = model if isinstance(model, str) else "; ".join(model.failures)
    method = f"{KINDS[law.degree]} ridge"
    table = _marked([*([of_model] if of_model else []), *one.rows], method)
    why, said, own = _why(one, of_model, reason, other), sentences(one), best_of(one.rows)
    assert own is not None
    warnings = [*recorded.said]
    if of_model and of_model["rmse_N"] * BETTER < own["rmse_N"]:
        ratio = own["rmse_N"] / of_model["rmse_N"]
        warnings.insert(0, f"the model of the sensor decodes held-out rows {ratio:.2g} times better: {other}")
    record: FlatRow = {
        "decoder": "regression", "kind": KINDS[law.degree], "penalty": law.penalty, "rows": law.rows,
        "runs": len(bench.runs), "lag_s": recorded.lag, "freedom": law.freedom,
        "held_out_N": found.held_out.tolist(), "inside_percent": own["inside_percent"],
        "ranges": ranges(found, bench.readings, parts.of_design(design)[0].unit), "decoders": table,
        "sentences": [*why, *said],
    }  # fmt: skip
    curve: Rows = [] if isinstance(model, str) else model.tables["learning"]
    page = page_templates.rendered(
        Path(__file__).with_name("REGRESSION.md.j2"),
        record=record, warnings=warnings, said=said, why=why, decoders=table, columns=bench.understood, law=law,
        covariance=[
            {"": f"F{axis} (N^2)", **dict(zip(("Fx", "Fy", "Fz"), values, strict=True))}
            for axis, values in zip(AXES, found.covariance.tolist(), strict=True)
        ],
        factor=found.factor, farthest=found.farthest, warmth=force_regression.WARMTH,
        learned=is_curve(curve),
    )  # fmt: skip
    text = calibration_file.regression_text(found, recorded.lag, lasting(warnings))
    drawn = partial(figures, recorded.force, one.chosen.force, curve)
    return Result(
        title="Calibration",
        records=[record],
        shown=[
            Table(title="Columns", rows=bench.understood),
            Table(title="Held-out rows", rows=table),
            Table(title="Range of the bench", rows=record["ranges"]),
            *(f"{page_templates.sentence(each)}." for each in why),
        ],
        tables={"decoders": table, "columns": bench.understood},
        files={
            "calibration.json": partial(write_text, text=text),
            "design.toml": partial(write_text, text=design_text(design) + design_table(recorded.needed)),
            "calibration.png": lambda path: save(path, drawn()),
        },
        pages={"CALIBRATION.md": page},
        warnings=warnings,
        remarks=said,
        design=dataclasses.asdict(design),
    )
