"""Readings one at a time give what the decoder gives for all of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam, decode, stream
from analytic.inverse import forward_model, response_surface
from geometry.design import BadInput, Design, paper

TAU = np.array([[0.1, 0.01], [0.002, 0.001]])


def coder_of(design, tau):
    law = response_surface.of_formula(lambda load: beam.solve(design, load), 4.0, 5.0)
    return decode.decoder(
        design, response_surface.Mechanics(tau, law.lateral, law.normal, law.depth, law.shear, 3, 2, law.errors)
    )


@pytest.mark.parametrize(
    ("design", "tau"),
    [
        (paper(), TAU),
        (paper(), forward_model.NO_TILT),
        (Design(l0=6.0, c=2.5), TAU),
        (Design(hall_layout="tmag5273a1"), TAU),
        (Design(hall_plate=0.5), TAU),
        (Design(magnet_north="up"), TAU),
    ],
    ids=["paper", "no tilt", "folded", "chip", "plates", "north up"],
)
def test_stream_is_the_decoder(design, tau):
    coder = coder_of(design, tau)
    t = np.linspace(0, 3, 60)
    path = np.stack([2.5 * np.cos(t), 2.5 * np.sin(1.3 * t), -1 - 0.8 * np.sin(2 * t)])
    path[:, 0] = [0, 0, 0]
    field = forward_model.readings_with_slopes(coder.forward, path)[0].T
    field[7], field[11], field[13] = 1.0, np.nan, 0.0
    expected = decode.decode(coder, field, follow=True)
    follower = stream.Stream(coder)
    found = [follower.step(tuple(row)) for row in field.tolist()]
    assert [sample.status for sample in found] == expected.status
    assert [sample.multiplicity for sample in found] == expected.multiplicity.tolist()
    for name in ("shift", "tilt", "force"):
        assert_allclose([getattr(sample, name) for sample in found], getattr(expected, name), atol=2e-8)


def test_bad_shape_is_a_sentence():
    with pytest.raises(BadInput, match="readings must have shape"):
        stream.Stream(coder_of(paper(), TAU)).step((0.01, 0.01))
