"""Study firmware of a regression: its polynomial, interval and range as a C header in the same Arduino library.

The header is the template magtip_regression.h.j2, which shares statuses and rows over time with that of the model.
The answers of the test vectors are those of `studies.calibration.force_regression` in Python, `reference`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from analytic import parts, time_series
from geometry.arrays import Array
from geometry.bad_input import BadInput
from geometry.design_digest import digest
from geometry.messages import Progress
from studies.calibration import calibration_file
from studies.calibration.force_regression import WARMTH, Regression
from studies.calibration.regression_study import ranges
from studies.firmware import decoder_export
from studies.firmware.decoder_export import HEADER, PLAIN, STATUSES, VECTORS, number
from studies.inputs.table_input import COLDEST, HOTTEST
from studies.inputs.user_input import design_text
from studies.output.atomic_files import write_text
from studies.output.result import Result, Writer
from studies.parts.requirements import Requirements, full_scale
from studies.quantities import shown

CODE, WARM_CODE = 2_400, 100
"""Bytes beside the tables of a program for a Cortex-M4F with -Os, and those of a temperature (as measured by
`tests/test_force_regression.py`)."""
AROUND = 1.3
"""Greatest distance of a test vector over that of the range."""


def tables_of(found: Regression) -> dict[str, Array]:
    """Return the constants of the header by their names, as float."""
    law, elements = found.law, parts.of_design(found.design)
    dithered = [e.noise > 0 and e.noise >= e.step for e in elements]
    arrays = {
        "centre": law.centre, "scale": law.scale, "term_means": law.term_means, "constant": law.constant,
        "weights": law.weights, "root": law.root[np.tril_indices(len(law.root))], "whitening": found.whitening,
        "spread": found.factor * np.sqrt(np.diag(found.covariance)), "forces": found.forces,
        "rails": np.array([(e.low, e.high) for e in elements]), "least_jump": found.least_jumps,
    }  # fmt: skip
    if np.isfinite(found.rest).all():
        arrays["rest"] = found.rest
    tables: dict[str, Any] = {name: np.asarray(values, dtype=np.float32) for name, values in arrays.items()}
    return tables | {"dithered": np.asarray(dithered, dtype=np.uint8)}


def reference(
    found: Regression, readings: Array, times: Array | None = None, temperature: Array | None = None
) -> dict[str, Any]:
    """Return what Python decodes from readings (n, k): status, force, half_width, and no pose.

    times : (n,), s; with them rows are compared with those before.
    temperature : (n,), C.
    """
    unknown = np.full(len(readings), np.nan)
    words, force, half = found.decode(readings, unknown if temperature is None else temperature)
    if times is not None:
        words = calibration_file.over_time(found, readings, times, words, force, half)
    nothing = np.full_like(force, np.nan)
    return {"status": words, "force": force, "half_width": half, "shift": nothing}


def readings_near(found: Regression, count: int, rng: np.random.Generator, most: float = AROUND) -> Array:
    """Return random readings (n, k) up to a distance, over that of the range, in float as C gets them."""
    k = len(found.rest)
    way = rng.normal(size=(count, k))
    far = most * found.farthest * rng.uniform(0, 1, (count, 1)) ** (1 / k)
    scores = np.linalg.solve(found.whitening, (far * way / np.linalg.norm(way, axis=1, keepdims=True)).T).T
    return (found.law.centre + found.law.scale * scores).astype(np.float32).astype(np.float64)


def vectors(found: Regression) -> list[dict[str, Any]]:
    """Return test vectors: readings in range and beyond, bad ones, then a time series with a gap and a jump."""
    rng, elements = np.random.default_rng(1), parts.of_design(found.design)
    single = readings_near(found, 36, rng)
    single[30] = [1.1 * e.high for e in elements]
    single[31, 1] = np.nan
    ends, t = readings_near(found, 2, rng, 0.7), np.linspace(0, 1, 60)
    series = ends[0] + (ends[1] - ends[0]) * np.sin(5 * t)[:, None]
    series[30, 0], series[40] = np.nan, series[10] + 0.2 * np.ptp(found.span, axis=0)
    series = series.astype(np.float32).astype(np.float64)
    times = (0.01 * np.arange(60) + 0.05 * (np.arange(60) >= 50)).astype(np.float32).astype(np.float64)
    names = [f"{name}_{elements[0].unit}" for name in parts.columns(elements)]
    rows = []
    for outputs, at in ((single, None), (series, times)):
        answers = reference(found, outputs, at)
        for k, output in enumerate(outputs.tolist()):
            seconds = math.nan if at is None else float(at[k] - at[max(k - 1, 0)])
            row = {**dict(zip(names, output, strict=True)), "seconds": seconds, "status": answers["status"][k]}
            for name, unit in (("shift", "mm"), ("force", "N")):
                row |= {f"{name}_{axis}_{unit}": v for axis, v in zip("xyz", answers[name][k].tolist(), strict=True)}
            rows.append(row)
    return rows


def rounding(found: Regression, tables: Mapping[str, Array]) -> float:
    """Return the largest error of the force, N, that float leaves at 4000 readings in range."""
    readings = readings_near(found, 4000, np.random.default_rng(0), 1.0)
    rounded: dict[str, Any] = {
        name: tables[name] for name in ("centre", "scale", "term_means", "constant", "weights")
    }
    law = dataclasses.replace(found.law, **rounded)
    return float(np.nanmax(np.abs(law.force(readings.astype(np.float32)) - found.law.force(readings))))


def header(found: Regression, told: Mapping[str, Any], tables: Mapping[str, Array]) -> str:
    """Return the text of magtip_decoder.h."""
    law, (cold, warm) = found.law, found.temperature_C + np.array([-WARMTH, WARMTH])
    numbers = {
        "share": 1 / law.rows, "farthest_2": found.farthest**2, "cold": cold, "warm": warm, "coldest": COLDEST,
        "hottest": HOTTEST, "jump": time_series.JUMP, "late": time_series.LATE,
    }  # fmt: skip
    counts = {
        "elements": len(law.centre), "terms": len(law.term_means), "recent": time_series.RECENT,
        "repeats": time_series.REPEATS, "thermal": found.is_thermal, "rejects": False, "rest": "rest" in tables,
    }  # fmt: skip
    listed = ranges(found, told["names"], told["unit"])
    return decoder_export.rendered(
        "magtip_regression.h.j2",
        **told,
        **{name: number(value) for name, value in numbers.items()},
        arrays=[decoder_export.declaration(f"magtip_{name}", values) for name, values in tables.items()],
        law=law,
        n=counts,
        design=design_text(found.design).splitlines(),
        ranges=[
            f"{row['name']}: {row['least']:.4g} to {row['most']:.4g} {row['unit']}"
            for row in listed
            if math.isfinite(row["least"])
        ],
    )


def told_of(
    found: Regression, needed: Requirements | None, command: str, tables: Mapping[str, Array], error: float
) -> dict[str, Any]:
    """Return what pages and comments say of an export, as `decoder_export` does of a model."""
    elements, largest = parts.of_design(found.design), float(np.nanmax(np.abs(found.forces)))
    full, of_what = full_scale(needed, largest, "the largest force of the bench")
    k, recent, thermal = len(elements), time_series.RECENT, found.is_thermal
    return {
        "command": command, "digest": digest(dataclasses.asdict(found.design)), "layout": found.design.hall_layout,
        "names": [e.name for e in elements], "unit": elements[0].unit, "source": f"a {found.words}",
        "regression": True, "beams": 0, "calibrated": True, "thermal": thermal, "statuses": STATUSES,
        "rails": (elements[0].low, elements[0].high), "average": elements[0].average,
        "example": decoder_export.example_of(found.design), "table_bytes": sum(a.nbytes for a in tables.values()),
        "code_bytes": CODE + WARM_CODE * thermal, "state_bytes": 4 * (4 * k + recent * (k + 1) + 3 + thermal),
        "force_percent": 100 * error / full, "full": full, "of_what": of_what,
    }  # fmt: skip


def texts(
    found: Regression, command: str, needed: Requirements | None = None
) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the texts of all files of the library by their names, and what they say of it."""
    tables = tables_of(found)
    told = told_of(found, needed, command, tables, rounding(found, tables))
    rows = vectors(found)
    made = {HEADER: header(found, told, tables), VECTORS: decoder_export.vectors_header(rows)}
    made |= {PLAIN[2]: decoder_export.vectors_table(rows)} | decoder_export.surroundings(told)
    return made, told


