"""Errors of the surrogate on beams that training has not seen, whether its intervals hold, and its files.

Errors are those of `surrogate_study`; a beam is covered if the intervals of all of its states hold the truth.
"""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from geometry.messages import Progress
from studies.mechanics import surrogate_file
from studies.mechanics.prediction import DEEP, SLENDER, THICK, WIDE, Beams
from studies.mechanics.solve_plan import Processes
from studies.mechanics.store import Store
from studies.output.figures import Figure, Look, plot, save, table_of
from studies.output.goals import Goal, missed, verdict
from studies.output.result import Result, Table
from studies.validation import pages, surrogate_study
from studies.validation.pages import Row
from studies.validation.surrogate_fit import COVERAGE
from studies.validation.surrogate_study import Errors, Extent, Outcome, scores
from studies.validation.surrogate_training import density_ratio, random_beams

GOALS = {"force": 2.0, "force_x": 2.0, "force_z": 2.0, "tilt": 3.0}
"""Largest 95th percentile of the errors, %, of presses and shears."""
DOUBT = 0.01
"""Probability that so few beams are covered as a goal refuses, if nine of ten are: a goal for each quantity and group
is refused by chance about once in as many goals as there are in a table."""
DEEPER = f"deep, depth above {DEEP:g} D"
NO_DATA: Row = {"states": 0, "beams": 0, "p95_percent": None, "covered_beams_percent": None}
NO_DATA["least_covered_percent"] = 100 * COVERAGE
REGIONS: dict[str, Callable[[Errors], Any]] = {
    "all": lambda rows: rows.beam == rows.beam,
    f"slender, L/D above {SLENDER:g}": lambda rows: rows.L_over_D > SLENDER,
    "slender, thin magnet": lambda rows: (rows.L_over_D > SLENDER) & (rows.magnet_height_over_D <= THICK),
    f"thick magnet, above {THICK:g} D": lambda rows: rows.magnet_height_over_D > THICK,
    "wide thin magnet": lambda rows: _wide_thin(rows),
    f"wide thin magnet, L/D to {SLENDER:g}": lambda rows: _wide_thin(rows) & (rows.L_over_D <= SLENDER),
    DEEPER: lambda rows: rows.kind.isin(["press", "shear"]) & (rows.depth_over_D > DEEP),
    "nu below 0.49": lambda rows: rows.nu < 0.49,
}


def _wide_thin(rows: Errors) -> Any:
    return (rows.magnet_diameter_over_D > WIDE) & (rows.magnet_height_over_D <= THICK)


def summaries(rows: Errors) -> list[Row]:
    """Return the statistics of each quantity in each region: over all first, then region by region."""
    table = []
    quantities = rows[["kind", "quantity"]].drop_duplicates()
    for region, inside in REGIONS.items():
        own = rows[inside(rows)]
        for kind, name in quantities.itertuples(index=False):
            some = own[(own.kind == kind) & (own.quantity == name)]
            if not some.empty:
                table.append({"kind": kind, "quantity": name, "region": region, **_summary(some)})
    return table


def _summary(rows: Errors) -> Row:
    """Return the statistics of a quantity; NaN if any error is unknown.

    `covered_beams_percent` is the share of beams of which every interval holds the truth; its goal,
    `least_covered_percent`, is the least share that is likely if nine of ten beams are covered.
    """
    sizes = rows.error_percent.abs().to_numpy()
    covered = scores(rows) <= 1.0
    beams = rows.assign(covered=covered).groupby("beam")["covered"].all()
    return {
        "beams": len(beams),
        "states": len(rows),
        "median_percent": float(np.median(sizes)),
        "p95_percent": float(np.percentile(sizes, 95)),
        "largest_percent": float(sizes.max()),
        "covered_percent": 100 * float(covered.mean()),
        "interval_percent": float(np.median(rows.interval_percent.to_numpy())),
        "fem_error_percent": float(np.median(rows.fem_error_percent.to_numpy())),
        "covered_beams_percent": 100 * int(beams.sum()) / len(beams),
        "least_covered_percent": 100 * least_covered(len(beams)) / len(beams),
    }


def least_covered(count: int) -> int:
    """Return how many of `count` beams must be covered: fewer have a probability below DOUBT if nine of ten are.

    >>> least_covered(20), least_covered(120)
    (14, 100)
    """
    return int(stats.binom.ppf(DOUBT, count, COVERAGE))


