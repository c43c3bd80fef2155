"""One problem for the finite elements: design, loads, accuracy, magnet and model, checked on construction.

Designs of one law that differ only in E, f or scale are the same problem in lengths over D and forces over E D^2, see
`Scene.dimensionless`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fem.accuracy import STANDARD, Accuracy, coarser, level
from geometry.arrays import Array
from geometry.design import BadInput, Design, Shape
from geometry.loads import Load, Magnet, check_kinds, check_load
from geometry.relaxation import Relaxation, lame

if TYPE_CHECKING:
    import skfem

    from fem.model.material import Law

Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]

MOST_HARMONICS = 12
"""Largest number of harmonics that can be requested."""
LEAST_SPOT = 0.01
"""Least radius over D of a gripped area of skin: with the stiffness of a grip's springs a smaller one would slip by
more than a percent."""
FIRST_TOUCH = 1e-14
"""Depth over D up to which there is no contact: smaller depths are lost in the rounding of the beam's length. The
plate's stiffness grows like depth^(-1/2); below this depth it is constant."""
OFF_AXIS = 3.0
"""Additional harmonics over sin t sqrt(R / d), see `orders_needed`. At standard the force of a press on the paper's
sensor then differs from its limit by 0.05 % under 8 degrees at a tenth of D (4 orders), 0.3 % under 20 degrees (6)
and 0.6 % under 40 degrees (8), and at D/40 by 0.1 % under 8 degrees (6) and under 20 degrees (8)."""
PRESS_DEPTH, PRESS_SHARE = 0.25, 0.3
"""Largest depth of scene press of the error rules (`fem.results.error_estimates`), over D and over the silicone above
the magnet (or the base), whichever depth is less. Up to this depth the error decreases as the contact grows (q > 0);
beyond, it hardly decreases, or grows."""
DEEP_RATIO, DEEP_SHARE = 3.3, 0.45
"""Largest depth of their scene deep, over that of press and over the silicone on the axis: the deepest presses of the
study."""
MOST_MODES = 40
"""Largest number of natural frequencies that can be requested."""
DIGITS = 12
"""Significant digits to which the numbers of two dimensionless scenes must agree to be the same."""