def run(
    found: Regression,
    flash: str,
    needed: Requirements | None,
    command: str,
    more: Mapping[str, Writer],
    progress: Progress,
) -> Result:
    """Return the library with the decoder of a regression, and `more` files; errors are percentages of `needed`."""
    progress(0.0, "test vectors")
    made, told = texts(found, command, needed)
    size, full = told["table_bytes"] + told["code_bytes"], told["full"]
    if size > decoder_export.bytes_of(flash):
        raise BadInput(
            f"--flash {flash} is too small: this regression takes {size} bytes, {told['code_bytes']} of them code"
        )
    error = told["force_percent"] / 100 * full
    record = {
        "status": "ok", "digest": told["digest"], "flash_bytes": size, "table_bytes": told["table_bytes"],
        "state_bytes": told["state_bytes"], "table_error_mm": math.nan, "table_error_N": error,
        "table_error_percent": told["force_percent"], "full_scale_N": full, "full_scale": told["of_what"],
        "fit_error_N": math.nan, "fit_error_percent": math.nan,
        "held_out_N": found.held_out.tolist(), "example": told["example"],
    }  # fmt: skip
    remark = (
        f"float adds {error:.1g} N to the errors of the {found.words}, which on held-out rows were "
        f"{shown(found.held_out.tolist(), 'N', 2, 'unknown')} along x, y and z"
    )
    remarks = [remark]
    if found.is_thermal:
        remarks.append(
            "give the decoder the temperature by magtip_set_temperature: out of the bench's it has no interval"
        )
    files = {name: partial(write_text, text=text) for name, text in made.items()}
    return Result(title="Firmware", records=[record], remarks=remarks, files={**files, **more})
