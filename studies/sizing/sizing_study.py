"""The study of `magtip size`: from requirements to a ranked front that finite elements confirm, its yield, its files.

Solved states are in the store, and the seed fixes the search: the same command gives the same result after any
interruption, and solves no state again.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fem.accuracy import Accuracy
from geometry.messages import Progress
from studies.mechanics import store as stores
from studies.mechanics.solve_plan import Processes, Solver
from studies.output import page_templates
from studies.output.atomic_files import write_json
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Writer
from studies.sizing import conflicts, front_yield, sizing_figures
from studies.sizing.catalogues import Catalogues, catalogues_of
from studies.sizing.conflicts import Conflict
from studies.sizing.front_search import Effort
from studies.sizing.front_solves import FrontPoint, largest_differences, solved_front
from studies.sizing.front_yield import Yield
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import check_rated, islands, searched

FILES = ("sizing.json", "front.csv", "yield.csv", "SIZING.md", "front.png", "run.json", "winner.toml")
"""Files that a sizing writes into its folder."""
VERSION = 1
"""Version of the format of sizing.json."""
FRONT = (
    *("rank", "D_mm", "L_mm", "magnet", "silicone", "hall_part", "fem_range_z_N"),
    *("fem_resolution_z_mN", "fem_resolution_x_mN", "fem_strain_percent", "outer_size_mm", "score"),
)
"""Columns of front.csv that the page shows."""
SEARCHED, SOLVED = 0.35, 0.9
"""Shares of the progress at which the search, and the finite elements, end."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How long to search, and how the front is solved.

    Attributes
    ----------
    points : largest number of points of the front that are solved.
    sensors : number of made sensors of the yield.
    """

    effort: Effort
    accuracy: Accuracy
    processes: Processes
    store: Path | None
    points: int
    sensors: int


@dataclass(frozen=True, slots=True)
class Sizing:
    """The result of a sizing.

    Attributes
    ----------
    front : points of the front, the ranked ones first; empty if no candidate meets all requirements.
    front_size : number of variants on the front of the search.
    winner_yield : yield of the best point; None if there is none.
    conflict : why there is no candidate; None if there is one, or if the search has only missed it.
    """

    requirements: Requirements
    catalogues: Catalogues
    effort: Effort
    front_size: int
    front: list[FrontPoint]
    winner_yield: Yield | None
    conflict: Conflict | None

    @property
    def winner(self) -> FrontPoint | None:
        """The best point that finite elements confirm."""
        return self.front[0] if self.front and self.front[0].status == "ok" else None

    @property
    def message(self) -> str:
        """Why there is no winner, in a sentence; "" if there is one."""
        if self.winner is not None:
            return ""
        if self.front:
            reasons = self.front[0].reason
            return (
                f"all {len(self.front)} points of the front fail by finite elements, the first because {reasons}: "
                "leave more room in that requirement"
            )
        if self.conflict is not None:
            return self.conflict.sentence()
        return (
            "the search found no variant that meets all requirements, and no set of them that conflicts: search "
            "longer with --generations, or loosen one"
        )


def run(requirements: Requirements, settings: Settings, progress: Progress) -> Sizing:
    """Search for variants, solve the front by finite elements, and return the result.

    Raises
    ------
    BadInput
        A catalogue or the store cannot be used, or a limit of the program rejects every candidate.
    """
    catalogues = catalogues_of(requirements)
    groups = islands(requirements, catalogues)
    first = partial(_part, progress, 0.0, SEARCHED)
    # a store that cannot be used is refused before the search
    with stores.opened(settings.store or stores.default()) as store:
        lasts, variants = searched(groups, settings.effort, first)
        if not variants:
            check_rated(groups)
            conflict = conflicts.conflict_of(groups, lasts, partial(_part, progress, SEARCHED, 1.0))
            return Sizing(requirements, catalogues, settings.effort, 0, [], None, conflict)
        solver = Solver(store, settings.processes, partial(_part, progress, SEARCHED, SOLVED), settings.accuracy)
        front = solved_front(variants, requirements, solver, most=settings.points)
    made = None
    if front[0].status == "ok":
        progress(SOLVED, f"{settings.sensors} made sensors")
        solves = {
            "model": f"fem:{settings.accuracy.name}",
            "store": settings.store,
            "workers": settings.processes.workers,
        }
        variant, seed = front[0].variant, requirements.seed
        made = front_yield.yield_of(variant, requirements, settings.sensors, seed, solves=solves)
    return Sizing(requirements, catalogues, settings.effort, len(variants), front, made, None)


def _part(progress: Progress, low: float, high: float, share: float, text: str) -> None:
    """Report the progress of a part of the study."""
    progress(low + (high - low) * share, text)


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
        **({"yield": []} if sizing.winner_yield is None else sizing.winner_yield.record()),
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
        shown.append(f"Yield of the first: {made_sensors.sentence}.")
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
