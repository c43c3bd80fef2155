"""Cost and error of every model on designs over the whole range, and the rule of --tolerance that follows.

Twenty-four chosen designs span the range: the paper's, L/D from 0.6 to 6, magnets from none to the largest that
fits, nu from 0.45 to 0.4999, four laws; six of them lie inside the range of the formulas. The rule of
`studies.mechanics.model_choice` follows from them. Further designs, drawn at random in the same range, confirm the
rule. templates/trade.md.j2 describes the measurements, and how a bound follows from errors.

A state is a row of trade.csv: one state of a path by one model, with its true errors and those of its reference, and
CPU seconds and memory of the whole path. The answers are those of the one engine; what a path costs is measured by
itself, for finite elements in a process of its own.
"""

import contextlib
import json
import math
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from analytic import beam, buckling, hall
from fem.accuracy import LEVELS, Accuracy
from fem.scene import Model
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies.beam import surrogate_response
from studies.cases import FemModel
from studies.mechanics import model_choice
from studies.mechanics.model_choice import ANY_REGION, Choice, Statement
from studies.output import records
from studies.output.atomic_files import json_line, write_text
from studies.output.figures import picture
from studies.output.goals import Goal
from studies.output.provenance import made, versions
from studies.output.result import Result, Table
from studies.output.text_tables import cell as figure
from studies.simulation.compare import part
from studies.simulation.mesh_convergence import richardson
from studies.validation import pages
from studies.validation.bench import speed
from studies.validation.error_study_cases import Trial, answers_of, designs, loads_of
from studies.validation.pages import Row
from studies.web import verdict_figures

FILES = ("trade.csv", "trade.png", "TRADE.md", "model_choice.json", "confirm.csv")
Kind = Literal["press", "glued shear", "friction"]
PLAN: dict[Any, Any] = tomllib.loads(Path(__file__).with_name("trade_plan.toml").read_text("utf-8"))
CHOSEN: dict[str, Any] = PLAN.pop("designs")
KINDS: tuple[Kind, ...] = tuple(PLAN)
QUICK_KINDS = KINDS[:2]
"""Kinds of a quick study: a reference with friction takes a minute."""
SURROGATE, SHIPPED = "surrogate", "shipped"
"""Name of the surrogate among the models, and of its one level."""
CALCULATED = ("formula", SURROGATE)
"""Models without a mesh: they are evaluated in the study's own process, and count inside their ranges only."""
STUDIED, DRAWN, DRAWS = 24, 26, 3
"""Chosen designs; random designs of a draw, and draws, with L/D from 0.6 to 6, nu from 0.45 and walls of 0.06 D or
more. Of the first draw 20 and of the others 6 designs lie anywhere in the range, the rest inside that of the
formulas. The rule was corrected after each draw but the last."""
CONFIRMED = DRAWN * DRAWS
STEPS = (*beam.LEVELS, SHIPPED, *LEVELS)
MODELS = ("formula", SURROGATE, "axisymmetric", "harmonic", "half", "full")
READINGS = ["S1_mT", "S2_mT", "S3_mT"]
COMPONENTS = {
    "force": ["force_x_N", "force_y_N", "force_N"],
    "shift": ["shift_x_mm", "shift_y_mm", "shift_z_mm"],
    "tilt": ["tilt_rad"],
    "sideways": ["sideways_N"],
    "along": ["sideways_N"],
    "readings": READINGS,
}
"""Columns of the components of each quantity whose errors are measured. `sideways` is the force along the shear
alone, a part of `force`, relative to itself; `along` is the same force, relative to the larger one of itself and that
of the unpressed beam."""
QUANTITIES = tuple(COMPONENTS)
COUNTED = ("force", "shift", "tilt", "readings", "sideways")
"""Quantities that a tolerance bounds."""
TRUE = [f"{name}_error_percent" for name in QUANTITIES]
COLUMNS = list(dict.fromkeys(column for columns in COMPONENTS.values() for column in columns))
LEAST_ORDER = 0.8
"""Least observed order for an extrapolation: a lower one multiplies the last difference by more than three."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad, force in N or flux density in mT below which a relative error has no meaning."""
REPEATS = {"formula": 50, SURROGATE: 10}
"""Evaluations for the cost of one, which is too short to be measured."""
STATE = ["design", "kind", "depth_mm", "shear_mm"]
"""Columns that tell the states of a model apart."""
TOLERANCES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
SHARE, FACTOR = 0.95, 1.5
"""Goals of the confirmation: share of the cases within the tolerance, largest error over the tolerance."""
LAST = "last draw"
"""Name of the results of the random designs that were drawn after the last change of the rule."""
FEWEST = 4
"""Least number of designs from which a bound of a formula or of the surrogate follows."""


