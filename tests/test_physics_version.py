"""Answers of the models' physics: a change of them raises the version, so that old answers are not taken for new.

The scenes are rough and quick; the answers are those of versions 1 to 3. Sections agree between machines and
versions of the packages to rounding, far below the 1e-6 asked for here. Tetrahedra differ by some percent in number
between processors, and their answers by half a percent.
"""

import math
from dataclasses import replace
from typing import get_args

import pytest

from fem.accuracy import QUICK
from fem.analyses.modes import modes
from fem.analyses.stability import critical
from fem.equilibrium import trace
from fem.physics_version import PHYSICS
from fem.scene import Model, Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import timed_quantities

ROUGH = replace(
    QUICK, name="rough", section_size=0.25, section_patch=0.03, solid_size=0.5, solid_patch=0.1, harmonics=1
)
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
    "press": ("axisymmetric", 3, 1e-6, (0.0, 4.22735933346326, 0.0, -0.3091196100140188)),
    "all silicone": ("axisymmetric", 3, 1e-6, (0.0, 1.0229699639638283, 0.0, -0.11736911640201159)),
    "yeoh": ("axisymmetric", 3, 1e-6, (0.0, 1.39895963901401, 0.0, -0.10647917689587579)),
    "mooney": ("axisymmetric", 3, 1e-6, (0.0, 1.4222605835770197, 0.0, -0.10766145462267399)),
    "ogden": ("axisymmetric", 3, 1e-6, (0.0, 1.391609347984881, 0.0, -0.10590067927064223)),
    "stick": ("harmonic", 3, 1e-6, (0.27339153898014695, 1.3704822950262594, 0.185238440536375, -0.1053503607342623)),
    "grip": ("harmonic", 3, 1e-6, (0.5719697582391418, 0.0, 0.2990250192276671, -0.003039849682115983)),
    "coulomb": (
        "harmonic",
        3,
        1e-6,
        (0.14253024554943355, 0.623969230809307, 0.09483507362440799, -0.04826342298427718),
    ),
    "tilted": (
        "harmonic",
        3,
        1e-6,
        (-0.04975933789272139, 0.4959336275135637, -0.026149331993498545, -0.05557300671545812),
    ),
    "turned": (
        "harmonic",
        3,
        1e-6,
        (-0.04955456126228268, 0.49125069820851025, -0.025986200863953594, -0.05522646138938939),
    ),
    "tetrahedra": (
        "half",
        3,
        1e-2,
        (-0.050175994095035134, 0.5000862917287704, -0.026324395375589338, -0.05571403487038154),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_answers_change_only_with_the_version(name):
    design, loads, magnet = CASES[name]
    model, version, tolerance, answer = ANSWERS[name]
    state = trace(design, loads, ROUGH, magnet=magnet, model=model, estimate=False)[-1]
    force, shift = state.response.force, state.response.shift
    assert (state.status, state.model) == ("ok", model)
    assert PHYSICS[state.model] == version, "write the answers of the new version into ANSWERS"
    size = math.hypot(force[0], force[2]), math.hypot(shift[0], shift[2])
    found = (force[0] / size[0], force[2] / size[0], shift[0] / size[1], shift[2] / size[1], *size)
    f, s = math.hypot(*answer[:2]), math.hypot(*answer[2:])
    wanted = (answer[0] / f, answer[1] / f, answer[2] / s, answer[3] / s, f, s)
    assert found == pytest.approx(wanted, rel=tolerance, abs=tolerance), "raise the version in fem.physics_version"


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
