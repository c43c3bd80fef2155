"""Fit the silicone's laws to a uniaxial test and write a design file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import SILICONE_E
from geometry.messages import Progress
from studies.output import own_files
from studies.output.atomic_files import write_text
from studies.output.records import FlatRow
from studies.simulation.law_regression import Fit, fit, nominal_stress
from studies.simulation.law_selection import Judged, choose, warnings
from studies.simulation.tensile_test import Specimen, read

FILES = ("fit.csv", "fit.png", "design.toml")
"""Files that `run` writes into a folder."""

MARK = "# fitted to "
"""First characters of a design file that this module writes."""


@dataclass(frozen=True, slots=True)
class FitRow:
    """One law fitted to a test, with the properties of the test."""

    judged: Judged
    data: Specimen

    @property
    def warnings(self) -> list[str]:
        """Warnings about the use of the law."""
        return warnings(self.judged, self.data)

    def row(self) -> FlatRow:
        """Return the flat row for JSON; `texts` has the same columns for tables."""
        judged, fit, data = self.judged, self.judged.fit, self.data
        return {
            "rank": judged.rank,
            "law": fit.law,
            "chosen": judged.chosen,
            "AICc": fit.aicc,
            "rms_MPa": fit.rms,
            "rms_percent": 100 * fit.share,
            "E_MPa": fit.E,
            "numbers": fit.numbers,
            **{f"stable_{mode}": list(ends) for mode, ends in fit.stable.items()},
            "small_strain_excess_percent": 100 * fit.small,
            "compression_spread_percent": 100 * judged.spread,
            "constants": fit.constants,
            "points": int(data.telling.sum()),
            "exactly_determined": fit.exact,
            "least_strain_percent": 100 * data.least_strain,
            "ranked_by": fit.criterion,
            "at_bound": list(fit.bounded),
            "stable_in_test": judged.in_test,
            "stable_in_solve": judged.in_solve,
            "E_of_a_silicone": SILICONE_E[0] <= fit.E <= SILICONE_E[1],
            "not_chosen_because": list(judged.against),
            "stable_farther": judged.farther.law if judged.farther else None,
            "warnings": self.warnings,
            "warning": "; ".join(self.warnings),
        }

    def texts(self) -> FlatRow:
        """Return the row for a table and for fit.csv: numbers, ranges and lists as texts."""
        fit = self.judged.fit
        texts: FlatRow = {"numbers": ", ".join(f"{name}={value:.6g}" for name, value in fit.numbers.items())}
        texts |= {f"stable_{mode}": f"{low:.3g} to {high:.3g}" for mode, (low, high) in fit.stable.items()}
        texts |= {"at_bound": ", ".join(fit.bounded), "not_chosen_because": ", ".join(self.judged.against)}
        return {name: value for name, value in {**self.row(), **texts}.items() if name != "warnings"}


def run(
    path: str,
    nu: float,
    folder: Path | None,
    asked: str | None = None,
    progress: Progress | None = None,
    command: str = "magtip fit",
) -> list[FitRow]:
    """Fit the test in a file, and write fit.csv, fit.png and design.toml into an existing folder.

    Parameters
    ----------
    asked : the law that the user chooses.
    command : command line that design.toml names as its origin.

    Returns
    -------
    A row for each law, the best first; that of the law in design.toml is chosen. Where no E is one that a design may
    have, none is chosen and there is no design.toml.
    """
    data = read(path)
    if folder is not None:
        own_files.check(folder, FILES)
    if progress is not None:
        progress(0.0, "fits of all laws")
    laws = choose(fit(data, nu), data, asked)
    rows = [FitRow(judged, data) for judged in laws]
    if folder is not None:
        from studies.output.csv_tables import write_table
        from studies.simulation import fit_plot

        write_table(folder / "fit.csv", [row.texts() for row in rows])
        smooth = np.geomspace(min(1.0, data.stretch.min()), max(1.0, data.stretch.max()), 300)
        curves = {
            judged.fit.law: [_model(judged.fit, x, nu).tolist() for x in (smooth, data.stretch)] for judged in laws
        }
        fit_plot.draw(folder / "fit.png", data.stretch.tolist(), data.stress.tolist(), smooth.tolist(), curves)
        for judged in laws:
            if judged.chosen:
                write_text(folder / "design.toml", design_text(path, judged.fit, nu, command))
    return rows


def _model(fit: Fit, stretch: Array, nu: float) -> Array:
    """Return the nominal stress of a fitted law at stretches, MPa."""
    return fit.E / (2 * (1 + nu)) * nominal_stress(fit.law, tuple(fit.numbers.values()), stretch)


def design_text(path: str, fit: Fit, nu: float, command: str) -> str:
    """Return the text of the design file of a fit; it names the command."""
    values: dict[str, Any] = {"E": fit.E, "nu": nu, "law": fit.law, **fit.numbers}
    lines = [
        f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value!r}" for name, value in values.items()
    ]
    head = f"{MARK}{printable(Path(path).name)}: rms residual {100 * fit.share:.3g} % of the largest stress"
    return "\n".join([head, f"# by {printable(command)}", *lines, ""])


def printable(text: str) -> str:
    """Return the text without characters that a comment cannot contain."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