def goals(table: Sequence[Row], failed: int) -> list[Goal]:
    """Return the goals: no beam of the test is left out; errors and coverage of each quantity in each region.

    A region without a beam has no data, and misses its goals.

    Parameters
    ----------
    failed : number of beams of the test that are left out because a state failed.
    """
    count = failed + max((row["beams"] for row in table), default=0)
    found = [Goal("beams left out of the test because a state failed", failed, 0, count)]
    rows = {(row["region"], row["kind"], row["quantity"]): row for row in table}
    quantities = dict.fromkeys((row["kind"], row["quantity"]) for row in table)
    for region, (kind, quantity) in itertools.product(REGIONS, quantities):
        if region == DEEPER and kind not in ("press", "shear"):
            continue
        row = rows.get((region, kind, quantity), NO_DATA)
        name = f"{kind}, {quantity}, {region}"
        if kind in ("press", "shear") and quantity in GOALS:
            error, bound = row["p95_percent"], GOALS[quantity]
            found.append(Goal(f"{name}: 95th percentile of the errors", error, bound, row["states"], "%"))
        covered, least = row["covered_beams_percent"], row["least_covered_percent"]
        found.append(Goal(f"{name}: beams that the intervals hold", covered, least, row["beams"], "%", at_least=True))
    return found


def designs_per_second(outcome: Outcome, count: int = 10_000) -> Mapping[str, float]:
    """Return how many designs a CPU second takes, with intervals."""
    b = random_beams(count, 11)
    begin = time.process_time()
    beams = Beams(b.L, b.diameter, b.height, b.nu, b.edge, outcome.surrogate)
    beams.press(0.5 * beams.deepest[:, None])
    press = time.process_time()
    beams.shear(0.5 * beams.deepest[:, None], 0.5 * beams.farthest[:, None])
    beams.critical_depth()
    beams.first_mode(density_ratio(b))
    end = time.process_time()
    return {"press": count / (press - begin), "press, shear, critical depth and mode": count / (end - begin)}


# Files

FILES = ("SURROGATE.md", "surrogate.npz", "summary.csv", "errors.csv", "errors.png")


def run(progress: Progress, extent: Extent, states: Store, processes: Processes) -> Result:
    """Build the surrogate and test it; states that the store has are not solved again."""
    return result(surrogate_study.run(extent, states, processes, progress), extent.first)


def result(outcome: Outcome, first: int) -> Result:
    """Return the result of a study; `first` is the number of its first training beams."""
    rows = outcome.errors()
    table = summaries(rows)
    posed = goals(table, outcome.failed[1])
    lost = missed(posed)
    title = "Errors on unseen beams"
    columns = ("kind", "quantity", "region", "p95_percent", "covered_beams_percent", "least_covered_percent")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "surrogate.npz")
        surrogate_file.write(file, outcome.surrogate)
        size = file.stat().st_size
    page = pages.rendered(
        "surrogate.md.j2",
        about=outcome.surrogate.about,
        first=first,
        failed=outcome.failed,
        table=table,
        verdict=verdict(posed),
        lost=list(map(str, lost)),
        size=size / 1e6,
        speed=designs_per_second(outcome),
    )
    return Result(
        title=title,
        records=table,
        shown=[Table(title=title, rows=table, first=columns)],
        tables={"summary": table, "errors": rows.to_dict("records")},
        files={
            "surrogate.npz": lambda path: surrogate_file.write(path, outcome.surrogate),
            "errors.png": lambda path: save(path, figures(rows)),
        },
        pages={"SURROGATE.md": page},
        failures=list(map(str, lost)),
    )


EQUAL = "error = half width"
ENDS = (0.05, 50.0)
"""Half widths, %, at which the line of equal errors begins and ends."""
LEAST_ERROR = 1e-3
"""Least error of the picture, %; smaller errors are drawn at this value."""


def figures(rows: Errors) -> list[Figure]:
    """Return the error of force and tilt over the half width of its interval, for presses and shears."""
    import pandas as pd

    x, y = "half width of the 90 % interval (%)", "error on unseen beams (%)"
    data = rows[rows["quantity"].isin(["force", "force_x", "force_z", "tilt"])]
    data = data.assign(
        **{x: data["interval_percent"], y: data["error_percent"].abs().clip(lower=LEAST_ERROR)},
        panel=data["kind"].astype(str),
        series=data["quantity"].astype(str).str.replace("_", " along "),
    )
    equal = table_of(
        {x: end, y: end, "panel": kind, "series": EQUAL, "joined": True}
        for kind in dict.fromkeys(data["panel"])
        for end in ENDS
    )
    data = pd.concat([data[[x, y, "panel", "series"]].assign(joined=False), equal], ignore_index=True)
    return [plot("Errors and half widths of the surrogate", "", data, x, y, Look(log="xy"))]
