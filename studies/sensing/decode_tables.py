"""Decode a table of readings: the rows of `magtip decode --file`, and the counts that it reports."""

from __future__ import annotations

import contextlib
import csv
import io
import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.loads import tilts_of
from studies.output import atomic_files, console
from studies.output.result import Result
from studies.sensing.decode_readings import RESPONSES, WHY, WITH_POSE, force_gap, in_tesla, limit_sentence
from studies.sensing.field_tables import read_rows

if TYPE_CHECKING:
    from analytic.decode import Decoded, Decoder, Limit, Status
    from geometry.arrays import Array


POSE_COLUMNS = ["status", "shift_x_mm", "shift_y_mm", "shift_z_mm", "tilt_rad", "tilt_y_rad"]
LOAD_COLUMNS = ["force_x_N", "force_y_N", "force_z_N", "depth_mm", "shear_mm", "shear_y_mm"]
COLUMNS = [*POSE_COLUMNS, *LOAD_COLUMNS, "condition", "multiplicity", "level"]
"""Columns that decoding adds to a table of readings."""
MOST_SEARCHED = 2000
"""Number of rows out of the workspace whose poses are searched outside it: a limit of the time, not of the result."""
MANY = 500
"""Number of rows from which a terminal shows the progress."""


def decode_file(
    coder: Decoder,
    path: Path,
    units: str | None,
    out: Path | None,
    level: str,
    check: Callable[[Array, Decoded], tuple[list[Status], list[str]]],
    *,
    as_json: bool = False,
) -> Result:
    """Decode a table of readings as a stream, add the columns `COLUMNS` and count the rows of each status.

    Without `out` the table is printed; as JSON, one object for each row with its number and its readings.

    The table's head names one column for each element in order, such as S1_V,S2_V,S3_V (or _T for flux densities).
    Further columns are copied. A row with an empty or NaN reading gets the status not_finite. `check` returns the
    status of each row, which may differ from the decoder's, and warnings. The result has failed if no row has a pose.

    Raises
    ------
    BadInput
        A file cannot be read or written, or is not a table of readings.
    """
    import numpy as np

    from analytic.decode import decode
    from analytic.parts import columns

    elements = coder.forward.elements
    unit = units or elements[0].unit
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    heads = {kind: [f"{name}_{kind}" for name in columns(elements)] for kind in ("V", "T")}
    other = "T" if unit == "V" else "V"
    head, rows, values = read_rows(
        path,
        heads[unit],
        COLUMNS,
        holes=True,
        instead={f"--units {other}": heads[other]} if elements[0].unit == "V" else {},
    )
    field = in_tesla(elements, values, unit)
    with console.progress(as_json=as_json) if len(rows) >= MANY else contextlib.nullcontext() as progress:
        if progress is not None:
            progress(0.0, f"poses of {len(rows)} rows")
        decoded = decode(coder, field, follow=True)
    statuses, said = check(field, decoded)
    tilt, tilt_y = tilts_of(*decoded.tilt.T)
    numbers = np.column_stack([decoded.shift, tilt, tilt_y, decoded.force, decoded.load, decoded.condition])
    if as_json and target is None:
        lines = zip(field.tolist(), statuses, numbers.tolist(), decoded.multiplicity.tolist(), strict=True)
        console.report(
            [
                {"row": k, "readings_T": b} | dict(zip(COLUMNS, (status, *line, many, level), strict=True))
                for k, (b, status, line, many) in enumerate(lines, 1)
            ],
            as_json=True,
        )
        return _result(coder, decoded, field, level, statuses, said, printed=True)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *COLUMNS])
    for row, status, line, many in zip(rows, statuses, numbers.tolist(), decoded.multiplicity, strict=True):
        writer.writerow([*row, status, *("" if math.isnan(v) else repr(v + 0.0) for v in line), many, level])
    if target is None:
        print(text.getvalue(), end="", flush=True)
    else:
        atomic_files.write_text(target, text.getvalue())
    return _result(coder, decoded, field, level, statuses, said, printed=target is None)


def _result(
    coder: Decoder,
    decoded: Decoded,
    field: Array,
    level: str,
    statuses: list[Status],
    said: list[str],
    *,
    printed: bool,
) -> Result:
    """Return the counts of each status with their reasons; `printed`: whether the rows were printed, not written."""
    from studies.sensing import force_level_check

    gap = force_gap(coder, level, decoded)
    counts: dict[str, int] = {name: statuses.count(name) for name in WHY if name in statuses}
    sentences = []
    for status, count in counts.items():
        why = [WHY[status]]
        if status == "out_of_workspace":
            limits = _count_limits(coder, decoded, field)
            texts = {limit: limit_sentence(coder, limit, solved=level == RESPONSES) for limit in limits}
            why = [texts[limit] + (f" ({n} of {count})" if len(texts) > 1 else "") for limit, n in limits.items()]
        if status != "ok":
            sentences.append(f"{count} of {len(statuses)} rows {status}: {'; '.join(why)}")
    lost = bool(counts) and not WITH_POSE & set(counts)
    return Result(
        title="Decoded",
        records=[] if printed else [counts],
        shown=[],
        warnings=([] if gap is None else force_level_check.warnings(level, gap)) + said,
        remarks=[] if lost else sentences,
        failures=sentences if lost else [],
    )


def _count_limits(coder: Decoder, decoded: Decoded, field: Array) -> dict[Limit | None, int]:
    """Count the rows that exceed each limit of the workspace."""
    from analytic.decode import exceeded_limit, poses_outside

    rows = [k for k, status in enumerate(decoded.status) if status == "out_of_workspace"][:MOST_SEARCHED]
    limits = [exceeded_limit(coder, pose) for pose in poses_outside(coder, field[rows])]
    return dict(Counter(limits))
