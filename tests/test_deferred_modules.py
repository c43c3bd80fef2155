"""Deferred modules: there for whoever uses them."""

import subprocess
import sys

USES = """
import sys
from studies import deferred_modules
deferred_modules.defer()
deferred_modules.defer()
import numpy, scipy.spatial
part = {part}
print(part in sys.modules)
{use}
print(part in sys.modules)
"""


def before_and_after(part, use):
    """Whether a part of a deferred module is imported, before the module is used and after."""
    code = USES.format(part=repr(part), use=use)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_a_deferred_module_is_imported_where_it_is_used():
    uses = {
        "numpy.f2py.crackfortran": "numpy.f2py.crackfortran",
        "numpy.testing._private": "numpy.testing.assert_allclose(1, 1)",
        "scipy.spatial.transform._rotation": (
            "from scipy.spatial.transform import Rotation; assert Rotation.identity().magnitude() == 0"
        ),
    }
    for part, use in uses.items():
        assert before_and_after(part, use) == ["False", "True"]
