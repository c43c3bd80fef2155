"""The design of the sensor: one frozen `Design` with a scalar field for each property, checked on creation.

Units and the sensor's frame are in README.md of this package. The magnet's north pole points down (Chathuranga et al.
2016, section II.B), so the magnetisation points along -z.
"""

import dataclasses
import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

from geometry.bad_input import BadInput as BadInput
from geometry.bad_input import in_range, known_fields, nearest, no_effect, quantity, words
from geometry.hall_chips import CHIPS, CIRCLES, OWN, HallChip, least_radius

__all__ = ["PRESETS", "BadInput", "Design", "Shape", "paper", "preset", "preset_table"]

LEAST_WALL = 0.1
"""Least thickness of silicone between the magnet and any outer face, mm: a design below it is refused."""


LAWS: dict[str, tuple[str, ...]] = {
    "neo-hookean": (),
    "mooney-rivlin": ("mooney_share",),
    "yeoh": ("yeoh_2", "yeoh_3"),
    "ogden": ("ogden_alpha1", "ogden_alpha2", "ogden_share"),
}
"""Material laws of the silicone, each with the fields of `Design` that it uses besides E and nu.

These fields are dimensionless. E and nu fix the stiffness at small strain in every law.
"""

SILICONE_E = (0.01, 20.0)
"""Young's moduli of silicones, MPa: from castable gels softer than Shore 00-10 (0.05 MPa) to Shore A 90, 20.9 MPa by
Gent's formula (1958), E = 0.0981 (56 + 7.66 S) / (0.137505 (254 - 2.54 S))."""

HALL_LAYOUTS = ("three", *CHIPS, OWN)
"""Three one-axis Hall elements S1, S2 and S3, or one to three 3-axis chips at the height of S1."""

POLES = {"down": 1.0, "up": -1.0}
"""Where the magnet's north pole can point, with the sign of its polarisation along -z: down is towards the base."""

REFERENCE_TEMPERATURE, KELVIN = 20.0, 273.15
"""Temperature at which E, the remanence and the gains of a design hold, C, as data sheets of magnets state theirs
(IEC 60404-8-1); and 0 C, K."""
HOT_MAGNET = 80.0
"""Largest working temperature of the standard grades of NdFeB, C: above it a magnet may lose remanence for good."""

OF_MAGNET = ("remanence", "remanence_drift", "magnet_north", "magnet_density")
"""Fields that have no effect without a magnet.

`magnet_edge_radius` is not listed: its default of 0.1 mm may stay when the magnet is removed.
"""

OF_MODULUS = ("E", "temperature")
"""Fields on which the mechanics depend by the modulus at the temperature alone (`Design.E_now`)."""

OF_TIME = ("loss_factor", "loss_low", "loss_high", "prony", "modulus")
"""Fields of the relaxation (see `geometry.relaxation`), which have no effect on a static state."""

LEAST_ALPHA = 0.01
"""Least magnitude of an exponent of Ogden's law: the energy divides by the exponent, so 0 is impossible."""


def modulus_at(E: Any, temperature: Any) -> Any:
    """Return the Young's modulus of a rubber at a temperature, C, from E at the reference temperature.

    The stress of a rubber is that of the entropy of its chains, so that its modulus is proportional to the absolute
    temperature (Treloar, The Physics of Rubber Elasticity, 1975, chapter 4): 0.34 % per K at 20 C. This holds far
    above the glass transition (-125 C of polydimethylsiloxane), where a silicone does not crystallise (below about
    -45 C) or age (above about 200 C): the bounds of `Design.temperature`. Fillers, whose network softens with the
    temperature, make it less. Loss factor and branches are taken as independent of the temperature. Arrays broadcast.

    >>> modulus_at(1.0, 20.0), round(modulus_at(1.0, 60.0), 4)
    (1.0, 1.1364)
    """
    return E * ((temperature + KELVIN) / (REFERENCE_TEMPERATURE + KELVIN))


