"""From a uniaxial test to a design file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import SILICONE_E, BadInput
from geometry.messages import Progress
from studies.output.atomic_files import write_text
from studies.simulation.law_regression import Fit, fit, nominal_stress
from studies.simulation.law_remarks import warnings
from studies.simulation.law_selection import Judged, choose
from studies.simulation.law_stability import MODES
from studies.simulation.tensile_test import Specimen, read

FILES = ("fit.csv", "fit.png", "design.toml")
"""What is written into a folder."""

MARK = "# fitted to "
"""How a design file begins that is written here."""


def run(
    path: str,
    nu: float,
    folder: Path | None,
    asked: str | None = None,
    progress: Progress | None = None,
    command: str = "magtip fit",
) -> list[dict[str, Any]]:
    """Fit the test in a file; writes fit.csv, fit.png and design.toml into an existing folder.

    Parameters
    ----------
    asked : the law that the user chooses.
    command : that this is run by, for design.toml.

    Returns
    -------
    A record for each law, the best first; `chosen` marks the one in design.toml. Where no E is one that a design may
    have, none is chosen and there is no design.toml.
    """
    data = read(path)
    if folder is not None:
        _refuse_foreign(folder / "design.toml")
    if progress is not None:
        progress(0.0, "fits of all laws")
    judged = choose(fit(data, nu), data, asked)
    records = [record(found, data) for found in judged]
    if folder is not None:
        from studies.output import table_plots
        from studies.output.csv_tables import write_table

        write_table(folder / "fit.csv", [flat(row) for row in records])
        smooth = np.geomspace(min(1.0, data.stretch.min()), max(1.0, data.stretch.max()), 300)
        curves = {
            found.fit.law: [_model(found.fit, x, nu).tolist() for x in (smooth, data.stretch)] for found in judged
        }
        table_plots.fit(folder / "fit.png", data.stretch.tolist(), data.stress.tolist(), smooth.tolist(), curves)
        for found in judged:
            if found.chosen:
                write_text(folder / "design.toml", design_text(path, found.fit, nu, command))
    return records


def _refuse_foreign(file: Path) -> None:
    """A design that was not written here is somebody's own: it must not be replaced."""
    if file.exists() and not file.read_bytes().startswith(MARK.encode()):
        raise BadInput(f"{str(file)!r} was not written by magtip fit and would be overwritten: choose another folder")


def _model(found: Fit, stretch: Array, nu: float) -> Array:
    return found.E / (2 * (1 + nu)) * nominal_stress(found.law, tuple(found.numbers.values()), stretch)


def record(judged: Judged, data: Specimen) -> dict[str, Any]:
    """One law under the names that leave the program."""
    found = judged.fit
    return {
        "rank": judged.rank,
        "law": found.law,
        "chosen": judged.chosen,
        "AICc": found.aicc,
        "rms_MPa": found.rms,
        "rms_percent": 100 * found.share,
        "E_MPa": found.E,
        "numbers": found.numbers,
        **{f"stable_{mode}": list(ends) for mode, ends in found.stable.items()},
        "small_strain_excess_percent": 100 * found.small,
        "compression_spread_percent": 100 * judged.spread,
        "constants": found.constants,
        "points": int(data.telling.sum()),
        "exactly_determined": found.exact,
        "least_strain_percent": 100 * data.least_strain,
        "ranked_by": found.criterion,
        "at_bound": list(found.bounded),
        "stable_in_test": judged.in_test,
        "stable_in_solve": judged.in_solve,
        "E_of_a_silicone": SILICONE_E[0] <= found.E <= SILICONE_E[1],
        "not_chosen_because": list(judged.against),
        "stable_farther": judged.farther.law if judged.farther else None,
        "warnings": warnings(judged, data),
        "warning": "; ".join(warnings(judged, data)),
    }


def flat(row: dict[str, Any]) -> dict[str, Any]:
    """A record for a table: numbers, ranges and lists as texts."""
    texts = {"numbers": ", ".join(f"{name}={value:.6g}" for name, value in row["numbers"].items())}
    for mode in MODES:
        low, high = row[f"stable_{mode}"]
        texts[f"stable_{mode}"] = f"{low:.3g} to {high:.3g}"
    for key in ("at_bound", "not_chosen_because"):
        texts[key] = ", ".join(row[key])
    return {key: value for key, value in {**row, **texts}.items() if key != "warnings"}


def design_text(path: str, found: Fit, nu: float, command: str) -> str:
    """The fit as a design file, which such a command makes."""
    values: dict[str, Any] = {"E": found.E, "nu": nu, "law": found.law, **found.numbers}
    lines = [
        f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value!r}" for name, value in values.items()
    ]
    head = f"{MARK}{_printable(Path(path).name)}: rms residual {100 * found.share:.3g} % of the largest stress"
    return "\n".join([head, f"# by {_printable(command)}", *lines, ""])


def _printable(text: str) -> str:
    """The text as a comment can hold it."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