def run(progress: Progress, *, confirm: bool = False, quick: bool = False, command: str = "") -> Result:
    """Measure cost and true error of every model over the range of designs; the rule of --tolerance follows.

    The store keeps all answers, so that a run that was stopped continues there; the costs, up to half an hour, are
    measured again.

    Parameters
    ----------
    confirm
        Check the rule on 78 random designs; exit status 3 if a goal is missed.
    quick
        Use two designs, and the section models at accuracy quick in presses and glued shears only: seconds instead of
        an hour.
    """
    origin, count = made(command, versions()), 2 if quick else STUDIED
    first, second = (part(progress, *ends) or progress for ends in ((0.0, 0.5 if confirm else 1.0), (0.5, 1.0)))
    states = states_of(first, count, quick=quick)
    rule = statements(states)
    if not confirm:
        return result(states, rule, [], (), origin)
    random = states_of(second, count, quick=quick, confirm=True)
    results = list(confirmed(random, rule))
    states = pd.concat([states, random], ignore_index=True)
    return result(states, rule, results, QUICK_KINDS if quick else KINDS, origin)


# Designs, loads and runs


def runs_on(kind: Kind, model: Model, level: str, count: int) -> list[int]:
    chosen = [number for number in CHOSEN["order"] if number < count]
    counts = dict(zip(LEVELS, PLAN[kind]["runs"].get(model, [count] * len(LEVELS)), strict=True))
    return sorted(chosen[: counts[level]])


def trial(number: int, kind: Kind, model: Model, *, confirm: bool = False) -> Trial:
    design = designs("trade_random" if confirm else "trade")[number]
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    loads = loads_of(design, magnet, CHOSEN | PLAN[kind], number)
    return Trial(number, design, magnet, PLAN[kind]["scene"], model, tuple(loads))


class Run(NamedTuple):
    """One path of loads by one model: finite elements at an accuracy, a level of the formulas, or the surrogate."""

    kind: Kind
    trial: Trial
    model: str
    level: str
    accuracy: Accuracy | None = None
    """Of a reference; None for that of the level."""

    @property
    def model_of_cases(self) -> str | FemModel:
        if self.model in CALCULATED:
            return self.level if self.model == "formula" else SURROGATE
        return FemModel(self.level, self.accuracy or LEVELS[self.level], self.trial.model)


def plan(
    count: int = STUDIED, *, quick: bool = False, confirm: bool = False
) -> tuple[list[Run], dict[tuple[int, Kind], str]]:
    """Return all runs on the first `count` designs, and the fineness of the reference of each design and kind.

    If `quick`, these are presses and glued shears by the section models at level quick, with coarser references; to
    `confirm` the rule, all that it can choose for the random designs.
    """
    finenesses: dict[tuple[int, Kind], str] = {}
    runs: list[Run] = []
    for kind in QUICK_KINDS if quick else KINDS:
        section = PLAN[kind]["section"]
        levels = ("quick",) if quick else tuple(LEVELS)
        if confirm:
            chosen = PLAN[kind].get("confirming", range(CONFIRMED))[: 2 if quick else None]
            levels = levels[:2] if kind == "friction" else levels
            numbers = {(section, level): chosen for level in levels}
        else:
            models = (section,) if quick else PLAN[kind]["models"]
            numbers = {(m, level): runs_on(kind, m, level, count) for m in models for level in levels}
            chosen = runs_on(kind, section, "quick", count)
        calculated = [("formula", level) for level in beam.LEVELS]
        calculated += [] if kind == "friction" else [(SURROGATE, SHIPPED)]
        for (model, level), own in (dict.fromkeys(calculated, chosen) | numbers).items():
            name: Any = "auto" if model in CALCULATED else model
            runs += [Run(kind, trial(n, kind, name, confirm=confirm), model, level) for n in own]
        fine = runs_on(kind, section, "fine", count) if kind == "glued shear" and not confirm else []
        for n in chosen:
            L_over_D = 0.0 if confirm else designs("trade")[n].L / designs("trade")[n].D
            coarser = confirm or L_over_D > CHOSEN["slender"] or n >= CHOSEN["common"]
            usual = "finer" if n in fine else "coarser" if coarser else "usual"
            finenesses[n, kind] = "rough" if quick else usual
    return runs, finenesses