@dataclass(frozen=True, slots=True)
class Scene:
    """One problem for the finite elements.

    Attributes
    ----------
    design : the sensor.
    loads : a path of loads of one kind (plate or grip, friction, tilt of the plate, imperfection). The depth under a
        glued plate must not change after the first shear. With Coulomb friction the result depends on the path, which
        may press, release and shear to and fro.
    accuracy : accuracy level of the meshes.
    magnet : "rigid", or "ignored" for a beam that is all silicone.
    model : the model; "auto" is replaced by the smallest model that can carry the loads.
    mesh : tetrahedra in units of D to solve on in place of those of the accuracy; errors are then not estimated.

    Raises
    ------
    BadInput
        The loads do not fit the design, the model, the accuracy or each other.

    Examples
    --------
    >>> from geometry.design import paper
    >>> Scene(paper(), (Load(depth=1.0), Load(depth=2.0))).model
    'axisymmetric'
    """

    design: Design
    loads: tuple[Load, ...]
    accuracy: Accuracy = STANDARD
    magnet: Magnet = "rigid"
    model: Model = "auto"
    mesh: skfem.MeshTet2 | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "accuracy", level(self.accuracy))
        object.__setattr__(self, "loads", tuple(self.loads))
        if not self.loads:
            raise BadInput("a path needs at least one load")
        for load in self.loads:
            check_kinds(self.design, load, self.magnet)
            spot = LEAST_SPOT**2 * self.design.D
            if load.grip is not None and load.grip < spot:
                raise BadInput(f"grip must be at least D/{LEAST_SPOT**-2:.0f} = {spot:.3g} mm; got {load.grip:g} mm")
            check_load(self.design, load, self.magnet)
        object.__setattr__(self, "model", choose_model(self.loads, self.model))
        _check_path(self.loads)
        grip, least = self.loads[0].grip, _least_cap(self.design, self.accuracy)
        if grip is not None and self.solid and grip < least:
            raise BadInput(
                f"grip must be at least {least:.3g} mm for the mesh of this accuracy to resolve it; got {grip:g} mm"
            )

    def coarser(self) -> Scene | None:
        """Return the scene on the mesh for error estimates.

        None on a mesh of one's own, and where the coarser mesh does not resolve the gripped skin.
        """
        accuracy, grip = coarser(self.accuracy), self.loads[0].grip
        if self.mesh is not None:
            return None
        if grip is not None and self.solid and grip < _least_cap(self.design, accuracy):
            return None
        return dataclasses.replace(self, accuracy=accuracy)

    @property
    def solid(self) -> bool:
        """Whether the model consists of tetrahedra."""
        return self.model in ("half", "full")

    @property
    def sheared(self) -> Load | None:
        """The first load that shears the tip, None in a press."""
        return next((load for load in self.loads if load.shears_tip), None)

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector in the user's (x, y) of the model's x axis: the direction of the shear; x without a plane of
        symmetry, and for full."""
        sheared = self.sheared
        return (1.0, 0.0) if sheared is None or self.model == "full" or self.turns else sheared.direction

    @property
    def turn(self) -> Array:
        """Rotation (2, 2) from the user's x and y to the model's."""
        x, y = self.direction
        return np.array([[x, y], [-y, x]])

    def position(self, load: Load) -> Array:
        """Return the position (3,) of plate or grip under a load, over D: depth, and shear in the model's frame."""
        return np.array([load.depth, *(self.turn @ load.imposed_shear)]) / self.design.D

    @property
    def turns(self) -> bool:
        """Whether the loads have no common plane of symmetry."""
        return turns(self.loads)

    @property
    def sideways(self) -> bool:
        """Whether any load shears the tip."""
        return self.sheared is not None

    @property
    def shape(self) -> Shape:
        """The beam's shape over D."""
        return self.design.shape.scaled(1 / self.design.D)

    @property
    def law(self) -> Law:
        """The silicone's law, stresses over E."""
        from fem.model.material import law

        return law(self.design.law, self.design.law_numbers)

    @property
    def grip(self) -> float | None:
        """Height over D within which the skin is gripped, None under a plate."""
        grip = self.loads[0].grip
        return None if grip is None else grip / self.design.D

    @property
    def plate_tilt(self) -> float:
        """Tilt of the plate, rad."""
        return self.loads[0].plate_tilt

    @property
    def coulomb(self) -> float | None:
        """Coefficient of Coulomb friction, None where the plate is frictionless or glued."""
        return self.loads[0].coulomb

    @property
    def push(self) -> float:
        """The imperfection, a dead force along x, over E D^2."""
        return self.loads[0].imperfection / (self.design.E_now * self.design.D**2)

    def harmonics_at(self, depth: float) -> int:
        """Return the number of harmonics for a load at a depth over D, at most MOST_HARMONICS.

        >>> from geometry.design import paper
        >>> scene = Scene(paper(), (Load(depth=0.8, plate_tilt=0.14),))
        >>> scene.harmonics_at(0.1), scene.harmonics_at(0.02), scene.orders_needed(0.02)
        (4, 6, 6)
        """
        return max(self.accuracy.harmonics, min(self.orders_needed(depth), MOST_HARMONICS))

    def orders_needed(self, depth: float) -> int:
        """Return the number of harmonics that a load at a depth over D needs, more the farther off the axis it is.

        A plate tilted by an angle t touches the dome at R sin t from the axis. There a contact of radius a =
        sqrt(R d) fills an angle of about a / (R sin t) to each side, so the number of orders that resolve it grows
        like x = sin t sqrt(R / d), see OFF_AXIS.
        """
        least = self.accuracy.harmonics
        if not self.plate_tilt or depth <= FIRST_TOUCH:
            return least
        away = math.sin(abs(self.plate_tilt)) * math.sqrt(self.shape.R / depth)
        return least + math.ceil(OFF_AXIS * away)

    def dimensionless(self) -> dict[str, Any]:
        """Return all values that the states depend on: lengths over D, forces over E D^2, angles in rad.

        Numbers are rounded to DIGITS significant digits, so that similar designs give equal values.
        """
        D = self.design.D
        shape = self.design.shape if self.magnet == "rigid" else self.design.shape.without_magnet()
        loads = [
            {
                "depth": load.depth / D,
                "shear": [load.shear_x / D, load.shear_y / D],
                "friction": load.friction,
                "grip": None if load.grip is None else load.grip / D,
                "plate_tilt": load.plate_tilt,
                "imperfection": load.imperfection / (self.design.E_now * D**2),
            }
            for load in self.loads
        ]
        # states of all levels have the keys of stores made before the last two were fields
        left_out = {"name": self.accuracy.name, "coarseness": 1.0, "tolerance_factor": 1.0}
        accuracy = {k: v for k, v in dataclasses.asdict(self.accuracy).items() if v != left_out.get(k)}
        content = {
            "shape": dataclasses.asdict(shape.scaled(1 / D)),
            "nu": self.design.nu,
            "law": [self.design.law, *self.design.law_numbers],
            "loads": loads,
            "accuracy": accuracy,
            "magnet": self.magnet,
            "model": self.model,
        }
        return {name: _rounded(value) for name, value in content.items()}


