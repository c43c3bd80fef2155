"""True errors of vibrations, compared with a much finer mesh, and whether their estimates hold."""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from fem.accuracy import FINE, LEVELS, QUICK, Accuracy, longer_edges
from fem.analyses.vibration import vibrating_sensor, vibration_model
from fem.results.error_estimates import VibrationQuantity
from fem.scene import Scene, press_limits
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.output.goals import Goal
from studies.output.result import Result
from studies.simulation import response_curves
from studies.simulation.response_curves import Complex, Curves
from studies.validation import pages
from studies.validation.error_study_cases import designs, rounded
from studies.validation.errors.error_table import CLEAR, COVERAGE, SHARP, SHARPNESS
from studies.validation.pages import Row

REFERENCE = replace(FINE, name="reference", section_size=0.03, section_patch=0.0013, harmonics=4)
SHARES, SHEAR = (0.3, 1.0), 0.08
"""Depths over the first depth of `press_limits`, and shear over D."""
RATIOS = np.geomspace(0.02, 3.0, 40)
"""Frequencies over the lowest natural one of the free sensor."""
FINE_DESIGNS = (0, 3, 6, 9)
"""Designs that are solved at level fine too, without shear."""
NAN = float("nan")
FILES = ("VIBRATION_ERRORS.md", "vibration_errors.csv")
FIGURES = ("static_error", "static_estimate", "largest_error", "difference", "holds", "sharp")
QUANTITIES = ("force over motion", "shift over force", "reading over force", "shift of the free sensor")
RULES: tuple[VibrationQuantity, ...] = ("force", "shift", "reading", "base")
"""Gains that are judged, the last one of free sensors only, and the rules of their estimates."""


class Case(NamedTuple):
    """A vibration: number of the design, kind of its state at rest, and the load there."""

    number: int
    kind: str
    design: Design
    load: Load