def no_numbers(law: str) -> str:
    """Return the sentence on a law whose numbers are at their defaults.

    >>> no_numbers("yeoh")
    'the law yeoh without its numbers is the law neo-hookean: set yeoh_2 or yeoh_3'
    """
    return f"the law {law} without its numbers is the law neo-hookean: set {' or '.join(LAWS[law])}"


def _choice(default: str, choices: Iterable[str], text: str, **about: Any) -> Any:
    return field(default=default, metadata={"unit": "1", "choices": tuple(choices), "text": text, **about})


def _words(default: str, text: str, *, assumed: bool) -> Any:
    # free text: its metadata have neither a range nor choices
    return field(default=default, metadata={"unit": "1", "text": text, "assumed": assumed})


@dataclass(frozen=True, slots=True)
class Shape:
    """The lengths of the beam and of the magnet, all in one arbitrary unit of length.

    Attributes
    ----------
    D, L : diameter and total length of the beam.
    magnet_diameter, magnet_height, magnet_edge_radius : size of the magnet; a diameter of 0 means no magnet.
    """

    D: float
    L: float
    magnet_diameter: float
    magnet_height: float
    magnet_edge_radius: float

    @property
    def R(self) -> float:
        """Radius of the beam and of the hemispherical tip."""
        return self.D / 2

    @property
    def H(self) -> float:
        """Height of the hemisphere's centre, which is the magnet's centre."""
        return self.L - self.D / 2

    def plate_height(self, depth: float, plate_tilt: float = 0.0) -> float:
        """Return the height on the axis of a plate that was pressed down from first touch, tilted by an angle, rad.

        A tilted plate touches the tip off the axis first, while it is higher on the axis.
        """
        return self.L - depth + self.R * (1 / math.cos(plate_tilt) - 1)

    @property
    def has_magnet(self) -> bool:
        return self.magnet_diameter > 0

    @property
    def wall(self) -> float:
        """Least thickness of silicone around the magnet (above, beside and below); infinite without a magnet.

        >>> round(Shape(8, 9, 4, 2, 0).wall, 12) == round(4 - 5**0.5, 12)
        True
        """
        if not self.has_magnet:
            return math.inf
        a, b, rho = self.magnet_diameter / 2, self.magnet_height / 2, self.magnet_edge_radius
        # the point of the magnet closest to the dome lies on the fillet, whose centre is (a - rho, b - rho) from H
        return min(self.R - math.hypot(a - rho, b - rho) - rho, self.R - a, self.H - b)

    def scaled(self, factor: float) -> Self:
        """Return the similar shape with every length multiplied by `factor`."""
        return type(self)(*(factor * value for value in dataclasses.astuple(self)))

    def without_magnet(self) -> Self:
        """Return the beam of the same D and L, all of silicone."""
        return type(self)(self.D, self.L, 0.0, 0.0, 0.0)


