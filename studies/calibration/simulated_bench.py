"""A simulated test stand for rehearsal: a made sensor of any design, its planned presses, and a recording.

The sensor is drawn at random within its tolerances (`studies.sensitivity.made_sensors`). Finite elements of its own
silicone and magnet give forces, shift and tilt; its elements, displaced and with their own gains and nulls, read the
field of its displaced magnet, with noise, and through their converters.

The stand presses and shears to the planned forces, as far as it knows them: to the load at which a sensor of the made
one's E has them by the mechanics of the plan, or, where these end before, to the planned depth and shear. The forces
there differ by what nu, magnet and the mechanics' error change, some percent. Its depth counts from a zero of its
own, and contains that it gives way.

Limits: presses of the bench are slow, in the recording the silicone relaxes as the design's does; the plate neither
slips nor tilts, and nothing but the magnet makes a field.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analytic import parts
from analytic.hall import averaged, field_at, means_over_plates, plates_of, rotated
from analytic.inverse.response_surface import force_and_load, shifts_of_forces, workspace
from analytic.time_series import RelaxingForce
from fem.accuracy import QUICK, Accuracy, level
from fem.equilibrium import trace
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load
from geometry.messages import Progress
from studies.calibration import press_plan
from studies.calibration.bench_file import FORCES, MOTIONS
from studies.calibration.press_plan import Plan
from studies.inputs.option_groups import Planning
from studies.output.result import Result, Rows, Table
from studies.parts.part_tolerances import Parts, Tolerances
from studies.sensitivity.made_sensors import MadeSensors, made_sensors

if TYPE_CHECKING:
    import pandas as pd

    from studies.output.records import FlatRow
    from studies.parts.requirements import Requirements

STAND_ZERO, STAND_COMPLIANCE = 0.1, 0.004
"""Depth that the stand shows at first touch, mm, and how much it gives way, mm/N."""
TRUE, MOVED = [f"true_{name}" for name in FORCES], [f"true_{name}" for name in MOTIONS]
"""Columns of the true forces and of the plate's true motion."""
FILES = ("plan.csv", "bench.csv", "recording.csv")
"""Files of the study; the last two of a simulated bench only, so that none of another sensor stays beside a plan."""
AT_REST, STATES, STEP = 20, 60, 5.0
"""Rows of a recording at rest and under load, and seconds between them."""
RECORDED, DIRECTION = 0.8, 40.0
"""Share of the largest planned forces to which a recording goes, and its direction, deg: between those of a plan."""
IN_TURN = (
    "Press one beam after the other, with all others at rest, and write down the readings of all elements: column "
    "beam is the number of the one that is pressed, 0 at rest."
)
FieldCode = Callable[[Array, Design, Array, Array], Array]
"""B (n, 3), T, at points (n, 3), mm, of the sensor's frame, of a design's magnet with the shifts (n, 3), mm, and
rotation vectors (n, 2), rad: what `analytic.hall.field_at` returns."""


@dataclass(frozen=True, slots=True)
class Stand:
    """A test stand and its errors.

    Attributes
    ----------
    force_noise : standard deviation of a measured force, N.
    reading_noise : of a reading, in the elements' unit; None for that of the design or the data sheet.
    zero, compliance : depth that is shown at first touch, mm, and by how much the stand gives way, mm/N.
    accuracy : of the finite elements that give the true forces.
    field : code that gives the field of the magnet.
    loop : half of the relative width of the loop of the force, whose two ways are drawn at random.
    depth_noise : standard deviation of a shown depth, mm.
    """

    force_noise: float
    reading_noise: float | None = None
    zero: float = STAND_ZERO
    compliance: float = STAND_COMPLIANCE
    accuracy: Accuracy = QUICK
    field: FieldCode = field_at
    loop: float = 0.0
    depth_noise: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """What one made sensor does under n loads: forces and shifts (n, 3), N and mm, rotation vectors (n, 2), rad."""

    force: Array
    shift: Array
    turn: Array


REST = States(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 2)))


