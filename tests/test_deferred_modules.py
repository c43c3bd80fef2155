"""Deferred modules: there for whoever uses them."""

import subprocess
import sys

USES = """
import sys
from studies import deferred_modules
deferred_modules.defer()
deferred_modules.defer()
import numpy, scipy.spatial
print("numpy.f2py.crackfortran" in sys.modules)
numpy.f2py.crackfortran
print("numpy.f2py.crackfortran" in sys.modules, "numpy.testing._private" in sys.modules)
numpy.testing.assert_allclose(1, 1)
print("numpy.testing._private" in sys.modules, "scipy.spatial.transform._rotation" in sys.modules)
from scipy.spatial.transform import Rotation
assert Rotation.identity().magnitude() == 0
print("scipy.spatial.transform._rotation" in sys.modules)
"""


def test_a_deferred_module_is_imported_where_it_is_used():
    done = subprocess.run([sys.executable, "-c", USES], capture_output=True, text=True, check=True)
    assert done.stdout.split() == 3 * ["False", "True"]
