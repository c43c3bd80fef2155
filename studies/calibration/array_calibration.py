"""Study calibrate of an array: each beam by the rows that press it, with the neighbours at rest.

The neighbours' magnets at rest add a constant to each reading. It is computed by the design and taken off; how far
made magnets are from the design's is a standard deviation more of the nulls,

    sqrt(sum_j |B_j|^2 (sigma_J^2 + 2 sigma_tilt^2 + (3 sigma_place / p_j)^2)),

with the field B_j of each neighbour at a distance p_j, and the standard deviations of its polarisation, tilt and
place. What a beam's rows say is then the sensor in the field of its neighbours at rest. Forces between magnets shift
the beams at rest, which is in what a beam's rows say, too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from analytic import parts
from analytic.beam_arrays import of_array, readings_of_array
from analytic.hall import field_at
from analytic.inverse.forward_model import model
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.messages import Progress
from studies.calibration import bench_file, calibration_file, calibration_study, regression_study
from studies.inputs.option_groups import Calibrating
from studies.inputs.user_input import pairs, parse_numbers
from studies.output import page_templates
from studies.output.atomic_files import write_text
from studies.output.records import FlatRow
from studies.output.result import Result, Rows, Table
from studies.parts.part_tolerances import Tolerances, standard_deviation
from studies.parts.requirements import Requirements


def run(
    array: ArrayDesign,
    made: Tolerances,
    needed: Requirements | None,
    files: Sequence[Path],
    options: Calibrating,
    progress: Progress,
) -> Result:
    """Calibrate all beams of an array from files that a test stand recorded; see `calibration_study.run`.

    Raises
    ------
    BadInput
        As `calibration_study.run` and `bench_file.beams_of`, or a regression is asked for.
    """
    if not array.design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so there is nothing to calibrate")
    if options.decoder != "model":
        raise BadInput("an array is decoded jointly, by models of its beams: leave --decoder regression out")
    if options.force_noise is not None and not 0 < options.force_noise < math.inf:
        raise BadInput(f"--force-noise must be a number of N above 0; got {options.force_noise:g}")
    columns = pairs("--column", options.columns or [], "b1_S1=X0")
    fixed = pairs("--fix", options.fix or [], "remanence=1")
    values = {name: parse_numbers(f"--fix {name}", text)[0] for name, text in fixed.items()}
    benches = bench_file.beams_of(bench_file.read(files, array, columns, options.force_sign), array)
    strays, unsure = stray_outputs(array), stray_deviations(array, made)
    found: list[tuple[Result, str]] = []
    for k, bench in enumerate(benches):
        design = array.of_beam(k)
        recorded = replace(calibration_study.rows_of(design, bench), needed=needed)
        recorded.measured[:, : len(bench.readings)] -= strays[k]

        def part(share: float, text: str, k: int = k) -> None:
            progress((k + share) / len(array), f"beam {k + 1}: {text}")

        try:
            found.append(
                calibration_study.modelled(design, recorded, options, (made, values), "", part, stray=unsure[k])
            )
        except BadInput as error:
            raise BadInput(f"beam {k + 1}: {error}") from None
    return _result(array, found)


def stray_outputs(array: ArrayDesign) -> Array:
    """Return what the neighbours at rest add to the readings (n, k) by the design, in the elements' unit."""
    beams = of_array(model(array.design), array)
    stray = readings_of_array(beams, np.zeros((1, len(array), 3)), own=False)[0]
    return np.asarray(stray * [element.gain for element in parts.of_design(array.design)])


def stray_deviations(array: ArrayDesign, made: Tolerances) -> Array:
    """Return by how much that differs for made magnets, standard deviations (n, k), in the elements' unit."""
    elements, n = parts.of_design(array.design), len(array)
    points, gain = np.array([element.position for element in elements]), np.array([e.gain for e in elements])
    strength = standard_deviation("remanence", made["remanence"]) / 100
    tilt = math.radians(standard_deviation("magnet_tilt", made["magnet_tilt"]))
    place = max(standard_deviation(f"magnet_{axis}", made[f"magnet_{axis}"]) for axis in "xyz")
    variance = np.zeros((n, len(elements)))
    for k, j in ((k, j) for k in range(n) for j in range(n) if k != j):
        apart = array.places[k] - array.places[j]
        size = np.linalg.norm(field_at(points + np.append(apart, 0.0), array.design), axis=1)
        share = strength**2 + 2 * tilt**2 + (3 * place / np.linalg.norm(apart)) ** 2
        variance[k] += share * size**2
    return np.asarray(np.sqrt(variance) * np.abs(gain))


def _result(array: ArrayDesign, found: Sequence[tuple[Result, str]]) -> Result:
    records = [dict(result.records[0]) for result, _ in found]
    tables: dict[str, Rows] = {
        name: [{"beam": k, **row} for k, (result, _) in enumerate(found, 1) for row in result.tables[name]]
        for name in ("unknowns", "held_out", "learning", "residuals")
    }
    summary: list[FlatRow] = [
        {"beam": k} | row
        for k, (result, _) in enumerate(found, 1)
        for row in calibration_study.summary_of(result.tables["held_out"])
    ]
    warnings = _of_beams([result.warnings for result, _ in found])
    failures = _of_beams([result.failures for result, _ in found])
    said = _of_beams([record["sentences"] for record in records])
    text = calibration_file.array_text(
        array, [json.loads(text) for _, text in found], regression_study.lasting(warnings), failures
    )
    record: FlatRow = {
        "decoder": "array", "beams": len(array), "mechanics": records[0]["mechanics"], "held_out": summary,
        "growth": [each["growth"] for each in records], "sentences": said,
    }  # fmt: skip
    page = page_templates.rendered(
        Path(__file__).with_name("ARRAY_CALIBRATION.md.j2"),
        record=record, summary=summary, said=said, warnings=warnings,
        of_what=f"{records[0]['full_scale_N']:.4g} N",
    )  # fmt: skip
    return Result(
        title="Calibration",
        records=[record],
        shown=[
            Table(title="Columns", rows=found[0][0].tables["columns"]),
            Table(title="Held-out rows by beam", rows=summary),
        ],
        tables=tables,
        files={"calibration.json": partial(write_text, text=text)},
        pages={"CALIBRATION.md": page},
        warnings=warnings,
        failures=failures,
        design=None,
    )


def _of_beams(sentences: Sequence[Sequence[str]]) -> list[str]:
    """Return sentences with the beams that they are about, once each."""
    beams: dict[str, list[int]] = {}
    for k, each in enumerate(sentences, 1):
        for text in each:
            beams.setdefault(text, []).append(k)
    return [
        text if len(which) == len(sentences) else f"beam{'s' * (len(which) > 1)} {', '.join(map(str, which))}: {text}"
        for text, which in beams.items()
    ]
