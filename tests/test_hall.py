"""Elements, poses and readings: signs, rotations, the paper's offset, rails, bad input."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic.hall import FIELDS, elements, field_at, readings
from analytic.magnet import cylinder_field
from analytic.parts import CHIPS, Element, of_design
from geometry.design import BadInput, Design, paper
from geometry.loads import Response

RNG = np.random.default_rng(495)


def turn_y(angle):
    """z towards x."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def turn_x(angle):
    """y towards z."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_paper_offset_of_s1():
    read = readings(paper())
    assert abs(read.V[0] - 2.87) < 0.01
    assert_allclose(read.V, 2.5 + 31.25 * np.array(read.B_T), rtol=1e-14)
    assert read.saturated == (False, False, False)


def test_positions_are_signed_and_directions_are_units():
    positions, directions = elements(paper())
    assert_allclose(positions, [[0, 0, -2.2], [5, 0, -0.2], [0, 5, -0.2]], atol=1e-14)
    assert_allclose(directions, [[0, 0, -1], [1, 0, 0], [0, 1, 0]])


def test_field_at_rest_is_the_magnets_own_with_its_north_down():
    p = RNG.normal(size=(50, 3)) * 5
    expected = cylinder_field(p - [0, 0, 5], 2, 2, -1.2)
    assert_allclose(field_at(p, paper()), expected, rtol=1e-12, atol=1e-16)


@pytest.mark.parametrize("field", FIELDS)
def test_a_reversed_magnet_mirrors_the_outputs_at_the_null_voltage(field):
    down, up = (
        readings(Design(magnet_north=north, hall_null=2.3), shift=(0.4, -0.2, -1), tilt=(0.05, 0.1), field=field)
        for north in ("down", "up")
    )
    assert [-b for b in up.B_T] == list(down.B_T)
    assert_allclose(up.V, 2 * 2.3 - np.array(down.V), rtol=1e-15)


def test_signs():
    rest = readings(paper()).B_T
    assert min(rest) > 0
    pressed = readings(paper(), shift=(0, 0, -1)).B_T
    assert pressed[0] > rest[0]
    for step in (0.5, 1.0, 2.0):
        right = readings(paper(), shift=(step, 0, 0)).B_T
        back = readings(paper(), shift=(0, step, 0)).B_T
        assert right[1] > rest[1] > right[2]
        assert_allclose(back, [right[0], right[2], right[1]], rtol=1e-13)
        assert readings(paper(), shift=(-step, 0, 0)).B_T[1] < rest[1]


def test_s2_folds_where_the_docstring_says():
    x = np.linspace(0, 4, 401)
    s2 = np.tile(elements(paper())[0][1], (401, 1))
    for sunk, peak in ((0, 2.1), (1, 2.5), (2, 2.9), (3, 3.1)):
        b = field_at(s2, paper(), np.column_stack([x, 0 * x, 0 * x - sunk]))[:, 0]
        assert abs(x[b.argmax()] - peak) < 0.06


def test_tilt_turns_the_field_the_right_way():
    """Far below, against a dipole: z tilted towards x swings the north pole to -x; z tilted towards -y, to +y."""
    far = np.array([[3.0, -7.0, -400.0]])
    r = (far - [0, 0, 5])[0]
    for tilt, north in (
        ((0, 0.1), (-math.sin(0.1), 0, -math.cos(0.1))),
        ((0.1, 0), (0, math.sin(0.1), -math.cos(0.1))),
    ):
        m = 1.2 * 2**2 * 2 / 4 * np.array(north)
        d = np.linalg.norm(r)
        assert_allclose(field_at(far, paper(), tilt=tilt)[0], 3 * r * (r @ m) / d**5 - m / d**3, rtol=1e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, -2.0, math.pi])
def test_magnet_and_sensor_turned_together(angle):
    p = RNG.normal(size=(30, 3)) * 5
    centre = np.array([0, 0, 5])
    for turn, tilt in ((turn_y(angle), (0, angle)), (turn_x(angle), (angle, 0))):
        turned = field_at(centre + (p - centre) @ turn.T, paper(), tilt=tilt)
        assert_allclose(turned, field_at(p, paper()) @ turn.T, rtol=1e-11, atol=1e-13)


def test_rotation_vector_about_a_slanted_axis():
    """The tilt (r/sqrt 2, r/sqrt 2) is that about y, seen from a frame turned by 45 degrees about z."""
    c = math.sqrt(0.5)
    turn = np.array([[c, c, 0], [-c, c, 0], [0, 0, 1]])
    p = RNG.normal(size=(30, 3)) * 5
    slanted = field_at(p @ turn.T, paper(), tilt=(0.4 * c, 0.4 * c))
    assert_allclose(slanted, field_at(p, paper(), tilt=(0, 0.4)) @ turn.T, rtol=1e-11, atol=1e-13)


def test_moving_the_magnet_is_moving_the_sensor():
    p, shift = RNG.normal(size=(30, 3)) * 5, np.array([0.4, -0.7, -1.1])
    assert_allclose(
        field_at(p + shift, paper(), shift, (0.1, 0.2)), field_at(p, paper(), tilt=(0.1, 0.2)), rtol=1e-11, atol=1e-15
    )


def test_one_pose_per_point():
    p = RNG.normal(size=(5, 3)) * 5
    shifts, tilts = RNG.normal(size=(5, 3)), RNG.normal(size=(5, 2))
    each = [field_at(p[i : i + 1], paper(), shifts[i], tilts[i])[0] for i in range(5)]
    assert_allclose(field_at(p, paper(), shifts, tilts), each, rtol=1e-12)


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
    chip, pose = (
        dataclasses.replace(paper(), hall_layout="tmag5273a1"),
        {"shift": (0.4, -0.2, -0.7), "tilt": (0.1, 0.02)},
    )
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
    for change, text in (
        ({"direction": (1, 1, 0)}, "must be a unit vector"),
        ({"gain": math.nan}, "finite"),
        ({"null": 9}, "between low and high"),
        ({"plate": -1}, "0 or more"),
    ):
        with pytest.raises(BadInput, match=text):
            dataclasses.replace(along, **change)


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


def test_noise_has_its_size_and_only_on_request():
    loud = dataclasses.replace(paper(), hall_noise=0.01)
    assert readings(loud) == readings(paper())
    rng = np.random.default_rng(1)
    spread = np.std([np.subtract(readings(loud, noise=rng).V, readings(paper()).V) for _ in range(200)], axis=0)
    assert_allclose(spread, 0.01, rtol=0.2)


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


def test_elements_may_average_different_numbers_of_samples():
    plain, *others = of_design(Design(hall_noise=0.01))
    mixed = [plain, dataclasses.replace(others[0], average=100), others[1]]
    rng = np.random.default_rng(4)
    spread = np.std([readings(paper(), elements=mixed, noise=rng).V for _ in range(500)], axis=0)
    assert_allclose(spread, [0.01, 0.001, 0.01], rtol=0.15)


def test_levels_of_the_field():
    """The misprint spoils B_rho, which S2 and S3 read, and leaves S1 on the axis; a dipole is off everywhere."""
    exact, paper_s, printed, dipole = (np.array(readings(paper(), shift=(0, 0, -1), field=f).B_T) for f in FIELDS)
    assert np.abs(paper_s / exact - 1).max() < 1e-9
    assert_allclose(printed[0], exact[0], rtol=1e-12)
    assert (printed[1:] / exact[1:] > 1.3).all()
    assert 1e-3 < np.abs(dipole / exact - 1).min() < np.abs(dipole / exact - 1).max() < 0.2


def test_bad_input():
    bare = Design(magnet_diameter=0, magnet_height=0)
    with pytest.raises(BadInput, match="no magnet"):
        readings(bare)
    with pytest.raises(BadInput, match="not both"):
        readings(paper(), Response((0, 0, 0), (0, 0, 0), 0, 0), shift=(1, 0, 0))
    with pytest.raises(BadInput, match="mode must be"):
        readings(paper(), mode="length")
    with pytest.raises(BadInput, match="field must be"):
        readings(paper(), field="quadrupole")
    with pytest.raises(BadInput, match="ambient must be finite"):
        readings(paper(), ambient=(0, math.inf, 0))
    with pytest.raises(BadInput, match="shift must be finite"):
        readings(paper(), shift=(math.nan, 0, 0))
    with pytest.raises(BadInput, match="tilt must have shape"):
        field_at(np.zeros((4, 3)), paper(), tilt=(0, 0, 1))
    with pytest.raises(BadInput, match="points must have shape"):
        field_at([0, 0, 0], paper())
    with pytest.raises(BadInput, match="outside the magnet only"):
        readings(paper(), shift=(0, 0, -7.2), field="paper")