@known_fields
@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A sensor. All fields are floats, except names (`law`, `magnet_north`, `hall_layout`, `modulus`) and `prony`.

    E, the remanence and the gains are those at 20 C (`REFERENCE_TEMPERATURE`). Mechanics, field and readings take
    `E_now`, `polarisation` and `hall_gain_now`, which are those at the `temperature`. Lengths do not change with it:
    silicone expands by 0.03 % per K, which would move the magnet of the paper's sensor by 2 um per K. Nulls and noise
    of the elements stay, too.

    `prony` lists measured Prony branches "g:tau g:tau ...", tau in s; see `geometry.relaxation`. The metadata of a
    field give its unit, its range or its choices, and a description. `assumed` is True where the paper gives no value
    for the default, and `later` for fields that labels of older files lack (see `geometry.design_digest`).

    Raises
    ------
    BadInput
        A field is not a finite number or lies outside its range, a name is unknown, or fields contradict each other:
        the magnet does not fit the beam, for example.

    >>> Design(L=3.0)
    Traceback (most recent call last):
        ...
    geometry.bad_input.BadInput: L must exceed the tip radius D/2 = 4 mm; got 3 mm
    """

    D: float = quantity(8.0, "mm", 0.1, 200, "diameter of the beam", assumed=False)
    L: float = quantity(9.0, "mm", 0.05, 4000, "total length of the beam, tip included", assumed=False)
    f: float = quantity(5.0, "mm", 0.01, 1000, "distance of S2 and S3 from the axis", assumed=False)
    E: float = quantity(
        1.0, "MPa", 1e-4, 1e4, "Young's modulus of the silicone at small strain, at 20 C", assumed=False
    )
    nu: float = quantity(
        0.4998, "1", 0.0, 0.5, "Poisson's ratio (0.4998: bulk modulus 0.83 GPa at E = 1 MPa)", assumed=True
    )
    law: str = _choice("neo-hookean", LAWS, f"law of the silicone: {', '.join(LAWS)}", assumed=True)
    mooney_share: float = quantity(0.0, "1", 0.0, 1.0, "Mooney-Rivlin: C01 / (C10 + C01)", assumed=True)
    yeoh_2: float = quantity(0.0, "1", -100, 100, "Yeoh: C20 / C10", assumed=True)
    yeoh_3: float = quantity(0.0, "1", -100, 100, "Yeoh: C30 / C10", assumed=True)
    ogden_alpha1: float = quantity(2.0, "1", -30, 30, "Ogden: first exponent", assumed=True)
    ogden_alpha2: float = quantity(-2.0, "1", -30, 30, "Ogden: second exponent", assumed=True)
    ogden_share: float = quantity(0.0, "1", 0.0, 1.0, "Ogden: mu_2 / (mu_1 + mu_2)", assumed=True)
    magnet_diameter: float = quantity(4.0, "mm", 0.0, 200, "diameter of the magnet (0: none)", assumed=False)
    magnet_height: float = quantity(2.0, "mm", 0.0, 200, "height of the magnet (0: none)", assumed=True)
    magnet_edge_radius: float = quantity(0.1, "mm", 0.0, 100, "radius of the magnet's two edges", assumed=True)
    remanence: float = quantity(1.2, "T", 1e-3, 2.0, "J = mu0 M of the magnet, at 20 C", assumed=True)
    remanence_drift: float = quantity(
        -0.12, "percent/K", -0.5, 0.5, "change of the remanence by the temperature (NdFeB)", assumed=True, later=True,
        slider=(-0.2, 0.05),
    )  # fmt: skip
    magnet_north: str = _choice(
        "down", POLES, "north pole of the magnet: down (to the base) or up", assumed=False, later=True
    )
    density: float = quantity(1080, "kg/m3", 1, 25000, "density of the silicone", assumed=True)
    magnet_density: float = quantity(7500, "kg/m3", 1, 25000, "density of the magnet (NdFeB)", assumed=True)
    l0: float = quantity(7.2, "mm", 0.0, 1000, "distance from S1 up to the magnet's centre at rest", assumed=True)
    c: float = quantity(2.0, "mm", -1000, 1000, "height of S2 and S3 above S1", assumed=True)
    hall_gain: float = quantity(31.25, "V/T", 1e-3, 1e6, "gain of a Hall element (SS495A)", assumed=True)
    hall_gain_drift: float = quantity(
        0.02, "percent/K", -0.5, 0.5, "change of this gain by the temperature (SS495A)", assumed=True, later=True,
        slider=(-0.2, 0.2),
    )  # fmt: skip
    hall_null: float = quantity(2.5, "V", 0.0, 100, "output of a Hall element in zero field", assumed=True)
    hall_low: float = quantity(0.2, "V", 0.0, 100, "lower rail of a Hall element's output", assumed=True)
    hall_high: float = quantity(4.8, "V", 0.0, 100, "upper rail of a Hall element's output", assumed=True)
    hall_noise: float = quantity(0.0, "V", 0.0, 10, "noise (rms) of a Hall element's output", assumed=True)
    hall_noise_density: float = quantity(0.0, "V/sqrt(Hz)", 0.0, 1, "white noise of the output", assumed=True)
    hall_bandwidth: float = quantity(1000.0, "Hz", 1e-3, 1e9, "noise bandwidth of one sample", assumed=True)
    hall_noise_floor: float = quantity(0.0, "V", 0.0, 10, "noise (rms) that no average reduces", assumed=True)
    hall_average: float = quantity(1.0, "1", 1, 1e6, "number of samples that each reading averages", assumed=True)
    hall_step: float = quantity(0.0, "V", 0.0, 10, "step of the analog-to-digital converter (0: none)", assumed=True)
    hall_plate: float = quantity(
        0.0, "mm", 0.0, 10, "side of a Hall element's square plate (0: a point)", assumed=True
    )
    hall_layout: str = _choice(
        "three",
        HALL_LAYOUTS,
        "three: one-axis elements S1, S2, S3; else 3-axis chips l0 below the magnet",
        assumed=False,
    )
    chip_x: float = quantity(
        0.0, "mm", -1000, 1000, "distance of a 3-axis chip from the beam's axis, along x", assumed=False
    )
    chip_count: float = quantity(
        1.0,
        "1",
        1,
        max(CIRCLES),
        "number of 3-axis chips, evenly on a circle of radius chip_x",
        assumed=False,
        later=True,
    )
    chip_noise: float = quantity(
        0.0, "T", 0.0, 1, "noise (rms) of a chip's value (0: its data sheet's)", assumed=True
    )
    chip_range: float = quantity(0.1, "T", 1e-6, 10, "full scale of the layout chip", assumed=True)
    chip_step: float = quantity(0.0, "T", 0.0, 1, "one count of the layout chip", assumed=True)
    chip_length: float = quantity(3.0, "mm", 0.1, 50, "footprint of the layout chip along x", assumed=True)
    chip_width: float = quantity(3.0, "mm", 0.1, 50, "footprint of the layout chip along y", assumed=True)
    chip_height: float = quantity(1.0, "mm", 0.05, 20, "height of the layout chip over its board", assumed=True)
    chip_plate: float = quantity(0.5, "mm", 0.0, 20, "height of its sensitive volume over the board", assumed=True)
    silicone: str = _words("", "name of the silicone, for the recipe (empty: none is named)", assumed=False)
    loss_factor: float = quantity(0.1, "1", 0.0, 1.0, "tan(delta) of the silicone (0: elastic)", assumed=True)
    loss_low: float = quantity(0.01, "Hz", 1e-6, 1e6, "least frequency with this loss factor", assumed=True)
    loss_high: float = quantity(1000.0, "Hz", 1e-6, 1e6, "greatest frequency with this loss factor", assumed=True)
    prony: str = _words("", "measured branches g:tau g:tau ..., tau in s (empty: loss_factor holds)", assumed=True)
    modulus: str = _choice(
        "long-term", ("long-term", "instantaneous"), "which modulus E is, at rest or after a step", assumed=True
    )
    temperature: float = quantity(
        20.0, "degC", -40, 200, "temperature of silicone, magnet and Hall elements", assumed=True, later=True,
        slider=(-20, 80),
    )  # fmt: skip

    def __post_init__(self) -> None:
        # a sweep makes a million designs: nearly all values are floats in their range, which need no conversion
        for (spec, low, high), value in zip(_RANGES, _VALUES(self), strict=True):
            if not (type(value) is float and low <= value <= high):
                object.__setattr__(self, spec.name, _checked(spec, value))
        if not self.L > self.D / 2:
            raise BadInput(f"L must exceed the tip radius D/2 = {self.D / 2:g} mm; got {self.L:g} mm")
        if not self.L <= 20 * self.D:
            raise BadInput(f"L must not exceed 20 D = {20 * self.D:g} mm; got {self.L:g} mm")
        if not self.hall_low < self.hall_null < self.hall_high:
            raise BadInput(
                "hall_low, hall_null and hall_high must rise; got "
                f"{self.hall_low:g}, {self.hall_null:g} and {self.hall_high:g} V"
            )
        if not self.loss_low < self.loss_high:
            raise BadInput(f"loss_low must be less than loss_high = {self.loss_high:g} Hz; got {self.loss_low:g} Hz")
        if not self.chip_plate <= self.chip_height:
            raise BadInput(
                f"chip_plate must not exceed chip_height = {self.chip_height:g} mm; got {self.chip_plate:g} mm"
            )
        for name, what in (("hall_average", "samples"), ("chip_count", "chips")):
            if getattr(self, name) % 1:
                raise BadInput(f"{name} must be a whole number of {what}; got {getattr(self, name):g}")
        for name, alpha in (("ogden_alpha1", self.ogden_alpha1), ("ogden_alpha2", self.ogden_alpha2)):
            if not abs(alpha) >= LEAST_ALPHA:
                raise BadInput(f"{name} must be at least {LEAST_ALPHA:g} or at most -{LEAST_ALPHA:g}; got {alpha:g}")
        self._check_magnet()
        if self.element_count > 3:
            length, width, _ = self.chip.body
            least = least_radius(int(self.chip_count), length, width)
            if not abs(self.chip_x) >= least - 1e-9:
                raise BadInput(
                    f"chip_x must be at least {math.ceil(1e3 * least) / 1e3:g} mm, or {self.chip_count:g} chips of "
                    f"{length:g} x {width:g} mm overlap; got {self.chip_x:g} mm"
                )

    def _check_magnet(self) -> None:
        if (self.magnet_diameter == 0) != (self.magnet_height == 0):
            raise BadInput(
                "magnet_diameter and magnet_height must both be positive, or both 0 for no magnet; got "
                f"{self.magnet_diameter:g} and {self.magnet_height:g} mm"
            )
        if self.magnet_diameter == 0:
            return
        widest = min(self.magnet_diameter, self.magnet_height) / 2
        if not self.magnet_edge_radius <= widest:
            raise BadInput(
                f"magnet_edge_radius must not exceed half the magnet's smaller side = {widest:g} mm; "
                f"got {self.magnet_edge_radius:g} mm"
            )
        wall = self.shape.wall
        if not wall >= LEAST_WALL - 1e-9:
            raise BadInput(
                f"the magnet ({self.magnet_diameter:g} x {self.magnet_height:g} mm) leaves "
                f"{wall:.3g} mm of silicone around it and needs at least {LEAST_WALL:g} mm: "
                "take a smaller magnet or a larger D or L"
            )
        if not self.l0 > self.magnet_height / 2:
            raise BadInput(
                f"l0 must exceed half the magnet's height = {self.magnet_height / 2:g} mm; got {self.l0:g} mm"
            )

    @property
    def R(self) -> float:
        """Radius of the beam and of the hemispherical tip, mm."""
        return self.D / 2

    @property
    def H(self) -> float:
        """Height of the magnet's centre above the base, mm."""
        return self.L - self.D / 2

    @property
    def polarisation(self) -> float:
        """Polarisation of the magnet along -z, T: the remanence, negative if the north pole points up."""
        return POLES[self.magnet_north] * self.remanence_now

    @property
    def E_now(self) -> float:
        """Young's modulus at the temperature, MPa, with which all mechanics are: see `modulus_at`.

        >>> Design().E_now, round(Design(temperature=60.0).E_now, 4)
        (1.0, 1.1364)
        """
        return float(modulus_at(self.E, self.temperature))

    @property
    def remanence_now(self) -> float:
        """Remanence at the temperature, T, reversible and linear: J (1 + drift (T - 20 C)).

        Sintered NdFeB loses 0.12 % per K between 20 C and its working temperature (tables of grades of Arnold and
        Shanghai magnet; 0.09 to 0.13 by alloy), SmCo 0.03 to 0.045 %, ferrite 0.2 %. Losses above the working
        temperature, which stay, are not modelled.

        >>> Design().remanence_now, round(Design(temperature=60.0).remanence_now, 4)
        (1.2, 1.1424)
        """
        return self.remanence * self._drifted(self.remanence_drift)

    @property
    def hall_gain_now(self) -> float:
        """Gain of an element at the temperature: of a one-axis element in V/T, of a chip over that at 20 C.

        That of a chip stays: data sheets state how far it drifts, to either side (`geometry.hall_chips`).

        >>> Design(temperature=60.0).hall_gain_now, Design(hall_layout="tmag5273a1", temperature=60.0).hall_gain_now
        (31.5, 1.0)
        """
        return self.hall_gain * self._drifted(self.hall_gain_drift) if self.hall_layout == "three" else 1.0

    def _drifted(self, drift: float) -> float:
        """Return a value over that at the reference temperature; drift in percent per K."""
        return 1 + drift / 100 * (self.temperature - REFERENCE_TEMPERATURE)

    @property
    def shape(self) -> Shape:
        """The lengths of beam and magnet, mm."""
        return Shape(self.D, self.L, self.magnet_diameter, self.magnet_height, self.magnet_edge_radius)

    @property
    def element_count(self) -> int:
        """Number of Hall elements: three, or the three axes of each chip."""
        return 3 if self.hall_layout == "three" else 3 * int(self.chip_count)

    @property
    def chip(self) -> HallChip:
        """The 3-axis chip of a layout that has one; a `chip_noise` above 0 replaces what its data sheet states.

        >>> Design(hall_layout="mlx90393").chip.noise, Design(hall_layout="chip", chip_noise=2e-6).chip.noise
        (None, 2e-06)
        """
        noise = self.chip_noise or None
        if self.hall_layout == OWN:
            body = self.chip_length, self.chip_width, self.chip_height
            return HallChip("chip", self.chip_range, self.chip_step, body, self.chip_plate, noise)
        chip = CHIPS[self.hall_layout]
        return chip if noise is None else dataclasses.replace(chip, noise=noise, rate=None)

    @property
    def law_numbers(self) -> tuple[float, ...]:
        """The dimensionless parameters of the law, in the order of `LAWS`."""
        return tuple(getattr(self, name) for name in LAWS[self.law])

    def for_mechanics(self, magnet: str) -> Self:
        """Return the design whose mechanics are the same.

        A magnet that is `ignored` is silicone, and a law whose numbers are those of neo-Hookean silicone is that law.

        >>> Design(law="yeoh").for_mechanics("rigid") == Design()
        True
        """
        changed: dict[str, Any] = {}
        if magnet == "ignored" and self.magnet_diameter > 0:
            changed = {"magnet_diameter": 0.0, "magnet_height": 0.0}
        if self.is_neo_hookean and self.law != "neo-hookean":
            changed["law"] = "neo-hookean"
        return dataclasses.replace(self, **changed) if changed else self

    @property
    def is_neo_hookean(self) -> bool:
        """Whether the law's numbers are at their defaults, at which every law is the neo-Hookean one."""
        return self.law_numbers == tuple(_DEFAULTS[name] for name in LAWS[self.law])

    def unused_fields(self) -> dict[str, str]:
        """Return the names of the fields that have no effect in this design, each with the reason.

        >>> Design(law="yeoh", hall_layout="tmag5273a1").unused_fields()["hall_noise"]
        'hall_layout is tmag5273a1'
        """
        used = OF_ONE_LAYOUT[self.hall_layout]
        reasons = {name: f"the law is {self.law}" for law, names in LAWS.items() if law != self.law for name in names}
        for names in OF_ONE_LAYOUT.values():
            reasons |= {name: f"hall_layout is {self.hall_layout}" for name in names if name not in used}
        if not self.hall_noise_density:
            reasons = {"hall_bandwidth": "hall_noise_density is 0"} | reasons
        if self.prony:
            reasons |= dict.fromkeys(("loss_factor", "loss_low", "loss_high"), "prony is given")
        elif not self.loss_factor:
            reasons |= dict.fromkeys(("loss_low", "loss_high", "modulus"), "loss_factor is 0")
        return reasons if self.shape.has_magnet else reasons | dict.fromkeys(OF_MAGNET, "magnet_diameter is 0")

    def unused_field_warnings(self) -> list[str]:
        """Return one sentence for each reason why fields that differ from their defaults have no effect."""
        names_by_reason: dict[str, list[str]] = {}
        for name, reason in self.unused_fields().items():
            # a field at its default was probably not set by the user: no warning
            if getattr(self, name) != _DEFAULTS[name]:
                names_by_reason.setdefault(reason, []).append(name)
        return [no_effect(names, reason) for reason, names in names_by_reason.items()]

    def warnings(self, *, base_limits_l0: bool = False) -> list[str]:
        """Return warnings about a sensor that can be computed but not built, or that is probably not intended.

        base_limits_l0 : True where the caller names the larger limit that the base sets to l0, so that the limit of
            the beam is left out.
        """
        texts = []
        s1, s23 = self.H - self.l0, self.H - self.l0 + self.c
        chip = self.hall_layout != "three"
        if s1 > 0 and not base_limits_l0 and not (chip and abs(self.chip_x) >= self.R):
            name = "the chip" if chip else "S1"
            texts.append(
                f"{name} would lie inside the beam, {s1:.3g} mm above the base: raise l0 above {self.H:g} mm"
            )
        if chip:
            pass
        elif s23 > 0 and not self.f > self.R:
            texts.append(f"S2 and S3 would lie inside the beam: raise f above D/2 = {self.R:g} mm")
        elif s23 > -self.D / 8 and self.f - self.R < self.D / 8 * (1 - 1e-9):
            texts.append(
                f"only {self.f - self.R:.3g} mm separate S2 and S3 from the beam's wall: a sheared beam may touch "
                f"them; raise f"
            )
        if self.L > 3 * self.D:
            texts.append(f"L/D = {self.L / self.D:.3g}: a beam this slender may buckle sideways under a plate")
        return [*texts, *self.value_warnings()]

    def value_warnings(self) -> list[str]:
        """Return warnings for every use of the design: fields without effect, or an E that no silicone has."""
        texts = self.unused_field_warnings()
        if self.law != "neo-hookean" and self.is_neo_hookean:
            texts.append(no_numbers(self.law))
        if self.modulus == "instantaneous":
            from geometry.relaxation import relaxation_of

            rest = relaxation_of(self).rest
            if rest < 1:
                note = f"static solves take E as it stands; at rest a force is {rest:.3g} times as large"
                texts.append(f"modulus is instantaneous: {note}")
        if self.hall_layout != "three" and self.chip.noise is None:
            texts.append(
                f"the noise of {self.chip.name} is unknown: resolutions count its step alone and are too fine; "
                "set chip_noise"
            )
        if self.hall_layout != "three" and self.temperature != REFERENCE_TEMPERATURE:
            drift, warmer = self.chip.gain_drift, abs(self.temperature - REFERENCE_TEMPERATURE)
            far = "by an unknown amount" if drift is None else f"by up to {100 * abs(drift) * warmer:.2g} %"
            texts.append(
                f"the gain of {self.chip.name} may have drifted {far} to either side at {self.temperature:g} C: "
                f"it is taken as that at {REFERENCE_TEMPERATURE:g} C"
            )
        if self.shape.has_magnet and self.temperature > HOT_MAGNET:
            texts.append(
                f"temperature is {self.temperature:g} C: standard grades of NdFeB work up to {HOT_MAGNET:g} C, above "
                "which they may lose remanence for good, which is not modelled"
            )
        if not SILICONE_E[0] <= self.E <= SILICONE_E[1]:
            texts.append(
                f"E = {self.E:g} MPa is outside the range of silicones, {SILICONE_E[0]:g} MPa (gels) to "
                f"{SILICONE_E[1]:g} MPa (Shore A 90): check that E is given in MPa"
            )
        return texts