# States, references and costs


def states_of(progress: Progress, count: int, *, quick: bool, confirm: bool = False) -> pd.DataFrame:
    """Return all states with their errors, and with costs but for the random designs."""
    runs, finenesses = plan(count, quick=quick, confirm=confirm)
    truth = references(finenesses, confirm, part(progress, 0.0, 0.5, "references"))
    table = judged(runs, answers(runs, part(progress, 0.5, 0.8)), truth, confirm=confirm)
    costs: list[tuple[float, float]] = []
    for k, one in enumerate(runs):
        progress(0.8 + 0.2 * k / len(runs), f"cost of design {one.trial.number}, {one.kind}, {one.model} {one.level}")
        costs += [(math.nan, math.nan) if confirm else cost(one)] * len(one.trial.loads)
    table[["cpu_s", "peak_MB"]] = costs
    section = (table.model == table.kind.map(lambda kind: PLAN[kind]["section"])) & (table.level == "standard")
    unit = table.cpu_s.where(section).groupby([table.design, table.kind]).transform("first")
    return table.assign(cost=table.cpu_s / unit)


def answers(runs: Sequence[Run], progress: Progress | None = None, **options: Any) -> pd.DataFrame:
    """Return a row for each load of each run: its place, COLUMNS (NaN where there is none), status and message.

    A press has neither tilt nor a force along a shear, a design without a magnet no readings.
    """
    states = [(one, load) for one in runs for load in one.trial.loads]
    asked = [(one.trial.design, load, one.trial.magnet) for one, load in states]
    models, quantities = [one.model_of_cases for one, _ in states], ["force", "shift", "tilt", "readings"]
    found = answers_of(asked, models, quantities, progress, **options)
    columns = ["design", "kind", "model", "level", "depth_mm", "shear_mm", "friction"]
    runs_and_loads = [(one.trial.number, one.kind, one.model, one.level, load) for one, load in states]
    rows = [(*names, load.depth, load.shear_x, load.friction) for *names, load in runs_and_loads]
    place = pd.DataFrame(rows, columns=columns)
    table = pd.concat([place, found.reindex(columns=[*COLUMNS, "status", "message"])], axis=1)
    upright = table.shear_mm == 0
    # a press that may be unstable is the exact answer of a tip that is held on the axis
    table.loc[table.status.isin(("unstable", "unknown")) & upright, ["status", "message"]] = "ok", ""
    table.loc[upright, "tilt_rad"] = math.nan
    table.loc[[magnet == "ignored" for _, _, magnet in asked], READINGS] = math.nan
    return table.assign(sideways_N=found.force_x_N.where(~upright))


def references(finenesses: Mapping[tuple[int, Kind], str], confirm: bool, progress: Progress | None) -> pd.DataFrame:
    runs = []
    names = ("section_size", "section_patch", "harmonics", "friction_step_factor")
    for (number, kind), fineness in finenesses.items():
        own, begin = trial(number, kind, PLAN[kind]["section"], confirm=confirm), PLAN[kind]["begin"][fineness]
        for step in PLAN[kind]["steps"][begin : begin + 3]:
            mesh = replace(LEVELS["fine"], name=f"reference {step[0]:g}", **dict(zip(names, step, strict=True)))
            runs.append(Run(kind, own, "reference", mesh.name, mesh))
    found = answers(runs, progress)
    sizes = [one.accuracy.section_size for one in runs if one.accuracy for _ in one.trial.loads]
    truth = extrapolated(found.assign(size=sizes))
    at_rest = Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)
    designs = {one.trial.number: one.trial.design for one in runs if one.trial.magnet == "rigid"}
    rest = {number: 1e3 * np.array(hall.readings(one, at_rest).B_T) for number, one in designs.items()}
    return truth.join(full_scales(truth, rest))


