"""Comparison of the harmonic model on the section with models of tetrahedra, by their own error estimates."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fem.accuracy import LEVELS, Accuracy
from fem.scene import turns
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.cases import FemModel
from studies.inputs.user_input import AccuracyName
from studies.output.result import Result
from studies.simulation.compare import part
from studies.validation import error_study_cases, pages
from studies.validation.error_study_cases import answers_of
from studies.validation.errors.error_table import relative_errors

FILES = ("CROSSCHECK.md", "crosscheck.csv")
COMPONENTS = {
    "force": ("force_x_N", "force_y_N", "force_N"),
    "shift": ("shift_x_mm", "shift_y_mm", "shift_z_mm"),
    "tilt": ("tilt_rad", "tilt_y_rad"),
    "sideways": ("sideways_N",),
}
"""Columns of the components of each quantity that is compared."""
LOADS = Path(__file__).with_name("crosscheck_loads.csv")
"""Loads of the designs: first upright plates with the largest shear of `error_study_cases`, then tilted ones at the
same depth. A frictionless plate only presses; others shear by 0.05 D along the tilt or across, where with a
coefficient of 0.4 some of the contact area slips. Each kind of load occurs with and without a rigid magnet."""
Case = tuple[int, Load]
"""Number of the design, and load."""


def run(
    progress: Progress,
    *,
    accuracy: AccuracyName = "quick",
    quick: bool = False,
    tilted: bool = False,
    store: Path | None = None,
) -> Result:
    """Compare the harmonic model with tetrahedra; exit status 3 if they differ by more than both error estimates.

    Parameters
    ----------
    accuracy
        Accuracy of both models.
    quick
        Use the first of twelve designs: a minute instead of ten.
    tilted
        Also compare loads of tilted plates: a quarter of an hour more, most of it for Coulomb friction on tetrahedra.
    store
        File of solved states; default: that of the user.
    """
    count = 1 if quick else error_study_cases.DESIGNS
    chosen = [(number, load) for number, load in loads() if number < count and (tilted or not load.plate_tilt)]
    answers = solved(chosen, LEVELS[accuracy], store, progress)
    return result(compared(chosen, *answers), "quick" if quick else "full")


def magnet_of(number: int) -> Magnet:
    return "rigid" if number % 2 == 0 else "ignored"


def loads() -> list[Case]:
    found = []
    for row in pd.read_csv(LOADS, dtype={"friction": str}).itertuples():
        friction: Any = row.friction if row.friction in ("none", "stick") else float(row.friction)
        load = Load(row.depth_mm, row.shear_mm, row.shear_y_mm, friction, plate_tilt=row.tilt_rad)
        found.append((int(row.design), load))
    return found


def solved(
    chosen: list[Case], accuracy: Accuracy, store: Path | None = None, progress: Progress | None = None
) -> list[pd.DataFrame]:
    """Return the answers of the harmonic model, of tetrahedra, and of the former with one harmonic more.

    The tetrahedra fill the whole body where the load turns out of the plane of symmetry, else half of it.
    """
    asked = [(error_study_cases.designs()[n], load, magnet_of(n)) for n, load in chosen]
    x, y = (np.array([load.direction[k] for _, load in chosen]) for k in (0, 1))
    richer = replace(accuracy, name="one harmonic more", harmonics=accuracy.harmonics + 1)
    models = [
        [FemModel("harmonic", accuracy, "harmonic")] * len(chosen),
        [FemModel("solid", accuracy, "full" if turns([load]) else "half") for _, load in chosen],
        [FemModel("harmonic", richer, "harmonic")] * len(chosen),
    ]
    found = []
    for k, own in enumerate(models):
        table = answers_of(asked, own, ["force", "shift", "tilt"], part(progress, k / 3, (k + 1) / 3), store=store)
        found.append(table.assign(sideways_N=table.force_x_N * x + table.force_y_N * y))
    return found


def compared(chosen: list[Case], harmonic: pd.DataFrame, solid: pd.DataFrame, one_more: pd.DataFrame) -> pd.DataFrame:
    """Return for each load the differences of the models, percent of the harmonic answer, and their estimates.

    They agree in a quantity if the difference is at most the sum of both error estimates, and not at all where a
    solve has failed or an estimate is unknown.
    """
    states = {"harmonic": harmonic, "tetrahedra": solid, "one harmonic more": one_more}
    table = pd.DataFrame(
        {
            "design": number,
            "magnet": magnet_of(number),
            "depth_mm": load.depth,
            "shear_mm": load.shear_x,
            "shear_y_mm": load.shear_y,
            "tilt_deg": round(math.degrees(load.plate_tilt), 3),
            "friction": load.friction,
            "sheared": bool(load.shear),
        }
        for number, load in chosen
    )
    good = pd.concat([answers["status"] == "ok" for answers in states.values()], axis=1).all(axis=1)
    table["status"], table["message"] = "ok", ""
    for name, answers in reversed(states.items()):
        bad = answers["status"] != "ok"
        table.loc[bad, "status"] = answers.loc[bad, "status"]
        table.loc[bad, "message"] = name + ": " + answers.loc[bad, "message"]
    table["agree"] = good
    other, more = (100 * relative_errors(answers, harmonic, COMPONENTS, 0.0) for answers in (solid, one_more))
    for name in COMPONENTS:
        asked = good & (table["sheared"] | (name != "sideways"))
        column = "error_estimate" if name == "force" else f"{name}_error_estimate"
        table[f"{name}_difference_percent"] = other[name].where(asked)
        table[f"{name}_harmonic_estimate_percent"] = 100 * harmonic[column].where(asked)
        table[f"{name}_half_estimate_percent"] = 100 * solid[column].where(asked)
        table[f"{name}_one_harmonic_more_percent"] = more[name].where(asked)
        agrees = _off(table, name) <= 1
        table[f"{name}_agree"] = agrees.astype(object).where(asked)
        table["agree"] &= agrees | ~asked
    table["harmonic_s"], table["half_s"] = harmonic["seconds"], solid["seconds"]
    return table.drop(columns="sheared")


def result(table: pd.DataFrame, run: str = "full") -> Result:
    rows = pages.records(table)
    loads = "loads" if (table.tilt_deg != 0).any() else "designs"
    place = "design " + table.design.astype(str) + ", tilt " + table.tilt_deg.map("{:g}".format) + " deg"
    off = pd.DataFrame({name: _off(table, name) for name in COMPONENTS}).max(axis=1).where(table.status == "ok")
    misses = dict(zip(place[~table.agree], off[~table.agree].tolist(), strict=True))
    shown = {name: table[table[f"{name}_agree"].notna() | (table.status != "ok")] for name in COMPONENTS}
    brief = pages.records(table.drop(columns=[f"{name}_agree" for name in COMPONENTS]))
    page = {"rows": rows, "loads": loads, "tables": {name: pages.records(own) for name, own in shown.items()}}
    title, look = "Harmonic model against tetrahedra", {"places": ("design",)}
    return pages.study("crosscheck", title, rows, page, brief, look, misses=misses, run=run)


def _off(table: pd.DataFrame, name: str) -> pd.Series:
    """Return the differences of a quantity over the sum of both estimates."""
    estimates = table[f"{name}_harmonic_estimate_percent"] + table[f"{name}_half_estimate_percent"]
    return table[f"{name}_difference_percent"] / estimates
