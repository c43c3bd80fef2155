"""The study of `magtip sensitivity`: Sobol indices, Morris' effects, and made sensors, with its tables and its page.

Sobol indices come from a fast model, which answers thousands of points; Morris' effects from finite elements, whose
states are kept in the store like those of a sweep, so that an interrupted study continues; made sensors from a fast
model again.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array
from geometry.bad_input import nearest
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED
from geometry.messages import Progress
from studies import cases
from studies.inputs import study_input, user_input
from studies.inputs.option_groups import Sampling, Solves
from studies.output import page_templates
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Result, Table
from studies.output.text_tables import heading, titled
from studies.parts.part_tolerances import SPECS, Parts, Tolerances, sources_of, tolerances
from studies.quantities import shown
from studies.sensing.field_readings import columns as element_columns
from studies.sensitivity import beam_motions, global_sensitivity, made_sensors, uncertainty_figures
from studies.sensitivity.beam_motions import MODELS, Press, sampled_outputs
from studies.sensitivity.calibration import AxisSpread, percentile, refusals_of, spread_of
from studies.sensitivity.global_sensitivity import Ranges
from studies.sensitivity.made_sensors import MadeSensors

if TYPE_CHECKING:
    import pandas as pd

FILES = (
    "SENSITIVITY.md",
    *("sobol.csv", "sobol.png", "morris.csv", "morris_cases.csv", "morris.png"),
    *("montecarlo.csv", "percentiles.csv", "montecarlo.png"),
)
"""Files of the study; those of a method only if it was requested."""
OF_A_TOLERANCE = ("E", "nu", "remanence", "magnet_diameter", "magnet_height")
"""Fields of a design that `Tolerances` has under the same name: the inputs that vary by default."""
SHARES = (0.05, 0.5, 0.95)
"""Percentiles of the spread of a calibration."""
MOST_NAMED = 3
"""Greatest number of reasons of failures that a sentence names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A sensitivity study that is ready to run: what a method would refuse is refused before another one computes.

    The model of sobol and montecarlo answers failed cases of morris, too; `solves` are those of morris.
    """

    design: Design
    ranges: Ranges
    load: Press
    methods: Sequence[str] = ("sobol", "montecarlo")
    tolerances: Tolerances = dataclasses.field(default_factory=tolerances)
    parts: Parts | None = None
    sampling: Sampling = dataclasses.field(default_factory=Sampling)
    solves: Solves = dataclasses.field(default_factory=Solves)

    def __post_init__(self) -> None:
        sampling = self.sampling
        for name in self.methods:
            if name not in METHODS:
                raise BadInput(f"--methods: there is no method {name!r}: {nearest(name, METHODS)}")
        if sampling.model not in MODELS:
            raise BadInput(f"--model: there is no model {sampling.model!r}: {nearest(sampling.model, MODELS)}")
        if not sampling.seed >= 0:
            raise BadInput(f"--seed must be 0 or more; got {sampling.seed}")
        if tuple(self.methods) != ("montecarlo",):
            if not self.ranges:
                raise BadInput("no input varies: add --vary NAME=low:high")
            for name in self.ranges:
                if name not in study_input.DESIGN and name not in ("depth", "shear"):
                    raise BadInput(
                        f"--vary {name}: only fields of the design, depth and shear can vary: leave it out"
                    )
            if "shear" in self.ranges and self.load.shear:
                raise BadInput("shear is given twice, by --shear and by --vary: leave one of them out")
        if "sobol" in self.methods:
            global_sensitivity.check_count(self.ranges, sampling.count)
        if "morris" in self.methods:
            global_sensitivity.check_trajectories(self.ranges, sampling.trajectories)
        if "montecarlo" in self.methods:
            made_sensors.check_draw(self.design, sampling.sensors, sampling.seed)

    @property
    def sheared(self) -> bool:
        """Whether the load has a shear."""
        return bool(self.load.shear) or "shear" in self.ranges

    def answered(self, points: Array) -> tuple[dict[str, tuple[Array, Array]], tuple[str, ...]]:
        """Return the outputs of the fast model at points of the inputs, see `sampled_outputs`."""
        return sampled_outputs(self.sampling.model, self.design, self.ranges, points, self.load, sheared=self.sheared)


def ranges_of(design: Design, vary: Sequence[str], methods: Sequence[str], sizes: Tolerances) -> Ranges:
    """Return the ranges in texts NAME=low:high; without any, those of the tolerances that are above 0.

    >>> from geometry.design import paper
    >>> ranges_of(paper(), ["E=0.6:1", "depth=0.5:1.5"], ["sobol"], tolerances())
    {'E': (0.6, 1.0), 'depth': (0.5, 1.5)}
    """
    ranges = {}
    for name in OF_A_TOLERANCE if not vary else ():
        value, size = getattr(design, name), sizes[name]
        spread = size * value / 100 if name in ("E", "remanence") else size
        if spread:
            ranges[name] = (value - spread, min(value + spread, study_input.DESIGN[name].high))
    if vary and tuple(methods) == ("montecarlo",):
        raise BadInput("--vary works with the methods sobol and morris: add one to --methods, or use --tolerance")
    for name, text in user_input.pairs("--vary", vary, "E=0.6:1").items():
        study_input.check_name(name)
        if not study_input.AXES[name].is_number:
            raise BadInput(f"--vary {name}: its values are names, not numbers, so it has no range: leave it out")
        if name == "hall_average":
            raise BadInput("--vary hall_average: it is a whole number of samples, so it has no range: leave it out")
        parts = text.split(":")
        if len(parts) != 2:
            raise BadInput(f"--vary {name} takes low:high, such as {name}=1:2; got {text!r}")
        low, high = (study_input.parse(name, part.strip())[0] for part in parts)
        if isinstance(low, str) or isinstance(high, str) or not low < high:
            raise BadInput(f"--vary {name} takes low:high with low < high; got {text!r}")
        ranges[name] = (low, high)
    return ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a method has found.

    Attributes
    ----------
    rows, each : of its table; and the cases of morris as a sweep has them, or the made sensors.
    count, reasons : number of points, cases or sensors, and why how many of them have failed.
    doubt : what to beware of, in a sentence; "" if there is nothing.
    replaced : number of failed cases that the fast model replaces in the estimates of morris.
    axes : calibrations of the made sensors by the axis.
    """

    rows: list[FlatRow]
    each: list[FlatRow] = dataclasses.field(default_factory=list)
    count: int
    reasons: Mapping[str, int]
    doubt: str = ""
    replaced: int = 0
    axes: Mapping[str, AxisSpread] = dataclasses.field(default_factory=dict)

    @property
    def failures(self) -> str:
        """How many have failed and why, "" if none has.

        >>> Found(rows=[], count=100, reasons={"a": 2, "b": 1}).failures
        '3 of 100 have failed (3 %), 2 because a, 1 because b'
        """
        failed, named = sum(self.reasons.values()), list(self.reasons.items())[:MOST_NAMED]
        rest = failed - sum(number for _, number in named)
        texts = [f"{number} because {text}" for text, number in named] + [f"{rest} for other reasons"] * (rest > 0)
        share = f"{failed} of {self.count} have failed ({shown(failed / self.count, 'percent')}), {', '.join(texts)}"
        return share if failed else ""