def extrapolated(found: pd.DataFrame) -> pd.DataFrame:
    """Return the limits of COLUMNS in each state, with error bars (`NAME_bar`), from the answers of three meshes.

    `size` is the edge length of a mesh, in decreasing order. States that a mesh does not answer, or finds unstable,
    are left out.
    """
    rows: dict[Any, Row] = {}
    for place, own in found.groupby(STATE, sort=False):
        if (own.status == "ok").all():
            row = rows[place] = {}
            for name in own[COLUMNS].columns[np.isfinite(own[COLUMNS].astype(float)).all()]:
                values = own[name].tolist()
                limit, order = richardson((1 / own["size"]).tolist(), values)
                known = order >= LEAST_ORDER
                row[name] = limit if known else values[-1]
                row[f"{name}_bar"] = abs(limit - values[-1]) if known else max(values) - min(values)
    index = pd.MultiIndex.from_tuples(list(rows), names=STATE)
    return pd.DataFrame(list(rows.values()), index=index, columns=[*COLUMNS, *(f"{name}_bar" for name in COLUMNS)])


def full_scales(truth: pd.DataFrame, rest: Mapping[int, Array]) -> pd.DataFrame:
    """Return the full scale of each element in each state, `NAME_scale`, mT: its largest change from rest on a path.

    S2 and S3 share theirs; `rest` are the readings of the unloaded designs with a magnet by their numbers.
    """
    unloaded = np.array([rest.get(number, (math.nan,) * 3) for number in truth.index.get_level_values("design")])
    changes = (truth[READINGS] - unloaded.reshape(-1, 3)).abs().groupby(["design", "kind"]).transform("max")
    for name in READINGS[1:]:
        changes[name] = changes[READINGS[1:]].max(axis=1)
    return changes.add_suffix("_scale")


def true_errors(found: pd.DataFrame, truth: pd.DataFrame, unpressed_N: Array) -> pd.DataFrame:
    """Return the errors of answers against the references in the same rows, with the references' error bars, percent.

    They are relative to the quantity or, for readings, to the full scales of the elements; NaN where the reference is
    nearly 0. `unpressed_N` is the force along the same shear of the unpressed beam.
    """
    errors = {}
    for name, columns in COMPONENTS.items():
        true, bar = (truth[[f"{c}{end}" for c in columns]].to_numpy(dtype=float) for end in ("", "_bar"))
        off = found[columns].to_numpy(dtype=float) - true
        size, order = np.linalg.norm(true, axis=1), 2.0
        if name == "along":
            size = np.maximum(size, unpressed_N)
        elif name == "readings":
            scales = truth[[f"{column}_scale" for column in columns]].to_numpy(dtype=float)
            size, order = np.where(scales.min(axis=1) > NOTHING, 1.0, math.nan), math.inf
            off, bar = off / scales, bar / scales
        known = (size > NOTHING) & np.isfinite(off).all(axis=1)
        for kind, vectors in (("error", off), ("bar", bar)):
            lengths = 100 * np.linalg.norm(vectors, order, axis=1) / np.where(known, size, 1.0)
            errors[f"{name}_{kind}_percent"] = np.where(known, lengths, math.nan)
    return pd.DataFrame(errors, index=found.index)


def judged(runs: Sequence[Run], found: pd.DataFrame, truth: pd.DataFrame, *, confirm: bool) -> pd.DataFrame:
    """Return the states of runs with their errors.

    `message` is the reason why a formula is outside its range, or why a model has no answer.
    """
    states = [(one, load) for one in runs for load in one.trial.loads]
    answered, calculated = np.isfinite(found.force_N), found.model.isin(CALCULATED)
    found.loc[calculated, "status"] = np.where(answered[calculated], "ok", "refused")
    outside = [beam.outside(s.trial.design, load, s.level) if s.model == "formula" else "" for s, load in states]
    found["message"] = found.message.mask(calculated & answered, pd.Series(outside, found.index))
    true = truth.reindex(pd.MultiIndex.from_frame(found[STATE])).set_axis(found.index)
    lost = "no_reference", "a mesh of the reference has no stable answer"
    found.loc[(found.status == "ok") & true.force_N.isna(), ["status", "message"]] = lost
    unpressed = np.array([buckling.sideways_stiffness(one.trial.design) * load.shear for one, load in states])
    good = found.status == "ok"
    errors = true_errors(found, true, unpressed).where(good)
    place = found[["design", "kind", "model", "level", "depth_mm", "shear_mm", "friction", "status"]]
    place.insert(1, "confirming", confirm)
    return place.join(errors).assign(along_N=found.sideways_N.where(good), message=found.message)


