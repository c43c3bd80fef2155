"""What a design leaves of its requirements: the part `margins` of the live page, and the state at which it opens.

The figures are those of a sizing (`studies.sizing.candidate_performance`): whole sensors at the least and the largest
E of the silicone and the worse end of the remanence, by the surrogate, under all required loads. A magnet or silicone
whose values are those of no part of the catalogue has no ranges.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.beam import surrogate_range, surrogate_response
from studies.inputs import user_input
from studies.parts.catalogues import catalogues_of
from studies.parts.requirements import Criterion, Requirements, read_requirements, stated_requirements
from studies.quantities import UNITS, shown
from studies.sizing import candidate_performance, sensor_arrays, variant_search
from studies.sizing.candidate_performance import Performance
from studies.sizing.candidate_variables import Variant
from studies.web.explorer_state import Request
from studies.web.panels import Memory
from studies.web.state_answers import number
from studies.web.time_answers import refusal

Data = dict[str, Any]
EFFORT = variant_search.Effort(population=256, generations=10)
"""Search for a variant to begin with, which ends with the first one that meets all requirements."""
NO_REQUIREMENTS = (
    "started with a file of requirements, or with a design file that has a table [requirements], such as the "
    "winner.toml of magtip size, magtip explore shows here what the sensor leaves of each"
)


def sensor_of(
    source: str, sets: Sequence[str] = (), progress: Progress | None = None
) -> tuple[Design, Requirements | None]:
    """Return the sensor of a preset or design file with the requirements that it states, None if it states none.

    For a file of requirements it is a variant that meets them by the surrogate, or the nearest of a short search.
    """
    table = user_input.toml_table(source, "preset or file")
    if "force_z" in table:
        needed = read_requirements(source)
        fields = dataclasses.asdict(_variant_for(needed, progress)) | user_input.overrides(sets)
        return user_input.design_from("paper", fields, "rigid"), needed
    return user_input.read_design(source, sets), stated_requirements(source)


def _variant_for(needed: Requirements, progress: Progress | None) -> Design:
    pools = variant_search.searched(needed, catalogues_of(needed), EFFORT, progress, first_met=True)
    pool = min(pools, key=lambda each: float(each.violation.min()))
    found = pool.candidates.variant(int(pool.violation.argmin()))
    if isinstance(found, str):
        raise BadInput(f"no variant was found to begin with: {found}")
    return found.design


def opening_load(design: Design, needed: Requirements) -> dict[str, float]:
    """Return depth and shear, mm, of the largest required load of a sensor with this E; nothing where unknown."""
    try:
        result = performance_of(design, needed, nominal=True)
    except BadInput:
        return {}
    z, x, angle = result.loads[0].T
    known = np.flatnonzero(np.isfinite(result.depth[0] + result.shear[0]) & (np.nan_to_num(angle, nan=1.0) == 0))
    if not len(known):
        return {}
    at = known[np.lexsort((x[known], z[known]))[-1]]
    load = {"depth": float(result.depth[0, at]), "shear": float(result.shear[0, at]) if x[at] else 0.0}
    return {name: round(value * design.D, 3) for name, value in load.items() if value}


def performance_of(design: Design, needed: Requirements, *, nominal: bool = False) -> Performance:
    """Return what a design reaches, one row; `nominal`: of a sensor with its E and remanence, and no ranges.

    Raises
    ------
    BadInput
        There is no base for it, or the surrogate does not know such a beam.
    """
    reason = surrogate_response.refusal(design, Load(depth=surrogate_range.SHALLOWEST * design.D), "rigid")
    if reason:
        raise BadInput(f"margins are known by the surrogate only: {reason}")
    sensors = sensor_arrays.sensors_of_variant(variant_of(design, needed, nominal=nominal), needed)
    # without a noise two loads are infinitely far apart
    with np.errstate(divide="ignore", invalid="ignore"):
        return candidate_performance.performance(sensors, sensors.beams(), needed, caution=0.0 if nominal else 1.0)


def variant_of(design: Design, needed: Requirements, *, nominal: bool = False) -> Variant:
    """Return a design with the parts of the catalogue whose values it has; else with parts without ranges."""
    parts = catalogues_of(needed)

    def like(entries: tuple[Any, ...]) -> Any:
        for entry in [] if nominal else entries:
            # older design files state no drifts
            fields = [(name, value) for name, value in entry.fields().items() if not name.endswith("_drift")]
            if all(
                getattr(design, name) == value
                if isinstance(value, str)
                else math.isclose(getattr(design, name), value, rel_tol=1e-6)
                for name, value in fields
            ):
                return entry
        return None

    magnet = like(parts.magnets) or dataclasses.replace(
        parts.magnets[0], remanence_low=design.remanence, remanence_high=design.remanence
    )
    silicone = like(parts.silicones) or dataclasses.replace(parts.silicones[0], E_low=design.E, E_high=design.E)
    part = like(parts.hall_parts) or dataclasses.replace(parts.hall_parts[0], gain_drift=None)
    return Variant(design, magnet, part, silicone)


def margins_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, Data]]:
    """Yield what the design of a request leaves of its requirements."""
    design, needed = request.state.design, request.needed
    yield level, memory.results.get(("margins", design, needed), partial(margins, design, needed))


def margins(design: Design, needed: Requirements | None) -> Data:
    """Return the part `margins`: a table of values with their margins, and where these are worst."""
    if needed is None:
        return refusal(NO_REQUIREMENTS)
    if not design.shape.has_magnet:
        return refusal("a sensor without a magnet reads nothing")
    try:
        result = performance_of(design, needed)
    except BadInput as error:
        return refusal(str(error))
    variant = variant_of(design, needed)
    rows = [_row(*each, result, variant, needed) for each in needed.criteria()]
    reached = [float(margin[0]) for margin in result.margins.values()]
    # what is not known has the least margin, which no known one has
    unknown = reached.count(candidate_performance.LEAST)
    missed = sum(margin < 0 for margin in reached) - unknown
    counts = [f"{missed} of {len(rows)} requirements missed"] * bool(missed) + [f"{unknown} not known"] * bool(
        unknown
    )
    verdict = ", ".join(counts) or "All requirements are met"
    E, magnet, range_z = variant.silicone, variant.magnet, float(result.values["range_z"][0])
    kept = f" Strain, stability and saturation hold up to {range_z:.3g} N." if range_z > 0 else ""
    return {
        "columns": ["reached, margin", "worst at"],
        "rows": rows,
        "message": f"{verdict}, by the surrogate's pessimistic ends, for E from {E.E_low:.4g} to {E.E_high:.4g} MPa "
        f"and remanences from {magnet.remanence_low:.4g} to {magnet.remanence_high:.4g} T.{kept} Margins are "
        "relative to the bound, and end at 100 %.",
    }


def _row(criterion: Criterion, bound: float, result: Performance, variant: Variant, needed: Requirements) -> Data:
    name, scale, margin = criterion.name, criterion.factor, float(result.margins[criterion.name][0])
    value = float(criterion.value_of(result.values, needed)[0])
    share = shown(abs(margin), "percent")
    text = f"{share} left" if margin >= 0 else f"missed by {share}"
    if math.isnan(value):
        text = "not known: no noise is given" if name.startswith("resolution") else "not known"
    elif math.isinf(value) and margin < 0:
        text = "missed without a bound"
    elif name in ("no_saturation", "clearance"):
        text = "met" if margin >= 0 else "missed"
    name_and_bound = f"{criterion.words}, at {'least' if criterion.way > 0 else 'most'} {scale * bound:.4g}"
    known = scale * value if math.isfinite(value) else None
    return number(name_and_bound, UNITS[criterion.unit], known, text, _corner(criterion, result, variant))


def _corner(criterion: Criterion, result: Performance, variant: Variant) -> str:
    """Return the sensor and the load at which a figure is worst; "" where it is the same for all."""
    silicone, magnet, figure = variant.silicone, variant.magnet, criterion.worst or criterion.figure
    if criterion.softest:
        return f"E = {silicone.E_low:.3g} MPa"
    at = int(result.worst[figure][0]) if figure in result.worst else -1
    if at < 0:
        return ""
    z, x, angle = result.loads[0, at].tolist()
    remanence = magnet.remanence_high if figure == "saturation" else magnet.remanence_low
    E = (silicone.E_low, silicone.E_high)[result.corner[at]]
    # a strain is the same for all magnets and in all directions
    of_field = figure != "strain"
    aside = f" with {x:.3g} N{f' at {math.degrees(angle):.0f}°' if of_field else ''}" if x else ""
    of_magnet = f", {remanence:.3g} T" if of_field else ""
    return f"E = {E:.3g} MPa{of_magnet}, {z:.3g} N{aside}"
