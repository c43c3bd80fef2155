"""The stress that a time step of a viscoelastic law adds to the elements, see `fem.model.viscoelasticity`.

Arrays over all points have the shape (..., t, m, q), see `fem.model.viscous_history`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model import viscoelasticity as laws
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

    def part(self, elements: slice) -> Overstress:
        """Return the overstress of some elements, with points (t m q,) as in `element_loops`."""

        def pick(values: Array) -> Array:
            own = values[..., elements, :]
            return own.reshape(*own.shape[:-3], -1)

        H = None if self.H is None else pick(self.H)
        return Overstress(
            self.factor, H, tuple(ViscousBranch(pick(one.A), pick(one.b), one.share) for one in self.branches)
        )

    def energy(self, C: Array, J: Array, mu: Array) -> Array:
        """Return the energy (...) over E beside the scaled law.

        Parameters
        ----------
        C, J : right Cauchy-Green tensor (6, ...) and volume ratio (...).
        mu : shear modulus over E.
        """
        W = np.zeros(J.shape)
        if self.H is not None:
            unit = np.array([1.0, 1, 1, 0, 0, 0]).reshape(6, *(1,) * J.ndim)
            W = W + laws.contract(self.H, C - unit) / 2
        for one in self.branches:
            W = W + laws.branch_stress(one.A, one.b, C, J, one.share * mu)[0]
        return W
