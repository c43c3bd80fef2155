"""The press curve by FElupe, run by the interpreter of FElupe's own environment: `python peer_felupe.py GIVEN.npz`.

It imports nothing of magtip, and magtip nothing of FElupe, whose licence is the GPL. GIVEN holds the mesh (points
(n, 2) as r, z in mm; cells (m, 6); nodes of base and axis; edges (k, 3) of the skin), E_MPa, nu, L_mm, R_mm and the
depths_mm. It prints one JSON object: forces, iterations and CPU seconds, with those of the imports apart.

What was chosen for FElupe:

- Second-order triangles with the three-field energy (u, p, J) of `NearlyIncompressible` on continuous first-order p
  and J. Of FElupe's formulations it was the cheapest at equal error: `SolidBodyNearlyIncompressible` (one pressure
  an element) wants finer meshes and smaller steps, and displacements alone do not converge.
- The gradient of `QuadraticTriangle` is wrong in FElupe 11.3.0: its last entry is 4 (1 - 2 r - s) where
  4 (1 - r - 2 s) belongs, and Newton's method diverges. It is put right here where it is found wrong.
- `ContactRigidPlane` pushes at nodes and did not converge here: on second-order edges the corners' share of a smooth
  pressure is small, and none at the axis. Triangles have no boundary region to put a `FormItem` on. So the plate is
  an item of its own: a penalty at Gauss points of the edges, as stiff as magtip's of tetrahedra, that takes the first
  iteration of a step with the points in contact before it.
- SciPy's `spsolve`, at these sizes faster than PyPardiso's; steps from depth to depth without any between, from an
  extrapolated first guess; a tolerance that leaves an error far below the mesh's.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import felupe as fem  # type: ignore[import-not-found]
import numpy as np
import scipy
from felupe.mechanics import Assemble  # type: ignore[import-not-found]
from felupe.mechanics._helpers import Results  # type: ignore[import-not-found]
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

IMPORT_S = time.process_time()
KAPPA = 3000.0
TOLERANCE = 1e-3


class Plate:
    """A flat frictionless plate: an energy k g^2 / 2 per reference area where a point overlaps it by g."""

    def __init__(self, field: Any, edges: Any) -> None:
        t, weights = np.polynomial.legendre.leggauss(3)
        s = (t + 1) / 2
        slopes = np.stack([4 * s - 3, 4 * s - 1, 4 - 8 * s], axis=1)
        nodes = field.region.mesh.points[edges]
        self.field, self.edges = field, edges
        self.shape = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=1)
        self.points = np.einsum("qa,eai->eqi", self.shape, nodes)
        length = np.linalg.norm(np.einsum("qa,eai->eqi", slopes, nodes), axis=-1)
        self.weights = 2 * np.pi * self.points[..., 1] * length * weights / 2
        self.height, self.stiffness, self.pressed = np.inf, 0.0, None
        self.size = field.region.mesh.npoints * 2
        self.results = Results()
        self.assemble = Assemble(vector=self._vector, matrix=self._matrix)

    def come(self, height: float, stiffness: float, first: float) -> None:
        """Move to a height; the first iteration is to keep the contact, at first touch the points above `first`."""
        self.pressed = self.points[..., 0] > first if self.height == np.inf else self._overlap() > 0
        self.height, self.stiffness = height, stiffness

    def _overlap(self) -> Any:
        return self.points[..., 0] + self.field[0].values[self.edges, 0] @ self.shape.T - self.height

    def pressure(self) -> Any:
        overlap = self._overlap()
        active = overlap > 0 if self.pressed is None else self.pressed
        return np.where(active, self.weights * self.stiffness * overlap, 0.0)

    def _vector(self, field: Any = None, parallel: bool = False) -> Any:
        values, rows = self.pressure() @ self.shape, 2 * self.edges.ravel()
        return coo_matrix((values.ravel(), (rows, 0 * rows)), shape=(self.size, 1)).tocsr()

    def _matrix(self, field: Any = None, parallel: bool = False) -> Any:
        weights = self.weights * self.stiffness * (self._overlap() > 0 if self.pressed is None else self.pressed)
        values = np.einsum("eq,qa,qb->eab", weights, self.shape, self.shape)
        rows = np.broadcast_to(2 * self.edges[:, :, None], values.shape)
        columns = np.broadcast_to(2 * self.edges[:, None, :], values.shape)
        self.pressed = None
        return coo_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(self.size,) * 2).tocsr()


def gradient(self: Any, rs: Any) -> Any:
    """Derivatives of the second-order triangle's shape functions, shape (6, 2)."""
    r, s = rs
    t = 1 - r - s
    corners = [[1 - 4 * t, 1 - 4 * t], [4 * r - 1, 0], [0, 4 * s - 1]]
    return np.array([*corners, [4 * (t - r), -4 * r], [4 * s, 4 * r], [-4 * s, 4 * (t - s)]], dtype=float)