def run(
    design: Design,
    made: Tolerances,
    bought: Parts,
    needed: Requirements | None,
    options: Planning,
    array: ArrayDesign | None,
    progress: Progress,
) -> Result:
    """Plan the presses of a bench, and simulate them if the options say so.

    Parameters
    ----------
    made : tolerances of the sensor.
    bought : the parts of the catalogues that it is made of, in whose ranges a simulated one lies.
    needed : its requirements; None for usual loads.
    array : of which the design is one beam: its presses are repeated on each.

    Raises
    ------
    BadInput
        The design cannot be planned (`press_plan.plan`), or an option is out of its range.
    SolveFailed
        The finite elements do not reach a load of the drawn sensor.
    """
    stand = _stand_of(options)
    plan = press_plan.plan(
        design, made, needed, count=options.presses, responses=options.responses, force_noise=options.force_noise,
        solves={"progress": lambda share, text: progress(0.1 * share, text)},
    )  # fmt: skip
    tables: dict[str, Rows] = {"plan": plan.rows() if array is None else rows_of_array(plan, array)}
    record = plan.record()
    if array is not None:
        record["beams"] = len(array)
    if options.simulate:
        stand = dataclasses.replace(stand, force_noise=plan.sensor.force_noise)
        drawn = made_sensors(design, made, 1 if array is None else len(array), options.seed, parts=bought)
        found, record["made"] = _simulated(plan, array, drawn, stand, options.seed, progress)
        tables |= found
    return Result(
        title="Press plan",
        records=[record],
        shown=[Table(title="Press plan", rows=plan.shown()), *plan.sentences(), *[IN_TURN] * (array is not None)],
        tables=tables,
        warnings=plan.warnings(),
        design=dataclasses.asdict(design),
    )


def _simulated(
    plan: Plan, array: ArrayDesign | None, drawn: MadeSensors, stand: Stand, seed: int, progress: Progress
) -> tuple[dict[str, Rows], FlatRow | list[FlatRow]]:
    """Return the tables of a simulated bench, and the values of the drawn sensor, or of each of an array's."""

    def pressing(share: float, text: str) -> None:
        progress(0.1 + 0.4 * share, text)

    def recorded(share: float, text: str) -> None:
        progress(0.5 + 0.5 * share, "recording")

    if array is None:
        found = bench(plan, drawn, stand, seed, pressing)
        slow = recording(plan, drawn, stand, seed, recorded)
        made: FlatRow | list[FlatRow] = made_record(drawn)
    else:
        beams = beams_of(array, drawn)
        found = bench_of_array(plan, array, beams, stand, seed, pressing)
        slow = recording_of_array(plan, array, beams, stand, seed, recorded)
        made = [made_record(one) for one in beams]
    measured_ = found.drop(columns=[*TRUE, *MOVED])
    return {"bench": measured_.to_dict("records"), "recording": slow.to_dict("records")}, made


def rows_of_array(plan: Plan, array: ArrayDesign) -> list[FlatRow]:
    """Return the rows of plan.csv: rest, and the presses of a plan on each beam in turn."""
    rest, *presses = plan.rows()
    empty = dict.fromkeys(columns(plan.sensor.design))
    rows = [(0, rest), *((k, row) for k in range(1, len(array) + 1) for row in presses)]
    return [
        {"beam": k}
        | {name: value for name, value in row.items() if value is not None or name == "angle_deg"}
        | dict.fromkeys([*columns(array), *(name for name in row if row[name] is None and name not in empty)])
        for k, row in rows
    ]


def _stand_of(options: Planning) -> Stand:
    """Return the stand of options; its force noise is that of the plan."""
    for name, value, least in (
        ("force-noise", options.force_noise, 0.0),
        ("reading-noise", options.reading_noise, 0.0),
        ("stand-compliance", options.stand_compliance, 0.0),
        ("stand-zero", options.stand_zero, -math.inf),
    ):
        if value is not None and not (least <= value < math.inf):
            raise BadInput(f"--{name} must be a finite number{', 0 or more' if least == 0 else ''}; got {value:g}")
    if options.seed < 0:
        raise BadInput(f"--seed must be 0 or more; got {options.seed}")
    if options.force_noise == 0:
        raise BadInput("--force-noise must be above 0 N, since it weighs the forces of the plan; got 0")
    return Stand(1.0, options.reading_noise, options.stand_zero, options.stand_compliance, level(options.accuracy))


def made_record(made: MadeSensors) -> FlatRow:
    """Return the drawn values of one made sensor."""
    design = _design_of(made)
    return {
        "E_MPa": design.E,
        "nu": design.nu,
        "remanence_T": design.remanence,
        "magnet_diameter_mm": design.magnet_diameter,
        "magnet_height_mm": design.magnet_height,
        "magnet_offset_mm": made.magnet_offset[0].tolist(),
        "magnet_tilt_rad": made.magnet_tilt[0].tolist(),
        "element_offset_mm": made.element_offset[0].tolist(),
        "gain_factor": made.gain_factor[0].tolist(),
        f"null_shift_{parts.of_design(design)[0].unit}": made.null_shift[0].tolist(),
    }


