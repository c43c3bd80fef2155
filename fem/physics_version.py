"""Versions of the models' physics, by which kept answers are found again: raised by hand.

An answer that is kept stays good as long as the model would give it again within its error estimate. What may change
it is an equation, a contact stiffness, the grading of a mesh or an accuracy level; a new version of Python or of a
package, a message, or a faster solver does not. So whoever changes the answers of a model raises its number here, and
`tests/test_physics_version.py`, which holds an answer of each kind, fails until both agree.
"""

from __future__ import annotations

from fem.scene import Model

PHYSICS: dict[Model, int] = {"axisymmetric": 1, "harmonic": 1, "half": 1, "full": 1}
"""Version of each model, from 1 up."""
