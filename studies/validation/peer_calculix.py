"""The half model's press as an input deck of CalculiX (`ccx`), and the force from what it prints.

A second-order tetrahedral mesh of y >= 0 with clamped base and symmetry plane is pressed by a rigid plate, a single
C3D8 all of whose nodes are moved. Material: *HYPERELASTIC, NEO HOOKE, whose energy C10 (I1 - 3) + (J - 1)^2 / D1 is
that of magtip with C10 = mu / 2 and D1 = 2 / K. Lengths in mm, stresses in MPa.

What was chosen for CalculiX: C3D10, because C3D10T treats nothing but temperatures otherwise; linear penalty contact
of faces with faces, or of nodes with a face; one increment, which CalculiX shortens where it must; the solver of its
build (SPOOLES in Debian's). C3D10 has no pressure of its own: with the sensor's Poisson's ratio it is too stiff and
wants many iterations, so that a second setting takes a smaller one. That changes the material, and the force with
it, by an amount that counts as error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from studies.validation import pages

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
"""Corners of CalculiX' faces S1 to S4."""
TURNED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
"""Nodes of a cell after corners 1 and 2 have changed places."""


@dataclass(frozen=True, slots=True)
class Press:
    """What is pressed how far.

    Attributes
    ----------
    E, nu : of the silicone, MPa and 1.
    L, R, depth : length of the beam, its radius and how far the plate comes down, mm.
    contact : CalculiX' type of contact pair.
    stiffness : of the contact, MPa per mm.
    """

    E: float
    nu: float
    L: float
    R: float
    depth: float
    contact: Literal["SURFACE TO SURFACE", "NODE TO SURFACE"] = "SURFACE TO SURFACE"
    stiffness: float = 300.0


def deck(mesh: Any, press: Press) -> str:
    """The input deck for a scikit-fem MeshTet2 with boundaries "base", "skin" and "symmetry"."""
    points, cells = mesh.doflocs.T, np.asarray(mesh.dofs.element_dofs).T
    slopes = points[cells[:, 1:4]] - points[cells[:, :1]]
    cells = np.where(np.linalg.det(slopes)[:, None] < 0, cells[:, TURNED], cells) + 1
    n, reach = len(points), 1.5 * np.sqrt(press.R * press.depth)
    corners = [(x, y, z) for z in (press.L, press.L + 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    plate = [(1.5 * press.R * x, 1.5 * press.R * y, z) for x, y, z in corners]
    base = _on(points[:, 2])
    mu, K = press.E / 2 / (1 + press.nu), press.E / 3 / (1 - 2 * press.nu)
    return pages.rendered(
        "calculix.inp.j2",
        body=_numbered(points, 1),
        plate=_numbered(plate, n + 1),
        cells=[f"{i}, " + ", ".join(map(str, row)) for i, row in enumerate(cells.tolist(), 1)],
        block=f"{len(cells) + 1}, " + ", ".join(str(n + k) for k in range(1, 9)),
        last=len(cells) + 1,
        base=base.tolist(),
        symmetry=np.setdiff1d(_on(points[:, 1]), base).tolist(),
        faces=_faces(mesh, cells, press.L, reach),
        moduli=(mu / 2, 2 / K),
        press=press,
    )


def force(printed: str) -> tuple[float, float]:
    """Time of the last increment in a .dat file and the whole beam's force at it, N; ValueError if there is none."""
    pattern = r"total force .*time\s+(\S+)\s+\S+\s+\S+\s+(\S+)"
    found = re.findall(pattern, printed)
    if not found:
        raise ValueError("CalculiX printed no force")
    time, normal = map(float, found[-1])
    return time, 2 * normal


def iterations(said: str) -> int:
    """How many iterations CalculiX tells of on standard output."""
    return len(re.findall(r"^ iteration +\d+", said, flags=re.MULTILINE))


def _on(coordinate: Any) -> Any:
    """Numbers of the nodes in a plane."""
    return np.flatnonzero(np.abs(coordinate) < 1e-9) + 1


def _numbered(points: Any, first: int) -> list[str]:
    return [f"{i}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(points, first)]


def _faces(mesh: Any, cells: Any, L: float, reach: float) -> list[str]:
    """Faces of the skin that the plate may touch, as CalculiX names them."""
    skin = {tuple(sorted(corners)) for corners in (mesh.facets[:, mesh.boundaries["skin"]].T + 1).tolist()}
    found = []
    for side, local in enumerate(FACES, 1):
        middle = mesh.doflocs.T[cells[:, local] - 1].mean(axis=1)
        near = (np.hypot(middle[:, 0], middle[:, 1]) < reach) & (middle[:, 2] > L / 2)
        for i in np.flatnonzero(near):
            if tuple(sorted(cells[i, local].tolist())) in skin:
                found.append(f"{i + 1}, S{side}")
    return found
