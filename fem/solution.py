"""The result of a solve in the user's units: the state of each load, its field, and facts about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NoReturn

from geometry.bad_input import OutOfReach
from geometry.loads import Load, Response

if TYPE_CHECKING:
    import skfem

    from fem.model import angular_fields
    from geometry.arrays import Array, Ints

CREASE = 2.4
"""Stretch normal to a free surface over the least one along it, from which on it creases (see
`fem.results.silicone_limits`)."""

RadiusSource = Literal["gap", "pressure", "area"]
Status = Literal["ok", "unstable", "unknown", "not_converged", "no_contact"]
Stop = Literal["", "no_convergence", "guess_inverted", "step_inverted", "singular", "force_lost"]
Verdict = Literal["stable", "unstable", "unknown"]


@dataclass(frozen=True, slots=True)
class Stability:
    """Number of unstable directions of an equilibrium; None where it is unknown.

    It has no truth value, so that what is unknown cannot be taken for stable or unstable.

    >>> Stability(0).verdict, Stability(2).verdict, UNKNOWN.verdict
    ('stable', 'unstable', 'unknown')
    >>> (Stability(1) + UNKNOWN).verdict
    'unstable'
    """

    directions: int | None

    @classmethod
    def counted(cls, negative: int | None, pressures: int) -> Stability:
        """Return the stability of a body with a number of pressures, from its number of negative eigenvalues.

        With fewer negative eigenvalues than pressures the pivots cannot have been those of a saddle point.

        >>> Stability.counted(7, 6), Stability.counted(5, 6), Stability.counted(None, 6)
        (Stability(directions=1), Stability(directions=None), Stability(directions=None))
        """
        return UNKNOWN if negative is None or negative < pressures else cls(negative - pressures)

    @property
    def verdict(self) -> Verdict:
        if self.directions is None:
            return "unknown"
        return "unstable" if self.directions else "stable"

    @property
    def is_stable(self) -> bool:
        return self.verdict == "stable"

    @property
    def is_unstable(self) -> bool:
        return self.verdict == "unstable"

    @property
    def is_unknown(self) -> bool:
        return self.verdict == "unknown"

    def __add__(self, second: Stability) -> Stability:
        """Return the stability against the directions of both; one unstable direction is enough to know it."""
        known = [each.directions for each in (self, second) if each.directions is not None]
        return UNKNOWN if len(known) < 2 and not any(known) else Stability(sum(known))

    def __bool__(self) -> NoReturn:
        raise TypeError("a stability may be unknown: ask whether it is_stable, is_unstable or is_unknown")


STABLE, UNKNOWN = Stability(0), Stability(None)


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts about a state beside its response.

    Attributes
    ----------
    stop : why the path ended before the load; empty if it did not.
    stability : of the model that was solved: stable, unstable with a number of directions, or unknown. `verdict` is
        that of the sensor.
    onset, onset_mm : the load coordinate that changed when the path became unstable, and its values (from, to) before
        and after, mm; None where the path did not become unstable or was not checked.
    weak_at : principal stretches, largest first, at which the law loses stability in the state, or just beyond a
        state that stopped or is unstable; None if nowhere.
    inverted_share : share of the silicone's volume with det F <= 0; None where it was not computed, because J at
        the integration points is above `fem.results.diagnostics.FLAT`.
    remark : the most important limitation of the answer, a key of `fem.results.diagnostics.REMARKS`; None if there
        is none. "given_way": the tip has buckled to a
        side that the mesh chose. "leaning": an imperfection led it there. "guided_only": the tip would buckle if it
        were free to slide; "guided_doubtful": the mesh does not tell whether it would, so near the critical depth;
        "guided_unknown": it is not known for another reason; "guided_unchecked": it was not looked at;
        "nearly_guided_only": it is close to that. "pulled": a glued plate pulls at the tip.
    sideways_stiffness_ratio : lateral stiffness of a frictionless press with a tip free to slide, over that of the
        unloaded beam; 0 where it buckles. None where it was not computed (see `fem.results.lateral_stiffness`).
    sideways_half_width : half width of this ratio; within it of zero the verdict is unknown.
    critical_depth : estimated critical depth, mm, to some 10 %; None far from it (see
        `fem.results.lateral_stiffness`). `fem.analyses.stability` computes it with an error estimate.
    crease_ratio : largest ratio of the stretches normal to the free skin and along it, which creases beyond CREASE
        (see `fem.results.silicone_limits`); None where it was not computed.
    harmonics_missing : harmonics that a tilted plate needs beyond those of the model (see
        `fem.scene.Scene.orders_needed`); the error estimates have grown with them.
    contact_pressure : largest pressure of the plate on the tip, over E, per deformed area, of an axisymmetric press;
        None where it was not computed.
    largest_strain : largest principal nominal strain that 99.9 % of the silicone's volume stays below (see
        `fem.results.silicone_limits`); None where it was not computed.
    """

    stop: Stop = ""
    stability: Stability = UNKNOWN
    onset: Literal["depth", "shear"] | None = None
    onset_mm: tuple[float, float] | None = None
    weak_at: tuple[float, float, float] | None = None
    inverted_share: float | None = None
    remark: str | None = None
    sideways_stiffness_ratio: float | None = None
    sideways_half_width: float | None = None
    critical_depth: float | None = None
    largest_strain: float | None = None
    contact_pressure: float | None = None
    harmonics_missing: int = 0
    crease_ratio: float | None = None

    @property
    def creased(self) -> bool:
        """Whether the free skin is known to be compressed beyond the limit of creases."""
        return self.crease_ratio is not None and self.crease_ratio >= CREASE

    @property
    def verdict(self) -> Verdict:
        """Whether the state is stable against all that was looked at: its own model, a free tip, creases, its path.

        >>> Facts(stability=Stability(0)).verdict, Facts(stability=Stability(0), remark="guided_only").verdict
        ('stable', 'unstable')
        >>> Facts(stability=Stability(0), remark="guided_unknown").verdict
        'unknown'
        """
        if self.onset or self.creased or self.remark in ("given_way", "guided_only"):
            return "unstable"
        unknown = ("guided_doubtful", "guided_unknown", "guided_unchecked")
        return "unknown" if self.remark in unknown else self.stability.verdict

    @property
    def status(self) -> Status:
        """Status that follows from the facts.

        >>> Facts().status, Facts(stability=Stability(2)).status, Facts("no_convergence").status
        ('ok', 'unstable', 'not_converged')
        >>> Facts(remark="guided_only").status, Facts(crease_ratio=3.0).status, Facts(remark="guided_doubtful").status
        ('unstable', 'unstable', 'unknown')
        """
        if self.stop:
            return "not_converged"
        if self.remark == "no_touch":
            return "no_contact"
        if self.verdict == "unstable":
            return "unstable"
        return "unknown" if self.remark == "guided_doubtful" else "ok"


