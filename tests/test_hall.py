"""Elements, poses and readings: signs, rotations, the paper's offset, rails, bad input."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from analytic.hall import FIELDS, batch_readings, elements, field_at, readings
from analytic.magnet import cylinder_field
from analytic.parts import CHIPS, Element, of_design
from geometry.design import BadInput, Design, paper
from geometry.loads import Response

RNG = np.random.default_rng(495)


def test_paper_offset_of_s1():
    read = readings(paper())
    assert abs(read.V[0] - 2.87) < 0.01
    assert_allclose(read.V, 2.5 + 31.25 * np.array(read.B_T), rtol=1e-14)
    assert read.saturated == (False, False, False)


def test_positions_are_signed_and_directions_are_units():
    positions, directions = elements(paper())
    assert_allclose(positions, [[0, 0, -2.2], [5, 0, -0.2], [0, 5, -0.2]], atol=1e-14)
    assert_allclose(directions, [[0, 0, -1], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize("field", FIELDS)
def test_a_reversed_magnet_mirrors_the_outputs_at_the_null_voltage(field):
    down, up = (
        readings(Design(magnet_north=north, hall_null=2.3), shift=(0.4, -0.2, -1), tilt=(0.05, 0.1), field=field)
        for north in ("down", "up")
    )
    assert [-b for b in up.B_T] == list(down.B_T)
    assert_allclose(up.V, 2 * 2.3 - np.array(down.V), rtol=1e-15)


def test_the_field_of_a_moved_magnet_is_its_own_carried_along():
    """Turned about its centre by the rotation vector, then shifted, against SciPy; one pose for each point."""
    p, shifts, tilts = RNG.normal(size=(50, 3)) * 5, RNG.normal(size=(50, 3)), RNG.normal(size=(50, 2))
    tilts[:3] = [(0, 0), (0, 1e-9), (math.pi, 0)]
    turn = Rotation.from_rotvec(np.column_stack([tilts, np.zeros(50)]))
    own = cylinder_field(turn.inv().apply(p - shifts - [0, 0, 5]), 2, 2, -1.2)
    assert_allclose(field_at(p, paper(), shifts, tilts), turn.apply(own), rtol=1e-11, atol=1e-13)


def test_response_and_pose_agree():
    response = Response((1, 0, 5), (0.5, 0.1, -0.8), 0.07, 2.0)
    assert readings(paper(), response) == readings(paper(), shift=(0.5, 0.1, -0.8), tilt=(0, 0.07))
    assert readings(paper(), response) != readings(paper(), shift=(0.5, 0.1, -0.8))


def test_magnitude_and_the_papers_quadrature():
    pose = {"shift": (0.5, -0.3, -1.0), "tilt": (0.05, 0.1)}
    b = field_at(elements(paper())[0], paper(), **pose)
    assert_allclose(readings(paper(), **pose, mode="magnitude").B_T, np.linalg.norm(b, axis=1), rtol=1e-14)
    for mode in ("component", "magnitude"):
        exact, quadrature = (readings(paper(), **pose, mode=mode, field=field).B_T for field in ("exact", "paper"))
        assert_allclose(quadrature, exact, rtol=1e-11)


def test_outputs_stop_at_the_rails():
    near = Design(magnet_height=4, l0=5)
    assert readings(near).saturated == (True, False, False)
    assert readings(near).V[0] == 4.8
    assert abs(readings(near).B_T[0] - 77.684e-3) < 1e-6
    backwards = dataclasses.replace(near, hall_null=0.3, hall_low=0.25)
    assert readings(backwards, shift=(-4, 0, -3)).V[0] <= 4.8
    over = readings(near, shift=(0, 0, 0), tilt=(0, math.pi))
    assert over.V[0] == 0.2
    assert over.saturated[0]


def test_chip_reads_the_whole_vector_where_s1_is():
    chip = dataclasses.replace(paper(), hall_layout="tmag5273a1")
    pose = {"shift": (0.4, -0.2, -0.7), "tilt": (0.1, 0.02)}
    read = readings(chip, **pose)
    (b,) = field_at(elements(paper())[0][:1], chip, **pose)
    assert_allclose(read.B_T, [-b[2], b[0], b[1]], rtol=1e-14)
    assert read.units == ("T", "T", "T")
    assert np.isnan(read.V).all()
    step = CHIPS["tmag5273a1"].step
    assert_allclose(read.output, np.round(np.array(read.B_T) / step) * step, rtol=1e-12)
    near = readings(dataclasses.replace(chip, magnet_height=4.0, l0=4.5))
    assert near.saturated == (True, False, False)
    assert near.output[0] == 0.08


def test_chips_on_a_circle_read_alike_where_the_magnet_is_turned_from_one_to_the_next():
    three = dataclasses.replace(paper(), hall_layout="tmag5273a1", chip_count=3, chip_x=3.0, l0=7.5)
    places, _ = elements(three)
    assert_allclose(np.linalg.norm(places[:, :2], axis=1), 3.0, rtol=1e-14)
    turn = np.array([[-0.5, -math.sqrt(0.75)], [math.sqrt(0.75), -0.5]])
    shift, tilt = np.array([0.4, -0.2]), np.array([0.1, 0.02])
    first = np.reshape(readings(three, shift=(*shift, -0.7), tilt=tuple(tilt)).B_T, (3, 3))
    turned = np.reshape(readings(three, shift=(*(turn @ shift), -0.7), tilt=tuple(turn @ tilt)).B_T, (3, 3))
    assert_allclose(turned[[1, 2, 0], 0], first[:, 0], rtol=1e-12)
    assert_allclose(turned[[1, 2, 0], 1:], first[:, 1:] @ turn.T, rtol=1e-11)


def test_any_elements():
    """One that looks along the field, at the place of S1, on its own scale."""
    b = field_at(elements(paper())[0], paper())[0]
    along = Element("A", (0, 0, -2.2), tuple(b / np.linalg.norm(b)), gain=10, null=1, low=-5, high=5)
    back = dataclasses.replace(along, name="B", direction=tuple(-b / np.linalg.norm(b)))
    read = readings(paper(), elements=[along, back])
    assert_allclose(read.output, [1 + 10 * np.linalg.norm(b), 1 - 10 * np.linalg.norm(b)], rtol=1e-12)


def test_ambient_field_adds():
    rest, moved = (readings(paper(), ambient=(3e-3 * k, -1e-3 * k, 2e-3 * k)).B_T for k in (0, 1))
    assert_allclose(np.subtract(moved, rest), [-2e-3, 3e-3, -1e-3], rtol=1e-12)


@pytest.mark.parametrize("field", ["exact", "dipole"])
def test_plate_averages_over_its_area(field):
    """Against 20 x 20 Gauss points; the error of 2 x 2 falls with the fourth power of the side."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    errors = []
    for side in (1.0, 0.5):
        design = dataclasses.replace(paper(), hall_plate=side)
        i, j = np.meshgrid(nodes * side / 2, nodes * side / 2)
        weight = np.outer(weights, weights).ravel() / 4
        s2 = field_at(np.column_stack([5 + 0 * i.ravel(), i.ravel(), j.ravel() - 0.2]), paper(), field=field)[:, 0]
        errors.append(abs(readings(design, field=field).B_T[1] - s2 @ weight))
    assert 12 < errors[0] / errors[1] < 20
    point = readings(paper(), field=field).B_T[1]
    assert errors[1] < 1e-2 * abs(readings(dataclasses.replace(paper(), hall_plate=0.5), field=field).B_T[1] - point)


