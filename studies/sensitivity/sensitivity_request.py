"""A sensitivity study as options ask for it, and the tables that it shows on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from geometry.bad_input import nearest
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.exploration import store as stores
from studies.exploration.needed_paths import Processes
from studies.inputs.user_input import AccuracyName
from studies.output.records import FlatRow
from studies.sensitivity import made_sensors, morris_effects, sensitivity_study, sobol_indices, varied_inputs
from studies.sensitivity.beam_motions import MODELS
from studies.sensitivity.sensitivity_report import Results, doubt
from studies.sensitivity.sensitivity_study import METHODS, summary
from studies.sensitivity.sobol_indices import Ranges
from studies.sensitivity.tolerances import Tolerances, parse
from studies.sensitivity.varied_inputs import Press


@dataclass(frozen=True, slots=True)
class Request:
    """A sensitivity study that is ready to run; `counts` are base points, trajectories and made sensors."""

    design: Design
    ranges: Ranges
    load: Press
    methods: tuple[str, ...]
    tolerances: Tolerances
    model: str
    accuracy: AccuracyName
    counts: tuple[int, int, int]
    seed: int


@dataclass(frozen=True, slots=True)
class Table:
    """A table on the screen; `brief` are columns that only a wide one shows, `first` those that it must show."""

    title: str
    rows: Sequence[FlatRow]
    brief: Sequence[str]
    first: Sequence[str]
    remark: str


def request_of(
    *,
    design: Design,
    vary: Sequence[str],
    load: tuple[float, float],
    methods: str,
    tolerances: Sequence[str],
    model: str,
    accuracy: AccuracyName,
    counts: tuple[int, int, int],
    seed: int,
) -> Request:
    """Return the study that options ask for.

    Raises
    ------
    BadInput
        A method, model, range, tolerance, load or seed is unknown or impossible, or has no effect.
    """
    chosen = tuple(dict.fromkeys(part.strip() for part in methods.split(",")))
    for name in chosen:
        if name not in METHODS:
            raise BadInput(f"--methods: there is no method {name!r}: {nearest(name, METHODS)}")
    if model not in MODELS:
        raise BadInput(f"--model: there is no model {model!r}: {nearest(model, MODELS)}")
    if not seed >= 0:
        raise BadInput(f"--seed must be 0 or more; got {seed}")
    if vary and chosen == ("montecarlo",):
        raise BadInput("--vary works with the methods sobol and morris: add one to --methods, or use --tolerance")
    sizes = parse(tolerances)
    ranges = varied_inputs.parse_ranges(vary) if vary else varied_inputs.ranges_of_tolerances(design, sizes)
    if not ranges and chosen != ("montecarlo",):
        raise BadInput("no input varies: add --vary NAME=low:high")
    request = Request(design, ranges, Press(*load), chosen, sizes, model, accuracy, counts, seed)
    _check(request)
    return request


def _check(request: Request) -> None:
    """Raise BadInput for what a method would refuse, before another method has begun to compute."""
    points, trajectories, sensors = request.counts
    if request.methods != ("montecarlo",):
        varied_inputs.check_ranges(request.ranges, request.load)
    if "sobol" in request.methods:
        sobol_indices.check_count(request.ranges, points)
    if "morris" in request.methods:
        morris_effects.check_trajectories(request.ranges, trajectories)
    if "montecarlo" in request.methods:
        made_sensors.check_draw(request.design, sensors, request.seed)


def run(request: Request, store: Path | None, processes: Processes, progress: Progress | None) -> Results:
    """Return the results of all methods of a study; the store is used by morris only, default: the user's."""
    design, ranges, load, seed = request.design, request.ranges, request.load, request.seed
    points, trajectories, sensors = request.counts
    sobol = morris = monte_carlo = None
    # first the method that may refuse the load, last the one whose solves take long
    if "montecarlo" in request.methods:
        _report(progress, "made sensors")
        monte_carlo = sensitivity_study.monte_carlo_study(
            design, load, request.tolerances, request.model, sensors, seed
        )
    if "sobol" in request.methods:
        _report(progress, "Sobol indices")
        sobol = sensitivity_study.sobol_study(design, ranges, load, request.model, points, seed)
    if "morris" in request.methods:
        with stores.opened(store or stores.default()) as states:
            morris = sensitivity_study.morris_study(
                *(design, ranges, load, request.model, request.accuracy, trajectories, seed),
                *(states, processes, progress),
            )
    return Results(design, load, request.tolerances, sobol, morris, monte_carlo)


def _report(progress: Progress | None, text: str) -> None:
    """Report which method begins."""
    if progress is not None:
        progress(0.0, text)


def tables(results: Results) -> list[Table]:
    """Return the tables of all methods."""
    shown = []
    common = ("method", "low", "high", "unit", "points", "failed", "failed_percent", "model")
    if results.sobol is not None:
        parts = (summary(results.sobol.reasons, results.sobol.rows[0].points), doubt(results.sobol.rows))
        remark = "; ".join(filter(None, parts))
        first: tuple[str, ...] = ("output", "input", "first_order", "total_order")
        indices = [row.row() for row in results.sobol.rows]
        shown.append(Table("Sobol indices", indices, (*common, "mean"), first, remark))
    if results.morris is not None:
        parts = (summary(results.morris.reasons, results.morris.rows[0].points), results.morris.doubt)
        remark = "; ".join(filter(None, parts))
        first = ("output", "input", "mu_star", "sigma", "effect_unit")
        effects = [row.row() for row in results.morris.rows]
        shown.append(Table("Morris' effects", effects, (*common, "sigma_low", "sigma_high"), first, remark))
    if results.monte_carlo is not None:
        remark = summary(results.monte_carlo.reasons, results.monte_carlo.rows[0].sensors)
        first = ("axis", "quantity", "unit", "percentile", "value")
        spread = [row.row() for row in results.monte_carlo.rows]
        brief = ("method", "sensors", "failed", "model", "model_error_percent", "message")
        shown.append(Table("Calibration of made sensors", spread, brief, first, remark))
    return shown


def all_failed(results: Results) -> bool:
    """Return whether every case of a method has failed."""
    ends = [
        *([(results.sobol.reasons, results.sobol.rows[0].points)] if results.sobol else []),
        *([(results.morris.reasons, results.morris.rows[0].points)] if results.morris else []),
        *([(results.monte_carlo.reasons, results.monte_carlo.rows[0].sensors)] if results.monte_carlo else []),
    ]
    return any(sum(reasons.values()) >= count for reasons, count in ends)
