"""DECODE.md, from what `studies.benchmarks.decoder_benchmark` measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analytic.inverse.response_surface import Mechanics
from studies.benchmarks.lookup_benchmark import TableFigures, WholeTable

FULL = 601 * 601 * 301
"""Entries of the paper's table."""
FASTER, STREAM_HZ, TRIP_MM, SHARE = 5e4, 1e3, 1e-6, 0.95


@dataclass(frozen=True, slots=True)
class RoundTrips:
    """Poses of a layout that are decoded from their own readings.

    Attributes
    ----------
    tau : tilt per shift, rad/mm.
    unique, lost, ambiguous, other_sign : shares of the poses, as ABOUT of the benchmark says.
    error_mm : the worst of the unique ones.
    condition, worst_condition : of the slopes, median and largest.
    """

    layout: str
    tau: float
    unique: float
    error_mm: float
    lost: float
    ambiguous: float
    other_sign: float
    condition: float
    worst_condition: float


@dataclass(frozen=True, slots=True)
class SecondPoses:
    """The decoder's poses beside those of an exhaustive search.

    Attributes
    ----------
    ambiguous, said : readings with several poses by the search, and those of them that the decoder calls so.
    poses, missed, only : poses by the search, those that the decoder misses, and those that it alone has.
    """

    layout: str
    tau: float
    readings: int
    ambiguous: int
    said: int
    poses: int
    missed: int
    only: int


@dataclass(frozen=True, slots=True)
class DecoderSpeed:
    """Decodings a second of many readings at once, and of a stream."""

    program: str
    layout: str
    per_s: float
    stream_Hz: float


@dataclass(frozen=True, slots=True)
class TiltErrors:
    """Errors of shift and force where the magnet tilts and the decoder does not know it.

    Attributes
    ----------
    no_pose : share of the readings without a pose.
    median_mm, worst_mm : of the shift.
    lateral_N, normal_N : median errors of the force; largest_... : the largest force itself.
    """

    no_pose: float
    median_mm: float
    worst_mm: float
    lateral_N: float
    normal_N: float
    largest_lateral_N: float
    largest_normal_N: float


@dataclass(frozen=True, slots=True)
class Measurements:
    """All that the benchmark of the decoder measures.

    Attributes
    ----------
    whole : of the paper's table in a file, if one is named.
    tilts : by the mechanics.
    law : through the states of states.jsonl, if there are any.
    """

    trips: Sequence[RoundTrips]
    searches: Sequence[SecondPoses]
    tables: Sequence[TableFigures]
    whole: WholeTable | None
    tilts: Mapping[str, TiltErrors]
    law: Mechanics | None
    speed: Sequence[DecoderSpeed]


def report(measured: Measurements, about: Mapping[str, str], text: str) -> str:
    """Return the text of DECODE.md: goals, a table of each measurement, and how it was measured."""
    command = "python -m studies.benchmarks.decoder_benchmark results/decode" + (
        " FULL.npy" if measured.whole is not None else ""
    )
    lines = ["# The decoder", "", f"`{command}`", "", *_goals(measured)]
    lines += ["", "## Round trips, and shares of ambiguous readings", ""]
    heads = ["layout", "tau, rad/mm", "unique", "worst error of these, mm", "ambiguous"]
    heads += ["other sign of det", "lost", "condition, median", "worst"]
    lines += _table(
        heads,
        [
            [
                trips.layout,
                f"{trips.tau:g}",
                f"{trips.unique:.2%}",
                f"{trips.error_mm:.1e}",
                f"{trips.ambiguous:.2%}",
                f"{trips.other_sign:.2%}",
                f"{trips.lost:.2%}",
                f"{trips.condition:.1f}",
                f"{trips.worst_condition:.0f}",
            ]
            for trips in measured.trips
        ],
    )
    lines += ["", "## Second poses beside an exhaustive search", ""]
    heads = ["layout", "tau, rad/mm", "readings", "ambiguous by the search", "of these by the decoder"]
    heads += ["poses by the search", "missed by the decoder", "poses of the decoder alone"]
    cells = [
        [s.layout, f"{s.tau:g}", *map(str, (s.readings, s.ambiguous, s.said, s.poses, s.missed, s.only))]
        for s in measured.searches
    ]
    lines += _table(heads, cells)
    lines += ["", "## Speed", ""]
    heads = ["program", "layout", "decodings/s, many at once", "stream, Hz"]
    lines += _table(heads, [[s.program, s.layout, f"{s.per_s:.0f}", f"{s.stream_Hz:.0f}"] for s in measured.speed])
    lines += ["", *_lookup(measured), "", *_tilts(measured), "", "## How it was measured", ""]
    lines += [*text.strip().splitlines(), ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in about.items() if value)]) + "\n"


