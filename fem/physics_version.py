"""Versions of the models' physics, raised by hand; kept answers are found by them.

A kept answer stays valid while the model would reproduce it within its error estimate. It may become invalid by a
change of an equation, a contact stiffness, the grading of a mesh or an accuracy level; not by a new version of Python
or of a package, a new message, or a faster solver. A change of a model's answers must come with a higher number here:
`tests/test_physics_version.py`, which stores one answer of each kind, fails until both agree.
"""

from __future__ import annotations

from typing import Literal

from fem.scene import Model

PHYSICS: dict[Model | Literal["critical depth", "modes"], int] = {
    "axisymmetric": 1,
    "harmonic": 1,
    "half": 1,
    "full": 1,
    "critical depth": 1,
    "modes": 1,
}
"""Version of each model, and of the critical depth and the natural frequencies, counted from 1."""
