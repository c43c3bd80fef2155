"""What candidates reach, and the search for variants."""

import dataclasses

import numpy as np
import pytest

from analytic.force_resolution import force_resolution
from analytic.hall import batch_readings
from analytic.parts import of_design
from geometry.base import Base, outer_size, plan
from geometry.mold import Mold, sizes
from studies.beam.beam_curves import pressed_curves, with_shears
from studies.beam.beam_model import BeamStates, Quantity
from studies.parts.catalogues import catalogues_of
from studies.parts.requirements import Requirements
from studies.sizing.candidate_performance import LEAST, performance
from studies.sizing.candidate_variables import Space, joined
from studies.sizing.sensor_arrays import sensors_of, sensors_of_variant
from studies.sizing.variant_search import (
    Effort,
    dominated,
    front_of,
    searched,
    sorted_parts,
    spread,
    whole_front,
)
from studies.validation.devices.search_check import held

NEEDED = Requirements(
    force_z=5.0, force_x=1.5, resolution_z=0.05, largest_strain=1.0, first_mode=50.0, outer_size=25.0
)
PARTS = catalogues_of(NEEDED)


CHIPS = sorted_parts(PARTS, 3)
"""The same with one to three chips."""


def made(D=10.0, L=11.0, magnet="4x4 N45", silicone="Mold Star 30", part="DRV5055A2", places=(1, 1, 1.8), chips=1):
    names = (
        [each.name for each in CHIPS.magnets].index(magnet),
        [each.name for each in CHIPS.silicones].index(silicone),
    )
    choices = [*names, [(each.name, each.count) for each in CHIPS.hall_parts].index((part, chips))]
    return Space(NEEDED, CHIPS).rounded(np.array([choices]), np.array([[D, L, *places]]))


def reached(one, needed=NEEDED, **options):
    sensors = sensors_of(one)
    return performance(sensors, sensors.beams(), needed, **options)


@pytest.mark.parametrize(("shape", "screws"), [("round", True), ("square", True), ("square", False)])
@pytest.mark.parametrize("process", ["fdm", "sla"])
def test_sizes_are_those_of_base_and_mould(shape, screws, process):
    needed = Requirements(force_z=5.0, outer_shape=shape, screws=screws, process=process)
    space, random = Space(needed, CHIPS), np.random.default_rng(1)
    counts = [len(CHIPS.magnets), len(CHIPS.silicones), len(CHIPS.hall_parts)]
    drawn = space.candidates(random.integers(counts, size=(80, 3)), random.random((80, 5)))
    drawn, compared = drawn.take(drawn.outside() == ""), 0
    for k, said in enumerate(np.array(drawn.sizes()).T):
        variant = drawn.variant(k)
        if isinstance(variant, str):
            continue
        outline = plan(variant.design, Base(shape=shape, screw=None if screws else 0.0), process)
        mould, (_, _, height) = sizes(variant.design, Mold(process=process)), outer_size(variant.design, outline)[0]
        wall = min(2 * mould.pin_radius, mould.wall, 1.2 if outline.seats.posts else np.inf)
        assert said == pytest.approx([2 * outline.half, height, wall], abs=1e-9)
        compared += 1
    assert compared > 50


