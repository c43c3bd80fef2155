"""Samples of a study: Sobol points or a Latin hypercube in a box of axes, drawn by scipy.stats.qmc with a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from geometry.design import BadInput
from studies.inputs import study_axes
from studies.inputs.study_axes import Factor
from studies.inputs.user_input import check_keys, validated

METHODS = ("latin-hypercube", "sobol")
"""Methods of sampling."""
MOST_SAMPLES = 1_048_576
"""Largest number of sampled points."""


def sample(path: str, table: Mapping[str, Any]) -> Factor:
    """Return the points of a sample in a box, drawn by scipy.stats.qmc with a seed."""
    where = f"{path}: sample"
    kinds = {"method": str, "count": int, "seed": int, "ranges": dict[str, Any], "log": list[str]}
    check_keys(where, table, kinds)
    values = validated(where, table, kinds)
    method, count, seed = values.get("method", "sobol"), values.get("count", 0), values.get("seed", 0)
    if method not in METHODS:
        raise BadInput(f"{where}: method must be {' or '.join(METHODS)}; got {method!r}")
    if not 1 <= count <= MOST_SAMPLES:
        raise BadInput(f"{where}: count must be a whole number from 1 to {MOST_SAMPLES}; got {count}")
    if method == "sobol" and count & (count - 1):
        below = 1 << (count.bit_length() - 1)
        raise BadInput(f"{where}: Sobol points need a power of 2 as count; got {count}: take {below} or {2 * below}")
    if seed < 0:
        raise BadInput(f"{where}: seed must be 0 or more; got {seed}")
    low, high, log = _box(where, values.get("ranges", {}), values.get("log", []))
    from scipy.stats import qmc

    engine = qmc.Sobol if method == "sobol" else qmc.LatinHypercube
    unit = engine(len(low), rng=seed).random(count)
    columns = []
    for k, name in enumerate(low):
        a, b = low[name], high[name]
        if name in log:
            column = [a * (b / a) ** share for share in unit[:, k].tolist()]
        else:
            column = [a + (b - a) * share for share in unit[:, k].tolist()]
        columns.append(tuple(min(max(float(f"{value:.12g}"), a), b) for value in column))
    return Factor(tuple(low), tuple(columns), sampled=True)


def _box(
    where: str, ranges: Mapping[str, Any], log: Sequence[str]
) -> tuple[dict[str, float], dict[str, float], Sequence[str]]:
    """Return the lower and the upper bounds of a sample's axes, and the axes that are sampled on a log scale."""
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    for name, ends in ranges.items():
        study_axes.check_name(name)
        if not study_axes.AXES[name].is_number:
            raise BadInput(f"{where}: {name} has names, not numbers, so it cannot be sampled: make it an axis")
        if not isinstance(ends, list) or len(ends) != 2:
            raise BadInput(f"{where}: the range of {name} must be [low, high]; got {ends!r:.60}")
        first, last = study_axes.from_table(name, [ends[0]])[0], study_axes.from_table(name, [ends[1]])[0]
        if isinstance(first, str) or isinstance(last, str) or not first < last:
            raise BadInput(f"{where}: the range of {name} must be [low, high] with low < high; got {ends!r:.60}")
        low[name], high[name] = first, last
    if not low:
        raise BadInput(f"{where}: there are no ranges: add a table [sample.ranges] with NAME = [low, high]")
    for name in log:
        if name not in low:
            raise BadInput(f"{where}: log names {name!r}, which has no range: choose from {', '.join(low)}")
        if not low[name] > 0:
            raise BadInput(f"{where}: the range of {name} must begin above 0 for a log scale; got {low[name]:g}")
    return low, high, log
