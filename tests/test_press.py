"""Where the contact of a press ends, and the mesh that is fine there."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK, STANDARD
from fem.analyses.modes import find_contact, modes, pressed_sensor
from fem.model.symmetry_models import specification
from fem.scene import Scene
from fem.solve import press
from fem.solve.newton import NoStateError
from fem.solve.press import find_press, measure_contact_edge, solve_press
from geometry.design import paper
from geometry.loads import Load

SECTION = specification(Scene(paper(), (Load(depth=1.0),), QUICK), 0.16, 0.08)


def test_a_press_that_never_starts_still_leaves_a_mesh_to_solve_on(monkeypatch):
    monkeypatch.setattr(press, "measure_contact_edge", lambda state: 0.0)
    assert find_press(SECTION, 0.01, 0.125)[0] == pytest.approx(0.25)


def test_the_end_of_a_contact_stays_where_it_was_found():
    """Beside one more press on a mesh that is fine where the end was found."""
    radius = find_press(SECTION, 0.02, 0.125)[0]
    again = measure_contact_edge(solve_press(replace(SECTION, rim=(radius, 0.012)), 0.125)[0])
    assert radius == pytest.approx(again, rel=0.01)


def test_a_press_that_crushes_silicone_is_no_state_to_analyse():
    """At 6.5 mm a press of the paper's sensor folds elements at tip and magnet; `solve` stops at 5.68 mm."""
    with pytest.raises(NoStateError, match=r"crushes silicone to [0-9.]+ % of its volume"):
        modes(paper(), depth=6.5, accuracy=QUICK, estimate=False)


def test_a_press_whose_levels_agree_is_a_state_to_analyse():
    """At 5 mm the frequencies of the three levels agree to 0.5 %, though J falls below 0.1 at the magnet's edge."""
    scene = Scene(paper(), (Load(depth=5.0),), STANDARD, "rigid")
    reached = pressed_sensor(scene, find_contact(scene))
    assert 0.04 < reached.state.least_J < 0.1
    assert reached.state.stability.is_stable