@pytest.mark.parametrize(
    ("part", "chips", "uneven", "rejects"),
    [
        ("DRV5055A2", 1, 0.0, False),
        ("TMAG5273A1", 1, 0.0, False),
        ("TMAG5273A1", 3, 0.0, True),
        ("TMAG5273A1", 3, 0.4, False),
    ],
)
def test_every_load_is_a_state_of_the_surrogate_and_its_figures_are_those_of_the_sensor(part, chips, uneven, rejects):
    """Depth and shear of each pose give the required forces, and slopes by differences give the resolution."""
    one = made(part=part, chips=chips)
    design, sensors = one.variant(0).design, sensors_of(one)
    beams = sensors.beams()
    ends = (sensors.E_low[0], sensors.E_high[0])
    noise = np.array([element.noise_T for element in of_design(design)])
    noise *= 1 + uneven * np.sin(np.arange(len(noise)))
    sensors = dataclasses.replace(sensors, noise=noise[None])
    weak = dataclasses.replace(design, remanence=float(sensors.remanence[0, 0]))

    def state(E, q, lift=0.0):
        """Force and readings at a depth and a shear (x, y), over D, of a magnet that is lifted, mm."""
        depth, size, way = q[0], np.hypot(q[1], q[2]), np.arctan2(q[2], q[1])
        s = {n: v.value[0, 0] for n, v in beams.shear(np.array([[depth]]), np.array([[size]])).items()}
        e = np.array([np.cos(way), np.sin(way)])
        force = E * design.D**2 * np.array([*(s["force_x"] * e), s["force_z"]])
        shift = design.D * np.array([*(s["shift_x"] * e), -s["shift_z"]]) + [0, 0, lift]
        tilt = s["tilt"] * np.array([-e[1], e[0]])
        reading = batch_readings([weak], np.zeros(1, dtype=np.int64), shift[None], tilt[None]).field_T[0]
        return force, reading, s["strain"]

    needed = dataclasses.replace(NEEDED, ambient_error=1.0, temperature_error=1.0, reject_ambient=rejects, chips=3)
    result = performance(dataclasses.replace(sensors, drift=np.array([-8e-4])), beams, needed, caution=0.0)
    worst = dict.fromkeys(("resolution_z", "resolution_x", "strain", "drift", "ambient", "warming"), 0.0)
    directions = np.array([element.direction for element in of_design(design)])
    within = directions / noise[:, None]
    free = np.eye(len(noise)) - within @ np.linalg.pinv(within) if rejects else np.eye(len(noise))
    for k in range(result.loads.shape[1]):
        z, x, angle = result.loads[0, k]
        if x == 0:
            continue
        q = np.array([result.depth[0, k], *(result.shear[0, k] * np.array([np.cos(angle), np.sin(angle)]))])
        E = ends[result.corner[k]]
        force, reading, strain = state(E, q)
        assert np.hypot(*force[:2]) == pytest.approx(x, rel=0.03)
        assert force[2] == pytest.approx(z, rel=0.03)
        steps = [[state(E, q + way * 1e-3 * np.eye(3)[j])[:2] for way in (1, -1)] for j in range(3)]
        K, J = (np.stack([(a[i] - b[i]) / (2e-3 * design.D) for a, b in steps], axis=1) for i in (0, 1))
        J = noise[:, None] * (free @ (J / noise[:, None]))
        sigma = force_resolution(J[None], K[None], noise)[0]
        # the readings of a warmer sensor are 0.2 % per K smaller, and so is what they are decoded to
        by_reading = K @ np.linalg.pinv(J / noise[:, None])
        change = np.abs(by_reading @ (2e-3 * reading / noise))
        figures = {"resolution_z": sigma[2], "resolution_x": max(sigma[:2]), "strain": strain}
        figures["drift"] = max(change / [1.5, 1.5, 5.0])
        figures["ambient"] = np.linalg.norm(by_reading @ within, 2)
        # the magnet rises by what the silicone below it expands, and the silicone is stiffer
        lifted = state(E, q, lift=0.01)[1] - state(E, q, lift=-0.01)[1]
        rise = 3e-4 * (design.L - design.D / 2) / 0.02
        figures["warming"] = np.linalg.norm(
            change + np.abs(force) / 293.15 + rise * np.abs(by_reading @ (lifted / noise))
        )
        for name, value in figures.items():
            worst[name] = max(worst[name], value)
    for name, value in worst.items():
        assert result.values[name][0] == pytest.approx(value, rel=0.04, abs=1e-9 if rejects else 0), name


def test_sensors_of_one_and_of_three_chips_are_rated_together_as_alone():
    one, three = made(part="TMAG5273A1"), made(part="TMAG5273A1", chips=3)
    together = reached(joined([one, three])).values
    # one chip is rated in half of the directions if it is alone: its other half mirrors that
    for k, alone in enumerate(map(reached, (one, three))):
        for name, value in alone.values.items():
            assert together[name][k] == pytest.approx(value[0], rel=1e-9, nan_ok=True), name
    assert together["resolution_z"][1] < together["resolution_z"][0]


