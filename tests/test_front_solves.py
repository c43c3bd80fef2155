"""The points of a front by finite elements, and the yield of made sensors."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from conftest import ROUGH, take_surrogate
from stores import temporary

from analytic.hall import readings
from fem.accuracy import QUICK
from fem.equilibrium import solve, trace
from geometry.design import paper
from geometry.loads import Load
from studies.calibration import press_plan
from studies.cases import FiniteElements
from studies.inputs.user_input import read_design
from studies.parts.catalogues import catalogues_of
from studies.parts.part_tolerances import batches_of, parse_tolerances
from studies.parts.requirements import Requirements, stated_requirements
from studies.sensitivity.beam_motions import motions
from studies.sensitivity.made_sensors import nominal_sensor, share_with_error
from studies.simulation.solved_beams import SolvedBeams
from studies.sizing import front_yield, sizing_export, sizing_study
from studies.sizing.candidate_performance import FIGURES, LEAST, performance
from studies.sizing.candidate_variables import Space, joined
from studies.sizing.front_solves import (
    COMPARED,
    FrontPoint,
    _judged,
    ranked,
    solved_points,
    to_solve,
    with_solved_loads,
)
from studies.sizing.front_yield import check_of, drawn, required_load, yield_of
from studies.sizing.sensor_arrays import made_sensors_of, sensors_of, sensors_of_variant

PLAIN = Requirements(force_z=5.0)


@pytest.fixture(autouse=True)
def mechanics(monkeypatch):
    """Yields after presses rest on the surrogate."""
    take_surrogate(monkeypatch)


def points(rows, **solved):
    """Points with the given ranges, resolutions and sizes."""
    made = []
    for number, (range_z, resolution, size) in enumerate(rows, 1):
        values = dict.fromkeys(FIGURES, 1.0) | {f"{name}_half_width": 0.0 for name in COMPARED}
        values |= {"range_z": range_z, "resolution_z": resolution, "resolution_x": resolution / 2, "outer_size": size}
        values |= solved
        made.append(FrontPoint(number, None, values, values, {}, [], "ok", ""))
    return made


def test_the_weights_decide_the_ranks():
    made = points([(10, 0.01, 20), (5, 0.001, 20), (5, 0.01, 10)])
    for weights, best in (((1, 0, 0), 1), ((0, 1, 0), 2), ((0, 0, 1), 3)):
        names = dict(zip(("weight_range", "weight_resolution", "weight_size"), map(float, weights), strict=True))
        order = ranked(made, Requirements(force_z=5.0, **names))
        assert (order[0].number, order[0].rank) == (best, 1)
        assert order[0].score == pytest.approx(1.0)


def test_no_rank_rests_on_less_than_the_error_of_the_finite_elements():
    """3 % more range dominates, but not where finite elements know a range within 10 %: then both share a rank."""
    rows = [(10.3, 0.01, 20), (10, 0.01, 20), (20, 0.02, 20)]
    sure, doubtful = (ranked(points(rows, range_z_half_width=w), Requirements(force_z=5.0)) for w in (0.0, 1.0))
    assert {point.number for point in sure} == {1, 3}
    assert [point.rank for point in sorted(doubtful, key=lambda point: point.number)][0:2] in ([1, 1], [2, 2])


def test_ranks_and_what_is_left_out_rest_on_half_a_percent():
    """A difference of 4e-6 decides nothing, whatever the values; what parts two ranks, or leaves out, is larger."""
    edge = 5.0 * np.exp(0.05)
    near = ranked(points([(edge * (1 + 2e-6), 0.01, 20), (edge * (1 - 2e-6), 0.01, 20), (5, 0.001, 20)]), PLAIN)
    assert sorted(point.number for point in near) == [1, 2, 3]
    assert len({point.rank for point in near if point.number < 3}) == 1
    rows = np.exp(np.random.default_rng(1).normal(0.0, 0.006, (60, 3))) * [10, 0.01, 20]
    order = ranked(points(rows.tolist()), PLAIN)
    F = {k + 1: np.log(row) * [-1, 1, 1] for k, row in enumerate(rows)}
    stays = {point.number for point in order}
    assert 3 < len(stays) < 60
    for one in order:
        for other in order:
            assert one.rank >= other.rank or (F[other.number] - F[one.number]).max() > 0.005
    for number in set(F) - stays:
        assert any((F[k] <= F[number]).all() and (F[number] - F[k]).max() > 0.005 for k in stays)


def test_no_rank_rests_on_a_half_width_that_is_unknown():
    rows = [(10.3, 0.01, 20), (10, 0.01, 20), (20, 0.01, 21)]
    unknown = ranked(points(rows, range_z_half_width=np.nan), PLAIN)
    assert [point.rank for point in sorted(unknown, key=lambda point: point.number)] == [1, 1, 3]


def test_failed_points_come_last_without_a_rank():
    made = points([(10, 0.001, 10), (5, 0.01, 20)])
    made[0] = dataclasses.replace(made[0], status="failed", reason="largest_strain is missed by 3 %")
    order = ranked(made, Requirements(force_z=5.0))
    assert [(point.number, point.rank) for point in order] == [(2, 1), (1, 0)]


def made_shares(within, count=400):
    """Shares of made sensors of which so many meet all requirements."""
    row = front_yield._row(front_yield.ALL, pd.Series(np.arange(count + 2) < within), [], np.zeros(2, dtype=int))
    return front_yield.Shares(None, None, None, pd.DataFrame([row]), pd.DataFrame({"within_percent": [50.0]}))


def test_a_yield_below_the_required_one_fails_and_an_unknown_one_comes_later():
    """89 % of 400 has an interval from 85.5 to 91.9 %: whether it is 90 % is unknown, and leaves out nothing."""
    needed = dataclasses.replace(PLAIN, least_yield=0.9)
    made = points([(20, 0.001, 10), (10, 0.002, 12), (5, 0.01, 20), (4, 0.02, 30)])
    shares = [made_shares(within) for within in (356, 240, 380, 380)]
    judged = [_judged(dataclasses.replace(p, made=s), needed) for p, s in zip(made, shares, strict=True)]
    order = ranked(judged, needed)
    assert [(point.number, point.rank, point.status) for point in order] == [
        (3, 1, "ok"),
        (1, 2, "ok"),
        (2, 0, "failed"),
    ]
    assert order[1].doubt.startswith("whether least_yield is met is unknown: 89 % of made sensors (85.5 to 91.9 %)")
    assert order[2].reason.startswith("least_yield is missed: 60 % of made sensors (55")
    assert order[0].margins["least_yield"] == pytest.approx(0.95 / 0.9 - 1)
    row = dataclasses.replace(order[0], variant=MADE).row()
    assert (row["yield_percent"], row["worst_batch_percent"]) == (95.0, 50.0)
    # without the requirement the yield is shown, and ranks nothing
    assert ranked([_judged(dataclasses.replace(point, margins={}), PLAIN) for point in judged], PLAIN)[0].number == 1


@pytest.fixture(scope="module")
def sheared():
    """Shears of the paper's sensor: in falling order, and one without a depth because its press has failed."""
    depth, shear = np.array([[0.1, 0.1, np.nan]]), np.array([[0.1, 0.05, 0.1]])
    with temporary() as memory:
        yield (
            SolvedBeams([paper()], FiniteElements(ROUGH, {"store": memory, "workers": 0}))
            .states(depth, shear)
            .quantities
        )


