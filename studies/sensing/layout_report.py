"""What `magtip layout` gives to read: tables, LAYOUT.md, and the short forms of a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.output import atomic_files
from studies.output.provenance import made, versions
from studies.sensing import layout_metrics, layout_plots, layout_search, layout_uniqueness

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.survey import Survey

Row = Mapping[str, Any]

FILES = ("layout.csv", "layout.png", "search.csv", "claim.csv", "claim.png", "LAYOUT.md")
"""What is written into a folder; of a search and of the claim only where they are asked for."""


def write(folder: Path, coder: Decoder, seen: Survey, found: Row, command: str, room: float) -> None:
    """layout.csv, layout.png, LAYOUT.md and, of the claim, claim.csv and claim.png, into an existing folder."""
    from studies.output.csv_tables import write_table

    # before a file of the repository changes
    origin = versions()
    write_table(folder / "layout.csv", layout_metrics.table(coder, seen))
    layout_plots.maps(folder / "layout.png", coder, seen, room)
    if "search" in found:
        write_table(folder / "search.csv", found["search"])
    if "claim" in found:
        write_table(folder / "claim.csv", found["claim"]["heights"])
        layout_plots.claim(folder / "claim.png", found["claim"]["heights"], coder.forward.design.c)
    atomic_files.write_text(folder / "LAYOUT.md", text(found, command, origin))


def text(found: Row, command: str, origin: str) -> str:
    """LAYOUT.md."""
    lines = ["# The layout of the Hall elements", ""]
    verdict = found["message"]
    lines += [f"{verdict[0].upper()}{verdict[1:]}.", "", *_figures(found), ""]
    remarks = [f"- {sentence}" for sentence in (*found["hits"], *found["warnings"])]
    lines += [*remarks, ""] if remarks else []
    lines += ["![Condition, sign of det J, multiplicity and noise over x and z](layout.png)", ""]
    lines += ["Left: the plane y = 0. Right: the worst over all y. The table behind it is layout.csv.", ""]
    if "claim" in found:
        lines += _claim(found["claim"])
    if "search" in found:
        lines += ["## Other layouts, best first", "", *_search(found["search"]), ""]
    lines += ["## How it was made", "", *layout_metrics.ABOUT.splitlines()]
    if "search" in found:
        lines += ["", *layout_search.ABOUT.splitlines()]
    return "\n".join([*lines, "", made(command, origin)]) + "\n"


def _figures(found: Row) -> list[str]:
    low, high = found["workspace_mm"]
    box = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True))
    noise = ", ".join(f"{1e6 * value:.3g}" for value in found["noise_of_readings_T"])
    names = [name for name in ("f", "c", "chip_x") if found[f"{name}_mm"] is not None]
    place = "".join(f"{name} = {found[f'{name}_mm']:g} mm, " for name in names)
    rows: list[Sequence[str]] = [
        ("layout", f"{found['layout']}, {place}l0 = {found['l0_mm']:g} mm"),
        ("mechanics, tilt, reading", f"{found['mechanics']}, {found['tilt']}, {found['mode']}"),
        ("workspace: shift of the magnet along x, y, z", f"{box} mm"),
        ("poses of the map; share that the mechanics know", f"{found['poses']}; {found['known_percent']:.3g} %"),
        ("unique", f"{found['unique_percent']:.4g} %"),
        ("ambiguous", f"{found['ambiguous_percent']:.4g} %"),
        ("saturated", f"{found['saturated_percent']:.4g} %"),
        ("blocked", f"{found['blocked_percent']:.4g} %"),
        ("det J > 0, < 0", f"{found['det_positive_percent']:.4g} %, {found['det_negative_percent']:.4g} %"),
        ("condition number, median and worst", _pair(found, "condition", "")),
        ("noise of the pose, median and worst", _pair(found, "noise", "_um", " µm")),
        ("noise of the force, median and worst", _pair(found, "noise", "_N", " N")),
        ("noise of the readings", f"{noise} µT ({found['noise_source']})"),
    ]
    return _markdown(("", ""), rows)


def _pair(found: Row, stem: str, end: str, unit: str = "") -> str:
    return ", ".join(_text(found[f"{stem}_{which}{end}"], unit) for which in ("median", "worst"))


def _text(value: float | None, unit: str = "") -> str:
    """Three digits; a dash for what is not there.

    >>> _text(12.345, " N"), _text(None), _text(float("inf"))
    ('12.3 N', '-', 'infinite')
    """
    if value is None or value != value:
        return "-"
    return "infinite" if abs(value) == float("inf") else f"{value:.3g}{unit}"


def _markdown(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [[cell.replace("|", "\\|") for cell in line] for line in (heads, ["---"] * len(heads), *rows)]
    return [f"| {' | '.join(line)} |" for line in lines]


def _search(rows: Sequence[Row]) -> list[str]:
    heads = ["rank", "layout", "unique %", "saturated %", "blocked %", "worst condition"]
    heads += ["worst noise, µm", "median noise, µm", "worst noise, N"]
    keys = ("unique_percent", "saturated_percent", "blocked_percent", "condition_worst")
    keys += ("noise_worst_um", "noise_median_um", "noise_worst_N")  # type: ignore[assignment]
    cells = []
    for row in rows:
        name, place = ("given" if row["rank"] == 0 else str(row["rank"])), f"`{row['settings']}`"
        cells.append([name, place, *(_text(row[key]) for key in keys)])
    return _markdown(heads, cells)


def _claim(claim: dict[str, list[dict[str, Any]]]) -> list[str]:
    """The claim, its answer for the given layout, where it fails, and how it was measured."""
    lines = ["## Are the readings unique to each position of the magnet?", ""]
    forms = claim["forms"]
    apart = [key for key in forms[0] if key.startswith("difference_at_")]
    heads = ["readings", "workspace, mm", "unique", "poses with equal readings", "worst condition"]
    heads += [
        f"least difference, {key.removeprefix('difference_at_').removesuffix('_mm_over_noise')} mm apart"
        for key in apart
    ]
    cells = []
    for row in forms:
        low, high = row["workspace_mm"]
        box = f"±{high[0]:.2g}, ±{high[1]:.2g}, {low[2]:.2g} to {high[2]:.2g}"
        share, far = row["alike_percent"], row["alike_apart_mm"]
        alike = f"{share:.3g} %, up to {far:.2g} mm apart" if share else "none"
        differences = [f"{row[key]:.3g} x noise" for key in apart]
        cells.append(
            [
                row["readings"],
                box,
                f"{row['unique_percent']:.4g} %",
                alike,
                _text(row["condition_worst"]),
                *differences,
            ]
        )
    lines += [f"- {sentence}" for sentence in layout_uniqueness.answer(claim)]
    lines += ["", "For the given layout:", "", *_markdown(heads, cells), ""]
    lines += ["For which c, and where it fails first:", "", *_limits(claim["limits"]), ""]
    lines += ["![Share of poses whose readings another pose gives too, over c](claim.png)", ""]
    return [*lines, *layout_uniqueness.ABOUT.splitlines(), "", "The table behind it is claim.csv.", ""]


def _limits(rows: Sequence[Row]) -> list[str]:
    heads = ["magnet height, mm", "l0, mm", "readings", "unique for c, mm", "there, or just below", "just above"]
    cells = []
    for row in rows:
        low, high = row["unique_from_c_mm"], row["unique_to_c_mm"]
        span = f"{'any' if low is None else f'{low:.3g}'} to {'any' if high is None else f'{high:.3g}'}"
        cells.append(
            [
                f"{row['magnet_height_mm']:g}",
                f"{row['l0_mm']:g}",
                row["readings"],
                span if row["unique"] else "not at c next to the given",
                _failure(row["below"]),
                _failure(row["above"]),
            ]
        )
    return _markdown(heads, cells)


def _failure(row: Row | None) -> str:
    """What reads alike, and in which box of shifts."""
    if row is None:
        return ""
    box = ", ".join(f"{name} {_span(row[f'alike_{name}_mm'])}" for name in "xyz")
    return (
        f"c = {row['c_mm']:.3g}: {row['alike_percent']:.2g} %, up to {row['alike_apart_mm']:.2g} mm apart, at {box}"
    )


def _span(ends: Sequence[float]) -> str:
    low, high = ends
    return f"{low:.2g}" if high - low < 1e-9 else f"{low:.2g} to {high:.2g}"


# On a terminal


def shown(found: Mapping[str, Any]) -> dict[str, Any]:
    """What a terminal shows of a record."""
    hidden = ["status", "elements", "hits", "warnings", "search", "claim", "poses"]
    hidden += ["known_percent"] if found["known_percent"] == 100 else []
    short = {key: value for key, value in found.items() if key not in hidden and value is not None}
    if found["most_alike"] == 1:
        del short["most_alike"], short["alike_apart_mm"]
    low, high = short.pop("workspace_mm")
    short["workspace_mm"] = [f"{a:.3g} to {b:.3g}" for a, b in zip(low, high, strict=True)]
    return short


def shown_search(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """What a terminal shows of a search; the other shares are in the files and in JSON."""
    kept = ("unique_percent", "condition_worst", "noise_worst_um", "noise_median_um", "noise_worst_N")
    return [{"rank": row["rank"] or "given", "settings": row["settings"]} | {k: row[k] for k in kept} for row in rows]


def shown_claim(claim: Mapping[str, Sequence[Row]]) -> list[dict[str, Any]]:
    """What a terminal shows of the claim: the given layout form by form, and the range of c."""
    rows = []
    for form in claim["forms"]:
        (limit, *_) = [row for row in claim["limits"] if row["readings"] == form["readings"]]
        keys = [key for key in form if key.startswith(("unique", "alike_percent", "alike_apart", "difference"))]
        rows.append({"readings": form["readings"]} | {key: form[key] for key in keys})
        rows[-1] |= {key: limit[key] for key in ("unique_from_c_mm", "unique_to_c_mm")}
    return rows
