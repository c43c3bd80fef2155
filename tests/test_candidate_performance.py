"""What candidates reach: held against the surrogate and readings one by one, known dependences, and the margins."""

import dataclasses

import numpy as np
import pytest

from analytic.force_resolution import force_resolution
from analytic.hall import batch_readings
from analytic.parts import of_design
from geometry.base import Base, outer_size, plan
from geometry.mold import Mold, sizes
from studies.sizing.candidate_performance import LEAST, performance
from studies.sizing.candidate_variables import Space, joined
from studies.sizing.catalogues import catalogues_of
from studies.sizing.requirements import Requirements
from studies.sizing.sensor_arrays import sensors_of
from studies.sizing.variant_search import sorted_parts

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


def narrow(sensors):
    """Sensors of one E, the middle of its range."""
    E = (sensors.E_low + sensors.E_high) / 2
    return dataclasses.replace(sensors, E_low=E, E_high=E)


@pytest.mark.parametrize("shape", ["round", "square"])
@pytest.mark.parametrize("process", ["fdm", "sla"])
def test_sizes_are_those_of_base_and_mould(shape, process):
    needed = Requirements(force_z=5.0, outer_shape=shape, process=process)
    space, random = Space(needed, CHIPS), np.random.default_rng(1)
    counts = [len(CHIPS.magnets), len(CHIPS.silicones), len(CHIPS.hall_parts)]
    drawn = space.candidates(random.integers(counts, size=(80, 3)), random.random((80, 5)))
    drawn, compared = drawn.take(drawn.outside() == ""), 0
    for k, said in enumerate(np.array(drawn.sizes()).T):
        variant = drawn.variant(k)
        if isinstance(variant, str):
            continue
        outline = plan(variant.design, Base(shape=shape), process)
        mould, (_, _, height) = sizes(variant.design, Mold(process=process)), outer_size(variant.design, outline)[0]
        wall = min(2 * mould.pin_radius, mould.wall, 1.2 if outline.seats.posts else np.inf)
        assert said == pytest.approx([2 * outline.half, height, wall], abs=1e-9)
        compared += 1
    assert compared > 50


@pytest.mark.parametrize(("part", "chips"), [("DRV5055A2", 1), ("TMAG5273A1", 1), ("TMAG5273A1", 3)])
def test_every_load_is_a_state_of_the_surrogate_and_its_figures_are_those_of_the_sensor(part, chips):
    """Depth and shear of each pose give the required forces, and slopes by differences give the resolution."""
    one = made(part=part, chips=chips)
    design, sensors = one.variant(0).design, sensors_of(one)
    beams = sensors.beams()
    ends = (sensors.E_low[0], sensors.E_high[0])
    noise = np.array([element.noise_T for element in of_design(design)])
    weak = dataclasses.replace(design, remanence=float(sensors.remanence[0, 0]))

    def state(E, q):
        """Force and readings at a depth and a shear (x, y), over D."""
        depth, size, way = q[0], np.hypot(q[1], q[2]), np.arctan2(q[2], q[1])
        s = {n: v.value[0, 0] for n, v in beams.shear(np.array([[depth]]), np.array([[size]])).items()}
        e = np.array([np.cos(way), np.sin(way)])
        force = E * design.D**2 * np.array([*(s["force_x"] * e), s["force_z"]])
        shift = design.D * np.array([*(s["shift_x"] * e), -s["shift_z"]])
        tilt = s["tilt"] * np.array([-e[1], e[0]])
        reading = batch_readings([weak], np.zeros(1, dtype=np.int64), shift[None], tilt[None]).field_T[0]
        return force, reading, s["strain"]

    result = performance(dataclasses.replace(sensors, drift=np.array([-8e-4])), beams, NEEDED, caution=0.0)
    worst = dict.fromkeys(("resolution_z", "resolution_x", "strain", "drift"), 0.0)
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
        sigma = force_resolution(J[None], K[None], noise)[0]
        # the readings of a warmer sensor are 0.2 % per K smaller, and so is what they are decoded to
        change = np.abs(K @ np.linalg.pinv(J) @ (2e-3 * reading)) / [1.5, 1.5, 5.0]
        figures = {"resolution_z": sigma[2], "resolution_x": max(sigma[:2]), "strain": strain, "drift": max(change)}
        for name, value in figures.items():
            worst[name] = max(worst[name], value)
    for name, value in worst.items():
        assert result.values[name][0] == pytest.approx(value, rel=0.04), name


def test_sensors_of_one_and_of_three_chips_are_rated_together_as_alone():
    one, three = made(part="TMAG5273A1"), made(part="TMAG5273A1", chips=3)
    together = reached(joined([one, three])).values
    # one chip is rated in half of the directions if it is alone: its other half mirrors that
    for k, alone in enumerate(map(reached, (one, three))):
        for name, value in alone.values.items():
            assert together[name][k] == pytest.approx(value[0], rel=1e-9, nan_ok=True), name
    assert together["resolution_z"][1] < together["resolution_z"][0]


def test_the_worst_pose_is_named():
    result = reached(made())
    at = result.worst["strain"][0]
    assert result.corner[at] == 0
    assert result.loads[0, at, :2] == pytest.approx([5.0, 1.5]) or result.loads[0, at, 1] == pytest.approx(1.5)


