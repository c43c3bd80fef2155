"""Compare the force by a level of the formulas with that by level finite, at the decoded poses.

The levels below finite assume small loads, and level paper a bar without contact or magnet: on the paper's sensor its
press force is a third of that by finite elements. Both forces are therefore compared at the same shift of the magnet,
within the range in which level finite was compared with finite elements (`analytic.beam.outside`). Forces in N,
lengths in mm.
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
"""The level with which the others are compared."""
APART = 0.1
"""Difference of the forces, over that of level finite, above which a warning is given."""
REMEDY = "add --level finite, or give states solved by finite elements with --responses"


@dataclass(frozen=True, slots=True)
class Gap:
    """Forces of a level and of level finite at the same poses, one row each.

    Attributes
    ----------
    chosen, best : sizes of the forces, shape (n,), N; NaN for no force, and for a pose outside level finite's range.
    apart : size of their difference, shape (n,), N.
    finite : force of level finite, (F_x, F_y, F_n), shape (n, 3), N.
    slack : error of the polynomials by which the decoder represents level finite, N.
    """

    chosen: Array
    best: Array
    apart: Array
    finite: Array
    slack: float

    @property
    def wide(self) -> NDArray[np.bool_]:
        """Rows in which the forces differ by more than `APART`, shape (n,)."""
        return np.asarray(self.apart > np.maximum(APART * self.best, self.slack))

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """Rows with a force outside the range of level finite, so that its error is unknown, shape (n,)."""
        return np.asarray((self.chosen > 0) & np.isnan(self.best))


def finite_force(design: Design, law: Mechanics | None, shift: Array) -> Array:
    """Return the force by level finite at shifts (n, 3), mm; NaN outside the range of `analytic.beam.outside`.

    Parameters
    ----------
    law : the mechanics of level finite; None if this level refuses the design.

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
    """Compare forces (n, 3), N, of a level at shifts (n, 3), mm, with level finite; `law` as in `finite_force`."""
    best = finite_force(design, law, shift)
    chosen, size, apart = (np.sqrt((values**2).sum(axis=1)) for values in (force, best, force - best))
    return Gap(chosen, size, apart, best, max(law.errors[1:3]) if law else 0.0)


def warnings(level: str, found: Gap) -> list[str]:
    """Return warnings: forces that differ much from level finite, and forces whose error is unknown."""
    said, count = [], len(found.chosen)
    wide, unknown = np.flatnonzero(found.wide), np.flatnonzero(found.unknown)
    if len(wide):
        shares = found.apart[wide] / np.maximum(found.best[wide], found.slack)
        worst, share = int(wide[shares.argmax()]), 100 * shares.max()
        chosen, best = found.chosen[worst], found.best[worst]
        if count == 1:
            where = f"level {level} gives a force of {chosen:.3g} N at this pose, level {BEST} {best:.3g} N"
            said.append(f"{where} (they differ by {share:.3g} %): {REMEDY}")
        else:
            where = (
                f"in {len(wide)} of {count} rows the force of level {level} differs by more than {100 * APART:g} %"
            )
            most = f"by {share:.3g} % in row {worst + 1} ({chosen:.3g} N, not {best:.3g} N)"
            said.append(f"{where} from that of level {BEST}, at most {most}: {REMEDY}")
    if len(unknown):
        what = "this pose is" if count == 1 else f"poses of {len(unknown)} of {count} rows are"
        said.append(
            f"{what} outside the range of level {BEST}, so the error of the force of level {level} is unknown: give "
            "states solved by finite elements with --responses"
        )
    return said
