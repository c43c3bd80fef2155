"""The same request gives the same tetrahedra, in whichever process it is made."""

import hashlib
import logging
import subprocess
import sys

import numpy as np
from pytetwild import PyfTetWildWrapper

from geometry import mesh as meshing
from geometry import messages
from geometry.design import Shape
from geometry.mesh import tetrahedra
from geometry.meshing import mesh_cache, tetwild_process

ASK = """
import hashlib
from geometry.meshing import mesh_cache
from geometry.design import Shape
from geometry.mesh import tetrahedra
with mesh_cache.bypassed():
    mesh = tetrahedra(Shape(*{shape}), {size}, **{options})
    print(hashlib.sha256(mesh.doflocs.tobytes() + mesh.t.tobytes()).hexdigest())
"""
SHAPE, SIZE, OPTIONS = (8, 7, 4, 2, 0), 2.5, {"half": True, "magnet": "regions", "rim": (1.0, 0.5)}
"""Shape, size and options of a mesh that has a magnet and is finer at a rim."""


def test_two_processes_make_the_same_mesh():
    """Python's hashes, memory addresses and the order of processes do not affect the mesh."""
    code = ASK.format(shape=SHAPE, size=SIZE, options=OPTIONS)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    with mesh_cache.bypassed():
        mesh = tetrahedra(Shape(*SHAPE), SIZE, **OPTIONS)
    assert done.stdout.split() == [hashlib.sha256(mesh.doflocs.tobytes() + mesh.t.tobytes()).hexdigest()]


def test_another_seed_makes_another_mesh(monkeypatch, tmp_path):
    """The mesh depends on the seed: the replaced function is called."""
    other = tmp_path / "other.py"
    other.write_text(meshing.CHILD.read_text().replace(f"SEED = {tetwild_process.SEED}", "SEED = 7"))
    with mesh_cache.bypassed():
        one = tetrahedra(Shape(8, 6, 0, 0, 0), 2.0, magnet="none")
        monkeypatch.setattr(meshing, "CHILD", other)
        two = tetrahedra(Shape(8, 6, 0, 0, 0), 2.0, magnet="none")
    assert one.doflocs.shape != two.doflocs.shape or not np.array_equal(one.doflocs, two.doflocs)


def test_a_library_without_the_function_has_no_slot():
    assert tetwild_process.slot(str(PyfTetWildWrapper.__file__), b"no such function") is None


def test_a_seed_that_cannot_be_fixed_causes_one_warning(monkeypatch, tmp_path, caplog):
    child = tmp_path / "child.py"
    child.write_text(meshing.CHILD.read_text().replace('"linux"', '"elsewhere"'))
    monkeypatch.setattr(meshing, "CHILD", child)
    messages.warn_once.cache_clear()
    with mesh_cache.bypassed(), caplog.at_level(logging.WARNING):
        for _ in range(2):
            tetrahedra(Shape(8, 6, 0, 0, 0), 2.0, magnet="none")
    (record,) = caplog.records
    assert "meshes of tetrahedra differ from run to run" in record.getMessage()