@dataclass(frozen=True, slots=True)
class Field:
    """Fields of the deformed body.

    Attributes
    ----------
    mesh : second-order mesh, mm.
    u : (n, dim) nodal displacements, or (n, fields) those of a section with harmonics, mm.
    p : (k, 1) or (k, harmonics + 1) pressures at the vertices, MPa.
    vertices : (k,) nodes of the pressures.
    angles : functions of the angle that multiply u and p; see `fem.results.revolved_body` for the solid body.
    """

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: Ints
    angles: angular_fields.Angles


@dataclass(frozen=True, slots=True)
class Estimates:
    """Estimated relative errors from the mesh and the harmonics, see `fem.results.error_estimates`.

    Those of force, shift and tilt are relative errors of the vectors, or of the numbers of a small shear; that of
    `sideways` is of the force along the shear, `depth` and `shear` of those that a wanted force leads to, `depth` of
    a critical depth too (and `force` then of the critical force), `stiffness` of a small shear. `strain` is that of
    the largest strain, `pressure` of the largest contact pressure, `crease` of the crease ratio; that of
    `slip_share`, which may be 0, is absolute. None where they are unknown, were not estimated, or the quantity is
    zero.
    """

    force: float | None = None
    shift: float | None = None
    tilt: float | None = None
    sideways: float | None = None
    depth: float | None = None
    shear: float | None = None
    stiffness: float | None = None
    contact_radius: float | None = None
    energy: float | None = None
    strain: float | None = None
    pressure: float | None = None
    crease: float | None = None
    dissipated: float | None = None
    slip_share: float | None = None


NOT_ESTIMATED = Estimates()


@dataclass(frozen=True, slots=True)
class Solution:
    """One state of a path of loads.

    Attributes
    ----------
    load : load that this state carries; less than the requested one when the solve stopped early.
    response, field : the response, and the fields from which it was computed; None where only numbers were kept.
    energy : energy stored in the deformed silicone, N mm; without Coulomb friction its derivative by the depth is the
        normal force.
    model : name of the model.
    dofs, newton_iterations, seconds : number of unknowns, and iterations and time since the state before.
    facts : further facts; code that decides by them reads them here, not in the message.
    message : what is wrong and how to remedy it; it follows from `facts`, by `fem.results.diagnostics`.
    dissipated : energy dissipated by slip on the plate since the path began, N mm.
    slip_share : share of the contact area that slips; None without Coulomb friction or contact.
    estimates : estimated errors.
    radius_from : what the contact radius follows from (`fem.model.plate_contact`): "gap", the gap around the contact;
        "pressure", a Hertz contact with its second moment of the pressure, where the points around the contact are
        too few; "area", the area that touches under a shear. None without a plate.
    """

    load: Load
    response: Response
    energy: float
    model: str
    dofs: int
    newton_iterations: int
    seconds: float
    field: Field | None = None
    facts: Facts = Facts()
    message: str = ""
    dissipated: float = 0.0
    slip_share: float | None = None
    estimates: Estimates = NOT_ESTIMATED
    radius_from: RadiusSource | None = None

    @property
    def status(self) -> Status:
        return self.facts.status

    @property
    def body(self) -> Field:
        """The fields of the deformed body, of a solution that was not kept as numbers only."""
        if self.field is None:
            raise ValueError("the fields of this solution were not kept: solve it again")
        return self.field


class ForceOutOfReach(OutOfReach):
    """No state has a wanted force; `state` is the one that comes nearest, of the motion of the target."""

    def __init__(self, sentence: str, state: Solution) -> None:
        super().__init__(sentence)
        self.state = state