def test_a_reading_averages_its_samples():
    """With a step far above the noise of an average: the spread about the true output is that of the elements."""
    design = Design(
        hall_noise_density=1e-4, hall_bandwidth=100.0, hall_step=1e-3, hall_average=16, hall_noise_floor=1e-4
    )
    rng, true = np.random.default_rng(3), np.array(readings(Design()).V)
    errors = [np.subtract(readings(design, noise=rng).V, true) for _ in range(1000)]
    expected = np.array([element.noise_T * element.gain for element in of_design(design)])
    assert_allclose(np.sqrt(np.square(errors).mean(axis=0)), expected, rtol=0.1)
    assert_allclose(expected, math.sqrt((1e-6 + 1e-6 / 12) / 16 + 1e-8), rtol=1e-3)


def test_levels_of_the_field():
    """The misprint spoils B_rho, which S2 and S3 read, and leaves S1 on the axis; a dipole is off everywhere."""
    exact, paper_s, printed, dipole = (np.array(readings(paper(), shift=(0, 0, -1), field=f).B_T) for f in FIELDS)
    assert np.abs(paper_s / exact - 1).max() < 1e-9
    assert_allclose(printed[0], exact[0], rtol=1e-12)
    assert (printed[1:] / exact[1:] > 1.3).all()
    assert 1e-3 < np.abs(dipole / exact - 1).min() < np.abs(dipole / exact - 1).max() < 0.2


