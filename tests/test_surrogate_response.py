"""The surrogate's response to one load: units, direction, refusals."""

from dataclasses import replace

import pytest

from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics.surrogate_response import respond

STICK = Load(depth=1.0, shear_x=1.5, friction="stick")


def test_forces_scale_with_E_and_lengths_with_D():
    small = respond(paper(), STICK)
    big = Design(D=16, L=18, magnet_diameter=8, magnet_height=4, magnet_edge_radius=0.2, l0=14.4, E=3.0, f=9)
    large = respond(big, Load(depth=2.0, shear_x=3.0, friction="stick"))
    assert large.response.force == pytest.approx([12 * part for part in small.response.force])
    assert large.response.shift == pytest.approx([2 * part for part in small.response.shift])
    assert large.response.tilt == pytest.approx(small.response.tilt)
    assert (large.strain, large.errors["force"]) == pytest.approx((small.strain, small.errors["force"]))


def test_a_shear_in_another_direction_is_turned():
    along = respond(paper(), STICK).response
    turned = respond(paper(), Load(depth=1.0, shear_x=-0.9, shear_y=1.2, friction="stick")).response
    assert turned.force == pytest.approx((-0.6 * along.force[0], 0.8 * along.force[0], along.force[2]))
    assert turned.shift == pytest.approx((-0.6 * along.shift[0], 0.8 * along.shift[0], along.shift[2]))
    assert (turned.tilt, turned.tilt_y) == pytest.approx((-0.6 * along.tilt, 0.8 * along.tilt))


def test_a_frictionless_plate_that_moves_sideways_is_a_press():
    assert respond(paper(), Load(depth=1.0, shear_x=1.0)) == respond(paper(), Load(depth=1.0))


@pytest.mark.parametrize(
    ("design", "load", "reason"),
    [
        (paper(), Load(depth=0.05), "depths of 0.08 to 2.8 mm here; got 0.05 mm"),
        (paper(), Load(depth=2.9), "depths of 0.08 to 2.8 mm"),
        (paper(), Load(depth=1.0, shear_x=3.1, friction="stick"), "shears to 3 mm here; got 3.1 mm"),
        (paper(), Load(depth=1.0, shear_x=1.0, friction=0.5), "does not know Coulomb friction"),
        (paper(), Load(shear_x=0.5, grip=1.0), "does not know grips"),
        (paper(), Load(depth=0.5, plate_tilt=0.1), "does not know tilted plates"),
        (paper(), Load(depth=0.5, imperfection=0.001), "does not know imperfections"),
        (replace(paper(), law="ogden"), Load(depth=0.5), "law neo-hookean only; got ogden"),
        (replace(paper(), nu=0.4), Load(depth=0.5), "nu within 0.45 and 0.5; got 0.4"),
        (
            replace(paper(), L=30.0, l0=28.2),
            Load(depth=2.0, shear_x=1, friction="stick"),
            "a press to stay stable to",
        ),
        (replace(paper(), L=30.0, l0=28.2), Load(depth=2.0), "mm here, and nothing deeper; got 2 mm: take finite"),
    ],
)
def test_what_it_does_not_know_is_refused_in_a_sentence(design, load, reason):
    with pytest.raises(BadInput, match=reason):
        respond(design, load)


def test_a_design_without_a_magnet_is_refused():
    with pytest.raises(BadInput, match="rigid magnet only"):
        respond(replace(paper(), magnet_diameter=0.0, magnet_height=0.0), Load(depth=0.5), "ignored")