def test_a_force_that_no_press_reaches_is_missed():
    parts = {"magnets": ("5x3 N45",), "silicones": ("Dragon Skin 30",), "hall_parts": ("DRV5055A2",)}
    needed = Requirements(force_z=5000.0, **parts)
    drawn = Space(needed, catalogues_of(needed)).candidates(np.zeros((1, 3), dtype=int), np.full((1, 5), 0.5))
    with temporary() as memory:
        (point,) = solved_points(drawn, needed, FiniteElements(ROUGH, {"store": memory, "workers": 0}))
    assert point.reason.startswith("force_z is missed by 100 %")


def test_finite_elements_go_on_where_the_surrogate_has_no_answer_to_a_load():
    """At the largest E the press of 1.55 N is 0.028 D deep: less than shears of the surrogate are."""
    needed = Requirements(
        force_z=6.0,
        force_x=1.24,
        press_with_shear=1.55,
        largest_strain=1.0,
        hall_parts=("DRV5055A2",),
        silicones=("Smooth-Sil 940",),
        magnets=("3x3 N35",),
    )
    space = Space(needed, catalogues_of(needed))
    one = space.rounded(np.zeros((1, 3), dtype=int), np.array([[9.4, 7.7, 5.4, 0.8, -1.4]]))
    with temporary() as memory:
        (point,) = solved_points(one, needed, FiniteElements(ROUGH, {"store": memory, "workers": 0}))
    assert np.isnan(point.predicted["range_z"])
    assert point.solved["range_z"] > 3 * needed.force_z
    # of a front, which meets the loads of the search, such a variant is solved: under a third of the force along the
    # plate the press is shallower than under all of it
    sensors = sensors_of(one)
    for press in np.arange(1.68, 1.78, 0.004):
        better = dataclasses.replace(needed, force_x=0.8 * press, press_with_shear=press)
        coarse, dense = (performance(sensors, sensors.beams(), better, dense=d).margins for d in (False, True))
        if min(coarse.values()) >= 0 and dense["largest_strain"] == LEAST:
            break
    else:
        pytest.fail("no press lies between")
    assert len(to_solve(joined([one, space.rounded(one.choices, one.lengths + 0.3)]), better, 12)) == 2