def sobol(request: Request) -> Found:
    """Return the Sobol indices of all outputs for the ranges of the inputs."""
    design, ranges, seed = request.design, request.ranges, request.sampling.seed
    points = global_sensitivity.saltelli_points(ranges, request.sampling.count, seed)
    outputs, refusals = request.answered(points)
    lengths = beam_motions.error_lengths(request.sampling.model, design)
    rows, doubtful = [], []
    for name, (values, half_width) in outputs.items():
        # what is rounding only is no share
        known, stated = np.isfinite(values), np.isfinite(half_width).any()
        table = (
            global_sensitivity.indices(ranges, values, half_width if stated else None, seed, lengths).round(9) + 0.0
        )
        mean, deviation = (float(values[known].mean()), float(values[known].std())) if known.any() else (None, None)
        # how much of the variation is error
        error = float(np.median(half_width[known])) / deviation if deviation and stated else None
        doubtful += [titled(name)] if error is not None and error > 1 else []
        last: FlatRow = {"mean": mean, "standard_deviation": deviation, "model_error_over_deviation": error}
        last |= {"model": request.sampling.model}
        rows += _rows("sobol", ranges, name, table, values, last)
    doubt = (
        f"do not read the indices of {', '.join(doubtful)}: the model's error exceeds the variation of the output, "
        "so that their intervals reach from 0 to 1; vary the inputs in wider ranges, or use --methods morris"
    )
    return Found(rows=rows, count=len(points), reasons=failure_reasons(refusals), doubt=doubt if doubtful else "")


