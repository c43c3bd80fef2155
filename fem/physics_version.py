"""Versions of the models' physics and of the error estimates, raised by hand; kept answers are found by them.

A kept answer stays valid while the model would reproduce it within its error estimate. It may become invalid by a
change of an equation, a contact stiffness, the grading of a mesh or an accuracy level; not by a new version of Python
or of a package, a new message, or a faster solver. A quantity that all answers get (version 2: the largest strain
and the sideways stiffness) counts as a change, because older answers lack it. A change of a model's answers must come
with a higher number here: `tests/test_physics_version.py`, which stores one answer of each kind, fails until both
agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from fem.scene import Model

PHYSICS: dict[Model | Literal["critical depth", "modes", "response", "cycle"], int] = {
    "axisymmetric": 3,
    "harmonic": 3,
    "half": 3,
    "full": 3,
    "critical depth": 1,
    "modes": 2,
    "response": 4,
    "cycle": 3,
}
"""Version of each model, and of the critical depth, natural frequencies, vibrations and cycles, counted from 1."""

ESTIMATES = 2
"""Version of the error estimates of all models, counted from 1: of the coarser mesh and of the rules. Kept answers
are found by it too. Nothing rests on it that is made of the answers alone: neither the rules, which carry the version
of the physics, nor the surrogate."""


def outdated(made: Mapping[str, Any], today: Mapping[Any, Any]) -> list[str]:
    """Return the names of today's versions that are other ones than those with which something was made.

    Rules, the surrogate and the choice of models by a tolerance are checked by this function before they answer.

    >>> outdated({"modes": 2, "half": 2}, {"modes": 2, "half": 3, "full": 3})
    ['half', 'full']
    """
    return [name for name, version in today.items() if made.get(name) != version]
