"""Compiled assembly of a section without harmonics: which plates and elements it knows, and its batches."""

from dataclasses import replace

import numpy as np
from test_element_loops import assert_equal_assemblies, by_both_loops
from test_nonlinear_system import SCENES, plate, smooth

from fem.model import axisymmetric_loops, coulomb_friction, element_loops


def test_sections_without_harmonics_are_known_and_others_are_not():
    known = {name for name, build in SCENES.items() if axisymmetric_loops.knows(build().elements, build().surface)}
    assert known == {"cylinder", "sensor"}


def test_springs_at_chosen_points():
    system, flat = plate("sensor", 0.02)
    q = smooth(system)
    chosen = replace(flat, pressed=np.random.default_rng(3).random(system.surface.weights.shape) < 0.3)
    assert_equal_assemblies(*by_both_loops(system, chosen, q))


def test_a_plate_with_friction_is_added_apart():
    system, flat = plate("sensor", 0.02)
    rough = replace(flat, friction=coulomb_friction.at_rest(0.5, system.surface.weights.shape))
    assert not rough.only_presses
    q = smooth(system)
    assert_equal_assemblies(*by_both_loops(system, rough, q))


def test_results_do_not_depend_on_the_size_of_batches(monkeypatch):
    monkeypatch.setattr(element_loops, "BATCH", 100)
    system, flat = plate("sensor", 0.02)
    q = smooth(system)
    assert_equal_assemblies(*by_both_loops(system, flat, q))
    assert len(system.axisymmetric._batches) > 5
