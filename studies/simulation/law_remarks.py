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
            f"{found.law} misses the test: it leaves {100 * found.share:.2g} % (rms, of the largest stress), and up "
            f"to {100 * max(SMALL_STRAIN, data.least_strain):.3g} % strain its stress is "
            f"{100 * abs(found.small):.2g} % too {'large' if found.small > 0 else 'small'}, as forces may be"
        )
    if found.exact:
        constants = f"{found.constants} constant{'s' if found.constants > 1 else ''}"
        said.append(f"{found.law} is exactly determined, {constants} by as many points: its misfit says nothing")
    if data.least_strain > SMALL_STRAIN:
        said.append(
            f"the least strain of the test is {100 * data.least_strain:.3g} %: E, the stiffness at small strain, is "
            "extrapolated"
        )
    if data.stretch.min() > PRESSED and judged.spread > SPREAD:
        said.append(
            f"laws that hit the test differ by {100 * judged.spread:.3g} % from {found.law} in a compression to a "
            f"stretch of {PRESSED:g}, which the test does not have: forces of a press may differ as much"
        )
    ends_early = not judged.in_test or not within({"planar": RANGE}, found.stable)
    if not judged.in_test:
        low, high = found.stable["uniaxial"]
        said.append(f"the data leave the stable range of {found.law}, stretch {low:.3g} to {high:.3g}")
    elif ends_early:
        said.append(
            f"{found.law} is stable {_ends(found.stable)}: single points at the magnet's edge reach planar stretches "
            "of 2.7 in a press to D/4 and 4.3 to 3/8 D, and a solve that ends there says so"
        )
    if ends_early and judged.farther is not None:
        said.append(_farther(found, judged.farther))
    if found.bounded:
        where = " and ".join(f"{name} = {found.numbers[name]:.4g}" for name in found.bounded)
        said.append(f"{where} at a bound of the search: no optimum, ranked last")
    return said


def _farther(found: Fit, other: Fit) -> str:
    """Which law is stable beyond where this one is, and what it costs."""
    whole = within(dict.fromkeys(MODES, RANGE), other.stable)
    where = f"in all stretches from {RANGE[0]:g} to {RANGE[1]:g}" if whole else _ends(other.stable)
    return (
        f"{other.law} misses the test by {100 * other.share:.2g} % ({found.law} by {100 * found.share:.2g} %) and is "
        f"stable {where}: --law {other.law} may press farther"
    )


def _impossible(judged: Judged, data: Specimen) -> str:
    """What is wrong with E, and which unit would mend it."""
    found, unit = judged.fit, data.column.rpartition("_")[2]
    if judged.possible:
        text = f"is no silicone's, {SILICONE_E[0]:g} MPa (gels) to {SILICONE_E[1]:g} MPa (Shore A 90)"
    else:
        low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
        text = f"is none that a design may have, {low:g} to {high:g} MPa"
    others = [
        f"; were it in {name.rpartition('_')[2]}, E would be {value:.4g} MPa"
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
        "E_not_possible": "its E is none that a design may have",
        "unstable_in_test": "it is not stable over the test's stretches",
        "misses_test": (
            f"it misses the test by {row['rms_percent']:.2g} %, at small strain by "
            f"{abs(row['small_strain_excess_percent']):.2g} %"
        ),
        "unstable_in_solve": (
            f"it is stable {_ends({mode: row[f'stable_{mode}'] for mode in MODES})}, and a press to 3/8 D takes the "
            f"silicone {_ends(SOLVE)}"
        ),
        "number_at_bound": f"{numbers} ended at a bound of the search",
        "ranks_lower": "it ranks lower",
        "another_asked_for": "another law was asked for",
    }
    texts = [said[reason] for reason in row["not_chosen_because"]]
    return f"{law} is not chosen: {'; '.join(texts)}" if texts else ""