BARE = Design(magnet_diameter=0, magnet_height=0)
MOVED = Response((0, 0, 0), (0, 0, 0), 0, 0)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: readings(BARE), "no magnet"),
        (lambda: readings(paper(), MOVED, shift=(1, 0, 0)), "not both"),
        (lambda: readings(paper(), mode="length"), "mode must be"),
        (lambda: readings(paper(), field="quadrupole"), "field must be"),
        (lambda: readings(paper(), ambient=(0, math.inf, 0)), "ambient must be finite"),
        (lambda: readings(paper(), shift=(math.nan, 0, 0)), "shift must be finite"),
        (lambda: readings(paper(), shift=(0, 0, -7.2), field="paper"), "outside the magnet only"),
        (lambda: field_at(np.zeros((4, 3)), paper(), tilt=(0, 0, 1)), "tilt must have shape"),
        (lambda: field_at([0, 0, 0], paper()), "points must have shape"),
        (lambda: Element("A", (0, 0, 0), (1, 1, 0), 10, 1, -5, 5), "must be a unit vector"),
        (lambda: Element("A", (0, 0, 0), (1, 0, 0), math.nan, 1, -5, 5), "finite"),
        (lambda: Element("A", (0, 0, 0), (1, 0, 0), 10, 9, -5, 5), "between low and high"),
        (lambda: Element("A", (0, 0, 0), (1, 0, 0), 10, 1, -5, 5, plate=-1), "0 or more"),
    ],
)
def test_poses_options_and_elements_that_mean_nothing_are_refused(call, text):
    with pytest.raises(BadInput, match=text):
        call()


# Readings of many rows at once: those of single calls, and none where these refuse.


MIXED = [
    paper(),
    Design(magnet_north="up", c=3.0, f=6.0, E=2.0),
    Design(hall_plate=0.3, l0=6.5, remanence=0.6, hall_step=0.0049),
    Design(hall_layout="tmag5273a1", chip_x=2.0, hall_plate=0.3),
    Design(hall_layout="tle493d-p2b6", chip_x=3.0, chip_count=3, l0=7.5),
    Design(magnet_height=4.0, l0=5.5, hall_gain=90.0, hall_low=1.0, hall_high=3.0),
]


def single(design, shift, tilt):
    """Field, output and saturation of one row."""
    try:
        reading = readings(design, shift=tuple(shift), tilt=tuple(tilt))
    except BadInput:
        return [math.nan], [math.nan], [False]
    return reading.B_T, reading.output, reading.saturated


def assert_singles(designs, owner, shift, tilt):
    batch = batch_readings(designs, owner, shift, tilt)
    each = [single(designs[k], s, t) for k, s, t in zip(owner, shift, tilt, strict=True)]
    # designs with fewer elements than others have no more readings
    field, output = (np.full(batch.output.shape, np.nan) for _ in range(2))
    saturated = np.zeros(batch.output.shape, dtype=bool)
    for k, (b, out, over) in enumerate(each):
        field[k, : len(b)], output[k, : len(b)], saturated[k, : len(b)] = b, out, over
    # a component that is small beside |B| has fewer correct digits
    assert_allclose(batch.field_T, field, rtol=1e-13, atol=2e-15)
    assert_allclose(batch.output, output, rtol=1e-13, atol=1e-13)
    assert_array_equal(batch.saturated, saturated)
    return batch


def poses(count):
    return RNG.uniform([-1, -1, -2], [1, 1, 0.2], (count, 3)), RNG.uniform(-0.3, 0.3, (count, 2))


def test_rows_are_single_readings():
    batch = assert_singles(MIXED, RNG.integers(0, len(MIXED), 300), *poses(300))
    assert batch.saturated.any()
    assert not batch.saturated.all()


def test_no_pose_and_no_magnet():
    bare = dataclasses.replace(paper(), magnet_diameter=0.0, magnet_height=0.0)
    shift, tilt = np.zeros((5, 3)), np.zeros((5, 2))
    shift[1, 0], tilt[2, 1], shift[3, 2] = math.nan, math.nan, math.inf
    batch = assert_singles([paper(), bare], np.array([0, 0, 0, 0, 1]), shift, tilt)
    assert_array_equal(np.isnan(batch.output).all(axis=1), [False, True, True, True, True])
    assert batch_readings([], np.zeros(0, dtype=np.int64), shift[:0], tilt[:0]).output.shape == (0, 3)


@pytest.mark.parametrize("plate", [0.0, 0.4])
def test_an_element_on_the_rim_has_no_reading(plate):
    # at rest S2 lies 0.5 mm above the magnet's lower rim; without a plate the shift moves it onto the rim
    design = Design(l0=2.0, c=1.5, f=2.5, magnet_diameter=4.0, magnet_height=2.0, hall_plate=plate)
    shift = np.array([[0.0, 0, 0], [0.5, 0, 0.5], [0.5, 0, 0.6]])
    batch = assert_singles([design], np.zeros(3, dtype=np.int64), shift, np.zeros((3, 2)))
    assert_array_equal(np.isnan(batch.field_T).all(axis=1), [False, plate == 0, False])
