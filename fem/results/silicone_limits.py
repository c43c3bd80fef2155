"""How far a state is from the limits of the silicone: of its law, of its free skin, and of its strength.

A law is stable in Drucker's sense at given principal stretches if d(tau) : d(h) > 0 for every volume-preserving
change of their logarithms h (tau: Kirchhoff stress). A pressure adds the same amount to all components of tau, so it
does not change this. Where a law is unstable, strain localises in ever smaller zones that no mesh resolves: a solve
ends there, or its result depends on the mesh.

A free surface of a stable law folds into creases where it is compressed along itself: for a neo-Hookean solid where
the stretch normal to it is CREASE times the least one along it (Hong, Zhao and Suo, Appl. Phys. Lett. 95, 2009). A
crease has no length of its own and needs a small disturbance to open. A mesh therefore opens it anywhere between this
ratio and 3.4, where the smooth surface becomes unstable (Biot), and its depth of onset moves with the mesh although
the crease is one of the silicone.

The principal stretches are the square roots of the eigenvalues of C = F^T F; the largest principal nominal strain at
a point is lambda_1 - 1. Its maximum over the body is no property of the body: at the edge of the bonded magnet and of
the clamped base it grows with every finer mesh. So the volume decides: the strain of a state, a measure of how far it
is from tearing, is the value that `VOLUME_SHARE` of the silicone's volume stays below, by the volumes of the
integration points.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from fem.model import elements
from fem.model.elements import Elements
from fem.model.material import Law, evaluate, neo_hookean, ogden, yeoh
from fem.model.nonlinear_system import System
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.compiled import compiled

REACH = 1.1
"""Factor on the logarithmic strains of a state that has no next one: the next state would have had larger strains."""
STEPS, BATCH = 200, 256
"""Steps in which the strain at the loss of stability is searched for, and elements per batch."""
VOLUME_SHARE = 0.999
"""Share of the silicone's volume that stays below the strain of a state."""


def stress_and_stiffness(silicone: Law, h: Array) -> tuple[Array, Array]:
    """Return the Kirchhoff stresses (n, 3) without pressure, and their derivatives by h (n, 3, 3), both over mu.

    h : (n, 3) logarithms of the principal stretches, which add up to 0.
    """
    stretch = np.exp(h)
    _, P, A = evaluate(silicone, np.einsum("ij,nj->ijn", np.eye(3), np.expm1(h)))
    tau = np.einsum("iin->ni", P) * stretch
    slopes = A[::4, ::4].transpose(2, 0, 1)
    return tau, slopes * stretch[:, :, None] * stretch[:, None, :] + tau[:, :, None] * np.eye(3)


def least_stiffness(D: Array) -> Array:
    """Return the least d(tau) : d(h) over mu (n,), D = d(tau)/dh (n, 3, 3), for a volume-preserving unit change.

    >>> from fem.model.material import neo_hookean
    >>> round(float(least_stiffness(stress_and_stiffness(neo_hookean, np.zeros((1, 3)))[1])[0]), 12)
    2.0
    """
    # volume-preserving changes of h add up to zero: they lie in the plane normal to (1, 1, 1)
    plane = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])
    return np.asarray(np.linalg.eigvalsh(plane @ D @ plane.T)[:, 0])


def logarithmic_strains(e: Elements, part: slice, u: Array) -> Array:
    """Return the logarithms of the principal stretches at the points of elements, less their mean, shape (n, 3)."""
    G = elements.gradient(e, part, u).reshape(3, 3, -1)
    h = np.log(np.linalg.svd(np.moveaxis(G, -1, 0) + np.eye(3), compute_uv=False))
    return np.asarray(h - h.mean(axis=1, keepdims=True))


def always_stable(silicone: Law) -> bool:
    """Return whether a law of `geometry.design.Design` is stable at every stretch.

    All are, except Yeoh's with a negative constant. The energies of the others are sums of exponentials of h with
    positive factors, and therefore convex. I1' - 3 is such a sum and not negative, so its powers are convex too.
    False for any other law, of which this is not known.
    """
    if silicone is neo_hookean:
        return True
    if not isinstance(silicone, functools.partial) or silicone.func not in (ogden, yeoh):
        return False
    factors = silicone.keywords["shares"] if silicone.func is ogden else silicone.keywords.values()
    return bool(min(factors) >= 0)