def choose_model(loads: Sequence[Load], model: Model) -> Model:
    """Return the smallest model that can carry the loads, or the requested one; raises BadInput if that cannot.

    >>> choose_model([Load(depth=1.0)], "auto")
    'axisymmetric'
    """
    sideways = any(load.shears_tip or load.imperfection for load in loads)
    tilted = any(load.plate_tilt for load in loads)
    if model not in ("auto", "axisymmetric", "harmonic", "half", "full"):
        raise BadInput(f"model must be auto, axisymmetric, harmonic, half or full; got {model!r}")
    if model == "axisymmetric" and sideways:
        raise BadInput("model axisymmetric cannot carry a shear or an imperfection: choose auto or harmonic")
    if model == "axisymmetric" and tilted:
        raise BadInput("model axisymmetric cannot carry a tilted plate: choose auto or harmonic")
    if model == "half" and turns(loads):
        raise BadInput("model half carries shear and tilt in one plane only: choose auto, harmonic or full")
    if model == "auto":
        return "harmonic" if sideways or tilted else "axisymmetric"
    return model


def turns(loads: Sequence[Load]) -> bool:
    """Return whether loads have no common plane of symmetry.

    Their shears are along two lines, or not along the tilt or the imperfection.

    >>> tilted = Load(depth=1.0, shear_y=0.5, friction="stick", plate_tilt=0.1)
    >>> turns([tilted]), turns([Load(depth=1.0, shear_y=0.5, friction="stick")])
    (True, False)
    """
    fixed = {0.0} if any(load.plate_tilt or load.imperfection for load in loads) else set()
    return len({load.axis for load in loads if load.shears_tip} | fixed) > 1


def silicone_on_axis(design: Design, magnet: Magnet) -> float:
    """Return the thickness of the silicone on the axis, above and below a rigid magnet, mm."""
    return design.L - (design.magnet_height if magnet == "rigid" else 0.0)


def press_limits(design: Design, magnet: Magnet) -> tuple[float, float]:
    """Return the largest depths of the error rules' scenes press and deep, mm.

    >>> from geometry.design import paper
    >>> [round(depth, 9) for depth in press_limits(paper(), "rigid")]
    [0.9, 2.97]
    """
    rigid = magnet == "rigid"
    first = min(PRESS_DEPTH * design.D, PRESS_SHARE * (design.R - design.magnet_height / 2 if rigid else design.L))
    return first, min(DEEP_RATIO * first, DEEP_SHARE * silicone_on_axis(design, magnet))


def relaxed(design: Design, relaxation: Relaxation) -> Design:
    """Return the design whose E and nu are those at rest: the bulk modulus stays, the shear modulus relaxes.

    >>> from geometry.design import paper
    >>> from geometry.relaxation import Relaxation
    >>> import dataclasses
    >>> relaxed(dataclasses.replace(paper(), nu=0.5, modulus="instantaneous"), Relaxation((0.5,), (1.0,))).E
    0.5
    """
    if design.modulus == "long-term" or relaxation.rest == 1:
        return design
    mu, inverse_K = lame(design.E, design.nu)
    mu *= relaxation.rest
    # 9 / E = 3 / mu + 1 / K and 2 mu (1 + nu) = E
    E = 9 / (3 / mu + inverse_K)
    return dataclasses.replace(design, E=E, nu=E / (2 * mu) - 1)


def check_glued(design: Design, depth: float, magnet: Magnet) -> None:
    """Refuse a depth, mm, at which there is no contact area to shear."""
    check_load(design, Load(depth=depth), magnet)
    if not depth > 0:
        raise BadInput(f"depth must be above 0 mm for a shear, which needs a contact area; got {depth:g} mm")


def _check_path(loads: Sequence[Load]) -> None:
    """Refuse loads of different kinds, a change of depth under a glued plate, and gluing without contact."""
    if any(load.unmoved != loads[0].unmoved for load in loads):
        raise BadInput("all loads of a path must have the same grip, friction, plate tilt and imperfection")
    glued: float | None = None
    for load in loads:
        if glued is not None and load.depth != glued:
            raise BadInput(
                f"the plate has stuck to the tip since depth {glued:g} mm and cannot move to {load.depth:g} mm: "
                "press to the full depth before the shear"
            )
        if load.bonds_contact:
            if load.depth == 0:
                raise BadInput(
                    "a shear with friction stick needs a depth above 0 mm: at depth 0 nothing is in contact"
                )
            glued = load.depth


def _least_cap(design: Design, accuracy: Accuracy) -> float:
    """Return the least height, mm, of a gripped cap that is two elements of a solid wide."""
    return 2 * (2 * accuracy.solid_patch) ** 2 * design.D**2 / design.R / 4


def _rounded(value: Any) -> Any:
    """Return a plain value with its numbers rounded to DIGITS significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") + 0.0
    if isinstance(value, dict):
        return {name: _rounded(part) for name, part in value.items()}
    return [_rounded(part) for part in value] if isinstance(value, (list, tuple)) else value
