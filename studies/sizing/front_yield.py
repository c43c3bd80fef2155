"""Yield of a variant: the share of made sensors that meet all requirements, and which requirement fails most.

Each made sensor has its own E, Poisson's ratio, magnet, displaced parts, gains and offsets (`made_sensors`), drawn
within the ranges of the catalogues. Its mechanics come from the surrogate, its readings from its own parts. It counts
as calibrated by itself: deviations change what it can reach, and are no errors of its forces. The magnet's place in
the silicone changes the readings only.

A yield is uncertain for two reasons: the number of sensors is finite (`low` to `high`), and the surrogate has errors
(`worse` to `better`: all values at the worse, and at the better ends of its 90 % intervals).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from studies.output.records import FlatRow
from studies.sensitivity.made_sensors import MadeSensors, Tolerances, made_sensors, share_with_error
from studies.sizing.candidate_performance import MadeReader, performance
from studies.sizing.variant_search import beams_of

if TYPE_CHECKING:
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.requirements import Requirements

SENSORS = 1000
"""Number of made sensors: a share of 90 % is then known to 2 points."""
MAGNET_DIGITS = 2
"""Decimals of a made magnet's size, mm: magnets of equal size share the computation of their fields."""
ALL = "all"
"""Stands for all requirements together."""
IMPOSSIBLE = "possible"
"""Stands for the requirement that a made sensor is possible, and within the range of the surrogate."""


@dataclass(frozen=True, slots=True)
class Yield:
    """Yield of a variant.

    Attributes
    ----------
    count, passed : made sensors, and those that meet all requirements.
    low, high : 95 % interval of the share from the number of sensors alone (Clopper and Pearson).
    worse, better : shares at the worse and at the better ends of the surrogate's intervals, by requirement; the first
        is that of all together.
    missed : number of sensors that miss each requirement, the most frequent one first.
    quantiles : 5 %, 50 % and 95 % quantiles of the margins of each requirement.
    """

    count: int
    passed: int
    low: float
    high: float
    worse: Mapping[str, float]
    better: Mapping[str, float]
    missed: Mapping[str, int]
    quantiles: Mapping[str, tuple[float, float, float]]

    @property
    def share(self) -> float:
        """Share of the sensors that meet all requirements, 0 to 1."""
        return self.passed / self.count

    @property
    def uncertainty(self) -> str:
        """Both parts of the uncertainty of the share, as a text."""
        sampling = f"95 % interval from the number of sensors {100 * self.low:.3g} to {100 * self.high:.3g} %"
        ends = f"{100 * self.worse[ALL]:.3g} and {100 * self.better[ALL]:.3g} %"
        return f"{sampling}; at the ends of the surrogate's 90 % intervals {ends}"

    def rows(self) -> list[FlatRow]:
        """Return the rows of yield.csv: all requirements together, and each by itself."""
        rows: list[FlatRow] = [self._row(ALL, self.count - self.passed)]
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
        ends = {
            "surrogate_worse_percent": 100 * self.worse[name],
            "surrogate_better_percent": 100 * self.better[name],
        }
        return {"requirement": name, **numbers, "low_percent": 100 * low, "high_percent": 100 * high} | ends


def tolerances_of(variant: Variant) -> Tolerances:
    """Return the tolerances of a variant's parts but for `ranges_of`; places and tilts have their defaults."""
    magnet, gain = variant.magnet, 100 * variant.hall_part.gain_tolerance
    return Tolerances(
        magnet_diameter=magnet.tolerance,
        magnet_height=magnet.tolerance,
        hall_gain=gain,
        chip_gain=gain,
    )


def ranges_of(variant: Variant) -> dict[str, tuple[float, float]]:
    """Return the ranges of the catalogue for E, nu and the remanence.

    The range of E is that over the sources, which disagree: it is wider than that of one supplier's batches.
    """
    silicone, magnet = variant.silicone, variant.magnet
    return {
        "E": (silicone.E_low, silicone.E_high),
        "nu": (silicone.nu_low, silicone.nu_high),
        "remanence": (magnet.remanence_low, magnet.remanence_high),
    }


def yield_of(variant: Variant, requirements: Requirements, count: int = SENSORS, seed: int = 0) -> Yield:
    """Return the yield of a variant."""
    drawn = made_sensors(variant.design, tolerances_of(variant), count, seed, ranges=ranges_of(variant))
    sensors = _rounded(drawn)
    table, worse, better = (_margins(variant, sensors, requirements, caution) for caution in (0.0, 1.0, -1.0))
    met = {name: values >= 0 for name, values in table.items()}
    passed = int(np.all(list(met.values()), axis=0).sum())
    missed = {name: int((~values).sum()) for name, values in met.items()}
    _, low, high = share_with_error(passed, count)
    quantiles: dict[str, tuple[float, float, float]] = {}
    for name, values in table.items():
        least, middle, most = np.nanquantile(values, [0.05, 0.5, 0.95]).tolist()
        quantiles[name] = least, middle, most
    order = sorted(missed, key=lambda name: -missed[name])
    ordered = {name: missed[name] for name in order}
    return Yield(count, passed, low, high, _shares(worse), _shares(better), ordered, quantiles)


def _shares(margins: Mapping[str, Array]) -> dict[str, float]:
    """Return the shares of sensors that meet all requirements, and each of them."""
    met = {name: values >= 0 for name, values in margins.items()}
    return {name: float(np.mean(one)) for name, one in ({ALL: np.all(list(met.values()), axis=0)} | met).items()}


def _margins(variant: Variant, sensors: MadeSensors, requirements: Requirements, caution: float) -> dict[str, Array]:
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
    result = performance(variants, beams, requirements, caution=caution, reader=MadeReader(sensors))
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
