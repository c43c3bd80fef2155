"""Following a path of loads, in units of D and E: adaptive steps, gluing, unstable directions.

The plate's position is v = (depth, shear along x, shear along y). A leg goes straight from one position to another;
its steps shrink when Newton's method fails and grow again, up to the longest, when it finds its way fast. Every step
starts from a curve through the last states, and from the contact that their gaps lead to; states between are solved
roughly. A model with several harmonics has a scout
with one, on the same mesh, that goes ahead: where it arrives, what the others had to add before is added again, and
Newton's method needs no steps between. If that does not converge, or finds itself unstable, the leg is gone in steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.contact import coulomb_friction, plate_contact
from fem.contact.plate_contact import KAPPA, SECTION_KAPPA, Plate
from fem.discretisation import elements
from fem.discretisation.nonlinear_system import System
from fem.discretisation.symmetry_models import Discretisation, raise_harmonics
from fem.solvers.direct_solver import Solver
from fem.solvers.newton import TOLERANCE, Equilibrium, Stop, newton

Array = NDArray[np.float64]

LONGEST_STEP, SOLID_STEP = 0.25, 0.125
"""Longest steps over D without friction, on sections and in tetrahedra: these distort more where a patch ends."""
PRESS_RUB, SHEAR_RUB, PRESS_SHARE = 0.02, 0.08, 0.2
"""Longest steps over D with Coulomb friction, whose answer depends on the way: second-order errors in their length.
Those of a press are also at most a share of its depth."""
SHORTEST_STEP = 1e-3
ON_THE_WAY, SOLID_WAY = 1e-4, 3e-3
"""Tolerances of states that are only passed, without friction, on sections and in tetrahedra."""
FAST = 7
"""Iterations up to which a step counts as easy."""
FIRST_TOUCH = 1e-14
MOST_LEAP = 12
"""Iterations for following the scout."""
SURE_STEP = 0.01
"""Steps over D that first meet an unstable direction, or crush silicone, are halved to this before it is believed."""
CRUSHED = 0.25
"""Volume ratio J below which silicone counts as crushed. A coarse mesh has equilibria, of higher energy, with an
element folded flat (J of 0.1 to 0.2 at its points), which a long step may land on; at the edges of a glued patch or a
magnet J stays above 0.35."""
ONSET_HALVINGS = 3


class Path:
    """The state while a path is followed.

    Parameters
    ----------
    d : the model to start with.
    grip : height below the tip within which the skin is held, or None for a plate.
    tilt : of the plate, rad.
    raised : builds the model with harmonics that takes over from an axisymmetric one when the shear begins, or in
        which its sideways stability is looked at.
    rim : undeformed radius of the patch that is glued then, the contact radius if not told.
    mu : coefficient of Coulomb friction, which takes the place of gluing, or None.
    rub : steps with friction are at most so many times PRESS_RUB and SHEAR_RUB long.
    scout : builds the model with one harmonic, and the same points on the skin, that goes ahead of one with more.
    kappa : stiffness of the plate on a section without Coulomb friction (default: SECTION_KAPPA), see
        `fem.contact.plate_contact`.

    Attributes
    ----------
    rim : undeformed radius of the patch that is to be glued, if it was told.
    position : (3,) where plate or grip is.
    q, energy : unknowns of the present model, and what is stored in the modelled part.
    iterations : of Newton's method since the last load.
    unstable : number of unstable directions, None where it is not known.
    onset : positions (before, after) between which the first unstable direction appeared, or None.
    friction : history of the points in contact, None without Coulomb friction.
    dissipated : energy that slipping has cost in the modelled part.
    flattest : least volume ratio J at the points of integration.
    sheared : whether plate or grip have ever moved sideways.
    stiffness_at_rest : what `fem.results.lateral_stiffness.at_rest` found, None before it was asked.
    """

    def __init__(
        self,
        d: Discretisation,
        grip: float | None = None,
        tilt: float = 0.0,
        raised: Callable[[], Discretisation] | None = None,
        rim: float | None = None,
        mu: float | None = None,
        rub: float = 1.0,
        scout: Callable[[], Discretisation] | None = None,
        kappa: float | None = None,
    ) -> None:
        self.d, self.tilt, self._raised, self.rim = d, tilt, raised, rim
        self.grip = grip is not None
        self.solver = Solver()
        self.position = np.zeros(3)
        self.q = np.zeros(d.system.size)
        self._past: list[tuple[Array, Array, Array]] = []
        self.energy = 0.0
        self.iterations = 0
        self.unstable: int | None = None
        self.flattest = 1.0
        self.onset: tuple[Array, Array] | None = None
        self._high: System | None = None
        self.stiffness_at_rest: float | None = None
        self.tied: NDArray[np.bool_] | None = None
        self.targets: Array | None = None
        self.gap: Array | None = None
        self.friction = coulomb_friction.at_rest(mu, self.skin.weights.shape) if mu is not None else None
        self.dissipated, self.sheared = 0.0, False
        self._rub, self._kappa = rub, SECTION_KAPPA if kappa is None else kappa
        self._heading = np.zeros(3)
        self._build_scout = scout
        self._scout: Path | None = None
        if grip is not None:
            self.tied = plate_contact.whole_facets(self.skin.points[..., 2]) >= d.shape.L - grip
            self.targets = self.skin.points[..., :2]
        if raised is None:
            self._send_scout()

    @property
    def skin(self) -> elements.Surface:
        assert self.d.system.surface is not None
        return self.d.system.surface

    @property
    def u(self) -> Array:
        """Nodal fields of the present state."""
        return self.d.system.state(self.q).u

    def plate(self, position: Array | None = None) -> Plate:
        """The plate (or grip) at a position, the present one if not told."""
        depth, *shear = self.position if position is None else position
        shape = self.d.shape
        radius = shape.R if self.grip else math.sqrt(shape.R * max(depth, FIRST_TOUCH))
        kappa = self._kappa if self.d.revolved and self.friction is None else KAPPA
        # a tilted plate touches the dome beside its top
        height = None if self.grip else shape.L - depth + shape.R * (1 / math.cos(self.tilt) - 1)
        return Plate(
            height,
            kappa / radius,
            np.array(shear),
            self.tilt,
            self.tied,
            self.targets,
            self.gap,
            friction=self.friction,
        )

    def go(self, depth: float, shear: Array) -> Stop:
        """Move to a depth, then to a shear (2,); returns why it stopped on the way, empty if it did not."""
        self.iterations = 0
        reason = self._leg(np.array([depth, *self.position[1:]]))
        if reason or np.array_equal(shear, self.position[1:]):
            return reason
        self.sheared = True
        if self._raised is not None:
            self._raise()
        if self.tied is None and self.friction is None:
            self._glue()
        return self._leg(np.array([depth, *shear]))

    @property
    def high(self) -> System:
        """The model with harmonics on the mesh of an axisymmetric one."""
        assert self._raised is not None
        if self._high is None:
            self._high = self._raised().system
        return self._high

    def close(self) -> None:
        """Give the factorisation's memory back."""
        self.solver.close()
        if self._scout is not None:
            self._scout.close()

    def _raise(self) -> None:
        """Hand the state over to a model with harmonics on the same mesh."""
        assert self._raised is not None
        low, q, self.d, self._raised = self.d.system, self.q, self._raised(), None
        self.q = raise_harmonics(low, self.d.system, q)
        self._past = []
        if self.friction is not None:
            self.friction = coulomb_friction.revolved(self.friction, self.skin.points)
        self.solver.close()
        self.solver = Solver()
        self._send_scout(low, q)

    def _send_scout(self, low: System | None = None, q: Array | None = None) -> None:
        """Let a model with one harmonic stand where this one does: at rest, or where unknowns q of `low` say."""
        if self._build_scout is None:
            return
        self._scout = scout = Path(self._build_scout(), tilt=self.tilt)
        scout.grip, scout.position = self.grip, self.position
        if low is not None and q is not None:
            scout.q = raise_harmonics(low, scout.d.system, q)

    def _glue(self) -> None:
        """Tie what lies within the contact radius to the plate."""
        plate = plate_contact.glued(self.skin, self.u, self.plate(), self.rim, self.d.shape.H)
        assert plate.targets is not None
        self.tied, self.targets, self.gap = plate.tied, plate.targets - self.position[1:], plate.gap

    def _leap(self, goal: Array) -> bool:
        """Go to a position by following the scout, without steps; tells whether that was possible."""
        scout = self._scout
        if scout is None or not np.array_equal(scout.position, self.position):
            return False
        scout.tied, scout.targets, scout.gap = self.tied, self.targets, self.gap
        more = self.q - raise_harmonics(scout.d.system, self.d.system, scout.q)
        scout.iterations = 0
        reason = scout._leg(goal, passing=True)
        self.iterations += scout.iterations
        if reason or (scout.unstable or 0) != (self.unstable or 0):
            return False
        guess, plate = more + raise_harmonics(scout.d.system, self.d.system, scout.q), self.plate(goal)
        pressed = None if self.grip else plate_contact.overlap(self.skin, self.d.system.state(guess).u, plate) > 0
        answer = newton(self.d.system, self.solver, guess, plate, pressed, most=MOST_LEAP)
        self.iterations += answer.iterations
        flat = flattest(answer)
        sound = (answer.unstable or 0) == (self.unstable or 0) and (flat < CRUSHED) == (self.flattest < CRUSHED)
        if not answer.converged or not sound:
            return False
        self.flattest = flat
        self.q, self.energy, self.position, self._past = answer.state.q, answer.assembly.energy, goal, []
        return True

    def _leg(self, goal: Array, *, passing: bool = False) -> Stop:
        """Go to a position; if only `passing`, roughly."""
        start = self.position
        length = float(np.linalg.norm(goal - start))
        if length == 0 or self._leap(goal):
            return ""
        longest = self._longest((goal - start) / length, max(start[0], goal[0])) / length
        now, step = 0.0, min(longest, 1.0)
        on_the_way = ON_THE_WAY if self.d.revolved else SOLID_WAY
        while now < 1:
            target = 1.0 if 1 - now <= 1.001 * step else now + step
            position = goal if target == 1 else start + target * (goal - start)
            rough = self.friction is None and (passing or target < 1)
            answer = self._try(position, on_the_way if rough else TOLERANCE)
            flat = flattest(answer)
            doubtful = (answer.unstable and not self.unstable) or (flat < CRUSHED <= self.flattest)
            if answer.converged and doubtful and step * length > SURE_STEP:
                # a long step may land on an unstable branch beside the stable one
                self._past = []
                step = (target - now) / 2
                continue
            if answer.converged:
                self._past = [*self._past[-1:], (self.position, self.q, self._overlap())]
                self._note_stability(answer, position)
                if self.friction is not None:
                    self.friction, lost = plate_contact.rubbed(self.skin, answer.state.u, self.plate(position))
                    self.dissipated += lost
                self.q, self.energy, self.position = answer.state.q, answer.assembly.energy, position
                self.flattest = flat
                now = target
                if answer.iterations <= FAST:
                    step *= 1.5
                step = min(step, longest)
                continue
            self._past = []
            step = (target - now) / 2
            if step * length < SHORTEST_STEP * min(length, 1.0):
                if self.friction is None and not passing:
                    self._settle()
                return answer.reason
        return ""

    def _settle(self) -> None:
        """Solve the present state, which was only to be passed, to the end."""
        answer = newton(self.d.system, self.solver, self.q, self.plate())
        self.iterations += answer.iterations
        if answer.converged:
            self.q, self.energy, self.flattest = answer.state.q, answer.assembly.energy, flattest(answer)

    def _longest(self, way: Array, depth: float) -> float:
        """Longest step over D in a direction, down to a depth.

        Where the direction is a new one, all that touches is expected to stick at first.
        """
        if self.friction is None:
            return LONGEST_STEP if self.d.revolved else SOLID_STEP
        if way @ self._heading < 1 - 1e-9:
            self.friction = coulomb_friction.turned_back(self.friction)
        self._heading = way
        return self._rub * (min(PRESS_RUB, PRESS_SHARE * depth) if way[0] else SHEAR_RUB)

    def _try(self, position: Array, tolerance: float) -> Equilibrium:
        share = self._shares(position)
        guess, plate = share[-1] * self.q, self.plate(position)
        for part, (_, q, _) in zip(share[:-1], self._past, strict=True):
            guess += part * q
        if self.friction is not None:
            there = plate_contact.slid(self.skin, self.d.system.state(guess).u, plate if self._past else self.plate())
            self.friction = coulomb_friction.expecting(self.friction, there)
            plate = replace(plate, friction=self.friction)
        pressed = self._pressed(position, share)
        answer = newton(self.d.system, self.solver, guess, plate, pressed, tolerance=tolerance)
        self.iterations += answer.iterations
        return answer

    def _shares(self, position: Array) -> Array:
        """What the past states and, last, the present one count in a polynomial through them, followed to a position.

        States that do not lie on the line from the present one backwards are forgotten.
        """
        ahead = position - self.position
        length = float(np.linalg.norm(ahead))
        back = [float((place - self.position) @ ahead) / length for place, _, _ in self._past]
        on_line = [
            b < 0 and np.abs(b * ahead / length - (p[0] - self.position)).max() < 1e-9
            for b, p in zip(back, self._past, strict=True)
        ]
        if not all(on_line):
            self._past, back = [], []
        at = np.array([*back, 0.0])
        return np.array([np.prod([(length - u) / (t - u) for u in at if u != t]) for t in at])

    def _overlap(self) -> Array:
        """How far the skin's points overlap the plate at present, shape (k, q)."""
        return plate_contact.overlap(self.skin, self.u, self.plate())

    def _pressed(self, position: Array, share: Array) -> NDArray[np.bool_] | None:
        """Where to expect contact: where the gap, followed further, is closed, or Hertz's at first touch."""
        if self.grip:
            return None
        if self.position[0] == 0:
            rest = np.zeros(self.d.system.fixed.shape)
            return plate_contact.overlap(self.skin, rest, self.plate(np.array([position[0] / 2, 0, 0]))) >= 0
        gap = self._overlap()
        if self._past:
            place, _, before = self._past[-1]
            gap += np.linalg.norm(position - self.position) / np.linalg.norm(self.position - place) * (gap - before)
        return gap > 0

    def _note_stability(self, answer: Equilibrium, position: Array) -> None:
        """Keep the number of unstable directions, and find between which positions the first one appeared."""
        was, self.unstable = self.unstable, answer.unstable
        if not answer.unstable or was or self.onset is not None:
            return
        stable, unstable, q = self.position, position, self.q
        for _ in range(ONSET_HALVINGS):
            middle = (stable + unstable) / 2
            guess = (q + answer.state.q) / 2
            between = newton(self.d.system, self.solver, guess, self.plate(middle))
            self.iterations += between.iterations
            if not between.converged or between.unstable is None:
                break
            if between.unstable:
                unstable, answer = middle, between
            else:
                stable, q = middle, between.state.q
        self.onset = (stable, unstable)


def flattest(answer: Equilibrium) -> float:
    """Least volume ratio J at the points of integration."""
    return 1 + min((float(strain.Jm1.min()) for strain in answer.state.strains), default=0.0)
