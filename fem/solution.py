"""What a solve returns, in the user's units, and how it is read off a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import contact, drucker, elements, friction, integrals, rigid
from fem.material import strain
from fem.models import Discretisation
from fem.path import Path
from geometry.design import LAWS, Design
from geometry.scene import Load, Response

Array = NDArray[np.float64]
Status = Literal["ok", "not_converged", "unstable", "no_contact"]

BUCKLED = 0.01
"""Sideways shift of the magnet over D, or its tilt, beyond which a frictionless press is no longer the symmetric one;
mesh noise alone stays below a third of it."""
FLAT = 0.5
"""Least volume ratio J at the points of integration below which it is looked for silicone that is inside out."""
FOLDED = 1e-6
"""Share of the silicone that is inside out which is worth a word."""
FOLD_GRID, OFF_CORNER, FOLD_BATCH = 6, 1e-6, 256
"""Steps along a triangle's side (a tetrahedron's: half as many) where it is looked, how far off its corners, and
elements at a time."""


@dataclass(frozen=True, slots=True)
class Field:
    """The deformed body.

    Attributes
    ----------
    mesh : second order, mm.
    u : (n, dim) nodal displacements, or (n, fields) those of a section with harmonics, mm.
    p : (k, 1) or (k, harmonics + 1) pressures at the vertices, MPa.
    vertices : (k,) nodes of the pressures.
    angles : the functions of the angle that u and p are multiplied by; see `fem.revolve` for the solid body.
    """

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: NDArray[np.int64]
    angles: elements.Angles


@dataclass(frozen=True, slots=True)
class Solution:
    """One state of a load path.

    Attributes
    ----------
    load : the load that this state carries; less than the one asked for when the solve stopped on the way.
    response, field : the answer, and what it was read from.
    energy : stored in the deformed silicone, N mm; without Coulomb friction its derivative by the depth is the normal
        force.
    dissipated : energy that slipping on the plate has cost since the path began, N mm.
    slip_share : share of the area in contact that slips, None without Coulomb friction or contact.
    status, message : "ok", or why not and what to try.
    error_estimate, shift_error_estimate, tilt_error_estimate, sideways_error_estimate : relative errors of the force,
        of the magnet's shift, of its tilt, and of the force along the shear alone, from the mesh (and the harmonics);
        None where they were not estimated or there is nothing.
    dofs, newton_iterations, seconds : what it cost since the state before.
    """

    load: Load
    response: Response
    energy: float
    status: Status
    message: str
    model: str
    error_estimate: float | None
    shift_error_estimate: float | None
    tilt_error_estimate: float | None
    sideways_error_estimate: float | None
    dofs: int
    newton_iterations: int
    seconds: float
    field: Field
    dissipated: float = 0.0
    slip_share: float | None = None


def slides(load: Load) -> bool:
    """Whether a load moves the tip sideways (a frictionless plate does not)."""
    rough = load.friction == "stick" if isinstance(load.friction, str) else load.friction > 0
    return bool(load.shear_x or load.shear_y) and (load.grip is not None or rough)


def along(load: Load) -> tuple[float, float]:
    """Unit vector of the line along which a load shears, with x > 0 or (0, 1); without a shear (1, 0).

    Along an axis it is exact, so that nothing of a response is across it.

    >>> along(Load(shear_y=-2.0)), along(Load(shear_x=-3.0, shear_y=4.0))
    ((0.0, 1.0), (0.6, -0.8))
    """
    x, y = load.shear_x, load.shear_y
    length = math.copysign(math.hypot(x, y), x or y)
    return (x / length + 0.0, y / length + 0.0) if length else (1.0, 0.0)


def coulomb(loads: Sequence[Load]) -> float | None:
    """Coefficient of friction of a path's loads, None for a frictionless or glued plate."""
    mu = loads[0].friction
    return None if isinstance(mu, str) or mu == 0 else float(mu)


