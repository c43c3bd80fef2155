"""DECODE.md, from what `studies.benchmarks.decoder_benchmark` measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

FULL = 601 * 601 * 301
"""Entries of the paper's table."""
FASTER, STREAM_HZ, TRIP_MM, SHARE = 5e4, 1e3, 1e-6, 0.95


def report(found: Mapping[str, Any], about: Mapping[str, str], text: str) -> str:
    """Goals first, then a table of each measurement, then how it was measured."""
    command = "python -m studies.benchmarks.decoder_benchmark results/decode" + (
        " FULL.npy" if "full" in found else ""
    )
    lines = ["# The decoder", "", f"`{command}`", "", *_goals(found)]
    lines += ["", "## Round trips and how many poses read alike", ""]
    heads = ["layout", "tau, rad/mm", "unique", "worst error of these, mm", "ambiguous"]
    heads += ["other sign of det", "lost", "condition, median", "worst"]
    lines += _table(
        heads,
        [
            [
                row["layout"],
                f"{row['tau']:g}",
                f"{row['unique']:.2%}",
                f"{row['error_mm']:.1e}",
                f"{row['ambiguous']:.2%}",
                f"{row['other_sign']:.2%}",
                f"{row['lost']:.2%}",
                f"{row['condition']:.1f}",
                f"{row['worst_condition']:.0f}",
            ]
            for row in found["trips"]
        ],
    )
    lines += ["", "## Second poses beside an exhaustive search", ""]
    heads = ["layout", "tau, rad/mm", "readings", "ambiguous by the search", "of these by the decoder"]
    heads += ["poses by the search", "missed by the decoder", "found by the decoder alone"]
    keys = ("readings", "ambiguous", "said", "poses", "missed", "only")
    lines += _table(heads, [[r["layout"], f"{r['tau']:g}", *(str(r[k]) for k in keys)] for r in found["searches"]])
    lines += ["", "## Speed", ""]
    heads = ["program", "layout", "decodings/s, many at once", "stream, Hz"]
    lines += _table(
        heads, [[r["program"], r["layout"], f"{r['per_s']:.0f}", f"{r['stream_Hz']:.0f}"] for r in found["speed"]]
    )
    lines += ["", *_lookup(found), "", *_tilts(found), "", "## How it was measured", ""]
    lines += [*text.strip().splitlines(), ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in about.items() if value)]) + "\n"


def _goals(found: Mapping[str, Any]) -> list[str]:
    worst = max(row["error_mm"] for row in found["trips"])
    several = sum(row["ambiguous"] for row in found["searches"])
    said = sum(row["said"] for row in found["searches"]) / max(several, 1)
    many: dict[str, float] = {}
    one: dict[str, float] = {}
    for row in found["speed"]:
        if "l0 6" not in row["layout"]:
            many[row["program"]] = min(many.get(row["program"], 1e99), row["per_s"])
            one[row["program"]] = min(one.get(row["program"], 1e99), row["stream_Hz"])
    rows = [
        [f"unique poses come back to {TRIP_MM:g} mm", f"{worst:.1e} mm", _met(worst <= TRIP_MM)],
        [f"{SHARE:.0%} of the ambiguous readings are said to be", f"{said:.1%} of {several}", _met(said >= SHARE)],
    ]
    for program in many:
        rows.append(
            [f"{FASTER:g} decodings/s on one core, {program}", f"{many[program]:.0f}", _met(many[program] >= FASTER)]
        )
        rows.append(
            [f"a stream at {STREAM_HZ:g} Hz, {program}", f"{one[program]:.0f}", _met(one[program] >= STREAM_HZ)]
        )
    return _table(["goal", "found", "met"], rows)


def _lookup(found: Mapping[str, Any]) -> list[str]:
    rows = found["tables"]
    lines = ["## The paper's table, read by its nearest entry, without tilt", ""]
    lines += _table(
        ["step, mm", "entries", "MB", "built in, s", "query, us", "median error, mm", "worst, mm"],
        [
            [
                f"{r['step_mm']:g}",
                str(r["entries"]),
                f"{r['MB']:.1f}",
                f"{r['build_s']:.2f}",
                f"{r['query_us']:.0f}",
                f"{r['median_mm']:.2g}",
                f"{r['worst_mm']:.2g}",
            ]
            for r in rows
        ],
    )
    if "full" in found:
        return [*lines, "", *_full(found["full"])]
    last = rows[-1]
    full, ratio = last["build_s"] / last["entries"] * FULL / 60, 0.01 / last["step_mm"]
    text = (
        f"At the paper's step of 0.01 mm, extrapolated: {FULL} entries, {24 * FULL / 1e9:.1f} GB, {full:.1f} minutes "
        "on one core to build (`magtip table paper --step 0.01 --out FILE.npy`), a median error of "
        f"{last['median_mm'] * ratio:.2g} mm and a worst one of {last['worst_mm'] * ratio:.2g} mm. Without tilt the "
        "table of two dimensions holds the same readings (`--plane`: 7 MB)."
    )
    lines += ["", text]
    return lines


def _full(row: Mapping[str, Any]) -> list[str]:
    step = f"{row['step_mm']:g}"
    heads = ["made on one core", "made again, the same", "index of blocks", "query", "median error, mm", "worst, mm"]
    cells = [
        f"{row['build_s']:.0f} s (by {row['slabs']} slabs)",
        f"{row['same']} of {row['slabs']} slabs",
        f"{row['index_s']:.0f} s, {row['index_MB']:.1f} MB",
        f"{row['query_us'] / 1e3:.2f} ms, {row['blocks']:.1f} blocks",
        f"{row['median_mm']:.2g}",
        f"{row['worst_mm']:.2g}",
    ]
    text = (
        f"The process took at most, with pages of the mapped file, {row['peak_MB']:.0f} MB. Without "
        "tilt the table of two dimensions holds the same readings (`--plane`: 7 MB)."
    )
    size = f"{row['entries']} entries, {row['MB'] / 1e3:.1f} GB"
    first = f"The whole table, {size}, made by `magtip table paper --step {step} --out FULL.npy`:"
    return [first, "", *_table(heads, [cells]), "", text]


def _tilts(found: Mapping[str, Any]) -> list[str]:
    lines = ["## What ignoring the tilt costs", ""]
    heads = ["mechanics", "no pose", "shift: median error, mm", "worst, mm"]
    heads += ["lateral force: median error, N", "of at most, N", "normal force: median error, N", "of at most, N"]
    keys = ("median_mm", "worst_mm", "lateral_N", "largest_lateral_N", "normal_N", "largest_normal_N")
    lines += _table(
        heads,
        [[name, f"{r['no_pose']:.1%}", *(f"{r[k]:.2g}" for k in keys)] for name, r in found["tilts"].items()],
    )
    if "law" in found:
        law = found["law"]
        tilt, lateral, normal, depth, shear = law.errors
        text = (
            f"states.jsonl reaches {law.reach:.2f} mm sideways and {law.sink:.2f} mm down; the polynomials through "
            f"it miss its states by at most {tilt:.1g} rad, {lateral:.1g} N sideways, {normal:.1g} N of the normal "
            f"force, {depth:.1g} mm of depth and {shear:.1g} mm of shear."
        )
        lines += ["", text]
    return lines


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (heads, ["---"] * len(heads), *rows)]


def _met(good: bool) -> str:
    return "yes" if good else "**no**"