def morris(request: Request, progress: Progress | None = None) -> Found:
    """Return Morris' effects on all outputs of finite elements; the fast model stands in for failed cases."""
    import pandas as pd

    design, ranges, load = request.design, request.ranges, request.load
    points = global_sensitivity.trajectories(ranges, request.sampling.trajectories, request.sampling.seed)
    fixed = {name: getattr(load, name) for name in ("depth", "shear") if name not in ranges and getattr(load, name)}
    inputs = pd.DataFrame(points, columns=[study_input.column(name) for name in ranges])
    read, tilt = design.shape.has_magnet, request.sheared
    table = cases.answer(
        inputs.assign(**{study_input.column(name): value for name, value in fixed.items()}),
        [f"fem:{request.sampling.accuracy}"],
        base=design,
        quantities=["force", "shift", "contact_radius", *["readings"] * read, *["tilt"] * tilt],
        store=request.solves.store,
        workers=request.solves.workers,
        scheduler=request.solves.scheduler,
        progress=progress,
    )
    ok = table["status"].isin(ANSWERED)
    lost = ~ok.to_numpy()
    stand_ins = request.answered(points[lost])[0] if lost.any() else {}
    rows = []
    for name in beam_motions.names(design, sheared=request.sheared):
        values = np.where(ok, table[f"fem_{name}"].astype(float), np.nan)
        substitute = np.full(len(points), np.nan)
        substitute[lost] = stand_ins[name][0] if stand_ins else np.nan
        effects = global_sensitivity.effects(ranges, points, values, substitute, request.sampling.seed)
        effects["effect_unit"] = f"{heading(name)[1] or name.rpartition('_')[2]} per full range"
        rows += _rows("morris", ranges, name, effects, values, {"model": f"fem {request.sampling.accuracy}"})
    failed, unstable = table[~ok], table["message"][table["status"] == "unstable"]
    doubt = f"{len(unstable)} of {len(table)} states are unstable, the first one because {next(iter(unstable), '')}"
    return Found(
        rows=rows,
        each=table.to_dict("records"),
        count=len(table),
        reasons=failure_reasons((failed["status"] + ": " + failed["message"]).tolist()),
        doubt=doubt if len(unstable) else "",
        replaced=int(np.isfinite(stand_ins["force_N"][0]).sum()) if stand_ins else 0,
    )


def _rows(
    method: str, ranges: Ranges, output: str, table: pd.DataFrame, values: Array, last: FlatRow
) -> list[FlatRow]:
    failed = int((~np.isfinite(values)).sum())
    count = {"points": len(values), "failed": failed, "failed_percent": 100 * failed / len(values)}
    return [
        {"method": method, "output": output, "input": name, "low": low, "high": high}
        | {"unit": study_input.AXES[name].unit}
        | _known(numbers)
        | count
        | last
        for (name, (low, high)), numbers in zip(ranges.items(), table.to_dict("records"), strict=True)
    ]


def _known(row: Mapping[Any, Any]) -> FlatRow:
    return {k: None if isinstance(value, float) and not math.isfinite(value) else value for k, value in row.items()}


def monte_carlo(request: Request) -> Found:
    """Return the spread of the calibrations of made sensors."""
    sampling = request.sampling
    sensors = made_sensors.made_sensors(request.design, request.tolerances, sampling.sensors, sampling.seed)
    axes = spread_of(sensors, request.load, sampling.model)
    unit = "V" if element_columns(request.design)[1] == "V" else "T"
    rows = []
    for name, axis in axes.items():
        last = {
            "sensors": len(axis.refusals),
            "failed": sum(map(bool, axis.refusals)),
            "model": sampling.model,
        }
        last |= {"model_error_percent": 100 * axis.model_error, "message": axis.message}
        for quantity, share in itertools.product(axis.made, SHARES):
            row = {
                "method": "montecarlo",
                "axis": name,
                "quantity": quantity,
                "unit": {"sensitivity": f"{unit}/N", "offset": unit}.get(quantity, "N"),
                "nominal": axis.nominal[quantity],
                "percentile": 100 * share,
                **dict(zip(("value", "low", "high"), percentile(axis.made[quantity], share), strict=True)),
            }
            rows.append(_known(row | last))
    refusals = refusals_of(axes)
    each = sensor_rows(sensors, axes, refusals, unit)
    return Found(rows=rows, each=each, count=len(each), reasons=failure_reasons(refusals), axes=axes)