def test_a_load_without_a_depth_has_no_response(sheared):
    assert np.isnan(sheared["force_x"].value).tolist() == [[False, False, True]]


class WithoutErrors(FiniteElements):
    """As where there is no coarser mesh."""

    def answers(self, *asked):
        found = super().answers(*asked)
        return found.assign(**{name: np.nan for name in found if name.endswith("error_estimate")})


@pytest.mark.parametrize("elements", [FiniteElements, WithoutErrors])
def test_an_unknown_error_is_not_taken_for_none(elements):
    with temporary() as memory:
        slender = SolvedBeams(
            [dataclasses.replace(paper(), L=30.0)], elements(QUICK, {"store": memory, "workers": 0})
        )
        pressed, critical = slender.states(np.array([[0.1]]), np.zeros((1, 1))).quantities, slender.critical_depth()
        likely, sure = (slender.stable_to(caution)[0] for caution in (0.0, 1.0))
    widths = [float(found.half_width.item()) for found in (pressed["force_z"], pressed["shift_z"], critical)]
    assert likely == critical.value[0] == pytest.approx(0.66 / 8, rel=0.02)
    if elements is FiniteElements:
        assert all(width > 0 for width in widths)
        assert sure == likely - widths[2]
    else:
        assert np.isnan([*widths, sure]).all()


def test_shears_are_those_of_one_path_whatever_their_order(sheared):
    loads = [Load(depth=0.8, shear_x=shear, friction="stick") for shear in (0.4, 0.8)]
    near, far = (state.response for state in trace(paper(), loads, ROUGH, model="harmonic"))
    assert sheared["force_x"].value[0, :2] * 64 == pytest.approx([far.force[0], near.force[0]], rel=1e-6)
    assert sheared["shift_z"].value[0, :2] * 8 == pytest.approx([-far.shift[2], -near.shift[2]], rel=1e-6)


# Yield


NEEDED = Requirements(force_z=5.0, force_x=1.5, magnets=("4x4 N45",), silicones=("Mold Star 30",))
PARTS = catalogues_of(dataclasses.replace(NEEDED, hall_parts=("DRV5055A2",)))
CANDIDATE = Space(NEEDED, PARTS).rounded(np.zeros((1, 3), dtype=np.int64), np.array([[10.0, 11.0, 1.0, 1.0, 1.8]]))
MADE = CANDIDATE.variant(0)


def reached(variant, **options):
    """What a variant reaches as designed."""
    sensors = sensors_of_variant(variant, NEEDED)
    return performance(sensors, sensors.beams(), NEEDED, **options)


class Unsolved(FiniteElements):
    """As where a worst load at an E of 0.5 MPa fails."""

    failure = ("not_converged", "no convergence")

    def answers(self, cases, *asked):
        found = super().answers(cases, *asked)
        if cases[0][0].E != 0.5:
            return found
        status, message = self.failure
        return found.assign(status=status, message=message, fem_force_N=4.0 if status == "unstable" else np.nan)


