"""Whether an equilibrium is stable, by the inertia of its stiffness: stable, unstable, or unknown.

By Sylvester's law of inertia the pivots D of a symmetric matrix K = L D L^T have the signs of its eigenvalues. Each
pressure of a saddle point adds a negative eigenvalue; those beyond them are directions in which the body is unstable.
The count is unknown where the stiffness is unsymmetric (a slipping contact) or its pivots do not have these signs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NoReturn

import numpy as np

from geometry.arrays import Array

Verdict = Literal["stable", "unstable", "unknown"]


@dataclass(frozen=True, slots=True)
class Stability:
    """Whether an equilibrium is stable. It has no truth value, so that what is unknown cannot be taken for either.

    Attributes
    ----------
    directions : number of unstable directions; None where it is unknown.

    Examples
    --------
    >>> Stability(0).verdict, Stability(2).verdict, UNKNOWN.verdict
    ('stable', 'unstable', 'unknown')
    >>> (Stability(1) + UNKNOWN).verdict
    'unstable'
    """

    directions: int | None

    @classmethod
    def counted(cls, negative: int | None, pressures: int) -> Stability:
        """Return the stability of a body with a number of pressures, from its number of negative eigenvalues.

        With fewer negative eigenvalues than pressures the pivots cannot have been those of a saddle point.

        >>> Stability.counted(7, 6), Stability.counted(5, 6), Stability.counted(None, 6)
        (Stability(directions=1), Stability(directions=None), Stability(directions=None))
        """
        return UNKNOWN if negative is None or negative < pressures else cls(negative - pressures)

    @property
    def verdict(self) -> Verdict:
        if self.directions is None:
            return "unknown"
        return "unstable" if self.directions else "stable"

    @property
    def is_stable(self) -> bool:
        return self.verdict == "stable"

    @property
    def is_unstable(self) -> bool:
        return self.verdict == "unstable"

    @property
    def is_unknown(self) -> bool:
        return self.verdict == "unknown"

    def __add__(self, other: Stability) -> Stability:
        """Return the stability against the directions of both; one unstable direction is enough to know it."""
        known = [each.directions for each in (self, other) if each.directions is not None]
        return UNKNOWN if len(known) < 2 and not any(known) else Stability(sum(known))

    def __bool__(self) -> NoReturn:
        raise TypeError("a stability may be unknown: ask whether it is_stable, is_unstable or is_unknown")


STABLE, UNKNOWN = Stability(0), Stability(None)


def count_negative(symmetric: Array) -> int:
    """Return the number of negative eigenvalues of a dense symmetric matrix (n, n)."""
    return int(np.count_nonzero(np.linalg.eigvalsh(symmetric) < 0))