def bench(plan: Plan, made: MadeSensors, stand: Stand, seed: int, progress: Progress) -> pd.DataFrame:
    """Return what a stand measures under the presses of a plan, and the true forces.

    Parameters
    ----------
    made : one sensor.

    Raises
    ------
    SolveFailed
        The finite elements do not reach a load.
    """
    import pandas as pd

    design, rng = _design_of(made), np.random.default_rng([seed, 0])
    load = loads_of(plan, design, plan.force, plan.load)
    states = pressed(design, load, stand.accuracy, progress)
    rows = np.hstack([measured(made, states, load[:, :1], stand, rng), states.force, load])
    return pd.DataFrame(rows, columns=[*columns(design), *FORCES, "depth_mm", *TRUE, *MOVED])


def bench_of_array(
    plan: Plan, array: ArrayDesign, made: Sequence[MadeSensors], stand: Stand, seed: int, progress: Progress
) -> pd.DataFrame:
    """Return what a stand measures of an array at rest, and under the presses of a plan on each beam in turn.

    made : the sensor of each beam.
    """
    import pandas as pd

    rng, n, tables = np.random.default_rng([seed, 0]), len(array), []
    names = columns(array)
    for k, one in enumerate(made):
        design = _design_of(one)
        load = loads_of(plan, design, plan.force, plan.load)[bool(k) :]
        solved = pressed(design, load, stand.accuracy, _part(progress, k, n))
        others = _repeated(REST, len(load))
        states = [solved if j == k else others for j in range(n)]
        read = readings_of_beams(made, states, array.places, stand, rng)
        rows = np.hstack([read, forces_and_depths(solved.force, load[:, :1], stand, rng), solved.force, load])
        table = pd.DataFrame(rows, columns=[*names, *FORCES, "depth_mm", *TRUE, *MOVED])
        table.insert(0, "beam", np.where(load.any(axis=1), k + 1, 0))
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _part(progress: Progress, k: int, n: int) -> Progress:
    return lambda share, text: progress((k + share) / n, f"beam {k + 1}: {text}")


def _repeated(states: States, count: int) -> States:
    return States(*(np.repeat(rows, count, axis=0) for rows in (states.force, states.shift, states.turn)))


def measured(made: MadeSensors, states: States, depth: Array, stand: Stand, rng: np.random.Generator) -> Array:
    """Return what a stand measures of one made sensor in states: readings, forces and shown depths, (n, k + 4).

    depth : of the plate, (n, 1), mm.
    """
    # forces first: numbers that are drawn keep their order
    stand_shows = forces_and_depths(states.force, depth, stand, rng)
    return np.hstack([readings(made, states, stand, rng), stand_shows])


def forces_and_depths(force: Array, depth: Array, stand: Stand, rng: np.random.Generator) -> Array:
    """Return the forces and the depth (n, 4) that a stand shows, for true ones (n, 3), N, and (n, 1), mm."""
    size = force.shape
    # a plate that does not touch has no depth
    shown = np.where(depth > 0, depth, math.nan) + stand.zero + stand.compliance * force[:, 2:]
    if stand.depth_noise:
        shown = shown + stand.depth_noise * rng.normal(size=shown.shape)
    loop = 1 + stand.loop * rng.choice([-1.0, 1.0], size=(len(force), 1)) if stand.loop else 1.0
    return np.hstack([force * loop + stand.force_noise * rng.normal(size=size), shown])


def recording(plan: Plan, made: MadeSensors, stand: Stand, seed: int, progress: Progress) -> pd.DataFrame:
    """Return readings over time, from rest to a press and a shear, and the true forces, which relax; see `bench`."""
    import pandas as pd

    rng = np.random.default_rng([seed, 1])
    times, found, force = _recorded(plan, _design_of(made), RECORDED, DIRECTION, stand, progress)
    rows = np.hstack([times, readings(made, found, stand, rng), force])
    return pd.DataFrame(rows, columns=["time_s", *columns(plan.sensor.design), *TRUE])