class Unstable(Unsolved):
    """As where it has a force, but is unstable."""

    failure = ("unstable", "it buckles")


LOAD = {"figure": "strain", "E_MPa": 0.5, "depth_mm": 0.8, "shear_mm": 0.0, "force_z_N": 5.0, "force_x_N": 0.0}


def loaded(rows, moduli):
    """Points of the variant, each with one worst load at an E."""
    made = zip(points(rows), moduli, strict=True)
    return [dataclasses.replace(point, variant=MADE, worst=[LOAD | {"E_MPa": E}]) for point, E in made]


@pytest.mark.parametrize(("elements", "said"), [(Unsolved, "did not reach"), (Unstable, "found unstable")])
def test_a_point_whose_worst_load_fails_is_not_ranked_but_what_it_dominates_is(elements, said):
    """The first point dominates the second and the last one, the second only the last one."""
    rows = [(10, 0.01, 20), (9, 0.01, 20), (9, 0.011, 18), (8, 0.011, 21)]
    with temporary() as memory:
        fem = elements(ROUGH, {"store": memory, "workers": 0})
        order = ranked(loaded(rows, [0.5, 0.7, 0.7, 0.7]), dataclasses.replace(NEEDED, weight_size=2.0), fem)
    assert [(point.number, point.status, point.rank) for point in order] == [
        (3, "ok", 1),
        (2, "ok", 2),
        (1, "failed", 0),
    ]
    assert order[-1].reason == f"finite elements {said} the load of the strain: {elements.failure[1]}"
    assert order[0].solved["strain"] == order[0].worst[0]["strain_percent"] / 100 != 1.0


@pytest.mark.parametrize(
    ("chips", "pitch", "reason"),
    [
        (2, None, ""),
        (3, None, "3 chips tlv493d-a1b6 cannot share a bus"),
        (3, 16.0, "27 chips tlv493d-a1b6 are more than 8 buses of 2 addresses hold, 16"),
    ],
)
def test_a_sizing_says_what_board_would_refuse(chips, pitch, reason):
    chosen = {"hall_layout": "tlv493d-a1b6", "chip_count": float(chips), "chip_x": 4.4, "l0": 8.0}
    variant = dataclasses.replace(MADE, design=dataclasses.replace(MADE.design, **chosen))
    point = dataclasses.replace(points([(10, 0.01, 20)])[0], variant=variant)
    needed = dataclasses.replace(NEEDED, pitch=pitch)
    sizing = sizing_study.Sizing(needed, PARTS, sizing_study.Settings(), 1, 1, [point], None, None)
    result = sizing_study.result_of(sizing, "", "", wide=False)
    assert [reason in text for text in result.warnings] == [True] * bool(reason)
    assert (reason or "`magtip board winner.toml --out board` has addresses and places") in result.pages["SIZING.md"]


def test_a_strain_that_is_unknown_under_one_load_is_unknown():
    class Unknown(FiniteElements):
        """As where a solve has no strain, at an E of 0.5 MPa."""

        def answers(self, cases, *asked):
            E = np.array([design.E for design, _ in cases])
            found = super().answers(cases, *asked)
            return found.assign(fem_largest_strain_percent=found["fem_largest_strain_percent"].where(E != 0.5))

    for moduli in ((0.5, 0.7), (0.7, 0.5)):
        (point,) = loaded([(10, 0.01, 20)], [0.7])
        point = dataclasses.replace(point, worst=[LOAD | {"E_MPa": E} for E in moduli])
        with temporary() as memory:
            fem = Unknown(ROUGH, {"store": memory, "workers": 0})
            found = with_solved_loads(point, dataclasses.replace(NEEDED, largest_strain=0.8), fem)
        assert (found.status, found.reason) == ("failed", "largest_strain is not known")