def test_readings_saturate_at_the_largest_remanence():
    sensors = sensors_of(made())
    low, high = sensors.remanence[0]
    assert low < high
    found = [
        performance(dataclasses.replace(sensors, remanence=np.array([ends])), sensors.beams(), NEEDED)
        for ends in ((low, high), (high, high), (low, low))
    ]
    both, strong, weak = (float(one.values["saturation"][0]) for one in found)
    assert both == strong < weak
    # a distance from the rail falls with the field in proportion
    assert (1 - strong) / (1 - weak) == pytest.approx(high / low, rel=1e-9)


def test_similar_forces_give_similar_poses():
    """Twice the modulus under twice the force is the same deformation."""
    sensors = sensors_of(made())
    stiff = dataclasses.replace(sensors, E_low=2 * sensors.E_low, E_high=2 * sensors.E_high)
    double = dataclasses.replace(NEEDED, force_z=10.0, force_x=3.0)
    a, b = (performance(each, each.beams(), needed).values for each, needed in ((sensors, NEEDED), (stiff, double)))
    for name, factor in (("depth", 1), ("strain", 1), ("saturation", 1), ("resolution_z", 2), ("range_z", 2)):
        assert b[name] == pytest.approx(factor * a[name], rel=1e-6), name
    assert b["first_mode"] == pytest.approx(np.sqrt(2) * a["first_mode"])


def test_a_load_is_met_although_a_small_shear_raises_the_force_of_its_press():
    needed = Requirements(force_z=6.0, force_x=2.0, largest_strain=1.0, outer_size=25.0, outer_shape="square")
    one = made(13.3, 11.0, "10x3 N42", "Mold Star 30", places=(9.8, 1.1, -1.4))
    sparse, dense = (reached(one, needed, dense=dense).values["range_z"][0] for dense in (False, True))
    assert sparse == pytest.approx(dense, rel=0.01)


def test_no_response_is_extrapolated():
    """Beyond the last depth and the last shear there is no state, and a force without one is not reached."""
    one = made()
    far = reached(one, dataclasses.replace(NEEDED, force_z=500.0))
    assert far.margins["force_z"][0] == pytest.approx(far.values["reach"][0] - 1)
    assert far.margins["largest_strain"][0] == LEAST
    aside = dataclasses.replace(NEEDED, force_x=4.9, friction=1.0)
    sideways = reached(made(L=14.0), aside)
    assert np.isnan([sideways.values[name][0] for name in ("strain", "range_z")]).all()
    assert sideways.margins["force_x"][0] < 0


def test_the_range_ends_where_the_strain_reaches_its_bound_and_its_cap_is_an_option():
    one = made()
    free = dataclasses.replace(NEEDED, largest_strain=0.6, no_saturation=False, resolution_z=None, first_mode=None)
    end = reached(one, free, caution=0.0).values
    factor = end["range_z"][0] / 5.0
    assert factor > 1
    more = dataclasses.replace(free, force_z=5.0 * factor, force_x=1.5 * factor)
    assert reached(one, more, caution=0.0).values["strain"][0] == pytest.approx(0.6, rel=5e-3)
    capped = reached(one, dataclasses.replace(free, range_cap=1.2), caution=0.0).values
    assert capped["range_z"][0] == pytest.approx(min(1.2, factor) * 5.0, rel=2e-3)


def test_drift_is_the_change_of_decoded_forces_that_a_gain_causes():
    """The drift of the gain adds to the magnet's by its sign; an unknown one misses."""
    sensors = sensors_of(made(part="TMAG5170A1"))
    strict = dataclasses.replace(NEEDED, drift_per_K=0.02)
    known, more, less, unknown = (
        performance(one, one.beams(), strict)
        for one in (sensors, *(dataclasses.replace(sensors, drift=np.array([d])) for d in (-4.4e-4, 1.2e-3, np.nan)))
    )
    assert more.values["drift"] == pytest.approx(known.values["drift"] * (12 + 4.4) / (12 + 2.2))
    # the magnet loses 0.09 to 0.12 % per K, and this gain rises by 0.12 %
    assert less.values["drift"] == pytest.approx(known.values["drift"] * (12 - 9) / (12 + 2.2))
    assert unknown.margins["drift_per_K"] == LEAST