def put_right() -> bool:
    """Replace FElupe's gradient of the second-order triangle if it is wrong, and tell whether it was."""
    element = fem.element.QuadraticTriangle()
    at, steps = np.array([0.2, 0.3]), 0.1 * np.eye(2)
    # central differences are exact for quadratics
    slopes = np.column_stack([(element.function(at + h) - element.function(at - h)) / 0.2 for h in steps])
    wrong = not np.allclose(element.gradient(at), slopes)
    if wrong:
        fem.element.QuadraticTriangle.gradient = gradient
    return wrong


def solve(given: Any) -> dict[str, Any]:
    points = np.ascontiguousarray(given["points"][:, ::-1])
    cells = given["cells"]
    a, b = (points[cells[:, k]] - points[cells[:, 0]] for k in (1, 2))
    # cells are turned so that all have a positive area
    turned = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    cells = np.where(turned[:, None], cells[:, [0, 2, 1, 5, 4, 3]], cells)
    mesh = fem.Mesh(points, cells, "triangle6")
    region = fem.RegionQuadraticTriangle(mesh)
    x = fem.FieldsMixed(region, n=3, axisymmetric=True)
    E, nu, R, L = (float(given[name]) for name in ("E_MPa", "nu", "R_mm", "L_mm"))
    law = fem.NearlyIncompressible(fem.NeoHooke(mu=E / 2 / (1 + nu)), bulk=E / 3 / (1 - 2 * nu))
    plate = Plate(x, given["edges"])
    items = [fem.SolidBody(law, x), plate]
    held = {
        "base": fem.Boundary(x[0], mask=np.isin(np.arange(len(points)), given["base"])),
        "axis": fem.Boundary(x[0], mask=np.isin(np.arange(len(points)), given["axis"]), skip=(1, 0)),
    }
    dof0, dof1 = fem.dof.partition(x, held)
    options = {"dof0": dof0, "dof1": dof1, "ext0": fem.dof.apply(x, held, dof0), "solver": spsolve}
    forces, iterations, before, last = [], 0, None, 0.0
    for depth in given["depths_mm"]:
        plate.come(L - depth, KAPPA * E / np.sqrt(R * depth), L - depth / 2)
        now = [field.values.copy() for field in x.fields]
        if before is not None:
            for field, a, b in zip(x.fields, now, before[1], strict=True):
                field.values = a + (a - b) * (depth - last) / (last - before[0])
        before = (last, now) if last else None
        last = depth
        found = fem.newtonraphson(x0=x, items=items, tol=TOLERANCE, maxiter=40, verbose=False, **options)
        x, iterations = found.x, iterations + found.iterations
        forces.append([0.0, 0.0, float(np.sum(plate.pressure()))])
    return {"forces_N": forces, "iterations": iterations, "dofs": sum(x.fieldsizes)}


def main(path: str) -> None:
    with np.load(path) as given:
        arrays = dict(given)
    begin = time.process_time()
    corrected = put_right()
    try:
        answer = {"status": "ok", "message": "", **solve(arrays)}
    except fem.tools.NewtonConvergenceError as error:
        answer = {"status": "not_converged", "message": str(error).strip()}
    answer |= {"import_s": IMPORT_S, "cpu_s": time.process_time() - begin, "gradient_corrected": corrected}
    print(json.dumps(answer | {"version": f"felupe {fem.__version__}, scipy {scipy.__version__}"}))


if __name__ == "__main__":
    main(sys.argv[1])