def read(
    path: Path, design: Design, load: Load, direction: Array, reason: str, seconds: float, *, watch: bool = False
) -> Solution:
    """The present state of a path that was to reach a load.

    Parameters
    ----------
    direction : (2,) unit vector in the user's frame along which the model's x axis points.
    reason : why the path stopped short; empty if it did not.
    watch : look whether an axisymmetric press is stable sideways.
    """
    D, d = design.D, path.d
    turn = np.array([[direction[0], -direction[1]], [direction[1], direction[0]]])
    if reason:
        depth, shear = float(path.position[0]) * D, turn @ path.position[1:] * D
        moved = {"shear_x": float(shear[0]), "shear_y": float(shear[1])} if path.sheared else {}
        load = replace(load, depth=depth, **moved)
    state = d.system.state(path.q)
    plate = path.plate()
    residual, _, _ = contact.traction(path.skin, state.u, plate)
    total = d.symmetry * np.einsum("kq,kqi->i", path.skin.weights, residual) * design.E * D**2
    shift, tilt = pose(d, state.u, path.q)
    if d.model == "axisymmetric":
        total[0] = shift[0] = tilt[0] = 0.0  # radial tractions, and rounding
    if d.model != "full":
        total[1] = shift[1] = tilt[1] = 0.0
    force, shift_xy, tilt_xy = turn @ -total[:2] + 0.0, turn @ shift[:2] * D + 0.0, turn @ tilt + 0.0
    radius = contact.patch_radius if path.sheared else contact.contact_radius
    response = Response(
        force=(float(force[0]), float(force[1]), float(total[2])),
        shift=(float(shift_xy[0]), float(shift_xy[1]), float(shift[2]) * D),
        tilt=float(tilt_xy[0]),
        contact_radius=0.0 if path.grip else radius(path.skin, state.u, plate) * D,
        tilt_y=float(tilt_xy[1]),
    )
    status, message = _judge(path, design, load, reason, response, watch)
    return Solution(
        load=load,
        response=response,
        energy=path.energy * d.symmetry * design.E * D**3,
        status=status,
        message=message,
        model=d.model,
        error_estimate=None,
        shift_error_estimate=None,
        tilt_error_estimate=None,
        sideways_error_estimate=None,
        dofs=d.system.size,
        newton_iterations=path.iterations,
        seconds=seconds,
        field=Field(
            mesh=type(d.mesh)(d.mesh.doflocs * D, d.mesh.t),
            u=state.u * D,
            p=state.p * design.E,
            vertices=d.system.corner_nodes,
            angles=d.elements.angles,
        ),
        dissipated=path.dissipated * d.symmetry * design.E * D**3,
        slip_share=friction.slip_share(path.friction, path.skin.weights) if path.friction is not None else None,
    )


def pose(d: Discretisation, u: Array, q: Array) -> tuple[Array, Array]:
    """Displacement (3,) of the magnet's centre, and its rotation (2,) as angles that carry z towards x and y.

    Without a rigid magnet: the material point at the centre, and the rotation of the polar decomposition there.
    """
    system = d.system
    if system.rigid:
        motion = system.motion(q)
        place = {1: [2], 3: [0, 2], 6: [0, 1, 2]}[len(motion)]
        shift = np.zeros(3)
        shift[place] = motion[: len(place)]
        return shift, _angles(rigid.axis(motion))
    shift, G = d.centre(u)
    return shift, np.zeros(2) if d.model == "axisymmetric" else _angles(_rotation(G)[:, 2])


def _rotation(G: Array) -> Array:
    """Rotation (3, 3) of the polar decomposition of 1 + G."""
    U, _, Vt = np.linalg.svd(np.eye(3) + G)
    return np.asarray(U @ Vt)


def _angles(axis: Array) -> Array:
    """Rotation (2,) that carries z to a direction (3,): towards x, towards y."""
    across = float(np.hypot(axis[0], axis[1]))
    return np.zeros(2) if across == 0 else np.arctan2(across, axis[2]) * axis[:2] / across


def _judge(
    path: Path, design: Design, load: Load, reason: str, response: Response, watch: bool
) -> tuple[Status, str]:
    normal, sheared, D = response.force[2], path.sheared, design.D
    if reason:
        shear = float(np.linalg.norm(path.position[1:])) * D
        at = f"depth {load.depth:.4g} mm" + (f", shear {shear:.4g} mm" if shear else "")
        remedy = _weak(path, design) or "try a smaller load or another accuracy"
        before = f"; {_instability(path, D)}" if path.onset is not None else ""
        return "not_converged", f"stopped at {at}: {reason}; {remedy}{before}"
    if load.depth > 0 and not normal > 0 and not sheared:
        remedy = (
            "the plate has not reached it to within rounding: take a larger depth"
            if path.d.model == "axisymmetric"
            else "choose model axisymmetric, whose mesh follows the contact"
        )
        return "no_contact", f"depth {load.depth:g} mm touches no integration point of this mesh: {remedy}"
    if path.unstable or path.onset is not None:
        return "unstable", "; ".join(filter(None, (_instability(path, D), _weak(path, design))))
    if path.friction is not None and load.depth > 0 and not normal > 0:
        return "ok", "the tip has lost touch with the plate: it carries no load any more"
    if load.depth > 0 and normal < 0:
        return "ok", "the glued plate pulls at the tip by now: a real one would peel off or slip before"
    aside = max(math.hypot(*response.shift[:2]) / D, math.hypot(response.tilt, response.tilt_y))
    if load.depth > 0 and not sheared and not load.plate_tilt and aside > BUCKLED:
        shift, tilt = math.hypot(*response.shift[:2]), math.hypot(response.tilt, response.tilt_y)
        if load.imperfection:
            return "ok", (
                f"the tip leans aside (shift {shift:.2g} mm, tilt {tilt:.2g} rad): the branch to which an "
                f"imperfection of {load.imperfection:g} N leads"
            )
        return "unstable", (
            f"the tip has given way sideways under the frictionless plate (shift {shift:.2g} mm, tilt {tilt:.2g} "
            "rad; the mesh decides to which side): the symmetric press is unstable"
        )
    return "ok", "; ".join(filter(None, (_remark(path, load, sheared, watch), _fold(path))))


