"""Options that several verbs share, as values: motion of the plate, pose of the magnet, method, basis of a layout."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, Token

from geometry.design import BadInput
from geometry.loads import Magnet
from studies.inputs.user_input import AccuracyName

FieldLevel = Literal["exact", "paper", "paper-printed", "dipole"]
LawName = Literal["neo-hookean", "mooney-rivlin", "yeoh", "ogden"]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]


def _whole(type_: object, tokens: Sequence[Token]) -> int:
    """An int without rounding: the command line's own reader makes 2 of 2.5."""
    if not re.fullmatch(r"[+-]?[0-9]+", tokens[0].value.strip()):
        raise BadInput(f"{tokens[0].keyword} must be a whole number; got {tokens[0].value}")
    return int(tokens[0].value)


Whole = Annotated[int, Parameter(converter=_whole, n_tokens=1)]

DEPTH = Parameter(help="How far the plate comes down after first touch, mm.")
SHEAR = Parameter(help="Sideways motion of the plate or the grip along x, mm.")
SHEAR_Y = Parameter(help="Sideways motion along y, mm.")
MAGNET = Parameter(help="As a rigid body, or ignored: all silicone.")
LEVEL = Parameter(help="Field: exact, the paper's quadrature (3), the same with its misprint, or a dipole.")
ACCURACY = Parameter(help="Of the mesh and the harmonics.")


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What the plate or the grip does.

    Attributes
    ----------
    depths
        Several depths of a press, d1,d2,d3.
    steps
        N states on the way: of the depth, or with a shear, of the shear at the full depth.
    plate_tilt
        Rotation of the plate about y that carries its normal from z towards x, degrees.
    imperfection
        Dead force along x on the dome, N: a press that gives way sideways is followed to that side.
    friction
        none, stick (the patch in contact is glued to the plate), or a Coulomb coefficient, from first touch on.
        By default none for a press, and stick when the plate shears.
    grip
        No plate: all surface points within this height of the tip are moved sideways, mm.
    """

    depth: Annotated[float | None, DEPTH] = None
    depths: str | None = None
    steps: Whole | None = None
    shear: Annotated[float | None, SHEAR] = None
    shear_y: Annotated[float | None, SHEAR_Y] = None
    plate_tilt: float = 0.0
    imperfection: float = 0.0
    friction: str | None = None
    grip: float | None = None


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the magnet is.

    Attributes
    ----------
    shift
        Displacement of its centre, x,y,z in mm; z is negative when it sinks.
    tilt
        Rotation vector about its centre, rx,ry in rad, which is -tilt_y,tilt of a state: a positive ry carries z
        towards x, a positive rx carries z towards -y.
    """

    shift: str = "0,0,0"
    tilt: str = "0,0"


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """How finite elements solve it.

    Attributes
    ----------
    model
        auto takes the smallest that can carry the load.
    harmonics
        Number of harmonics of the harmonic model, 0 to 12 (a shear needs 1 or more), in place of the accuracy's.
    mesh
        A file with tetrahedra of this design to solve on, whole or the half at y >= 0, that meshio reads (.vtu, .msh,
        .inp, ...), with regions named silicone and magnet; errors are not estimated then.
    """

    magnet: Annotated[Magnet, MAGNET] = "rigid"
    model: Model = "auto"
    harmonics: Whole | None = None
    mesh: Path | None = None
    accuracy: Annotated[AccuracyName, ACCURACY] = "standard"


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """On what a layout of Hall elements is judged.

    Attributes
    ----------
    level
        Formulas that give tilt and force from the shift, and the reach of the workspace: paper (no tilt) by default.
    responses
        States printed by `magtip solve --json` (or `analytic --json`), a line each, instead of formulas.
    ignore_tilt
        As if the magnet did not tilt.
    mode
        B.n as an element reads it, or the paper's |B|.
    clearance
        Least distance of an element from the moved magnet and the beam's wall, mm.
    """

    level: str | None = None
    responses: Path | None = None
    ignore_tilt: bool = False
    mode: Literal["component", "magnitude"] = "component"
    clearance: float = 0.0