def cost(one: Run) -> tuple[float, float]:
    """Return CPU seconds of a path, and its memory beyond that of the imported modules, MB; NaN if it fails.

    Formulas and the surrogate take too little memory to be measured. Their first evaluation, in which the surrogate
    is read and factorized, does not count, as imports do not.
    """
    if one.model not in CALCULATED:
        accuracy = {name: value for name, value in asdict(LEVELS[one.level]).items() if name != "name"}
        task: Row = {"task": "trace", "model": one.trial.model, "magnet": one.trial.magnet, "accuracy": accuracy}
        task |= {"loads": [asdict(load) for load in one.trial.loads], "design": asdict(one.trial.design)}
        found = speed.magtip(task)
        return found.get("cpu_s", math.nan), found.get("peak_MB", math.nan) - found.get("base_MB", math.nan)
    for count in (1, REPEATS[one.model]):
        begin = time.process_time()
        for _, load in product(range(count), one.trial.loads):
            with contextlib.suppress(BadInput):
                if one.model == SURROGATE:
                    surrogate_response.respond(one.trial.design, load, one.trial.magnet)
                else:
                    beam.solve(one.trial.design, load, one.level)
                    beam.outside(one.trial.design, load, one.level)
    return (time.process_time() - begin) / count, 0.0


# Tables and page


def result(
    states: pd.DataFrame, rule: Sequence[Statement], results: Sequence[Row], kinds: Sequence[Kind], origin: str
) -> Result:
    """Return the result of states and a rule; results and kinds to be confirmed are empty without confirmation."""
    table, confirmation, rows = cells(states), summary(results), pages.records(states)
    first = ("kind", "model", "level", "force_p95_percent", "shift_p95_percent", "cpu_s", "cost")
    shown = [Table(title="Cost and error", rows=table, first=first)]
    if kinds:
        shown.append(Table(title="Confirmation", rows=confirmation))
    text, ran = (
        as_text(rule, origin),
        {(cell["kind"], cell["model"], cell["level"]): cell["designs"] for cell in table},
    )
    judged = pd.DataFrame(results, columns=["kind", "design", "status", "error"])
    page = {
        "tables": {kind: [_errors(row) for row in table if row["kind"] == kind] for kind in KINDS},
        "ran": [
            {"kind": kind, "model": model} | {level: ran.get((kind, model, level), 0) for level in LEVELS}
            for kind in KINDS
            for model in PLAN[kind]["models"]
        ],
        "rule": [
            {name: getattr(each, name) for name in ("kind", "region", "model", "level", "designs", "states", "cost")}
            | {f"{name} %": None if (bound := getattr(each, name)) is None else 100 * bound for name in COUNTED}
            for each in rule
        ],
        "results": results,
        "summary": confirmation,
        "tolerances": ", ".join(f"{100 * each:g}" for each in TOLERANCES),
        "designs": judged.design.nunique(),
        "counts": {kind: judged.design[judged.kind == kind].nunique() for kind in KINDS},
        "share": f"{SHARE:.0%}",
        "factor": FACTOR,
        "worst": sorted((each for each in results if each["status"] == "exceeded"), key=lambda each: -each["error"]),
        "lost": pages.records(states[~states.status.isin(["ok", "refused"])]),
    }
    files = {"model_choice.json": lambda path: write_text(path, text)}
    files["trade.png"] = partial(picture, rows=rows, draw=verdict_figures.trade)
    tables = {"trade": rows} | ({"confirm": results} if results else {})
    more: Row = {"records": [*table, *(confirmation if kinds else [])], "shown": shown, "files": files}
    posed = goals(results, kinds) if kinds else None
    return pages.study("trade", "Cost and error", rows, page, goals=posed, tables=tables, **more)


