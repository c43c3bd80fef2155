"""What a process keeps for later calls is read-only: no caller can change the answer of the next one."""

import ast
import dataclasses
import importlib
from pathlib import Path

import numpy as np
import pytest

from fem.model.nonlinear_system import System
from fem.model.symmetry_models import MeshSpecification
from geometry.design import paper

ROOT = Path(__file__).resolve().parent.parent
SHAPE = paper().shape
SECTION = MeshSpecification(SHAPE, 0.45, "rigid", 2.0, 2.0)
CALLS = {
    "analytic.cylinder.cylinder_series": (0.5,),
    "analytic.cylinder.disc_series": (),
    "fem.analyses.time_steps.product_weights": ((0.0, 1.0, 2.0), 0),
    "fem.model.angular_fields.fourier_fields": (2,),
    "fem.model.elements._facet_functions": (2, 5),
    "fem.model.plate_contact._frame": (0.1,),
    "fem.model.single_order.build": (SECTION.build(), 1),
    "fem.model.symmetry_models._axisymmetric": (SECTION, 0),
    "fem.model.symmetry_models._section_mesh": (SHAPE, 2.0),
    "fem.model.symmetry_models._solid_mesh": (SHAPE, 2.0),
}
"""Kept functions whose results hold arrays, with arguments."""
WITHOUT_ARRAYS = {
    "analytic.cylinder.compiled_functions",
    "fem.model.material.law",
    "fem.results.error_estimates.error_rules",
    "fem.results.lateral_stiffness._stiffness_at_rest",
    "fem.solve.direct_solver._mkl",
    "geometry.cad.magnet_inertia",
    "geometry.compiled._announce_compilation",
    "geometry.compiled._digest",
    "geometry.relaxation.constant_loss",
}


def kept_functions():
    """The names of the functions of the physics whose results a process keeps."""
    for package in ("geometry", "fem", "analytic"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.parse(path.read_text("utf-8")).body:
                decorators = ast.unparse(node).split("def ")[0] if isinstance(node, ast.FunctionDef) else ""
                if "cache" in decorators:
                    yield f"{path.relative_to(ROOT).with_suffix('').as_posix().replace('/', '.')}.{node.name}"


def arrays_in(value):
    if isinstance(value, System):
        value = vars(value)
    if isinstance(value, np.ndarray):
        return [value]
    if dataclasses.is_dataclass(value):
        value = [getattr(value, spec.name) for spec in dataclasses.fields(value)]
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else ()
    return [array for item in items for array in arrays_in(item)]


def test_every_kept_function_is_known_here():
    assert set(kept_functions()) == {*CALLS, *WITHOUT_ARRAYS, "geometry.section._triangulated"}


@pytest.mark.parametrize("name", CALLS)
def test_kept_arrays_are_read_only(name):
    module, function = name.rsplit(".", 1)
    arrays = arrays_in(getattr(importlib.import_module(module), function)(*CALLS[name]))
    assert arrays
    assert not any(array.flags.writeable for array in arrays)


def test_a_section_cannot_change_the_one_that_is_kept():
    from geometry import section

    before = section.section(SHAPE, 2.0)
    before.doflocs[:] = 0
    kept = section._triangulated.cache_info().currsize
    assert section.section(SHAPE, 2.0).doflocs.any()
    assert section._triangulated.cache_info().currsize == kept