def test_similar_forces_give_similar_poses():
    """Twice the modulus under twice the force is the same deformation."""
    sensors = sensors_of(made())
    stiff = dataclasses.replace(sensors, E_low=2 * sensors.E_low, E_high=2 * sensors.E_high)
    double = dataclasses.replace(NEEDED, force_z=10.0, force_x=3.0)
    a, b = (performance(each, each.beams(), needed).values for each, needed in ((sensors, NEEDED), (stiff, double)))
    for name, factor in (("depth", 1), ("strain", 1), ("saturation", 1), ("resolution_z", 2), ("range_z", 2)):
        assert b[name] == pytest.approx(factor * a[name], rel=1e-6), name
    assert b["first_mode"] == pytest.approx(np.sqrt(2) * a["first_mode"])


def test_bounds_are_held_at_the_worse_end_of_the_modulus():
    sensors = sensors_of(made())
    middle = narrow(sensors)
    wide, one = (performance(each, each.beams(), NEEDED).values for each in (sensors, middle))
    for name, way in (("strain", 1), ("first_mode", -1), ("resolution_z", 1), ("saturation", -1), ("range_z", -1)):
        assert way * wide[name][0] > way * one[name][0], name


def test_resolution_is_proportional_to_the_noise_and_to_the_field():
    sensors = sensors_of(made())
    loud = dataclasses.replace(sensors, noise=3 * sensors.noise)
    weak = dataclasses.replace(sensors, remanence=sensors.remanence / 3)
    a, b, c = (performance(each, each.beams(), NEEDED).values for each in (sensors, loud, weak))
    assert b["resolution_x"] == pytest.approx(3 * a["resolution_x"])
    assert c["resolution_x"] == pytest.approx(3 * a["resolution_x"])
    assert b["distinct"] == pytest.approx(a["distinct"] / 3)
    assert 1 - c["saturation"] == pytest.approx((1 - a["saturation"]) / 3)


def test_shares_are_those_of_the_forces():
    one = made()
    half = dataclasses.replace(NEEDED, force_z=2.5, force_x=0.75)
    scaled = reached(dataclasses.replace(one, share=np.array([[0.5, 0.5]])), share=np.array([[0.5, 0.5]]))
    for name, value in reached(one, half).values.items():
        if name not in ("reach", "reach_x"):
            assert scaled.values[name] == pytest.approx(value, nan_ok=True), name


def test_half_widths_worsen_every_bound_that_mechanics_decide():
    nominal, worse = (reached(made(), caution=caution).values for caution in (0.0, 1.0))
    for name in ("resolution_z", "resolution_x", "strain", "depth"):
        assert worse[name][0] > nominal[name][0], name
    for name in ("range_z", "saturation", "first_mode"):
        assert worse[name][0] < nominal[name][0], name


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


def test_a_load_that_slips_does_not_count():
    """Under less friction the whole force along the plate needs a heavier press, whose contact is larger."""
    one = made()
    rough, smooth = (reached(one, dataclasses.replace(NEEDED, friction=mu)) for mu in (2.0, 0.4))
    assert (smooth.loads[0, :, 1] <= 0.4 * smooth.loads[0, :, 0] * (1 + 1e-9)).all()
    assert (
        rough.loads[0, :, 0][rough.loads[0, :, 1] > 0].min()
        < smooth.loads[0, :, 0][smooth.loads[0, :, 1] > 1.4].min()
    )


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
    """The drift of the gain adds to the magnet's by its sign; unknown ones and fast motions miss."""
    sensors = sensors_of(made(part="TMAG5170A1"))
    strict = dataclasses.replace(NEEDED, drift_per_K=0.02, hysteresis=0.09, speed=1.0)
    known, more, less, unknown = (
        performance(one, one.beams(), strict)
        for one in (sensors, *(dataclasses.replace(sensors, drift=np.array([d])) for d in (-4.4e-4, 1.2e-3, np.nan)))
    )
    assert more.values["drift"] == pytest.approx(known.values["drift"] * (12 + 4.4) / (12 + 2.2))
    # the magnet loses 0.09 to 0.12 % per K, and this gain rises by 0.12 %
    assert less.values["drift"] == pytest.approx(known.values["drift"] * (12 - 9) / (12 + 2.2))
    assert unknown.margins["drift_per_K"] == LEAST
    # the linear spring of the assumed loss factor has 7.2 %
    assert known.values["hysteresis"] == pytest.approx(1.15 * 0.0722, rel=0.03)
    assert known.margins["hysteresis"] > 0
    fast = dataclasses.replace(strict, speed=1e5)
    assert performance(sensors, sensors.beams(), fast).margins["hysteresis"] == LEAST


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


def test_unset_requirements_have_no_margin():
    free = Requirements(force_z=5.0, no_saturation=False, unique_decoding=False)
    assert set(reached(made(), free).margins) == {"force_z", "stability_margin", "wall", "clearance"}


def test_strong_field_saturates():
    result = reached(made(magnet="6x6 N52", L=12.0, part="DRV5055A1", places=(0, 0, 1.8)))
    assert result.margins["no_saturation"][0] < 0
    assert result.values["range_z"][0] == 0
    # a reading at its rail determines nothing
    assert np.isinf(result.values["resolution_x"][0])


def test_element_at_the_magnets_height_folds():
    """Where the magnet gets level with S2 and S3 their readings have a maximum, and det J changes its sign."""
    high, low = (
        reached(made(silicone="Dragon Skin 30", places=(1, 1, z))).values["decoding"][0] for z in (5.0, -1.8)
    )
    assert high < 0 < low
