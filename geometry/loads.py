"""The load on the sensor (`Load`) and the sensor's response (`Response`).

Formulas and finite elements both take a `Load` and return a `Response`.
"""

import dataclasses
import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, get_args

from geometry.bad_input import BadInput, known_fields
from geometry.design import Design

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Load", "Response"]

Magnet = Literal["rigid", "ignored"]
Waveform = Literal["triangle", "sine"]
Angle = TypeVar("Angle", float, "NDArray[np.float64]")
ANSWERED = ("ok", "unstable", "unknown")
"""Statuses of a state that carries its whole load, so that its numbers count; every other one has no answer."""
STEEPEST = 0.7
"""Largest tilt of a plate, rad: a steeper plate touches the cylindrical wall of the beam soon after the dome."""


def _of_load(
    default: Any,
    unit: str,
    text: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    open_low: bool = False,
    names: tuple[str, ...] = (),
    column: str = "",
    slider: tuple[float, float] | None = None,
    sideways: bool = False,
) -> Any:
    about = {"unit": unit, "text": text, "low": low, "high": high, "open_low": open_low, "names": names}
    ways = {"column": column, "slider": slider or (low, high), "sideways": sideways}
    return field(default=default, metadata={**about, **ways})


@known_fields
@dataclass(frozen=True, slots=True)
class Load:
    """The prescribed motion of a flat rigid plate, or of a grip that holds the tip.

    The metadata of a field are what tables, options and pages take: the unit there (angles in degrees), the range of
    its numbers (`open_low`: without the lower bound), names beside numbers, a description, and its name there
    (`column`) if that is another one, the part of the range that designers use (`slider`), and whether it acts
    sideways.

    Attributes
    ----------
    depth : travel of the plate along -z after first touch, mm.
    shear_x, shear_y : sideways travel of the plate after the press, or of the grip, mm.
    friction : "none"; "stick": the press is frictionless, then the contact area is bonded to the plate and moves
        sideways with it; or a Coulomb coefficient that acts from first touch on.
    plate_tilt : rotation of the plate about y that carries its normal from z towards x, rad. The plate still moves
        along z, by `depth` after first touch.
    imperfection : dead force along x, spread over the dome, N. It selects the side to which a press buckles, so that
        the solution can be followed beyond buckling.
    grip : height of the held part of the tip, mm. There is no plate: every surface point within this height of the
        tip moves sideways by the shear, and u_z is free.

    Raises
    ------
    BadInput
        A value is not finite, a value is negative where that is not allowed, or two values exclude each other.

    >>> Load(depth=1.0, shear_x=0.5, friction=0.6).shears_tip
    True
    """

    depth: float = _of_load(0.0, "mm", "travel of the plate after first touch", low=0.0, open_low=True)
    shear_x: float = _of_load(
        0.0, "mm", "displacement of the plate or the grip along x", column="shear", sideways=True
    )
    shear_y: float = _of_load(0.0, "mm", "displacement of the plate or the grip along y", sideways=True)
    friction: float | Literal["none", "stick"] = _of_load(
        "none",
        "1",
        "friction of the plate: none, stick (during a shear the contact area sticks to the plate), or a Coulomb "
        "coefficient, from first touch on",
        low=0.0,
        names=("none", "stick"),
    )
    grip: float | None = _of_load(
        None,
        "mm",
        "height below the tip within which a grip, in place of the plate, holds all surface points",
        low=0.0,
        open_low=True,
    )
    plate_tilt: float = _of_load(
        0.0,
        "deg",
        "rotation of the plate about y; positive values turn its normal from z towards x",
        low=-float(math.floor(math.degrees(STEEPEST))),
        high=float(math.floor(math.degrees(STEEPEST))),
        sideways=True,
    )
    imperfection: float = _of_load(
        0.0, "N", "dead force on the dome along x; it selects the direction in which a press buckles", sideways=True
    )

    def __post_init__(self) -> None:
        for spec in dataclasses.fields(self):
            value = getattr(self, spec.name)
            if spec.name in ("friction", "grip"):
                continue
            if not _is_number(value):
                raise BadInput(f"{spec.name.replace('_', ' ')} must be a number; got {value!r:.60}")
            if spec.name != "plate_tilt":
                _check_range(spec, value)
        is_word = isinstance(self.friction, str) and self.friction in ("none", "stick")
        if not (is_word or (_is_number(self.friction) and 0 <= float(self.friction) < math.inf)):
            raise BadInput(f"friction must be none, stick or a coefficient of 0 or more; got {self.friction!r:.60}")
        if not abs(self.plate_tilt) <= STEEPEST:
            bound, got = math.degrees(STEEPEST), math.degrees(self.plate_tilt)
            raise BadInput(f"plate tilt must be within +-{bound:.3g} degrees; got {got:.4g}")
        if self.imperfection and (self.grip is not None or self.coulomb is not None):
            raise BadInput("an imperfection cannot be combined with Coulomb friction: leave one of them out")
        if self.grip is not None:
            if self.plate_tilt:
                got = math.degrees(self.plate_tilt)
                raise BadInput(f"a grip has no plate to tilt, so plate tilt must be 0; got {got:.4g} degrees")
            if not (_is_number(self.grip) and 0 < self.grip < math.inf):
                raise BadInput(f"grip must be a positive height in mm; got {self.grip!r:.60}")
            if self.depth:
                raise BadInput(f"a grip has no plate, so depth must be 0; got {self.depth:g} mm")

    @property
    def shear(self) -> float:
        """Length of the shear vector, mm.

        >>> Load(shear_x=-3.0, shear_y=4.0).shear
        5.0
        """
        return math.hypot(self.shear_x, self.shear_y)

    @property
    def unmoved(self) -> Self:
        """The load without its depth and shear: what all loads of a path share.

        >>> Load(1.0, 0.5, friction="stick").unmoved == Load(friction="stick")
        True
        """
        return dataclasses.replace(self, depth=0.0, shear_x=0.0, shear_y=0.0)

    def beyond(self, *known: str) -> list[str]:
        """Return what a model that knows some fields only does not know of the load: names, values and units.

        >>> Load(0.5, plate_tilt=0.1).beyond("depth"), Load(0.5, friction="stick").beyond("depth", "friction")
        (['plate tilt = 5.73 deg'], [])
        """
        found = []
        for spec in dataclasses.fields(self):
            value, unit = getattr(self, spec.name), spec.metadata["unit"]
            if spec.name not in known and value != spec.default:
                shown = math.degrees(value) if unit == "deg" else value
                text = shown if isinstance(shown, str) else f"{shown:.3g}"
                found.append(f"{spec.name.replace('_', ' ')} = {text} {'' if unit == '1' else unit}".rstrip())
        return found

    @property
    def coulomb(self) -> float | None:
        """Coefficient of Coulomb friction; None for a frictionless plate, for a bonded one, and for a grip.

        >>> Load(friction=0.3).coulomb, Load(friction=0.0).coulomb, Load(friction="stick").coulomb
        (0.3, None, None)
        """
        if isinstance(self.friction, str) or self.friction == 0 or self.grip is not None:
            return None
        return float(self.friction)

    @property
    def tip_is_held(self) -> bool:
        """True if the tip follows the whole shear: in a grip, or bonded to the plate.

        >>> Load(grip=1.0).tip_is_held, Load(friction="stick").tip_is_held, Load(friction=0.3).tip_is_held
        (True, True, False)
        """
        return self.grip is not None or self.friction == "stick"

    @property
    def shears_tip(self) -> bool:
        """True if the load moves the tip sideways; a frictionless plate does not.

        >>> Load(shear_x=1.0, friction=0.3).shears_tip, Load(shear_x=1.0).shears_tip
        (True, False)
        """
        return self.shear > 0 and (self.tip_is_held or self.coulomb is not None)

    @property
    def bonds_contact(self) -> bool:
        """True if the contact area is bonded to the plate: after the press, while a plate with "stick" is sheared.

        >>> Load(1.0, 0.5, friction="stick").bonds_contact, Load(shear_x=0.5, grip=1.0).bonds_contact
        (True, False)
        """
        return self.shears_tip and self.friction == "stick" and self.grip is None

    @property
    def imposed_shear(self) -> tuple[float, float]:
        """Shear (x, y) that acts on the tip, mm; (0, 0) under a frictionless plate.

        >>> Load(shear_y=1.0).imposed_shear, Load(shear_y=1.0, friction="stick").imposed_shear
        ((0.0, 0.0), (0.0, 1.0))
        """
        return (self.shear_x, self.shear_y) if self.shears_tip else (0.0, 0.0)

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector along the line of the shear, with the sign that makes x > 0, or (0, 1); (1, 0) without a shear.

        Along the x or y axis the components are exactly 0 and 1, so that no rounding error turns a response out of
        its plane of symmetry.

        >>> Load(shear_y=-2.0, grip=1.0).direction, Load(shear_x=-3.0, shear_y=4.0, friction="stick").direction
        ((0.0, 1.0), (0.6, -0.8))
        """
        x, y = self.imposed_shear
        length = math.copysign(self.shear, x or y)
        return (x / length + 0.0, y / length + 0.0) if x or y else (1.0, 0.0)

    @property
    def axis(self) -> float:
        """Angle of the line of the shear from the x axis, rad, in (-pi/2, pi/2].

        >>> Load(shear_x=-1.0, shear_y=1.0, friction="stick").axis
        -0.785398163397
        """
        x, y = self.imposed_shear
        angle = math.atan2(y, x)
        # opposite shears share one line: the angle is taken modulo pi, and rounded so that their values are equal
        return round(angle - math.pi * math.ceil(angle / math.pi - 0.5 - 1e-12), 12) + 0.0


def _check_range(spec: "dataclasses.Field[Any]", value: float) -> None:
    """Raise BadInput for a number outside the declared range; 0 always stands for a load that does not act."""
    known = spec.metadata
    low, high, unit = known["low"], known["high"], "" if known["unit"] == "1" else f" of {known['unit']}"
    value = math.degrees(value) if known["unit"] == "deg" else value
    if value == 0 or (low <= value <= high and math.isfinite(value)):
        return
    least = "" if math.isinf(low) else f", {low:g} or more"
    bound = least if math.isinf(high) else f" from {low:g} to {high:g}"
    name = (known["column"] or spec.name).replace("_", " ")
    raise BadInput(f"{name} must be a finite number{unit}{bound}; got {value:g}")


def _is_number(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


@dataclass(frozen=True, slots=True)
class Response:
    """The response of the sensor to a load, in the same form from formulas and from finite elements.

    Attributes
    ----------
    force : force (x, y, z) on the tip, N; x and y positive along the shear, z positive in compression.
    shift : displacement of the magnet's centre, mm; z negative when the magnet moves towards the base.
    tilt : lean of the magnet's axis from z towards x, rad.
    contact_radius : radius of the contact area on the plate, mm; 0 without a plate.
    tilt_y : lean of the magnet's axis from z towards y, rad.
    """

    force: tuple[float, float, float]
    shift: tuple[float, float, float]
    tilt: float
    contact_radius: float
    tilt_y: float = 0.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its nine numbers: force, shift, tilt, tilt_y, contact radius."""
        return (*self.force, *self.shift, self.tilt, self.tilt_y, self.contact_radius)

    @property
    def rotation(self) -> tuple[float, float]:
        """The tilt as a rotation vector (rx, ry) of the magnet about its centre, rad."""
        return rotation_of(self.tilt, self.tilt_y)

    @classmethod
    def restored(cls, values: Mapping[str, Any]) -> Self:
        """Return the response whose fields were written as JSON, which has lists only.

        >>> Response.restored({"force": [0.0, 0.0, 2.0], "shift": [0.0, 0.0, -1.0], "tilt": 0.1, "contact_radius": 3})
        Response(force=(0.0, 0.0, 2.0), shift=(0.0, 0.0, -1.0), tilt=0.1, contact_radius=3, tilt_y=0.0)
        """
        fields: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
        }
        return cls(**fields)

    def scaled(self, length: float, force: float) -> Self:
        """Return the response of a similar sensor: lengths and forces are multiplied, angles stay.

        `scaled(D, E * D**2)` gives units to a response whose lengths are relative to D and whose forces are relative
        to E D^2.

        >>> Response((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 0.1, 3.0).scaled(2.0, 4.0)
        Response(force=(0.0, 0.0, 8.0), shift=(0.0, 0.0, -2.0), tilt=0.1, contact_radius=6.0, tilt_y=0.0)
        """
        (fx, fy, fz), (x, y, z) = self.force, self.shift
        return dataclasses.replace(
            self,
            force=(force * fx, force * fy, force * fz),
            shift=(length * x, length * y, length * z),
            contact_radius=length * self.contact_radius,
        )