def _goals(measured: Measurements) -> list[str]:
    worst = max(trips.error_mm for trips in measured.trips)
    several = sum(search.ambiguous for search in measured.searches)
    said = sum(search.said for search in measured.searches) / max(several, 1)
    many: dict[str, float] = {}
    one: dict[str, float] = {}
    for speed in measured.speed:
        if "l0 6" not in speed.layout:
            many[speed.program] = min(many.get(speed.program, 1e99), speed.per_s)
            one[speed.program] = min(one.get(speed.program, 1e99), speed.stream_Hz)
    rows = [
        [f"unique poses come back to {TRIP_MM:g} mm", f"{worst:.1e} mm", _met(worst <= TRIP_MM)],
        [
            f"{SHARE:.0%} of the ambiguous readings are reported as ambiguous",
            f"{said:.1%} of {several}",
            _met(said >= SHARE),
        ],
    ]
    for program in many:
        rows.append(
            [f"{FASTER:g} decodings/s on one core, {program}", f"{many[program]:.0f}", _met(many[program] >= FASTER)]
        )
        rows.append(
            [f"a stream at {STREAM_HZ:g} Hz, {program}", f"{one[program]:.0f}", _met(one[program] >= STREAM_HZ)]
        )
    return _table(["goal", "measured", "met"], rows)


def _lookup(measured: Measurements) -> list[str]:
    lines = ["## The paper's table without tilt, read by its nearest entry", ""]
    lines += _table(
        ["step, mm", "entries", "MB", "built in, s", "query, us", "median error, mm", "worst, mm"],
        [
            [
                f"{table.step_mm:g}",
                str(table.entries),
                f"{table.MB:.1f}",
                f"{table.build_s:.2f}",
                f"{table.query_us:.0f}",
                f"{table.median_mm:.2g}",
                f"{table.worst_mm:.2g}",
            ]
            for table in measured.tables
        ],
    )
    if measured.whole is not None:
        return [*lines, "", *_full(measured.whole)]
    last = measured.tables[-1]
    full, ratio = last.build_s / last.entries * FULL / 60, 0.01 / last.step_mm
    text = (
        f"At the paper's step of 0.01 mm, extrapolated: {FULL} entries, {24 * FULL / 1e9:.1f} GB, {full:.1f} minutes "
        "on one core to build (`magtip table paper --step 0.01 --out FILE.npy`), a median error of "
        f"{last.median_mm * ratio:.2g} mm and a worst one of {last.worst_mm * ratio:.2g} mm. Without tilt the "
        "table of two dimensions holds the same readings (`--plane`: 7 MB)."
    )
    lines += ["", text]
    return lines


def _full(whole: WholeTable) -> list[str]:
    table = whole.figures
    heads = ["made on one core", "made again, the same", "index of blocks", "query", "median error, mm", "worst, mm"]
    cells = [
        f"{table.build_s:.0f} s (by {whole.slabs} slabs)",
        f"{whole.same} of {whole.slabs} slabs",
        f"{whole.index_s:.0f} s, {whole.index_MB:.1f} MB",
        f"{table.query_us / 1e3:.2f} ms, {whole.blocks:.1f} blocks",
        f"{table.median_mm:.2g}",
        f"{table.worst_mm:.2g}",
    ]
    text = (
        f"The process took at most, with pages of the mapped file, {whole.peak_MB:.0f} MB. Without "
        "tilt the table of two dimensions holds the same readings (`--plane`: 7 MB)."
    )
    size = f"{table.entries} entries, {table.MB / 1e3:.1f} GB"
    first = f"The whole table, {size}, made by `magtip table paper --step {table.step_mm:g} --out FULL.npy`:"
    return [first, "", *_table(heads, [cells]), "", text]


def _tilts(measured: Measurements) -> list[str]:
    lines = ["## Errors if the tilt is ignored", ""]
    heads = ["mechanics", "no pose", "shift: median error, mm", "worst, mm"]
    heads += ["lateral force: median error, N", "of at most, N", "normal force: median error, N", "of at most, N"]
    cells = []
    for mechanics, t in measured.tilts.items():
        numbers = t.median_mm, t.worst_mm, t.lateral_N, t.largest_lateral_N, t.normal_N, t.largest_normal_N
        cells.append([mechanics, f"{t.no_pose:.1%}", *(f"{number:.2g}" for number in numbers)])
    lines += _table(heads, cells)
    if measured.law is not None:
        law = measured.law
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
