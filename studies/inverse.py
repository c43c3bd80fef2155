"""The verbs that go back from readings: decode and table."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from geometry.design import BadInput
from studies import console, decoding, inputs
from studies.options import FAILED, GOOD, AsJson, Sets, Source, judged


def decode(
    source: Source,
    /,
    *,
    readings: str | None = None,
    file: Path | None = None,
    units: Literal["T", "V"] | None = None,
    level: str | None = None,
    responses: Path | None = None,
    ignore_tilt: bool = False,
    out: Path | None = None,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Pose of the magnet and load on the tip from readings, with every other pose that reads alike.

    Exit status 3 if no pose in the workspace gives the readings (of a file: not a single row of it).

    Parameters
    ----------
    readings
        What the elements read, a,b,c in the order S1,S2,S3 (a chip: -z,x,y).
    file
        A .csv file with the columns S1_V,S2_V,S3_V (or _T), decoded row by row as a stream.
    units
        Of the readings: outputs in V or flux densities B.n in T; by default what the elements send.
    level
        Formulas that give tilt and load from the shift: paper (which has no tilt) by default.
    responses
        States printed by `magtip solve --json`, a line each, that give tilt and load instead of formulas.
    ignore_tilt
        Decode as if the magnet did not tilt.
    out
        The .csv file with the results added; standard output by default.
    """
    if (readings is None) == (file is None):
        raise BadInput("give the readings either as --readings a,b,c or as --file FILE.csv")
    if readings is not None and out is not None:
        raise BadInput("--out is for --file FILE.csv: leave it out")
    coder = decoding.prepare(inputs.read_design(source, sets or []), level, responses, ignore_tilt=ignore_tilt)
    if readings is not None:
        record = decoding.one(coder, readings, units)
        console.report([record], as_json=as_json, title="Decoded")
        if record["status"] == "ambiguous":
            console.say(f"magtip: warning: {record['message']}")
            return GOOD
        return judged([record])
    assert file is not None
    counts = decoding.table(coder, file, units, out)
    if as_json and out is not None:
        console.report([counts], as_json=True)
    for status, count in counts.items():
        if status != "ok":
            console.say(f"magtip: {count} of {sum(counts.values())} rows {status}: {decoding.WHY[status]}")
    return GOOD if not counts or {"ok", "ambiguous"} & set(counts) else FAILED