def test_the_distance_from_the_rail_is_that_of_the_solved_state():
    """A shear at 45 degrees has the same readings as the solve of the worst load along x."""
    row = LOAD | {"figure": "saturation", "E_MPa": 0.7, "remanence_T": 1.3, "direction_deg": 45.0, "shear_mm": 0.6}
    row |= {"force_z_N": 2.2, "force_x_N": 0.7}
    point = dataclasses.replace(points([(10, 0.01, 20)])[0], variant=MADE, worst=[row])
    with temporary() as memory:
        found = with_solved_loads(point, NEEDED, FiniteElements(ROUGH, {"store": memory, "workers": 0}))
    (solved,) = found.worst
    aside = solved["shear_mm"] * np.sqrt(0.5)
    load = Load(solved["depth_mm"], aside, aside, friction="stick")
    design = dataclasses.replace(MADE.design, E=0.7, remanence=1.3, hall_step=0.0)
    response = solve(design, load, ROUGH, model="harmonic").response
    output = readings(design, response).output
    distance = min(
        min((design.hall_high - out) / (design.hall_high - design.hall_null) for out in output),
        min((out - design.hall_low) / (design.hall_null - design.hall_low) for out in output),
    )
    assert solved["value"] / 100 == found.solved["saturation"] == pytest.approx(distance, abs=1e-6)
    assert found.margins["no_saturation"] == found.solved["saturation"] != 1.0


def row_of(result, name):
    return next(row for row in result.rows() if row["requirement"] == name)


def test_sensor_without_deviations_reads_as_designed():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    magnet = dataclasses.replace(
        MADE.magnet, remanence_low=MADE.magnet.remanence, remanence_high=MADE.magnet.remanence
    )
    one = dataclasses.replace(MADE, silicone=silicone, magnet=magnet)
    sensors = sensors_of_variant(one, NEEDED)
    designed = performance(sensors, sensors.beams(), NEEDED)
    made = made_sensors_of(one, nominal_sensor(MADE.design), sensors)
    found = performance(made, made.beams(), NEEDED)
    for name, value in found.one(0).items():
        assert value == pytest.approx(designed.one(0)[name], rel=1e-6, nan_ok=True), name


@pytest.mark.parametrize("name", ["E", "nu", "remanence"])
def test_draws_fill_the_range_of_the_catalogue_and_no_more(name):
    """Half of the sensors lie on each side of the typical value, which is in the middle of no range."""
    low, high = batches_of(MADE.design)[name]
    values = drawn(MADE, 1000, 0)[0].fields[name][:1000]
    assert low <= values.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < values.max() <= high
    assert np.mean(values < getattr(MADE.design, name)) == pytest.approx(0.5, abs=0.04)


def test_sensors_of_a_batch_are_alike_and_batches_differ():
    """Of the variance of E, that within batches is small; parts differ in their gains whatever their batch."""
    sensors, batches, batch = drawn(MADE, 500, 0)
    table = pd.DataFrame({"E": sensors.fields["E"], "gain": sensors.gain_factor[:, 0]})

    def within(rows, groups):
        """The variance within groups over the whole one."""
        return rows.groupby(groups).var().mean() / rows.var()

    # each of the first 500 is of a batch of its own: no group of them is alike
    assert (within(table[:500], np.arange(500) % 25) > 0.8).all()
    assert within(table[500:], batch)["E"] < 0.1
    assert within(table[500:], batch)["gain"] > 0.8
    assert batches["at_the_ends"].sum() == 4
    low, high = batches_of(MADE.design)["E"]
    ends = batches[batches["at_the_ends"]]["E_MPa"]
    assert low < ends.min() < low + 0.15 * (high - low)
    assert high - 0.15 * (high - low) < ends.max() < high
    assert list(np.bincount(batch)) == [20] * 29


def test_calibration_raises_the_yield():
    """The moduli of the catalogue differ by half: without a calibration no force is right to 5 % in every sensor."""
    calibrations = yield_of(MADE, NEEDED, 60).calibrations.set_index("calibration")
    shares = calibrations["within_percent"]
    assert list(shares.index) == ["none", "offset", "offset and gain", "twelve presses", "full"]
    assert shares.is_monotonic_increasing
    assert shares["none"] < 30 < shares["offset and gain"] < shares["full"] == 100
    errors = calibrations["force_error_95_percent"]
    # a posterior is no exact knowledge, but a better one than two corrections
    assert 0.5 < errors["twelve presses"] < 0.5 * errors["offset and gain"]


