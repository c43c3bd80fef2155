"""The points of a front, solved by finite elements: what they say, beside the surrogate, and which points fail.

A point that misses a requirement by the numbers of the finite elements, or whose yield is too small, stays in the
table, with its reason, but is not ranked; one that another one dominates by these numbers is left out: it is nowhere
better, and somewhere worse by `RESOLUTION`, or by the largest half width of the finite elements (what their error
estimates change) where that is larger. The score of a point is the weighted mean of three numbers, 0 for the worst
and 1 for the best point that passes: of the logarithms of range, resolution and outer size. Scores share a rank that
differ by less than such steps of all three, so that no rank rests on less. A point of which it is unknown whether it
has the required yield comes after those that have it.

The responses of the beams (`SolvedBeams`) have the form of the surrogate's. The paths of all beams are solved side by
side by worker processes; their states land in the store, so that a command that was interrupted solves none of them
again. NaN stands for a state that a solve did not reach. The worst loads of the best point are solved by themselves:
their strain and distance from the rail are no interpolation. Resolutions are slopes of curves between the solved
states.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from analytic.hall import batch_readings
from analytic.parts import common_values
from fem.scene import Model
from geometry.arrays import Array, Ints
from geometry.design import Design
from geometry.loads import Load
from studies.beam import surrogate_range
from studies.beam.beam_curves import SOLVED_DEPTHS
from studies.cases import FiniteElements
from studies.mechanics.tasks import finished
from studies.output.records import FlatRow
from studies.parts.requirements import CRITERIA, MOST
from studies.quantities import UNITS
from studies.sensing.crosstalk import DECODERS
from studies.simulation.solved_beams import MOTIONS, SolvedBeams
from studies.sizing import beam_neighbours, front_yield
from studies.sizing.candidate_performance import LEAST, NO_SHEAR, Performance, margins, performance
from studies.sizing.candidate_variables import Candidates, Variant
from studies.sizing.front_yield import Shares
from studies.sizing.sensor_arrays import sensors_of
from studies.sizing.variant_search import RESOLUTION, dominated, objectives, spread

if TYPE_CHECKING:
    from studies.parts.requirements import Requirements

MOST_TRIED, FEW = 60, 100
"""Points of a front whose yield is estimated before they are solved, and made sensors of each: about 15 s."""
MOST_POINTS = 12
"""Points of a front that are solved: their finite elements take about two minutes on two cores."""
COMPARED = {
    "range_z": ("range_z", "N", 1.0),
    "range_x": ("range_x", "N", 1.0),
    "depth": ("depth", "over_D", 1.0),
    "resolution_z": ("resolution_z", "mN", 1e3),
    "resolution_x": ("resolution_x", "mN", 1e3),
    "strain": ("strain", "percent", 100.0),
    "critical": ("critical_depth", "over_D", 1.0),
    "first_mode": ("first_mode", "Hz", 1.0),
    "saturation": ("rail_distance", "percent", 100.0),
}
"""Quantities that both sources give: stem and unit of their columns, and this unit in that of `Performance`."""
ALIKE = {"outer_size": "outer_size_mm", "height": "height_mm", "wall": "wall_mm"}
"""Lengths, which do not depend on the source."""
NAMED = {
    CRITERIA[name].figure: CRITERIA[name]
    for name in ("largest_strain", "resolution_z", "resolution_x", "no_saturation")
}
"""Criteria whose worst loads are named, by their figures."""
ENDS_OF_RANGE = ("largest_strain", "stability_margin", "no_saturation")
"""Requirements that end the range."""
CORRECTED = 3
"""Solves of a worst load, each with depth and shear corrected by the forces of the one before."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """A point of the front; its number is from 1, in the order of the front.

    Attributes
    ----------
    predicted, solved : what it reaches by the surrogate and by finite elements, names as in `Performance`.
    margins : of the requirements, by finite elements; of the yield by the surrogate.
    worst : rows of the worst loads, see `_worst`.
    status, reason : "ok", or "failed" if a solve failed or a requirement is missed: which, by how much, and which of
        them ends the range at once.
    rank, score : 1 for the best, equal for equal scores, and 0 to 1; 0 and NaN for a point that failed.
    made : the yield, by the surrogate; None of a point that failed by its own figures.
    doubt : why it is unknown whether a requirement is met, "" if that is known.
    array : what `magtip array` says of it as a beam of the required array; empty for a single sensor.
    """

    number: int
    variant: Variant
    predicted: dict[str, float]
    solved: dict[str, float]
    margins: dict[str, float]
    worst: list[FlatRow]
    status: str
    reason: str
    rank: int = 0
    score: float = np.nan
    made: Shares | None = None
    doubt: str = ""
    array: FlatRow = field(default_factory=dict)

    def row(self) -> FlatRow:
        """Return the row of front.csv: each quantity by the surrogate and by FEM, and their difference."""
        row: FlatRow = {"rank": self.rank or None, "point": self.number, "status": self.status}
        row |= self.variant.row() | {column: self.solved[name] for name, column in ALIKE.items()}
        for name, (stem, unit, factor) in COMPARED.items():
            predicted, solved = factor * self.predicted[name], factor * self.solved[name]
            known = np.isfinite(solved) and np.isfinite(predicted) and solved != 0
            row |= {f"surrogate_{stem}_{unit}": predicted, f"fem_{stem}_{unit}": solved}
            row[f"{stem}_difference_percent"] = 100 * (predicted / solved - 1) if known else None
            row[f"surrogate_{stem}_half_width_{unit}"] = factor * self.predicted[f"{name}_half_width"]
        row |= {f"margin_{name}_percent": 100 * value for name, value in self.margins.items()}
        for each in self.worst:
            load = f"{each['force_z_N']:.4g} N with {each['force_x_N']:.4g} N at E = {each['E_MPa']:.4g} MPa"
            row[f"worst_load_of_{each['figure']}"] = load
        for name in ("polarity", *(f"{decoder}_percent" for decoder in DECODERS), "magnets_change_N"):
            row |= {f"array_{name}": self.array[name]} if self.array else {}
        made = self.made
        shares = [None] * 4 if made is None else [made.share, *made.interval, made.worst]
        for name, share in zip(("yield", "yield_low", "yield_high", "worst_batch"), shares, strict=True):
            row[f"{name}_percent"] = None if share is None else 100 * share
        return row | {"score": self.score, "reason": self.reason or self.doubt}


SECONDS = 2.5e-3
"""Time that the yield takes for each made sensor, s."""


def solved_front(
    candidates: Candidates,
    needed: Requirements,
    fem: FiniteElements,
    *,
    most: int = MOST_POINTS,
    sensors: int = front_yield.SENSORS,
) -> list[FrontPoint]:
    """Solve a front by finite elements, and return its points, those that pass first, in the order of their ranks.

    Parameters
    ----------
    most : number of points that are solved; `spread` chooses them, after the one with the best score.
    sensors : number of made sensors of the yield of each point that passes.
    """
    candidates = to_solve(candidates, needed, most)
    if not len(candidates):
        return []
    points, judge = (
        solved_points(candidates, needed, fem),
        functools.partial(with_yield, needed=needed, count=sensors),
    )
    rated = finished(points, judge, workers=fem.options.get("workers"), cost=lambda point: SECONDS * sensors)
    # a process that died says nothing of the yield
    judged = {each.task.number: each.answer or each.task for each in rated}
    return ranked([judged[point.number] for point in points], needed, fem)


def with_yield(point: FrontPoint, needed: Requirements, count: int) -> FrontPoint:
    """Return a point with its yield; one that failed stays as it is."""
    if point.status != "ok":
        return point
    intervals = needed.least_yield is not None
    made = front_yield.shares_of(point.variant, needed, count, needed.seed, intervals=intervals)
    return _judged(replace(point, made=made), needed)


def to_solve(candidates: Candidates, needed: Requirements, most: int) -> Candidates:
    """Return which candidates of a front finite elements solve, see `solved_front`.

    Under the loads of the search all meet the requirements. Where the surrogate has no answer to one of the loads
    between these, finite elements have to say whether it is met.
    """
    candidates = candidates.take([k for k in range(len(candidates)) if not isinstance(candidates.variant(k), str)])
    if not len(candidates):
        return candidates
    sensors = sensors_of(candidates)
    cautious, searched = (performance(sensors, sensors.beams(), needed, dense=dense) for dense in (True, False))
    # of a load without an answer no figure is known, and the force along the plate counts as not reached
    unknown = np.isnan(cautious.values["strain"])
    met = [(v >= 0) | unknown & ((v == LEAST) | (name == "force_x")) for name, v in cautious.margins.items()]
    passed = np.flatnonzero(np.all(met, axis=0))
    # if the surrogate confirms none at these loads, finite elements say why
    kept = passed if len(passed) else np.arange(len(candidates))
    values = {name: np.where(np.isnan(v), searched.values[name], v) for name, v in cautious.values.items()}
    kept = kept[_of_yield(candidates.take(kept), objectives(values, needed)[kept], needed)]
    F = objectives(values, needed)[kept]
    best = int(scores(F, RESOLUTION, needed)[0].argmax())
    chosen = (
        np.unique([best, *spread(F, max(most - 1, 1)).tolist()])[: max(most, 1)] if most > 1 else np.array([best])
    )
    return candidates.take(kept[chosen])


def _of_yield(candidates: Candidates, F: Array, needed: Requirements) -> Ints:
    """Return which candidates may have the required yield, by `FEW` made sensors of each; all if there are none."""
    every = np.arange(len(candidates))
    if needed.least_yield is None:
        return every
    tried = spread(F, MOST_TRIED)
    shares = [
        front_yield.shares_of(cast("Variant", candidates.variant(k)), needed, FEW, needed.seed, intervals=False)
        for k in tried.tolist()
    ]
    kept = tried[[made.interval[1] >= needed.least_yield for made in shares]]
    return kept if len(kept) else every


def solved_points(candidates: Candidates, needed: Requirements, fem: FiniteElements) -> list[FrontPoint]:
    """Solve candidates whose designs are possible by finite elements, and return them without ranks."""
    sensors = sensors_of(candidates)
    variants = [cast("Variant", candidates.variant(k)) for k in range(len(candidates))]
    beams = sensors.beams()
    predicted, cautious = (performance(sensors, beams, needed, caution=ca, dense=True) for ca in (0.0, 1.0))
    ask = np.fmax(cautious.ask, predicted.ask)
    ask[:, 1] = np.fmin(cautious.ask[:, 1], predicted.ask[:, 1])
    # where no press reaches the force, finite elements go as far as the surrogate does
    deepest = surrogate_range.deepest(*sensors.beam[:, :3].T)[:, None]
    shears = np.full((len(sensors), SOLVED_DEPTHS), NO_SHEAR)
    least = np.full_like(deepest, surrogate_range.SHALLOWEST_SHEAR)
    ask = np.where(np.isnan(ask), np.hstack([deepest, least, deepest, shears]), ask)
    solid = SolvedBeams([variant.design for variant in variants], fem)
    solved, worse = (performance(sensors, solid, needed, caution=ca, ask=ask, dense=True) for ca in (0.0, 1.0))
    points = []
    for k, variant in enumerate(variants):
        said, values = predicted.one(k), solved.one(k)
        # how far a press is stable is in the margin, also where the search for the critical depth has stopped
        known = [name for name in COMPARED if name != "critical" and not np.isnan(said[name])]
        lost = [name for name in known if np.isnan(values[name])]
        for middle, end in ((said, cautious), (values, worse)):
            middle |= {f"{name}_half_width": abs(float(end.values[name][k]) - middle[name]) for name in COMPARED}
        signed = {name: float(value[k]) for name, value in solved.margins.items()}
        reason = f"finite elements did not reach {', '.join(lost)}" if lost else ""
        point = FrontPoint(k + 1, variant, said, values, signed, _worst(solved, k, variant), "", reason)
        points.append(_judged(_in_array(point, needed), needed))
    return points


def _in_array(point: FrontPoint, needed: Requirements) -> FrontPoint:
    """Return a point with what `magtip array` says of it, where an array is required."""
    if needed.pitch is None:
        return point
    row, why = beam_neighbours.reason_of(point.variant.design, needed)
    values = point.solved | (beam_neighbours.figures_of(row) if row else {})
    own = _margins_of(values, needed)
    return replace(point, solved=values, margins=own, reason="; ".join(filter(None, [point.reason, why])), array=row)


def _margins_of(values: dict[str, float], needed: Requirements) -> dict[str, float]:
    signed = margins({name: np.array([value]) for name, value in values.items()}, needed)
    return {name: float(value[0]) for name, value in signed.items()}


def _judged(point: FrontPoint, needed: Requirements) -> FrontPoint:
    missed = {name: value for name, value in point.margins.items() if not value >= 0 and name != "least_yield"}
    reasons = [
        f"{n} is not known" if v == LEAST else f"{n} is missed by {-100 * v:.{'2g' if v > -0.99 else '0f'}} %"
        for n, v in missed.items()
    ]
    if point.solved["range_z"] == 0:
        ended = [name for name in ENDS_OF_RANGE if name in missed]
        named = f"{' and '.join(ended)} {'is' if len(ended) == 1 else 'are'} missed"
        why = named if ended else "no press is known to be stable as deep as theirs"
        alone = "the margin of force_z is that of the force alone"
        reasons.append(f"the range is 0 N, because {why} under the required loads: {alone}")
    least, doubt, signed = needed.least_yield, "", dict(point.margins)
    if least is not None and point.made is not None:
        (low, high), share = point.made.interval, point.made.share
        signed["least_yield"] = min(share / least - 1, MOST)
        found = f"{100 * share:.3g} % of made sensors ({100 * low:.3g} to {100 * high:.3g} %) meet all the others"
        if high < least:
            reasons.append(f"least_yield is missed: {found}")
        elif low < least:
            doubt = f"whether least_yield is met is unknown: {found}"
    reason = "; ".join(filter(None, [point.reason, *reasons]))
    return replace(point, status="failed" if reason else "ok", reason=reason, margins=signed, doubt=doubt)


def _worst(solved: Performance, k: int, variant: Variant) -> list[FlatRow]:
    rows: list[FlatRow] = []
    D, silicone, magnet = variant.design.D, variant.silicone, variant.magnet
    for name, criterion in NAMED.items():
        at = int(solved.worst[name][k])
        if at < 0 or not np.isfinite(solved.values[name][k]):
            continue
        z, x, angle = solved.loads[k, at].tolist()
        rows.append(
            {
                "figure": name,
                "value": criterion.factor * float(solved.values[name][k]),
                "unit": UNITS[criterion.unit],
                "E_MPa": (silicone.E_low, silicone.E_high)[solved.corner[at]],
                "remanence_T": magnet.remanence_high if name == "saturation" else magnet.remanence_low,
                "force_z_N": z,
                "force_x_N": x,
                # a strain is the same in all directions
                "direction_deg": 0.0 if name == "strain" else math.degrees(angle),
                "depth_mm": D * float(solved.depth[k, at]),
                "shear_mm": D * float(solved.shear[k, at]),
            }
        )
    return rows


def solve_line(row: FlatRow, accuracy: str, file: str = "winner.toml") -> str:
    """Return the command that solves a worst load."""
    words = [f"magtip solve {file} --set E={row['E_MPa']:g} --set remanence={row['remanence_T']:g}"]
    words.append(f"--depth {row['depth_mm']:.6g}")
    if row["shear_mm"]:
        angle = math.radians(row["direction_deg"])
        x, y = (round(row["shear_mm"] * part, 6) + 0.0 for part in (math.cos(angle), math.sin(angle)))
        words += [f"--shear {x:.6g}"] + ([f"--shear-y {y:.6g}"] if y else [])
    return " ".join([*words, f"--accuracy {accuracy}"])


def with_solved_loads(point: FrontPoint, needed: Requirements, fem: FiniteElements) -> FrontPoint:
    """Return a point whose worst loads are solved by themselves, and strain and distance from the rail by these."""
    rows = [dict(row) for row in point.worst]
    design = point.variant.design
    groups: list[tuple[Model, list[FlatRow]]] = [
        ("auto", [row for row in rows if not row["shear_mm"]]),
        ("harmonic", [row for row in rows if row["shear_mm"]]),
    ]
    for model, same in [group for group in groups if group[1]] * CORRECTED:
        cases = [
            (
                replace(design, E=row["E_MPa"]),
                Load(row["depth_mm"], row["shear_mm"], friction="stick" if row["shear_mm"] else "none"),
            )
            for row in same
        ]
        for row, answer in zip(same, fem.answers(cases, MOTIONS, model).to_dict("records"), strict=True):
            if answer["status"] != "ok" or np.isnan(answer["fem_force_N"]):
                kinds = {"unstable": "found unstable", "unknown": "do not know to be stable"}
                found = kinds.get(answer["status"], "did not reach")
                reason = f"finite elements {found} the load of the {row['figure']}: {answer['message']}"
                return replace(point, status="failed", reason=reason)
            row["strain_percent"] = float(answer["fem_largest_strain_percent"])
            row["solved_force_z_N"] = float(answer["fem_force_N"])
            row["solved_force_x_N"] = float(answer.get("fem_force_x_N", 0.0))
            row["solved_depth_mm"], row["solved_shear_mm"] = row["depth_mm"], row["shear_mm"]
            row["message"] = answer["message"]
            if row["figure"] == "saturation":
                row["value"] = 100 * _rail_distance(design, row, answer)
            # a press grows like the power 1.5 of its depth, a shear in proportion
            row["depth_mm"] *= (row["force_z_N"] / row["solved_force_z_N"]) ** (2 / 3)
            if row["shear_mm"]:
                row["shear_mm"] *= row["force_x_N"] / row["solved_force_x_N"]
    for row in rows:
        row["depth_mm"], row["shear_mm"] = row.pop("solved_depth_mm"), row.pop("solved_shear_mm")
        if row["figure"] == "strain":
            row["value"] = row["strain_percent"]
    # NaN is the largest
    strain = float(np.max([row["strain_percent"] for row in rows])) / 100
    rails = {row["figure"]: float(row["value"]) / 100 for row in rows if row["figure"] == "saturation"}
    values = point.solved | {"strain": strain} | rails
    return _judged(replace(point, solved=values, worst=rows, margins=_margins_of(values, needed)), needed)


def _rail_distance(design: Design, row: FlatRow, answer: FlatRow) -> float:
    """Return the least distance of an output from its rail in a solved state, over that in zero field."""
    way = math.radians(row["direction_deg"])
    e = np.array([math.cos(way), math.sin(way)])
    aside, sinking, tilt = (answer.get(f"fem_{name}", 0.0) for name in ("shift_x_mm", "shift_z_mm", "tilt_rad"))
    shift, turn = np.array([[*(aside * e), sinking]]), tilt * np.array([[-e[1], e[0]]])
    strong = replace(design, E=row["E_MPa"], remanence=row["remanence_T"])
    field = batch_readings([strong], np.zeros(1, dtype=np.int64), shift, turn).field_T[0]
    gain, null, low, high, *_ = common_values(strong)
    return float(np.minimum(1 - gain * field / (high - null), 1 + gain * field / (null - low)).min())


def scores(F: Array, resolution: Array | float, needed: Requirements) -> tuple[Array, float]:
    """Return the scores of points with objectives F, shape (n, 3), and the least difference of two that counts.

    resolution : of each objective; one that spreads by less says nothing, and all have its best.
    """
    width = np.ptp(F, axis=0)
    spreads = width > resolution
    width = np.where(spreads, width, 1.0)
    share = np.where(spreads, (F.max(axis=0) - F) / width, 1.0)
    weights = np.array([needed.weight_range, needed.weight_resolution, needed.weight_size])
    weights /= weights.sum()
    return np.asarray(share @ weights), float(np.where(spreads, resolution / width, 0.0) @ weights)


def solved_objectives(points: Sequence[FrontPoint], needed: Requirements) -> tuple[Array, Array]:
    """Return the objectives of points by finite elements, shape (n, 3), and the resolution of each of them.

    A half width as large as its value is that of a bound that is missed with it, and says nothing of the value. Where
    one is unknown, no difference in this objective counts.
    """
    values = {n: np.array([point.solved[n] for point in points]) for n in points[0].solved}
    F = objectives(values, needed)
    widths = {n: values.get(f"{n}_half_width", np.zeros(len(v))) for n, v in values.items()}
    moved = {n: v + np.where(widths[n] >= v, 0.0, widths[n]) for n, v in values.items()}
    # the objective of what is unknown is larger than any other
    return F, np.fmax(RESOLUTION, np.abs(objectives(moved, needed) - F).max(axis=0))


def ranked(points: Sequence[FrontPoint], needed: Requirements, fem: FiniteElements | None = None) -> list[FrontPoint]:
    """Return points with their ranks and scores, the best first, and then those that failed.

    Parameters
    ----------
    fem : solves the worst loads of the best point; if it fails by them, those of the next one.
    """
    passed = [point for point in points if point.status == "ok"]
    failed = [point for point in points if point.status != "ok"]
    while passed:
        F, resolution = solved_objectives(passed, needed)
        doubtful = np.array([bool(point.doubt) for point in passed])
        # what is unknown leaves out nothing that is known
        lost = np.where(doubtful, dominated(F, resolution), False)
        lost[~doubtful] = dominated(F[~doubtful], resolution)
        kept = np.flatnonzero(~lost)
        score, step = scores(F[kept], resolution, needed)
        order = np.lexsort((F[kept].sum(axis=1), -score, doubtful[kept])).tolist()
        front = [passed[kept[k]] for k in order]
        checked = front[0] if fem is None else with_solved_loads(front[0], needed, fem)
        if checked.status == "ok":
            later = doubtful[kept]
            rank = [
                1 + int(((score > score[k] + step + 1e-9) & (later == later[k]) | (later < later[k])).sum())
                for k in order
            ]
            scored = zip([checked, *front[1:]], rank, score[order].round(9).tolist(), strict=True)
            return [*(replace(p, rank=r, score=s) for p, r, s in scored), *failed]
        # what this point has dominated may be the best of those that are left
        passed.remove(front[0])
        failed.append(checked)
    return failed


def largest_differences(points: Sequence[FrontPoint]) -> list[FlatRow]:
    """Return for each quantity the median and the largest difference between surrogate and FEM, in percent of FEM.

    `of_one_source` counts the points to which only one of the two gives a number: where only finite elements find a
    critical depth, for instance, the surrogate says that the beam never gives way.
    """
    table: list[FlatRow] = []
    for name, (stem, unit, _) in COMPARED.items():
        pairs = np.array([(point.predicted[name], point.solved[name]) for point in points]).reshape(-1, 2)
        known = np.isfinite(pairs)
        alone = int((known[:, 0] != known[:, 1]).sum())
        pairs = pairs[known.all(axis=1) & (pairs[:, 1] != 0)]
        errors = 100 * np.abs(pairs[:, 0] / pairs[:, 1] - 1)
        row = {
            "quantity": f"{stem}_{unit}",
            "points": len(errors),
            "of_one_source": alone,
            "median_percent": float(np.median(errors)) if len(errors) else None,
            "largest_percent": float(errors.max()) if len(errors) else None,
        }
        table.append(row)
    return table
