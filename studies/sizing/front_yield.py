"""Yield of a variant: the share of made sensors that meet all requirements, and which requirement fails most.

Each made sensor has its own E, Poisson's ratio, magnet, displaced parts, gains and offsets (`made_sensors`), drawn
within the ranges of the catalogues. Its mechanics come from the surrogate, its readings from its own parts. It counts
as calibrated by itself: deviations change what it can reach, and are no errors of its forces. The magnet's place in
the silicone changes the readings only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from studies.output.records import FlatRow
from studies.sensitivity.made_sensors import MadeSensors, made_sensors, share_with_error
from studies.sensitivity.tolerances import Tolerances
from studies.sizing.candidate_performance import performance
from studies.sizing.pose_readings import MadeReader
from studies.sizing.variant_search import beams_of

if TYPE_CHECKING:
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.requirements import Requirements

SENSORS = 1000
"""Number of made sensors: a share of 90 % is then known to 2 points."""
MAGNET_DIGITS = 2
"""Decimals of a made magnet's size, mm: magnets of equal size share the computation of their fields."""
IMPOSSIBLE = "possible"
"""Stands for the requirement that a made sensor is possible, and within the range of the surrogate."""


@dataclass(frozen=True, slots=True)
class Yield:
    """Yield of a variant.

    Attributes
    ----------
    count, passed : made sensors, and those that meet all requirements.
    low, high : 95 % interval of the share (Clopper and Pearson).
    missed : number of sensors that miss each requirement, the most frequent one first.
    quantiles : 5 %, 50 % and 95 % quantiles of the margins of each requirement.
    """

    count: int
    passed: int
    low: float
    high: float
    missed: Mapping[str, int]
    quantiles: Mapping[str, tuple[float, float, float]]

    @property
    def share(self) -> float:
        """Share of the sensors that meet all requirements, 0 to 1."""
        return self.passed / self.count

    def rows(self) -> list[FlatRow]:
        """Return the rows of yield.csv: all requirements together, and each by itself."""
        rows: list[FlatRow] = [self._row("all", self.count - self.passed)]
        for name, missed in self.missed.items():
            low, middle, high = (100 * value for value in self.quantiles.get(name, (np.nan,) * 3))
            rows.append(
                self._row(name, missed)
                | {"margin_5_percent": low, "margin_50_percent": middle, "margin_95_percent": high}
            )
        return rows

    def _row(self, name: str, missed: int) -> FlatRow:
        share, low, high = share_with_error(self.count - missed, self.count)
        numbers = {"sensors": self.count, "within": self.count - missed, "within_percent": 100 * share}
        return {"requirement": name, **numbers, "low_percent": 100 * low, "high_percent": 100 * high}


def tolerances_of(variant: Variant) -> Tolerances:
    """Return the tolerances that the ranges of a variant's parts mean; places and tilts have their defaults.

    The range of E is that over the sources, which disagree: it is wider than that of one supplier's batches.
    """
    silicone, magnet, part = variant.silicone, variant.magnet, variant.hall_part
    deviation = max(silicone.E_high / silicone.E - 1, 1 - silicone.E_low / silicone.E)
    remanence = (magnet.remanence_high - magnet.remanence_low) / (2 * magnet.remanence)
    gain = 100 * part.gain_tolerance
    return Tolerances(
        E=min(100 * deviation, 90.0),
        remanence=100 * remanence,
        magnet_diameter=magnet.tolerance,
        magnet_height=magnet.tolerance,
        hall_gain=gain,
        chip_gain=gain,
    )


def yield_of(variant: Variant, requirements: Requirements, count: int = SENSORS, seed: int = 0) -> Yield:
    """Return the yield of a variant."""
    table = _margins(
        variant, _rounded(made_sensors(variant.design, tolerances_of(variant), count, seed)), requirements
    )
    met = {name: values >= 0 for name, values in table.items()}
    passed = int(np.all(list(met.values()), axis=0).sum())
    missed = {name: int((~values).sum()) for name, values in met.items()}
    _, low, high = share_with_error(passed, count)
    quantiles: dict[str, tuple[float, float, float]] = {}
    for name, values in table.items():
        least, middle, most = np.nanquantile(values, [0.05, 0.5, 0.95]).tolist()
        quantiles[name] = least, middle, most
    order = sorted(missed, key=lambda name: -missed[name])
    return Yield(count, passed, low, high, {name: missed[name] for name in order}, quantiles)


def _margins(variant: Variant, sensors: MadeSensors, requirements: Requirements) -> dict[str, Array]:
    """Return the margins of made sensors, each of shape (n,); those of an impossible sensor are -1."""
    made = [design or sensors.nominal for design in sensors.designs]
    variants = [
        dataclasses.replace(
            variant,
            design=design,
            silicone=dataclasses.replace(variant.silicone, E_low=design.E, E_high=design.E),
        )
        for design in made
    ]
    beams = beams_of(variants)
    possible = np.array([each is not None for each in sensors.designs]) & (beams.outside == "")
    # an impossible sensor has no readings: the nominal one takes its place, and its margins are replaced
    result = performance(variants, beams, requirements, caution=0.0, reader=MadeReader(sensors))
    margins = {name: np.where(possible, values, -1.0) for name, values in result.margins.items()}
    # base and mould are those of the nominal design
    for name in ("outer_size", "height", "wall", "clearance"):
        margins.pop(name, None)
    return margins | {IMPOSSIBLE: np.where(possible, 1.0, -1.0)}


def _rounded(sensors: MadeSensors) -> MadeSensors:
    """Return made sensors whose magnets have rounded sizes."""
    designs = tuple(
        design
        and dataclasses.replace(
            design,
            magnet_diameter=round(design.magnet_diameter, MAGNET_DIGITS),
            magnet_height=round(design.magnet_height, MAGNET_DIGITS),
        )
        for design in sensors.designs
    )
    return dataclasses.replace(sensors, designs=designs)
