"""How far the force by a level of the formulas is from that of level finite, at the poses that were decoded.

The levels below finite are made for small loads, and the paper's for a bar without contact or magnet: on the paper's
sensor its press force is a third of that of finite elements. So both forces are compared at the same shift of the
magnet, where level finite was set beside finite elements (`analytic.beam.outside`). Forces in N, lengths in mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from analytic.inverse import response_surface
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load

if TYPE_CHECKING:
    from analytic.inverse.response_surface import Mechanics


BEST = "finite"
"""The level that the others are compared with."""
APART = 0.1
"""Difference of the forces, over that of level finite, from which it is said."""
REMEDY = "add --level finite, or give states solved by finite elements with --responses"


@dataclass(frozen=True, slots=True)
class Gap:
    """Forces of a level and of level finite at the same poses, one row each.

    Attributes
    ----------
    own, best : sizes of the forces, shape (n,), N; NaN for no force, and for a pose outside level finite's range.
    apart : size of their difference, shape (n,), N.
    finite : force of level finite, (F_x, F_y, F_n), shape (n, 3), N.
    slack : difference that the decoder's polynomials for level finite may make, N.
    """

    own: Array
    best: Array
    apart: Array
    finite: Array
    slack: float

    @property
    def wide(self) -> NDArray[np.bool_]:
        """Where the forces differ by more than `APART`."""
        return np.asarray(self.apart > np.maximum(APART * self.best, self.slack))

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """Where there is a force, and level finite cannot say how good it is."""
        return np.asarray((self.own > 0) & np.isnan(self.best))


def finite_force(design: Design, law: Mechanics | None, shift: Array) -> Array:
    """Force by level finite at shifts (n, 3), mm; NaN outside the range in which it was set beside finite elements.

    Parameters
    ----------
    law : the mechanics of level finite; None where it cannot carry the design.

    Returns
    -------
    force : (F_x, F_y, F_n), shape (n, 3), N.
    """
    if law is None:
        return np.full(shift.shape, np.nan)
    force, load, _ = response_surface.force_and_load(law, np.ascontiguousarray(shift.T))
    low, high = response_surface.workspace(design, law)
    inside = ((shift >= low) & (shift <= high)).all(axis=1) & (load[0] <= beam.DEEPEST * design.D)
    inside &= np.hypot(load[1], load[2]) <= beam.FARTHEST * design.D
    inside &= not beam.outside(design, Load(), BEST)
    return np.where(inside, force, np.nan).T


def gap(design: Design, law: Mechanics | None, shift: Array, force: Array) -> Gap:
    """Forces (n, 3), N, of a level at shifts (n, 3), mm, beside those of level finite; `law` as in `finite_force`."""
    best = finite_force(design, law, shift)
    own, size, apart = (np.sqrt((values**2).sum(axis=1)) for values in (force, best, force - best))
    return Gap(own, size, apart, best, max(law.errors[1:3]) if law else 0.0)


def warnings(level: str, found: Gap) -> list[str]:
    """What is to be said of a level's forces: where they are far from level finite's, and where that is not known."""
    said, count = [], len(found.own)
    wide, unknown = np.flatnonzero(found.wide), np.flatnonzero(found.unknown)
    if len(wide):
        shares = found.apart[wide] / np.maximum(found.best[wide], found.slack)
        worst, share = int(wide[shares.argmax()]), 100 * shares.max()
        own, best = found.own[worst], found.best[worst]
        if count == 1:
            where = f"level {level} gives a force of {own:.3g} N at this pose, level {BEST} {best:.3g} N"
            said.append(f"{where} (they differ by {share:.3g} %): {REMEDY}")
        else:
            where = (
                f"in {len(wide)} of {count} rows the force of level {level} differs by more than {100 * APART:g} %"
            )
            most = f"by {share:.3g} % in row {worst + 1} ({own:.3g} N, not {best:.3g} N)"
            said.append(f"{where} from that of level {BEST}, at most {most}: {REMEDY}")
    if len(unknown):
        what = "this pose is" if count == 1 else f"poses of {len(unknown)} of {count} rows are"
        said.append(
            f"{what} outside the range of level {BEST}, so the error of the force of level {level} is unknown: give "
            "states solved by finite elements with --responses"
        )
    return said