def recording_of_array(
    plan: Plan, array: ArrayDesign, made: Sequence[MadeSensors], stand: Stand, seed: int, progress: Progress
) -> pd.DataFrame:
    """Return readings over time of all beams, pressed and sheared at once, each along a way of its own, and the true
    forces on each of them."""
    import pandas as pd

    rng, n = np.random.default_rng([seed, 1]), len(array)
    found = [
        _recorded(
            *(plan, _design_of(one), RECORDED * (1 - k / (2 * n)), DIRECTION + 360 * k / n, stand),
            _part(progress, k, n),
        )
        for k, one in enumerate(made)
    ]
    read = readings_of_beams(made, [states for _, states, _ in found], array.places, stand, rng)
    rows = np.hstack([found[0][0], read, *(force for *_, force in found)])
    return pd.DataFrame(rows, columns=["time_s", *columns(array), *true_columns(n)])


def true_columns(n: int) -> list[str]:
    """Return the columns of the true forces on n beams."""
    return [f"true_b{k}_{name}" for k in range(1, n + 1) for name in FORCES]


def _recorded(
    plan: Plan, design: Design, share: float, direction: float, stand: Stand, progress: Progress
) -> tuple[Array, States, Array]:
    """Return times (n, 1), s, states and forces (n, 3), N, of a press and a shear to a share of the largest ones."""
    normal, aside = plan.needed.force_z, plan.needed.force_x or 0.0
    way = np.radians(direction)
    force = share * np.array([[aside * np.cos(way), aside * np.sin(way), normal]])
    largest = np.argmax(plan.force[:, 2] + np.hypot(*plan.force[:, :2].T))
    ((depth, x, y),) = loads_of(plan, design, force, share * plan.load[[largest]]).tolist()
    steps = np.linspace(0, 1, STATES // 2 + 1)[1:].tolist()
    # a path has one kind of friction
    loads = [Load(depth * step, friction="stick" if aside else "none") for step in steps]
    if aside:
        loads += [Load(depth, x * step, y * step, friction="stick") for step in steps]
    found = solved(design, loads, stand.accuracy, progress)
    found = States(*(np.vstack([np.zeros((AT_REST, v.shape[1])), v]) for v in (found.force, found.shift, found.turn)))
    times = STEP * np.arange(len(found.force))[:, None]
    moved = np.vstack([np.zeros((AT_REST, 2)), [[load.shear_x, load.shear_y] for load in loads]])
    law = RelaxingForce(design)
    rows = zip(times.ravel().tolist(), found.force, moved, strict=True)
    return np.asarray(times), found, np.array([law.step(*row) for row in rows])


def columns(design: Design | ArrayDesign) -> list[str]:
    """Return the names of the columns of a design's readings, with their unit."""
    elements = parts.of_design(design)
    return [f"{name}_{elements[0].unit}" for name in parts.columns(elements)]


def _design_of(made: MadeSensors) -> Design:
    (design,), (refusal,) = made.designs, made.refusals
    if design is None:
        raise BadInput(f"the drawn sensor cannot be made ({refusal}): choose another --seed, or less --tolerance")
    return design


def loads_of(plan: Plan, design: Design, force: Array, load: Array) -> Array:
    """Return depth and shears (n, 3), mm, at which a made design has about these forces (n, 3), N.

    load : (n, 3) the same, where the mechanics of the plan end before.
    """
    law, nominal = plan.sensor.mechanics, plan.sensor.design
    wanted = force * nominal.E_now / design.E_now
    aside = np.hypot(wanted[:, 0], wanted[:, 1])
    u, w = shifts_of_forces(law, *workspace(nominal, law), aside, wanted[:, 2])
    way = wanted[:, :2] / np.where(aside > 0, aside, 1.0)[:, None]
    shift = np.ascontiguousarray(np.column_stack([u[:, None] * way, w]).T)
    reached = force_and_load(law, shift, contact=False)[1].T
    return np.where(np.isfinite(reached), reached, load)


def pressed(design: Design, load: Array, accuracy: Accuracy, progress: Progress) -> States:
    """Return what a design does under depths and shears (n, 3), mm, each from rest on, by finite elements.

    Shears of one size are the same in all directions, so that one along x is solved for all of them. At depth 0 the
    sensor is at rest.
    """
    sizes = np.column_stack([load[:, 0], np.hypot(load[:, 1], load[:, 2])])
    unique, which = np.unique(sizes.round(9), axis=0, return_inverse=True)
    solves = []
    for k, (depth, shear) in enumerate(unique.tolist()):
        progress(k / len(unique), f"state {k + 1} of {len(unique)}")
        one = Load(depth, shear, friction="stick") if shear else Load(depth)
        solves.append(solved(design, [one], accuracy) if depth else REST)
    c, s = load[:, 1:].T / np.where(sizes[:, 1] > 0, sizes[:, 1], 1.0)
    c = np.where(sizes[:, 1] > 0, c, 1.0)

    def turned(name: str) -> Array:
        x, y, *z = np.vstack([getattr(state, name) for state in solves])[which.ravel()].T
        return np.column_stack([c * x - s * y, s * x + c * y, *z])

    return States(*map(turned, ("force", "shift", "turn")))


def solved(design: Design, loads: list[Load], accuracy: Accuracy, progress: Progress | None = None) -> States:
    """Return what a design does under loads that follow one another, by finite elements."""
    found = trace(design, loads, accuracy, estimate=False, progress=progress)
    if len(found) < len(loads) or found[-1].status not in ANSWERED:
        raise SolveFailed(f"the drawn sensor was not solved ({found[-1].status}): {found[-1].message}")
    answers = [state.response for state in found]
    force, shift, turn = (
        np.array([getattr(each, name) for each in answers]) for name in ("force", "shift", "rotation")
    )
    return States(force, shift, turn)


def readings(made: MadeSensors, states: States, stand: Stand, rng: np.random.Generator) -> Array:
    """Return what the elements (k,) of one made sensor read in states (n,), in their unit, with noise and steps."""
    return readings_of_beams([made], [states], np.zeros((1, 2)), stand, rng)


def readings_of_beams(
    made: Sequence[MadeSensors], states: Sequence[States], places: Array, stand: Stand, rng: np.random.Generator
) -> Array:
    """Return what the elements of all beams (m k,) read in states (n,) of each, of the magnets of all of them.

    made : the sensor of each beam. places : of their axes, (m, 2), mm.
    """
    found = []
    for one, at in zip(made, places, strict=True):
        elements = elements_of(one)
        points, owners = plates_of(elements)
        b = np.zeros((len(states[0].force) * len(points), 3))
        for other, state, place in zip(made, states, places, strict=True):
            b += _field(points + np.append(at - place, 0.0), other, state, stand)
        gain, null = (np.array([getattr(element, name) for element in elements]) for name in ("gain", "null"))
        raw = null + gain * means_over_plates(b, elements, owners)
        if stand.reading_noise is not None:
            elements = tuple(
                dataclasses.replace(e, noise=stand.reading_noise, floor=0.0, average=1) for e in elements
            )
        found.append(averaged(elements, raw, rng)[0])
    return np.hstack(found)


def _field(points: Array, made: MadeSensors, states: States, stand: Stand) -> Array:
    """Return the field (n m, 3), T, at points (m, 3), mm, of the magnet of one made sensor in states (n,)."""
    # the magnet's offset turns with the silicone around it, its tilt adds to that of the load
    shift = states.shift + rotated(made.magnet_offset[0], states.turn)
    turn, count = states.turn + made.magnet_tilt[0], len(points)
    at = np.tile(points, (len(shift), 1))
    return stand.field(at, _design_of(made), np.repeat(shift, count, axis=0), np.repeat(turn, count, axis=0))


def beams_of(array: ArrayDesign, made: MadeSensors) -> list[MadeSensors]:
    """Return the sensor of each beam, its magnet as it lies in the array, from made sensors (n,) of its design."""
    found = []
    for k in range(len(array)):
        one, nominal = made.one(k), array.of_beam(k)
        design = dataclasses.replace(_design_of(one), magnet_north=nominal.magnet_north)
        found.append(dataclasses.replace(one, nominal=nominal, designs=(design,)))
    return found


def elements_of(made: MadeSensors) -> tuple[parts.Element, ...]:
    """Return the elements of one made sensor, displaced, with their own gains and nulls."""
    nominal, _ = parts.with_noise(parts.of_design(made.nominal))
    rows = zip(
        nominal, made.element_offset[0], made.gain_factor[0].tolist(), made.null_shift[0].tolist(), strict=True
    )
    return tuple(
        dataclasses.replace(
            element,
            position=tuple((element.position + place).tolist()),
            gain=element.gain * gain,
            null=element.null + null,
        )
        for element, place, gain, null in rows
    )
