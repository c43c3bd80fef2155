"""What is said of the laws of a uniaxial test: warnings, and why laws are not chosen."""

from __future__ import annotations

from typing import Any

from geometry.design import SILICONE_E, Design
from studies.simulation.law_regression import MISFIT, SMALL_STRAIN, Fit
from studies.simulation.law_selection import PRESSED, SMALL_MISFIT, SPREAD, Judged, Reason
from studies.simulation.law_stability import MODES, RANGE, SOLVE, Ranges, within
from studies.simulation.tensile_test import STRESS, Specimen


def warnings(judged: Judged, data: Specimen) -> list[str]:
    """What a user should know before a law is used."""
    found, said = judged.fit, []
    if not judged.possible or not SILICONE_E[0] <= found.E <= SILICONE_E[1]:
        said.append(_impossible(judged, data))
    if found.share > MISFIT or abs(found.small) > SMALL_MISFIT:
        said.append(
            f"{found.law} fits the test poorly: its rms error is {100 * found.share:.2g} % of the largest stress, "
            f"and up to {100 * max(SMALL_STRAIN, data.least_strain):.3g} % strain its stress is "
            f"{100 * abs(found.small):.2g} % too {'large' if found.small > 0 else 'small'}; forces may be off by as "
            "much"
        )
    if found.exact:
        constants = f"{found.constants} constant{'s' if found.constants > 1 else ''}"
        said.append(
            f"{found.law} has {constants} and the test as many points, so its error of zero is no evidence: "
            "measure more points"
        )
    if data.least_strain > SMALL_STRAIN:
        said.append(
            f"the smallest strain of the test is {100 * data.least_strain:.3g} %, so E (the stiffness at small "
            "strain) is extrapolated"
        )
    if data.stretch.min() > PRESSED and judged.spread > SPREAD:
        said.append(
            f"the test has no compression: at a stretch of {PRESSED:g} other laws that fit the test differ from "
            f"{found.law} by {100 * judged.spread:.3g} %, and press forces may be off by as much; test in "
            "compression too"
        )
    ends_early = not judged.in_test or not within({"planar": RANGE}, found.stable)
    if not judged.in_test:
        low, high = found.stable["uniaxial"]
        said.append(f"the test exceeds the stable range of {found.law}, stretches from {low:.3g} to {high:.3g}")
    elif ends_early:
        said.append(
            f"{found.law} is stable {_ends(found.stable)}: at the magnet's edge a press to D/4 reaches a planar "
            "stretch of 2.7, a press to 3/8 D one of 4.3; a solve that stops there reports it"
        )
    if ends_early and judged.farther is not None:
        said.append(_farther(found, judged.farther))
    if found.bounded:
        where = " and ".join(f"{name} = {found.numbers[name]:.4g}" for name in found.bounded)
        said.append(f"{where} lies at a bound of the search, so it is not an optimum: the law is ranked last")
    return said


def _farther(found: Fit, other: Fit) -> str:
    """Which law is stable beyond where this one is, and what it costs."""
    whole = within(dict.fromkeys(MODES, RANGE), other.stable)
    where = f"in all stretches from {RANGE[0]:g} to {RANGE[1]:g}" if whole else _ends(other.stable)
    return (
        f"{other.law} has an rms error of {100 * other.share:.2g} % ({found.law}: {100 * found.share:.2g} %) and is "
        f"stable {where}: --law {other.law} may allow deeper presses"
    )


def _impossible(judged: Judged, data: Specimen) -> str:
    """What is wrong with E, and which unit would mend it."""
    found, unit = judged.fit, data.column.rpartition("_")[2]
    if judged.possible:
        text = (
            f"is outside the range of silicones, {SILICONE_E[0]:g} MPa (gels) to {SILICONE_E[1]:g} MPa (Shore A 90)"
        )
    else:
        low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
        text = f"is outside the range of a design, {low:g} to {high:g} MPa"
    others = [
        f"; in {name.rpartition('_')[2]} E would be {value:.4g} MPa"
        for name, factor in STRESS.items()
        if SILICONE_E[0] <= (value := found.E * factor / STRESS[data.column]) <= SILICONE_E[1]
    ]
    check = f"check that the column {data.column} is in {unit}{''.join(others)}"
    return f"{found.law}: E = {found.E:.4g} MPa {text}: {check}"


def _ends(stable: Ranges) -> str:
    """Where a law is stable in each mode."""
    return ", ".join(f"{mode} {low:.3g} to {high:.3g}" for mode, (low, high) in stable.items())


def reasons(row: dict[str, Any]) -> str:
    """Why a law is not chosen, from its record; empty for the one that is."""
    law, numbers = row["law"], ", ".join(row["at_bound"])
    said: dict[Reason, str] = {
        "E_not_possible": "its E is outside the range of a design",
        "unstable_in_test": "it is unstable at some of the test's stretches",
        "misses_test": (
            f"its rms error is {row['rms_percent']:.2g} %, and {abs(row['small_strain_excess_percent']):.2g} % at "
            "small strain"
        ),
        "unstable_in_solve": (
            f"it is stable {_ends({mode: row[f'stable_{mode}'] for mode in MODES})}, but a press to 3/8 D reaches "
            f"{_ends(SOLVE)}"
        ),
        "number_at_bound": f"{numbers} lies at a bound of the search",
        "ranks_lower": "it ranks lower",
        "another_asked_for": "--law chooses another law",
    }
    texts = [said[reason] for reason in row["not_chosen_because"]]
    return f"{law} is not chosen: {'; '.join(texts)}" if texts else ""
