"""Candidates of the search as one table of arrays, and the variants that they stand for.

A candidate is a magnet, a silicone, a Hall part and five lengths: D, L, how far S1 or the chip lies below the beam
and S2 and S3 beside it (both beyond the least that the base needs), and the height of S2 and S3 above the base plane.
Of several chips, the fourth length is how much larger their circle is than the least one.
All lengths are whole multiples of `ROUNDING`. Outer size, height and wall are those of `geometry.base` and
`geometry.mold` with their default choices, for all candidates at once.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.parts import of_design
from geometry.arrays import Array, Ints
from geometry.base import THINNEST, least_outline, least_pitch, least_thickness, plan
from geometry.design import LEAST_WALL, BadInput, Design
from geometry.fabrication.hall_elements import SS495A, WEB
from geometry.fabrication.printability import PROCESSES
from geometry.hall_chips import CIRCLES, least_radius
from studies.beam import prediction, surrogate_range
from studies.parts.catalogues import Catalogues, HallPartEntry, MagnetEntry, SiliconeEntry
from studies.parts.requirements import Requirements

ROUNDING = 0.1
"""Lengths of a design are whole multiples of this, mm: a finer drawing asks for more than printers hold."""
USUAL_D = (1.0, 30.0)
"""Range of the diameter where the requirements have none, mm."""
FARTHEST, LEVEL = 0.8, (-0.5, 0.8)
"""How much farther than necessary the elements lie at most, over D; and the height of S2 and S3 over the magnet's."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A design with typical values of its parts."""

    design: Design
    magnet: MagnetEntry
    hall_part: HallPartEntry
    silicone: SiliconeEntry

    @property
    def loss(self) -> list[float | None]:
        """Largest loss factor, and the frequencies between which it holds, Hz; None or NaN where unknown.

        A design of the silicone has the loss factors of the silicone, unless it states one of its own. Branches are
        no single loss factor.
        """
        d, part = self.design, self.silicone
        if d.prony:
            return [None] * 3
        if d.silicone == part.name and d.loss_factor == part.loss_field()["loss_factor"]:
            return [part.loss_factor_high, part.loss_low, part.loss_high]
        return [d.loss_factor, d.loss_low, d.loss_high]

    def row(self) -> dict[str, Any]:
        """Return the columns that identify a variant in tables."""
        d = self.design
        three = d.hall_layout == "three"
        return {
            "D_mm": d.D,
            "L_mm": d.L,
            "magnet": self.magnet.name,
            "silicone": self.silicone.name,
            "hall_part": self.hall_part.name,
            "f_mm": d.f if three else None,
            "l0_mm": d.l0,
            "c_mm": d.c if three else None,
            "chips": None if three else int(d.chip_count),
            "chip_x_mm": None if three else d.chip_x,
            "samples": int(d.hall_average),
        }


