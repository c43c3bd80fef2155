"""Designs, loads, models and references of the study of cost and error."""

import itertools

import pytest

from fem.scene import Scene
from studies.validation import trade_cases
from studies.validation.trade_cases import KINDS, MODELS, confirming_designs, designs, references, runs_on, trial


def test_the_chosen_designs_span_the_range():
    ratios = [design.L / design.D for design in designs()]
    assert len(designs()) == trade_cases.STUDIED
    assert (min(ratios), max(ratios)) == (0.6, 6.0)
    assert (min(d.nu for d in designs()), max(d.nu for d in designs())) == (0.45, 0.4999)
    assert {d.law for d in designs()} == {"neo-hookean", "mooney-rivlin", "yeoh", "ogden"}
    assert {d.shape.has_magnet for d in designs()} == {True, False}


def test_the_confirming_designs_are_others_in_the_same_range():
    assert len(confirming_designs()) == trade_cases.CONFIRMED
    assert not set(confirming_designs()) & set(designs())
    assert all(0.6 <= design.L / design.D <= 6.0 and 0.45 <= design.nu < 0.5 for design in confirming_designs())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("confirm", [True, False])
def test_every_model_can_carry_the_loads_of_its_kind(kind, confirm):
    for number in range(trade_cases.CONFIRMED if confirm else trade_cases.STUDIED):
        for model in MODELS[kind]:
            one = trial(number, kind, model, confirm=confirm)
            assert Scene(one.design, one.loads, magnet=one.magnet, model=model).model == model


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fineness", ["rough", "coarser", "usual", "finer"])
def test_each_mesh_of_a_reference_is_finer_by_the_root_of_two(kind, fineness):
    sizes = [accuracy.section_size for accuracy in references(kind, fineness)]
    assert [a / b for a, b in itertools.pairwise(sizes)] == pytest.approx([2**0.5] * 2, rel=0.01)


def test_cells_that_run_on_few_designs_take_different_ones():
    numbers = runs_on("press", "half", "quick", trade_cases.STUDIED)
    assert len({designs()[number].L / designs()[number].D for number in numbers}) == len(numbers)
    assert set(numbers) <= set(range(trade_cases.STUDIED))
