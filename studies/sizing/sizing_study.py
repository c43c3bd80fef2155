"""The study of `magtip size`: from requirements to a ranked front that finite elements confirm, its yield, its files.

Bounds that no variant of the parts can keep end it at once. Solved states are in the store, and the seed fixes the
search: the same command gives the same result after any interruption, and solves no state again.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.scene import Model
from geometry.array_design import grid_array
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.calibration.sensor_fit import Fit
from studies.cases import FiniteElements
from studies.mechanics import store as stores
from studies.mechanics.solve_plan import Processes
from studies.mechanics.tasks import clock_text
from studies.output import console, page_templates
from studies.output.atomic_files import write_json
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Writer
from studies.parts.catalogues import Catalogues, catalogues_of
from studies.parts.requirements import CRITERIA, Requirements
from studies.sensing.crosstalk import DECODERS, FRAMES, REJECTED
from studies.sizing import conflicts, front_yield, sizing_figures
from studies.sizing.advice import Proof
from studies.sizing.beam_neighbours import SIDE
from studies.sizing.conflicts import Conflict
from studies.sizing.front_solves import (
    ALIKE,
    COMPARED,
    NAMED,
    FrontPoint,
    largest_differences,
    solve_line,
    solved_front,
)
from studies.sizing.front_yield import Yield
from studies.sizing.variant_search import FORCES, Effort, part_of, searched, whole_front

if TYPE_CHECKING:
    import pandas as pd

FILES = ("sizing.json", "front.csv", "yield.csv", "SIZING.md", "front.png", "run.json", "winner.toml")
"""Files that a sizing writes into its folder."""
VERSION = 1
"""Version of the format of sizing.json."""
FRONT = (
    *("rank", "D_mm", "L_mm", "magnet", "silicone", "hall_part", "fem_range_z_N"),
    *("fem_resolution_z_mN", "fem_resolution_x_mN", "fem_strain_percent", "outer_size_mm"),
    *("yield_percent", "worst_batch_percent", "score"),
)
"""Columns of front.csv that the page shows."""
SEARCHED, SOLVED = 0.15, 0.85
"""Shares of the progress at which the search, and the finite elements, end."""
STAGES = {"presses": 0.7, "stability": 3.6, "modes": 0.2, "shears": 4.0, "worst loads": 20.0, "yield": 30.0}
"""Costs of the stages after the search, s on one core, as measured on sensors of 10 to 25 mm; what counts is their
ratio."""
OF_POINTS = ("presses", "stability", "modes", "shears")
"""Stages whose cost is that of each point of the front."""
OF_QUANTITIES = {
    ("force", "auto"): "presses",
    ("critical_depth", "auto"): "stability",
    ("modes", "auto"): "modes",
    ("force", "harmonic"): "shears",
}
"""Stages by the first quantity and the model of which they ask finite elements."""
WORST_CALLS, BASIS = 6, 0.1
"""Calls of the worst loads, and share of the costs from which on they tell the time left."""
MOST, MOST_SENSORS = 4096, 100_000
"""Largest population, number of generations, and number of solved points, and largest number of made sensors; more
are taken for a mistake."""
ALTERNATIVES = 3
"""Number of other variants that are shown beside the best one."""
OBJECTIVES = {
    "range": ("fem_range_z_N", "N", max),
    "resolution in z": ("fem_resolution_z_mN", "mN", min),
    "resolution in x": ("fem_resolution_x_mN", "mN", min),
    "outer size": ("outer_size_mm", "mm", min),
    "yield": ("yield_percent", "%", max),
}
"""What a variant is compared by: column of front.csv, unit, and which is better."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How long to search, and how the front is solved.

    Attributes
    ----------
    effort : candidates of a generation, and generations; the seed is that of the requirements.
    accuracy : of the finite elements.
    processes : what solves: by default as many processes of this machine as pay.
    store : file of solved states; default: the user's.
    points, sensors : largest number of points of the front that are solved, and made sensors of the yield.
    calibration : of a made sensor; its posterior counts in the yield if the best variant is its design.
    """

    effort: Effort = field(default_factory=Effort)
    accuracy: Accuracy = STANDARD
    processes: Processes = field(default_factory=Processes)
    store: Path | str | None = None
    points: int = 12
    sensors: int = 1000
    calibration: Fit | None = None

    def __post_init__(self) -> None:
        effort = self.effort
        for name, value, least, most in (
            ("population", effort.population, 8, MOST),
            ("generations", effort.generations, 1, MOST),
            ("points", self.points, 1, MOST),
            ("sensors", self.sensors, 1, MOST_SENSORS),
        ):
            if not least <= value <= most:
                raise BadInput(f"`{name}` must lie between {least} and {most}; got {value}")

    def calibration_of(self, design: Design) -> Fit | None:
        """Return the calibration if it is one of this design."""
        found = self.calibration
        return found if found is not None and found.sensor.design == design else None


@dataclass(frozen=True, slots=True)
class Sizing:
    """The result of a sizing.

    Attributes
    ----------
    candidates, front_size : numbers of candidates that the search tried, and of variants on its front.
    front : points of the front, the ranked ones first; empty if no candidate meets all requirements.
    conflict : why there is no candidate; None if there is one, or if the search has only missed it.
    """

    requirements: Requirements
    catalogues: Catalogues
    settings: Settings
    candidates: int
    front_size: int
    front: list[FrontPoint]
    winner_yield: Yield | None
    conflict: Conflict | None

    @property
    def winner(self) -> FrontPoint | None:
        """The best point that finite elements confirm."""
        return self.front[0] if self.front and self.front[0].status == "ok" else None

    @property
    def board_refusal(self) -> str:
        """Why `magtip board` refuses the winner, or the array of it in winner.toml, before it searches tracks; "" if
        it does not."""
        from studies.fabrication import array_board

        if self.winner is None:
            return ""
        design, needed = self.winner.variant.design, self.requirements
        array = None if needed.pitch is None else grid_array(design, SIDE, SIDE, needed.pitch)
        return array_board.refusal(design, array, needed.base, needed.process)

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
        assert self.conflict is not None
        return self.conflict.sentence()

    def alternatives(self) -> list[FrontPoint]:
        """Return other points that meet all requirements and differ most in kind from those before: first by the kind
        of Hall part, then by silicone and magnet; of equals the better ones."""
        rest = [point for point in self.front[1:] if point.status == "ok"]
        chosen = self.front[:1]
        for _ in range(min(ALTERNATIVES, len(rest))):
            best = max(rest, key=lambda point: (min(_unlike(point, other) for other in chosen), point.score))
            rest.remove(best)
            chosen = [*chosen, best]
        return chosen[1:]


def _unlike(one: FrontPoint, other: FrontPoint) -> int:
    a, b = one.variant, other.variant
    kinds = (a.hall_part.layout == "three") != (b.hall_part.layout == "three")
    names = [a.silicone.name != b.silicone.name, a.hall_part != b.hall_part]
    return int(8 * kinds + 2 * sum(names) + (a.magnet.name.split()[0] != b.magnet.name.split()[0]))


def size(
    requirements: Requirements, settings: Settings = Settings(), *, progress: Progress | bool | None = None
) -> Sizing:
    """Find the variants that meet requirements: search, then proof by finite elements, as `magtip size` does.

    Parameters
    ----------
    requirements : what the sensor must reach (N, mm, Hz, V), and which catalogues, parts and process it may have.
    settings : how long to search, and how the front is solved.
    progress : True shows a bar on standard error; or a function, called with the share that is done and a text.

    Returns
    -------
    Sizing
        `winner`, the best point that finite elements confirm, or None and a `message` that says why; its parts and
        its design are `winner.variant`. `front` has all points that were solved.

    Raises
    ------
    BadInput
        A requirement is out of range, names no part of the catalogues, or contradicts another one.

    Examples
    --------
    `studies/examples/size_variant.py` sizes a sensor and presses it. A wish that cannot be is refused at once:

    >>> size(Requirements(force_z=5.0, magnets=("5x3 N99",)))
    Traceback (most recent call last):
    geometry.bad_input.BadInput: magnets: the catalogues have no '5x3 N99': did you mean 5x3 N52?
    """
    if not isinstance(requirements, Requirements):
        raise BadInput(f"size takes Requirements, such as Requirements(force_z=5.0); got {requirements!r:.60}")
    settings = replace(settings, effort=replace(settings.effort, seed=requirements.seed))
    with console.chosen_progress(progress) as report:
        return _sized(requirements, settings, report or (lambda share, text: None))


def _sized(requirements: Requirements, settings: Settings, progress: Progress) -> Sizing:
    catalogues = catalogues_of(requirements)
    sizing = partial(Sizing, requirements, catalogues, settings)
    processes = settings.processes
    with (
        # a store that cannot be used is refused before the search
        stores.opened(settings.store or stores.default()) as store,
        # the same workers for all parts, because they start slowly
        processes.opened() as workers,
    ):
        proof = Proof(settings.effort, settings.accuracy, store.file)
        # a trial opens the store, which is on this machine
        local = None if processes.scheduler else workers
        if bounds := conflicts.impossible(requirements, catalogues):
            return sizing(0, 0, [], None, conflicts.excluded(requirements, bounds, proof, local, progress))
        first = part_of(progress, 0.0, SEARCHED)
        found = searched(requirements, catalogues, settings.effort, first, workers=workers)
        candidates = sum(pool.rated for pool in found)
        options = {"store": store, "workers": workers}
        if not any((pool.violation == 0).any() for pool in found):
            rest = part_of(progress, SEARCHED, 1.0)
            conflict = conflicts.conflict_of(requirements, catalogues, found, proof, local, rest)
            return sizing(candidates, 0, [], None, conflict)
        variants, _ = whole_front(found)
        stages = _Stages(progress, min(len(variants), settings.points))
        again = {"retry_failed": processes.retry_failed, "progress": stages}
        fem = _FrontElements(settings.accuracy, options | again)
        front = solved_front(variants, requirements, fem, most=settings.points, sensors=settings.sensors)
        made = None
        if front and front[0].status == "ok":
            progress(SOLVED, f"{settings.sensors} made sensors")
            made = front_yield.yield_of(
                front[0].variant,
                requirements,
                settings.sensors,
                requirements.seed,
                calibration=settings.calibration_of(front[0].variant.design),
                solves={"model": f"fem:{settings.accuracy.name}", **options},
                shares=front[0].made if requirements.least_yield is not None else None,
            )
        return sizing(candidates, len(variants), front, made, None)


class _Stages:
    """Progress of the finite elements of a front by a plan of stages, with the time left once that has a basis."""

    def __init__(self, progress: Progress, points: int) -> None:
        self.progress, self.now, self.calls, self.started = progress, "", 0, time.monotonic()
        self.costs = {name: cost * (points if name in OF_POINTS else 1) for name, cost in STAGES.items()}
        self.done = 0.0

    def begin(self, quantity: str, model: str) -> None:
        """Begin to ask finite elements for a quantity; what is asked again is of the worst loads."""
        stage = OF_QUANTITIES[quantity, model]
        if stage not in self.costs:
            stage = "worst loads"
        if stage != self.now:
            self.done += self.costs.pop(self.now, 0.0)
            self.now, self.calls = stage, 0
        self.calls += 1

    def __call__(self, share: float, text: str) -> None:
        """Report a share of a call; its own time left is not that of the whole."""
        if text.startswith("0 of 0"):
            return  # all is in the store
        if self.now == "worst loads":
            share = min((self.calls - 1 + share) / WORST_CALLS, 1.0)
        done, total = self.done + share * self.costs[self.now], self.done + sum(self.costs.values())
        left = ""
        if done > BASIS * total:
            seconds = (time.monotonic() - self.started) * (total / done - 1)
            left = f", {clock_text(seconds)} left"
        part = done / (total - self.costs["yield"])
        self.progress(SEARCHED + (SOLVED - SEARCHED) * part, f"{self.now}: {text.partition(',')[0]}{left}")


class _FrontElements(FiniteElements):
    """Finite elements that report the stages of a front."""

    def answers(
        self, cases: Sequence[tuple[Design, Load]], quantities: Sequence[str], model: Model = "auto"
    ) -> pd.DataFrame:
        """Return the answers as `FiniteElements` does."""
        self.options["progress"].begin(quantities[0], model)
        return super().answers(cases, quantities, model)


def record(sizing: Sizing, origin: str, command: str) -> FlatRow:
    """Return the object of sizing.json, which `--json` prints too."""
    winner, nearest = sizing.winner, sizing.conflict.nearest if sizing.conflict else None
    return {
        "version": VERSION,
        "status": "ok" if winner else "failed",
        "message": sizing.message,
        "requirements": sizing.requirements.rows(),
        "catalogues": {
            spec.name: len(getattr(sizing.catalogues, spec.name)) for spec in dataclasses.fields(sizing.catalogues)
        },
        "search": dataclasses.asdict(sizing.settings.effort)
        | {"candidates": sizing.candidates, "front": sizing.front_size},
        "winner": None if winner is None else winner_record(winner),
        "front": [point.row() for point in sizing.front],
        "differences": largest_differences(sizing.front),
        **({"yield": []} if sizing.winner_yield is None else sizing.winner_yield.record()),
        "conflict": [] if sizing.conflict is None else sizing.conflict.rows(),
        "nearest": None if nearest is None else winner_record(nearest) | {"reason": nearest.reason},
        "command": command,
        "made": origin,
    }


def winner_record(point: FrontPoint) -> FlatRow:
    """Return the winner: its design, its parts with their sources, and its margins."""
    parts = ("design", "magnet", "silicone", "hall_part")
    found = {name: dataclasses.asdict(getattr(point.variant, name)) for name in parts}
    return found | {"margins": point.margins, "worst_loads": point.worst}


def result_of(sizing: Sizing, origin: str, command: str, *, wide: bool) -> Result:
    """Return tables, picture and page of a sizing; it has failed without a winner."""
    whole, made_sensors = record(sizing, origin, command), sizing.winner_yield
    rows = [point.row() for point in sizing.front]
    shown: list[Block] = []
    files: dict[str, Writer] = {"sizing.json": partial(write_json, record=whole)}
    if rows:
        several = ["chips"] * any((row["chips"] or 1) > 1 for row in rows)
        names = (*FRONT, *several, "status", "reason")
        main = rows if wide else [{name: row[name] for name in names} for row in rows]
        first = ("rank", "D_mm", "L_mm", "magnet", "silicone", "hall_part", *several, "outer_size_mm")
        shown.append(Table(title=f"Front: {len(rows)} points, solved by finite elements", rows=main, first=first))
        files["front.png"] = partial(picture, rows=rows, draw=sizing_figures.front)
    if rows and made_sensors is not None:
        shown.append(f"Yield of the first: {made_sensors.sentence}.")
    if sizing.winner and sizing.winner.doubt:
        shown.append(f"Of the first, {sizing.winner.doubt}.")
    refused = sizing.board_refusal
    tables = {"front": rows, "yield": [] if made_sensors is None else made_sensors.rows()}
    return Result(
        title="Sizing",
        records=[whole],
        shown=shown,
        tables={name: each for name, each in tables.items() if each},
        files=files,
        pages={"SIZING.md": page(sizing)},
        warnings=[f"magtip board refuses the best variant: {refused}"] if refused else [],
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
    rows = [point.row() for point in sizing.front if point.status == "ok"]
    nearest = sizing.conflict.nearest if sizing.conflict else None
    # the requirements that decide
    least = sorted(margins, key=lambda name: margins[name])[:3]
    return page_templates.rendered(
        Path(__file__).with_name("SIZING.md.j2"),
        sizing=sizing,
        requirements=requirements,
        left_out=() if sizing.requirements.hall_parts else sizing.catalogues.left_out,
        unsure=() if sizing.winner is None else _of_noise(sizing.winner.variant.hall_part.assumed),
        made=sizing.winner_yield,
        ranked=rows,
        front_heads={name: name for name in FRONT},
        failed=[{"point": each.number, **each.variant.row(), "reason": each.reason} for each in failed],
        differences=largest_differences(sizing.front),
        named=NAMED,
        line=partial(solve_line, accuracy=sizing.settings.accuracy.name),
        costs=_costs(rows),
        alternatives=[point.row() for point in sizing.alternatives()],
        nearest=[]
        if nearest is None
        else [{"quantity": k, "value": v} for k, v in nearest.row().items() if v is not None and v == v],
        nearest_array=nearest.array if nearest else {},
        side=SIDE,
        decoders=DECODERS,
        random_frames=FRAMES,
        rejected=REJECTED,
        nearest_worst=[] if nearest is None else nearest.worst,
        misses=[{"requirement": name, "margin, %": 100 * margins[name]} for name in least],
        reached=[] if sizing.winner is None else _reached(sizing.winner.solved, sizing.requirements),
    )


def _reached(solved: Mapping[str, float], needed: Requirements) -> list[FlatRow]:
    """Return what a point reaches in the criteria beside forces that bound a number, or that were compared."""
    asked = [each.name for each, _ in needed.criteria()]
    values = {name: np.array(value) for name, value in solved.items()}
    rows = []
    for name, each in CRITERIA.items():
        if name in FORCES or each.level is not None or not (name in asked or each.figure in (*COMPARED, *ALIKE)):
            continue
        value = float(each.value_of(values, needed))
        rows += [{"words": each.words, "value": value, "unit": each.unit}] * math.isfinite(value)
    return rows


def _of_noise(keys: tuple[str, ...]) -> list[str]:
    """Return which of these keys decide the noise of a reading."""
    return [key for key in keys if key in ("noise", "noise_density", "rate", "bandwidth", "step")]


def _costs(rows: list[FlatRow]) -> list[FlatRow]:
    """Return what the best point has in each objective beside the best of the front in it."""
    table = []
    for name, (column, unit, better) in OBJECTIVES.items():
        values = [row[column] for row in rows]
        if not values or any(value is None or value != value for value in values):
            continue
        best = better(values)
        table.append(
            {
                "objective": name,
                "unit": unit,
                "this variant": values[0],
                "best of the front": best,
                "rank of that one": rows[values.index(best)]["rank"],
                "difference, %": 100 * (values[0] / best - 1) if best else math.nan,
            }
        )
    return table
