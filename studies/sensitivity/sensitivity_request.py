"""A sensitivity study as options ask for it."""

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
from studies.output.result import Result
from studies.sensitivity import made_sensors, morris_effects, sensitivity_study, sobol_indices, varied_inputs
from studies.sensitivity.beam_motions import MODELS
from studies.sensitivity.sensitivity_report import Results, result_of
from studies.sensitivity.sensitivity_study import METHODS
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


def run(request: Request, store: Path | None, processes: Processes, progress: Progress) -> Result:
    """Return the result of all methods of a study; the store is used by morris only, default: the user's."""
    design, ranges, load, seed = request.design, request.ranges, request.load, request.seed
    points, trajectories, sensors = request.counts
    sobol = morris = monte_carlo = None
    # first the method that may refuse the load, last the one whose solves take long
    if "montecarlo" in request.methods:
        progress(0.0, "made sensors")
        monte_carlo = sensitivity_study.monte_carlo_study(
            design, load, request.tolerances, request.model, sensors, seed
        )
    if "sobol" in request.methods:
        progress(0.0, "Sobol indices")
        sobol = sensitivity_study.sobol_study(design, ranges, load, request.model, points, seed)
    if "morris" in request.methods:
        with stores.opened(store or stores.default()) as states:
            morris = sensitivity_study.morris_study(
                *(design, ranges, load, request.model, request.accuracy, trajectories, seed),
                *(states, processes, progress),
            )
    return result_of(Results(design, load, request.tolerances, sobol, morris, monte_carlo))
