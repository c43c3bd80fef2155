"""Columns of a study's rows that depend on time: steady vibrations, and loops of loading cycles."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np

from geometry.relaxation import relaxation_of
from studies.mechanics import response_paths
from studies.mechanics.path_solver import Answer
from studies.mechanics.study_cases import Batch, Columns, Plan, Problem
from studies.sweeps.model_results import NAN


def response(plan: Plan, batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return -3 dB bandwidth, first resonance and its Q; with a frequency also gain and phase there, degrees."""
    named = ("response_bandwidth_Hz", "response_resonance_Hz", "response_Q")
    at = ("response_gain", "response_phase_deg") if "frequency" in {*plan.load, *plan.axes} else ()
    numbers = np.array(
        [_response(plan, problem, answer) for problem, answer in zip(batch.problems, answers, strict=True)]
    )[batch.problem]
    columns = dict(zip((*at, *named), numbers.T[0 if at else 2 :], strict=True))
    return {name: np.ascontiguousarray(values) for name, values in columns.items()}


def _response(plan: Plan, problem: Problem, answer: Answer) -> tuple[float, ...]:
    """Return gain, phase, bandwidth, resonance and Q of a problem; NaN for what it does not have."""
    from fem.analyses.vibration import relaxed

    values, design = answer.values, problem.design
    if not values or design is None or plan.reference is None:
        return (NAN,) * 5
    at_rest, frequency = relaxed(design, relaxation_of(design)), problem.motion.frequency
    unit = response_paths.unit_of(at_rest)
    gain = complex(NAN, NAN)
    if frequency is not None:
        gain = response_paths.gain_at(values, response_paths.band(at_rest, plan.reference.accuracy), frequency)
    bandwidth, resonance, Q = (
        NAN if values[name] is None else values[name] for name in ("bandwidth", "resonance", "Q")
    )
    return abs(gain), math.degrees(cmath.phase(gain)), bandwidth * unit, resonance * unit, Q


def cycle(batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return gap at mid-stroke, % of full scale, area, mJ, and largest force, N, of the last loop."""
    D = np.array([NAN if p.design is None else p.design.D for p in batch.problems])[batch.problem]
    gap, area, largest = (
        np.array([answer.values.get(name, NAN) for answer in answers])[batch.problem]
        for name in ("gap_percent", "area_over_ED3", "largest_over_ED2")
    )
    return {
        "loop_gap_percent": gap,
        "loop_area_mJ": area * batch.E * D**3,
        "loop_largest_force_N": largest * batch.E * D**2,
    }