def cells(states: pd.DataFrame) -> list[Row]:
    """Return a row for each kind, model and level that ran on the chosen designs: cost and errors of its states.

    Formulas and the surrogate count inside their ranges only; level paper states none. `solved` are the states with
    an answer and a reference, `unclear_percent` is the share of errors that are less than three bars of their
    reference. Errors are median, 95th percentile and, over all counted quantities, the largest.
    """
    frame = states[~states.confirming]
    order = {"kind": KINDS, "model": MODELS, "level": STEPS}
    frame = frame.assign(**{name: pd.Categorical(frame[name], values) for name, values in order.items()})
    rows = []
    for place, own in frame.groupby(list(order), observed=True, sort=True):
        row: Row = dict(zip(order, place, strict=True)) | {"designs": own.design.nunique(), "states": len(own)}
        inside = own[counting(own)]
        row["solved"] = len(inside)
        for name in QUANTITIES:
            errors = inside[f"{name}_error_percent"]
            row |= {f"{name}_median_percent": errors.median(), f"{name}_p95_percent": pages.percentile(errors, 95)}
        counted, bars = (
            inside[[f"{name}_{kind}_percent" for name in COUNTED]].to_numpy() for kind in ("error", "bar")
        )
        unclear = (3 * bars > counted)[np.isfinite(counted)]
        row["largest_percent"] = float(pd.Series(counted.ravel()).max())
        row["unclear_percent"] = 100 * float(unclear.mean()) if len(unclear) else math.nan
        # the surrogate refuses most paths outside its range as a whole, at no cost
        refused = (own.model == SURROGATE) & (own.status == "refused")
        answered = own if refused.all() else own[~refused]
        rows.append(row | {name: float(answered[name].median()) for name in ("cpu_s", "cost", "peak_MB")})
    return rows


def counting(states: pd.DataFrame) -> pd.Series:
    return ((states.model != "formula") | (states.message == "")) & states[TRUE].notna().any(axis=1)


def _errors(cell: Row) -> Row:
    row = {name: cell[name] for name in ("model", "level", "designs")}
    row["states"] = f"{cell['solved']} of {cell['states']}"
    for name in COUNTED:
        middle, high = cell[f"{name}_median_percent"], cell[f"{name}_p95_percent"]
        both = f"{figure(middle, 2)} / {figure(high, 2)}" if math.isfinite(middle) else ""
        row["readings % FS" if name == "readings" else f"{name} %"] = both
    row |= {"largest %": cell["largest_percent"], "unclear %": cell["unclear_percent"], "CPU s": cell["cpu_s"]}
    return row | {"cost": cell["cost"], "MB": None if cell["model"] in CALCULATED else round(cell["peak_MB"])}


# The rule


def statements(states: pd.DataFrame) -> list[Statement]:
    own = states[~states.confirming & counting(states)]
    regions = []
    for state in pages.records(own):
        one = trial(state["design"], state["kind"], "auto")
        name = model_choice.region(one.design, load_of(state), one.magnet, state["kind"]).name
        name = model_choice.formula_region(one.design, name) if state["model"] == "formula" else name
        regions.append(ANY_REGION if state["model"] in ("half", "full") else name)
    found = []
    names = ["kind", "region", "model", "level"]
    for values, group in own.assign(region=regions).groupby(names, sort=False):
        place: Row = dict(zip(names, values, strict=True))
        designs, cost = group.design.nunique(), group.cost.median()
        # a model of unknown cost is never the cheapest
        if (place["model"] in CALCULATED and designs < FEWEST) or math.isnan(cost):
            continue
        bounds: Row = {}
        for name in COUNTED:
            # an error counts at least as large as the bar of its reference
            of = "along" if name == "sideways" else name
            errors = group[[f"{of}_error_percent", f"{of}_bar_percent"]].max(axis=1) / 100
            largest = (1 + 1 / designs) * float(errors.max())
            bounds[name] = None if errors.isna().all() else model_choice.rounded_up(largest, 3)
        place |= {"designs": designs, "states": len(group), "cost": float(f"{cost:.3g}")}
        found.append(Statement(**place, **bounds))
    return found


def load_of(state: Row) -> Load:
    return Load(depth=state["depth_mm"], shear_x=state["shear_mm"], friction=state["friction"])


def as_text(rule: Sequence[Statement], origin: str) -> str:
    rows = ",\n".join(json_line(records.known(asdict(each))) for each in rule)
    made = f'"made": {json.dumps(origin)}, "versions": {json.dumps(model_choice.versions())}'
    return f'{{{made}, "statements": [\n{rows}\n]}}\n'


# Confirmation


