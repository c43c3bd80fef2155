"""The files of a sizing: sizing.json, front.csv, yield.csv, SIZING.md and front.png."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from studies.output.atomic_files import write_json
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Writer
from studies.output.text_tables import markdown
from studies.sizing import sizing_figures
from studies.sizing.front_solves import FrontPoint, largest_differences

if TYPE_CHECKING:
    from studies.sizing.sizing_study import Sizing

FILES = ("sizing.json", "front.csv", "yield.csv", "SIZING.md", "front.png", "run.json", "winner.toml")
"""Files that a sizing writes into its folder."""
VERSION = 1
"""Version of the format of sizing.json."""
FRONT = (
    *("rank", "D_mm", "L_mm", "magnet", "silicone", "hall_part", "fem_range_z_N"),
    *("fem_resolution_z_mN", "fem_resolution_x_mN", "fem_strain_percent", "outer_size_mm", "score"),
)
"""Columns of front.csv that the page shows."""


def record(sizing: Sizing, origin: str, command: str) -> FlatRow:
    """Return the object of sizing.json, which `--json` prints too."""
    winner = sizing.winner
    return {
        "version": VERSION,
        "status": "ok" if winner else "failed",
        "message": sizing.message,
        "requirements": sizing.requirements.rows(),
        "catalogues": {
            spec.name: len(getattr(sizing.catalogues, spec.name)) for spec in dataclasses.fields(sizing.catalogues)
        },
        "search": dataclasses.asdict(sizing.effort) | {"front": sizing.front_size},
        "winner": None if winner is None else winner_record(winner),
        "front": [point.row() for point in sizing.front],
        "differences": list(largest_differences(sizing.front).values()),
        "yield": [] if sizing.winner_yield is None else sizing.winner_yield.rows(),
        "conflict": [] if sizing.conflict is None else sizing.conflict.rows(),
        "command": command,
        "made": origin,
    }


def winner_record(point: FrontPoint) -> FlatRow:
    """Return the winner: its design, its parts with their sources, and its margins."""
    variant = point.variant
    return {
        "design": dataclasses.asdict(variant.design),
        "magnet": dataclasses.asdict(variant.magnet),
        "silicone": dataclasses.asdict(variant.silicone),
        "hall_part": dataclasses.asdict(variant.hall_part),
        "margins": point.margins,
    }


def result_of(sizing: Sizing, origin: str, command: str, *, wide: bool) -> Result:
    """Return tables, picture and page of a sizing; it has failed without a winner.

    Parameters
    ----------
    origin, command : what sizing.json states as its origin.
    wide : whether the terminal shows all columns of the front.
    """
    whole, made_sensors = record(sizing, origin, command), sizing.winner_yield
    rows = [point.row() for point in sizing.front]
    shown: list[Block] = []
    files: dict[str, Writer] = {"sizing.json": partial(write_json, record=whole)}
    if rows:
        main = rows if wide else [{name: row[name] for name in (*FRONT, "status", "reason")} for row in rows]
        first = ("rank", "D_mm", "L_mm", "magnet", "silicone", "hall_part", "outer_size_mm")
        shown.append(Table(title=f"Front: {len(rows)} points, solved by finite elements", rows=main, first=first))
        files["front.png"] = partial(picture, rows=rows, draw=sizing_figures.front)
    if rows and made_sensors is not None:
        shown.append(
            f"Yield of the first: {100 * made_sensors.share:.3g} % of {made_sensors.count} made sensors are within "
            f"all requirements ({made_sensors.uncertainty})."
        )
    tables = {"front": rows, "yield": [] if made_sensors is None else made_sensors.rows()}
    return Result(
        title="Sizing",
        records=[whole],
        shown=shown,
        tables={name: each for name, each in tables.items() if each},
        files=files,
        pages={"SIZING.md": page(sizing)},
        packages=("pymoo",),
        failures=[] if sizing.winner else [sizing.message],
        design={} if sizing.winner is None else dataclasses.asdict(sizing.winner.variant.design),
    )


def page(sizing: Sizing) -> str:
    """Return SIZING.md without its origin."""
    parts = ["# Sizing", sizing.message and f"No variant: {sizing.message}.", _requirements(sizing)]
    if sizing.winner is not None:
        parts += [_winner(sizing.winner), _yield(sizing)]
    if sizing.front:
        parts += [_front(sizing), _differences(sizing.front)]
    return "\n\n".join(part for part in parts if part)


def _requirements(sizing: Sizing) -> str:
    """Return the table of the requirements, with what the winner reaches."""
    margins = {} if sizing.winner is None else sizing.winner.margins
    rows = []
    for row in sizing.requirements.rows():
        margin = margins.get(row["requirement"])
        rows.append(
            {
                "requirement": row["requirement"],
                "value": "" if row["value"] is None else row["value"],
                "unit": "" if row["unit"] == "1" else row["unit"],
                "state": row["state"],
                "margin of the winner, %": "" if margin is None else f"{100 * margin:.3g}",
            }
        )
    note = (
        "Bounds are held over the whole range of E of each silicone and of the remanence of each grade, at presses "
        "of a quarter of the range and of the whole range, each with sideways forces to their whole range in all "
        "directions. The largest strain is often that of the sideways force under the lighter press, whose contact "
        "is smaller. The range in x is the least sideways force that is reached under these presses; under one "
        "shallower than 0.03 D no shear is known, and none counts as reached. A margin is relative to its bound; "
        "margins above 100 % are shown as 100. The range in z is not followed beyond three times the required one, "
        "the range in x not beyond the required one: a margin of 0 % there means at least the required range. A "
        "press counts as stable as deep as that is known: the margin of stability is at least the stated one."
    )
    return f"## Requirements\n\n{markdown(rows)}\n\n{note}"


def _winner(point: FrontPoint) -> str:
    """Return what the winner is made of, and what it reaches."""
    variant = point.variant
    design, magnet, silicone = variant.design, variant.magnet, variant.silicone
    place = f"l0 = {design.l0:g} mm"
    if design.hall_layout == "three":
        place += f", f = {design.f:g} mm, c = {design.c:g} mm"
    beam = (
        f"- beam: D = {design.D:g} mm, L = {design.L:g} mm, {silicone.name} (E = {silicone.E_low:g} to "
        f"{silicone.E_high:g} MPa: {silicone.source})"
    )
    magnet_text = (
        f"- magnet: {magnet.name}, {magnet.diameter:g} x {magnet.height:g} mm, remanence {magnet.remanence_low:g} to "
        f"{magnet.remanence_high:g} T ({magnet.source})"
    )
    part = f"- Hall part: {variant.hall_part.name} at {place} ({variant.hall_part.source})"
    reached = (
        f"- by finite elements: range {point.solved['range_z']:.3g} N, resolution "
        f"{1000 * point.solved['resolution_z']:.3g} mN in z and {1000 * point.solved['resolution_x']:.3g} mN in x at "
        f"the worst pose, largest strain {100 * point.solved['strain']:.3g} %, outer size "
        f"{point.solved['outer_size']:.3g} mm, first mode {point.solved['first_mode']:.4g} Hz"
    )
    lines = [beam, magnet_text, part, reached]
    return "## The best variant\n\n" + "\n".join(lines)


def _yield(sizing: Sizing) -> str:
    if sizing.winner_yield is None:
        return ""
    made_sensors = sizing.winner_yield
    name, missed = next(iter(made_sensors.missed.items()))
    worst = f"; {name} fails most often, in {missed} of them" if missed else ""
    rows = [
        {
            "requirement": row["requirement"],
            "within, %": f"{row['within_percent']:.3g}",
            "95 % interval of the sampling": f"{row['low_percent']:.3g} to {row['high_percent']:.3g}",
            "at the ends of the surrogate's intervals": f"{row['surrogate_worse_percent']:.3g} to "
            f"{row['surrogate_better_percent']:.3g}",
        }
        for row in made_sensors.rows()
    ]
    return (
        f"## Yield\n\nOf {made_sensors.count} made sensors {100 * made_sensors.share:.3g} % are within all "
        f"requirements ({made_sensors.uncertainty}){worst}. E, nu, remanence, magnet and gain are drawn within the "
        "ranges of the catalogue, places within usual tolerances; mechanics are those of the surrogate, and no made "
        f"sensor is solved by finite elements. Each sensor is calibrated by itself.\n\n{markdown(rows)}"
    )


def _front(sizing: Sizing) -> str:
    """Return the tables of the ranked and of the failed points."""
    ranked = [point.row() for point in sizing.front if point.status == "ok"]
    failed = [point for point in sizing.front if point.status != "ok"]
    of = f" of {sizing.front_size}" if sizing.front_size > len(sizing.front) else ""
    text = (
        f"## Pareto front\n\n{len(sizing.front)}{of} points of the front, all solved by finite elements; "
        f"failed and not ranked: {len(failed)}.\n\n![Front](front.png)"
    )
    if ranked:
        text += "\n\n" + markdown([{name: _short(row.get(name)) for name in FRONT} for row in ranked])
    if failed:
        text += "\n\n### Failed by finite elements\n\n" + markdown(
            [{"point": point.number, **point.variant.row(), "reason": point.reason} for point in failed]
        )
    return text


def _differences(front: Sequence[FrontPoint]) -> str:
    """Return the table of the differences between surrogate and finite elements."""
    rows = [
        {name: "" if value is None else _short(value) for name, value in row.items()}
        for row in largest_differences(front).values()
    ]
    note = (
        "Differences in percent of the finite elements. Half widths (front.csv) are the differences to "
        "the worse ends of the surrogate's intervals, at which the search holds every bound. `of_one_source` counts "
        "points to which only one of the two gives a number: those have no difference."
    )
    return f"## Surrogate beside finite elements\n\n{note}\n\n{markdown(rows)}"


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)