def sensor_rows(
    made: MadeSensors, axes: Mapping[str, AxisSpread], refusals: Sequence[str], unit: str
) -> list[FlatRow]:
    """Return a row for each made sensor: its values, and its calibration along each axis."""
    import pandas as pd

    columns: dict[str, Any] = {
        "sensor": range(1, len(made) + 1),
        "status": ["failed" if reason else "ok" for reason in refusals],
        **{study_input.column(name): made.fields[name] for name in OF_A_TOLERANCE},
        **{f"magnet_offset_{way}_mm": made.magnet_offset[:, k] for k, way in enumerate("xyz")},
        "magnet_tilt_rad": made.magnet_tilt[:, 1],
        "magnet_tilt_y_rad": -made.magnet_tilt[:, 0],
    }
    for k in range(made.gain_factor.shape[1]):
        columns |= {f"element{k + 1}_offset_{way}_mm": made.element_offset[:, k, j] for j, way in enumerate("xyz")}
        columns[f"element{k + 1}_gain_factor"] = made.gain_factor[:, k]
        columns[f"element{k + 1}_null_shift_{unit}"] = made.null_shift[:, k]
    unit_of = {"sensitivity": f"{unit}_per_N", "offset": unit}
    for name, axis in axes.items():
        columns |= {f"{name}_{quantity}_{unit_of.get(quantity, 'N')}": v for quantity, v in axis.made.items()}
    rows: list[FlatRow] = pd.DataFrame(columns | {"message": refusals}).to_dict("records")
    return rows


def failure_reasons(refusals: Sequence[str]) -> dict[str, int]:
    """Return how many have failed for each reason, the most frequent first; "" is no failure.

    Reasons that differ in their numbers only are one, and the first of them is named.

    >>> failure_reasons(["", "rail", "1 mm deep", "rail", "2.5e-3 mm deep", "rail"])
    {'rail': 3, '1 mm deep': 2}
    """
    groups: dict[str, list[str]] = {}
    for reason in filter(None, refusals):
        groups.setdefault(re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "#", reason), []).append(reason)
    return {group[0]: len(group) for group in sorted(groups.values(), key=len, reverse=True)}


OF_ROWS = ("method", "low", "high", "unit", "points", "failed", "failed_percent", "model")
METHODS: dict[str, Table] = {
    "sobol": Table(
        title="Sobol indices",
        rows=(),
        brief=(*OF_ROWS, "mean"),
        first=("output", "input", "first_order", "total_order"),
    ),
    "morris": Table(
        title="Morris' effects",
        rows=(),
        brief=(*OF_ROWS, "sigma_low", "sigma_high"),
        first=("output", "input", "mu_star", "sigma", "effect_unit"),
    ),
    "montecarlo": Table(
        title="Calibration of made sensors",
        rows=(),
        brief=("method", "sensors", "failed", "model", "model_error_percent", "message"),
        first=("axis", "quantity", "unit", "percentile", "value"),
    ),
}
"""The table of each method on a terminal, without its rows."""


FAST = {"sobol": sobol, "montecarlo": monte_carlo}


def run(request: Request, progress: Progress) -> Result:
    """Return tables, pictures and page of all methods; the study has failed if every case of a method has failed."""
    found: dict[str, Found] = {}
    # first the method that may refuse the load, last the one whose solves take long
    for name, text in (("montecarlo", "made sensors"), ("sobol", "Sobol indices"), ("morris", "Morris' effects")):
        if name in request.methods:
            progress(0.0, text)
            found[name] = morris(request, progress) if name == "morris" else FAST[name](request)
    found = {name: found[name] for name in METHODS if name in found}
    shown = [dataclasses.replace(METHODS[name], rows=each.rows) for name, each in found.items()]
    said = [text for each in found.values() if (text := "; ".join(filter(None, (each.failures, each.doubt))))]
    lost = any(sum(each.reasons.values()) >= each.count for each in found.values())
    rows = {"percentiles" if name == "montecarlo" else name: each.rows for name, each in found.items()}
    cases_of = {"morris": "morris_cases", "montecarlo": "montecarlo"}
    figures = uncertainty_figures
    draw = {"sobol": figures.sobol, "morris": figures.morris, "montecarlo": figures.made_sensors}
    return Result(
        title="Sensitivity",
        records=[row for table in shown for row in table.rows],
        shown=shown,
        tables=rows | {file: found[name].each for name, file in cases_of.items() if name in found},
        files={
            f"{name}.png": partial(picture, rows=each.each if name == "montecarlo" else each.rows, draw=draw[name])
            for name, each in found.items()
        },
        pages={"SENSITIVITY.md": page(request, found)},
        packages=("SALib",),
        remarks=[] if lost else [*said, *findings(found)],
        failures=said if lost else [],
    )