def rotation_of(tilt: Angle, tilt_y: Angle) -> tuple[Angle, Angle]:
    """Return the rotation vector (rx, ry), rad, of a magnet whose axis leans towards x and y by the given tilts.

    A right-handed rotation about y carries z towards x; one about x carries z towards -y. Hence
    (rx, ry) = (-tilt_y, tilt), and rz is 0.

    >>> rotation_of(0.2, 0.1)
    (-0.1, 0.2)
    """
    # adding 0 turns -0.0 into 0.0
    return 0.0 - tilt_y, 0.0 + tilt


def tilts_of(rx: Angle, ry: Angle) -> tuple[Angle, Angle]:
    """Return the tilts towards x and towards y, rad, of a rotation vector: the inverse of `rotation_of`.

    >>> tilts_of(*rotation_of(0.2, 0.1))
    (0.2, 0.1)
    """
    return 0.0 + ry, 0.0 - rx


def check_kinds(design: object, load: object, magnet: object) -> None:
    """Raise TypeError for what is no design or no load, BadInput for an unknown choice of the magnet."""
    if not isinstance(design, Design):
        raise TypeError(f"the design must be a Design, such as paper(); got {design!r:.60}")
    if not isinstance(load, Load):
        raise TypeError(f"the load must be a Load, such as Load(depth=1.0); got {load!r:.60}")
    if magnet not in get_args(Magnet):
        raise BadInput(f"magnet must be {' or '.join(get_args(Magnet))}; got {magnet!r}")