class Space:
    """All candidates with some of the Hall parts: parts as columns, and the ranges of the lengths.

    hall_parts : first and last but one of the Hall parts; default: all.
    free : forces (0 along z, 1 along the plate) of which candidates may take a share, with the least share of each.
    """

    def __init__(
        self,
        requirements: Requirements,
        parts: Catalogues,
        hall_parts: tuple[int, int] | None = None,
        free: Mapping[int, float] | None = None,
    ) -> None:
        self.requirements, self.parts, self.free = requirements, parts, free or {}
        last = hall_parts or (0, len(parts.hall_parts))
        self.choices = [(0, len(parts.magnets)), (0, len(parts.silicones)), last]
        self.process = PROCESSES[requirements.process]
        self.fit = self.process.fit / 2
        seats = [_seat(part, requirements) for part in parts.hall_parts]
        self.hall_parts = {name: np.array([seat[name] for seat in seats]) for name in seats[0]}
        names = ("diameter", "height", "edge_radius", "density", "remanence_low", "remanence_high")
        self.magnets = {name: np.array([getattr(each, name) for each in parts.magnets]) for name in names}
        kinds = ("E_low", "E_high", "density", "nu", "loss_factor_high", "loss_low", "loss_high")
        # of what is unknown the array has NaN
        self.silicones = {name: np.array([getattr(each, name) for each in parts.silicones], float) for name in kinds}
        self.low = USUAL_D[0] if requirements.D_low is None else requirements.D_low
        self.high = USUAL_D[1] if requirements.D_high is None else requirements.D_high
        self.high = min(self.high, requirements.outer_size or np.inf, requirements.pitch or np.inf)
        self.low = min(self.low, self.high)

    def diameters(self) -> tuple[Array, Array]:
        """Return the least and the largest D that the surrogate knows with each magnet, in the required range."""
        d, h = self.magnets["diameter"], self.magnets["height"]
        (d0, d1), (h0, h1) = surrogate_range.DIAMETER, surrogate_range.HEIGHT
        low = np.maximum.reduce([np.full(len(d), self.low), d / d1, h / h1, d + 2 * LEAST_WALL])
        high = np.minimum.reduce([np.full(len(d), self.high), d / d0, h / h0])
        return np.ceil(low / ROUNDING - 1e-6) * ROUNDING, np.floor(high / ROUNDING + 1e-6) * ROUNDING

    def candidates(self, choices: Ints, shares: Array, share: Array | None = None) -> Candidates:
        """Return the candidates at shares (n, 5) of the ranges of the lengths, 0 to 1.

        Parameters
        ----------
        choices : magnet, silicone and Hall part, shape (n, 3).
        share : see `Candidates`.
        """
        low, high = (ends[choices[:, 0]] for ends in self.diameters())
        D = low * np.exp(shares[:, 0] * np.log(np.maximum(high / low, 1.0)))
        h = self.magnets["height"][choices[:, 0]]
        shortest = np.maximum(surrogate_range.LENGTH[0], 0.5 + h / D / 2 + surrogate_range.LEAST_BELOW) * D
        longest = surrogate_range.LENGTH[1] * D
        if self.requirements.height is not None:
            longest = np.clip(self.requirements.height, shortest, longest)
        L = shortest * np.exp(shares[:, 1] * np.log(longest / shortest))
        # near the least distances the fields are largest
        below, aside = (FARTHEST * D * shares[:, k] ** 2 for k in (2, 3))
        level = (LEVEL[0] + shares[:, 4] * (LEVEL[1] - LEVEL[0])) * (L - D / 2)
        return self.rounded(choices, np.column_stack([D, L, below, aside, level]), share)

    def rounded(self, choices: Ints, lengths: Array, share: Array | None = None) -> Candidates:
        """Return the candidates of the nearest printable lengths (n, 5)."""
        grid = np.round(lengths / ROUNDING)
        grid[:, 2:4] = np.maximum(grid[:, 2:4], 0)
        three, several = self.hall_parts["three"][choices[:, 2]], self.hall_parts["count"][choices[:, 2]] > 1
        grid[~(three | several), 3] = 0
        grid[~three, 4] = 0
        return Candidates(
            self, choices, np.round(grid * ROUNDING, 9), np.ones((len(grid), 2)) if share is None else share
        )


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """n candidates.

    Attributes
    ----------
    choices : indices of magnet, silicone and Hall part, shape (n, 3).
    lengths : D, L and the three places of the elements, see the module, shape (n, 5), mm.
    share : shares of the required forces in z and in x at which each candidate is rated, shape (n, 2).
    """

    space: Space
    choices: Ints
    lengths: Array
    share: Array

    def __len__(self) -> int:
        return len(self.choices)

    def take(self, rows: Any) -> Candidates:
        """Return some of the candidates."""
        return Candidates(self.space, self.choices[rows], self.lengths[rows], self.share[rows])

    def of(self, space: Space) -> Candidates:
        """Return them as candidates of a space with the same parts and other requirements, at the whole forces."""
        return dataclasses.replace(self, space=space, share=np.ones_like(self.share))

    def magnet(self, name: str) -> Array:
        return self.space.magnets[name][self.choices[:, 0]]

    def silicone(self, name: str) -> Array:
        return self.space.silicones[name][self.choices[:, 1]]

    def hall_part(self, name: str) -> Array:
        """Return what the Hall parts of the candidates have, see `_seat`, shape (n,)."""
        return self.space.hall_parts[name][self.choices[:, 2]]

    @property
    def three(self) -> NDArray[np.bool_]:
        return np.asarray(self.hall_part("three"))

    @property
    def D(self) -> Array:
        return self.lengths[:, 0]

    @property
    def L(self) -> Array:
        return self.lengths[:, 1]

    @property
    def H(self) -> Array:
        return self.L - self.D / 2

    def places(self) -> tuple[Array, Array, Array]:
        """Return l0, f and c of each candidate, shape (n,), mm; of chips, f is the radius of their circle, and c has
        no meaning."""
        fit, part = self.space.fit, SS495A
        roof = self.hall_part("roof")
        least = np.round(_raised(self.H + roof + WEB), 9)
        # the base compares without a tolerance
        least = np.where(self.H - least + roof > -WEB, least + ROUNDING, least)
        l0 = least + self.lengths[:, 2]
        beside = np.maximum.reduce(
            [self.D / 2, np.full(len(self), part.width / 2 + fit), np.full(len(self), part.height / 2 + fit + WEB)]
        )
        least = np.round(_raised(beside + part.depth + fit), 9)
        least = np.where(least - part.depth - fit < beside, least + ROUNDING, least)
        f = np.where(self.three, least, self.hall_part("circle")) + self.lengths[:, 3]
        return tuple(np.round(each, 9) for each in (l0, f, l0 - self.H + self.lengths[:, 4]))  # type: ignore[return-value]

    def circle(self) -> Array:
        """Return the places of the chips along x and y, shape (c, 2, n), mm, 0 for S1; where there are fewer than c,
        the first one is repeated."""
        radius, count = np.where(self.three, 0.0, self.places()[1]), self.hall_part("count")
        most = count.max(initial=1)
        table = {number: [places[k if k < number else 0] for k in range(most)] for number, places in CIRCLES.items()}
        at = np.array([table[number] for number in count.tolist()]).reshape(len(self), most, 2)
        return np.asarray(np.moveaxis(at, 0, -1) * radius)

    def beams(self) -> prediction.Beams:
        """Return the surrogate's answers for the beams."""
        lengths = (self.L, self.magnet("diameter"), self.magnet("height"))
        L, diameter, height = (each / self.D for each in lengths)
        return prediction.beams(L, diameter, height, self.silicone("nu"), self.magnet("edge_radius") / self.D)

    def outside(self) -> NDArray[Any]:
        """Return why each candidate is impossible, or outside the surrogate's range; "" where it is neither."""
        beams, low, high = self.beams(), self.space.low, self.space.high
        wall = self.D * surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge)
        reasons = beams.outside.copy()
        for k in np.flatnonzero((wall < LEAST_WALL - 1e-9) & (reasons == "")):
            reasons[k] = f"the silicone around the magnet must be at least {LEAST_WALL:g} mm thick; got {wall[k]:.4g}"
        for k in np.flatnonzero(np.abs(self.D - np.clip(self.D, low, high)) > 1e-9):
            reasons[k] = f"D must lie within {low:g} and {high:.4g} mm; got {self.D[k]:.4g}"
        return reasons

    def room(self) -> Array:
        """Return the pitch of arrays from which on pockets and recesses of neighbours are apart, shape (n,), mm."""
        is_round, places = self.space.requirements.base.is_round, np.moveaxis(self.circle(), 1, 0)
        x, y = (
            np.array([at - reach, at + reach])
            for at, reach in zip(places, (self.hall_part("reach_x"), self.hall_part("reach_y")), strict=True)
        )
        return least_pitch(x, y, self.D / 2 + (self.space.process.fit if is_round else 0.0), is_round=is_round)

    def sizes(self) -> tuple[Array, Array, Array]:
        """Return outer size, height and thinnest printed wall or pin, each of shape (n,), mm."""
        needed, process, fit, part = self.space.requirements, self.space.process, self.space.fit, SS495A
        choices = needed.base
        wall, three, (l0, f, _) = choices.seat_wall, self.three, self.places()
        s1, level = self.H - l0, self.lengths[:, 4]
        post = three & (level > 0)
        half = part.width / 2 + fit + np.where(post, wall, 0.0)
        far = f - part.depth + part.thickness + fit + np.where(post, wall, 0.0)
        # the seat of S1, or of each chip on the circle, and those of S2 and S3
        places = np.abs(np.moveaxis(self.circle(), 1, 0))
        x = np.vstack([self.hall_part("reach_x") + places[0], np.where(three, far, 0.0)])
        y = np.vstack([self.hall_part("reach_y") + places[1], np.where(three, half, 0.0)])
        foot = self.D / 2 + (process.fit if choices.is_round else 0.0)
        outer, _ = least_outline(x, y, foot, choices.hole, wall, choices.is_round)
        one_axis = np.maximum(THINNEST, least_thickness(s1, level))
        thickness = np.where(three, one_axis, self.hall_part("above_underside") - s1)
        roof = s1 + self.hall_part("roof") - fit
        top = np.maximum(roof, np.where(three, level + part.height / 2, -np.inf))
        height = np.maximum.reduce([self.L, top, np.full(len(self), 0.4 if choices.is_round else 0.0)]) + thickness
        printed = np.minimum(self.magnet("diameter"), process.wall)
        return 2 * outer, height, np.where(post, np.minimum(printed, wall), printed)

    def variant(self, k: int) -> Variant | str:
        """Return the variant of one candidate, or the reason why its design is impossible."""
        parts, needed = self.space.parts, self.space.requirements
        m, s, h = self.choices[k].tolist()
        magnet, silicone, part = parts.magnets[m], parts.silicones[s], parts.hall_parts[h]
        l0, f, c = (float(each[k]) for each in self.places())
        fields: dict[str, Any] = {**magnet.fields(), **silicone.fields(), **part_fields(part, needed)}
        fields |= {"D": float(self.D[k]), "L": float(self.L[k]), "l0": l0}
        fields |= silicone.loss_field()
        fields |= {"f": f, "c": c} if part.layout == "three" else {"chip_x": f}
        try:
            design = Design(**fields)
            plan(design, needed.base, needed.process)
        except BadInput as error:
            return str(error)
        return Variant(design, magnet, part, silicone)

    def keys(self) -> list[bytes]:
        """Return a key of each candidate, equal for equal ones."""
        table = np.column_stack([self.choices, np.round(self.lengths / ROUNDING), self.share])
        return [row.tobytes() for row in table]


