"""What the page says of the silicone at a frequency."""

from dataclasses import replace

import pytest

from geometry.design import paper
from studies.explorer.state_answers import rate


def test_a_frequency_has_loss_factor_stiffness_and_gap_of_a_linear_loop():
    answer = rate(paper(), 10.0)
    assert answer["loss_factor"] == pytest.approx(0.1, rel=0.02)
    assert answer["gap"] == pytest.approx(10, rel=0.02)
    assert answer["storage"] > 1 > rate(replace(paper(), modulus="instantaneous"), 10.0)["storage"]


def test_an_elastic_silicone_is_as_stiff_as_at_rest():
    answer = rate(replace(paper(), loss_factor=0.0), 10.0)
    assert (answer["loss_factor"], answer["storage"], answer["gap"]) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize("frequency", [0.0, 1e4])
def test_nothing_is_said_without_a_frequency_or_beyond_the_branches(frequency):
    assert rate(paper(), frequency) is None