def inside_out(d: Discretisation, u: Array) -> float:
    """Share of the silicone's volume that is inside out (det F <= 0), on a grid of points in each element.

    Such spots lie between points of integration, where every J is positive.
    """
    dim = d.elements.dim
    n = FOLD_GRID // (dim - 1)
    grid = np.indices((n + 1,) * dim).reshape(dim, -1)
    # corners are where it begins; on the axis 1 / r has no value
    points = 1 / (dim + 1) + (1 - OFF_CORNER) * (grid[:, grid.sum(axis=0) <= n] / n - 1 / (dim + 1))
    e = elements.build(d.mesh, axisymmetric=d.revolved, angles=d.elements.angles, points=points)
    folded = whole = 0.0
    for at in range(0, len(e.cells), FOLD_BATCH):
        part = slice(at, at + FOLD_BATCH)
        J, volumes = 1 + strain(integrals.gradient(e, part, u)).Jm1, integrals.volumes(e, part)
        folded, whole = folded + float(volumes[J <= 0].sum()), whole + float(volumes.sum())
    return folded / whole


def _instability(path: Path, D: float) -> str:
    """Where the first unstable direction appeared."""
    count = (
        f"{path.unstable} unstable direction{'s' if path.unstable != 1 else ''}" if path.unstable else "past it now"
    )
    if path.onset is None:
        return f"{count}: the state is an equilibrium that does not last"
    before, after = path.onset
    what, i = ("depth", 0) if before[0] != after[0] else ("shear", slice(1, 3))
    low, high = (float(np.linalg.norm(np.atleast_1d(v[i]))) * D for v in (before, after))
    return (
        f"unstable since a {what} between {low:.4g} and {high:.4g} mm ({count}): "
        "beyond that the answer may depend on the path"
    )


def _weak(path: Path, design: Design) -> str:
    """Where the law itself loses stability in the present state or just beyond it: what is to be said of it."""
    stretches = drucker.lost(path.d.system, path.u)
    if stretches is None:
        return ""
    numbers = ", ".join(
        f"{name} = {value:g}" for name, value in zip(LAWS[design.law], design.law_numbers, strict=True)
    )
    return (
        f"the law {design.law} with {numbers} loses stability (Drucker) at principal stretches of "
        f"{', '.join(f'{value:.3g}' for value in stretches)}, to which this load leads: choose other numbers, such "
        "as magtip fit finds stable, or a smaller load"
    )


def _remark(path: Path, load: Load, sheared: bool, watch: bool) -> str:
    """What a user should know of an answer that is good."""
    if (load.shear_x or load.shear_y) and not sheared:
        return "the frictionless plate slides over the tip: the shear has no effect"
    if watch and load.depth > 0 and path.d.model == "axisymmetric" and path.sideways():
        return (
            "a tip that is free to slide on a frictionless plate gives way sideways before this depth: the answer is "
            "that of a guided one (magtip stability says at which depth)"
        )
    if path.friction is not None:
        share = friction.slip_share(path.friction, path.skin.weights)
        if share == 1 and sheared:
            return "full slip: all that touches the plate slides"
        return f"{share:.2g} of the area in contact slips" if share else ""
    if load.friction == "stick" and not sheared:
        return "stick acts once the plate shears: the press itself is frictionless"
    return ""


def _fold(path: Path) -> str:
    """Where a body is so flat that some of it is inside out, how much."""
    share = inside_out(path.d, path.u) if path.flattest < FLAT else 0.0
    if share < FOLDED:
        return ""
    return (
        f"{share:.1g} of the silicone is inside out between points of integration, at edges like the clamp's: forces "
        "and the magnet's motion hold, displacements there do not"
    )
