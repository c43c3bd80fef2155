"""Yield of a variant: the share of made sensors that meet all requirements, and which requirement fails most.

A maker's silicone and magnets are those of a batch, which lies anywhere within the ranges of the catalogue (E, nu,
remanence); its sensors differ by the scatter of parts, places and gains. So there is a yield over batches, and one of
the worst batch, among which are the ends of the ranges of E and remanence. No sensor lies beyond a range. Sensors of
one batch are alike, and say less than as many independent ones: each sensor of the yield over batches is of a batch
of its own, so that its interval is that of a share of independent draws. Further sensors of some batches give the
worst one.

Requirements hold for a sensor that is calibrated by itself: its deviations change what it can reach, and are no
errors of its forces. `calibrations` says how many also read the force without, or with part of a calibration.

Mechanics come from the surrogate: `worse` and `better` are the shares at the ends of its 90 % intervals, and `check`
holds drawn sensors against finite elements. The sampling error (`low` to `high`, 95 %) only says that the number of
sensors is finite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load
from studies.calibration import calibrated_forces, press_plan
from studies.calibration.sensor_fit import Fit
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.parts.part_tolerances import Parts, tolerances_of, values_at
from studies.parts.requirements import CRITERIA
from studies.sensitivity.beam_motions import SURROGATE, Press, motions
from studies.sensitivity.calibration import spread_of
from studies.sensitivity.made_sensors import (
    MadeSensors,
    batch_middles,
    batches_at,
    made_sensors,
    share_with_error,
)
from studies.sizing.candidate_performance import performance
from studies.sizing.sensor_arrays import Sensors, made_sensors_of, sensors_of_variant

if TYPE_CHECKING:
    import pandas as pd

    from studies.parts.requirements import Requirements
    from studies.sizing.candidate_variables import Variant

SENSORS = 1000
"""Number of made sensors, each of a batch of its own."""
BATCHES = 25
"""Number of batches of which further sensors are made, and as many of each of four more at the ends of the ranges."""
ENDS = ((0, 0.5, 0), (0, 0.5, 1), (1, 0.5, 0), (1, 0.5, 1))
"""Ends of the ranges of E and remanence, with the middle of that of nu, as shares of where batches lie."""
ALLOWED = 0.05
"""Largest force error over the required range with which a sensor counts as calibrated."""
CALIBRATIONS = {
    "none": "force_error",
    "offset": "zeroed_force_error",
    "offset and gain": "recalibrated_force_error",
    "twelve presses": "presses",
    "full": "",
}
"""Calibrations of each sensor by itself, and the force errors that remain; a full one leaves none but the noise."""
CHECKED = 30
"""Number of drawn sensors that finite elements solve."""
ALL = "all"
"""Stands for all requirements together."""
IMPOSSIBLE = "possible"
"""Stands for the requirement that a made sensor is possible, and within the range of the surrogate."""


@dataclass(frozen=True, slots=True)
class Yield:
    """Yield of a variant.

    Attributes
    ----------
    table : a row for all requirements and for each: yield.csv.
    batches : a row for each batch of several sensors: the middle of its ranges, sensors within all requirements,
        whether at the ends.
    calibrations : a row for each of `CALIBRATIONS`: shares of sensors within all requirements whose force errors are
        below `ALLOWED`; empty where the design itself reaches no such force by the surrogate.
    check : drawn sensors by finite elements and by the surrogate; empty if none was solved.
    """

    table: pd.DataFrame
    batches: pd.DataFrame
    calibrations: pd.DataFrame
    check: pd.DataFrame

    @property
    def share(self) -> float:
        """Share of the sensors that meet all requirements, over batches, 0 to 1."""
        return float(self.table["within_percent"].iloc[0]) / 100

    def rows(self) -> list[FlatRow]:
        return _records(self.table)

    def record(self) -> dict[str, list[FlatRow]]:
        """Return the tables by their keys in sizing.json."""
        tables = {"batches": self.batches, "calibrations": self.calibrations, "check": self.check}
        return {"yield": self.rows()} | {f"yield_{name}": _records(table) for name, table in tables.items()}

    @property
    def sentence(self) -> str:
        """Yield over batches, of the worst batch, sampling error, and the ends of the surrogate's intervals."""
        (text,) = page_templates.sentences(_TEMPLATE, "sentence", **self._words())
        return text

    def text(self) -> str:
        """Return the section of SIZING.md."""
        return page_templates.rendered(_TEMPLATE, made=self, rows=self.rows(), allowed=ALLOWED, **self._words())

    def _words(self) -> dict[str, Any]:
        worst = self.batches.loc[self.batches["within_percent"].idxmin()]
        first = self.table.iloc[1] if len(self.table) > 1 else None
        return {"all": self.table.iloc[0], "worst": worst, "first": first}