def test_a_bench_of_the_winner_promises_what_its_sizing_does(tmp_path):
    sizing_export.write_design(MADE, NEEDED, tmp_path)
    path = str(tmp_path / sizing_export.DESIGN)
    design, stated = read_design(path), stated_requirements(path)
    assert stated.loads(dense=True) == pytest.approx(NEEDED.loads(dense=True))
    plan = press_plan.plan(design, parse_tolerances([], design, path), stated)
    errors = front_yield.after_presses(MADE, NEEDED, None, press_plan.DRAWN, NEEDED.seed)
    assert plan.error(plan.after) == pytest.approx(np.quantile(errors, 0.95, method="higher"), rel=1e-6)
    assert plan.force[:, 2].max() == pytest.approx(NEEDED.force_z)


def test_a_force_error_that_is_unknown_counts_as_the_largest():
    sensors, _, batch = drawn(MADE, 25, 0)
    load, within = required_load(MADE.design, NEEDED), pd.Series(np.ones(len(sensors), dtype=bool))
    for unknown, known in ((1, 1.0), (2, np.nan)):
        presses = np.full(len(sensors), 0.01)
        presses[:unknown] = np.nan
        table = front_yield._calibrations(sensors, load, NEEDED, within, batch, presses).set_index("calibration")
        row = table.loc["twelve presses"]
        assert (row["unknown"], row["force_error_95_percent"]) == (unknown, pytest.approx(known, nan_ok=True))
        assert row["within_percent"] == 100 - 4 * unknown


def test_drawn_sensors_are_held_against_finite_elements(tmp_path):
    """The surrogate is within its own half width of finite elements for sensors of other E, nu and magnets, too."""
    sensors = drawn(MADE, 30, 0)[0]
    load = required_load(MADE.design, NEEDED)
    check = check_of(sensors, load, 3, model="fem:quick", store=tmp_path / "store.db", workers=0)
    assert list(check["sensor"]) == [0, 1, 2]
    for name in ("force", "force_x"):
        assert (check[f"{name}_difference_percent"].abs() < check[f"{name}_half_width_percent"] + 1).all()
    # the design itself carries the required forces there
    design = dataclasses.replace(MADE.design)
    moved = motions("surrogate", [design], np.array([[load.depth]]), np.array([[load.shear]])).values
    assert moved["force_x"][0, 0] == pytest.approx(NEEDED.force_x, rel=0.01)


def test_a_requirement_at_its_limit_is_met_by_some_and_named():
    typical = reached(MADE, dense=True)
    tight = dataclasses.replace(NEEDED, first_mode=1.05 * float(typical.values["first_mode"][0]))
    result = yield_of(MADE, tight, 60)
    assert 0 < row_of(result, "all")["within"] < 60
    assert result.rows()[1]["requirement"] == "first_mode"
    row = result.rows()[0]
    # of all batches, those at the ends of the ranges included
    assert row["worst_batch_percent"] == result.batches["within_percent"].min() == 0
    assert (result.batches["within_percent"] == 0)[result.batches["at_the_ends"]].any()
    assert f"29 others of {result.batches.sensors[0]} sensors each, of which 4 lie at the ends" in result.text()
    # sensors of batches of their own are independent
    assert [row["low_percent"], row["high_percent"]] == [100 * end for end in share_with_error(row["within"], 60)[1:]]


def test_the_surrogates_intervals_are_the_other_part_of_the_uncertainty():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    typical = reached(dataclasses.replace(MADE, silicone=silicone), caution=0.0)
    result = yield_of(MADE, dataclasses.replace(NEEDED, largest_strain=float(typical.values["strain"][0])), 100)
    row, every = row_of(result, "largest_strain"), row_of(result, "all")
    assert row["within_percent"] == pytest.approx(50, abs=15)
    for each in (row, every):
        assert each["surrogate_worse_percent"] <= each["within_percent"] <= each["surrogate_better_percent"]
    assert row["surrogate_worse_percent"] < row["surrogate_better_percent"]
    assert "at the ends of the surrogate's 90 % intervals; sampling error" in result.sentence
    assert "largest_strain fails most often" in result.text()
