"""Answers of the models' physics: a change of them raises the version, so that old answers are not taken for new.

The scenes are rough and quick; the answers are those of versions 1 to 3. Sections agree between machines and
versions of the packages to rounding, far below the 1e-6 asked for here. Tetrahedra differ by some percent in number
between processors, and their answers by half a percent.
"""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from conftest import ROUGH

from fem.analyses.modes import modes
from fem.analyses.stability import critical
from fem.equilibrium import trace
from fem.physics_version import PHYSICS
from fem.scene import Model, Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import timed_quantities

CASES = {
    "press": (paper(), [Load(depth=0.1), Load(depth=1.0)], "rigid"),
    "all silicone": (replace(paper(), nu=0.45), [Load(depth=0.5)], "ignored"),
    "yeoh": (replace(paper(), law="yeoh", yeoh_2=0.1), [Load(depth=0.5)], "rigid"),
    "mooney": (replace(paper(), law="mooney-rivlin", mooney_share=0.3), [Load(depth=0.5)], "rigid"),
    "ogden": (replace(paper(), law="ogden"), [Load(depth=0.5)], "rigid"),
    "stick": (paper(), [Load(depth=0.5, shear_x=0.5, friction="stick")], "rigid"),
    "grip": (paper(), [Load(shear_x=0.5, grip=2.0)], "rigid"),
    "coulomb": (paper(), [Load(depth=0.3, shear_x=0.3, friction=0.3)], "rigid"),
    "tilted": (paper(), [Load(depth=0.3, plate_tilt=0.1)], "ignored"),
    "turned": (paper(), [Load(depth=0.3, shear_y=0.3, friction="stick", plate_tilt=0.1)], "ignored"),
    "tetrahedra": (paper(), [Load(depth=0.3, plate_tilt=0.1)], "ignored"),
}
ANSWERS = {
    "press": ("axisymmetric", (0.0, 4.22735933, 0.0, -0.30911961)),
    "all silicone": ("axisymmetric", (0.0, 1.02296996, 0.0, -0.117369116)),
    "yeoh": ("axisymmetric", (0.0, 1.39895964, 0.0, -0.106479177)),
    "mooney": ("axisymmetric", (0.0, 1.42226058, 0.0, -0.107661455)),
    "ogden": ("axisymmetric", (0.0, 1.39160935, 0.0, -0.105900679)),
    "stick": ("harmonic", (0.273391539, 1.3704823, 0.185238441, -0.105350361)),
    "grip": ("harmonic", (0.571969758, 0.0, 0.299025019, -0.00303984968)),
    "coulomb": ("harmonic", (0.142530246, 0.623969231, 0.0948350736, -0.048263423)),
    "tilted": ("harmonic", (-0.0497593379, 0.495933628, -0.026149332, -0.0555730067)),
    "turned": ("harmonic", (-0.0495545613, 0.491250698, -0.0259862009, -0.0552264614)),
    "tetrahedra": ("half", (-0.0501759941, 0.500086292, -0.0263243954, -0.0557140349)),
}
"""Model, and force and shift of version 3 along x and z."""


@pytest.mark.parametrize("name", CASES)
def test_answers_change_only_with_the_version(name):
    (design, loads, magnet), (model, wanted) = CASES[name], ANSWERS[name]
    state = trace(design, loads, ROUGH, magnet=magnet, model=model, estimate=False)[-1]
    assert (state.status, state.model) == ("ok", model)
    assert PHYSICS[state.model] == 3, "write the answers of the new version into ANSWERS"
    (fx, _, fz), (ux, _, uz) = state.response.force, state.response.shift
    found, tolerance = np.array([(fx, fz), (ux, uz)]), 1e-2 if model == "half" else 1e-6
    wanted = np.reshape(wanted, (2, 2))
    sizes = np.linalg.norm(wanted, axis=1, keepdims=True)
    np.testing.assert_allclose(
        found / sizes, wanted / sizes, atol=tolerance, err_msg="raise the version of the model"
    )


def test_the_critical_depth_changes_only_with_the_version():
    slender = replace(paper(), L=24.0)
    state = critical(slender, "ignored", accuracy=ROUGH, estimate=False)
    assert PHYSICS["critical depth"] == 1, "write the answer of the new version here"
    found = state.depth / slender.D, state.force / (slender.E * slender.D**2)
    assert found == pytest.approx((0.12118004507224332, 0.020737021644350852), rel=1e-5), "raise the version"


def test_frequencies_change_only_with_the_version():
    lowest = modes(paper(), "rigid", 3, depth=0.5, accuracy=ROUGH, estimate=False)
    assert PHYSICS["modes"] == 2, "write the answer of the new version here"
    assert lowest.shape == ("bending", "torsion", "axial")
    wanted = (558.0107632537515, 630.1872266304849, 1109.8470668531104)
    assert lowest.frequency == pytest.approx(wanted, rel=1e-6), "raise the version in fem.physics_version"


def test_the_vibration_changes_only_with_the_version():
    values = timed_quantities.solve_response(Scene(paper(), (Load(depth=0.5),), ROUGH, "rigid"))
    assert PHYSICS["response"] == 4, "write the answer of the new version here"
    middle = values["stiffness_real"][150], values["stiffness_imag"][150]
    # the highest frequency, where inertia matters most
    assert (values["stiffness_real"][-1], values["stiffness_imag"][-1]) == pytest.approx(
        (0.714165274, 0.151351597), rel=1e-6
    ), "raise the version in fem.physics_version"
    assert middle == pytest.approx((1.23981241, 0.124549019), rel=1e-6), "raise the version in fem.physics_version"


def test_every_model_has_a_version():
    models = {model for model in get_args(Model) if model != "auto"}
    assert set(PHYSICS) == models | {"critical depth", "modes", "response", "cycle"}