def joined(groups: list[Candidates]) -> Candidates:
    """Return the candidates of several tables of one space."""
    return Candidates(
        groups[0].space,
        *(np.concatenate([getattr(each, name) for each in groups]) for name in ("choices", "lengths", "share")),
    )


def part_fields(part: HallPartEntry, requirements: Requirements) -> dict[str, Any]:
    """Return the fields of a `Design` with a Hall part, its noise and the converter that reads it."""
    average = max(part.average(requirements), 1)
    fields: dict[str, Any] = {"hall_average": float(average), **part.fields()}
    if part.layout == "three":
        fields |= {"hall_noise": requirements.converter_noise, "hall_step": requirements.converter_step}
        fields |= part.noise_fields(requirements.bandwidth, average)
    return fields


@functools.cache
def _seat(part: HallPartEntry, requirements: Requirements) -> dict[str, float]:
    """Return what a Hall part is and asks of the base, read from the plan of one that is deep enough for any part.

    Figures of its element; the height of its roof above the Hall plate, and that of this above the underside of the
    base; its reach along x and y; and the least radius of the chips' circle on the grid of the lengths, mm.
    """
    one = dataclasses.replace(part, count=1)
    design = Design(D=20.0, L=20.0, l0=40.0, f=40.0, c=20.0, **part_fields(one, requirements))
    made = plan(design, requirements.base, requirements.process)
    (body, *_), z = made.seats.bodies.values(), design.H - design.l0
    element = of_design(design)[0]
    x, y = (max(-body.corner[k], body.corner[k] + body.sides[k]) for k in (0, 1))
    radius = least_radius(part.count, 2 * x + WEB, 2 * y + WEB)
    return {
        "three": part.layout == "three",
        "count": part.count,
        "gain_drift": np.nan if part.gain_drift is None else part.gain_drift,
        "bandwidth": part.largest_bandwidth(requirements, int(design.hall_average)),
        **{name: getattr(element, name) for name in ("gain", "null", "low", "high", "noise_T", "plate")},
        "roof": body.corner[2] + body.sides[2] - z,
        "above_underside": made.thickness + z,
        "reach_x": x,
        "reach_y": y,
        "circle": math.ceil(radius / ROUNDING - 1e-6) * ROUNDING,
    }


def _raised(value: Array) -> Array:
    """Return the next multiples of `ROUNDING` at or above values."""
    return np.asarray(np.ceil(value / ROUNDING - 1e-4) * ROUNDING)