_TEMPLATE = Path(__file__).with_name("YIELD.md.j2")


def _records(table: pd.DataFrame) -> list[FlatRow]:
    rows: list[FlatRow] = table.astype(object).where(table.notna(), None).to_dict("records")
    return rows


def parts_of_variant(variant: Variant, process: str | None = None) -> Parts:
    """Return the parts of a variant, and the process that prints its base."""
    return Parts(variant.silicone, variant.magnet, variant.hall_part, process)


def drawn(
    variant: Variant, count: int, seed: int, process: str | None = None
) -> tuple[MadeSensors, pd.DataFrame, Ints]:
    """Draw made sensors, each of a batch of its own, and further ones of `BATCHES` batches and of those at the ends.

    Returns
    -------
    The sensors, the `count` of a batch of their own first; the middle of each batch of several sensors, those at the
    ends last; and the batch of each of these sensors, shape (n - count,).
    """
    import pandas as pd
    from scipy.stats import qmc

    design, made_of, number = variant.design, parts_of_variant(variant, process), min(BATCHES, count)
    _, random = np.random.default_rng(seed).spawn(2)
    middle = batches_at(np.vstack([qmc.LatinHypercube(3, rng=random).random(number), ENDS]))
    batch = np.repeat(np.arange(len(middle)), -(-count // number))
    middles = np.vstack([batch_middles(count, seed), middle[batch]])
    sizes = tolerances_of(design, made_of)
    sensors = made_sensors(design, sizes, len(middles), seed, parts=made_of, middle=middles)
    table = pd.DataFrame(values_at(design, made_of, middle)).set_axis(["E_MPa", "nu", "remanence_T"], axis=1)
    return sensors, table.assign(at_the_ends=table.index >= number), batch


@dataclass(frozen=True, slots=True)
class Shares:
    """Made sensors of a variant, and which of them meet the requirements by the surrogate.

    Attributes
    ----------
    sensors, batch : as from `drawn`; met : whether a sensor meets all requirements, shape (n,).
    table, batches : see `Yield`.
    """

    sensors: MadeSensors
    batch: Ints
    met: pd.Series[bool]
    table: pd.DataFrame
    batches: pd.DataFrame

    @property
    def share(self) -> float:
        """Share of the sensors that meet all requirements, over batches."""
        return float(self.table["within_percent"].iloc[0]) / 100

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the share: the sampling error (95 %), at the ends of the surrogate's intervals where known."""
        row = self.table.iloc[0]
        count, within = int(row["sensors"]), float(row["within_percent"])
        ends = [row["surrogate_worse_percent"], row["surrogate_better_percent"]]
        low, high = (round((within if np.isnan(end) else end) * count / 100) for end in ends)
        return share_with_error(low, count)[1], share_with_error(high, count)[2]

    @property
    def worst(self) -> float:
        """Share of the sensors of the worst batch."""
        return float(self.batches["within_percent"].min()) / 100


def shares_of(
    variant: Variant, requirements: Requirements, count: int = SENSORS, seed: int = 0, *, intervals: bool = True
) -> Shares:
    """Return which made sensors of a variant meet the requirements; `intervals` also at the surrogate's ends."""
    import pandas as pd

    sensors, batches, batch = drawn(variant, count, seed, requirements.process)
    made = made_sensors_of(variant, sensors, sensors_of_variant(variant, requirements))
    possible = np.array([design is not None for design in sensors.designs])
    margins = _margins(made, possible, requirements, 0.0)
    met, first = pd.DataFrame(margins) >= 0, slice(count)
    ends = [
        pd.DataFrame(_margins(made.take(first), possible[first], requirements, caution)) >= 0
        for caution in ((1.0, -1.0) if intervals else ())
    ]
    every = met.all(axis=1)
    groups = every[count:].groupby(batch)
    batches = batches.assign(sensors=groups.size(), within=groups.sum(), within_percent=100 * groups.mean())
    table = pd.DataFrame([
        _row(ALL, every, [end.all(axis=1) for end in ends], batch),
        *(
            _row(name, met[name], [end[name] for end in ends], batch)
            | dict(zip(QUANTILES, 100 * np.quantile(margins[name][first], SHARES), strict=True))
            for name in (~met[first]).sum().sort_values(ascending=False, kind="stable").index
        ),
    ])  # fmt: skip
    return Shares(sensors, batch, every, table, batches.rename_axis("batch").reset_index())


def yield_of(
    variant: Variant,
    requirements: Requirements,
    count: int = SENSORS,
    seed: int = 0,
    *,
    calibration: Fit | None = None,
    solves: Mapping[str, Any] = {},
    shares: Shares | None = None,
) -> Yield:
    """Return the yield of a variant.

    calibration : of a made sensor of this variant, whose posterior takes the place of that of twelve presses.
    solves : model, store and workers of `cases.answer` for the check by finite elements; empty for no check. The
        states of its mechanics have the same store and workers.
    shares : of the same sensors with intervals, if they are known already.
    """
    import pandas as pd

    made = shares or shares_of(variant, requirements, count, seed)
    sensors = made.sensors
    load = required_load(variant.design, requirements)
    calibrations = check = pd.DataFrame()
    if load is not None:
        of_mechanics = {name: value for name, value in solves.items() if name != "model"} | {"progress": None}
        presses = after_presses(variant, requirements, calibration, len(sensors), seed, of_mechanics)
        calibrations = _calibrations(sensors, load, requirements, made.met, made.batch, presses)
        check = check_of(sensors, load, count, **solves) if solves else check
    if calibration is not None and not calibrations.empty:
        calibrations = calibrations.replace({"calibration": {"twelve presses": "the calibration"}})
    return Yield(made.table, made.batches, calibrations, check)


SHARES = (0.05, 0.5, 0.95)
QUANTILES = tuple(f"margin_{100 * share:g}_percent" for share in SHARES)


def _row(name: str, met: pd.Series[bool], ends: Sequence[pd.Series[bool]], batch: Ints) -> FlatRow:
    """Return a row of yield.csv from all sensors, those of a batch of their own first, and from these at the `ends`
    of the surrogate's intervals, NaN without them; the interval is that of Clopper and Pearson.
    """
    count = len(met) - len(batch)
    within = int(met[:count].sum())
    share, low, high = share_with_error(within, count)
    worse, better = [100 * float(end.mean()) for end in ends] or [np.nan] * 2
    return {
        "requirement": name,
        "sensors": count,
        "within": within,
        "within_percent": 100 * share,
        "low_percent": 100 * low,
        "high_percent": 100 * high,
        "surrogate_worse_percent": worse,
        "surrogate_better_percent": better,
        "worst_batch_percent": 100 * float(met[count:].groupby(batch).mean().min()),
    }


def _margins(
    made: Sensors, possible: NDArray[np.bool_], requirements: Requirements, caution: float
) -> dict[str, Array]:
    """Return the margins of made sensors, each of shape (n,); those of an impossible sensor are -1."""
    beams = made.beams()
    possible = possible & (beams.outside == "")
    # base, mould and rate are those of the nominal design, and so are its neighbours
    result = performance(made, beams, replace(requirements, cross_talk=None), caution=caution)
    own = {name: values for name, values in result.margins.items() if CRITERIA[name].varies}
    margins = {name: np.where(possible, values, -1.0) for name, values in own.items()}
    return margins | {IMPOSSIBLE: np.where(possible, 1.0, -1.0)}


def required_load(design: Design, requirements: Requirements) -> Press | None:
    """Return depth and shear at which a design reaches the required forces by the surrogate; None if it does not."""
    grid = design.D * np.linspace(0.02, 0.5, 97)[None]
    pressed = motions(SURROGATE, [design], grid, np.zeros_like(grid)).values["force_z"][0]
    depth = _first(grid[0], pressed, requirements.force_z)
    if depth is None or requirements.force_x is None:
        return None if depth is None else Press(depth)
    sheared = motions(SURROGATE, [design], np.full_like(grid, depth), grid).values["force_x"][0]
    shear = _first(grid[0], sheared, requirements.force_x)
    return None if shear is None else Press(depth, shear)


def _first(at: Array, force: Array, wanted: float) -> float | None:
    known = np.isfinite(force)
    reached = np.flatnonzero(known & (force >= wanted))
    if not len(reached) or not force[known][0] <= wanted:
        return None
    rising = known & (np.arange(len(at)) <= reached[0])
    return float(np.interp(wanted, force[rising], at[rising]))


def _calibrations(
    sensors: MadeSensors,
    load: Press,
    requirements: Requirements,
    every: pd.Series[bool],
    batch: Ints,
    presses: Array,
) -> pd.DataFrame:
    """Return the shares within all requirements and `ALLOWED`; a sensor without a calibration curve has no error that
    is known, and counts as missed unless its calibration is full. `presses` is from `after_presses`.
    """
    import pandas as pd

    try:
        axes = spread_of(sensors, load)
    except BadInput:
        return pd.DataFrame()
    span = {"z": requirements.force_z, "x": requirements.force_x, "y": requirements.force_x}
    count, rows = len(every) - len(batch), []
    for name, quantity in CALIBRATIONS.items():
        if quantity == "presses":
            errors = [presses]
        else:
            errors = [axis.made[quantity] / (span[way] or np.nan) for way, axis in axes.items()] if quantity else []
        worst = np.max(errors, axis=0) if errors else np.zeros(len(every))
        within = every & (worst <= ALLOWED)
        # an error that is unknown may be the largest
        known = np.isfinite(worst[:count])
        largest = np.quantile(np.where(known, worst[:count], np.inf), 0.95, method="higher")
        rows.append({
            "calibration": name,
            "within_percent": 100 * float(within[:count].mean()),
            "worst_batch_percent": 100 * float(within[count:].groupby(batch).mean().min()),
            "force_error_95_percent": 100 * float(largest) if np.isfinite(largest) and errors else np.nan,
            "unknown": int((~known).sum()),
        })  # fmt: skip
    return pd.DataFrame(rows)


def after_presses(
    variant: Variant,
    requirements: Requirements,
    calibration: Fit | None,
    count: int,
    seed: int,
    solves: Mapping[str, Any] = {},
) -> Array:
    """Return the largest force error of sensors after `magtip calibrate` over the required range (count,); or NaN.

    Each has the twelve presses that `magtip bench` plans, on a stand with the error of its force sensor. Its errors
    are drawn from what these leave uncertain of a sensor with the parts of the catalogue, linearised at the typical
    one, or from the posterior of a calibration that was made of this design. `solves` are those of the mechanics.
    """
    unknown = np.full(count, np.nan)
    try:
        if calibration is None:
            made = tolerances_of(variant.design, parts_of_variant(variant, requirements.process))
            plan = press_plan.plan(variant.design, made, requirements, solves=solves)
            found, reached, lost = plan.after, plan.reached, plan.lost > 0
        else:
            found, loads = calibration, press_plan.loads_of(requirements)
            reached, _, _ = calibrated_forces.poses_under(found, loads)
            lost = not np.isfinite(reached).all()
    except (BadInput, SolveFailed):
        return unknown
    # the errors of a load whose pose is unknown may be the largest
    return unknown if lost else press_plan.largest_errors(found, reached, requirements, count, seed)


def check_of(sensors: MadeSensors, load: Press, count: int, *, model: str = "fem", **solves: Any) -> pd.DataFrame:
    """Return `CHECKED` drawn sensors under a load by finite elements, and by the surrogate with its half widths."""
    from studies import cases

    chosen = np.unique(np.linspace(0, count - 1, min(CHECKED, count)).round().astype(int)).tolist()
    designs = {k: design for k in chosen if (design := sensors.designs[k]) is not None}
    at = Load(load.depth, load.shear, friction="stick") if load.shear else Load(load.depth)
    table = cases.table([(design, at, "rigid") for design in designs.values()])
    solved, fast = (
        cases.answer(table, [name], base=sensors.nominal, quantities=["force"], **solves)
        for name in (model, SURROGATE)
    )
    result = solved[["E_MPa", "status"]].assign(sensor=list(designs))
    known = solved["status"].isin(ANSWERED)
    estimates = {"force": "error_estimate"} | ({"force_x": "sideways_error_estimate"} if load.shear else {})
    for name, estimate in estimates.items():
        fem, surrogate = solved[f"fem_{name}_N"].where(known), fast[f"surrogate_{name}_N"]
        result[f"fem_{name}_N"], result[f"surrogate_{name}_N"] = fem, surrogate
        result[f"{name}_difference_percent"] = 100 * (surrogate / fem - 1)
        result[f"{name}_half_width_percent"] = 100 * fast[estimate]
    return result