def check_load(design: Design, load: Load, magnet: Magnet = "rigid") -> None:
    """Raise BadInput for a load that is too large for the design.

    - The depth must be less than the thickness of all silicone on the axis.
    - A grip must lie on the beam.
    - A shear bends the beam, and pulls the part of the surface that a grip holds out of the beam, by at most five
      radii of that part: the silicone next to it is stretched by about this factor. The compliance of the held part
      is that of a rigid disc of radius a bonded to a half-space, (2 - nu) / (8 G a).
    - An imperfection alone must not bend the beam by more than the tip radius: a larger force is no small
      disturbance.
    """
    check_kinds(design, load, magnet)
    rigid = magnet == "rigid"
    if rigid and not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0): choose the magnet ignored")
    room = design.L - (design.magnet_height if rigid else 0.0)
    if not load.depth < room:
        raise BadInput(
            f"depth must be less than {room:g} mm, the silicone on the axis"
            f"{' above and below the magnet' if rigid else ''}; got {load.depth:g} mm"
        )
    if load.grip is not None and not load.grip < design.L:
        raise BadInput(f"grip must be less than L = {design.L:g} mm; got {load.grip:g} mm")
    if not load.shear <= 2 * design.L:
        raise BadInput(f"shear must not exceed 2 L = {2 * design.L:g} mm; got {load.shear:g} mm")
    if load.imperfection:
        _check_imperfection(design, load.imperfection)
    if load.grip is not None:
        _check_pull(design, load.grip, load.shear)