def find_loss(system: System, u: Array, reach: float = REACH) -> Array | None:
    """Return the principal stretches (3,), largest first, where the law loses stability in a body; None if nowhere.

    They are searched for on the straight line from zero strain to `reach` times the logarithmic strains of the point
    where the law is least stable: 1 for the state itself, REACH for the state that would follow.
    """
    if always_stable(system.law):
        return None
    e, worst, where = system.elements, 0.0, np.zeros(3)
    for at in range(0, len(e.cells), BATCH):
        h = reach * logarithmic_strains(e, slice(at, at + BATCH), u)
        stiffness = least_stiffness(stress_and_stiffness(system.law, h)[1])
        lowest = int(np.argmin(stiffness))
        if stiffness[lowest] < worst:
            worst, where = float(stiffness[lowest]), h[lowest]
    if worst == 0:
        return None
    line = np.linspace(0, 1, STEPS + 1)[:, None] * where
    first = int(np.argmax(least_stiffness(stress_and_stiffness(system.law, line)[1]) <= 0))
    return np.asarray(np.exp(line[first]))


def contact_pressure(state: PathState) -> float | None:
    """Return the largest pressure on the skin over E, per deformed area; None off the axis, and on a mesh too coarse.

    The facet in which the contact ends, and the one beside it, are left out: there the springs of single points carry
    what the facet's other points, which do not touch, cannot. The pressure of a smooth contact is largest near the
    axis and falls to 0 at its end (Hertz: p0 = 3 F / (2 pi a^2)), so nothing is lost where three facets touch.
    """
    if state.d.model != "axisymmetric" or state.plate.height is None:
        return None
    along, around = state.skin_stretches
    whole = np.flatnonzero((state.overlap > 0).all(axis=1))
    outermost = state.skin.radii[whole].max(axis=1, initial=0.0).argsort()[-1:]
    inner = np.delete(whole, outermost)
    pressure = state.plate.stiffness * state.overlap / (along * around)
    return float(pressure[inner].max()) if len(inner) else None


def largest_strain(e: Elements, u: Array) -> float:
    """Return the largest principal nominal strain that `VOLUME_SHARE` of the volume stays below; 0.3 is 30 %."""
    strains = []
    for at in range(0, len(e.cells), BATCH):
        G = elements.gradient(e, slice(at, at + BATCH), u).reshape(3, 3, -1)
        strains.append(np.sqrt(largest_eigenvalue(G + np.eye(3)[:, :, None])) - 1)
    strain, volume = np.concatenate(strains), elements.volumes(e, slice(None)).ravel()
    order = np.argsort(strain)
    below = np.cumsum(volume[order])
    return float(np.interp(VOLUME_SHARE * below[-1], below, strain[order]))


def largest_eigenvalue(F: Array) -> Array:
    """Return the largest eigenvalue of C = F^T F for each of the gradients F (3, 3, n), shape (n,).

    By the trigonometric solution of the characteristic polynomial (Smith 1961); where two eigenvalues are equal it is
    exact to 1e-8 only.

    >>> rotated = np.array([[0.0, -2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> largest_eigenvalue(rotated[:, :, None]).tolist(), largest_eigenvalue(np.eye(3)[:, :, None]).tolist()
    ([4.0], [1.0])
    """
    largest = np.empty(F.shape[2])
    _write_largest_eigenvalues(np.ascontiguousarray(F).reshape(9, -1), largest)
    return largest


@compiled
def _write_largest_eigenvalues(F: Array, largest: Array) -> None:
    a, b, c, d, e, f, g, h, k = F
    for n in range(len(largest)):
        xx, yy, zz = (
            a[n] * a[n] + b[n] * b[n] + c[n] * c[n],
            d[n] * d[n] + e[n] * e[n] + f[n] * f[n],
            g[n] * g[n] + h[n] * h[n] + k[n] * k[n],
        )
        xy, yz, zx = (
            a[n] * d[n] + b[n] * e[n] + c[n] * f[n],
            d[n] * g[n] + e[n] * h[n] + f[n] * k[n],
            g[n] * a[n] + h[n] * b[n] + k[n] * c[n],
        )
        mean = (xx + yy + zz) / 3
        xx, yy, zz = xx - mean, yy - mean, zz - mean
        spread = math.sqrt((xx * xx + yy * yy + zz * zz + 2 * (xy * xy + yz * yz + zx * zx)) / 6)
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * zx) + zx * (xy * yz - yy * zx)
        # an undeformed point has no direction of largest stretch
        share = det / (2 * spread**3) if spread > 0 else 1.0
        largest[n] = mean + 2 * spread * math.cos(math.acos(min(max(share, -1.0), 1.0)) / 3)