def test_hysteresis_is_that_of_the_largest_loss_factor_of_the_silicone():
    """0.7425 tan(delta) of a linear spring, times 1.15; an unknown one, or one of other frequencies, misses."""
    needed = dataclasses.replace(NEEDED, force_z=0.5, force_x=None, hysteresis=0.13, speed=1.0)
    soft = made(silicone="Ecoflex 00-30")
    assert reached(soft, needed).values["hysteresis"] == pytest.approx(1.15 * 0.7425 * 0.148, rel=1e-3)
    assert reached(soft, needed).margins["hysteresis"] > 0
    for one, speed in ((made(), 1.0), (soft, 500.0), (soft, 1e-3)):
        assert reached(one, dataclasses.replace(needed, speed=speed)).margins["hysteresis"] == LEAST
    variant = soft.variant(0)
    assert variant.design.loss_factor == 0.061
    for chosen in (
        variant,
        dataclasses.replace(variant, design=dataclasses.replace(variant.design, loss_factor=0.05)),
    ):
        loss = sensors_of_variant(chosen, needed).loss[0].tolist()
        assert loss == ([0.148, 0.1, 20.0] if chosen is variant else [0.05, 0.01, 1000.0])
    unknown = sensors_of_variant(made().variant(0), needed).loss
    assert np.isnan(unknown).all()


class Changed:
    """Beams whose answers are changed."""

    def __init__(self, beams, **changes):
        self.beams, self.changes = beams, changes

    def __getattr__(self, name):
        return self.changes.get(name, getattr(self.beams, name))


def test_unknown_stability_is_not_met():
    sensors = sensors_of(made())
    beams = sensors.beams()
    for unknown in (np.nan, 0.05):
        result = performance(sensors, Changed(beams, stable_to=lambda _, x=unknown: np.array([x])), NEEDED)
        assert result.margins["force_z"][0] < 0
        assert result.margins["stability_margin"][0] < 0


def test_element_at_the_magnets_height_folds():
    """Where the magnet gets level with S2 and S3 their readings have a maximum, and det J changes its sign."""
    high, low = (
        reached(made(silicone="Dragon Skin 30", places=(1, 1, z))).values["decoding"][0] for z in (5.0, -1.8)
    )
    assert high < 0 < low


# Responses over a force range


DEEPEST = np.array([0.3, 0.2])
STIFFNESS = np.array([1.0, 3.0])
LOW, HIGH = np.array([0.04, 0.05]), np.array([0.25, 0.19])


class KnownBeams:
    """Beams with responses in closed form: powers of the root of the depth, and of the shear."""

    def states(self, depth, shear):
        k, root = STIFFNESS[:, None], np.sqrt(depth)
        force, shift, square = k * depth**1.5 * (1 + depth), 0.6 * depth, shear**2
        values = {
            "force_x": k * shear * (0.4 + 0.3 * root + 0.2 * square),
            "force_z": force - 0.1 * k * square * (root + square),
            "shift_x": shear * (0.7 - 0.2 * square),
            "shift_z": shift + square * 0.3 * root,
            "tilt": shear * (0.5 + root),
            "strain": 2 * root * np.exp(square),
        }
        return BeamStates({name: Quantity(value, 0.01 * value) for name, value in values.items()}, None)


@pytest.fixture(scope="module", params=[(0.5, 1.0), (0.2, 0.5, 0.8, 1.0)])
def curves(request):
    farthest = np.full((2, 5), 0.3)
    return with_shears(pressed_curves(KnownBeams(), DEEPEST), KnownBeams(), LOW, HIGH, farthest, request.param)


DEPTH, SHEAR = np.array([[0.06, 0.2], [0.07, 0.13]]), np.array([[0.05, 0.15], [0.02, 0.12]])