_NAMES = [spec.name for spec in dataclasses.fields(Design)]
_DEFAULTS = {spec.name: spec.default for spec in dataclasses.fields(Design)}
OF_ONE_LAYOUT: dict[str, tuple[str, ...]] = {
    "three": ("f", "c", *(n for n in _NAMES if n.startswith("hall_") and n not in ("hall_layout", "hall_average"))),
    **dict.fromkeys(CHIPS, ("chip_x", "chip_count", "chip_noise")),
    OWN: tuple(n for n in _NAMES if n.startswith("chip_")),
}
"""For each layout, the fields that only some layouts use: a chip with a name has the figures of its data sheet."""

OF_READINGS = tuple(
    name
    for name in _NAMES
    if name.startswith(("hall_", "chip_")) or name in ("f", "l0", "c", "remanence", "remanence_drift", "magnet_north")
)
"""Fields on which readings depend, and mechanics do not."""
_RANGES = tuple(
    (spec, spec.metadata.get("low", math.nan), spec.metadata.get("high", math.nan))
    for spec in dataclasses.fields(Design)
)
"""The fields of a design, each with its least and largest value; NaN for a name."""
_VALUES = attrgetter(*_NAMES)
"""Returns the values of all fields of a design."""


def _checked(spec: dataclasses.Field[Any], value: object) -> float | str:
    """Return the value of a field as a float or as a name; raise BadInput if its type or its range is wrong."""
    if "choices" in spec.metadata:
        choices = spec.metadata["choices"]
        if not isinstance(value, str):
            raise BadInput(f"{spec.name} must be one of the names {', '.join(choices)}; got {value!r}")
        if value not in choices:
            raise BadInput(f"there is no {spec.name} {value!r}: {nearest(value, choices)}")
        return value
    if "low" not in spec.metadata:
        if not isinstance(value, str):
            raise BadInput(f"{spec.name} must be a text ({spec.metadata['text']}); got {value!r}")
        if value and spec.name == "prony":
            from geometry.relaxation import parse_branches

            parse_branches(value)
        return words(spec.name, value)
    return in_range(spec, value)