def findings(found: Mapping[str, Found]) -> list[str]:
    """Return a sentence of each method: which input matters most for which output, or how much made sensors err."""
    said = []
    for method, measure, name in (("sobol", "total_order", "Sobol"), ("morris", "mu_star", "Morris")):
        rows = found[method].rows if method in found else []
        if clauses := _clauses(rows, measure):
            said.append(f"{name}: {'; '.join(clauses)}")
    worst = [
        f"{row['value']:.2g} N along {row['axis']} ({row['low']:.2g} to {row['high']:.2g} N)"
        for row in (found["montecarlo"].rows if "montecarlo" in found else ())
        if row["quantity"] == "zeroed_force_error" and row["percentile"] == 95 and None not in _interval(row, "")
    ]
    if worst:
        said.append(f"made sensors: after zeroing 95 % of them err by at most {', '.join(worst)}")
    return said


def _clauses(rows: Sequence[FlatRow], measure: str) -> list[str]:
    """Return which input matters most for which outputs, unknown where its interval overlaps that of another one."""
    most: dict[str, list[str]] = {}
    unknown, idle = [], []
    for output, group in itertools.groupby(rows, lambda row: row["output"]):
        known = [row for row in group if None not in _interval(row, measure)]
        ranked = sorted(known, key=lambda row: -row[measure])
        name = heading(output)[0]
        if not ranked:
            unknown.append(f"{name} (no result)")
        elif not ranked[0][f"{measure}_high"] > 0:
            idle.append(name)
        elif near := [row for row in ranked[1:] if row[f"{measure}_high"] >= ranked[0][f"{measure}_low"]]:
            alike = [f"{row['input']} {_size(row, measure)}" for row in (ranked[0], *near)]
            texts = ", ".join(alike) if len(alike) <= MOST_NAMED else f"{len(alike)} inputs"
            unknown.append(f"{name} (the intervals of {texts} overlap)")
        else:
            most.setdefault(ranked[0]["input"], []).append(f"{name} {_size(ranked[0], measure)}")
    said = [f"{name} matters most for {', '.join(outputs)}" for name, outputs in most.items()]
    said += [f"no input changes {', '.join(idle)}"] if idle else []
    return said + ([f"unknown what matters most for {', '.join(unknown)}"] if unknown else [])


def _interval(row: FlatRow, measure: str) -> tuple[float | None, ...]:
    names = (measure, f"{measure}_low", f"{measure}_high") if measure else ("value", "low", "high")
    return tuple(row[name] for name in names)


def _size(row: FlatRow, measure: str) -> str:
    """Return a share of the variance, %, or an effect over the full range of the input, with its interval."""
    value, low, high = (float(row[name]) for name in (measure, f"{measure}_low", f"{measure}_high"))
    if measure == "total_order":
        # a share lies within 0 and 1, its interval by sampling may not
        return f"{100 * value:.0f} % [{100 * max(low, 0.0):.0f} to {100 * min(high, 1.0):.0f} %]"
    unit = row["effect_unit"].removesuffix(" per full range")
    return f"{value:.2g} {unit} [{low:.2g} to {high:.2g}]"


def page(request: Request, found: Mapping[str, Found]) -> str:
    """Return the text of SENSITIVITY.md without its origin."""
    return page_templates.rendered(
        Path(__file__).with_name("SENSITIVITY.md.j2"),
        load=request.load,
        tolerances=_effective_tolerances(request) if "montecarlo" in found else (),
        titled=titled,
        findings=findings(found),
        **{name: found.get(name) for name in METHODS},
    )


def _effective_tolerances(request: Request) -> list[FlatRow]:
    unused = "hall" if request.design.hall_layout != "three" else "chip"
    units, rows, read = {"1": "", "percent": "%"}, [], sources_of(request.design, request.parts)
    for name, spec in SPECS.items():
        if name in (f"{unused}_gain", f"{unused}_null"):
            continue
        assumed = "assumed: " if spec["assumed"] else ""
        usual, source = read.get(name, (float(spec["default"]), f"{assumed}{spec['source']}"))
        value = request.tolerances[name]
        rows.append({
            "value": spec["meaning"],
            "tolerance": f"± {value:g} {units.get(spec['unit'], spec['unit'])}".rstrip(),
            "distribution": spec["shape"],
            "source": source if value == usual else "set by the user",
        })  # fmt: skip
    return rows
