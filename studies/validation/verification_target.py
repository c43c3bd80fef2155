"""A problem that `verify` solves, with its published quantities and their tolerances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

Judged = Literal["finest", "extrapolated", "order"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One published number and the tolerance of the computed one, in the same unit."""

    name: str
    published: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class Target:
    """A problem with published quantities.

    Attributes
    ----------
    solve : returns the quantities on mesh n.
    meshes, quick : meshes of a full and of a reduced run; the reduced run skips a target without meshes.
    judged : which number is checked: value on the finest mesh, extrapolated value, or order of convergence.
    """

    name: str
    source: str
    solve: Callable[[int], Sequence[float]]
    quantities: tuple[Quantity, ...]
    meshes: tuple[int, ...] = (1,)
    quick: tuple[int, ...] = (1,)
    judged: Judged = "finest"
    note: str = ""


def relative(name: str, published: float, tolerance: float) -> Quantity:
    """Return a quantity whose tolerance is relative."""
    return Quantity(name, published, tolerance * abs(published))