def confirmed(states: pd.DataFrame, rule: Sequence[Statement]) -> Iterator[Row]:
    """Yield a row of confirm.csv for each tolerance, random design and load.

    `model` is the chosen model, empty if the rule refuses; `expected` its bound; `error` its largest true error of
    the counted quantities, a fraction, None if refused or without a reference.
    """
    names = ["kind", "design", "depth_mm", "shear_mm"]
    for place, group in states[states.confirming].groupby(names, sort=False):
        models = {(state["model"], state["level"]): state for state in pages.records(group)}
        for tolerance in TOLERANCES:
            row = dict(zip(names, place, strict=True)) | {"tolerance": tolerance}
            yield row | _confirmed(tolerance, models, rule)


def _confirmed(tolerance: float, models: Mapping[tuple[str, str], Row], rule: Sequence[Statement]) -> Row:
    """Return the result of a case: the model of the rule, or a finer one where its answer asks for it."""
    some = next(iter(models.values()))
    load = load_of(some)
    one = trial(some["design"], some["kind"], "auto", confirm=True)
    case = one.design, [load]
    try:
        choice: Choice | None = model_choice.choose(*case, tolerance, one.magnet, rule=rule)
    except BadInput:
        choice = None
    while choice is not None:
        state = models.get((choice.model, choice.level_or_accuracy))
        chosen: Row = {"model": choice.name, "status": "not run", "expected": choice.bound, "error": None}
        if state is None:
            return chosen
        errors = [state[f"{name}_error_percent"] for name in COUNTED]
        if np.isnan(errors).all():
            return chosen | {"status": state["status"]}
        if not model_choice.unmet(choice, one.design, load, state["along_N"]):
            error = float(np.nanmax(errors)) / 100
            return chosen | {"status": "within" if error <= tolerance else "exceeded", "error": error}
        choice = model_choice.finer(*case, choice, one.magnet, rule=rule)
    return {"model": "", "status": "refused", "expected": None, "error": None}


def summary(results: Sequence[Row]) -> list[Row]:
    """Return the results by kind and tolerance, by tolerance over all kinds, and those of the last draw alone.

    `refused` are cases for which the rule knows no model that meets the tolerance, `unjudged` those without a
    reference, or whose chosen model was not run; `worst` is the largest error over the tolerance.
    """
    if not results:
        return []
    frame = pd.DataFrame(results).astype({"error": float})
    parts = {kind: frame[frame.kind == kind] for kind in KINDS} | {"all": frame}
    parts[LAST] = frame[frame.design >= CONFIRMED - DRAWN]
    table = []
    for (kind, some), tolerance in product(parts.items(), TOLERANCES):
        own = some[some.tolerance == tolerance]
        judged, refused, within = own.error.count(), (own.status == "refused").sum(), (own.status == "within").sum()
        row: Row = {"kind": kind, "tolerance_percent": 100 * tolerance, "cases": len(own), "refused": int(refused)}
        row["unjudged"] = int(len(own) - judged - refused)
        for name, model in (("formulas", "formula"), (SURROGATE, SURROGATE)):
            row[name] = int(own.model.str.startswith(model).sum())
        row |= {"within": int(within), "share_percent": 100 * int(within) / int(judged) if judged else math.nan}
        table += [row | {"worst": float(own.error.max()) / tolerance}] if len(own) else []
    return table


def goals(results: Sequence[Row], kinds: Sequence[Kind] = KINDS) -> list[Goal]:
    """Return the goals of the confirmation: every case is judged, and within the tolerance.

    A kind that was to be confirmed and has no judged case misses its goals.
    """
    table = summary(results)
    posed = []
    for kind in (*kinds, "all", LAST):
        own = [row for row in table if row["kind"] == kind]
        unjudged, cases = (sum(row[name] for row in own) for name in ("unjudged", "cases"))
        posed.append(Goal(f"{kind}, cases without a judgement", unjudged, 0, cases))
        # a tolerance at which the rule refuses every case promises nothing
        known = [(row, row["cases"] - row["refused"] - row["unjudged"]) for row in own]
        known = [(row, judged) for row, judged in known if judged]
        if not known:
            posed.append(Goal(f"{kind}, cases within the tolerance", None, 100 * SHARE, 0, "%", at_least=True))
        for row, judged in known:
            where = f"{kind}, tolerance {row['tolerance_percent']:g} %"
            share = row["share_percent"]
            posed += [
                Goal(f"{where}, cases within it", share, 100 * SHARE, judged, "%", at_least=True),
                Goal(f"{where}, largest error over it", row["worst"], FACTOR, judged),
            ]
    return posed