def paper(**fields: Any) -> Design:
    """Return the sensor of Chathuranga et al., IEEE Sensors Journal 2016; what the paper leaves open is assumed.

    The assumed magnet height, remanence and l0 reproduce the paper's output of S1 at rest, 2.87 V.

    fields : those that differ from it.

    >>> paper(L=20.0).L
    20.0
    """
    return Design(**fields)


_FILES = sorted(
    Path(__file__).with_name("presets").glob("*.toml"), key=lambda file: (file.stem != "paper", file.stem)
)
PRESETS = {file.stem: file for file in _FILES}
"""The design files that are shipped, by their names: the paper's sensor, and best variants of `magtip size`.

Their tables beside the fields say how the sensor is made, and what was required of it.
"""


def preset_table(name: str) -> dict[str, Any]:
    """Return the table of a shipped design file: fields, and the tables beside them."""
    if name not in PRESETS:
        raise BadInput(f"there is no preset {name!r}: {nearest(name, PRESETS)}")
    return tomllib.loads(PRESETS[name].read_text("utf-8"))


def preset(name: str, **fields: Any) -> Design:
    """Return the design of a preset.

    fields : those that differ from it.

    >>> preset("paper").D, preset("paper", D=9.0).D
    (8.0, 9.0)
    """
    stated = {key: value for key, value in preset_table(name).items() if key in _DEFAULTS}
    return Design(**{**stated, **fields})
