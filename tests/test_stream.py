"""Readings one at a time give what the decoder gives for all of them."""

import dataclasses
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam, decode, stream
from analytic.inverse import forward_model, response_surface
from geometry.design import BadInput, Design, paper
from studies.inputs import user_input
from studies.sensing import decode_readings
from studies.sizing import candidate_variables
from studies.sizing.catalogues import catalogues_of
from studies.sizing.requirements import Requirements

TAU = np.array([[0.1, 0.01], [0.002, 0.001]]), 0.0, 1.0


def coder_of(design, tau):
    law = response_surface.of_formula(lambda load: beam.solve(design, load), 4.0, 5.0)
    return decode.decoder(design, dataclasses.replace(law, tau=tau[0], reach=3.0, sink=2.0, lean=tau[1:]))


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


def sized():
    """Ten designs of the catalogue: winners of `magtip size`, and candidates drawn at random, a Hall part each."""
    requirements = Requirements(force_z=5.0)
    catalogues = catalogues_of(requirements)
    space, draw = candidate_variables.Space(requirements, catalogues), np.random.default_rng(0)
    names = ("fingertip", "gripper_pad", "surgical_probe")
    designs = [user_input.read_design(str(RESULTS / name / "winner.toml")) for name in names]
    # beyond its samples the polynomial of this sensor's tilt exceeds 100 rad
    designs.append(Design(D=6.7, L=7.1, magnet_diameter=5, magnet_height=3, l0=4.9, hall_layout="tle493d-p2b6"))
    counts = [len(catalogues.magnets), len(catalogues.silicones), 1]
    while len(designs) < 10:
        choices = draw.integers(counts, size=(1, 3))
        choices[0, 2] = len(designs) % len(catalogues.hall_parts)
        drawn = space.candidates(choices, draw.uniform(0.3, 1.0, (1, 5)))
        variant = drawn.variant(0)
        designs += [] if drawn.outside()[0] or isinstance(variant, str) else [variant.design]
    return designs


RESULTS = Path(__file__).parent.parent / "results" / "sizing"
LEAST_RATE = 2000
"""Readings a second of processor time that a stream decodes on each of the ten designs."""


def test_stream_is_the_decoder_and_fast_on_designs_of_the_catalogue():
    rates, t = [], np.linspace(0, 10, 400)
    for design in sized():
        coder = decode.decoder(design, decode_readings.of_level(design, "finite"))
        # presses and shears through the workspace, from rest on
        path = 0.7 * np.array(coder.high)[:, None] * np.stack([np.sin(1.1 * t), np.sin(1.7 * t), 0 * t])
        path[2] = 0.45 * coder.low[2] * (1 - np.cos(0.6 * t))
        rows = list(map(tuple, forward_model.readings_at(coder.forward, path).T.tolist()))
        follower = stream.Stream(coder)
        follower.step(rows[0])
        # this compiles, in a new installation, what a stream needs
        expected = decode.decode(coder, rows, follow=True)
        begin = time.process_time()
        found = [follower.step(row) for row in rows]
        rates.append(len(rows) / (time.process_time() - begin))
        assert [sample.status for sample in found] == expected.status
        assert [sample.multiplicity for sample in found] == expected.multiplicity.tolist()
        assert_allclose([sample.shift for sample in found], expected.shift, atol=2e-8)
    assert len(rates) == 10
    assert min(rates) > LEAST_RATE, [round(rate) for rate in rates]
