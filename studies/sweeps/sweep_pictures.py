"""The pictures of a sweep: which rows and which quantities they show.

Of a study with more than some ten thousand cases every k-th value of its longest axes is drawn, and a note says so;
the table has all.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.inputs import study_input
from studies.mechanics.path_solver import KINDS
from studies.mechanics.study_cases import Columns, Plan
from studies.output import figures
from studies.sweeps import sweep_figures

if TYPE_CHECKING:
    import pandas as pd

MOST_DRAWN = 20_000
"""Largest number of cases that are drawn: more marks than a picture has room for."""
LARGE = 1000
"""Number of cases from which on the pictures leave out axes whose effect on the shown quantities is known."""


class Collected:
    """The rows of a sweep that its pictures show."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._fixed = _fixed(plan)
        counts = [factor.count for factor in plan.factors]
        drawn = [1 if k in self._fixed else count for k, count in enumerate(counts)]
        while math.prod(drawn) > MOST_DRAWN:
            longest = drawn.index(max(drawn))
            drawn[longest] = max(1, (drawn[longest] + 1) // 2)
        self._thinned = {
            plan.factors[k].names[0]: (drawn[k], count)
            for k, count in enumerate(counts)
            if drawn[k] < count and k not in self._fixed
        }
        self._chosen = [
            np.isin(np.arange(count), np.unique(np.round(np.linspace(0, count - 1, few)).astype(int)))
            for count, few in zip(counts, drawn, strict=True)
        ]
        for k, point in self._fixed.items():
            self._chosen[k] = np.arange(counts[k]) == point
        self._parts: list[Columns] = []

    def add(self, table: Columns, indices: NDArray[np.int64]) -> None:
        """Keep those rows of a table that are drawn."""
        rows = np.ones(len(indices), dtype=bool)
        stride = self.plan.count
        for factor, chosen in zip(self.plan.factors, self._chosen, strict=True):
            stride //= factor.count
            rows &= chosen[indices // stride % factor.count]
        if rows.any():
            self._parts.append({name: values[rows] for name, values in table.items()})

    def draw(self, path: Path) -> list[Path]:
        """Draw the pictures, one for each quantity, and return their files.

        The second one and further ones end in -2, -3 ... before the suffix; older files of such names are deleted.
        """
        import pandas as pd

        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        idle = {study_input.column(name) for k in self._fixed for name in self.plan.factors[k].names}
        table = pd.DataFrame({name: values for name, values in columns.items() if name not in idle})
        names = (path if k == 1 else path.with_stem(f"{path.stem}-{k}") for k in itertools.count(1))
        files = []
        for quantity in self._quantities(table):
            drawn = sweep_figures.sweep(table, [quantity])
            if drawn:
                files.append(next(names))
                figures.save(files[-1], drawn, notes=self._notes())
        for old in itertools.takewhile(Path.is_file, names):
            old.unlink()
        return files

    def _quantities(self, table: pd.DataFrame) -> list[str]:
        sheared = self.plan.loads_sideways and ("shear" in self.plan.axes or bool(self.plan.load.get("shear")))
        forces = ["force_x_N", "force_N"] if sheared else ["force_N", "force_x_N"]
        names = [*forces, *(name for name in sweep_figures.QUANTITIES if name not in forces)]
        present = [name for name in names if sweep_figures.models_of(table, name)]
        more = any(name in self.plan.quantities for name in KINDS)
        return present if more else present[:1]

    def _notes(self) -> list[str]:
        notes = []
        for k, point in self._fixed.items():
            factor = self.plan.factors[k]
            if "E" in factor.names:
                E = factor.values[factor.names.index("E")][point]
                notes.append(f"Forces are proportional to E: drawn for E = {E:g} MPa.")
            others = [name for name in factor.names if name != "E"]
            if others:
                verb = "has" if len(others) == 1 else "have"
                notes.append(f"{', '.join(others)} {verb} no effect on what is shown.")
        return notes + [
            f"Of {count} values of {name}, {few} are drawn; the table has all."
            for name, (few, count) in self._thinned.items()
        ]


def _fixed(plan: Plan) -> dict[int, int]:
    """Return the factors of a large study that the pictures show at one point only, with the number of this point.

    Forces do not depend on the Hall elements and the remanence, and are proportional to E.
    """
    matter = plan.matters("problems")
    idle = [k for k, factor in enumerate(plan.factors) if k not in matter and factor.count > 1]
    if "modes" in plan.quantities or "critical_depth" in plan.quantities:
        idle = [k for k in idle if "E" not in plan.factors[k].names]
    if plan.count < LARGE or len(idle) == len(plan.factors):
        return {}
    fixed = {}
    for k in idle:
        names, values = plan.factors[k].names, plan.factors[k].values
        E = [float(value) for value in values[names.index("E")]] if "E" in names else [plan.design.E]
        fixed[k] = min(range(len(E)), key=lambda point: abs(E[point] - plan.design.E))
    return fixed