def cases(*, quick: bool = False) -> list[Case]:
    chosen = []
    for number, design in enumerate(designs()[: 1 if quick else None]):
        chosen.append(Case(number, "free", design, Load()))
        for share in SHARES[:1] if quick else SHARES:
            depth = rounded(share * press_limits(design, "rigid")[0])
            chosen.append(Case(number, "press", design, Load(depth, friction="none")))
            if not quick:
                chosen.append(Case(number, "glued press", design, Load(depth, friction="stick")))
            # a shear takes a minute on the reference mesh: each design has one, at one depth or the other
            if not quick and share == SHARES[number % 2]:
                shear = rounded(SHEAR * design.D)
                chosen.append(Case(number, "shear", design, Load(depth, shear_x=shear, friction="stick")))
    return chosen


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Compare error estimates of vibrations with a much finer mesh; exit status 3 if a goal is missed unexpectedly.

    Nothing of a run that was stopped is kept: start it again.

    Parameters
    ----------
    quick
        Use two vibrations of one design, accuracy quick and a coarser reference: some seconds instead of hours.
    """
    chosen, judged = cases(quick=quick), list[Row]()
    truth = replace(REFERENCE, section_size=0.06, section_patch=0.003, harmonics=3) if quick else REFERENCE
    for i, case in enumerate(chosen):
        fine = case.number in FINE_DESIGNS and not case.load.shears_tip
        levels = [QUICK] if quick else [level for name, level in LEVELS.items() if fine or name != "fine"]
        solved = {}
        for accuracy in dict.fromkeys([truth, *(one for level in levels for one in (level, longer_edges(level)))]):
            progress(i / len(chosen), f"design {case.number}, {case.kind}, size {accuracy.section_size:g}")
            solved[accuracy] = solve(case, accuracy)
        for level in levels:
            judged += judge(case, level, *(solved[one] for one in (level, longer_edges(level), truth)))
    return result(judged, "quick" if quick else "full")


def solve(case: Case, accuracy: Accuracy) -> Mapping[str, Curves]:
    band = RATIOS * lowest_frequency(case.design)
    try:
        sensor = vibrating_sensor(case.design, case.load, (band[0], band[-1]), accuracy, check=False)
    except BadInput:
        return {}
    return response_curves.evaluator(case.design, sensor)(band)


@functools.cache
def lowest_frequency(design: Design) -> float:
    """Return the lowest natural frequency of the free sensor at level quick, Hz, rounded to four digits."""
    free = vibrating_sensor(design, Load(), (1.0, 2.0), QUICK, check=False)
    return rounded(min(min(values) for values in free.undamped().values()))


def judge(
    case: Case, level: Accuracy, fine: Mapping[str, Curves], coarse: Mapping[str, Curves], truth: Mapping[str, Curves]
) -> list[Row]:
    """Return the errors and estimates of a case at a level; NaN for motions that one of the meshes does not have.

    Errors and estimates are relative, static ones those at the lowest frequency; `difference` is the median one to
    the coarser mesh, over its amplification by resonances; `holds` and `sharp` are shares of the frequencies.
    """
    load, free = case.load, not case.load.depth
    scene = Scene(case.design, (load,), level, "rigid", "axisymmetric" if free else vibration_model(load))
    rules = RULES[3:] if free else RULES[:3]
    judged = []
    place: Row = {"design": case.number, "kind": case.kind, "depth_mm": load.depth, "shear_mm": load.shear_x}
    # a mesh on which the state is not reached has no motions
    for motion, rule in itertools.product(sorted(fine.keys() | coarse.keys() | truth.keys()) or [""], rules):
        row = place | {"level": level.name, "motion": motion, "quantity": QUANTITIES[RULES.index(rule)]}
        if any(motion not in curves for curves in (fine, coarse, truth)):
            judged.append(row | dict.fromkeys(FIGURES, NAN))
            continue
        g, g_coarse, g_true = (_gain(rule, curves[motion], fine[motion]) for curves in (fine, coarse, truth))
        estimate = response_curves.errors(rule, fine[motion], coarse[motion], g, g_coarse, scene)
        error = np.abs(g - g_true) / np.abs(g_true)
        slope = response_curves.amplification(fine[motion].frequency, g)
        difference = np.abs(g - g_coarse) / np.maximum(np.abs(g), np.abs(g_coarse)) / slope
        holds, sharp = estimate >= error, (estimate <= SHARP * error) | (estimate <= CLEAR)
        figures = (error[0], estimate[0], error.max(), np.median(difference), holds.mean(), sharp.mean())
        judged.append(row | dict(zip(FIGURES, map(float, figures), strict=True)))
    return judged


def _gain(rule: VibrationQuantity, curves: Curves, fine: Curves) -> Complex:
    if rule == "base":
        return curves.along
    assert curves.force is not None
    if rule == "reading":
        assert curves.per_N is not None
        return curves.per_N[:, fine.readers[0] if fine.readers else 0]
    return curves.force if rule == "force" else curves.along / curves.force


def summary(judged: Sequence[Row]) -> list[Row]:
    frame = pd.DataFrame(judged)
    frame["about"] = np.where(frame.kind == "shear", "a shear", "a press")
    frame.loc[frame.quantity == QUANTITIES[3], "about"] = "rest"
    rows = []
    for place in itertools.product(QUANTITIES, ("z", "x"), ("rest", "a press", "a shear")):
        row: Row = dict(zip(("quantity", "motion", "about"), place, strict=True))
        own = frame[(frame[list(row)] == list(place)).all(axis=1)]
        for level in LEVELS if len(own) else ():
            errors = 100 * own.largest_error[own.level == level]
            told = f"{errors.quantile(0.95):.2g}" if len(errors) else "not solved"
            row[f"{level}: 95 % of errors below, %"] = told
        shares = {f"{name}, %": f"{100 * own[name].mean():.0f}" for name in ("holds", "sharp")}
        rows += [row | {"cases": len(own)} | shares] if len(own) else []
    return rows


def goals(judged: Sequence[Row]) -> list[Goal]:
    """Return the goals of the study; a case without an answer misses them all."""
    posed = []
    for name, goal in (("holds", COVERAGE), ("sharp", SHARPNESS)):
        share = 100 * float(np.mean([one[name] for one in judged])) if judged else None
        posed.append(Goal(name, share, 100 * goal, len(judged), "%", at_least=True))
    return posed


def result(judged: Sequence[Row], run: str = "full") -> Result:
    table, title = summary(judged), "Errors of vibrations"
    page = {"summary": table, "reference": REFERENCE}
    return pages.study("vibration_errors", title, judged, page, table, goals=goals(judged), run=run, digits=4)
