"""Calibration curves: readings of each axis over the force, of made sensors that share the nominal force range."""

import dataclasses

import numpy as np
import pytest

from analytic import beam, hall
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.sensitivity.calibration_curves import curves, sensitivity_errors
from studies.sensitivity.made_sensors import made_sensors
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press

NONE = {spec.name: 0.0 for spec in dataclasses.fields(Tolerances)}


def test_the_ends_of_the_nominal_curves_are_the_readings_under_the_load():
    made = made_sensors(paper(), Tolerances(**NONE), 1)
    axes = curves("finite", made, Press(1.0, 0.3))
    pressed, sheared = (beam.solve(paper(), Load(1.0, s, friction="stick"), "finite") for s in (0.0, 0.3))
    nominal, _ = axes["z"]
    assert nominal.force[-1] == pytest.approx(pressed.force[2])
    assert nominal.rest[0] == pytest.approx(hall.readings(paper()).V[0])
    assert nominal.reading[0, -1] == pytest.approx(hall.readings(paper(), pressed).V[0], rel=1e-6)
    along_x, _ = axes["x"]
    assert along_x.force[[0, -1]] == pytest.approx([-sheared.force[0], sheared.force[0]])
    assert along_x.reading[0, -1] == pytest.approx(hall.readings(paper(), sheared).V[1], rel=1e-6)
    assert axes["y"][0].reading == pytest.approx(along_x.reading, rel=1e-12)


def test_a_sensor_of_twice_the_modulus_is_pressed_less_for_the_same_force():
    made = made_sensors(paper(), Tolerances(**NONE), 1)
    stiff = dataclasses.replace(made, designs=(Design(E=2.0),), E=np.array([2.0]))
    nominal, curve = curves("finite", stiff, Press(1.0))["z"]
    soft_at_half = np.interp(nominal.force[-1] / 2, nominal.force, nominal.reading[0])
    assert curve.reading[0, -1] == pytest.approx(soft_at_half, rel=1e-4)


def test_a_sensor_that_does_not_reach_the_force_says_so():
    made = made_sensors(paper(), Tolerances(**NONE), 1)
    soft = dataclasses.replace(made, designs=(Design(E=0.3),), E=np.array([0.3]))
    _, curve = curves("finite", soft, Press(1.0, 0.2))["z"]
    assert np.isnan(curve.reading[0, -1])
    assert "its force does not rise to 4.08 N" in curve.refusals[0]


def test_the_surrogate_has_curves_from_rest_on_although_it_has_no_shallow_presses():
    nominal, made = curves("surrogate", made_sensors(paper(), count=5), Press(1.0, 0.3))["z"]
    assert np.isfinite(nominal.reading).all()
    assert np.isfinite(made.reading).all()
    assert set(made.refusals) == {""}


def test_a_load_that_the_model_refuses_for_the_design_itself_is_bad_input():
    made = made_sensors(paper(), count=2)
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated: depth must be less than 7 mm"):
        curves("finite", made, Press(8.0))
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated in shear: the surrogate"):
        curves("surrogate", made, Press(1.0, 8.0))


def test_the_stated_error_of_the_sensitivity_covers_what_it_differs_from_finite_elements():
    """Finite elements at level standard give 4.187 N at a depth of 1 mm."""
    assert sensitivity_errors("finite", paper(), Press(1.0, 0.5)) == {"z": 0.0, "x": 0.0, "y": 0.0}
    errors = sensitivity_errors("surrogate", paper(), Press(1.0, 0.5))
    nominal, _ = curves("surrogate", made_sensors(paper(), count=1), Press(1.0, 0.5))["z"]
    assert set(errors) == {"z", "x", "y"}
    assert 0 < errors["z"] < 0.1
    assert abs(nominal.force[-1] / 4.187 - 1) < errors["z"]
    assert set(sensitivity_errors("surrogate", paper(), Press(1.0))) == {"z"}
