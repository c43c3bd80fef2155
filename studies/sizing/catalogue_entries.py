"""Entries of catalogues: magnets, Hall parts and silicones that are sold, with ranges and sources."""

from __future__ import annotations

import math
from dataclasses import dataclass

FILTER = math.pi / 2
"""Bandwidth of white noise over the -3 dB bandwidth of a low pass of first order."""


@dataclass(frozen=True, slots=True)
class MagnetEntry:
    """A cylindrical magnet that is sold, magnetised along its axis.

    Attributes
    ----------
    diameter, height, edge_radius : mm. tolerance : of diameter and height, +- mm.
    remanence_low, remanence_high : range of the grade, T.
    largest_temperature : °C. density : kg/m³.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

    name: str
    grade: str
    diameter: float
    height: float
    edge_radius: float
    tolerance: float
    remanence_low: float
    remanence_high: float
    largest_temperature: float
    density: float
    source: str
    assumed: tuple[str, ...]

    @property
    def remanence(self) -> float:
        """Middle of the range of the remanence, T."""
        return (self.remanence_low + self.remanence_high) / 2

    def fields(self) -> dict[str, float]:
        """Return the fields of a `Design` with this magnet."""
        return {
            "magnet_diameter": self.diameter,
            "magnet_height": self.height,
            "magnet_edge_radius": self.edge_radius,
            "remanence": self.remanence,
            "magnet_density": self.density,
        }


@dataclass(frozen=True, slots=True)
class HallPartEntry:
    """A Hall part that is sold: one-axis parts, of which a sensor has three, or a 3-axis chip.

    Attributes
    ----------
    layout : `hall_layout` of the designs with this part.
    gain, null, low, high : gain, V/T, output in zero field and rails, V; of a chip in T (gain 1).
    gain_tolerance : largest relative deviation of the gain.
    noise_density : white noise of the input up to `bandwidth`, T/sqrt(Hz); None for a chip.
    noise : rms of one output value of a chip, T; None for a one-axis part.
    bandwidth : -3 dB, Hz; None for a chip.
    step : step of a chip's converter, T. plate : side of the Hall plate, mm.
    width, height, thickness : body, mm; None for a chip, whose body the base knows.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

    name: str
    layout: str
    gain: float
    gain_tolerance: float
    null: float
    low: float
    high: float
    noise_density: float | None
    noise: float | None
    bandwidth: float | None
    step: float
    plate: float
    width: float | None
    height: float | None
    thickness: float | None
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float | str]:
        """Return the fields of a `Design` with this part, but for its noise: see `noise_fields`."""
        if self.layout != "three":
            return {"hall_layout": self.layout}
        values = {"gain": self.gain, "null": self.null, "low": self.low, "high": self.high, "plate": self.plate}
        return {"hall_layout": "three", **{f"hall_{name}": value for name, value in values.items()}}

    def noise_fields(self, bandwidth: float | None = None) -> dict[str, float]:
        """Return the fields of a `Design` for the part's white noise; none for a chip, whose noise the layout has.

        Parameters
        ----------
        bandwidth : -3 dB of a low pass of first order before the converter, Hz; default: that of the part, which is
            also the largest.
        """
        if self.noise_density is None or self.bandwidth is None:
            return {}
        band = self.bandwidth if bandwidth is None else min(bandwidth, self.bandwidth)
        return {"hall_noise_density": self.gain * self.noise_density, "hall_bandwidth": FILTER * band}


@dataclass(frozen=True, slots=True)
class SiliconeEntry:
    """A castable silicone.

    Attributes
    ----------
    E_low, E, E_high : least, typical and largest published Young's modulus at small strain, MPa.
    nu_low, nu, nu_high : Poisson's ratio. density : kg/m³.
    cure_temperature, cure_hours : of the data sheet without an oven, °C and h.
    mixed : ratio of the parts.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

    name: str
    E_low: float
    E: float
    E_high: float
    nu_low: float
    nu: float
    nu_high: float
    density: float
    cure_temperature: float
    cure_hours: float
    mixed: str
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float]:
        """Return the fields of a `Design` of this silicone, with its typical E and nu."""
        return {"E": self.E, "nu": self.nu, "density": self.density}


@dataclass(frozen=True, slots=True)
class Catalogues:
    """The parts from which a sensor is sized, none of them empty."""

    magnets: tuple[MagnetEntry, ...]
    hall_parts: tuple[HallPartEntry, ...]
    silicones: tuple[SiliconeEntry, ...]


Entry = MagnetEntry | HallPartEntry | SiliconeEntry
