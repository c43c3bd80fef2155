"""The files of a sizing: sizing.json, front.csv, yield.csv, SIZING.md and front.png."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from studies.output import page_templates
from studies.output.atomic_files import write_json
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Writer
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
    margins = {} if sizing.winner is None else sizing.winner.margins
    requirements = [
        {
            "requirement": row["requirement"],
            "value": row["value"],
            "unit": "" if row["unit"] == "1" else row["unit"],
            "state": row["state"],
            "margin of the winner, %": 100 * margins.get(row["requirement"], math.nan),
        }
        for row in sizing.requirements.rows()
    ]
    failed = [point for point in sizing.front if point.status != "ok"]
    return page_templates.rendered(
        Path(__file__).with_name("SIZING.md.j2"),
        sizing=sizing,
        requirements=requirements,
        made=sizing.winner_yield,
        ranked=[point.row() for point in sizing.front if point.status == "ok"],
        front_heads={name: name for name in FRONT},
        failed=[{"point": each.number, **each.variant.row(), "reason": each.reason} for each in failed],
        differences=list(largest_differences(sizing.front).values()),
    )
