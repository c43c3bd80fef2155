"""The stress that a time step of a viscoelastic law adds to the elements, see `fem.viscoelasticity`.

Arrays over all points have the shape (..., t, m, q), see `fem.discretisation.viscous_history`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem import material
from fem import viscoelasticity as laws
from geometry.arrays import Array


@dataclass(frozen=True, slots=True)
class ViscousBranch:
    """A branch of the law "finite" in one step: A (6, t, m, q), b (t, m, q) of `viscous_step`, g_i mu0 over mu."""

    A: Array
    b: Array
    share: float


@dataclass(frozen=True, slots=True)
class Overstress:
    """What a step adds to the elastic law: a factor on its modulus, a dead stress, and branches.

    Attributes
    ----------
    factor : factor on the isochoric law.
    H : (6, t, m, q) dead second Piola-Kirchhoff stress over E; None without.
    branches : branches of the law "finite".
    """

    factor: float
    H: Array | None = None
    branches: tuple[ViscousBranch, ...] = ()

    def part(self, elements: slice, *, angles_first: bool = False) -> Overstress:
        """Return the overstress of some elements, with points (m, q t) as in `element_integrals`.

        angles_first : points (t m q,) as in `element_loops` instead.
        """

        def pick(values: Array) -> Array:
            own = values[..., elements, :]
            if angles_first:
                return own.reshape(*own.shape[:-3], -1)
            own = np.moveaxis(own, -3, -1)
            return own.reshape(*own.shape[:-2], -1)

        H = None if self.H is None else pick(self.H)
        return Overstress(
            self.factor, H, tuple(ViscousBranch(pick(one.A), pick(one.b), one.share) for one in self.branches)
        )

    def stress(self, C: Array, J: Array, mu: Array, *, tangent: bool) -> tuple[Array, Array, Array | None]:
        """Return energy (...), stress (6, ...) and its tangent 2 dS/dC (6, 6, ...) beside the scaled law.

        Parameters
        ----------
        mu : modulus E's shear modulus; results are over E.
        """
        unit = np.array([1.0, 1, 1, 0, 0, 0]).reshape(6, *(1,) * J.ndim)
        W, S = np.zeros(J.shape), np.zeros(C.shape)
        CC: Array | None = None
        if self.H is not None:
            W, S = W + laws.contract(self.H, C - unit) / 2, S + self.H
        for one in self.branches:
            own = laws.branch_stress(one.A, one.b, C, J, one.share * mu, tangent=tangent)
            W, S = W + own[0], S + own[1]
            if tangent:
                CC = own[2] if CC is None else CC + own[2]
        return W, S, CC

    def add(self, k: material.Kinematics, mu: Array, weights: Array, W: Array, P: Array, A: Array) -> None:
        """Add energy, stress and tangent, all times weights, to those of `fem.material`, for `part` of the elements.

        P_iJ gains F_iI S_IJ, and its tangent delta_ik S_JL + F_iI F_kK (2 dS/dC)_IJKL.
        """
        C, F = laws.cauchy_green(k.G), k.G + np.eye(3).reshape(3, 3, *(1,) * k.Jm1.ndim)
        energy, S, CC = self.stress(C, 1 + k.Jm1, mu, tangent=k.tangent)
        stress = laws.full(weights * S)
        W += weights * energy
        P += np.einsum("iI...,IJ...->iJ...", F, stress)
        if not k.tangent:
            return
        places = range(9) if k.components is None else k.components
        for a, one in enumerate(places):
            for b, other in enumerate(places):
                if one // 3 == other // 3:
                    A[a, b] += stress[one % 3, other % 3]
        if CC is not None:
            _add_pushed(F, weights * CC, tuple(places), A)


def _add_pushed(F: Array, CC: Array, places: tuple[int, ...], A: Array) -> None:
    """Add F_iI F_kK CC_IJKL to tangents A (c, c, ...), for symmetric CC (6, 6, ...)."""
    own = laws.PLACES
    half = np.stack([sum(F[p // 3, I] * CC[own[I, p % 3]] for I in range(3)) for p in places])
    for a in range(len(places)):
        for b, other in enumerate(places):
            k, L = divmod(other, 3)
            for K in range(3):
                A[a, b] += F[k, K] * half[a, own[K, L]]
