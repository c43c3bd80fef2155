"""Objectives, constraints and fronts of candidates; conflicts that follow from their margins."""

import dataclasses

import numpy as np

from studies.sizing import conflicts
from studies.sizing.candidate_performance import CHECKED, performance
from studies.sizing.catalogues import catalogues_of
from studies.sizing.conflicts import conflict_of
from studies.sizing.front_search import Effort
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import beams_of, islands, searched

NEEDED = Requirements(
    force_z=5.0, force_x=1.0, outer_size=30.0, D_low=9.0, D_high=11.0, silicones=("Smooth-Sil 940", "Dragon Skin 30")
)
PARTS = catalogues_of(NEEDED)


def test_one_axis_parts_and_chips_are_searched_apart():
    one_axis, chips = islands(NEEDED, PARTS)
    assert {part.layout for part in one_axis.catalogues.hall_parts} == {"three"}
    assert "three" not in {part.layout for part in chips.catalogues.hall_parts}
    assert [part.name for part in chips.catalogues.silicones] == ["Dragon Skin 30", "Smooth-Sil 940"]


def test_variants_of_a_front_meet_the_requirements_and_none_dominates_another():
    texts: list[str] = []
    lasts, variants = searched(islands(NEEDED, PARTS), Effort(16, 4), lambda _, text: texts.append(text))
    assert len(lasts) == 2
    searches = [text.partition(",")[0] for text in texts]
    assert searches == [f"{kind}: generation {k}" for kind in ("one-axis parts", "3-axis chips") for k in range(4)]
    assert len(variants) > 2
    result = performance(variants, beams_of(variants), NEEDED)
    assert all((margin >= 0).all() for margin in result.margins.values())
    worst = np.maximum(result.resolution_z, result.resolution_x)
    F = np.column_stack([-result.range_z, worst, result.outer_size])
    assert not any((np.delete(F, k, axis=0) < F[k]).all(axis=1).any() for k in range(len(F)))


def test_more_poses_are_not_easier():
    _, variants = searched(islands(NEEDED, PARTS)[:1], Effort(16, 2))
    few, many = (performance(variants, beams_of(variants), NEEDED, **grid) for grid in ({}, {"grid": CHECKED}))
    # slopes are differences, with relative errors of 1e-8
    assert (many.resolution_z >= few.resolution_z * (1 - 1e-6)).all()
    assert (many.saturation <= few.saturation + 1e-12).all()


def test_range_and_strain_that_conflict_say_what_to_give(monkeypatch):
    # test_sizing_commands.py has the whole effort
    monkeypatch.setattr(conflicts, "EFFORT", Effort(16, 8))
    needed = dataclasses.replace(NEEDED, force_z=200.0, force_x=None, largest_strain=0.4)
    groups = islands(needed, dataclasses.replace(PARTS, hall_parts=PARTS.hall_parts[:1]))
    lasts, variants = searched(groups, Effort(16, 2))
    assert not variants
    conflict = conflict_of(groups, lasts)
    assert "force_z" in [bound.name for bound in conflict.members]
    gives = dict(zip([bound.name for bound in conflict.members], conflict.gives_of_all, strict=True))
    assert 0 < gives["force_z"] < 200
    # what is left of the range can indeed be met
    reduced = dataclasses.replace(needed, force_z=200.0 - gives["force_z"] - 2.0)
    assert searched(islands(reduced, groups[0].catalogues), Effort(32, 16))[1]
