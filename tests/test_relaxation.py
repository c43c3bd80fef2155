"""The relaxation of a design: branches, moduli, what both rest on, and refused times and frequencies."""

import pytest

from geometry.design import BadInput, Design
from geometry.prony import Relaxation, constant_loss
from geometry.relaxation import check_range, moduli, range_sentence, relaxation_notes, relaxation_of

MEASURED = Design(prony="0.1:0.1 0.2:10")


def test_measured_branches_refuse_what_their_data_do_not_cover():
    assert check_range(MEASURED, times=[0.1, 3.0, 10.0], frequencies=[0.1, 1.0]) == []
    with pytest.raises(BadInput) as raised:
        check_range(MEASURED, times=[5.0, 20.0, 40.0], frequencies=[600.0])
    assert str(raised.value) == (
        "the branches speak for 0.1 to 10 s (0.0159 to 1.59 Hz), not for 20 to 40 s and 600 Hz: measure further, and "
        "mark the shortest and the longest time of the test in prony by entries 0:LOW 0:HIGH, or allow such values "
        "(extrapolate), which marks the results"
    )


def test_values_outside_the_range_are_marked_on_request():
    (warning,) = check_range(MEASURED, frequencies=[600.0], beyond=True)
    assert warning.endswith("not for 600 Hz: the results are an extrapolation")


def test_an_assumed_loss_factor_speaks_for_its_band():
    design = Design(loss_low=0.1, loss_high=100.0)
    assert check_range(design, frequencies=[0.1, 100.0]) == []
    with pytest.raises(BadInput, match="not for 600 Hz: change loss_low or loss_high, or allow"):
        check_range(design, frequencies=[600.0])


def test_an_elastic_silicone_speaks_for_every_rate():
    elastic = relaxation_of(Design(loss_factor=0.0))
    assert range_sentence(elastic, times=[0.0, 1e9], frequencies=[0.0, 1e9]) == ""


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        (
            {},
            [
                "E = 1 MPa is the long-term modulus (the default); the instantaneous",
                "13 Prony branches of a constant loss",
            ],
        ),
        ({"loss_factor": 0.0}, ["the silicone is elastic (loss_factor is 0): E = 1 MPa at every rate"]),
        (
            {"prony": "0.5:1", "modulus": "instantaneous"},
            [
                "E = 1 MPa is the instantaneous modulus; the long-term modulus is 0.5 MPa",
                "1 Prony branch from the field",
            ],
        ),
    ],
)
def test_notes_name_the_modulus_and_the_source_of_the_branches(fields, parts):
    notes = relaxation_notes(Design(**fields))
    assert [note[: len(part)] for note, part in zip(notes, parts, strict=True)] == parts


def test_branches_of_a_design_are_its_text_or_its_loss_factor():
    assert relaxation_of(MEASURED) == Relaxation((0.1, 0.2), (0.1, 10.0))
    assert relaxation_of(Design(loss_factor=0.2)) == constant_loss(0.2, 0.01, 1000.0)
    assert relaxation_of(Design(loss_factor=0.0)).times == ()


def test_moduli_at_rest_and_after_a_step():
    prony = "0.2:0.01 0.2:1"
    assert moduli(Design(E=0.6, prony=prony)) == pytest.approx((1.0, 0.6))
    assert moduli(Design(E=0.6, prony=prony, modulus="instantaneous")) == pytest.approx((0.6, 0.36))
