"""The three studies of `magtip sensitivity`: Sobol indices, Morris' effects, and made sensors.

Sobol indices come from a fast model, which answers thousands of points; Morris' effects from finite elements, whose
states are kept in the store like those of a sweep, so that an interrupted study continues; made sensors from a fast
model again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.accuracy import LEVELS
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import ANSWERED
from geometry.messages import Progress
from studies.exploration import sweep
from studies.exploration.needed_paths import Processes
from studies.exploration.store import Store
from studies.exploration.study_cases import FemModel, Plan
from studies.exploration.study_rows import flat_rows
from studies.inputs.study_axes import Factor
from studies.inputs.user_input import AccuracyName
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns as element_columns
from studies.sensitivity import morris_effects, sensitivity_rows, sobol_indices
from studies.sensitivity.beam_motions import error_lengths
from studies.sensitivity.calibration_spread import CalibrationSpread, calibration_spread, failure_reasons
from studies.sensitivity.sampled_outputs import names, relative_half_width, sampled_outputs
from studies.sensitivity.sensitivity_rows import MorrisRow, SobolRow, SpreadRow
from studies.sensitivity.sobol_indices import Ranges
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press, check_ranges, sampled_cases

METHODS = ("sobol", "morris", "montecarlo")
"""Methods of the verb."""
MOST_NAMED = 3
"""Greatest number of reasons of failures that a sentence names."""


@dataclass(frozen=True, slots=True)
class SobolStudy:
    """Rows of all outputs, and why how many points have failed."""

    rows: Sequence[SobolRow]
    reasons: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class MorrisStudy:
    """Rows of all outputs, the cases as a sweep has them, and why how many of them have failed.

    `replaced` : number of failed cases that the fast model replaces in the estimates. `unstable` : messages of the
    cases whose state is unstable, which keep their numbers.
    """

    rows: Sequence[MorrisRow]
    cases: Sequence[FlatRow]
    reasons: Mapping[str, int]
    replaced: int
    unstable: Sequence[str]

    @property
    def doubt(self) -> str:
        """How many states are unstable, with the message of the first; "" if none is."""
        if not self.unstable:
            return ""
        return (
            f"{len(self.unstable)} of {len(self.cases)} states are unstable, the first one because {self.unstable[0]}"
        )


@dataclass(frozen=True, slots=True)
class MonteCarloStudy:
    """Percentiles, the made sensors with their calibrations, and why how many of them have failed."""

    spread: CalibrationSpread
    rows: Sequence[SpreadRow]
    sensors: Sequence[FlatRow]
    reasons: Mapping[str, int]
    unit: str


def sobol_study(design: Design, ranges: Ranges, load: Press, model: str, count: int, seed: int) -> SobolStudy:
    """Return the Sobol indices of all outputs for the ranges of the inputs.

    Raises
    ------
    BadInput
        An input cannot vary in this study, or the count is no power of 2.
    """
    check_ranges(ranges, load)
    points = sobol_indices.saltelli_points(ranges, count, seed)
    cases = sampled_cases(design, ranges, points, load)
    outputs, refusals = sampled_outputs(model, design, cases, sheared=_sheared(ranges, load))
    lengths = error_lengths(model, design)
    rows = []
    for name, output in outputs.items():
        indices = sobol_indices.indices(ranges, output.value, output.half_width, seed, lengths)
        rows += sensitivity_rows.sobol_rows(ranges, name, indices, relative_half_width(output), model)
    return SobolStudy(rows, failure_reasons(refusals))


def morris_study(
    design: Design,
    ranges: Ranges,
    load: Press,
    model: str,
    accuracy: AccuracyName,
    count: int,
    seed: int,
    store: Store,
    processes: Processes = Processes(),
    progress: Progress | None = None,
) -> MorrisStudy:
    """Return Morris' effects on all outputs of finite elements; `model` replaces failed cases in the estimates.

    Raises
    ------
    BadInput
        The number of trajectories is out of range, or an input cannot vary in this study.
    KeyboardInterrupt
        The study was interrupted; what is solved is in the store, and the same call continues.
    """
    check_ranges(ranges, load)
    points = morris_effects.trajectories(ranges, count, seed)
    plan = morris_plan(design, ranges, load, points, accuracy)
    tables = list(sweep.run(plan, None, store, processes=processes, progress=progress))
    table = {name: np.concatenate([one[name] for one in tables]) for name in tables[0]}
    ok = np.isin(table["status"].astype(str), ANSWERED)
    sheared = _sheared(ranges, load)
    outputs = names(design, sheared=sheared)
    other = substitutes(design, ranges, load, points, model, ~ok)
    rows = []
    for name in outputs:
        values = np.where(ok, table[f"fem_{name}"].astype(float), np.nan)
        effects = morris_effects.effects(ranges, points, values, other.get(name), seed)
        rows += sensitivity_rows.morris_rows(ranges, name, effects, f"fem {accuracy}")
    replaced = int(np.isfinite(other["force_N"]).sum()) if other else 0
    messages = [f"{one}: {text}" for one, text in zip(table["status"][~ok], table["message"][~ok], strict=True)]
    unstable = table["message"][table["status"] == "unstable"].tolist()
    return MorrisStudy(rows, list(flat_rows(table)), failure_reasons(messages), replaced, unstable)


def morris_plan(design: Design, ranges: Ranges, load: Press, points: Array, accuracy: AccuracyName) -> Plan:
    """Return the points as a study for `sweep.run`, all inputs zipped."""
    fixed: dict[str, float | str] = {} if "depth" in ranges else {"depth": load.depth}
    fixed |= {"shear": load.shear} if load.shear else {}
    quantities = ["force", "shift", "contact_radius", *(["readings"] if design.shape.has_magnet else [])]
    return Plan(
        design,
        (Factor(tuple(ranges), tuple(map(tuple, points.T.tolist())), sampled=True),),
        fixed,
        "rigid" if design.shape.has_magnet else "ignored",
        (FemModel(accuracy, LEVELS[accuracy]),),
        (),
        (*quantities, *(["tilt"] if _sheared(ranges, load) else [])),  # type: ignore[arg-type]
    )


def substitutes(
    design: Design, ranges: Ranges, load: Press, points: Array, model: str, failed: NDArray[np.bool_]
) -> dict[str, Array]:
    """Return the outputs of a fast model at the failed points, NaN elsewhere; none if no point has failed."""
    if not failed.any():
        return {}
    cases = sampled_cases(design, ranges, points[failed], load)
    outputs, _ = sampled_outputs(model, design, cases, sheared=_sheared(ranges, load))
    result = {}
    for name, output in outputs.items():
        result[name] = np.full(len(points), np.nan)
        result[name][failed] = output.value
    return result


def monte_carlo_study(
    design: Design, load: Press, tolerances: Tolerances, model: str, count: int, seed: int
) -> MonteCarloStudy:
    """Return the spread of the calibrations of made sensors.

    Raises
    ------
    BadInput
        The model refuses the design itself, or the draws are impossible.
    """
    spread = calibration_spread(design, load, tolerances, count, seed, model)
    unit = "V" if element_columns(design)[1] == "V" else "T"
    rows = sensitivity_rows.spread_rows(spread, unit, model)
    sensors = sensitivity_rows.sensor_rows(spread, unit)
    return MonteCarloStudy(spread, rows, sensors, failure_reasons(spread.refusals), unit)


def _sheared(ranges: Ranges, load: Press) -> bool:
    """Return whether the load has a shear."""
    return bool(load.shear) or "shear" in ranges


def summary(reasons: Mapping[str, int], count: int) -> str:
    """Return how many of so many cases have failed and why, "" if none has.

    >>> summary({"a": 2, "b": 1}, 100)
    '3 of 100 have failed (3 %), 2 because a, 1 because b'
    """
    failed = sum(reasons.values())
    if not failed:
        return ""
    named = list(reasons.items())[:MOST_NAMED]
    texts = [f"{number} because {text}" for text, number in named]
    rest = failed - sum(number for _, number in named)
    texts += [f"{rest} for other reasons"] if rest else []
    return f"{failed} of {count} have failed ({100 * failed / count:.3g} %), {', '.join(texts)}"
