"""Accuracy levels and that of the companion."""

from dataclasses import replace

import pytest

from fem.accuracy import COARSER, FINE, LEVELS, QUICK, STANDARD, coarser

SIZES = ("section_size", "solid_size", "section_patch", "solid_patch")


def test_each_level_is_finer_than_the_one_before():
    assert list(LEVELS.values()) == [QUICK, STANDARD, FINE]
    for rough, fine in ((QUICK, STANDARD), (STANDARD, FINE)):
        assert all(getattr(fine, size) < getattr(rough, size) for size in SIZES)
        assert fine.harmonics > rough.harmonics


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_a_companion_is_coarser_in_all(level):
    companion = coarser(level)
    for size in (*SIZES, "friction_step_factor"):
        assert getattr(companion, size) == pytest.approx(COARSER * getattr(level, size))
    assert companion.harmonics == level.harmonics - 1


def test_the_companion_of_a_single_harmonic_has_two():
    assert coarser(replace(STANDARD, harmonics=1)).harmonics == 2