def test_between_depths_and_shears(curves):
    values, slopes, along = curves.sheared(DEPTH, SHEAR)
    step = 1e-6
    for k, name in enumerate(("shift_x", "shift_z", "tilt", "force_x", "force_z", "strain")):
        exact = KnownBeams().states(DEPTH, SHEAR).quantities[name].value
        assert values[..., k] == pytest.approx(exact, rel=2e-3), name
        for way, slope in ((0, slopes), (1, along)):
            if name == "strain":
                continue
            moved = [curves.sheared(DEPTH + s * (1 - way), SHEAR + s * way)[0][..., k] for s in (step, -step)]
            assert slope[..., k] == pytest.approx((moved[0] - moved[1]) / (2 * step), rel=1e-4, abs=1e-7), name


def test_a_state_has_both_forces(curves):
    exact = KnownBeams().states(DEPTH, SHEAR).quantities
    state = curves.states(exact["force_z"].value, exact["force_x"].value)
    assert state.depth == pytest.approx(DEPTH, rel=2e-3)
    assert state.shear == pytest.approx(SHEAR, rel=5e-3)
    assert state.strain == pytest.approx(exact["strain"].value, rel=5e-3)
    assert state.plane[..., 3] == pytest.approx(exact["force_x"].value, rel=1e-4)


def test_a_press_alone_is_the_press(curves):
    force = KnownBeams().states(DEPTH, np.zeros_like(DEPTH)).quantities["force_z"].value
    state = curves.states(force, np.zeros_like(force))
    assert state.depth == pytest.approx(DEPTH, rel=1e-3)
    assert state.strain == pytest.approx(2 * np.sqrt(DEPTH), rel=2e-3)
    assert (state.shear == 0).all()


# The search


SEARCHED = Requirements(
    force_z=5.0,
    force_x=1.5,
    outer_size=30.0,
    D_low=8.0,
    D_high=12.0,
    magnets=("5x3 N45", "4x4 N45"),
    silicones=("Smooth-Sil 940", "Dragon Skin 30"),
    hall_parts=("DRV5055A2", "TLE493D-P2B6"),
)
SEARCHED_PARTS = catalogues_of(SEARCHED)
BRIEF = Effort(48, 8)


@pytest.fixture(scope="module")
def found():
    return searched(SEARCHED, SEARCHED_PARTS, BRIEF)


def test_ends_of_a_front_are_chosen_first():
    F = np.column_stack([np.linspace(0, 1, 11), np.linspace(1, 0, 11) ** 2])
    assert spread(F, 2).tolist() == [0, 10]
    assert spread(F, 11).tolist() == list(range(11))
    assert {0, 10} <= set(spread(F, 5).tolist())


def test_points_of_one_box_are_one_and_none_dominates_another():
    F = np.random.default_rng(0).random((500, 3))
    kept = front_of(F)
    assert not dominated(F[kept]).any()
    # a point within the resolution of another one is left out
    assert len(front_of(np.vstack([F, F[kept] + 1e-6]))) == len(kept)


def test_variants_of_a_front_meet_the_requirements(found):
    front, _ = whole_front(found)
    assert len(front) > 5
    sensors = sensors_of(front)
    result = performance(sensors, sensors.beams(), SEARCHED)
    assert all((margin >= 0).all() for margin in result.margins.values())


def test_a_random_search_of_ten_times_the_evaluations_finds_nothing_better():
    """Neither is a random candidate beyond the best by more than 2 %, nor does one extend an end by more."""
    needed = dataclasses.replace(SEARCHED, hall_parts=("TLE493D-P2B6",), magnets=("4x4 N45",))
    row = held(("", "", needed), 6_000, Effort(64, 10))
    assert row["passed"], row
    assert row["drawn_that_meet"] > 50
    # a search that is too short is found out
    assert not held(("", "", needed), 2_000, Effort(8, 1))["passed"]


def test_a_tighter_requirement_gives_no_longer_front(found):
    _, F = whole_front(found)
    tight = dataclasses.replace(SEARCHED, outer_size=float(np.exp(F[:, 2]).min()) - 0.3)
    pools = searched(tight, SEARCHED_PARTS, BRIEF)
    assert not any((pool.violation == 0).any() for pool in pools)