def _check_imperfection(design: Design, force: float) -> None:
    most = design.R / tip_compliance(design)
    if not abs(force) <= most:
        raise BadInput(
            f"imperfection must lie within +-{most:.3g} N, which bends the free beam by the tip radius; got "
            f"{force:g} N: {most / 1000:.2g} N is enough to select the direction of buckling"
        )


def _check_pull(design: Design, grip: float, shear: float) -> None:
    radius = math.sqrt(grip * (2 * design.R - grip)) if grip < design.R else design.R
    disc = (2 - design.nu) * (1 + design.nu) / (4 * design.E_now * radius)
    # beam and held part carry the same force, so they share the shear in proportion to their compliances
    most = 5 * radius * (1 + tip_compliance(design) / disc)
    if not shear <= most:
        raise BadInput(
            f"shear must not exceed {most:.3g} mm under a grip of {grip:g} mm, which holds a spot of {radius:.3g} mm "
            f"radius; got {shear:g} mm: take a larger grip or a smaller shear"
        )


def tip_compliance(design: Design) -> float:
    """Return the sideways compliance of the tip of a straight beam of silicone, from bending and shear, mm/N."""
    # 0.9: shear coefficient of a solid circular section
    area, G = math.pi * design.R**2, design.E_now / (2 * (1 + design.nu))
    bending = design.L**3 / (3 * design.E_now * area * design.R**2 / 4)
    return bending + design.L / (0.9 * G * area)
